//! What moves in the laboratory besides walkers: rotors, arms, and the two cameras.

use glam::{Quat, Vec3};

use super::plan::SECONDS;

/// Keys of a part that turns, for one run of the animation.
pub(super) const KEYS: u32 = 120;

/// How a rotor is turned at a part (0 … 1) of the animation; it comes back to where it started.
pub(super) fn rotor(part: f32, which: usize) -> Quat {
    let rounds = [6.0, -4.0][which % 2];
    Quat::from_rotation_y(std::f32::consts::TAU * rounds * part)
}

/// How an arm is turned: to and fro, resting at both ends.
pub(super) fn arm(part: f32, which: usize) -> Quat {
    let swing = libm::sinf(std::f32::consts::TAU * (2.0 * part + 0.3 * which as f32));
    let eased = swing * (1.5 - 0.5 * swing * swing);
    Quat::from_rotation_y(1.2 * eased)
}

/// Times of [`KEYS`], seconds.
pub(super) fn key_times() -> Vec<f32> {
    (0..=KEYS).map(|i| SECONDS * i as f32 / KEYS as f32).collect()
}

/// Along the aisles at eye height: control points of the eye and of what it looks at.
pub(super) fn aisle() -> (Vec<Vec3>, Vec<Vec3>) {
    let eye = |x: f32, z: f32| Vec3::new(x, 1.68, z);
    let path = vec![
        eye(-12.9, -2.85),
        eye(-11.0, -2.85),
        eye(-9.0, -2.82),
        eye(-7.2, -2.8),
        eye(-5.0, -2.8),
        eye(-2.5, -2.8),
        eye(-1.0, -2.82),
        eye(0.1, -2.7),
        eye(0.42, -2.0),
        eye(0.36, -0.8),
        eye(0.36, 0.4),
        eye(0.6, 1.3),
        eye(1.5, 1.92),
        eye(3.0, 1.98),
        eye(4.4, 1.98),
        eye(5.6, 1.95),
    ];
    let p = Vec3::new;
    let look = vec![
        p(-9.5, 1.3, -4.2),
        p(-7.0, 1.3, -4.8),
        p(-4.6, 1.3, -4.6),
        p(-1.5, 1.3, -3.4),
        p(2.5, 1.3, -2.4),
        p(4.2, 1.3, -1.2),
        p(4.6, 1.3, 1.0),
        p(5.6, 1.4, 3.2),
        p(9.0, 1.5, 4.4),
        p(11.5, 1.6, 3.9),
        p(12.5, 1.6, 2.2),
    ];
    (path, look)
}

/// Overhead from the west to the platform and back along the south: control points of the eye and of what it looks at.
pub(super) fn crane() -> (Vec<Vec3>, Vec<Vec3>) {
    let p = Vec3::new;
    let path = vec![
        p(-12.6, 3.4, 6.6),
        p(-11.0, 3.5, 5.4),
        p(-8.6, 3.55, 3.4),
        p(-6.4, 3.55, 1.5),
        p(-4.0, 3.55, 0.2),
        p(-1.2, 3.55, -0.6),
        p(1.6, 3.55, -0.9),
        p(4.0, 3.6, -0.3),
        p(5.4, 3.7, 0.9),
        p(5.6, 3.8, 2.4),
        p(4.6, 3.75, 3.6),
        p(2.6, 3.65, 4.0),
    ];
    let look = vec![
        p(-7.0, 0.6, 2.2),
        p(-5.0, 0.6, 0.6),
        p(-2.6, 0.7, -1.6),
        p(0.4, 0.8, -3.2),
        p(3.8, 0.9, -4.0),
        p(7.6, 1.0, -3.4),
        p(10.4, 1.6, -0.4),
        p(11.4, 2.2, 2.6),
        p(10.4, 2.6, 4.8),
        p(8.8, 1.6, 5.9),
        p(5.6, 1.0, 6.6),
        p(1.6, 0.6, 6.0),
        p(-2.2, 0.5, 4.0),
    ];
    (path, look)
}
