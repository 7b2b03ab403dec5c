//! What stands and hangs in the street, each piece about its own foot.

use std::f32::consts::{FRAC_PI_2, TAU};

use glam::{Affine3A, Quat, Vec3};

use super::palette::Stuff::{self, *};
use super::plan::*;
use crate::builtin::Detail;
use crate::builtin::joinery::torus;
use crate::builtin::kit::Kit;
use crate::builtin::noise::unit;

type Things = Kit<Stuff>;

fn p(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(x, y, z)
}

/// Roadway, kerbs, pavements, rails and covers.
pub(super) fn ground(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let (x0, x1) = (-LENGTH - 9.0, LENGTH + 1.0);
    k.plain(Cobbles, [x0, -0.6, -KERB], [x1, 0.0, KERB]);
    for s in [-1.0_f32, 1.0] {
        let (a, b) = (s * (KERB + 0.22), s * (FRONTS + 4.0));
        k.plain(Paving, [x0, -0.6, a.min(b)], [x1, PAVEMENT, a.max(b)]);
        let stones = libm::floorf((x1 - x0) / 1.25) as u32;
        let long = (x1 - x0) / stones as f32;
        for i in 0..stones {
            let at = x0 + long * i as f32;
            let (a, b) = (s * KERB, s * (KERB + 0.22));
            k.block(
                Kerb,
                [at + 0.004, -0.5, a.min(b)],
                [at + long - 0.004, PAVEMENT + 0.004, a.max(b)],
                0.018,
            );
        }
        // Gullies along the kerb.
        for i in 0..5 {
            let at = -16.0 + 8.0 * i as f32;
            let z = s * (KERB - 0.22);
            k.plain(Iron, [at - 0.28, -0.05, z - 0.2], [at + 0.28, 0.006, z + 0.2]);
            for j in 0..7 {
                let x = at - 0.24 + 0.07 * j as f32;
                k.plain(Iron, [x, 0.0, z - 0.17], [x + 0.04, 0.016, z + 0.17]);
            }
        }
    }
    // Rails of a tram, and covers.
    for z in [-1.9, -0.47] {
        k.plain(Steel, [x0, -0.1, z - 0.035], [x1, 0.008, z + 0.035]);
        k.plain(Iron, [x0, -0.1, z + 0.05], [x1, 0.004, z + 0.075]);
    }
    for (x, z) in [(-10.5, 1.7), (2.2, 0.9), (16.2, 1.3)] {
        k.turned(Iron, p(x, -0.05, z), &[[0.36, 0.0], [0.36, 0.058], [0.33, 0.064]], 36);
        for i in 0..12 {
            let d = Quat::from_rotation_y(TAU * i as f32 / 12.0) * Vec3::X;
            k.turned(Iron, p(x, 0.008, z) + d * 0.22, &[[0.03, 0.0], [0.03, 0.011], [0.02, 0.014]], 8);
        }
    }
    k
}

/// A round table on three feet, with cups, 0.74 m high.
pub(super) fn table(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    k.turned(Marble, p(0.0, 0.71, 0.0), &[[0.32, 0.0], [0.35, 0.008], [0.35, 0.024], [0.335, 0.032]], 44);
    k.turned(Brass, p(0.0, 0.712, 0.0), &[[0.34, -0.002], [0.356, 0.0], [0.356, 0.02], [0.34, 0.022]], 44);
    k.turned(
        Iron,
        p(0.0, 0.02, 0.0),
        &[[0.05, 0.0], [0.05, 0.1], [0.024, 0.14], [0.02, 0.6], [0.05, 0.66], [0.12, 0.692]],
        16,
    );
    for i in 0..3 {
        let d = Quat::from_rotation_y(TAU * i as f32 / 3.0) * Vec3::X;
        k.bar(Iron, &[p(0.0, 0.16, 0.0), d * 0.14 + Vec3::Y * 0.11, d * 0.3 + Vec3::Y * 0.02], 0.016, 8);
        k.turned(Iron, d * 0.3 - Vec3::Y * 0.004, &[[0.025, 0.0], [0.025, 0.014], [0.012, 0.03]], 10);
    }
    for (x, z, of) in [(0.15, 0.08, White), (-0.13, 0.12, White), (0.02, -0.17, Green)] {
        let at = p(x, 0.741, z);
        if of == White {
            k.turned(
                White,
                at,
                &[[0.0, 0.0], [0.035, 0.0], [0.07, 0.012], [0.068, 0.015], [0.03, 0.006], [0.0, 0.006]],
                22,
            );
            let cup = [
                [0.0, 0.006],
                [0.022, 0.006],
                [0.036, 0.03],
                [0.038, 0.06],
                [0.035, 0.06],
                [0.032, 0.03],
                [0.0, 0.014],
            ];
            k.turned(White, at, &cup, 20);
            let ear = torus(0.016, 0.004, [detail.facets(14, 6), detail.facets(6, 3)]);
            k.at(White, &ear, at + p(0.046, 0.036, 0.0));
        } else {
            let bottle = [
                [0.0, 0.0],
                [0.035, 0.0],
                [0.037, 0.01],
                [0.037, 0.15],
                [0.014, 0.2],
                [0.013, 0.26],
                [0.016, 0.262],
                [0.0, 0.27],
            ];
            k.turned(Green, at, &bottle, 18);
        }
    }
    k
}

/// A chair of bent wood, its front towards +Z.
pub(super) fn chair(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    k.turned(
        Wood,
        p(0.0, 0.44, 0.0),
        &[[0.19, 0.0], [0.215, 0.01], [0.215, 0.03], [0.19, 0.036], [0.0, 0.03]],
        30,
    );
    for (x, z) in [(-0.14, 0.14), (0.14, 0.14)] {
        k.bar(Wood, &[p(x, 0.445, z), p(1.2 * x, 0.0, 1.25 * z)], 0.015, 8);
    }
    let pieces = detail.facets(12, 5);
    let bow: Vec<Vec3> = (0..=pieces)
        .map(|i| {
            let (s, c) = libm::sincosf(std::f32::consts::PI * i as f32 / pieces as f32);
            p(-0.185 * c, 0.6 + 0.29 * s, -0.17 - 0.07 * s)
        })
        .collect();
    let mut back = vec![p(-0.165, 0.0, -0.23)];
    back.extend(&bow);
    back.push(p(0.165, 0.0, -0.23));
    k.bar(Wood, &back, 0.0145, 8);
    let inner: Vec<Vec3> = (0..=pieces)
        .map(|i| {
            let (s, c) = libm::sincosf(std::f32::consts::PI * i as f32 / pieces as f32);
            p(-0.11 * c, 0.46 + 0.33 * s, -0.165 - 0.055 * s)
        })
        .collect();
    k.bar(Wood, &inner, 0.011, 8);
    let hoop = torus(0.165, 0.009, [detail.facets(28, 8), detail.facets(6, 3)]);
    k.add(
        Wood,
        &hoop,
        &Affine3A::from_rotation_translation(Quat::from_rotation_x(FRAC_PI_2), p(0.0, 0.22, 0.0)),
    );
    k
}

/// A lantern on a cast post: its glass is dark.
pub(super) fn lantern(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let post = [
        [0.16, 0.0],
        [0.16, 0.12],
        [0.11, 0.2],
        [0.085, 0.85],
        [0.105, 0.9],
        [0.06, 0.98],
        [0.045, 2.9],
        [0.075, 2.95],
        [0.04, 3.02],
        [0.035, 3.2],
        [0.09, 3.26],
    ];
    k.turned(Iron, Vec3::ZERO, &post, 20);
    k.bar(Iron, &[p(-0.3, 2.85, 0.0), p(0.3, 2.85, 0.0)], 0.018, 8);
    for s in [-1.0, 1.0] {
        k.turned_along(
            Iron,
            p(0.3 * s, 2.85, 0.0),
            Vec3::X * s,
            &[[0.026, 0.0], [0.03, 0.02], [0.0, 0.045]],
            12,
        );
    }
    // A lamp of four sides that widens upwards.
    let (low, high) = (0.11, 0.18);
    let glass = [[0.9 * low, 3.26], [0.9 * high, 3.72]];
    k.turned(Glass, Vec3::ZERO, &glass, 12);
    for i in 0..4 {
        let d = Quat::from_rotation_y(TAU * (i as f32 + 0.5) / 4.0) * Vec3::X;
        k.bar(Iron, &[d * (low * 1.25) + Vec3::Y * 3.25, d * (high * 1.25) + Vec3::Y * 3.73], 0.011, 6);
    }
    k.turned(
        Iron,
        p(0.0, 3.72, 0.0),
        &[[0.25, 0.0], [0.25, 0.025], [0.12, 0.17], [0.05, 0.2], [0.03, 0.3], [0.0, 0.33]],
        24,
    );
    k
}

/// A string of bulbs that are off, along Z from front to front, hung at y = 0 at both ends.
pub(super) fn string(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let sag = |t: f32| p(0.0, -0.9 * (1.0 - (2.0 * t - 1.0) * (2.0 * t - 1.0)), FRONTS * (2.0 * t - 1.0));
    let pieces = 24;
    let line: Vec<Vec3> = (0..=pieces).map(|i| sag(i as f32 / pieces as f32)).collect();
    k.bar(Black, &line, 0.009, 6);
    for i in 0..14 {
        let at = sag((i as f32 + 0.5) / 14.0);
        if k.fine() {
            k.turned(Black, at - Vec3::Y * 0.07, &[[0.02, 0.0], [0.02, 0.06], [0.012, 0.075]], 10);
        }
        k.turned(
            Glass,
            at - Vec3::Y * 0.16,
            &[[0.0, 0.0], [0.025, 0.01], [0.042, 0.04], [0.03, 0.075], [0.016, 0.095]],
            14,
        );
    }
    k
}

/// A bollard.
pub(super) fn bollard(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let side = [
        [0.1, -0.05],
        [0.1, 0.1],
        [0.075, 0.14],
        [0.065, 0.7],
        [0.085, 0.74],
        [0.085, 0.8],
        [0.06, 0.84],
        [0.075, 0.9],
        [0.05, 0.97],
        [0.0, 0.99],
    ];
    k.turned(Iron, Vec3::ZERO, &side, 20);
    k
}

/// A tub with a clipped shrub.
pub(super) fn tub(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let side = [
        [0.0, 0.0],
        [0.24, 0.0],
        [0.3, 0.4],
        [0.33, 0.4],
        [0.33, 0.46],
        [0.29, 0.46],
        [0.27, 0.4],
        [0.0, 0.4],
    ];
    k.turned(Terracotta, Vec3::ZERO, &side, 26);
    k.bar(Wood, &[p(0.0, 0.35, 0.0), p(0.02, 0.75, 0.01), p(0.0, 1.05, 0.0)], 0.03, 8);
    // Leaves: thin boats, closed.
    let count = detail.count(230, 26);
    let size = libm::sqrtf(230.0 / count as f32).min(2.2);
    for i in 0..count {
        let r = |c: u32| unit(831, 8 * i + c);
        let y = 1.0 - 2.0 * (i as f32 + 0.5) / count as f32;
        let turn = 2.399_963 * i as f32;
        let (s, c) = libm::sincosf(turn);
        let around = libm::sqrtf(1.0 - y * y);
        let d = p(around * c, y, around * s);
        let at = p(0.0, 1.22, 0.0) + d * (0.36 + 0.05 * r(0));
        let (long, wide) = (0.075 * size, 0.035 * size);
        let along = (d.cross(Vec3::new(r(1) - 0.5, r(2) - 0.5, r(3) - 0.5)) + d * 0.5).normalize_or(Vec3::Y);
        let side = along.cross(d).normalize_or(Vec3::X);
        let tips = [at - along * long, at + along * long];
        let rim = [at + side * wide, at - side * wide];
        let up = side.cross(along) * (0.25 * wide);
        let mut leaf = crate::builtin::shapes::Geometry::new();
        for face in [
            [tips[0], rim[1], at + up],
            [rim[1], tips[1], at + up],
            [tips[1], rim[0], at + up],
            [rim[0], tips[0], at + up],
        ] {
            leaf.polygon(&face);
            leaf.polygon(&[face[1], face[0], at - up]);
        }
        if leaf.signed_volume() < 0.0 {
            leaf.triangles.iter_mut().for_each(|t| t.swap(1, 2));
            leaf.normals.iter_mut().for_each(|n| *n = -*n);
        }
        k.at(Leaf, &leaf, Vec3::ZERO);
    }
    k
}

/// A wheel of a bicycle, about the Z axis.
fn bicycle_wheel(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let [around, across] = [detail.facets(40, 12), detail.facets(8, 4)];
    k.at(Black, &torus(0.325, 0.017, [around, across]), Vec3::ZERO);
    k.at(Steel, &torus(0.302, 0.009, [around, across]), Vec3::ZERO);
    for i in 0..24 {
        let turn = Quat::from_rotation_z(TAU * i as f32 / 24.0);
        let s = if i % 2 == 0 { 1.0 } else { -1.0 };
        k.bar(Steel, &[turn * p(0.018, 0.0, 0.03 * s), turn * p(0.02, 0.302, 0.004 * s)], 0.0018, 4);
    }
    k.turned_along(
        Steel,
        p(0.0, 0.0, -0.045),
        Vec3::Z,
        &[[0.02, 0.0], [0.02, 0.02], [0.012, 0.025], [0.012, 0.065], [0.02, 0.07], [0.02, 0.09]],
        12,
    );
    k
}

/// A bicycle that leans on its stand, along X.
pub(super) fn bicycle(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let (rear, front) = (p(-0.52, 0.342, 0.0), p(0.55, 0.342, 0.0));
    let wheel = bicycle_wheel(detail);
    k.at_all(&wheel, rear);
    k.at_all(&wheel, front);
    let (crank, seat, head, neck) =
        (p(-0.08, 0.3, 0.0), p(-0.22, 0.78, 0.0), p(0.4, 0.8, 0.0), p(0.43, 0.66, 0.0));
    let paint = Red;
    k.bar(paint, &[crank, seat], 0.015, 10);
    k.bar(paint, &[seat - Vec3::Y * 0.06, head], 0.014, 10);
    k.bar(paint, &[crank, neck], 0.016, 10);
    k.bar(paint, &[head + Vec3::Y * 0.06, neck - Vec3::Y * 0.03], 0.018, 10);
    for s in [-1.0, 1.0] {
        let z = Vec3::Z * (0.055 * s);
        k.bar(paint, &[seat - Vec3::Y * 0.08, rear + z], 0.009, 8);
        k.bar(paint, &[crank, rear + z], 0.01, 8);
        k.bar(paint, &[neck - Vec3::Y * 0.03 + z, neck - Vec3::Y * 0.1 + z, front + z], 0.011, 8);
        k.bar(Steel, &[crank + z * 1.4, crank + p(0.12 * s, -0.11 * s, 0.085 * s)], 0.009, 6);
        k.block(
            Black,
            [crank.x + 0.12 * s - 0.045, crank.y - 0.11 * s - 0.012, 0.09 * s - 0.035],
            [crank.x + 0.12 * s + 0.045, crank.y - 0.11 * s + 0.012, 0.09 * s + 0.035],
            0.004,
        );
    }
    k.bar(paint, &[neck - Vec3::Y * 0.03 - Vec3::Z * 0.06, neck - Vec3::Y * 0.03 + Vec3::Z * 0.06], 0.013, 8);
    k.bar(Steel, &[seat, seat + p(-0.03, 0.1, 0.0)], 0.012, 8);
    k.block(Wood, [-0.37, 0.875, -0.07], [-0.1, 0.92, 0.07], 0.018);
    k.bar(Steel, &[head + Vec3::Y * 0.05, head + p(-0.01, 0.16, 0.0)], 0.012, 8);
    k.bar(
        Steel,
        &[
            p(0.2, 0.97, -0.27),
            p(0.36, 0.98, -0.22),
            p(0.4, 0.965, 0.0),
            p(0.36, 0.98, 0.22),
            p(0.2, 0.97, 0.27),
        ],
        0.011,
        8,
    );
    k.turned_along(
        Steel,
        crank - Vec3::Z * 0.012,
        Vec3::Z,
        &[[0.085, 0.0], [0.09, 0.004], [0.085, 0.008], [0.03, 0.024]],
        26,
    );
    // A stand under the rear axle, and a basket on the handlebar.
    k.bar(Steel, &[rear + p(0.03, 0.0, 0.06), p(-0.44, 0.0, 0.2)], 0.008, 6);
    for y in [0.84, 0.9, 0.96] {
        k.bar(Wood, &[p(0.44, y, -0.15), p(0.7, y, -0.15), p(0.7, y, 0.15), p(0.44, y, 0.15)], 0.007, 6);
    }
    for i in 0..5 {
        let z = -0.15 + 0.075 * i as f32;
        k.bar(Wood, &[p(0.44, 0.8, z), p(0.7, 0.8, z), p(0.72, 0.98, z)], 0.006, 6);
    }
    k
}
