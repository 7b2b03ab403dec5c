//! Unit normals in 16 bits (octahedral map, 8 bits a component).

use glam::{Vec2, Vec3};

use crate::octahedral::{flatten, unflatten};

/// A unit vector, octahedrally mapped, 8 bits a component: at most 1.0° off.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PackedNormal(pub [u8; 2]);

impl PackedNormal {
    /// Packs a unit vector. A zero vector packs as +Z.
    pub fn pack(normal: Vec3) -> PackedNormal {
        let p = flatten(normal);
        let byte = |v: f32| ((v * 127.0).round() as i32 + 127).clamp(0, 254) as u8;
        PackedNormal([byte(p.x), byte(p.y)])
    }

    /// The unit vector. Every bit pattern gives one.
    pub fn unpack(self) -> Vec3 {
        let component = |b: u8| (f32::from(b.min(254)) - 127.0) / 127.0;
        unflatten(Vec2::new(component(self.0[0]), component(self.0[1])))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn unpack_is_within_one_degree(x in -1f32..1.0, y in -1f32..1.0, z in -1f32..1.0) {
            let v = Vec3::new(x, y, z);
            prop_assume!(v.length() > 1e-3);
            let n = v.normalize();
            let back = PackedNormal::pack(n).unpack();
            prop_assert!((back.length() - 1.0).abs() < 1e-5);
            prop_assert!(n.dot(back) > 1.0f32.to_radians().cos(), "{n} became {back}");
        }

        #[test]
        fn every_pattern_is_a_unit_vector(a: u8, b: u8) {
            let n = PackedNormal([a, b]).unpack();
            prop_assert!((n.length() - 1.0).abs() < 1e-5);
        }
    }

    #[test]
    fn axes_are_exact() {
        for axis in [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z] {
            assert!(PackedNormal::pack(axis).unpack().distance(axis) < 1e-6, "{axis}");
        }
    }
}
