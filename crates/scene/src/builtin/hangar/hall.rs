//! The hall: shell, trusses, doors, services, and the crane.

use glam::{Affine3A, Mat3, Vec3};

use super::palette::Stuff::{self, *};
use super::plan::*;
use crate::builtin::Detail;
use crate::builtin::builder::rotation_y;
use crate::builtin::kit::Kit;
use crate::builtin::shapes::Geometry;

type Things = Kit<Stuff>;

fn p(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(x, y, z)
}

/// Floor, walls and roof as seen from inside, one layer; a rail along the walls' joint, and a plinth.
pub(super) fn shell(detail: Detail) -> [Things; 2] {
    let mut k: Things = Kit::new(detail);
    let ([x, z], c, joint) = (HALL, CEILING, 2.6);
    let mut face = |of: Stuff, corners: [Vec3; 4]| {
        let mut piece = Geometry::new();
        piece.polygon(&corners);
        k.at(of, &piece, Vec3::ZERO);
    };
    face(Floor, [p(-x, 0.0, z), p(x, 0.0, z), p(x, 0.0, -z), p(-x, 0.0, -z)]);
    face(Roof, [p(-x, c, -z), p(x, c, -z), p(x, c, z), p(-x, c, z)]);
    for turn in 0..4 {
        let (half, out) = if turn % 2 == 0 { (x, z) } else { (z, x) };
        let rotation = rotation_y(std::f32::consts::FRAC_PI_2 * turn as f32);
        // The wall that looks along +Z, turned. Walls at the ends are clad from the floor on.
        for (of, y0, y1) in [(if turn % 2 == 0 { Wall } else { Cladding }, 0.0, joint), (Cladding, joint, c)]
        {
            let corner = |s: f32, y: f32| {
                let q = rotation * p(s * half, y, -out);
                // Quarter turns leave crumbs; corners are shared to the last bit.
                p(x.copysign(q.x), q.y, z.copysign(q.z))
            };
            face(of, [corner(-1.0, y0), corner(1.0, y0), corner(1.0, y1), corner(-1.0, y1)]);
        }
    }
    let mut rails: Things = Kit::new(detail);
    for s in [-1.0_f32, 1.0] {
        let (a, b) = (s * (z - 0.08), s * (z + 0.05));
        rails.block(Structure, [-x, 2.52, a.min(b)], [x, 2.7, a.max(b)], 0.02);
        rails.block(Structure, [-x, -0.05, a.min(b)], [x, 0.16, a.max(b)], 0.015);
    }
    [k, rails]
}

/// Trusses across the hall, their columns, purlins and braces.
pub(super) fn trusses(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let [_, z] = HALL;
    let (step, count) = BAYS;
    for i in 0..count {
        let x = step * (i as f32 - 0.5 * (count - 1) as f32);
        for s in [-1.0_f32, 1.0] {
            // Columns of a web between flanges.
            let (a, b) = (s * (z - 0.36), s * (z + 0.02));
            k.plain(Structure, [x - 0.02, -0.05, a.min(b)], [x + 0.02, CEILING, a.max(b)]);
            for at in [z - 0.36, z - 0.06] {
                k.plain(Structure, [x - 0.15, -0.05, s * at - 0.02], [x + 0.15, TRUSS + 0.1, s * at + 0.02]);
            }
            k.block(
                DarkSteel,
                [x - 0.24, -0.02, s * (z - 0.21) - 0.26],
                [x + 0.24, 0.03, s * (z - 0.21) + 0.2],
                0.01,
            );
            k.plank(
                Structure,
                p(x, TRUSS - 1.0, s * (z - 0.3)),
                p(x, TRUSS + 0.05, s * (z - 1.5)),
                Vec3::X,
                [0.06, 0.06],
            );
        }
        k.plank(Structure, p(x, TRUSS + 0.06, -z), p(x, TRUSS + 0.06, z), Vec3::X, [0.1, 0.06]);
        k.plank(Structure, p(x, CEILING - 0.08, -z), p(x, CEILING - 0.08, z), Vec3::X, [0.1, 0.08]);
        let fields = 16;
        for j in 0..fields {
            let at = |j: u32| -z + 2.0 * z * j as f32 / fields as f32;
            let (low, high) = (TRUSS + 0.06, CEILING - 0.08);
            let (a, b) = if j % 2 == 0 { (low, high) } else { (high, low) };
            k.bar(Structure, &[p(x, a, at(j)), p(x, b, at(j + 1))], 0.035, 8);
            if j % 2 == 0 {
                k.bar(Structure, &[p(x, low, at(j)), p(x, high, at(j))], 0.028, 8);
            }
        }
    }
    let half = 0.5 * step * (count - 1) as f32;
    for j in 0..9 {
        let at = -11.2 + 2.8 * j as f32;
        k.plank(
            Structure,
            p(-HALL[0], CEILING - 0.02, at),
            p(HALL[0], CEILING - 0.02, at),
            Vec3::Z,
            [0.06, 0.07],
        );
    }
    for s in [-1.0_f32, 1.0] {
        for (a, b) in [(-half, -half + step), (half - step, half)] {
            k.bar(Steel, &[p(a, 0.4, s * (HALL[1] - 0.2)), p(b, TRUSS - 0.4, s * (HALL[1] - 0.2))], 0.022, 8);
            k.bar(Steel, &[p(b, 0.4, s * (HALL[1] - 0.2)), p(a, TRUSS - 0.4, s * (HALL[1] - 0.2))], 0.022, 8);
        }
    }
    k
}

/// The sliding doors at the east end, an office window and a gate in the west.
pub(super) fn doors(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let x = HALL[0];
    for i in 0..6 {
        let (a, b) = (-10.8 + 3.6 * i as f32, -10.8 + 3.6 * (i + 1) as f32);
        let inset = 0.1 + 0.12 * (i % 2) as f32;
        k.plain(
            if i % 2 == 0 { Blue } else { White },
            [x - inset - 0.08, 0.02, a - 0.05],
            [x - inset, 7.2, b + 0.05],
        );
        for j in 0..6 {
            let z = a + 0.3 + 0.6 * j as f32;
            k.plain(Structure, [x - inset - 0.14, 0.03, z - 0.04], [x - inset - 0.07, 7.18, z + 0.04]);
        }
        for y in [0.1, 2.4, 4.8, 7.05] {
            k.plain(Structure, [x - inset - 0.13, y, a + 0.02], [x - inset - 0.06, y + 0.1, b - 0.02]);
        }
        k.plain(Glass, [x - inset - 0.1, 5.1, a + 0.4], [x - inset - 0.02, 6.7, b - 0.4]);
    }
    k.block(Yellow, [x - 0.4, 7.25, -11.2], [x + 0.02, 7.6, 11.2], 0.03);
    k.plain(DarkSteel, [x - 0.34, -0.02, -11.2], [x - 0.06, 0.012, 11.2]);
    // The west wall: a roller gate, an office behind glass above it, stairs' landing and pipes.
    k.block(Yellow, [-x - 0.02, -0.05, -2.5], [-x + 0.2, 4.4, -2.2], 0.02);
    k.block(Yellow, [-x - 0.02, -0.05, 2.2], [-x + 0.2, 4.4, 2.5], 0.02);
    k.block(Yellow, [-x - 0.02, 4.1, -2.5], [-x + 0.22, 4.6, 2.5], 0.02);
    for i in 0..26 {
        let y = 0.16 * i as f32;
        k.block(Steel, [-x - 0.02, y, -2.22], [-x + 0.1, y + 0.152, 2.22], 0.02);
    }
    k.block(Structure, [-x - 0.02, 5.3, -6.2], [-x + 0.16, 7.2, 6.2], 0.03);
    for i in 0..6 {
        let z = -5.9 + 2.0 * i as f32;
        k.plain(Glass, [-x, 5.55, z], [-x + 0.2, 6.95, z + 1.8]);
    }
    for (i, (stuff, r)) in [(Copper, 0.05), (Steel, 0.08), (Red, 0.06), (Steel, 0.11)].into_iter().enumerate()
    {
        let z = 8.4 + 0.42 * i as f32;
        for s in [-1.0_f32, 1.0] {
            k.pipe(
                stuff,
                &[
                    p(-x + 0.3, -0.05, s * z),
                    p(-x + 0.3, 7.9 - 0.3 * i as f32, s * z),
                    p(-x + 0.3, 7.9 - 0.3 * i as f32, s * 2.0),
                ],
                r,
                0.3,
                14,
            );
            for y in [0.9, 3.4, 5.9] {
                k.flange(DarkSteel, p(-x + 0.3, y, s * z), Vec3::Y, r);
            }
        }
    }
    k
}

/// Pipes, ducts and lamps (off) under the roof, markings and drains in the floor.
pub(super) fn services(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let [x, z] = HALL;
    for s in [-1.0_f32, 1.0] {
        k.bar(Steel, &[p(-x, 8.2, s * 9.9), p(x, 8.2, s * 9.9)], 0.26, 26);
        for i in 0..14 {
            let at = p(-18.2 + 2.8 * i as f32, 8.2, s * 9.9);
            let rim = [[0.26, -0.03], [0.29, -0.02], [0.29, 0.02], [0.26, 0.03]];
            k.turned_along(DarkSteel, at, Vec3::X, &rim, 26);
            k.bar(DarkSteel, &[at + Vec3::Y * 0.27, p(at.x, TRUSS + 0.3, at.z)], 0.01, 6);
        }
        for (i, (stuff, r)) in [(Copper, 0.04), (Red, 0.055), (Blue, 0.045)].into_iter().enumerate() {
            let line = s * (z - 0.55);
            let y = 5.6 + 0.28 * i as f32;
            k.bar(stuff, &[p(-x, y, line), p(x, y, line)], r, 12);
            for j in 0..detail.count(9, 3) {
                k.flange(DarkSteel, p(-16.0 + 4.0 * j as f32 + 0.6, y, line), Vec3::X, r);
            }
        }
    }
    // Lamps that are off.
    let (step, count) = BAYS;
    for i in 0..count - 1 {
        let at = step * (i as f32 - 0.5 * (count - 2) as f32);
        for line in [-6.4, 0.0, 6.4] {
            k.bar(DarkSteel, &[p(at, CEILING, line), p(at, TRUSS - 0.1, line)], 0.012, 6);
            let bell = [
                [0.06, 0.0],
                [0.1, -0.08],
                [0.3, -0.3],
                [0.31, -0.34],
                [0.29, -0.34],
                [0.08, -0.1],
                [0.0, -0.1],
            ];
            let bell: Vec<[f32; 2]> = bell.iter().rev().map(|&[r, y]| [r, y + TRUSS - 0.05]).collect();
            k.turned(Stuff::Steel, p(at, 0.0, line), &bell, 26);
            k.turned(
                Glass,
                p(at, TRUSS - 0.36, line),
                &[[0.0, 0.0], [0.06, 0.02], [0.09, 0.09], [0.05, 0.19]],
                16,
            );
        }
    }
    // Markings: lines around the craft and along the aisles, 3 mm thick.
    let t = 0.004;
    for s in [-1.0_f32, 1.0] {
        k.plain(Yellow, [-18.5, -0.01, s * 8.1 - 0.05], [18.5, t, s * 8.1 + 0.05]);
        k.plain(Yellow, [-10.6, -0.01, s * 5.7 - 0.04], [10.6, t, s * 5.7 + 0.04]);
        k.plain(Yellow, [s * 10.6 - 0.04, -0.01, -5.6], [s * 10.6 + 0.04, t, 5.6]);
        for (i, bay) in BAY_X.into_iter().enumerate() {
            for e in [-1.0_f32, 1.0] {
                let at = bay + e * 2.6;
                k.plain(
                    if i % 2 == 0 { White } else { Yellow },
                    [at - 0.03, -0.01, (s * 8.4).min(s * 12.5)],
                    [at + 0.03, t, (s * 8.4).max(s * 12.5)],
                );
            }
        }
        // Drains.
        k.plain(DarkSteel, [-18.5, -0.02, s * 7.6 - 0.12], [18.5, 0.003, s * 7.6 + 0.12]);
        let bars = detail.count(184, 26);
        for i in 0..bars {
            let at = -18.4 + 36.8 * (i as f32 + 0.5) / bars as f32;
            k.plain(Steel, [at - 0.03, -0.01, s * 7.6 - 0.1], [at + 0.03, 0.01, s * 7.6 + 0.1]);
        }
    }
    for i in 0..12 {
        let (s, c) = libm::sincosf(std::f32::consts::TAU * i as f32 / 12.0);
        k.turned(DarkSteel, p(8.6 * c, -0.01, 4.6 * s), &[[0.09, 0.0], [0.09, 0.018], [0.05, 0.026]], 16);
    }
    k
}

/// Rails of the crane along the walls.
pub(super) fn rails(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let ([x, z], [y, line]) = (HALL, RAILS);
    for s in [-1.0_f32, 1.0] {
        k.plain(Orange, [-x, y - 0.36, s * line - 0.09], [x, y - 0.04, s * line + 0.09]);
        k.plain(DarkSteel, [-x, y - 0.04, s * line - 0.04], [x, y, s * line + 0.04]);
        let (step, count) = BAYS;
        for i in 0..count {
            let at = step * (i as f32 - 0.5 * (count - 1) as f32);
            let (a, b) = (s * (line - 0.12), s * (z - 0.05));
            k.block(Structure, [at - 0.08, y - 0.62, a.min(b)], [at + 0.08, y - 0.34, a.max(b)], 0.02);
        }
    }
    k
}

/// The crane's bridge, about the middle between its rails at their height.
pub(super) fn bridge(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let line = RAILS[1];
    for x in [-0.7, 0.7] {
        k.block(Yellow, [x - 0.14, 0.1, -line + 0.2], [x + 0.14, 0.62, line - 0.2], 0.02);
    }
    for s in [-1.0_f32, 1.0] {
        let at = s * line;
        k.block(Yellow, [-1.2, 0.1, at - 0.2], [1.2, 0.5, at + 0.2], 0.03);
        for x in [-0.95, 0.95] {
            k.turned_along(DarkSteel, p(x, 0.125, at - 0.06), Vec3::Z, &[[0.12, 0.0], [0.12, 0.12]], 20);
        }
        k.block(Orange, [-0.35, 0.48, at - 0.16], [0.35, 0.68, at + 0.16], 0.03);
    }
    let stripes = 16;
    for i in 0..stripes {
        let z = -0.9 * line + 1.8 * line * i as f32 / (stripes - 1) as f32;
        k.plain(DarkSteel, [-0.86, 0.3, z - 0.08], [-0.83, 0.42, z + 0.08]);
        k.plain(DarkSteel, [0.83, 0.3, z - 0.08], [0.86, 0.42, z + 0.08]);
    }
    k
}

/// The crane's trolley with its hook, about the bridge's middle.
pub(super) fn trolley(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    k.block(Orange, [-0.95, 0.6, -0.5], [0.95, 0.84, 0.5], 0.03);
    k.turned_along(
        DarkSteel,
        p(-0.5, 0.36, 0.0),
        Vec3::X,
        &[[0.2, 0.0], [0.22, 0.03], [0.16, 0.06], [0.16, 0.94], [0.22, 0.97], [0.2, 1.0]],
        26,
    );
    for z in [-0.06, 0.06] {
        k.bar(Steel, &[p(0.0, 0.3, z), p(0.0, -0.36, z)], 0.012, 8);
    }
    k.block(Red, [-0.1, -0.6, -0.13], [0.1, -0.34, 0.13], 0.03);
    let axes = Affine3A::from_mat3_translation(Mat3::IDENTITY, p(0.0, -0.72, 0.0));
    let hook: Vec<Vec3> = (0..=14)
        .map(|i| {
            let (s, c) = libm::sincosf(-1.1 + 0.33 * i as f32);
            axes.transform_point3(p(0.13 * s, 0.0 - 0.13 * c + 0.0, 0.0))
        })
        .collect();
    k.bar(Chrome, &[p(0.0, -0.58, 0.0), p(0.0, -0.64, 0.0)], 0.03, 10);
    k.bar(Chrome, &hook, 0.026, 10);
    k
}
