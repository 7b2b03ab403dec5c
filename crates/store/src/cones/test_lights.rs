//! Lights with a closed form, over a place at the origin with its normal along +Z, for tests.

use std::f32::consts::PI;

use glam::Vec3;

use super::ConeSample;

/// A light of radiance 5 that shines on the origin.
#[derive(Clone, Copy, Debug)]
pub(super) enum Light {
    /// Centre and radius.
    Sphere(Vec3, f32),
    /// Coaxial with the normal: height and radius.
    Disc(f32, f32),
    /// Parallel to the surface, centred over it: height and half sides.
    Rectangle(f32, [f32; 2]),
}

/// Radiance of the lights.
pub(super) const RADIANCE: f32 = 5.0;

/// A number in 0 … 1 from a place, a sample and a dimension.
pub(super) fn uniform(place: u32, sample: u32, dimension: u32) -> f32 {
    let mut z = (u64::from(place) << 40 ^ u64::from(sample) << 8 ^ u64::from(dimension))
        .wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 40) as f32 / (1u64 << 24) as f32
}

impl Light {
    /// Lights and the irradiance they give.
    pub(super) fn closed_forms() -> [(Light, f32); 4] {
        let sphere = PI * RADIANCE * 0.25 / 4.0;
        let (sine, cosine) = (libm::sinf(75f32.to_radians()), libm::cosf(75f32.to_radians()));
        let disc = PI * RADIANCE / 2.0;
        // Four times the form factor of a quarter, seen from below its corner.
        let (a, b) = (2.5f32, 1.0f32);
        let (p, q) = ((1.0 + a * a).sqrt(), (1.0 + b * b).sqrt());
        let quarter = (a / p * libm::atanf(b / p) + b / q * libm::atanf(a / q)) / (2.0 * PI);
        [
            (Light::Sphere(Vec3::new(0.0, 0.0, 2.0), 0.5), sphere),
            (Light::Sphere(Vec3::new(2.0 * sine, 0.0, 2.0 * cosine), 0.5), sphere * cosine),
            (Light::Disc(1.0, 1.0), disc),
            (Light::Rectangle(1.0, [a, b]), 4.0 * quarter * PI * RADIANCE),
        ]
    }

    /// A sample by solid angle (sphere) or area, as irradiance or fluence; none below the horizon.
    pub(super) fn sample(&self, place: u32, index: u32, irradiance: bool) -> Option<ConeSample> {
        let u = [0, 1].map(|dimension| uniform(place, index, dimension));
        let turn = 2.0 * PI * u[1];
        let (direction, density) = match *self {
            Light::Sphere(centre, radius) => {
                let sine = radius / centre.length();
                let rim = (1.0 - sine * sine).sqrt();
                let z = 1.0 - u[0] * (1.0 - rim);
                let (tangent, bitangent) = centre.normalize().any_orthonormal_pair();
                let r = (1.0 - z * z).max(0.0).sqrt();
                let across = tangent * (r * libm::cosf(turn)) + bitangent * (r * libm::sinf(turn));
                ((across + centre.normalize() * z).normalize(), 1.0 / (2.0 * PI * (1.0 - rim)))
            }
            Light::Disc(height, radius) => {
                let r = radius * u[0].sqrt();
                let p = Vec3::new(r * libm::cosf(turn), r * libm::sinf(turn), height);
                (p.normalize(), by_area(p, PI * radius * radius))
            }
            Light::Rectangle(height, [a, b]) => {
                let p = Vec3::new((2.0 * u[0] - 1.0) * a, (2.0 * u[1] - 1.0) * b, height);
                (p.normalize(), by_area(p, 4.0 * a * b))
            }
        };
        let cosine = if irradiance { direction.z } else { 1.0 };
        let value = Vec3::splat(RADIANCE * cosine / density);
        (direction.z > 0.0).then_some(ConeSample { direction, value, light: 0, cosine: 1.0 })
    }
}

/// Density per steradian of an even choice on a surface that faces down.
fn by_area(p: Vec3, area: f32) -> f32 {
    p.length_squared() / (p.normalize().z * area)
}
