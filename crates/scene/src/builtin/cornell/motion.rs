//! What moves in the box, the tall block and the small cube, and the two cameras.

use std::f32::consts::TAU;

use glam::{Quat, Vec3};

use super::plan::*;
use crate::builtin::builder::rotation_y;

/// Keys of a part that moves, for one run of the animation.
pub(super) const KEYS: u32 = 90;

/// How the tall block is turned at a part (0 … 1) of the animation: slowly to and fro.
pub(super) fn tall(part: f32) -> Quat {
    rotation_y(TALL.turn + 0.4 * libm::sinf(TAU * part))
}

/// Where the small cube is: from end to end and back.
pub(super) fn cube(part: f32) -> Vec3 {
    let ([from, to], line, _) = CUBE;
    let way = 0.5 - 0.5 * libm::cosf(TAU * part);
    BOX + Vec3::new(from + (to - from) * way, 0.0, line)
}

/// Towards the box and into it: control points of the eye and of what it looks at.
pub(super) fn into_box() -> (Vec<Vec3>, Vec<Vec3>) {
    let p = Vec3::new;
    let path = vec![
        p(-1.9, 2.7, 10.6),
        p(-2.6, 2.8, 9.8),
        p(-3.8, 2.85, 8.6),
        p(-4.4, 2.8, 7.2),
        p(-4.4, 2.6, 5.6),
        p(-4.0, 2.5, 4.3),
        p(-3.4, 2.7, 3.2),
        p(-2.8, 3.0, 2.4),
        p(-2.4, 3.4, 1.7),
        p(-2.3, 3.7, 1.2),
    ];
    let look = vec![
        p(-2.4, 2.2, 0.0),
        p(-3.4, 2.4, 0.0),
        p(-4.4, 2.6, -0.5),
        p(-4.4, 2.6, -1.0),
        p(-4.6, 2.2, -1.0),
        p(-4.8, 1.8, -0.8),
        p(-5.0, 1.4, -0.4),
        p(-5.2, 1.2, 0.0),
        p(-5.4, 1.2, 0.2),
        p(-5.5, 1.2, 0.2),
    ];
    (path, look)
}

/// Around the stages and close to the disc: control points of the eye and of what it looks at.
pub(super) fn stages() -> (Vec<Vec3>, Vec<Vec3>) {
    let p = Vec3::new;
    let path = vec![
        p(-1.0, 1.9, 6.9),
        p(0.2, 1.8, 6.3),
        p(1.8, 1.7, 5.6),
        p(3.6, 1.5, 5.6),
        p(5.4, 1.45, 5.5),
        p(7.0, 1.4, 4.6),
        p(7.7, 1.35, 3.0),
        p(7.7, 1.3, 1.5),
        p(6.8, 1.25, 0.7),
        p(5.6, 1.15, 0.55),
        p(4.7, 1.0, 0.8),
        p(3.9, 0.9, 1.1),
        p(3.1, 0.85, 1.0),
    ];
    let look = vec![
        p(2.6, 0.6, 0.8),
        p(3.2, 0.6, 0.8),
        p(3.6, 0.6, 1.0),
        p(4.8, 0.6, 1.6),
        p(5.1, 0.6, 2.2),
        p(5.4, 0.6, 1.4),
        p(6.2, 0.5, -0.8),
        p(6.7, 0.4, -1.3),
        p(6.4, 0.4, -1.4),
        p(5.0, 0.45, -1.0),
        p(3.7, 0.5, -0.8),
        p(3.5, 0.5, -0.7),
        p(3.4, 0.5, -0.8),
    ];
    (path, look)
}
