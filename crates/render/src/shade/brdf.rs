//! What glTF's metallic-roughness reflectance returns of light from all around.

use dapple_scene::Reflectance;
use glam::Vec3;

use super::Ambient;

/// Radiance reflected from the surroundings, unoccluded; the diffuse part has `gathered` this much.
pub(super) fn reflected_ambient(
    reflectance: &Reflectance,
    ambient: &Ambient,
    gathered: Vec3,
    normal: Vec3,
    to_viewer: Vec3,
) -> Vec3 {
    // Irradiance π L times albedo / π.
    let diffuse = reflectance.diffuse * gathered;
    if !reflectance.specular {
        return diffuse;
    }
    let n_dot_v = normal.dot(to_viewer).clamp(0.0, 1.0);
    let mirrored = normal * (2.0 * normal.dot(to_viewer)) - to_viewer;
    // Schlick's Fresnel, its rise towards grazing limited by roughness.
    let grazing = Vec3::splat(1.0 - reflectance.alpha).max(reflectance.f0);
    let fresnel = reflectance.f0 + (grazing - reflectance.f0) * fifth_power(1.0 - n_dot_v);
    // A rough surface gathers from about its normal, a smooth one from the mirrored direction.
    let gathered = mirrored.lerp(normal, reflectance.alpha.min(1.0)).normalize_or(normal);
    (Vec3::ONE - fresnel) * diffuse + fresnel * ambient.radiance(gathered)
}

fn fifth_power(x: f32) -> f32 {
    let x2 = x * x;
    x2 * x2 * x
}
