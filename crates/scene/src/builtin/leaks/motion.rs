//! What moves in the gallery: the closet's door, the cart, the louvre's slats, and the two cameras.

use std::f32::consts::TAU;

use glam::{Quat, Vec3};

use super::plan::*;

/// Keys of a part that moves, for one run of the animation.
pub(super) const KEYS: u32 = 90;

/// 0 to 1 while `part` goes from `from` to `to`, with a soft start and end.
fn eased(part: f32, from: f32, to: f32) -> f32 {
    let t = ((part - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Where the door is at a part (0 … 1) of the animation: shut, slid open, shut again.
pub(super) fn door(part: f32) -> Vec3 {
    let open = eased(part, 0.12, 0.36) - eased(part, 0.72, 0.96);
    let shut = 0.5 * (DOORWAY[0] + DOORWAY[1]);
    Vec3::new(BOOKCASE[1] + HALF + 0.006, 0.0, shut + 0.99 * open)
}

/// Where the cart is: behind the onyx and back, out at both ends.
pub(super) fn cart(part: f32) -> Vec3 {
    let [line, west, east] = CART;
    let way = eased(part, 0.02, 0.47) - eased(part, 0.53, 0.98);
    Vec3::new(west + (east - west) * way, 0.0, line)
}

/// How a slat of the louvre is turned: from nearly shut to open and back, one after the other.
pub(super) fn slat(part: f32, which: u32) -> Quat {
    let angle = 0.82 + 0.6 * libm::cosf(TAU * part - 0.18 * which as f32);
    Quat::from_rotation_z(-angle)
}

/// A walk through the hall and behind the bookcase: control points of the eye and of what it looks at.
pub(super) fn visit() -> (Vec<Vec3>, Vec<Vec3>) {
    let eye = |x: f32, z: f32| Vec3::new(x, 1.65, z);
    let path = vec![
        eye(2.6, 5.2),
        eye(1.6, 4.4),
        eye(0.4, 3.8),
        eye(-0.9, 3.3),
        eye(-1.9, 2.6),
        eye(-2.2, 1.6),
        eye(-2.3, 0.5),
        eye(-2.6, -0.6),
        eye(-2.85, -1.8),
        eye(-2.9, -3.0),
        eye(-3.1, -4.1),
        eye(-3.9, -4.75),
        eye(-5.0, -4.85),
        eye(-5.9, -4.85),
    ];
    let p = Vec3::new;
    let look = vec![
        p(5.5, 0.7, 1.4),
        p(5.0, 0.7, 0.0),
        p(2.6, 0.8, -2.6),
        p(-1.0, 1.0, -3.0),
        p(-5.0, 1.0, 1.6),
        p(-6.6, 1.0, 1.4),
        p(-6.0, 1.2, -1.6),
        p(-5.6, 1.3, -3.4),
        p(-5.6, 1.2, -3.8),
        p(-6.2, 1.1, -4.2),
        p(-7.0, 1.1, -4.6),
        p(-7.8, 1.0, -4.9),
        p(-8.4, 0.9, -4.9),
    ];
    (path, look)
}

/// Low along the places where things meet: control points of the eye and of what it looks at.
pub(super) fn close() -> (Vec<Vec3>, Vec<Vec3>) {
    let p = Vec3::new;
    let path = vec![
        p(6.9, 0.95, 5.5),
        p(6.85, 0.9, 4.6),
        p(6.9, 0.8, 3.6),
        p(6.6, 0.75, 2.0),
        p(5.6, 0.75, 1.2),
        p(4.2, 0.75, 1.2),
        p(3.0, 0.8, 1.1),
        p(1.9, 0.85, 0.2),
        p(1.3, 0.8, -1.2),
        p(0.6, 0.7, -2.6),
        p(-0.6, 0.6, -2.9),
        p(-1.7, 0.6, -2.4),
        p(-2.9, 0.6, -2.0),
        p(-4.2, 0.6, -1.9),
        p(-5.4, 0.65, -1.9),
    ];
    let look = vec![
        p(8.2, 0.5, 3.6),
        p(8.0, 0.5, 2.4),
        p(6.4, 0.3, 2.4),
        p(5.0, 0.2, 2.8),
        p(4.0, 0.2, 2.6),
        p(3.3, 0.0, 0.6),
        p(3.4, -0.1, -2.0),
        p(2.0, 0.2, -4.0),
        p(0.4, 0.4, -5.2),
        p(-2.0, 0.3, -4.4),
        p(-3.8, 0.2, -3.5),
        p(-5.4, 0.15, -3.5),
        p(-7.0, 0.1, -3.4),
        p(-8.4, 0.2, -3.0),
    ];
    (path, look)
}
