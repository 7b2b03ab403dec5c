//! Unit vectors on a square: the octahedral map, in single precision.

use glam::{Vec2, Vec3};

/// A unit vector as a place in the square −1 … 1, at the octahedron's point that it passes. A vector without a direction becomes +Z.
pub fn flatten(normal: Vec3) -> Vec2 {
    let sum = normal.x.abs() + normal.y.abs() + normal.z.abs();
    if sum.is_nan() || sum <= 0.0 {
        return Vec2::ZERO;
    }
    let p = Vec2::new(normal.x, normal.y) / sum;
    if normal.z < 0.0 { fold(p) } else { p }
}

/// The unit vector at a place in the square.
pub fn unflatten(p: Vec2) -> Vec3 {
    let z = 1.0 - p.x.abs() - p.y.abs();
    let xy = if z < 0.0 { fold(p) } else { p };
    Vec3::new(xy.x, xy.y, z).normalize()
}

/// Mirrors a point of the outer triangles over the square's diagonal, and back.
fn fold(p: Vec2) -> Vec2 {
    let sign = |v: f32| if v < 0.0 { -1.0 } else { 1.0 };
    Vec2::new((1.0 - p.y.abs()) * sign(p.x), (1.0 - p.x.abs()) * sign(p.y))
}
