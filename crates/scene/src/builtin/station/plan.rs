//! Measures of the station: where everything is, whatever the detail.
//! Metres; the middle of the hangar's deck is the origin, the hangar opens to +Z.

use std::f32::consts::FRAC_PI_2;

use glam::{Quat, Vec3};

use crate::builtin::noise::unit;

/// Length of the animation, seconds.
pub(super) const SECONDS: f32 = 15.0;
/// Frames of a camera path.
pub(super) const FRAMES: u32 = 900;
/// Half extents of the hangar inside (x, z).
pub(super) const HANGAR: [f32; 2] = [9.0, 6.0];
/// The hangar's ceiling.
pub(super) const CEILING: f32 = 5.4;
/// Thickness of its walls.
pub(super) const WALL: f32 = 0.4;
/// Where the modules start on either side (|x|), how long they are, and the height of their axes.
pub(super) const MODULE: [f32; 3] = [9.35, 7.6, 1.75];
/// Where the booms start (|x|), the length of a bay, and the half width of a truss.
pub(super) const BOOM: [f32; 3] = [17.1, 1.2, 0.42];
/// Bays of a boom.
pub(super) const BAYS: u32 = 8;
/// Foot of the mast on the roof, and its height.
pub(super) const MAST: (Vec3, f32) = (Vec3::new(-4.5, CEILING + 0.55, -2.5), 4.2);
/// Middles of the tanks on the roof.
pub(super) const TANKS: [Vec3; 4] = [
    Vec3::new(2.2, CEILING + 1.75, -3.4),
    Vec3::new(4.4, CEILING + 1.75, -3.4),
    Vec3::new(6.6, CEILING + 1.75, -3.4),
    Vec3::new(6.6, CEILING + 1.75, -1.2),
];

/// Bays of the keel, which hangs under the hangar.
pub(super) const KEEL_BAYS: u32 = 4;
/// Bays along a boom at which solar panels hang, to both sides.
pub(super) const PANEL_BAYS: [u32; 3] = [1, 4, 7];

/// A container: the middle of its underside, its turn in radians, and its colour (of three).
pub(super) struct Container {
    pub(super) at: Vec3,
    pub(super) turn: f32,
    pub(super) color: usize,
}

const fn container(x: f32, y: f32, z: f32, turn: f32, color: usize) -> Container {
    Container { at: Vec3::new(x, y, z), turn, color }
}

/// Containers (2.4 × 1.2 × 1.2 m) on the deck, some stacked.
pub(super) const CONTAINERS: &[Container] = &[
    container(-6.6, 0.0, -4.6, 0.0, 0),
    container(-4.0, 0.0, -4.6, 0.0, 1),
    container(-6.5, 1.2, -4.6, 0.04, 2),
    container(-7.6, 0.0, 2.2, FRAC_PI_2, 1),
    container(-7.6, 0.0, 4.8, FRAC_PI_2, 0),
    container(-7.6, 1.2, 2.3, 1.53, 0),
    container(4.6, 0.0, -4.7, 0.0, 2),
    container(7.2, 0.0, -4.7, 0.0, 0),
    container(7.4, 0.0, 3.9, 1.62, 2),
];

/// Barrels on the deck (x, z).
pub(super) const BARRELS: &[[f32; 2]] =
    &[[-1.7, -4.9], [-1.0, -4.8], [-1.4, -4.2], [7.9, 1.2], [7.2, 0.9], [7.8, 0.4], [2.6, -5.0]];

/// Middle of the pod's underside, on its legs.
pub(super) const POD: Vec3 = Vec3::new(1.4, 0.0, 0.4);

/// Lamps under the hangar's ceiling (x, z).
pub(super) const LAMPS: [[f32; 2]; 8] =
    [[-6.0, -3.0], [-2.0, -3.0], [2.0, -3.0], [6.0, -3.0], [-6.0, 2.5], [-2.0, 2.5], [2.0, 2.5], [6.0, 2.5]];

/// A rock that drifts and tumbles.
pub(super) struct Rock {
    pub(super) radius: f32,
    /// Where it is in the middle of the animation.
    pub(super) middle: Vec3,
    /// Metres a second.
    pub(super) velocity: Vec3,
    pub(super) axis: Vec3,
    /// Radians a second.
    pub(super) rate: f32,
    /// Which of three stones.
    pub(super) stone: usize,
}

/// Directions and distances of rocks: far from the station and from each other.
const ROCKS: [[f32; 4]; 14] = [
    [-22.0, 7.0, 24.0, 1.5],
    [-10.0, 15.0, 30.0, 0.9],
    [2.0, -7.0, 27.0, 1.2],
    [12.0, 9.0, 33.0, 2.1],
    [23.0, -4.0, 26.0, 1.0],
    [33.0, 12.0, 17.0, 1.7],
    [36.0, -8.0, -6.0, 2.2],
    [27.0, 17.0, -19.0, 1.3],
    [8.0, 23.0, -24.0, 1.6],
    [-13.0, 19.0, -26.0, 1.1],
    [-32.0, 12.0, -17.0, 2.0],
    [-37.0, -5.0, 6.0, 1.4],
    [-26.0, -13.0, -14.0, 0.8],
    [4.0, -17.0, 6.0, 1.8],
];

/// The rocks.
pub(super) fn rocks() -> Vec<Rock> {
    ROCKS
        .iter()
        .zip(0_u32..)
        .map(|(&[x, y, z, radius], i)| {
            let r = |seed: u32| 2.0 * unit(seed, i) - 1.0;
            let middle = Vec3::new(x, y, z);
            // Past the station rather than towards it.
            let aside = middle.cross(Vec3::new(r(401), 0.3 + r(402), r(403))).normalize_or(Vec3::X);
            let velocity = aside * (0.12 + 0.2 * unit(404, i));
            let axis = Vec3::new(r(405), r(406), r(407)).normalize_or(Vec3::Y);
            let rate = 0.06 + 0.22 * unit(408, i);
            Rock { radius, middle, velocity, axis, rate, stone: i as usize % 3 }
        })
        .collect()
}

impl Rock {
    /// Where the rock is at a time, and how it is turned.
    pub(super) fn pose(&self, time: f32) -> (Vec3, Quat) {
        let place = self.middle + self.velocity * (time - 0.5 * SECONDS);
        (place, Quat::from_axis_angle(self.axis, self.rate * time))
    }
}
