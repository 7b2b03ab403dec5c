//! What moves in the hangar: the drones, the crane, the fan, and the two cameras.

use std::f32::consts::TAU;

use glam::{Quat, Vec3};

use super::plan::*;
use crate::builtin::builder::rotation_y;
use crate::builtin::path::even_loop;

/// Keys a second of what moves.
pub(super) const RATE: u32 = 10;
/// Keys of a part that moves, for one run of the animation.
pub(super) const KEYS: u32 = RATE * SECONDS as u32;

/// Times of [`KEYS`], seconds.
pub(super) fn key_times() -> Vec<f32> {
    (0..=KEYS).map(|i| SECONDS * i as f32 / KEYS as f32).collect()
}

/// Parts (0 … 1) of the animation at its keys.
pub(super) fn parts() -> impl Iterator<Item = f32> {
    (0..=KEYS).map(|k| k as f32 / KEYS as f32)
}

/// The control points of a way: closed.
fn way(which: usize) -> Vec<Vec3> {
    let p = Vec3::new;
    match which {
        LOW | HIGH => {
            let ([x, z], [low, high], sign) = match which {
                LOW => ([10.6, 6.0], [2.8, 4.6], 1.0),
                _ => ([7.6, 4.4], [5.4, 6.6], -1.0),
            };
            (0..16)
                .map(|i| {
                    let (s, c) = libm::sincosf(sign * TAU * i as f32 / 16.0);
                    let lift = 0.5 + 0.5 * libm::sinf(TAU * i as f32 * 3.0 / 16.0);
                    p(x * c, low + (high - low) * lift, z * s)
                })
                .collect()
        }
        _ => {
            // Around a store: along the aisle, through the gap, behind it along the wall, and out through the other gap.
            let (side, bay) = (if which < 6 { -1.0 } else { 1.0 }, BAY_X[which % 6]);
            let half = 2.95;
            let (near, far) = (side * 7.8, side * (BAY_Z + 2.0));
            let lift = [1.5, 2.3, 1.9, 2.6, 1.4, 2.1][(which * 5 + which / 6) % 6];
            let mut points = vec![
                p(bay - half, lift, near),
                p(bay - half, lift + 0.4, 0.5 * (near + far)),
                p(bay - half, lift + 0.7, far),
                p(bay - 0.5 * half, lift + 0.5, far),
                p(bay + 0.5 * half, lift - 0.2, far),
                p(bay + half, lift - 0.5, far),
                p(bay + half, lift - 0.6, 0.5 * (near + far)),
                p(bay + half, lift, near),
                p(bay + 0.4 * half, lift + 0.6, side * 7.3),
                p(bay - 0.4 * half, lift + 0.3, side * 7.3),
            ];
            if which % 2 == 1 {
                points.reverse();
            }
            points
        }
    }
}

/// A drone's places, one a key: it goes its way once in a run.
pub(super) fn fly(drone: &Drone) -> Vec<Vec3> {
    let points = even_loop(&way(drone.way), KEYS);
    let start = libm::roundf(drone.start * KEYS as f32) as usize;
    (0..=KEYS as usize).map(|k| points[(k + start) % KEYS as usize]).collect()
}

/// How a drone is turned at its keys: its front (+Z) along its way, leaning into it.
pub(super) fn lean(places: &[Vec3]) -> Vec<Quat> {
    let count = places.len().saturating_sub(1).max(1);
    (0..places.len())
        .map(|k| {
            let ahead = places[(k + 2) % count] - places[(k + count - 2) % count];
            let heading = libm::atan2f(ahead.x, ahead.z);
            let speed = libm::sqrtf(ahead.x * ahead.x + ahead.z * ahead.z) * RATE as f32 / 4.0;
            rotation_y(heading) * Quat::from_rotation_x((0.06 * speed).min(0.3))
        })
        .collect()
}

/// 0 to 1 while `part` goes from `from` to `to`, with a soft start and end.
fn eased(part: f32, from: f32, to: f32) -> f32 {
    let t = ((part - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Where the crane's bridge is along the hall.
pub(super) fn bridge(part: f32) -> Vec3 {
    let way = eased(part, 0.05, 0.5) - eased(part, 0.55, 0.97);
    Vec3::new(-16.4 + 6.6 * way, RAILS[0], 0.0)
}

/// Where its trolley is.
pub(super) fn trolley(part: f32) -> Vec3 {
    let way = eased(part, 0.15, 0.45) - eased(part, 0.6, 0.9);
    bridge(part) + Vec3::Z * (6.5 - 9.0 * way)
}

/// How the fan is turned: two rounds in three seconds.
pub(super) fn fan(part: f32) -> Quat {
    Quat::from_rotation_z(-TAU * 10.0 * part)
}

/// A walk along the south aisle and around the craft's nose: control points of the eye and of what it looks at.
pub(super) fn aisle() -> (Vec<Vec3>, Vec<Vec3>) {
    let eye = |x: f32, z: f32| Vec3::new(x, 1.68, z);
    let path = vec![
        eye(-17.6, 6.4),
        eye(-15.4, 6.7),
        eye(-12.8, 7.0),
        eye(-9.6, 6.3),
        eye(-6.2, 6.2),
        eye(-2.8, 6.2),
        eye(0.6, 5.8),
        eye(3.8, 4.8),
        eye(6.8, 4.0),
        eye(9.4, 2.6),
        eye(10.8, 0.6),
        eye(11.0, -1.4),
    ];
    let p = Vec3::new;
    let look = vec![
        p(-8.0, 1.9, 4.0),
        p(-5.6, 1.9, 2.6),
        p(-3.0, 2.0, 1.4),
        p(0.0, 2.0, 0.4),
        p(2.2, 1.9, -0.6),
        p(3.4, 1.9, -1.6),
        p(4.0, 1.8, -2.8),
        p(4.2, 1.8, -3.6),
        p(4.4, 1.9, -4.0),
        p(4.0, 2.1, -4.0),
        p(2.6, 2.4, -3.6),
    ];
    (path, look)
}

/// A flight under the roof along the north side: control points of the eye and of what it looks at.
pub(super) fn roof() -> (Vec<Vec3>, Vec<Vec3>) {
    let p = Vec3::new;
    let path = vec![
        p(17.6, 5.4, -6.2),
        p(15.4, 5.5, -7.0),
        p(12.4, 5.6, -8.2),
        p(9.0, 5.5, -8.9),
        p(5.4, 5.4, -9.1),
        p(1.8, 5.3, -9.1),
        p(-1.8, 5.2, -9.0),
        p(-5.4, 5.0, -8.9),
        p(-9.0, 4.8, -8.6),
        p(-12.4, 4.6, -7.4),
        p(-14.6, 4.5, -5.6),
    ];
    let look = vec![
        p(6.0, 1.6, 0.0),
        p(4.4, 1.6, 0.4),
        p(2.6, 1.6, 0.6),
        p(1.2, 1.6, 0.8),
        p(0.0, 1.6, 1.0),
        p(-1.4, 1.6, 1.2),
        p(-2.8, 1.5, 1.6),
        p(-3.6, 1.5, 2.2),
        p(-3.4, 1.5, 2.6),
        p(-2.0, 1.6, 2.4),
        p(0.0, 1.8, 1.6),
    ];
    (path, look)
}
