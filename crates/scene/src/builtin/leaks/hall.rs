//! The hall itself: slabs, walls and ceiling of boxes that touch face to face, the mezzanine and its stair. World space.

use glam::{Vec2, Vec3};

use super::palette::Stuff::{self, *};
use super::plan::*;
use crate::builtin::Detail;
use crate::builtin::kit::Kit;
use crate::builtin::shapes::{Frame, Geometry, sweep};

type Things = Kit<Stuff>;

fn p(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(x, y, z)
}

/// A convex outline in the plane z = 0 (counter-clockwise from +Z), as thick as from `near` to `far`.
fn prism(outline: &[Vec2], near: f32, far: f32) -> Geometry {
    let frame = |z: f32| Frame { origin: Vec3::Z * z, x: Vec3::X, y: Vec3::Y };
    sweep(&[frame(near), frame(far)], outline, false, false)
}

/// Pieces of the floor, each an object of its own: their tops are one plane.
pub(super) fn floors(detail: Detail) -> Vec<(&'static str, Things)> {
    let ([x, z], [[x0, x1], [z0, z1]]) = (HALL.map(|h| h + WALL), BASIN);
    let slab = |of: Stuff, a: [f32; 2], b: [f32; 2], [low, high]: [f32; 2]| {
        let mut k: Things = Kit::new(detail);
        k.plain(of, [a[0], low, a[1]], [b[0], high, b[1]]);
        k
    };
    let floor = [-WALL, 0.0];
    vec![
        ("floor-west", slab(Boards, [-x, -z], [x0, z], floor)),
        ("floor-south", slab(Stone, [x0, z1], [x, z], floor)),
        ("floor-north", slab(Stone, [x0, -z], [x, z0], floor)),
        ("floor-east", slab(Stone, [x1, z0], [x, z1], floor)),
        ("basin", slab(Basin, [x0, z0], [x1, z1], [-WALL, WATER[0]])),
        ("water", slab(Water, [x0, z0], [x1, z1], WATER)),
    ]
}

/// Walls and ceiling with the skylight and its fins.
pub(super) fn shell(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let ([x, z], c, w) = (HALL, CEILING, WALL);
    k.plain(Plaster, [-x - w, 0.0, -z - w], [x + w, c, -z]);
    k.plain(Plaster, [-x - w, 0.0, z], [x + w, c, z + w]);
    k.plain(Plaster, [-x - w, 0.0, -z], [-x, c, z]);
    k.plain(Plaster, [x, 0.0, -z], [x + w, c, z]);
    let [[x0, x1], [z0, z1]] = SKYLIGHT;
    let top = c + 0.2;
    k.plain(Plaster, [-x - w, c, -z - w], [x0, top, z + w]);
    k.plain(Plaster, [x1, c, -z - w], [x + w, top, z + w]);
    k.plain(Plaster, [x0, c, -z - w], [x1, top, z0]);
    k.plain(Plaster, [x0, c, z1], [x1, top, z + w]);
    // Fins a little thinner than the way from one to the next, that only let the sun pass aslant.
    for i in 1..20 {
        let at = x0 + (x1 - x0) * i as f32 / 20.0;
        k.plain(Oak, [at - HALF, c - 0.12, z0], [at + HALF, top, z1]);
    }
    k
}

/// The mezzanine with its pillars and a balustrade of sheets.
pub(super) fn mezzanine(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let ([x, z], ([ex, ez], [under, top])) = (HALL, MEZZANINE);
    k.plain(Chalk, [-x, under, -z], [ex, top, ez]);
    let (places, half) = PILLARS;
    for [px, pz] in places {
        k.plain(DarkSteel, [px - half, 0.0, pz - half], [px + half, under, pz + half]);
    }
    // Sheets stand on the slab; a rail lies on them.
    let (edge, height) = (0.06, top + 0.95);
    k.plain(Rust, [-x, top, ez - edge - SHEET], [ex - edge, height, ez - edge]);
    k.plain(Rust, [ex - edge - SHEET, top, STAIR.3], [ex - edge, height, ez - edge - SHEET]);
    k.bar(Steel, &[p(-x, height, ez - edge), p(ex - edge, height, ez - edge)], 0.022, 16);
    k.bar(Steel, &[p(ex - edge, height, ez - edge), p(ex - edge, height, STAIR.3)], 0.022, 16);
    k
}

/// The stair: treads that touch the wall, a sheet along their other ends, a hand rail.
pub(super) fn stair(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let (treads, going, rise, edge) = STAIR;
    let ([x1, _], [_, top]) = MEZZANINE;
    let foot = x1 + going * treads as f32;
    for i in 0..treads {
        // Counted from above, so that the last tread meets the mezzanine exactly.
        let x = x1 + going * (treads - 1 - i) as f32;
        let y = rise * (i + 1) as f32;
        k.plain(Oak, [x, y - 0.04, -HALL[1]], [x + going + 0.03, y, edge]);
    }
    let slope = rise / going;
    let upper = |x: f32| rise + 0.04 + (foot - x) * slope;
    let low = 0.28;
    let bottom = foot - (low - rise - 0.04) / slope;
    let end = foot + 0.03;
    let outline = [
        Vec2::new(bottom, 0.0),
        Vec2::new(end, 0.0),
        Vec2::new(end, upper(end)),
        Vec2::new(x1, upper(x1)),
        Vec2::new(x1, upper(x1) - low),
    ];
    k.at(DarkSteel, &prism(&outline, edge, edge + 0.01), Vec3::ZERO);
    let rail = |x: f32| p(x, upper(x) + 0.86, edge + 0.005);
    k.bar(Steel, &[rail(foot), rail(x1 + 0.02)], 0.022, 16);
    for i in 0..6 {
        let x = foot - 0.05 - (foot - x1 - 0.1) * i as f32 / 5.0;
        k.bar(Steel, &[p(x, upper(x) - 0.1, edge + 0.005), rail(x)], 0.012, 10);
    }
    // A post where the rail begins.
    k.turned(DarkSteel, p(foot - 0.05, 0.0, edge + 0.06), &[[0.05, 0.0], [0.05, 0.012], [0.03, 0.02]], 20);
    k.bar(Steel, &[p(foot - 0.05, 0.0, edge + 0.06), p(foot - 0.05, top * 0.4, edge + 0.06)], 0.018, 12);
    k
}
