//! What moves in the village: the mill's sails, two signs in the wind, and the two cameras.

use std::f32::consts::TAU;

use glam::{Quat, Vec2, Vec3};

use super::plan::{SECONDS, ground};

/// Keys of a part that moves, for one run of the animation.
pub(super) const KEYS: u32 = 90;

/// Times of [`KEYS`], seconds.
pub(super) fn key_times() -> Vec<f32> {
    (0..=KEYS).map(|i| SECONDS * i as f32 / KEYS as f32).collect()
}

/// How the sails are turned about their axle at a part (0 … 1) of the animation: one round.
pub(super) fn sails(part: f32) -> Quat {
    Quat::from_rotation_z(TAU * (part + 0.06))
}

/// How a sign hangs: it swings along its arm's side, in gusts.
pub(super) fn sign(part: f32, which: usize) -> Quat {
    let phase = 1.9 * which as f32;
    let gust = 0.6 + 0.4 * libm::sinf(TAU * (2.0 * part) + phase);
    Quat::from_rotation_x(0.26 * gust * libm::sinf(TAU * (9.0 - which as f32) * part + phase))
}

/// A place at a height above the ground.
fn above(x: f32, z: f32, height: f32) -> Vec3 {
    Vec3::new(x, ground(Vec2::new(x, z)) + height, z)
}

/// A walk along the road and over the green to the hall: control points of the eye and of what it looks at.
pub(super) fn lane() -> (Vec<Vec3>, Vec<Vec3>) {
    let path = [
        [-25.6, 3.1],
        [-23.4, 2.9],
        [-20.4, 2.6],
        [-17.0, 2.2],
        [-13.6, 1.4],
        [-10.4, 0.6],
        [-7.6, 0.3],
        [-4.8, 0.4],
        [-2.6, 0.2],
        [-1.2, -1.0],
        [-0.7, -2.8],
        [-0.6, -4.6],
        [-0.6, -6.2],
    ];
    let path = path.iter().map(|&[x, z]| above(x, z, 1.66)).collect();
    let look = [
        [-16.0, -1.0, 1.6],
        [-14.0, -2.0, 1.6],
        [-11.0, -3.4, 1.7],
        [-8.0, -1.0, 1.5],
        [-5.4, 3.6, 1.3],
        [-2.4, 6.6, 0.9],
        [1.6, 6.4, 1.0],
        [4.6, 2.0, 1.3],
        [5.0, -2.4, 1.4],
        [2.4, -7.0, 1.7],
        [-0.2, -11.0, 2.1],
        [-1.2, -13.0, 2.4],
    ];
    let look = look.iter().map(|&[x, z, y]| above(x, z, y)).collect();
    (path, look)
}

/// A flight over the roofs, from the east down to the green: control points of the eye and of what it looks at.
pub(super) fn roofs() -> (Vec<Vec3>, Vec<Vec3>) {
    let p = Vec3::new;
    let path = vec![
        p(26.5, 8.4, 4.4),
        p(23.0, 8.6, 3.6),
        p(18.8, 8.6, 2.2),
        p(14.4, 8.4, 1.0),
        p(9.6, 8.2, 0.8),
        p(5.0, 8.2, 2.6),
        p(0.8, 8.0, 4.8),
        p(-4.2, 7.6, 4.6),
        p(-9.2, 7.0, 3.2),
        p(-13.6, 6.4, 2.2),
        p(-17.4, 5.6, 2.6),
        p(-20.6, 4.8, 3.2),
    ];
    let look = vec![
        p(14.0, 2.2, -3.0),
        p(10.0, 2.0, -4.0),
        p(6.0, 1.8, -4.6),
        p(2.4, 1.6, -5.4),
        p(-1.0, 1.4, -5.0),
        p(-5.4, 1.2, -3.2),
        p(-10.0, 1.4, -3.4),
        p(-15.0, 2.2, -6.4),
        p(-19.6, 3.6, -9.6),
        p(-23.0, 5.2, -13.0),
        p(-24.0, 5.6, -15.0),
    ];
    (path, look)
}
