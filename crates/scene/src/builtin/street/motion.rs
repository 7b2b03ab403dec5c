//! What moves in the street: three lights, the carriage, wheels, and the two cameras.

use std::f32::consts::TAU;

use glam::{Quat, Vec3};

use super::plan::*;
use crate::builtin::path::even_loop;

/// Keys a second of what moves.
pub(super) const RATE: u32 = 12;
/// Keys of a part that moves, for one run of the animation.
pub(super) const KEYS: u32 = RATE * SECONDS as u32;

/// Times of [`KEYS`], seconds.
pub(super) fn key_times() -> Vec<f32> {
    (0..=KEYS).map(|i| SECONDS * i as f32 / KEYS as f32).collect()
}

/// The ways of the warm sphere, the cool sphere and the cube: closed, each gone round once in a run.
pub(super) fn lights() -> [Vec<Vec3>; 3] {
    let p = Vec3::new;
    let warm = [
        p(-13.0, 2.2, -1.4),
        p(-9.4, 1.6, -1.3),
        p(-6.2, 1.35, -1.45),
        p(-3.0, 1.5, -1.6),
        p(0.6, 1.7, -1.5),
        p(3.4, 2.5, -0.9),
        p(4.0, 3.3, 0.1),
        p(1.6, 3.7, 1.0),
        p(-2.4, 3.5, 1.5),
        p(-6.6, 3.4, 1.7),
        p(-10.6, 3.3, 1.2),
        p(-13.6, 2.9, -0.2),
    ];
    let cool = [
        p(0.6, 1.7, 1.7),
        p(4.4, 1.5, 1.5),
        p(8.2, 1.5, 1.7),
        p(12.2, 1.9, 2.2),
        p(16.4, 2.4, 1.4),
        p(17.2, 2.2, -0.8),
        p(15.0, 1.6, -1.3),
        p(12.2, 1.3, -1.5),
        p(9.0, 1.5, -1.7),
        p(6.4, 2.0, -1.6),
        p(4.6, 2.6, -0.2),
        p(2.0, 2.4, 1.2),
    ];
    let cube = [
        p(15.6, 4.6, 1.6),
        p(10.4, 4.9, 2.5),
        p(3.2, 4.8, 2.7),
        p(-4.8, 4.9, 2.5),
        p(-12.0, 4.5, 1.9),
        p(-16.6, 3.3, 0.4),
        p(-13.4, 4.4, -2.1),
        p(-4.4, 5.0, -2.7),
        p(4.2, 5.0, -2.6),
        p(11.2, 4.7, -2.0),
    ];
    [warm.to_vec(), cool.to_vec(), cube.to_vec()].map(|way| even_loop(&way, KEYS))
}

/// How the cube is turned at a part (0 … 1) of the animation: about two axes at once, back where it started at the end.
pub(super) fn cube(part: f32) -> Quat {
    Quat::from_rotation_y(TAU * 5.0 * part) * Quat::from_rotation_x(TAU * 3.0 * part)
}

/// 0 to 1 while `part` goes from `from` to `to`, with a soft start and end.
fn eased(part: f32, from: f32, to: f32) -> f32 {
    let t = ((part - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Where the carriage is along the street: up and back, out at both ends.
pub(super) fn drive(part: f32) -> f32 {
    let [_, west, east] = DRIVE;
    west + (east - west) * (eased(part, 0.03, 0.48) - eased(part, 0.54, 0.98))
}

/// How far a wheel of a radius has turned when the carriage is at `x`.
pub(super) fn roll(x: f32, radius: f32) -> Quat {
    Quat::from_rotation_z(-(x - DRIVE[1]) / radius)
}

/// How a wheel of fortune is turned.
pub(super) fn fortune(part: f32, rounds: f32) -> Quat {
    Quat::from_rotation_z(TAU * rounds * part)
}

/// A walk from the gate along the south pavement and across the street: control points of the eye and of what it looks at.
pub(super) fn walk() -> (Vec<Vec3>, Vec<Vec3>) {
    let eye = |x: f32, z: f32, y: f32| Vec3::new(x, y, z);
    let path = vec![
        eye(-19.4, 2.6, 1.68),
        eye(-17.0, 2.75, 1.68),
        eye(-14.4, 2.8, 1.68),
        eye(-11.6, 2.75, 1.68),
        eye(-8.8, 2.7, 1.68),
        eye(-6.0, 2.6, 1.68),
        eye(-3.4, 2.5, 1.68),
        eye(-1.0, 2.3, 1.68),
        eye(1.0, 1.2, 1.68),
        eye(2.6, 0.2, 1.68),
        eye(4.6, -1.0, 1.68),
    ];
    let p = Vec3::new;
    let look = vec![
        p(-12.0, 2.0, -1.6),
        p(-9.6, 1.9, -2.2),
        p(-7.0, 1.7, -3.0),
        p(-4.2, 1.7, -4.0),
        p(-1.0, 1.8, -4.6),
        p(2.2, 1.7, -4.4),
        p(5.4, 1.6, -2.6),
        p(8.0, 1.6, -0.4),
        p(10.4, 1.8, 1.6),
        p(12.6, 2.0, 2.6),
        p(16.0, 2.2, 3.4),
    ];
    (path, look)
}

/// A flight from the east end down the street at the height of the first storey: control points of the eye and of what it looks at.
pub(super) fn crane() -> (Vec<Vec3>, Vec<Vec3>) {
    let p = Vec3::new;
    let path = vec![
        p(18.6, 6.2, -3.4),
        p(16.2, 6.0, -3.5),
        p(13.0, 5.7, -3.6),
        p(9.6, 5.4, -3.9),
        p(6.2, 5.2, -4.0),
        p(3.0, 5.1, -4.1),
        p(0.2, 5.0, -4.0),
        p(-3.0, 4.9, -3.9),
        p(-6.4, 4.8, -3.8),
        p(-9.6, 4.7, -3.7),
    ];
    let look = vec![
        p(9.0, 2.4, 1.0),
        p(6.0, 2.2, 1.6),
        p(3.2, 2.0, 2.4),
        p(1.0, 1.9, 2.8),
        p(-1.6, 1.7, 2.6),
        p(-4.8, 1.6, 1.6),
        p(-8.4, 1.8, 1.4),
        p(-12.4, 2.4, 1.0),
        p(-16.4, 3.2, 0.4),
        p(-20.0, 4.0, 0.0),
    ];
    (path, look)
}
