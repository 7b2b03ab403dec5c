//! glTF's metallic-roughness reflectance ([glTF2.0] appendix B.3), and places on surfaces that are ready to be shaded with it.
//!
//! Shared by both ends: what a server judges its rays with is what a client draws with. Equations in `render/src/shade/README.md`.

use std::f32::consts::FRAC_1_PI;

use glam::{Vec2, Vec3};

use crate::texture::{self, Encoding};
use crate::{Material, Scene};

/// Reflectance at normal incidence of all dielectrics (index of refraction 1.5).
const DIELECTRIC_F0: f32 = 0.04;
/// Smoother surfaces would show a point light as less than a sample.
const SMALLEST_ALPHA: f32 = 2e-3;

/// A material's reflectance at one place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reflectance {
    /// Diffuse albedo.
    pub diffuse: Vec3,
    /// Fresnel reflectance at normal incidence.
    pub f0: Vec3,
    /// Squared perceptual roughness, at least 0.002.
    pub alpha: f32,
    /// Whether there is gloss; without, the surface is Lambert's.
    pub specular: bool,
}

/// A place on a surface as one viewer sees it, with all that shading needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShadingPoint {
    /// Index into [`Scene::instances`].
    pub instance: u32,
    /// Metres.
    pub position_world: Vec3,
    /// Unit normal of the triangle, on the viewer's side.
    pub normal_world: Vec3,
    /// Unit normal that the surface is shaded with, within 90° of the other.
    pub normal_shading_world: Vec3,
    /// Unit vector to the viewer.
    pub to_viewer_world: Vec3,
    /// What it reflects.
    pub reflectance: Reflectance,
    /// Radiance that it emits itself.
    pub emitted: Vec3,
}

impl ShadingPoint {
    /// Radiance that goes to the viewer of light that arrives from a unit direction, with cosine: 0 from behind the true surface, whatever
    /// the interpolated normal says.
    pub fn reflected(&self, to_light_world: Vec3) -> Vec3 {
        let cosine = self.normal_shading_world.dot(to_light_world);
        if cosine <= 0.0 || self.normal_world.dot(to_light_world) <= 0.0 {
            return Vec3::ZERO;
        }
        self.reflectance.reflected(self.normal_shading_world, self.to_viewer_world, to_light_world) * cosine
    }

    /// What of the radiance that leaves towards the viewer is reflected: all but what it emits itself, never below 0.
    pub fn reflected_of(&self, radiance: Vec3) -> Vec3 {
        (radiance - self.emitted).max(Vec3::ZERO)
    }
}

impl Reflectance {
    /// Of a material where its texture coordinates are `uv`, with the linear base colour there; `specular: false` leaves the gloss out.
    pub fn of(
        scene: &Scene,
        material: &Material,
        uv: &[Vec2; 2],
        base_color: Vec3,
        specular: bool,
    ) -> Reflectance {
        let (mut metallic, mut roughness) = (material.metallic_factor, material.roughness_factor);
        if let Some(texture) = &material.metallic_roughness_texture {
            let texel = texture::sample(scene, texture, uv, Encoding::Linear);
            metallic *= texel.z;
            roughness *= texel.y;
        }
        Reflectance {
            diffuse: base_color * (1.0 - metallic),
            f0: Vec3::splat(DIELECTRIC_F0).lerp(base_color, metallic),
            alpha: (roughness * roughness).max(SMALLEST_ALPHA),
            specular,
        }
    }

    /// BRDF, 1/sr, for unit directions to the viewer and the light.
    pub fn reflected(&self, normal: Vec3, to_viewer: Vec3, to_light: Vec3) -> Vec3 {
        if !self.specular {
            return self.diffuse * FRAC_1_PI;
        }
        let half = (to_viewer + to_light).normalize_or_zero();
        let v_dot_h = to_viewer.dot(half).clamp(0.0, 1.0);
        let n_dot_h = normal.dot(half).clamp(0.0, 1.0);
        // Interpolated normals may turn away from the viewer.
        let n_dot_v = normal.dot(to_viewer).clamp(1e-3, 1.0);
        let n_dot_l = normal.dot(to_light).clamp(1e-3, 1.0);
        let fresnel = self.f0 + (Vec3::ONE - self.f0) * fifth_power(1.0 - v_dot_h);
        let specular = self.distribution(n_dot_h) * self.visibility(n_dot_v, n_dot_l);
        (Vec3::ONE - fresnel) * self.diffuse * FRAC_1_PI + fresnel * specular
    }

    /// D: GGX (Trowbridge–Reitz).
    fn distribution(&self, n_dot_h: f32) -> f32 {
        let a2 = self.alpha * self.alpha;
        // (n·h)² (α² − 1) + 1, without the cancellation for smooth surfaces.
        let f = (1.0 - n_dot_h) * (1.0 + n_dot_h) + n_dot_h * n_dot_h * a2;
        a2 * FRAC_1_PI / (f * f)
    }

    /// V = G / (4 n·l n·v): height-correlated Smith.
    fn visibility(&self, n_dot_v: f32, n_dot_l: f32) -> f32 {
        let a2 = self.alpha * self.alpha;
        let lambda = |a: f32, b: f32| a * (b * b * (1.0 - a2) + a2).sqrt();
        0.5 / (lambda(n_dot_l, n_dot_v) + lambda(n_dot_v, n_dot_l))
    }
}

fn fifth_power(x: f32) -> f32 {
    let x2 = x * x;
    x2 * x2 * x
}
