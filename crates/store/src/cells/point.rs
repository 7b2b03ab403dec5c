//! A point in 32 bits ([Neff2023] sec. 3.2): 1 allocated, 3 × 5 position in the cell, 2 × 4 normal, 8 visibility.

use glam::{Vec2, Vec3};

use crate::octahedral::{flatten, unflatten};

/// Steps of a normal's component to either side of zero, so that axes are exact.
const NORMAL_STEPS: f32 = 7.0;

/// One packed point: bit 31 allocated, bits 16 to 30 place in the cell (x uppermost), 8 to 15 normal, 0 to 7 visibility.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PackedPoint(pub u32);

impl PackedPoint {
    /// A place without a point.
    pub const FREE: PackedPoint = PackedPoint(0);
    /// Steps of a position along one axis of a cell.
    pub const STEPS: f32 = 32.0;

    /// Packs a point that lies at `position_cells` (in cells from the grid's corner) in `cell`; what lies outside the cell is
    /// held at its border. `normal` is from [`pack_normal`], `visibility` 255 where open.
    pub fn pack(position_cells: Vec3, cell: [u32; 3], normal: u8, visibility: u8) -> PackedPoint {
        let step = |axis: usize| {
            let inside = position_cells[axis] - cell[axis] as f32;
            (inside * Self::STEPS).clamp(0.0, Self::STEPS - 1.0) as u32
        };
        let place = step(0) << 26 | step(1) << 21 | step(2) << 16;
        PackedPoint(1 << 31 | place | u32::from(normal) << 8 | u32::from(visibility))
    }

    /// Whether there is a point.
    pub fn is_allocated(self) -> bool {
        self.0 >> 31 == 1
    }

    /// The same point with another value.
    pub fn with_visibility(self, visibility: u8) -> PackedPoint {
        PackedPoint(self.0 & !0xff | u32::from(visibility))
    }

    /// Visibility, 255 = open.
    pub fn visibility(self) -> u8 {
        self.0 as u8
    }

    /// Where it lies in its cell, 0 … 1 along each axis: the middle of its step.
    pub fn position_in_cell(self) -> Vec3 {
        let step = |shift: u32| ((self.0 >> shift & 31) as f32 + 0.5) / Self::STEPS;
        Vec3::new(step(26), step(21), step(16))
    }

    /// Its unit normal.
    pub fn normal(self) -> Vec3 {
        unpack_normal((self.0 >> 8) as u8)
    }
}

/// A unit normal, octahedrally mapped, 4 bits a component in −7 … 7. At most 17.2° off. A zero vector packs as +Z.
pub fn pack_normal(normal: Vec3) -> u8 {
    let p = flatten(normal);
    let nibble = |v: f32| (v * NORMAL_STEPS + NORMAL_STEPS).round().clamp(0.0, 2.0 * NORMAL_STEPS) as u8;
    nibble(p.x) << 4 | nibble(p.y)
}

/// The unit normal of [`pack_normal`]'s bits; every pattern gives one.
pub fn unpack_normal(bits: u8) -> Vec3 {
    let component = |nibble: u8| f32::from(nibble.min(14)) / NORMAL_STEPS - 1.0;
    unflatten(Vec2::new(component(bits >> 4), component(bits & 15)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_packed_point_keeps_what_it_has_room_for(
            x in 0f32..1.0, y in 0f32..1.0, z in 0f32..1.0,
            nx in -1f32..1.0, ny in -1f32..1.0, nz in -1f32..1.0, visibility: u8, other: u8,
        ) {
            prop_assume!(Vec3::new(nx, ny, nz).length() > 1e-3);
            let n = Vec3::new(nx, ny, nz).normalize();
            let cell = [3, 0, 9];
            let inside = Vec3::new(x, y, z);
            let point = PackedPoint::pack(inside + Vec3::new(3.0, 0.0, 9.0), cell, pack_normal(n), visibility);
            prop_assert!(point.is_allocated());
            prop_assert!((point.position_in_cell() - inside).abs().max_element() <= 0.5 / 32.0 + 1e-5);
            // Seven steps to a side: 17.2 degrees at the worst, about (5, 5, 4).
            prop_assert!(point.normal().dot(n) > 0.955, "{} became {}", n, point.normal());
            prop_assert_eq!(point.visibility(), visibility);
            let changed = point.with_visibility(other);
            prop_assert_eq!(changed.visibility(), other);
            prop_assert_eq!(changed.0 >> 8, point.0 >> 8);
        }

        #[test]
        fn what_lies_outside_its_cell_is_held_at_the_border(x in -9f32..9.0) {
            let point = PackedPoint::pack(Vec3::new(x, 0.5, 0.5), [0; 3], 0, 0);
            let expected = x.clamp(0.0, 1.0);
            prop_assert!((point.position_in_cell().x - expected).abs() <= 0.5 / 32.0 + 1e-5);
        }

        #[test]
        fn every_pattern_is_a_point_with_a_unit_normal(bits: u32) {
            let point = PackedPoint(bits);
            prop_assert!((point.normal().length() - 1.0).abs() < 1e-5);
            prop_assert!(point.position_in_cell().cmple(Vec3::ONE).all());
        }
    }

    #[test]
    fn bits_lie_where_they_are_said_to_lie() {
        // 5 bits a coordinate: ⌊0.5 · 32⌋ = 16, ⌊0.25 · 32⌋ = 8, 0; +Z is the middle (7, 7) of the octahedral map.
        let point = PackedPoint::pack(Vec3::new(2.5, 1.25, 4.0), [2, 1, 4], pack_normal(Vec3::Z), 200);
        assert_eq!(point.0, 1 << 31 | 16 << 26 | 8 << 21 | 7 << 12 | 7 << 8 | 200);
        for axis in [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z] {
            assert!(unpack_normal(pack_normal(axis)).distance(axis) < 1e-6, "{axis}");
        }
        assert_eq!(pack_normal(Vec3::ZERO), pack_normal(Vec3::Z));
    }
}
