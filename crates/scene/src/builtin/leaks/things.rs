//! What stands, lies and hangs in the gallery.

use glam::{Affine3A, Quat, Vec3};

use super::palette::Stuff::{self, *};
use super::plan::*;
use crate::builtin::Detail;
use crate::builtin::kit::Kit;
use crate::builtin::shapes::{Geometry, cloth, cuboid, lathe};

type Things = Kit<Stuff>;

fn p(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(x, y, z)
}

/// Blocks that share faces and edges, each an object of its own.
pub(super) fn blocks(detail: Detail) -> Vec<Things> {
    [
        (Coral, [4.0, 0.0, 2.5], [4.5, 0.5, 3.0]),
        (Chalk, [4.5, 0.0, 2.5], [5.0, 0.5, 3.0]),
        (Ink, [4.0, 0.0, 3.0], [4.5, 0.5, 3.5]),
        (Mustard, [4.0, 0.5, 2.5], [4.5, 1.0, 3.0]),
        (Teal, [5.0, 0.0, 2.5], [5.5, 1.5, 3.0]),
        (Chalk, [4.5, 0.0, 3.0], [5.5, 0.25, 3.5]),
        // Meets the teal one along one upright edge only.
        (Coral, [5.5, 0.0, 3.0], [6.0, 0.75, 3.5]),
        // Meets the row along edges on the floor only.
        (Mustard, [3.5, 0.0, 3.5], [4.0, 0.5, 4.0]),
    ]
    .into_iter()
    .map(|(of, a, b)| {
        let mut k: Things = Kit::new(detail);
        k.plain(of, a, b);
        k
    })
    .collect()
}

/// Round and leaning things that touch in points and lines: a ball and rollers on the floor, a plank against the wall.
pub(super) fn contacts(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let ball = |radius: f32| -> Geometry {
        let rings = detail.facets(32, 8);
        let profile: Vec<_> = (0..=rings)
            .map(|i| {
                let (s, c) = libm::sincosf(std::f32::consts::PI * i as f32 / rings as f32);
                let s = if i == 0 || i == rings { 0.0 } else { s };
                glam::Vec2::new(radius * s, radius - radius * c)
            })
            .collect();
        lathe(&profile, detail.facets(56, 10))
    };
    k.at(Chalk, &ball(0.36), p(3.3, 0.0, 2.3));
    k.at(Coral, &ball(0.16), p(6.45, 0.0, 2.55));
    // Rollers: the second lies against the first.
    for (i, of) in [(0, Teal), (1, Paper)] {
        let at = p(6.3, 0.2, 4.5 + 0.4 * i as f32);
        k.turned_along(of, at, Vec3::X, &[[0.2, 0.0], [0.2, 0.8]], 40);
    }
    // A plank that leans: its lower edge on the floor, its upper one against the south wall.
    let lean = 0.28_f32;
    let plank = cuboid(p(-0.14, 0.0, -0.02), p(0.14, 2.3, 0.0));
    for (i, x) in [4.6, 5.0].into_iter().enumerate() {
        let turn = Quat::from_rotation_x(lean + 0.06 * i as f32);
        let top = turn * p(0.0, 2.3, 0.0);
        // The lower corner that comes first to the floor is the one at the front.
        let foot = turn * p(0.0, 0.0, -0.02);
        let at = p(x, -foot.y.min(0.0), HALL[1] - top.z);
        k.add(Oak, &plank, &Affine3A::from_rotation_translation(turn, at));
    }
    k
}

/// A cube about its middle, to be sunk into the floor.
pub(super) fn sunk(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    k.plain(Teal, [-0.4, -0.4, -0.4], [0.4, 0.4, 0.4]);
    k
}

/// Carpet, a bench folded from sheets of 5 mm, a low table of the same, and what lies on them.
pub(super) fn seats(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let pile = 0.008;
    k.plain(Carpet, [-6.7, 0.0, 1.7], [-3.2, pile, 4.3]);
    let bench = |k: &mut Things, [x0, x1]: [f32; 2], [z0, z1]: [f32; 2], [foot, y]: [f32; 2], of: Stuff| {
        k.plain(of, [x0, y - SHEET, z0], [x1, y, z1]);
        for x in [x0, x1 - SHEET] {
            k.plain(of, [x, foot, z0], [x + SHEET, y - SHEET, z1]);
        }
    };
    bench(&mut k, [-6.3, -4.3], [1.85, 2.35], [pile, 0.42], DarkSteel);
    bench(&mut k, [-5.9, -4.5], [2.9, 3.5], [pile, 0.30], Rust);
    bench(&mut k, [-3.95, -3.45], [2.4, 3.6], [pile, 0.42], DarkSteel);
    // One more along the other face of the bookcase's partition, and a board over it, both against it.
    let face = BOOKCASE[0] + HALF;
    bench(&mut k, [-6.7, -4.3], [face, face + 0.4], [0.0, 0.42], Rust);
    k.plain(Oak, [-6.7, 1.3, face], [-4.3, 1.3 + BOARD, face + 0.2]);
    for (i, of) in [Chalk, Teal, Mustard].into_iter().enumerate() {
        let x = -6.2 + 0.62 * i as f32;
        let vase = [[0.05, 0.0], [0.075, 0.05], [0.08, 0.12], [0.035, 0.2], [0.03, 0.25], [0.04, 0.27]];
        k.round(of, p(x, 1.3 + BOARD, face + 0.1), &vase, 28);
    }
    // Cushions lie flat on the seats and against each other.
    k.plain(Mustard, [-6.3, 0.42, 1.85], [-5.63, 0.5, 2.35]);
    k.plain(Linen, [-5.63, 0.42, 1.85], [-4.96, 0.5, 2.35]);
    k.plain(Mustard, [-4.96, 0.42, 1.85], [-4.3, 0.5, 2.35]);
    k.plain(Coral, [-3.95, 0.42, 2.4], [-3.45, 0.5, 3.0]);
    // Books, a bowl and a board on the table.
    k.plain(Ink, [-5.7, 0.30, 3.0], [-5.4, 0.325, 3.22]);
    k.plain(Paper, [-5.69, 0.325, 3.01], [-5.43, 0.355, 3.2]);
    let bowl = [
        [0.0, 0.0],
        [0.07, 0.0],
        [0.12, 0.03],
        [0.17, 0.09],
        [0.16, 0.09],
        [0.11, 0.04],
        [0.06, 0.015],
        [0.0, 0.012],
    ];
    k.round(Chalk, p(-4.95, 0.30, 3.2), &bowl, 36);
    k
}

/// A curtain's rod along X with rings, about its middle.
pub(super) fn rod(detail: Detail, half: f32) -> Things {
    let mut k: Things = Kit::new(detail);
    k.bar(DarkSteel, &[Vec3::X * -half, Vec3::X * half], 0.014, 14);
    for s in [-1.0_f32, 1.0] {
        let knob = [[0.0, 0.0], [0.02, 0.004], [0.028, 0.025], [0.02, 0.046], [0.0, 0.05]];
        k.turned_along(DarkSteel, Vec3::X * (s * half), Vec3::X * s, &knob, 16);
    }
    k
}

/// The red curtain: 4.4 × 3.5 m in deep folds.
pub(super) fn red_curtain(detail: Detail) -> Geometry {
    cloth(4.4, 3.5, 19.0, 0.12, [detail.facets(380, 76), detail.facets(26, 4)], 71)
}

/// The linen curtain: 2.6 × 2.5 m.
pub(super) fn linen_curtain(detail: Detail) -> Geometry {
    cloth(2.6, 2.52, 12.0, 0.09, [detail.facets(240, 48), detail.facets(20, 4)], 72)
}

/// A cart on four wheels about the middle of the floor under it; it rolls along X.
pub(super) fn cart(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    k.plain(DarkSteel, [-0.42, 0.14, -0.2], [0.42, 0.16, 0.2]);
    for x in [-0.32, 0.32] {
        for z in [-0.2, 0.16] {
            k.turned_along(
                Ink,
                p(x, 0.08, z),
                Vec3::Z,
                &[[0.072, 0.0], [0.08, 0.008], [0.08, 0.032], [0.072, 0.04]],
                28,
            );
        }
        k.bar(Steel, &[p(x, 0.08, -0.2), p(x, 0.08, 0.2)], 0.012, 8);
        k.plain(DarkSteel, [x - 0.02, 0.08, -0.02], [x + 0.02, 0.14, 0.02]);
    }
    // Its load: two boxes that touch.
    k.plain(Mustard, [-0.38, 0.16, -0.18], [0.06, 0.74, 0.18]);
    k.plain(Chalk, [0.06, 0.16, -0.18], [0.38, 0.48, 0.18]);
    k
}

/// A pendant lamp's cord and shade about its lower rim.
pub(super) fn pendant(detail: Detail, cord: f32) -> Things {
    let mut k: Things = Kit::new(detail);
    k.bar(Ink, &[Vec3::Y * 0.2, Vec3::Y * cord], 0.006, 6);
    let shade =
        [[0.19, 0.0], [0.195, 0.0], [0.16, 0.09], [0.08, 0.17], [0.03, 0.2], [0.03, 0.24], [0.0, 0.24]];
    // Hollow: up inside, down outside, so that the profile runs from the axis to the axis.
    let mut profile = vec![[0.0, 0.16], [0.07, 0.155], [0.15, 0.085]];
    profile.extend(shade);
    k.turned(Ink, Vec3::ZERO, &profile, 32);
    k
}

/// Its glowing disc.
pub(super) fn bulb(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    k.turned(Lamp, Vec3::Y * 0.035, &[[0.0, 0.0], [0.1, 0.0], [0.1, 0.02], [0.0, 0.02]], 28);
    k
}

/// A flat lamp about the middle of its upper face.
pub(super) fn panel(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    k.plain(Lamp, [-0.4, -0.015, -0.06], [0.4, 0.0, 0.06]);
    k
}
