//! Bent normals in 16 bits: from where light comes to a point, relative to its normal.

use glam::Vec3;

use super::PackedNormal;

/// A unit vector of a point's open hemisphere, in rest space: its components along the tangents of [`orthonormal_basis`] of the
/// point's unpacked normal, in 127ths around 128. The component along the normal is what is left, and not negative.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct BentNormal(pub [u8; 2]);

/// The two bytes of all points, each in a list of its own.
pub type BentPlanes = [Vec<u8>; 2];

/// A point's new bent normal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BentChange {
    /// Index of the point in the store.
    pub point: u32,
    /// Bent normal before.
    pub old: BentNormal,
    /// Bent normal now.
    pub new: BentNormal,
}

impl Default for BentNormal {
    fn default() -> Self {
        BentNormal::UNBENT
    }
}

impl BentNormal {
    /// The normal itself.
    pub const UNBENT: BentNormal = BentNormal([128; 2]);

    /// Packs a direction (of any length; zero is the normal itself). What lies below the surface is brought to it.
    pub fn pack(direction_rest: Vec3, normal: PackedNormal) -> BentNormal {
        let normal = normal.unpack();
        let (tangent, bitangent) = orthonormal_basis(normal);
        let [x, y, z] = [tangent, bitangent, normal].map(|axis| direction_rest.dot(axis));
        let Some(local) = Vec3::new(x, y, z.max(0.0)).try_normalize() else { return BentNormal::UNBENT };
        let byte = |c: f32| ((c * 127.0).round() as i32 + 128).clamp(1, 255) as u8;
        BentNormal([byte(local.x), byte(local.y)])
    }

    /// The unit vector. Every bit pattern gives one.
    pub fn unpack(self, normal: PackedNormal) -> Vec3 {
        let normal = normal.unpack();
        if self == BentNormal::UNBENT {
            // Just that, without rounding.
            return normal;
        }
        let (tangent, bitangent) = orthonormal_basis(normal);
        let [x, y] = self.0.map(|byte| (f32::from(byte) - 128.0) / 127.0);
        let z = (1.0 - x * x - y * y).max(0.0).sqrt();
        (tangent * x + bitangent * y + normal * z).normalize_or(normal)
    }
}

/// Unit tangent and bitangent of a unit normal, so that `(tangent, bitangent, normal)` is right-handed.
///
/// Branchless \[Duff2017\] ("Building an Orthonormal Basis, Revisited", JCGT 6 (1), 2017); jumps only across the plane
/// z = 0.
pub fn orthonormal_basis(normal: Vec3) -> (Vec3, Vec3) {
    let sign = 1.0_f32.copysign(normal.z);
    let a = -1.0 / (sign + normal.z);
    let b = normal.x * normal.y * a;
    let tangent = Vec3::new(1.0 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x);
    (tangent, Vec3::new(b, sign + normal.y * normal.y * a, -normal.y))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f32::consts::SQRT_2;

    use glam::Vec2;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_pattern_is_a_unit_vector_above_the_surface(bent: [u8; 2], normal: [u8; 2]) {
            let normal = PackedNormal(normal);
            let direction = BentNormal(bent).unpack(normal);
            prop_assert!((direction.length() - 1.0).abs() < 1e-5);
            prop_assert!(direction.dot(normal.unpack()) > -1e-5);
        }

        #[test]
        fn unpack_is_near_what_was_packed(normal: [u8; 2], x in -1f32..1.0, y in -1f32..1.0, z in 0.05f32..1.0) {
            let normal = PackedNormal(normal);
            let (tangent, bitangent) = orthonormal_basis(normal.unpack());
            let local = Vec3::new(x, y, z).normalize();
            let direction = tangent * local.x + bitangent * local.y + normal.unpack() * local.z;
            let back = BentNormal::pack(direction * 7.0, normal).unpack(normal);
            prop_assert!(back.dot(normal.unpack()) > -1e-5);
            let back = Vec2::new(back.dot(tangent), back.dot(bitangent));
            // Half a step along each tangent. What rounds out of the unit disc is brought back to its edge, which is nearer.
            let error = (back - local.truncate()).length();
            prop_assert!(error < 0.5 * SQRT_2 / 127.0 + 1e-5, "{direction} is off by {error}");
        }
    }

    #[test]
    fn the_normal_and_nothing_are_unbent_and_what_is_below_grazes() {
        for byte in 0..=255 {
            let normal = PackedNormal([byte, 255 - byte]);
            assert_eq!(BentNormal::pack(normal.unpack(), normal), BentNormal::UNBENT);
            assert_eq!(BentNormal::pack(Vec3::ZERO, normal), BentNormal::UNBENT);
            assert_eq!(BentNormal::UNBENT.unpack(normal), normal.unpack());
        }
        let up = PackedNormal::pack(Vec3::Z);
        let below = BentNormal::pack(Vec3::new(1.0, 0.0, -3.0), up);
        assert!(below.unpack(up).distance(Vec3::X) < 1e-3);
    }
}
