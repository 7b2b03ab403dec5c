//! A point in 32 bits ([Neff2023] sec. 3.2): 1 allocated, 3 × 5 position in the cell, 2 × 4 normal, 8 visibility.

use glam::{Vec2, Vec3};

/// Steps of a position along one axis of a cell.
const STEPS: f32 = 32.0;
/// Steps of a normal's component to either side of zero, so that axes are exact.
const NORMAL_STEPS: f32 = 7.0;

/// Packs a point that lies at `position_cells` (in cells from the grid's corner) in `cell`.
pub(super) fn pack(position_cells: Vec3, cell: [u32; 3], normal: u32, visibility: u8) -> u32 {
    let step = |axis: usize| {
        let inside = position_cells[axis] - cell[axis] as f32;
        (inside * STEPS).clamp(0.0, STEPS - 1.0) as u32
    };
    1 << 31 | step(0) << 26 | step(1) << 21 | step(2) << 16 | normal << 8 | u32::from(visibility)
}

/// The same point with another value.
pub(super) fn with_visibility(word: u32, visibility: u8) -> u32 {
    word & !0xff | u32::from(visibility)
}

/// Visibility, 255 = open.
pub(super) fn visibility(word: u32) -> f32 {
    (word & 0xff) as f32
}

/// Where a point lies in its cell, 0 … 1 along each axis: the middle of its step.
pub(super) fn position_in_cell(word: u32) -> Vec3 {
    let step = |shift: u32| ((word >> shift & 31) as f32 + 0.5) / STEPS;
    Vec3::new(step(26), step(21), step(16))
}

/// A unit normal, octahedrally mapped, 4 bits a component.
pub(super) fn pack_normal(normal: Vec3) -> u32 {
    let mut p = Vec2::new(normal.x, normal.y) / (normal.x.abs() + normal.y.abs() + normal.z.abs());
    if normal.z < 0.0 {
        p = fold(p);
    }
    let nibble = |v: f32| (v * NORMAL_STEPS + NORMAL_STEPS).round().clamp(0.0, 2.0 * NORMAL_STEPS) as u32;
    nibble(p.x) << 4 | nibble(p.y)
}

/// The unit normal of a packed point.
pub(super) fn normal(word: u32) -> Vec3 {
    let component = |shift: u32| (word >> shift & 15) as f32 / NORMAL_STEPS - 1.0;
    let p = Vec2::new(component(12), component(8));
    let z = 1.0 - p.x.abs() - p.y.abs();
    let xy = if z < 0.0 { fold(p) } else { p };
    Vec3::new(xy.x, xy.y, z).normalize()
}

/// Mirrors a point of the outer triangles over the square's diagonal, and back.
fn fold(p: Vec2) -> Vec2 {
    let sign = |v: f32| if v < 0.0 { -1.0 } else { 1.0 };
    Vec2::new((1.0 - p.y.abs()) * sign(p.x), (1.0 - p.x.abs()) * sign(p.y))
}
