//! Shades G-buffer samples: what visibility multiplies (`ambient`) apart from what it never touches (`direct`).
//!
//! Takes a scene, pose, camera, G-buffer and shadow maps; returns two radiances a sample. Equations in the README.

mod brdf;
mod gathered;
mod light;
mod shadow;
#[cfg(test)]
mod tests;

use dapple_scene::{Pose, PosedCamera, Projection, Reflectance, Scene, ShadingPoint};
use glam::Vec3;
use rayon::prelude::*;

use crate::gbuffer::{GBuffer, Surface};
use crate::texture;
use brdf::reflected_ambient;
pub use gathered::{Gathering, Openings, shade_gathered};
pub use light::light_irradiance;
pub(crate) use light::{ActiveLight, active_lights};
#[cfg(all(test, feature = "gpu"))]
pub(crate) use shadow::SHADOW_FILTER;
#[cfg(feature = "gpu")]
pub(crate) use shadow::{Face, Lens, faces_of};
pub use shadow::{ShadowMaps, render_shadow_maps};

/// How to shade. The defaults suit scenes of white walls about 1 cd/m² bright.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShadeParams {
    /// Radiance from the surroundings; default a pale blue sky over a dim warm ground.
    pub ambient: Ambient,
    /// Radiance of samples that see nothing, linear RGB ≥ 0; default (0.05, 0.06, 0.08). Goes into `direct`.
    pub background: Vec3,
    /// Whether surfaces reflect like glTF materials (default). `false`: Lambert with the same diffuse albedo, no gloss.
    pub specular: bool,
    /// Whether a scene without placed lights gets a sun with a shadow, and a weak fill without (default).
    pub sun_without_lights: bool,
    /// Texels along a side of the shadow maps of directional and spot lights, 16 … 8192, default 2048; the six faces of
    /// a point light have half as many.
    pub shadow_resolution: u32,
    /// The first so many lights throw shadows, default 16; the others shine through everything. Bounds memory.
    pub max_shadowed_lights: u32,
}

impl Default for ShadeParams {
    fn default() -> Self {
        ShadeParams {
            ambient: Ambient::Hemisphere {
                sky: Vec3::new(0.36, 0.40, 0.46),
                ground: Vec3::new(0.17, 0.16, 0.15),
            },
            background: Vec3::new(0.05, 0.06, 0.08),
            specular: true,
            sun_without_lights: true,
            shadow_resolution: 2048,
            max_shadowed_lights: 16,
        }
    }
}

/// Radiance that arrives from the surroundings, the same everywhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ambient {
    /// Equal from all directions, linear RGB.
    Constant(Vec3),
    /// Changes with the height of the direction, in proportion to its y.
    Hemisphere {
        /// From straight above.
        sky: Vec3,
        /// From straight below.
        ground: Vec3,
    },
}

impl Ambient {
    /// Radiance about a unit direction: what an open surface gathers that looks there.
    pub fn radiance(&self, direction_world: Vec3) -> Vec3 {
        match *self {
            Ambient::Constant(radiance) => radiance,
            Ambient::Hemisphere { sky, ground } => ground.lerp(sky, 0.5 + 0.5 * direction_world.y),
        }
    }
}

/// Outgoing radiance of every sample of a G-buffer, in two parts.
#[derive(Clone, Debug, PartialEq)]
pub struct Shaded {
    /// Reflected from the surroundings: visibility multiplies this. Zero for background and unlit samples.
    pub ambient: Vec<Vec3>,
    /// Reflected from lights, emitted, unlit colour, background: visibility never touches this.
    pub direct: Vec<Vec3>,
}

/// Shades every sample. `shadow_maps` must be of the same scene and pose; lights without a map throw no shadow.
pub fn shade(
    scene: &Scene,
    pose: &Pose,
    camera: &PosedCamera,
    gbuffer: &GBuffer,
    shadow_maps: &ShadowMaps,
    params: &ShadeParams,
) -> Shaded {
    let lights = active_lights(scene, pose, params);
    let eye_world = camera.eye_world();
    let axis_world = camera.world_from_view.transform_vector3(Vec3::Z).normalize_or_zero();
    let shade_one = |i: usize| -> (Vec3, Vec3) {
        let Some(surface) = gbuffer.surface(scene, pose, i) else { return (Vec3::ZERO, params.background) };
        let to_viewer_world = match camera.projection {
            Projection::Perspective { .. } => (eye_world - surface.position_world).normalize_or_zero(),
            Projection::Orthographic { .. } => axis_world,
        };
        shade_surface(scene, &surface, to_viewer_world, &lights, shadow_maps, params)
    };
    let samples = (0..gbuffer.samples().len()).into_par_iter().with_min_len(1024);
    let (ambient, direct) = samples.map(shade_one).unzip();
    Shaded { ambient, direct }
}

/// Every sample of a G-buffer as a place to be shaded, in the order of the samples; `None` for the background and what has no material.
/// Unlit samples reflect nothing and emit their colour. For methods that bring light of their own.
pub fn shading_points(
    scene: &Scene,
    pose: &Pose,
    camera: &PosedCamera,
    gbuffer: &GBuffer,
    specular: bool,
) -> Vec<Option<ShadingPoint>> {
    let eye_world = camera.eye_world();
    let axis_world = camera.world_from_view.transform_vector3(Vec3::Z).normalize_or_zero();
    gbuffer.map_surfaces(scene, pose, |_, surface| {
        let surface = surface?;
        let to_viewer_world = match camera.projection {
            Projection::Perspective { .. } => (eye_world - surface.position_world).normalize_or_zero(),
            Projection::Orthographic { .. } => axis_world,
        };
        let material = scene.materials.get(surface.material as usize)?;
        let base_color = texture::base_color(scene, material, &surface.uv, surface.color).truncate();
        let mut reflectance = Reflectance::of(scene, material, &surface.uv, base_color, specular);
        let mut emitted = texture::emission(scene, material, &surface.uv);
        if material.unlit {
            reflectance = Reflectance { diffuse: Vec3::ZERO, f0: Vec3::ZERO, specular: false, ..reflectance };
            emitted = base_color;
        }
        Some(ShadingPoint {
            instance: surface.instance,
            position_world: surface.position_world,
            normal_world: surface.normal_world,
            normal_shading_world: surface.normal_shading_world,
            to_viewer_world,
            reflectance,
            emitted,
        })
    })
}

fn shade_surface(
    scene: &Scene,
    surface: &Surface,
    to_viewer_world: Vec3,
    lights: &[ActiveLight],
    shadow_maps: &ShadowMaps,
    params: &ShadeParams,
) -> (Vec3, Vec3) {
    let Some(material) = scene.materials.get(surface.material as usize) else {
        return (Vec3::ZERO, Vec3::ZERO);
    };
    let base_color = texture::base_color(scene, material, &surface.uv, surface.color).truncate();
    if material.unlit {
        return (Vec3::ZERO, base_color);
    }
    let reflectance = Reflectance::of(scene, material, &surface.uv, base_color, params.specular);
    let normal = surface.normal_shading_world;
    let gathered = params.ambient.radiance(normal);
    let ambient = reflected_ambient(&reflectance, &params.ambient, gathered, normal, to_viewer_world);
    let mut direct = texture::emission(scene, material, &surface.uv);
    for (i, light) in lights.iter().enumerate() {
        let arriving = light.arriving(surface.position_world);
        // Light from behind the true surface cannot reach it, whatever the interpolated normal says.
        let cosine = normal.dot(arriving.to_light);
        if cosine <= 0.0
            || surface.normal_world.dot(arriving.to_light) <= 0.0
            || arriving.intensity == Vec3::ZERO
        {
            continue;
        }
        let lit =
            shadow_maps.lit_fraction(i, surface.position_world, surface.normal_world, arriving.to_light);
        if lit > 0.0 {
            let reflected = reflectance.reflected(normal, to_viewer_world, arriving.to_light);
            direct += reflected * arriving.intensity * (cosine * lit);
        }
    }
    (ambient, direct)
}
