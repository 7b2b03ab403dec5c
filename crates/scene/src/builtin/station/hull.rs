//! The hangar: slabs, panels, ribs and pipes, in the world's space.

use glam::{Affine3A, Mat3, Vec3};

use super::palette::Stuff::{self, *};
use super::plan::*;
use crate::builtin::Detail;
use crate::builtin::kit::Kit;
use crate::builtin::noise::unit;
use crate::builtin::profile::block;

type Things = Kit<Stuff>;

fn p(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(x, y, z)
}

/// A field of panels on a wall: `origin` is a corner, `u` and `v` span it (u × v looks away from the wall), `counts` panels
/// with gaps between. `leave` tells which are left out.
fn panels(
    k: &mut Things,
    stuff: [Stuff; 2],
    [origin, u, v]: [Vec3; 3],
    counts: [u32; 2],
    seed: u32,
    leave: impl Fn(u32, u32) -> bool,
) {
    let size = [u.length() / counts[0] as f32, v.length() / counts[1] as f32];
    let (u, v) = (u.normalize_or(Vec3::X), v.normalize_or(Vec3::Y));
    let place = Affine3A::from_mat3_translation(Mat3::from_cols(u, v, u.cross(v)), origin);
    for j in 0..counts[1] {
        for i in 0..counts[0] {
            if leave(i, j) {
                continue;
            }
            let r = unit(seed, j * 64 + i);
            let gap = 0.025;
            let (x, y) = (i as f32 * size[0], j as f32 * size[1]);
            // Sunk into the wall behind, by different amounts.
            let lo = p(x + gap, y + gap, -0.02);
            let hi = p(x + size[0] - gap, y + size[1] - gap, 0.035 + 0.03 * r);
            k.add(if r < 0.8 { stuff[0] } else { stuff[1] }, &block(k.detail, lo, hi, 0.02), &place);
            if r > 0.55 && r < 0.8 {
                // A cover with screws.
                let (a, b) = (
                    p(x + 0.3 * size[0], y + 0.3 * size[1], 0.02),
                    p(x + 0.62 * size[0], y + 0.6 * size[1], 0.095),
                );
                k.add(Structure, &block(k.detail, a, b, 0.01), &place);
            }
        }
    }
}

/// Deck, roof and walls: thick slabs that overlap a little.
pub(super) fn slabs(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let ([x, z], c, w) = (HANGAR, CEILING, WALL);
    k.plain(Deck, [-x - w, -0.5, -z - w], [x + w, 0.0, z + 0.6]);
    k.plain(Structure, [-x - w, c, -z - w], [x + w, c + 0.5, z + 0.6]);
    k.plain(Structure, [-x - w + 0.02, -0.02, -z - w + 0.02], [x + w - 0.02, c + 0.02, -z]);
    for s in [-1.0_f32, 1.0] {
        let (a, b) = (s * x, s * (x + w - 0.02));
        k.plain(Structure, [a.min(b), -0.02, -z - 0.02], [a.max(b), c + 0.02, z + 0.58]);
    }
    k
}

/// Panels inside and outside.
pub(super) fn plating(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let ([x, z], c, w) = (HANGAR, CEILING, WALL);
    let both = [Hull, Plate];
    let (ox, oz) = (x + w, z + w);
    let front = z + 0.6;
    // Inside: back, left, right, ceiling.
    panels(&mut k, both, [p(-x, 0.15, -z), p(2.0 * x, 0.0, 0.0), p(0.0, c - 0.3, 0.0)], [9, 3], 1, |_, _| {
        false
    });
    let door = |i: u32, j: u32| (2..4).contains(&i) && j < 2;
    panels(&mut k, both, [p(-x, 0.15, z), p(0.0, 0.0, -2.0 * z), p(0.0, c - 0.3, 0.0)], [6, 3], 2, door);
    panels(&mut k, both, [p(x, 0.15, -z), p(0.0, 0.0, 2.0 * z), p(0.0, c - 0.3, 0.0)], [6, 3], 3, door);
    panels(
        &mut k,
        [Plate, Hull],
        [p(-x, c, -z), p(2.0 * x, 0.0, 0.0), p(0.0, 0.0, 2.0 * z)],
        [6, 4],
        4,
        |_, _| false,
    );
    // Outside: roof, underside, back, left, right.
    let roof = [p(-ox, c + 0.5, front), p(2.0 * ox, 0.0, 0.0), p(0.0, 0.0, -front - oz)];
    panels(&mut k, both, roof, [9, 6], 5, |_, _| false);
    let under = [p(-ox, -0.5, -oz), p(2.0 * ox, 0.0, 0.0), p(0.0, 0.0, front + oz)];
    panels(&mut k, [Plate, Foil], under, [8, 5], 6, |_, _| false);
    let back = [p(ox, -0.45, -oz), p(-2.0 * ox, 0.0, 0.0), p(0.0, c + 0.9, 0.0)];
    panels(&mut k, both, back, [9, 3], 7, |_, _| false);
    let hatch = |i: u32, _: u32| (2..4).contains(&i);
    let left = [p(-ox, -0.45, -oz), p(0.0, 0.0, front + oz), p(0.0, c + 0.9, 0.0)];
    panels(&mut k, both, left, [6, 3], 8, hatch);
    let right = [p(ox, -0.45, front), p(0.0, 0.0, -front - oz), p(0.0, c + 0.9, 0.0)];
    panels(&mut k, both, right, [6, 3], 9, hatch);
    k
}

/// Ribs, braces and the frame of the mouth.
pub(super) fn ribs(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let ([x, z], c) = (HANGAR, CEILING);
    // None stands before a hatch.
    for at in [-5.1, -2.0, 2.0, 5.1] {
        for s in [-1.0_f32, 1.0] {
            let (a, b) = (s * (x - 0.28), s * (x + 0.02));
            k.block(Structure, [a.min(b), -0.01, at - 0.12], [a.max(b), c + 0.01, at + 0.12], 0.03);
            k.bar(Steel, &[p(s * (x - 0.15), c - 1.1, at), p(s * (x - 1.3), c - 0.15, at)], 0.05, 12);
        }
        k.block(Structure, [-x, c - 0.3, at - 0.1], [x, c + 0.01, at + 0.1], 0.03);
    }
    // A crane's rails, its bridge and trolley.
    for s in [-1.0, 1.0] {
        k.block(Yellow, [s * 5.2 - 0.1, c - 0.52, -z], [s * 5.2 + 0.1, c - 0.28, z], 0.02);
    }
    k.block(Yellow, [-5.4, c - 0.78, -1.45], [5.4, c - 0.5, -1.15], 0.03);
    k.block(DarkSteel, [-2.9, c - 0.98, -1.6], [-2.1, c - 0.46, -1.0], 0.04);
    k.bar(DarkSteel, &[p(-2.5, c - 0.95, -1.3), p(-2.5, 2.9, -1.3)], 0.014, 8);
    k.turned(
        Orange,
        p(-2.5, 2.6, -1.3),
        &[[0.0, 0.0], [0.09, 0.03], [0.12, 0.12], [0.1, 0.28], [0.03, 0.32]],
        20,
    );
    // The mouth: a frame with lamps.
    let front = z + 0.58;
    for s in [-1.0_f32, 1.0] {
        let (a, b) = (s * (x - 0.1), s * (x + 0.62));
        k.block(Orange, [a.min(b), -0.55, front - 0.4], [a.max(b), c + 0.6, front + 0.25], 0.06);
    }
    k.block(Orange, [-x - 0.6, c - 0.1, front - 0.38], [x + 0.6, c + 0.62, front + 0.23], 0.06);
    k.block(DarkSteel, [-x - 0.6, -0.62, front - 0.38], [x + 0.6, 0.02, front + 0.23], 0.06);
    for i in 0..10 {
        let at = -8.1 + 1.8 * i as f32;
        k.turned_along(
            Signal,
            p(at, c + 0.25, front + 0.22),
            Vec3::Z,
            &[[0.07, 0.0], [0.07, 0.03], [0.04, 0.06]],
            14,
        );
        k.plain(Yellow, [at - 0.3, 0.012, front - 0.3], [at + 0.3, 0.03, front + 0.1]);
    }
    // The round hatches to the modules.
    for s in [-1.0_f32, 1.0] {
        let at = p(s * (x - 0.02), 1.75, 0.0);
        let inward = Vec3::NEG_X * s;
        let frame = [[1.15, -0.1], [1.42, -0.1], [1.42, 0.12], [1.30, 0.2], [1.18, 0.2], [1.15, 0.08]];
        k.turned_along(Structure, at, inward, &frame, 48);
        k.turned_along(Orange, at, inward, &[[1.12, 0.02], [1.12, 0.13], [0.9, 0.16], [0.4, 0.18]], 48);
        k.turned_along(Window, at, inward, &[[0.3, 0.1], [0.3, 0.2]], 24);
        for i in 0..8 {
            let d = glam::Quat::from_rotation_x(std::f32::consts::TAU * i as f32 / 8.0) * Vec3::Y;
            k.bar(Steel, &[at + inward * 0.2 + d * 0.42, at + inward * 0.17 + d * 1.05], 0.025, 8);
        }
    }
    k
}

/// Pipes, ducts and cables inside, and a hand rail along the deck's edge.
pub(super) fn services(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let ([x, z], c) = (HANGAR, CEILING);
    // Along the back wall and down into the deck.
    let kinds = [(Copper, 0.04), (Steel, 0.07), (Blue, 0.05), (Steel, 0.045), (Orange, 0.055), (Steel, 0.09)];
    for (i, (stuff, radius)) in kinds.into_iter().enumerate() {
        let y = 2.9 + 0.25 * i as f32;
        let (from, to) = (-x + 0.5 + 0.3 * i as f32, x - 0.5 - 0.35 * i as f32);
        let line = -z + 0.3;
        k.pipe(
            stuff,
            &[p(from, -0.1, line), p(from, y, line), p(to, y, line), p(to, -0.1, line)],
            radius,
            0.25,
            16,
        );
        for j in 0..6 {
            let at = -6.0 + 2.4 * j as f32;
            k.flange(DarkSteel, p(at, y, line), Vec3::X, radius);
        }
        k.flange(DarkSteel, p(from, 1.1, line), Vec3::Y, radius);
        k.flange(DarkSteel, p(to, 1.1, line), Vec3::Y, radius);
    }
    for j in 0..8 {
        let at = -7.2 + 2.1 * j as f32;
        k.block(DarkSteel, [at - 0.03, 2.7, -z - 0.01], [at + 0.03, 4.4, -z + 0.12], 0.008);
    }
    // Ducts under the ceiling.
    for s in [-1.0_f32, 1.0] {
        let line = s * 7.3;
        k.bar(Steel, &[p(line, c - 0.62, -z), p(line, c - 0.62, z)], 0.24, 28);
        for j in 0..7 {
            let at = -5.4 + 1.8 * j as f32;
            let ring = [[0.24, -0.03], [0.27, -0.02], [0.27, 0.02], [0.24, 0.03]];
            k.turned_along(DarkSteel, p(line, c - 0.62, at), Vec3::Z, &ring, 28);
        }
        for (i, stuff) in [Rubber, Red, Rubber].into_iter().enumerate() {
            let off = s * (6.75 - 0.09 * i as f32);
            let sag: Vec<Vec3> = (0..=24)
                .map(|j| {
                    let t = j as f32 / 24.0;
                    let hang = libm::sinf(std::f32::consts::PI * (5.0 * t - libm::floorf(5.0 * t)));
                    p(off, c - 0.36 - 0.12 * hang, -z + 2.0 * z * t)
                })
                .collect();
            k.bar(stuff, &sag, 0.025, 8);
        }
    }
    // Floor markings and lashing rings.
    for s in [-1.0, 1.0] {
        k.plain(Yellow, [s * 3.6 - 0.05, -0.01, -3.4], [s * 3.6 + 0.05, 0.012, 5.6]);
        for j in 0..6 {
            let at = p(s * 4.1, 0.0, -3.0 + 1.7 * j as f32);
            k.turned(DarkSteel, at, &[[0.11, -0.01], [0.11, 0.012], [0.07, 0.02]], 18);
        }
    }
    // A rail along the edge, with an opening in the middle.
    for s in [-1.0_f32, 1.0] {
        let line = z + 0.05;
        for j in 0..5 {
            let at = s * (4.4 + 1.05 * j as f32);
            k.bar(Steel, &[p(at, -0.05, line), p(at, 1.08, line)], 0.022, 10);
        }
        for y in [0.4, 0.75, 1.09] {
            k.bar(
                if y > 1.0 { Yellow } else { Steel },
                &[p(s * 4.4, y, line), p(s * 8.6, y, line)],
                0.02,
                10,
            );
        }
    }
    k
}

/// Pipes, tank straps, a ladder and small boxes on the roof.
pub(super) fn roof(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let top = CEILING + 0.5;
    for (i, tank) in TANKS.into_iter().enumerate() {
        let shell: Vec<[f32; 2]> = (0..=8)
            .map(|j| {
                let angle = std::f32::consts::PI * (j as f32 / 8.0 - 0.5);
                [(0.85 * libm::cosf(angle)).max(0.0), 0.85 * libm::sinf(angle)]
            })
            .map(|[r, y]| [if r < 1e-4 { 0.0 } else { r }, y])
            .collect();
        k.round(if i % 2 == 0 { Foil } else { Radiator }, tank, &shell, 40);
        k.turned(DarkSteel, tank, &[[0.83, -0.05], [0.89, -0.04], [0.89, 0.04], [0.83, 0.05]], 40);
        for j in 0..4 {
            let d = glam::Quat::from_rotation_y(std::f32::consts::FRAC_PI_2 * (j as f32 + 0.5)) * Vec3::X;
            k.bar(Steel, &[tank + d * 0.86, p(tank.x, top - 0.02, tank.z) + d * 1.0], 0.035, 10);
        }
        let end = p(tank.x - 1.1, tank.y + 0.95, tank.z + 0.0);
        k.pipe(
            Copper,
            &[tank + Vec3::Y * 0.8, tank + Vec3::Y * 0.95, end, p(end.x, top - 0.02, end.z)],
            0.03,
            0.12,
            10,
        );
    }
    for i in 0..5 {
        let line = 1.6 + 0.28 * i as f32;
        let (a, b) = (-8.4 + 0.5 * i as f32, 8.2 - 0.6 * i as f32);
        let y = top + 0.22;
        let stuff = [Steel, Copper, Steel, Orange, Steel][i];
        k.pipe(
            stuff,
            &[p(a, top - 0.05, line), p(a, y, line), p(b, y, line), p(b, top - 0.05, line)],
            0.05,
            0.15,
            12,
        );
    }
    for j in 0..7 {
        let at = -6.0 + 2.0 * j as f32;
        k.block(DarkSteel, [at - 0.04, top - 0.02, 1.45], [at + 0.04, top + 0.3, 2.9], 0.01);
    }
    for i in 0..46 {
        let r = |c: u32| unit(420, 4 * i + c);
        let at = p(-8.6 + 17.2 * r(0), top, -5.6 + 11.0 * r(1));
        let busy = TANKS.iter().any(|t| (at.x - t.x).abs() < 2.3 && (at.z - t.z).abs() < 1.6)
            || (at.z - 2.2).abs() < 1.1
            || (at - MAST.0).length() < 1.6;
        if busy {
            continue;
        }
        let (w, h) = (0.12 + 0.3 * r(2), 0.1 + 0.3 * r(3));
        let stuff = [Structure, Plate, DarkSteel, Radiator][(i % 4) as usize];
        k.block(stuff, [at.x - w, top - 0.02, at.z - 0.7 * w], [at.x + w, top + h, at.z + 0.7 * w], 0.02);
    }
    // Radiators behind the hangar, on struts.
    for i in 0..3 {
        let x = -5.4 + 5.4 * i as f32;
        let (near, far) = (-HANGAR[1] - WALL - 0.9, -HANGAR[1] - WALL - 5.2);
        k.block(Radiator, [x - 1.7, 2.6, far], [x + 1.7, 2.66, near], 0.02);
        for j in 0..10 {
            let at = x - 1.55 + 0.345 * j as f32;
            k.plain(Radiator, [at - 0.012, 2.65, far + 0.1], [at + 0.012, 2.85, near - 0.1]);
            k.plain(Radiator, [at - 0.012, 2.41, far + 0.1], [at + 0.012, 2.61, near - 0.1]);
        }
        for s in [-1.0, 1.0] {
            k.bar(
                Steel,
                &[p(x + 0.9 * s, 2.63, near - 0.3), p(x + 0.9 * s, 2.63, -HANGAR[1] - 0.3)],
                0.05,
                12,
            );
            k.bar(
                Steel,
                &[p(x + 0.9 * s, 2.62, near - 2.4), p(x + 0.9 * s, 0.6, -HANGAR[1] - 0.3)],
                0.03,
                10,
            );
        }
    }
    k
}
