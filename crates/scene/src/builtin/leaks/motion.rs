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

/// Where the door is at a part (0 … 1) of the animation: shut, slid open when the visitor comes, shut again.
pub(super) fn door(part: f32) -> Vec3 {
    let open = eased(part, 0.5, 0.7) - eased(part, 0.84, 0.99);
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
        p(5.7, 1.15, 5.2),
        p(6.3, 1.05, 4.1),
        p(6.8, 0.95, 3.2),
        p(6.75, 0.85, 2.1),
        p(6.1, 0.8, 1.35),
        p(4.9, 0.8, 1.1),
        p(3.6, 0.8, 1.1),
        p(2.4, 0.8, 0.6),
        p(1.5, 0.75, -0.6),
        p(0.6, 0.7, -1.5),
        p(-0.6, 0.65, -1.3),
        p(-1.7, 0.65, -0.6),
        p(-2.9, 0.65, -0.3),
        p(-4.1, 0.65, -0.25),
        p(-5.2, 0.7, -0.3),
    ];
    let look = vec![
        p(8.0, 0.7, 2.8),
        p(8.2, 0.6, 2.2),
        p(8.3, 0.4, 0.4),
        p(7.2, 0.2, -1.4),
        p(5.6, 0.2, -1.8),
        p(3.6, 0.2, -0.8),
        p(2.2, 0.3, 1.0),
        p(1.4, 0.3, 2.2),
        p(0.0, 0.3, 1.0),
        p(-0.6, 0.3, -1.2),
        p(-1.2, 0.4, -3.8),
        p(-2.2, 0.5, -3.4),
        p(-4.0, 0.5, -1.6),
        p(-4.6, 0.4, 0.6),
        p(-5.0, 0.3, 1.1),
        p(-6.2, 0.3, 1.1),
        p(-7.4, 0.3, 0.9),
    ];
    (path, look)
}
