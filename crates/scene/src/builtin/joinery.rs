//! Planks, prisms, rings and spoked wheels: pieces that carts, houses and machines are joined from.

use std::f32::consts::TAU;

use glam::{Affine3A, Quat, Vec2, Vec3};

use super::kit::Kit;
use super::profile::v2;
use super::shapes::{Frame, Geometry, circle, rectangle, sweep};

/// A straight piece of rectangular section from `a` to `b`: half its width along `side` (made square to the piece), half its
/// thickness across both.
pub(super) fn plank(a: Vec3, b: Vec3, side: Vec3, half: [f32; 2]) -> Geometry {
    let along = (b - a).normalize_or(Vec3::Y);
    let x = (side - along * along.dot(side)).normalize_or(along.any_orthonormal_vector());
    let y = along.cross(x);
    let outline = rectangle(v2(-half[0], -half[1]), v2(half[0], half[1]));
    sweep(&[Frame { origin: a, x, y }, Frame { origin: b, x, y }], &outline, false, false)
}

/// A convex outline (counter-clockwise in x, y) between two depths along Z.
pub(super) fn prism(outline: &[Vec2], [back, front]: [f32; 2]) -> Geometry {
    let frame = |z: f32| Frame { origin: Vec3::Z * z, x: Vec3::X, y: Vec3::Y };
    sweep(&[frame(back), frame(front)], outline, false, false)
}

/// A ring about the Z axis: an outline in (outward, −Z) swept around a circle of a radius.
pub(super) fn ring(radius: f32, outline: &[Vec2], round: bool, segments: u32) -> Geometry {
    let frames: Vec<Frame> = (0..segments.max(3))
        .map(|i| {
            let (s, c) = libm::sincosf(TAU * i as f32 / segments.max(3) as f32);
            let outward = Vec3::new(c, s, 0.0);
            Frame { origin: outward * radius, x: outward, y: Vec3::NEG_Z }
        })
        .collect();
    sweep(&frames, outline, round, true)
}

/// A torus about the Z axis.
pub(super) fn torus(radius: f32, thickness: f32, [around, across]: [u32; 2]) -> Geometry {
    ring(radius, &circle(thickness, across), true, around)
}

/// Measures of a spoked wheel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wheel {
    /// Outer radius, metres.
    pub(super) radius: f32,
    /// Width of the rim, and its height from inside to outside.
    pub(super) rim: [f32; 2],
    /// How many spokes, and how thick.
    pub(super) spokes: (u32, f32),
    /// Radius and length of the hub.
    pub(super) hub: [f32; 2],
}

impl<S: Copy + PartialEq> Kit<S> {
    /// A straight piece of rectangular section, see [`plank`].
    pub(super) fn plank(&mut self, of: S, a: Vec3, b: Vec3, side: Vec3, half: [f32; 2]) {
        self.at(of, &plank(a, b, side, half), Vec3::ZERO);
    }

    /// A spoked wheel about the Z axis: rim and spokes of one material, tyre and hub of others.
    pub(super) fn wheel(&mut self, wheel: &Wheel, [wood, tyre, hub]: [S; 3]) {
        let Wheel { radius, rim: [width, height], spokes: (count, thick), hub: [hub_radius, length] } =
            *wheel;
        let segments = self.detail.facets(56, 14);
        let half = 0.5 * width;
        let band = 0.12 * height;
        let felloe = rectangle(v2(-height, -half), v2(-0.5 * band, half));
        self.at(wood, &ring(radius, &felloe, false, segments), Vec3::ZERO);
        let iron = rectangle(v2(-band, -1.08 * half), v2(0.0, 1.08 * half));
        self.at(tyre, &ring(radius, &iron, false, segments), Vec3::ZERO);
        for i in 0..count {
            let d = Quat::from_rotation_z(TAU * i as f32 / count as f32) * Vec3::Y;
            self.bar(wood, &[d * (0.6 * hub_radius), d * (radius - 0.6 * height)], thick, 8);
        }
        let barrel = [
            [0.75 * hub_radius, -0.5 * length],
            [hub_radius, -0.3 * length],
            [hub_radius, 0.3 * length],
            [0.75 * hub_radius, 0.5 * length],
        ];
        self.turned_along(hub, Vec3::ZERO, Vec3::Z, &barrel, 20);
    }

    /// A convex outline between two depths along Z, placed.
    pub(super) fn prism(&mut self, of: S, outline: &[[f32; 2]], depths: [f32; 2], placement: &Affine3A) {
        let outline: Vec<Vec2> = outline.iter().map(|&[x, y]| v2(x, y)).collect();
        self.add(of, &prism(&outline, depths), placement);
    }

    /// A barrel of staves with hoops, 0.86 m high, from its foot.
    pub(super) fn cask(&mut self, [wood, iron]: [S; 2]) {
        let side = [
            [0.0, -0.03],
            [0.25, -0.03],
            [0.285, 0.16],
            [0.305, 0.42],
            [0.285, 0.68],
            [0.25, 0.86],
            [0.225, 0.86],
            [0.225, 0.82],
            [0.0, 0.82],
        ];
        self.turned(wood, Vec3::ZERO, &side, 26);
        for (y, r) in [(0.06, 0.268), (0.24, 0.296), (0.6, 0.297), (0.79, 0.268)] {
            let hoop = [[r - 0.02, -0.025], [r + 0.006, -0.025], [r + 0.006, 0.025], [r - 0.02, 0.025]];
            self.turned(iron, Vec3::Y * y, &hoop, 26);
        }
    }

    /// A crate of 0.8 m about the middle of its underside: boards in a frame, braced.
    pub(super) fn crate_box(&mut self, [boards, frame]: [S; 2]) {
        if !self.fine() {
            self.plain(boards, [-0.4, 0.0, -0.4], [0.4, 0.8, 0.4]);
            return;
        }
        self.plain(boards, [-0.37, 0.01, -0.37], [0.37, 0.78, 0.37]);
        for s in [-1.0_f32, 1.0] {
            for y in [0.0, 0.35, 0.7] {
                self.block(frame, [-0.4, y, s * 0.385 - 0.015], [0.4, y + 0.1, s * 0.385 + 0.015], 0.006);
                self.block(frame, [s * 0.385 - 0.015, y, -0.37], [s * 0.385 + 0.015, y + 0.1, 0.37], 0.006);
            }
            for x in [-0.385, 0.385] {
                self.block(frame, [x - 0.02, 0.0, s * 0.39 - 0.02], [x + 0.02, 0.8, s * 0.39 + 0.02], 0.006);
            }
            let (a, b) = (Vec3::new(s * 0.34, 0.1, s * 0.385), Vec3::new(-s * 0.34, 0.7, s * 0.385));
            self.plank(frame, a, b, Vec3::X, [0.05, 0.012]);
        }
    }
}
