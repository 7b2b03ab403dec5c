//! glTF's metallic-roughness reflectance ([glTF2.0] appendix B.3).

use std::f32::consts::FRAC_1_PI;

use dapple_scene::{Material, Scene};
use glam::{Vec2, Vec3};

use super::Ambient;
use crate::texture::{self, Encoding};

/// Reflectance at normal incidence of all dielectrics (index of refraction 1.5).
const DIELECTRIC_F0: f32 = 0.04;
/// Smoother surfaces would show a point light as less than a sample.
const SMALLEST_ALPHA: f32 = 2e-3;

/// A material's reflectance at one place.
pub(super) struct Reflectance {
    /// Diffuse albedo.
    diffuse: Vec3,
    /// Fresnel reflectance at normal incidence.
    f0: Vec3,
    /// Squared perceptual roughness.
    alpha: f32,
    specular: bool,
}

impl Reflectance {
    pub(super) fn of(
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
    pub(super) fn reflected(&self, normal: Vec3, to_viewer: Vec3, to_light: Vec3) -> Vec3 {
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

    /// Radiance reflected from the surroundings, unoccluded; the diffuse part has `gathered` this much.
    pub(super) fn ambient(&self, ambient: &Ambient, gathered: Vec3, normal: Vec3, to_viewer: Vec3) -> Vec3 {
        // Irradiance π L times albedo / π.
        let diffuse = self.diffuse * gathered;
        if !self.specular {
            return diffuse;
        }
        let n_dot_v = normal.dot(to_viewer).clamp(0.0, 1.0);
        let mirrored = normal * (2.0 * normal.dot(to_viewer)) - to_viewer;
        // Schlick's Fresnel, its rise towards grazing limited by roughness.
        let grazing = Vec3::splat(1.0 - self.alpha).max(self.f0);
        let fresnel = self.f0 + (grazing - self.f0) * fifth_power(1.0 - n_dot_v);
        // A rough surface gathers from about its normal, a smooth one from the mirrored direction.
        let gathered = mirrored.lerp(normal, self.alpha.min(1.0)).normalize_or(normal);
        (Vec3::ONE - fresnel) * diffuse + fresnel * ambient.radiance(gathered)
    }
}

fn fifth_power(x: f32) -> f32 {
    let x2 = x * x;
    x2 * x2 * x
}
