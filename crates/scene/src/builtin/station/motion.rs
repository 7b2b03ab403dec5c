//! What moves at the station besides rocks: airlocks, the dish, and the two cameras.

use glam::{Quat, Vec3};

use std::f32::consts::TAU;

/// Keys of a part that turns, for one run of the animation.
pub(super) const KEYS: u32 = 60;

/// How an airlock's ring is turned at a part (0 … 1) of the animation: it unlocks and locks again.
pub(super) fn airlock(part: f32) -> Quat {
    Quat::from_rotation_x(0.5 * (1.0 - libm::cosf(TAU * part)))
}

/// How the dish is turned: it searches to and fro.
pub(super) fn dish(part: f32) -> Quat {
    Quat::from_rotation_y(0.7 + 0.6 * libm::sinf(TAU * part))
}

/// A walk across the deck to the mouth: control points of the eye and of what it looks at.
pub(super) fn deck() -> (Vec<Vec3>, Vec<Vec3>) {
    let eye = |x: f32, z: f32| Vec3::new(x, 1.68, z);
    let path = vec![
        eye(7.6, -2.9),
        eye(6.4, -2.8),
        eye(4.6, -2.75),
        eye(2.4, -2.85),
        eye(0.2, -2.8),
        eye(-1.8, -2.4),
        eye(-3.2, -1.4),
        eye(-3.7, 0.0),
        eye(-3.6, 1.4),
        eye(-2.9, 2.7),
        eye(-1.6, 3.6),
        eye(0.2, 4.2),
        eye(1.9, 4.6),
        eye(2.9, 5.0),
    ];
    let p = Vec3::new;
    let look = vec![
        p(2.0, 1.6, -3.8),
        p(0.0, 1.6, -3.4),
        p(-2.5, 1.5, -1.8),
        p(-4.0, 1.4, 0.4),
        p(-3.0, 1.3, 2.4),
        p(0.0, 1.3, 1.6),
        p(2.4, 1.4, 0.8),
        p(4.4, 1.7, 1.8),
        p(6.0, 2.0, 5.0),
        p(7.5, 2.4, 10.0),
        p(12.0, 3.2, 15.0),
    ];
    (path, look)
}

/// A flight around the outside: control points of the eye and of what it looks at.
pub(super) fn orbit() -> (Vec<Vec3>, Vec<Vec3>) {
    let p = Vec3::new;
    let path = vec![
        p(25.0, 6.0, 13.0),
        p(21.0, 5.4, 14.0),
        p(15.5, 4.2, 14.8),
        p(9.0, 3.2, 15.0),
        p(2.5, 3.2, 15.2),
        p(-4.5, 4.6, 15.0),
        p(-11.0, 7.0, 12.4),
        p(-15.0, 9.4, 7.4),
        p(-14.8, 11.0, 1.6),
        p(-11.5, 11.6, -3.6),
        p(-6.5, 11.2, -8.2),
        p(-0.5, 9.8, -11.4),
        p(5.5, 8.2, -12.6),
        p(10.0, 7.2, -11.6),
    ];
    let look = vec![
        p(19.0, 2.4, 1.0),
        p(14.0, 2.4, 0.5),
        p(7.0, 2.4, 2.0),
        p(2.5, 2.2, 0.5),
        p(-1.0, 2.4, 0.0),
        p(-4.5, 3.4, 0.5),
        p(-8.0, 4.0, -0.5),
        p(-7.0, 5.0, -1.0),
        p(-3.5, 5.5, -1.6),
        p(0.5, 5.4, -2.2),
        p(3.5, 4.6, -3.6),
        p(5.5, 3.6, -3.4),
    ];
    (path, look)
}
