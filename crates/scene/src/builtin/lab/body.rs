//! A walker's body: joints, skin and the joints' influence on it, in a pose with hanging arms.
//!
//! It is 1.76 m high, stands on the ground at the origin and faces +Z; its left is +X.

use glam::{Vec2, Vec3};

use crate::builtin::Detail;
use crate::builtin::shapes::{Geometry, Girth, between, loft, oval};

/// Number of joints.
pub(super) const JOINTS: usize = 16;
pub(super) const PELVIS: usize = 0;
pub(super) const SPINE: usize = 1;
pub(super) const CHEST: usize = 2;
pub(super) const HEAD: usize = 3;
/// Upper and lower arm, left then right.
pub(super) const ARMS: [[usize; 2]; 2] = [[4, 5], [6, 7]];
/// Upper leg, lower leg, foot and toes, left then right.
pub(super) const LEGS: [[usize; 4]; 2] = [[8, 9, 10, 11], [12, 13, 14, 15]];

/// A joint: its name, its parent, and where it is at rest. No joint is turned at rest.
pub(super) struct Joint {
    pub(super) name: &'static str,
    pub(super) parent: Option<usize>,
    pub(super) at: Vec3,
}

const fn joint(name: &'static str, parent: Option<usize>, x: f32, y: f32, z: f32) -> Joint {
    Joint { name, parent, at: Vec3::new(x, y, z) }
}

/// Height of the sole's joint with the leg.
pub(super) const ANKLE: f32 = 0.085;
/// Lengths of the upper and the lower leg.
pub(super) const LEG: [f32; 2] = [0.43, 0.415];
/// Half the distance of the hips, and how far they lie below the pelvis' joint.
pub(super) const HIP: [f32; 2] = [0.09, 0.02];
/// Where the sole bears a foot that rolls, as distances along it from the ankle: heel, ball, tip of the toes.
pub(super) const SOLE: [f32; 3] = [-0.055, 0.12, 0.195];

pub(super) const SKELETON: [Joint; JOINTS] = [
    joint("pelvis", None, 0.0, 0.95, 0.0),
    joint("spine", Some(PELVIS), 0.0, 1.06, 0.0),
    joint("chest", Some(SPINE), 0.0, 1.24, 0.0),
    joint("head", Some(CHEST), 0.0, 1.50, -0.01),
    joint("upper-arm-left", Some(CHEST), 0.185, 1.405, -0.01),
    joint("lower-arm-left", Some(4), 0.22, 1.117, -0.004),
    joint("upper-arm-right", Some(CHEST), -0.185, 1.405, -0.01),
    joint("lower-arm-right", Some(6), -0.22, 1.117, -0.004),
    joint("upper-leg-left", Some(PELVIS), HIP[0], 0.93, 0.0),
    joint("lower-leg-left", Some(8), HIP[0], 0.50, 0.0),
    joint("foot-left", Some(9), HIP[0], ANKLE, 0.0),
    joint("toes-left", Some(10), HIP[0], 0.0, SOLE[1]),
    joint("upper-leg-right", Some(PELVIS), -HIP[0], 0.93, 0.0),
    joint("lower-leg-right", Some(12), -HIP[0], 0.50, 0.0),
    joint("foot-right", Some(13), -HIP[0], ANKLE, 0.0),
    joint("toes-right", Some(14), -HIP[0], 0.0, SOLE[1]),
];

/// What a walker wears and how broad it is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Build {
    /// Breadth of trunk and limbs, 1 on average.
    pub(super) girth: f32,
    /// Height of the coat's hem.
    pub(super) hem: f32,
    /// A helmet instead of hair.
    pub(super) helmet: bool,
}

/// Geometry with four influences a vertex.
#[derive(Default)]
pub(super) struct Skinned {
    pub(super) geometry: Geometry,
    pub(super) joints: Vec<[u16; 4]>,
    pub(super) weights: Vec<[f32; 4]>,
}

impl Skinned {
    /// Adds a closed piece; `influence` tells up to three joints besides the first, with their weights, at a vertex.
    fn add(&mut self, piece: &Geometry, first: usize, influence: impl Fn(Vec3) -> Vec<(usize, f32)>) {
        for &p in &piece.positions {
            let mut joints = [first as u16; 4];
            let mut weights = [0.0; 4];
            let mut rest = 1.0;
            for (slot, (joint, weight)) in influence(p).into_iter().take(3).enumerate() {
                // An unused slot names joint 0, as glTF wants it.
                joints[slot + 1] = if weight > 0.0 { joint as u16 } else { 0 };
                weights[slot + 1] = weight;
                rest -= weight;
            }
            weights[0] = rest.max(0.0);
            for (joint, weight) in joints.iter_mut().zip(weights) {
                *joint = if weight > 0.0 { *joint } else { 0 };
            }
            self.joints.push(joints);
            self.weights.push(weights);
        }
        self.geometry.append_at(piece, Vec3::ZERO);
    }
}

/// The parts of a body by what they are made of.
#[derive(Default)]
pub(super) struct Body {
    pub(super) skin: Skinned,
    pub(super) coat: Skinned,
    pub(super) trousers: Skinned,
    pub(super) shoes: Skinned,
    pub(super) top: Skinned,
}

/// Rings of a piece that runs upward, from rows of x, y, z, half width (X), half depth (Z).
fn upward(rows: &[[f32; 5]], rings: u32, sides: u32, power: f32) -> Geometry {
    let girths: Vec<Girth> = rows
        .iter()
        .map(|&[x, y, z, w, d]| Girth { center: Vec3::new(x, y, z), half: Vec2::new(d, w) })
        .collect();
    let rings: Vec<Vec<Vec3>> =
        between(&girths, rings).into_iter().map(|g| oval(g, [Vec3::Z, Vec3::X], power, sides)).collect();
    loft(&rings)
}

/// 0 below `from`, 1 above `to`, smooth between.
fn rise(from: f32, to: f32, x: f32) -> f32 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Makes a body.
pub(super) fn body(build: &Build, detail: Detail) -> Body {
    let mut body = Body::default();
    let sides = |full: u32| detail.facets(full, 6);
    let rings = |full: u32, least: u32| detail.facets(full, least);

    let trunk = upward(&trunk_rows(build), rings(27, 9), sides(29), 2.3);
    body.coat.add(&trunk, PELVIS, |p| {
        let spine = rise(0.96, 1.12, p.y);
        let chest = rise(1.16, 1.34, p.y);
        // The hem follows the legs, which would come out of it otherwise.
        let leg = (4.0 * (0.94 - p.y)).clamp(0.0, 0.85);
        let left = rise(-0.07, 0.07, p.x);
        if p.y < 0.94 {
            vec![(LEGS[0][0], leg * left), (LEGS[1][0], leg * (1.0 - left))]
        } else {
            vec![(SPINE, spine * (1.0 - chest)), (CHEST, chest)]
        }
    });
    for (side, sign) in [(0, 1.0), (1, -1.0)] {
        let mirrored = |rows: &[[f32; 5]], breadth: f32| -> Vec<[f32; 5]> {
            rows.iter().map(|&[x, y, z, w, d]| [sign * x, y, z, w * breadth, d * breadth]).collect()
        };
        let [upper, lower] = ARMS[side];
        let sleeve = upward(&mirrored(SLEEVE, build.girth), rings(19, 6), sides(17), 2.0);
        body.coat.add(&sleeve, upper, |p| {
            let below = 1.0 - rise(1.06, 1.17, p.y);
            vec![(lower, below), (CHEST, 0.6 * rise(1.35, 1.46, p.y))]
        });
        let hand = upward(&mirrored(HAND, 1.0), rings(11, 4), sides(12), 2.2);
        let thumb = upward(&mirrored(THUMB, 1.0), rings(7, 3), sides(8), 2.0);
        for piece in [hand, thumb] {
            body.skin.add(&piece, lower, |_| Vec::new());
        }
        let [thigh, shin, foot, toes] = LEGS[side];
        let leg = upward(&mirrored(LEG_ROWS, 0.5 + 0.5 * build.girth), rings(24, 7), sides(19), 2.0);
        body.trousers
            .add(&leg, thigh, |p| vec![(shin, 1.0 - rise(0.44, 0.56, p.y)), (PELVIS, rise(0.88, 0.97, p.y))]);
        body.shoes.add(&shoe(sign, rings(17, 7), sides(16)), foot, |p| {
            vec![(toes, rise(SOLE[1] - 0.025, SOLE[1] + 0.025, p.z))]
        });
    }
    let head = upward(HEAD_ROWS, rings(22, 7), sides(23), 2.0);
    let nose = upward(NOSE, rings(6, 3), sides(8), 2.0);
    body.skin.add(&head, HEAD, |p| vec![(CHEST, 1.0 - rise(1.46, 1.53, p.y))]);
    body.skin.add(&nose, HEAD, |_| Vec::new());
    let top = if build.helmet { HELMET } else { HAIR };
    body.top.add(&upward(top, rings(13, 5), sides(23), 2.0), HEAD, |_| Vec::new());
    body
}

fn trunk_rows(build: &Build) -> Vec<[f32; 5]> {
    let hem = build.hem;
    // A long coat flares a little.
    let flare = 0.12 * (0.78 - hem);
    let mut rows = vec![
        [0.0, hem, 0.0, 0.174 + flare, 0.138 + flare],
        [0.0, hem + 0.012, 0.0, 0.188 + flare, 0.152 + flare],
    ];
    rows.push([0.0, 0.5 * (hem + 0.90), 0.0, 0.188 + 0.5 * flare, 0.149 + 0.5 * flare]);
    rows.extend([
        [0.0, 0.90, -0.002, 0.183, 0.138],
        [0.0, 1.00, -0.005, 0.166, 0.121],
        [0.0, 1.09, -0.002, 0.154, 0.112],
        [0.0, 1.18, 0.004, 0.160, 0.117],
        [0.0, 1.27, 0.006, 0.171, 0.123],
        [0.0, 1.35, 0.0, 0.178, 0.117],
        [0.0, 1.41, -0.008, 0.171, 0.100],
        [0.0, 1.45, -0.013, 0.128, 0.080],
        [0.0, 1.475, -0.015, 0.086, 0.066],
        [0.0, 1.492, -0.015, 0.064, 0.058],
    ]);
    for row in &mut rows {
        // Shoulders keep their breadth, where the arms start.
        let g = if row[1] > 1.3 { 1.0 } else { build.girth };
        row[3] *= g;
        row[4] *= g;
    }
    rows
}

/// A shoe around x = 0.09 or its mirror image, from heel to toes, flat below.
fn shoe(sign: f32, rings: u32, sides: u32) -> Geometry {
    // Distance along the foot, height of the middle, half width, half height.
    const ROWS: [[f32; 4]; 9] = [
        [-0.074, 0.046, 0.016, 0.024],
        [-0.066, 0.046, 0.030, 0.044],
        [-0.035, 0.050, 0.040, 0.064],
        [0.015, 0.052, 0.042, 0.068],
        [0.065, 0.042, 0.045, 0.056],
        [0.115, 0.034, 0.048, 0.044],
        [0.155, 0.028, 0.045, 0.034],
        [0.188, 0.024, 0.033, 0.027],
        [0.203, 0.022, 0.014, 0.017],
    ];
    let girths: Vec<Girth> = ROWS
        .iter()
        .map(|&[z, y, w, h]| Girth {
            center: Vec3::new(sign * (HIP[0] + 0.006), y, z),
            half: Vec2::new(w, h),
        })
        .collect();
    let rings: Vec<Vec<Vec3>> = between(&girths, rings)
        .into_iter()
        .map(|g| {
            let mut ring = oval(g, [Vec3::X, Vec3::Y], 2.4, sides);
            for p in &mut ring {
                p.y = p.y.max(0.0);
            }
            ring
        })
        .collect();
    loft(&rings)
}

const SLEEVE: &[[f32; 5]] = &[
    [0.241, 0.872, 0.0, 0.032, 0.034],
    [0.240, 0.880, 0.0, 0.038, 0.041],
    [0.233, 0.97, -0.001, 0.041, 0.044],
    [0.224, 1.06, -0.003, 0.044, 0.047],
    [0.219, 1.12, -0.005, 0.047, 0.049],
    [0.211, 1.20, -0.007, 0.050, 0.053],
    [0.201, 1.29, -0.009, 0.054, 0.058],
    [0.190, 1.37, -0.011, 0.057, 0.063],
    [0.177, 1.425, -0.012, 0.048, 0.056],
    [0.163, 1.452, -0.012, 0.026, 0.034],
];

const HAND: &[[f32; 5]] = &[
    [0.254, 0.697, 0.012, 0.007, 0.012],
    [0.254, 0.707, 0.010, 0.013, 0.025],
    [0.252, 0.76, 0.006, 0.016, 0.038],
    [0.248, 0.81, 0.002, 0.019, 0.042],
    [0.244, 0.855, 0.0, 0.022, 0.034],
    [0.241, 0.90, 0.0, 0.026, 0.028],
];

const THUMB: &[[f32; 5]] = &[
    [0.240, 0.752, 0.053, 0.006, 0.007],
    [0.240, 0.772, 0.050, 0.010, 0.011],
    [0.242, 0.81, 0.038, 0.011, 0.014],
    [0.244, 0.842, 0.020, 0.011, 0.014],
];

const LEG_ROWS: &[[f32; 5]] = &[
    [0.092, 0.052, -0.010, 0.044, 0.052],
    [0.092, 0.062, -0.010, 0.049, 0.059],
    [0.092, 0.13, -0.012, 0.049, 0.059],
    [0.092, 0.22, -0.019, 0.052, 0.062],
    [0.092, 0.32, -0.025, 0.056, 0.066],
    [0.091, 0.42, -0.014, 0.055, 0.064],
    [0.090, 0.50, -0.003, 0.056, 0.064],
    [0.089, 0.59, 0.0, 0.062, 0.070],
    [0.088, 0.70, 0.0, 0.072, 0.081],
    [0.087, 0.82, -0.002, 0.080, 0.092],
    [0.086, 0.91, -0.004, 0.079, 0.098],
    [0.080, 0.97, -0.004, 0.055, 0.075],
];

const HEAD_ROWS: &[[f32; 5]] = &[
    [0.0, 1.462, -0.014, 0.046, 0.046],
    [0.0, 1.50, -0.010, 0.051, 0.052],
    [0.0, 1.535, -0.004, 0.052, 0.056],
    [0.0, 1.555, 0.012, 0.054, 0.072],
    [0.0, 1.578, 0.019, 0.062, 0.084],
    [0.0, 1.615, 0.013, 0.070, 0.092],
    [0.0, 1.655, 0.005, 0.075, 0.097],
    [0.0, 1.695, 0.0, 0.073, 0.095],
    [0.0, 1.728, -0.004, 0.060, 0.082],
    [0.0, 1.748, -0.006, 0.038, 0.054],
    [0.0, 1.757, -0.006, 0.014, 0.02],
];

const NOSE: &[[f32; 5]] = &[
    [0.0, 1.603, 0.102, 0.010, 0.010],
    [0.0, 1.612, 0.108, 0.014, 0.015],
    [0.0, 1.637, 0.101, 0.009, 0.012],
    [0.0, 1.662, 0.092, 0.005, 0.008],
];

const HAIR: &[[f32; 5]] = &[
    [0.0, 1.575, -0.042, 0.048, 0.044],
    [0.0, 1.595, -0.038, 0.066, 0.062],
    [0.0, 1.645, -0.030, 0.081, 0.084],
    [0.0, 1.69, -0.017, 0.083, 0.094],
    [0.0, 1.73, -0.009, 0.070, 0.089],
    [0.0, 1.756, -0.007, 0.046, 0.061],
    [0.0, 1.767, -0.007, 0.016, 0.022],
];

const HELMET: &[[f32; 5]] = &[
    [0.0, 1.692, 0.020, 0.092, 0.134],
    [0.0, 1.697, 0.018, 0.100, 0.142],
    [0.0, 1.704, 0.012, 0.096, 0.132],
    [0.0, 1.712, -0.002, 0.092, 0.116],
    [0.0, 1.745, -0.004, 0.084, 0.106],
    [0.0, 1.778, -0.005, 0.060, 0.076],
    [0.0, 1.790, -0.005, 0.022, 0.028],
];
