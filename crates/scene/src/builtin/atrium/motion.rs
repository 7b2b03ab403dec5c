//! What moves in the atrium: boulders, spot lights, and the two cameras.

use glam::{Quat, Vec3};

use super::plan::*;
use crate::builtin::noise::unit;
use crate::builtin::path::look_along;
use crate::builtin::physics::{Body, Push};
use crate::builtin::shapes::boulder_points;

/// Length of the animation, seconds.
pub(super) const SECONDS: f32 = 15.0;
/// Frames of a camera path.
pub(super) const FRAMES: u32 = 900;
/// Height of the spot lights.
pub(super) const SPOT_HEIGHT: f32 = 7.0;
/// Different rocks; boulder `i` is rock `i % ROCKS`.
pub(super) const ROCKS: u32 = 3;

/// A boulder's start: radius, position of its underside, and when it is pushed how.
struct Start {
    radius: f32,
    under: Vec3,
    push: (f32, Vec3),
}

const fn start(radius: f32, x: f32, y: f32, z: f32, time: f32, vx: f32, vz: f32) -> Start {
    Start { radius, under: Vec3::new(x, y, z), push: (time, Vec3::new(vx, 0.0, vz)) }
}

const BOULDERS: &[Start] = &[
    // Down the west flight, one after another.
    start(0.42, -7.9, GALLERY, -2.55, 0.2, 2.6, 0.0),
    start(0.28, -8.0, GALLERY, -1.86, 3.2, 3.0, 0.0),
    start(0.50, -9.0, GALLERY, -2.34, 6.6, 3.4, 0.0),
    // Down the east flight.
    start(0.55, 7.9, GALLERY, 2.38, 1.2, -2.6, 0.0),
    start(0.27, 8.9, GALLERY, 2.75, 5.0, -3.4, 0.0),
    start(0.38, 9.0, GALLERY, 1.98, 8.6, -3.4, 0.0),
    // Through the skylight.
    start(0.60, 3.0, 5.6, -1.2, 0.0, -0.5, 1.0),
    start(0.33, -3.8, 4.3, 1.7, 0.0, 1.0, -0.8),
    // Across the hall and along the aisles.
    start(0.36, -5.9, 0.0, 1.5, 4.6, 4.2, 0.3),
    start(0.45, 8.4, 0.0, -4.6, 1.4, -5.0, 0.1),
    start(0.30, 4.4, 0.0, -2.0, 10.2, -3.6, 0.5),
    start(0.40, -8.4, 0.0, 4.5, 8.8, 5.0, 0.0),
];

/// The boulders: bodies for the simulation, in the order of their nodes.
pub(super) fn boulders() -> Vec<Body> {
    BOULDERS
        .iter()
        .enumerate()
        .map(|(i, start)| {
            let seed = i as u32;
            let axis = Vec3::new(unit(61, seed) - 0.5, unit(62, seed) - 0.5, unit(63, seed) - 0.5);
            let rotation = Quat::from_axis_angle(axis.normalize_or(Vec3::Y), 6.0 * unit(64, seed));
            let points = boulder_points(2, rock_seed(seed % ROCKS));
            let lowest = points.iter().fold(0.0_f32, |y, &p| y.min((rotation * p).y));
            Body {
                hull: points.iter().map(|&p| p * start.radius).collect(),
                radius: start.radius,
                position: start.under - Vec3::Y * (lowest * start.radius - 0.002),
                rotation,
                pushes: vec![Push { time: start.push.0, velocity: start.push.1 }],
            }
        })
        .collect()
}

/// The seed of a rock's shape.
pub(super) fn rock_seed(rock: u32) -> u32 {
    900 + rock
}

/// The walk at eye height: control points of the eye and of what it looks at.
pub(super) fn walk() -> (Vec<Vec3>, Vec<Vec3>) {
    let eye = |x: f32, z: f32| Vec3::new(x, 1.65, z);
    let path = vec![
        eye(-8.46, 4.635),
        eye(-6.66, 4.68),
        eye(-4.68, 4.59),
        eye(-3.51, 4.23),
        eye(-3.51, 3.33),
        eye(-3.15, 2.34),
        eye(-2.34, 1.26),
        eye(-1.98, 0.0),
        eye(-1.44, -0.99),
        eye(-0.18, -1.44),
        eye(1.26, -1.53),
        eye(2.7, -1.35),
        eye(3.96, -0.81),
        eye(5.22, -0.18),
        eye(7.02, 0.0),
        eye(8.01, 0.18),
    ];
    let look = vec![
        Vec3::new(0.0, 1.7, 4.4),
        Vec3::new(0.0, 1.7, 4.1),
        Vec3::new(0.4, 1.8, 2.2),
        Vec3::new(0.5, 1.9, 0.0),
        Vec3::new(1.0, 2.0, -2.2),
        Vec3::new(1.5, 2.1, -4.0),
        Vec3::new(2.5, 2.2, -4.2),
        Vec3::new(5.5, 2.3, -2.6),
        Vec3::new(8.0, 2.5, 0.6),
        Vec3::new(8.6, 2.4, 2.4),
        Vec3::new(8.8, 1.9, 4.0),
        Vec3::new(8.6, 1.5, 5.0),
    ];
    (path, look)
}

/// The flight along the gallery: control points of the eye and of what it looks at.
pub(super) fn flight() -> (Vec<Vec3>, Vec<Vec3>) {
    let p = Vec3::new;
    let path = vec![
        p(-8.37, 5.55, 4.77),
        p(-6.3, 5.6, 4.815),
        p(-4.05, 5.65, 4.77),
        p(-1.8, 5.65, 4.77),
        p(0.36, 5.7, 4.725),
        p(2.34, 5.7, 4.68),
        p(3.33, 5.75, 4.14),
        p(3.555, 5.8, 3.06),
        p(3.24, 5.85, 1.62),
        p(1.8, 5.85, 0.36),
        p(-0.54, 5.75, -0.36),
        p(-2.8, 5.7, -0.9),
        p(-4.4, 5.65, -1.0),
        p(-5.6, 5.6, -0.3),
        p(-5.9, 5.6, 0.6),
    ];
    let look = vec![
        p(-0.9, 4.68, 2.7),
        p(0.0, 3.78, 0.45),
        p(0.9, 2.25, -0.45),
        p(1.8, 1.8, -0.9),
        p(3.15, 1.98, -1.35),
        p(2.7, 1.98, -2.25),
        p(0.45, 1.62, -1.8),
        p(-2.7, 1.3, 0.2),
        p(-4.0, 0.9, 2.2),
        p(-2.2, 0.9, 3.2),
        p(0.5, 1.3, 2.6),
        p(3.0, 1.7, 1.8),
        p(5.5, 2.3, 1.6),
    ];
    (path, look)
}

/// A spot light that sweeps: where it hangs, what it points at on average, how far and how fast it sweeps, its colour.
pub(super) struct Spot {
    pub(super) at: Vec3,
    pub(super) aim: Vec3,
    pub(super) sweep: Vec3,
    pub(super) turns: [f32; 2],
    pub(super) color: Vec3,
    pub(super) candela: f32,
}

/// The moving spot lights: they hang under the beams of the roof and along the gallery.
pub(super) fn spots() -> Vec<Spot> {
    let p = Vec3::new;
    vec![
        Spot {
            at: p(-6.25, SPOT_HEIGHT, 2.8),
            aim: p(-1.35, 0.0, -0.36),
            sweep: p(3.6, 0.0, 1.6),
            turns: [1.0, 2.0],
            color: p(1.0, 0.82, 0.6),
            candela: 75.0,
        },
        Spot {
            at: p(6.25, SPOT_HEIGHT, -2.8),
            aim: p(1.35, 0.0, 0.36),
            sweep: p(3.6, 0.0, 1.8),
            turns: [2.0, 1.0],
            color: p(0.65, 0.8, 1.0),
            candela: 70.0,
        },
        Spot {
            at: p(6.25, SPOT_HEIGHT, 2.8),
            aim: p(-2.7, 2.2, -3.06),
            sweep: p(3.0, 1.6, 0.6),
            turns: [1.0, 1.0],
            color: p(1.0, 0.55, 0.45),
            candela: 80.0,
        },
        Spot {
            at: p(-6.25, SPOT_HEIGHT, -2.8),
            aim: p(2.7, 2.2, 3.06),
            sweep: p(3.4, 1.4, 0.6),
            turns: [1.0, 2.0],
            color: p(0.75, 1.0, 0.7),
            candela: 60.0,
        },
    ]
}

impl Spot {
    /// The rotation that points the light's −Z where it shines at a time (seconds). It repeats after [`SECONDS`].
    pub(super) fn rotation(&self, time: f32) -> Quat {
        let phase = std::f32::consts::TAU * time / SECONDS;
        let swing = Vec3::new(
            libm::sinf(phase * self.turns[0]),
            libm::sinf(phase * self.turns[1] + 1.3),
            libm::cosf(phase * self.turns[1]),
        );
        look_along(self.aim + self.sweep * swing - self.at)
    }
}
