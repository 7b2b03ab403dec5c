//! What is attached to the hangar outside: modules, booms, solar panels, the mast and its dish; each about its own origin.

use std::f32::consts::{FRAC_PI_2, TAU};

use glam::{Quat, Vec3};

use super::palette::Stuff::{self, *};
use super::plan::*;
use crate::builtin::Detail;
use crate::builtin::kit::Kit;
use crate::builtin::noise::unit;

type Things = Kit<Stuff>;

fn p(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(x, y, z)
}

/// A pressurised module along +X from the hangar's wall.
pub(super) fn module(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let length = MODULE[1];
    let hull = [
        [1.15, 0.0],
        [1.15, 0.5],
        [1.35, 0.6],
        [1.85, 1.0],
        [1.9, 1.1],
        [1.9, length - 1.4],
        [1.85, length - 1.3],
        [1.2, length - 0.75],
        [1.1, length - 0.6],
        [1.1, length - 0.3],
    ];
    k.turned_along(Hull, Vec3::ZERO, Vec3::X, &hull, 72);
    for i in 0..5 {
        let at = 1.25 + 1.15 * i as f32;
        let ring = [[1.88, -0.07], [1.97, -0.06], [1.97, 0.06], [1.88, 0.07]];
        k.turned_along(Structure, p(at, 0.0, 0.0), Vec3::X, &ring, 64);
    }
    k.turned_along(
        Foil,
        p(2.55, 0.0, 0.0),
        Vec3::X,
        &[[1.88, 0.0], [1.93, 0.01], [1.93, 0.93], [1.88, 0.94]],
        64,
    );
    k.turned_along(
        DarkSteel,
        p(0.12, 0.0, 0.0),
        Vec3::X,
        &[[1.14, 0.0], [1.3, 0.01], [1.3, 0.17], [1.14, 0.18]],
        48,
    );
    // Portholes.
    for i in 0..3 {
        for turn in [0.35_f32, 2.79, 3.9, 5.5] {
            let d = Quat::from_rotation_x(turn) * Vec3::Z;
            let at = p(1.85 + 1.15 * i as f32 + if i > 0 { 1.15 } else { 0.0 }, 0.0, 0.0) + d * 1.86;
            k.turned_along(DarkSteel, at, d, &[[0.30, 0.0], [0.30, 0.09], [0.24, 0.11]], 28);
            k.turned_along(Window, at, d, &[[0.2, 0.02], [0.2, 0.13]], 24);
        }
    }
    // Hand rails and pipes along the hull.
    for i in 0..8 {
        let d = Quat::from_rotation_x(TAU * (i as f32 + 0.5) / 8.0) * Vec3::Y;
        let line = |x: f32, r: f32| p(x, 0.0, 0.0) + d * r;
        if i % 2 == 0 {
            k.pipe(
                Yellow,
                &[line(1.4, 1.86), line(1.4, 2.1), line(5.6, 2.1), line(5.6, 1.86)],
                0.02,
                0.08,
                8,
            );
            for j in 1..4 {
                k.bar(
                    Steel,
                    &[line(1.4 + 1.05 * j as f32, 1.88), line(1.4 + 1.05 * j as f32, 2.1)],
                    0.014,
                    8,
                );
            }
        } else {
            let stuff = [Steel, Copper][i / 2 % 2];
            k.pipe(
                stuff,
                &[line(0.9, 1.5), line(1.2, 2.06), line(5.9, 2.06), line(6.35, 1.5)],
                0.04,
                0.12,
                12,
            );
        }
    }
    for i in 0..26 {
        let r = |c: u32| unit(430, 4 * i + c);
        let turn = Quat::from_rotation_x(TAU * r(0));
        let (w, h) = (0.08 + 0.12 * r(1), 0.05 + 0.12 * r(2));
        let at = p(1.5 + 1.15 * libm::floorf(3.99 * r(3)) + 0.3, 0.0, 0.0);
        let piece = crate::builtin::profile::block(detail, p(-w, 1.86, -w), p(w, 1.92 + h, w), 0.015);
        k.add(Structure, &piece, &glam::Affine3A::from_rotation_translation(turn, at));
    }
    k
}

/// Stays from the hangar's wall to a module, in the module's space.
pub(super) fn stays(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    for (y, z) in [(-1.6, -3.6), (-1.6, 3.6), (3.2, -3.6), (3.2, 3.6)] {
        let foot = p(0.02, y, z);
        let d = p(0.0, y, z).normalize();
        let ends = [p(2.4, 0.0, 0.0) + d * 1.9, p(4.7, 0.0, 0.0) + d * 1.9];
        k.bar(Steel, &[foot, ends[0]], 0.06, 14);
        k.bar(Steel, &[foot, ends[1]], 0.045, 14);
        k.turned_along(DarkSteel, foot, Vec3::X, &[[0.22, -0.05], [0.22, 0.06], [0.1, 0.12]], 20);
        for end in ends {
            k.turned_along(DarkSteel, end, d, &[[0.12, -0.06], [0.12, 0.05], [0.07, 0.08]], 18);
        }
    }
    k
}

/// The instruments at the keel's end, hanging from the origin.
pub(super) fn probe(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    k.turned(Structure, Vec3::ZERO, &[[0.5, -0.5], [0.62, -0.44], [0.62, -0.06], [0.5, 0.02]], 40);
    k.turned(Foil, Vec3::ZERO, &[[0.0, -1.3], [0.3, -1.24], [0.44, -1.0], [0.44, -0.48]], 40);
    k.turned(Signal, p(0.0, -1.42, 0.0), &[[0.0, 0.0], [0.05, 0.02], [0.06, 0.14]], 16);
    for i in 0..6 {
        let d = Quat::from_rotation_y(TAU * i as f32 / 6.0) * Vec3::X;
        k.turned_along(
            DarkSteel,
            d * 0.58 - Vec3::Y * 0.25,
            d,
            &[[0.13, 0.0], [0.13, 0.16], [0.1, 0.18]],
            20,
        );
        k.turned_along(Window, d * 0.6 - Vec3::Y * 0.25, d, &[[0.09, 0.0], [0.09, 0.17]], 18);
        k.bar(Steel, &[d * 0.3 - Vec3::Y * 0.9, d * 1.3 - Vec3::Y * 1.7], 0.012, 8);
    }
    k
}

/// The ring of docking latches at a module's end, which turns about X.
pub(super) fn airlock(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let ring =
        [[0.75, -0.12], [1.28, -0.12], [1.34, -0.06], [1.34, 0.1], [1.22, 0.2], [0.85, 0.22], [0.75, 0.15]];
    k.turned_along(Orange, Vec3::ZERO, Vec3::X, &ring, 56);
    for i in 0..12 {
        let turn = Quat::from_rotation_x(TAU * i as f32 / 12.0);
        let latch = crate::builtin::profile::block(detail, p(0.05, 1.05, -0.07), p(0.34, 1.2, 0.07), 0.02);
        let place = glam::Affine3A::from_quat(turn);
        k.add(DarkSteel, &latch, &place);
        let bolt = crate::builtin::profile::block(detail, p(-0.08, 1.32, -0.1), p(0.06, 1.42, 0.1), 0.02);
        k.add(if i % 3 == 0 { Yellow } else { Steel }, &bolt, &place);
    }
    k
}

/// One bay of a truss along +X: four long bars, a frame at its start, and braces.
pub(super) fn truss_bay(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let [_, length, h] = BOOM;
    let corners = [(-h, -h), (h, -h), (h, h), (-h, h)];
    for i in 0..4 {
        let ((y, z), (y1, z1)) = (corners[i], corners[(i + 1) % 4]);
        k.bar(Steel, &[p(0.0, y, z), p(length, y, z)], 0.032, 14);
        k.bar(Steel, &[p(0.02, y, z), p(0.02, y1, z1)], 0.022, 11);
        k.bar(DarkSteel, &[p(0.02, y, z), p(length - 0.02, y1, z1)], 0.014, 11);
        k.turned_along(DarkSteel, p(0.02, y, z), Vec3::X, &[[0.05, -0.05], [0.05, 0.05]], 12);
    }
    k.bar(Copper, &[p(0.0, 0.1, 0.05), p(length, 0.1, 0.05)], 0.03, 14);
    k.bar(Rubber, &[p(0.0, -0.08, -0.1), p(length, -0.08, -0.1)], 0.022, 11);
    k.block(Structure, [0.3, -0.16, -0.14], [0.62, 0.16, 0.14], 0.02);
    k
}

/// A solar panel on its arm, which reaches 6.6 m along +Z and faces +Y.
pub(super) fn solar_panel(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    k.bar(Steel, &[p(0.0, 0.0, -0.05), p(0.0, 0.0, 6.55)], 0.05, 14);
    k.turned_along(
        DarkSteel,
        p(0.0, 0.0, 0.3),
        Vec3::Z,
        &[[0.09, 0.0], [0.12, 0.04], [0.12, 0.3], [0.09, 0.34]],
        24,
    );
    for s in [-1.0_f32, 1.0] {
        for i in 0..4 {
            let z = 1.0 + 1.4 * i as f32;
            let (a, b) = (s * 0.09, s * 1.2);
            k.plain(Cells, [a.min(b), 0.0, z], [a.max(b), 0.03, z + 1.34]);
            k.plain(Structure, [a.min(b) + 0.05, -0.03, z + 0.2], [a.max(b) - 0.05, 0.001, z + 0.24]);
            k.plain(Structure, [a.min(b) + 0.05, -0.03, z + 1.1], [a.max(b) - 0.05, 0.001, z + 1.14]);
        }
        k.plain(Foil, [s * 1.2 - 0.02, -0.03, 0.98], [s * 1.2 + 0.02, 0.045, 6.58]);
        k.plain(Foil, [s * 0.09 - 0.02, -0.03, 0.98], [s * 0.09 + 0.02, 0.045, 6.58]);
        k.bar(Steel, &[p(0.0, -0.02, 0.75), p(s * 1.2, -0.015, 1.6)], 0.016, 8);
    }
    for i in 0..5 {
        let z = 0.97 + 1.4 * i as f32;
        k.plain(Steel, [-1.2, -0.02, z - 0.014], [1.2, 0.04, z + 0.014]);
    }
    k
}

/// A mast of three posts, upright, with whip antennas on top.
pub(super) fn mast(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let height = MAST.1;
    let post = |i: u32, y: f32| Quat::from_rotation_y(TAU * i as f32 / 3.0) * p(0.34, y, 0.0);
    for i in 0..3 {
        k.bar(Steel, &[post(i, -0.08), post(i, height)], 0.03, 10);
        k.turned(DarkSteel, post(i, -0.08), &[[0.09, 0.0], [0.09, 0.05], [0.05, 0.07]], 14);
        let bays = 7;
        for j in 0..bays {
            let (y0, y1) = (height * j as f32 / bays as f32, height * (j + 1) as f32 / bays as f32);
            k.bar(DarkSteel, &[post(i, y0), post(i + 1, y1)], 0.014, 8);
            k.bar(Steel, &[post(i, y1), post(i + 1, y1)], 0.014, 8);
        }
    }
    k.turned(Structure, p(0.0, height, 0.0), &[[0.45, -0.02], [0.45, 0.05], [0.2, 0.08]], 28);
    for (x, z, long) in [(0.36, 0.1, 2.6), (-0.28, 0.26, 1.9), (-0.2, -0.3, 2.2)] {
        k.bar(Steel, &[p(x, height, z), p(x, height + long, z)], 0.012, 8);
        k.turned(Signal, p(x, height + long, z), &[[0.02, 0.0], [0.03, 0.02], [0.02, 0.05]], 10);
    }
    k
}

/// A dish that looks along +Z and up; it turns about Y. Its foot is the origin.
pub(super) fn dish(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    k.turned(DarkSteel, Vec3::ZERO, &[[0.3, -0.02], [0.3, 0.08], [0.14, 0.14], [0.14, 0.5]], 28);
    let pivot = p(0.0, 0.62, 0.0);
    k.turned_along(
        Structure,
        pivot - Vec3::X * 0.3,
        Vec3::X,
        &[[0.15, 0.0], [0.17, 0.02], [0.17, 0.58], [0.15, 0.6]],
        24,
    );
    let axis = p(0.0, 0.45, 0.9).normalize();
    // A bowl of two skins.
    let steps = 9;
    let bowl = |t: f32, lift: f32| [1.7 * t, 0.52 * t * t + lift];
    let mut skin: Vec<[f32; 2]> = (0..=steps).map(|i| bowl(i as f32 / steps as f32, 0.0)).collect();
    skin.push([1.72, 0.55]);
    skin.extend((0..=steps).rev().map(|i| bowl(0.985 * i as f32 / steps as f32, 0.03)));
    k.turned_along(Radiator, pivot + axis * 0.22, axis, &skin, 56);
    k.turned_along(Structure, pivot, axis, &[[0.22, 0.0], [0.22, 0.2], [0.4, 0.26]], 24);
    let focus = pivot + axis * 1.5;
    for i in 0..3 {
        let side = axis.cross(Vec3::X).normalize();
        let d = Quat::from_axis_angle(axis, TAU * i as f32 / 3.0) * side;
        k.bar(Steel, &[pivot + axis * 0.55 + d * 1.25, focus], 0.018, 8);
    }
    k.turned_along(
        DarkSteel,
        focus - axis * 0.12,
        axis,
        &[[0.05, 0.0], [0.14, 0.06], [0.14, 0.2], [0.08, 0.24]],
        24,
    );
    k
}

/// A container of 2.4 × 1.2 × 1.2 m about the middle of its underside, with corner fittings and ribs.
pub(super) fn container(detail: Detail, color: Stuff) -> Things {
    let mut k: Things = Kit::new(detail);
    k.plain(color, [-1.17, 0.04, -0.57], [1.17, 1.16, 0.57]);
    for x in [-1.2, 1.08] {
        for z in [-0.6, 0.48] {
            k.block(Structure, [x, 0.0, z], [x + 0.12, 1.2, z + 0.12], 0.015);
        }
    }
    for y in [0.0, 1.1] {
        for z in [-0.595, 0.515] {
            k.block(Structure, [-1.1, y + 0.003, z], [1.1, y + 0.097, z + 0.08], 0.012);
        }
        for x in [-1.195, 1.115] {
            k.block(Structure, [x, y + 0.003, -0.5], [x + 0.08, y + 0.097, 0.5], 0.012);
        }
    }
    for i in 0..detail.count(14, 5) {
        let x = -0.98 + 1.96 * i as f32 / (detail.count(14, 5) - 1) as f32;
        for z in [-0.595, 0.56] {
            k.block(color, [x - 0.035, 0.09, z], [x + 0.035, 1.11, z + 0.035], 0.008);
        }
    }
    for z in [-0.2, 0.2] {
        k.bar(Steel, &[p(1.185, 0.1, z), p(1.185, 1.1, z)], 0.014, 8);
    }
    k
}

/// A barrel.
pub(super) fn barrel(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let side = [
        [0.0, 0.0],
        [0.28, 0.0],
        [0.3, 0.03],
        [0.3, 0.29],
        [0.315, 0.31],
        [0.3, 0.33],
        [0.3, 0.57],
        [0.315, 0.59],
        [0.3, 0.61],
        [0.3, 0.87],
        [0.28, 0.9],
        [0.26, 0.87],
        [0.0, 0.87],
    ];
    k.turned(Blue, Vec3::ZERO, &side, 32);
    k.turned(Steel, p(0.16, 0.865, 0.0), &[[0.04, 0.0], [0.04, 0.03]], 12);
    k
}

/// A small craft on three legs, its nose towards +Z.
pub(super) fn pod(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let middle = p(0.0, 1.25, 0.0);
    let hull = [
        [0.0, -1.55],
        [0.55, -1.5],
        [0.78, -1.3],
        [0.86, -0.9],
        [0.88, 0.0],
        [0.82, 0.7],
        [0.62, 1.3],
        [0.34, 1.65],
        [0.0, 1.78],
    ];
    let profile: Vec<glam::Vec2> = hull.iter().map(|&[r, z]| glam::Vec2::new(r, z)).collect();
    let rounded = crate::builtin::profile::rounded(&profile, detail.facets(5, 2));
    let rounded: Vec<[f32; 2]> = rounded.iter().map(|v| v.to_array()).collect();
    k.turned_along(Radiator, middle, Vec3::Z, &rounded, 56);
    for z in [-0.95, -0.2, 0.5] {
        let r = if z > 0.0 { 0.855 } else { 0.875 };
        k.turned_along(
            Orange,
            middle + Vec3::Z * z,
            Vec3::Z,
            &[[r - 0.03, -0.05], [r + 0.03, -0.04], [r + 0.03, 0.04], [r - 0.03, 0.05]],
            56,
        );
    }
    for turn in [-0.5_f32, 0.0, 0.5] {
        let d = Quat::from_rotation_y(turn) * p(0.0, 0.55, 0.83);
        let at = middle + p(0.0, 0.1, 0.75) + d * 0.55;
        k.turned_along(DarkSteel, at, d, &[[0.2, -0.1], [0.2, 0.06], [0.16, 0.08]], 24);
        k.turned_along(Window, at, d, &[[0.15, 0.0], [0.15, 0.09]], 24);
    }
    for i in 0..3 {
        let turn = Quat::from_rotation_y(TAU * (i as f32 + 0.5) / 3.0);
        let foot = turn * p(0.0, 0.0, 1.05);
        k.bar(Steel, &[foot + Vec3::Y * 0.05, middle + turn * p(0.0, -0.55, 0.5)], 0.055, 14);
        k.bar(
            Steel,
            &[foot + Vec3::Y * 0.3 - turn * Vec3::Z * 0.1, middle + turn * p(0.25, -0.6, 0.3)],
            0.025,
            10,
        );
        k.turned(DarkSteel, foot, &[[0.22, 0.0], [0.22, 0.03], [0.08, 0.08]], 24);
    }
    for (x, y) in [(-0.45, 0.0), (0.45, 0.0), (0.0, 0.45), (0.0, -0.45)] {
        let bell = [[0.1, 0.0], [0.2, -0.38], [0.185, -0.38], [0.07, -0.04]];
        let at = middle + p(x, y, -1.42);
        let bell: Vec<[f32; 2]> = bell.iter().map(|&[r, z]| [r, -z]).collect();
        k.turned_along(DarkSteel, at, Vec3::NEG_Z, &bell, 28);
    }
    // Tanks at the sides.
    for s in [-1.0, 1.0] {
        let at = middle + p(0.98 * s, -0.1, -0.75);
        k.turned_along(
            Foil,
            at,
            Vec3::Z,
            &[[0.0, 0.0], [0.16, 0.04], [0.24, 0.14], [0.24, 0.95], [0.16, 1.05], [0.0, 1.09]],
            28,
        );
        for z in [0.2, 0.8] {
            k.bar(Steel, &[at + Vec3::Z * z, at + p(-0.25 * s, 0.05, z)], 0.04, 10);
        }
    }
    k
}

/// A lamp under the ceiling about its middle: a housing and rods.
pub(super) fn lamp(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    k.block(Structure, [-0.6, 0.01, -0.16], [0.6, 0.1, 0.16], 0.02);
    for x in [-0.4, 0.4] {
        k.bar(DarkSteel, &[p(x, 0.09, 0.0), p(x, 0.45, 0.0)], 0.012, 8);
    }
    k
}

/// A lamp's glass.
pub(super) fn glass(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    k.plain(Lamp, [-0.55, -0.015, -0.12], [0.55, 0.02, 0.12]);
    k
}

/// The turn of a boom or module on the east (+1) or west (−1) side.
pub(super) fn side_turn(side: f32) -> f32 {
    FRAC_PI_2 * (1.0 - side)
}
