//! The laboratory's room, platform, pipes and lamps, in the world's space.

use glam::{Vec2, Vec3};

use super::palette::Stuff::{self, *};
use super::plan::*;
use crate::builtin::Detail;
use crate::builtin::kit::Kit;
use crate::builtin::shapes::{Geometry, stairs};

type Things = Kit<Stuff>;

fn p(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(x, y, z)
}

/// Floor, walls and ceiling from inside: single layers.
pub(super) fn shell() -> [Geometry; 3] {
    let corner = |i: usize, y: f32| {
        let (x, z) = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)][i % 4];
        p(ROOM.x * x, y, ROOM.y * z)
    };
    let (mut floor, mut walls, mut ceiling) = (Geometry::new(), Geometry::new(), Geometry::new());
    floor.polygon(&[corner(3, 0.0), corner(2, 0.0), corner(1, 0.0), corner(0, 0.0)]);
    ceiling.polygon(&[corner(0, CEILING), corner(1, CEILING), corner(2, CEILING), corner(3, CEILING)]);
    for i in 0..4 {
        let (a, b) = (i, i + 1);
        walls.polygon(&[corner(a, 0.0), corner(b, 0.0), corner(b, CEILING), corner(a, CEILING)]);
    }
    [floor, walls, ceiling]
}

/// Skirting, posts along the walls, a door in the east and one in the west.
pub(super) fn trim(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let (x, z) = (ROOM.x, ROOM.y);
    for s in [-1.0_f32, 1.0] {
        let (a, b) = (s * (z - 0.025), s * (z + 0.02));
        k.block(DarkSteel, [-x, 0.0, a.min(b)], [x, 0.14, a.max(b)], 0.008);
        let (a, b) = (s * (x - 0.025), s * (x + 0.02));
        k.block(DarkSteel, [a.min(b), 0.0, -z], [a.max(b), 0.14, z], 0.008);
        for i in 0..8 {
            let px = -12.25 + 3.5 * i as f32;
            let (a, b) = (s * (z - 0.09), s * (z + 0.02));
            k.block(Steel, [px - 0.09, 2.6, a.min(b)], [px + 0.09, CEILING, a.max(b)], 0.012);
        }
    }
    for (side, at) in [(-1.0_f32, -6.9), (1.0, -2.9)] {
        let wall = |depth: f32, width: f32| {
            let (a, b) = (side * (x - depth), side * (x + 0.02));
            ([a.min(b), at - width], [a.max(b), at + width])
        };
        let (lo, hi) = wall(0.05, 0.95);
        k.block(Orange, [lo[0], 0.0, lo[1]], [hi[0], 2.35, hi[1]], 0.015);
        for edge in [-1.0, 1.0] {
            let (lo, hi) = wall(0.07, 0.42);
            k.block(Enamel, [lo[0], 0.02, lo[1] + 0.43 * edge], [hi[0], 2.25, hi[1] + 0.43 * edge], 0.012);
        }
        let (lo, hi) = wall(0.085, 0.30);
        k.plain(Glass, [lo[0], 1.3, lo[1]], [hi[0], 1.9, hi[1]]);
        let (lo, hi) = wall(0.06, 0.5);
        k.plain(Lamp, [lo[0], 2.45, lo[1]], [hi[0], 2.55, hi[1]]);
    }
    k
}

/// The platform with its edge beams and columns.
pub(super) fn platform(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let (c, [deck, thick]) = (PLATFORM, DECK);
    k.plain(Deck, [c.x, deck - thick, c.y], [ROOM.x + 0.02, deck, ROOM.y + 0.02]);
    let under = deck - thick;
    let beam = |k: &mut Things, a: [f32; 2], b: [f32; 2]| {
        // Two flanges and a web.
        let along_x = (b[0] - a[0]) > (b[1] - a[1]);
        for (y0, y1, inset) in [(under - 0.215, under - 0.195, 0.0), (under - 0.2, under + 0.01, 0.08)] {
            let (ix, iz) = if along_x { (0.0, inset) } else { (inset, 0.0) };
            k.block(Blue, [a[0] + ix, y0, a[1] + iz], [b[0] - ix, y1, b[1] - iz], 0.004);
        }
    };
    for z in [c.y + 0.02, 4.2, 6.8] {
        beam(&mut k, [c.x + 0.02, z], [ROOM.x, z + 0.2]);
    }
    for i in 0..5 {
        let x = c.x + 0.02 + 1.65 * i as f32;
        beam(&mut k, [x, c.y + 0.05], [x + 0.2, ROOM.y]);
    }
    for at in COLUMNS {
        k.block(Blue, [at.x - 0.08, 0.0, at.y - 0.08], [at.x + 0.08, under - 0.15, at.y + 0.08], 0.01);
        k.block(DarkSteel, [at.x - 0.15, 0.0, at.y - 0.15], [at.x + 0.15, 0.03, at.y + 0.15], 0.006);
        for (i, j) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
            let bolt = p(at.x + 0.115 * i, 0.028, at.y + 0.115 * j);
            k.turned(Steel, bolt, &[[0.02, 0.0], [0.02, 0.025]], 6);
        }
    }
    k
}

/// Posts with two rails and a hand rail along a line, which may climb.
fn railing(k: &mut Things, from: Vec3, to: Vec3) {
    let way = to - from;
    let posts = (way.length() / 1.15) as u32 + 1;
    for i in 0..=posts {
        let foot = from + way * (i as f32 / posts as f32);
        k.bar(Steel, &[foot - Vec3::Y * 0.05, foot + Vec3::Y * (RAIL - 0.01)], 0.018, 10);
        k.turned(DarkSteel, foot, &[[0.045, -0.01], [0.045, 0.012]], 14);
    }
    for (height, radius) in [(0.35, 0.010), (0.68, 0.010), (RAIL, 0.024)] {
        k.bar(
            if radius > 0.02 { Yellow } else { Steel },
            &[from + Vec3::Y * height, to + Vec3::Y * height],
            radius,
            12,
        );
    }
}

/// Railings of the platform and of the stairs, and the stairs.
pub(super) fn climb(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let (c, deck) = (PLATFORM, DECK[0]);
    let edge = 0.07;
    railing(&mut k, p(c.x + edge, deck, c.y + edge), p(ROOM.x - 0.05, deck, c.y + edge));
    let landing = STAIRS[1] - 0.5 * STAIRS[0];
    railing(&mut k, p(c.x + edge, deck, c.y + edge + 0.3), p(c.x + edge, deck, landing - 0.05));
    // The last tread reaches a little under the platform's edge.
    let flight = stairs(STEPS, STEP[0], STEP[1], STAIRS[0], 0.3, 0.02);
    let foot = p(stairs_foot() + 0.004, 0.0, STAIRS[1]);
    k.at(Deck, &flight, foot);
    let rise = p(STEP[1], STEP[0], 0.0);
    let side = p(0.0, 0.0, -0.5 * STAIRS[0] + 0.04);
    railing(&mut k, foot + side + rise * 0.5, foot + side + rise * (STEPS as f32 - 0.5));
    k
}

/// Trusses across the hall under the ceiling.
pub(super) fn trusses(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let (low, high) = (CEILING - 0.62, CEILING - 0.08);
    for i in 0..8 {
        let x = -12.25 + 3.5 * i as f32;
        for (y, half) in [(high, 0.06), (low, 0.05)] {
            k.block(Blue, [x - half, y - half, -ROOM.y], [x + half, y + half, ROOM.y], 0.008);
        }
        let fields = 14;
        let z = |j: u32| -ROOM.y + 2.0 * ROOM.y * j as f32 / fields as f32;
        for j in 0..fields {
            let (a, b) = if j % 2 == 0 { (low, high) } else { (high, low) };
            k.bar(Blue, &[p(x, a, z(j)), p(x, b, z(j + 1))], 0.022, 8);
        }
    }
    k
}

/// Round air ducts, cable ladders and bundles of pipes under the ceiling and along the walls.
pub(super) fn services(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let (x, z) = (ROOM.x, ROOM.y);
    for (line, radius, height) in [(-3.0, 0.30, 4.95), (1.75, 0.24, 5.0)] {
        k.bar(Steel, &[p(-x, height, line), p(x, height, line)], radius, 28);
        for i in 0..14 {
            let at = -13.0 + 2.0 * i as f32;
            k.turned_along(
                Steel,
                p(at, height, line),
                Vec3::X,
                &[[radius, -0.03], [radius + 0.025, -0.02], [radius + 0.025, 0.02], [radius, 0.03]],
                16,
            );
            if i % 2 == 0 {
                let mouth = [[0.13, 0.0], [0.15, 0.03], [0.15, 0.25]];
                k.turned(Enamel, p(at + 1.0, height - radius - 0.2, line), &mouth, 16);
            }
            k.bar(DarkSteel, &[p(at, height, line), p(at, CEILING, line)], 0.012, 6);
        }
    }
    // Cable ladders.
    for line in [-6.2, 5.9] {
        let y = 5.12;
        for side in [-0.2, 0.2] {
            k.plain(DarkSteel, [-x, y, line + side - 0.012], [x, y + 0.06, line + side + 0.012]);
        }
        for i in 0..93 {
            let at = -13.8 + 0.3 * i as f32;
            k.plain(DarkSteel, [at - 0.012, y + 0.015, line - 0.2], [at + 0.012, y + 0.035, line + 0.2]);
        }
        for (cable, offset) in [(Rubber, -0.12), (Blue, -0.06), (Rubber, 0.0), (Orange, 0.07), (Rubber, 0.13)]
        {
            let points: Vec<Vec3> = (0..=18)
                .map(|i| {
                    let sway = 0.02 * libm::sinf(1.7 * i as f32 + 40.0 * offset);
                    p(-x + 28.0 / 18.0 * i as f32, y + 0.052, line + offset + sway)
                })
                .collect();
            k.bar(cable, &points, 0.020, 5);
        }
    }
    // Pipes along the north and west walls, with joints and brackets.
    for (i, (stuff, radius)) in
        [(Copper, 0.035), (Enamel, 0.06), (Blue, 0.05), (Steel, 0.075), (Yellow, 0.04)]
            .into_iter()
            .enumerate()
    {
        let y = 2.95 + 0.24 * i as f32;
        let (a, b) = (-z + 0.22, -x + 0.22);
        let end = 13.4 - 2.1 * i as f32;
        k.pipe(
            stuff,
            &[
                p(end, CEILING, a),
                p(end, y, a),
                p(b, y, a),
                p(b, y, 6.6 - 0.3 * i as f32),
                p(b, CEILING, 6.6 - 0.3 * i as f32),
            ],
            radius,
            0.2,
            16,
        );
        for j in 0..9 {
            let at = -12.4 + 2.55 * j as f32;
            if at < end - 0.6 {
                k.flange(DarkSteel, p(at, y, a), Vec3::X, radius);
            }
        }
        for j in 0..5 {
            k.flange(DarkSteel, p(b, y, -6.0 + 2.6 * j as f32), Vec3::Z, radius);
        }
    }
    for j in 0..10 {
        let at = -12.9 + 2.55 * j as f32;
        k.block(DarkSteel, [at - 0.025, 2.78, -z - 0.02], [at + 0.025, 4.1, -z + 0.06], 0.004);
    }
    // Branches down to the hoods and the racks.
    for (at, down) in [(-6.5, 2.2), (-4.85, 2.2), (4.6, 2.2)] {
        k.bar(Steel, &[p(at, down + 0.15, -8.11), p(at, CEILING, -8.11)], 0.135, 24);
    }
    k.bar(Steel, &[p(-6.6, 2.35, 8.11), p(-6.6, CEILING, 8.11)], 0.135, 24);
    for (at, line) in [(2.75, -5.2), (4.05, -5.2), (5.35, -5.2)] {
        k.pipe(Rubber, &[p(at, 2.0, line), p(at, 5.16, line), p(at, 5.16, -6.1)], 0.03, 0.25, 10);
    }
    for (at, line) in [(-4.6, -5.2), (-3.1, -5.2), (-1.6, -5.2), (-10.8, 4.4)] {
        let up = if line < 0.0 { -3.0 } else { 1.75 };
        k.pipe(Steel, &[p(at, 2.42, line), p(at, 4.97, line), p(at, 4.97, up)], 0.075, 0.35, 18);
        k.flange(DarkSteel, p(at, 3.4, line), Vec3::Y, 0.075);
    }
    k
}

/// Where lamps hang (x, z).
pub(super) fn lamp_places() -> Vec<Vec2> {
    let mut places = Vec::new();
    for i in 0..4 {
        for z in [-5.2, -0.6, 4.4] {
            let x = -10.5 + 7.0 * i as f32;
            places.push(Vec2::new(x, z));
        }
    }
    places
}

/// Height of the lamps' undersides.
pub(super) const LAMP: f32 = 4.55;

/// The housing of a lamp about the middle of its underside, on two rods.
pub(super) fn lamp(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    k.block(Enamel, [-0.85, 0.012, -0.14], [0.85, 0.08, 0.14], 0.012);
    for z in [-0.14, 0.125] {
        k.plain(Enamel, [-0.85, -0.02, z], [0.85, 0.03, z + 0.015]);
    }
    for x in [-0.6, 0.6] {
        k.bar(DarkSteel, &[p(x, 0.07, 0.0), p(x, CEILING - LAMP, 0.0)], 0.008, 6);
    }
    k
}

/// The glowing underside of a lamp.
pub(super) fn glow(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    k.plain(Lamp, [-0.82, 0.0, -0.115], [0.82, 0.02, 0.115]);
    k
}
