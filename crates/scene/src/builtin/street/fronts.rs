//! Houses' fronts in their own space: the wall looks along +Z at z = 0, the middle of its foot is the origin.

use glam::{Affine3A, Vec2, Vec3};

use super::palette::Stuff::{self, *};
use super::plan::*;
use crate::builtin::Detail;
use crate::builtin::kit::Kit;
use crate::builtin::noise::unit;
use crate::builtin::shapes::{Geometry, arcade_wall};

type Things = Kit<Stuff>;

fn p(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(x, y, z)
}

/// Thickness of the walls, and how deep panes lie.
const WALL: f32 = 0.34;
const PANE_DEPTH: f32 = 0.2;

/// An opening: its middle and width along X.
#[derive(Clone, Copy)]
struct Opening {
    at: f32,
    wide: f32,
}

/// A stretch of wall between two heights, with openings from `sill` to `top`.
fn wall(
    k: &mut Things,
    of: Stuff,
    half: f32,
    [y0, y1]: [f32; 2],
    [sill, top]: [f32; 2],
    openings: &[Opening],
) {
    if sill > y0 {
        k.plain(of, [-half, y0, -WALL], [half, sill, 0.0]);
    }
    k.plain(of, [-half, top, -WALL], [half, y1, 0.0]);
    let mut from = -half;
    for o in openings {
        k.plain(of, [from, sill, -WALL], [o.at - 0.5 * o.wide, top, 0.0]);
        from = o.at + 0.5 * o.wide;
    }
    k.plain(of, [from, sill, -WALL], [half, top, 0.0]);
}

/// A window's pane and bars in an opening.
fn glazing(k: &mut Things, of: Stuff, o: Opening, [y0, y1]: [f32; 2], [across, up]: [u32; 2]) {
    let (x0, x1) = (o.at - 0.5 * o.wide, o.at + 0.5 * o.wide);
    k.plain(Glass, [x0, y0, -PANE_DEPTH - 0.04], [x1, y1, -PANE_DEPTH]);
    let bar = |k: &mut Things, a: [f32; 2], b: [f32; 2]| {
        k.plain(of, [a[0], a[1], -PANE_DEPTH - 0.02], [b[0], b[1], -PANE_DEPTH + 0.05]);
    };
    let w = 0.05;
    for (a, b) in [
        ([x0, y0], [x0 + w, y1]),
        ([x1 - w, y0], [x1, y1]),
        ([x0 + w, y0], [x1 - w, y0 + w]),
        ([x0 + w, y1 - w], [x1 - w, y1]),
    ] {
        bar(k, a, b);
    }
    // The finest bars are left out at low detail.
    let [across, up] = if k.fine() { [across, up] } else { [across.min(2), 1] };
    for i in 1..across {
        let x = x0 + o.wide * i as f32 / across as f32;
        k.plain(of, [x - 0.025, y0 + w, -PANE_DEPTH - 0.02], [x + 0.025, y1 - w, -PANE_DEPTH + 0.04]);
    }
    for i in 1..up {
        let y = y0 + (y1 - y0) * i as f32 / up as f32;
        k.plain(of, [x0 + w, y - 0.018, -PANE_DEPTH - 0.02], [x1 - w, y + 0.018, -PANE_DEPTH + 0.03]);
    }
}

/// Jambs, a moulded head and a sill around an opening.
fn surround(k: &mut Things, o: Opening, [y0, y1]: [f32; 2]) {
    let (x0, x1) = (o.at - 0.5 * o.wide, o.at + 0.5 * o.wide);
    if k.fine() {
        for (a, b) in [(x0 - 0.13, x0), (x1, x1 + 0.13)] {
            k.plain(Trim, [a, y0, -0.02], [b, y1, 0.045]);
        }
        k.plain(Trim, [x0 - 0.13, y1, -0.02], [x1 + 0.13, y1 + 0.16, 0.05]);
    }
    k.block(Trim, [x0 - 0.2, y1 + 0.15, -0.02], [x1 + 0.2, y1 + 0.24, 0.14], 0.015);
    k.block(Trim, [x0 - 0.17, y0 - 0.1, -WALL + 0.1], [x1 + 0.17, y0, 0.11], 0.012);
}

/// Open shutters with slats, beside an opening.
fn shutters(k: &mut Things, of: Stuff, o: Opening, [y0, y1]: [f32; 2]) {
    let leaf = 0.5 * o.wide;
    for s in [-1.0_f32, 1.0] {
        let inner = o.at + s * (0.5 * o.wide + 0.15);
        let (a, b) = (inner.min(inner + s * leaf), inner.max(inner + s * leaf));
        let (z0, z1) = (0.03, 0.075);
        if !k.fine() {
            k.plain(of, [a, y0, z0], [b, y1, z1]);
            continue;
        }
        for (x0, x1) in [(a, a + 0.06), (b - 0.06, b)] {
            k.plain(of, [x0, y0, z0], [x1, y1, z1]);
        }
        let middle = 0.5 * (y0 + y1);
        for y in [y0, middle - 0.035, y1 - 0.07] {
            k.plain(of, [a + 0.06, y, z0 + 0.003], [b - 0.06, y + 0.07, z1 - 0.003]);
        }
        for (from, to) in [(y0 + 0.07, middle - 0.035), (middle + 0.035, y1 - 0.07)] {
            let count = k.detail.count(8, 2);
            for i in 0..count {
                let y = from + (to - from) * (i as f32 + 0.5) / count as f32;
                let tilt = p(0.0, -0.5, 1.0);
                k.plank(of, p(a + 0.05, y, 0.052), p(b - 0.05, y, 0.052), tilt, [0.03, 0.006]);
            }
        }
        // A hook in the wall.
        k.bar(Iron, &[p(0.5 * (a + b), y0 + 0.3, -0.02), p(0.5 * (a + b), y0 + 0.3, 0.09)], 0.012, 6);
    }
}

/// A balcony before an opening or several: slab, brackets, railing.
fn balcony(k: &mut Things, [x0, x1]: [f32; 2], y: f32) {
    let deep = 0.62;
    k.block(Trim, [x0, y - 0.12, -0.05], [x1, y, deep + 0.06], 0.02);
    let brackets = libm::roundf((x1 - x0) / 1.3).max(2.0) as u32;
    for i in 0..brackets {
        let x = x0 + 0.15 + (x1 - x0 - 0.3) * i as f32 / (brackets - 1) as f32;
        let outline = [[-0.02, 0.0], [-0.02, -0.42], [0.1, -0.4], [0.34, -0.2], [0.5, 0.0]];
        // Swept along X: the outline's x is +Z, its y is up.
        let axes = glam::Mat3::from_cols(Vec3::Z, Vec3::Y, Vec3::NEG_X);
        k.prism(Trim, &outline, [-0.07, 0.07], &Affine3A::from_mat3_translation(axes, p(x, y - 0.11, 0.0)));
    }
    let top = y + 0.95;
    let rail =
        [p(x0 + 0.05, top, 0.0), p(x0 + 0.05, top, deep), p(x1 - 0.05, top, deep), p(x1 - 0.05, top, 0.0)];
    k.bar(Iron, &rail, 0.024, 8);
    let low = rail.map(|q| q - Vec3::Y * 0.84);
    k.bar(Iron, &low, 0.014, 6);
    let pitch = if k.fine() { 0.13 } else { 0.5 };
    let count = libm::roundf((x1 - x0 - 0.1) / pitch) as u32;
    for i in 0..=count {
        let x = x0 + 0.05 + (x1 - x0 - 0.1) * i as f32 / count as f32;
        let thick = if i == 0 || i == count { 0.02 } else { 0.009 };
        k.bar(Iron, &[p(x, y - 0.01, deep), p(x, top, deep)], thick, 6);
    }
    for s in 1..4 {
        for x in [x0 + 0.05, x1 - 0.05] {
            let z = deep * s as f32 / 4.0;
            k.bar(Iron, &[p(x, y - 0.01, z), p(x, top, z)], 0.009, 6);
        }
    }
}

/// Shop windows and a door in the ground floor's wall, with a sign board above.
fn shop(k: &mut Things, front: &Front, half: f32) {
    let of = front.shop;
    let openings = [
        Opening { at: -0.53 * half, wide: 0.66 * half },
        Opening { at: 0.06 * half, wide: 1.2 },
        Opening { at: 0.6 * half, wide: 0.56 * half },
    ];
    let top = 2.75;
    wall(k, front.base, half, [-0.3, GROUND_FLOOR], [-0.3, top], &openings);
    for (i, o) in openings.into_iter().enumerate() {
        let (x0, x1) = (o.at - 0.5 * o.wide, o.at + 0.5 * o.wide);
        if i == 1 {
            // A door: panels below, glass above, a step and a handle.
            glazing(k, of, o, [1.0, top], [2, 2]);
            k.plain(of, [x0, -0.02, -PANE_DEPTH - 0.05], [x1, 1.02, -PANE_DEPTH + 0.02]);
            for s in [-1.0_f32, 1.0] {
                let at = o.at + s * 0.3;
                k.block(of, [at - 0.2, 0.15, -PANE_DEPTH], [at + 0.2, 0.85, -PANE_DEPTH + 0.05], 0.015);
            }
            k.plain(Trim, [x0, -0.3, -WALL], [x1, 0.02, 0.06]);
            k.bar(
                Brass,
                &[p(o.at + 0.09, 1.0, -PANE_DEPTH + 0.09), p(o.at + 0.09, 1.35, -PANE_DEPTH + 0.09)],
                0.016,
                10,
            );
            for y in [1.02, 1.33] {
                k.bar(
                    Brass,
                    &[p(o.at + 0.09, y, -PANE_DEPTH), p(o.at + 0.09, y, -PANE_DEPTH + 0.09)],
                    0.01,
                    8,
                );
            }
        } else {
            let sill = 0.55;
            k.plain(of, [x0, -0.3, -WALL], [x1, sill, -0.04]);
            let panels = libm::roundf(o.wide / 0.8).max(1.0) as u32;
            for j in 0..panels {
                let a = x0 + o.wide * j as f32 / panels as f32;
                let b = x0 + o.wide * (j + 1) as f32 / panels as f32;
                k.block(of, [a + 0.08, 0.08, -0.05], [b - 0.08, sill - 0.1, 0.0], 0.015);
            }
            k.block(of, [x0 - 0.04, sill - 0.02, -WALL + 0.05], [x1 + 0.04, sill + 0.05, 0.05], 0.012);
            glazing(k, of, o, [sill + 0.05, top], [panels + 1, 3]);
        }
        for x in [x0, x1] {
            k.plain(of, [x - 0.09, 0.0, -0.02], [x + 0.09, top, 0.055]);
        }
    }
    // The sign board, and a moulding above it.
    k.block(of, [-0.9 * half, top + 0.05, -0.02], [0.9 * half, top + 0.55, 0.08], 0.02);
    k.block(Trim, [-half, GROUND_FLOOR - 0.18, -0.02], [half, GROUND_FLOOR - 0.02, 0.16], 0.02);
    for i in 0..9 {
        let x = -0.62 * half + 1.24 * half * i as f32 / 8.0;
        let r = unit(801 + front.bays, i * 8 + front.storeys);
        k.block(Brass, [x - 0.05 - 0.09 * r, top + 0.2, 0.07], [x + 0.05 + 0.09 * r, top + 0.4, 0.1], 0.008);
    }
}

/// A front with the house behind it.
pub(super) fn house(detail: Detail, which: usize) -> Things {
    let mut k: Things = Kit::new(detail);
    let front = &FRONT[which];
    let half = 0.5 * HOUSE;
    let top = GROUND_FLOOR + STOREY * front.storeys as f32;
    shop(&mut k, front, half);
    let pitch = HOUSE / front.bays as f32;
    let wide = if front.bays == 3 { 1.25 } else { 1.0 };
    let openings: Vec<Opening> =
        (0..front.bays).map(|i| Opening { at: -half + pitch * (i as f32 + 0.5), wide }).collect();
    for storey in 0..front.storeys {
        let y0 = GROUND_FLOOR + STOREY * storey as f32;
        let has_balcony = front.balconies >> storey & 1 == 1;
        let span = if has_balcony { [y0 + 0.08, y0 + 2.3] } else { [y0 + 0.75, y0 + 2.4] };
        wall(&mut k, front.wall, half, [y0, y0 + STOREY], span, &openings);
        for &o in &openings {
            glazing(&mut k, if front.shutters.is_some() { White } else { front.shop }, o, span, [2, 3]);
            surround(&mut k, o, span);
            if let Some(of) = front.shutters {
                shutters(&mut k, of, o, span);
            }
            if has_balcony && front.bays == 3 {
                balcony(&mut k, [o.at - 0.95, o.at + 0.95], y0 + 0.04);
            } else if !has_balcony && (o.at + storey as f32) % 3.0 > 1.2 {
                flower_box(&mut k, o, span[0], (storey * 8 + which as u32) * 16 + (o.at + half) as u32);
            }
        }
        if has_balcony && front.bays == 4 {
            balcony(&mut k, [-half + 0.4, half - 0.4], y0 + 0.04);
        }
        k.block(Trim, [-half, y0 + STOREY - 0.1, -0.02], [half, y0 + STOREY + 0.02, 0.09], 0.015);
    }
    quoins(&mut k, half, top);
    cornice(&mut k, half, top);
    roof(&mut k, front, half, top, &openings);
    k
}

/// What fills a house behind its front: nobody sees it.
pub(super) fn core(detail: Detail, which: usize) -> Things {
    let mut k: Things = Kit::new(detail);
    let half = 0.5 * HOUSE;
    let top = GROUND_FLOOR + STOREY * FRONT[which].storeys as f32;
    k.plain(FRONT[which].wall, [-half, -0.3, -4.0], [half, top, -WALL + 0.01]);
    k
}

/// A box of flowers under a window; its plants are closed, small and round.
fn flower_box(k: &mut Things, o: Opening, sill: f32, seed: u32) {
    k.block(Terracotta, [o.at - 0.45, sill - 0.02, 0.07], [o.at + 0.45, sill + 0.16, 0.27], 0.012);
    for i in 0..k.detail.count(12, 4) {
        let r = |c: u32| unit(811 + seed, 4 * i + c);
        let at = p(o.at - 0.4 + 0.8 * r(0), sill + 0.2 + 0.1 * r(1), 0.1 + 0.14 * r(2));
        let of = [Leaf, Leaf, Petal][(i % 3) as usize];
        let place = Affine3A::from_scale_rotation_translation(
            Vec3::splat(0.05 + 0.035 * r(3)),
            glam::Quat::IDENTITY,
            at,
        );
        k.add(of, &crate::builtin::shapes::boulder(1, 820 + i), &place);
    }
}

/// Stones at the corners, longer and shorter by turns.
fn quoins(k: &mut Things, half: f32, top: f32) {
    let rows = libm::floorf((top - GROUND_FLOOR - 0.2) / 0.45) as u32;
    // At low detail only the longer ones.
    let step = if k.fine() { 1 } else { 2 };
    for i in (0..rows).step_by(step) {
        let y = GROUND_FLOOR + 0.06 + 0.45 * i as f32;
        let long = if i % 2 == 0 { 0.46 } else { 0.28 };
        for s in [-1.0_f32, 1.0] {
            let (a, b) = (s * half, s * (half - long));
            k.block(Trim, [a.min(b), y, -0.03], [a.max(b), y + 0.4, 0.035], 0.012);
        }
    }
}

/// The main cornice, with blocks under it.
fn cornice(k: &mut Things, half: f32, top: f32) {
    k.block(Trim, [-half, top - 0.02, -0.1], [half, top + 0.14, 0.3], 0.02);
    k.block(Trim, [-half, top + 0.12, -0.1], [half, top + 0.26, 0.42], 0.025);
    let count = if k.fine() { 21 } else { 7 };
    for i in 0..count {
        let x = -half + 0.2 + (2.0 * half - 0.4) * i as f32 / (count - 1) as f32;
        k.block(Trim, [x - 0.07, top - 0.2, -0.02], [x + 0.07, top - 0.01, 0.24], 0.01);
    }
}

/// A steep roof with dormers and chimneys.
fn roof(k: &mut Things, front: &Front, half: f32, top: f32, openings: &[Opening]) {
    let (foot, high) = (top + 0.25, 2.3);
    // Swept along X: the outline's x is +Z, its y is up.
    let axes = Affine3A::from_mat3(glam::Mat3::from_cols(Vec3::Z, Vec3::Y, Vec3::NEG_X));
    let outline = [
        [-4.0, foot - 0.3],
        [0.12, foot - 0.3],
        [0.12, foot],
        [-0.75, foot + high],
        [-4.0, foot + high + 0.4],
    ];
    k.prism(Slate, &outline, [-half, half], &axes);
    k.bar(Zinc, &[p(-half, foot + high + 0.02, -0.75), p(half, foot + high + 0.02, -0.75)], 0.07, 10);
    k.bar(Zinc, &[p(-half, foot + 0.03, 0.2), p(half, foot + 0.03, 0.2)], 0.08, 12);
    for &o in openings {
        let w = 0.62;
        let (y0, y1) = (foot + 0.35, foot + 1.65);
        k.plain(front.wall, [o.at - w, y0 - 0.1, -1.4], [o.at + w, y1, -0.02]);
        k.plain(Glass, [o.at - w + 0.14, y0 + 0.08, -0.1], [o.at + w - 0.14, y1 - 0.14, 0.0]);
        for (a, b) in [
            ([o.at - w, y0 - 0.08], [o.at - w + 0.16, y1]),
            ([o.at + w - 0.16, y0 - 0.08], [o.at + w, y1]),
            ([o.at - w + 0.16, y0 - 0.08], [o.at + w - 0.16, y0 + 0.1]),
            ([o.at - w + 0.16, y1 - 0.15], [o.at + w - 0.16, y1]),
            ([o.at - 0.03, y0 + 0.1], [o.at + 0.03, y1 - 0.15]),
        ] {
            if k.fine() {
                k.plain(White, [a[0], a[1], -0.05], [b[0], b[1], 0.05]);
            }
        }
        let gable = [[o.at - w - 0.12, y1 - 0.02], [o.at + w + 0.12, y1 - 0.02], [o.at, y1 + 0.5]];
        k.prism(Zinc, &gable, [-1.7, 0.14], &Affine3A::IDENTITY);
    }
    for s in [-0.85, 0.8] {
        let x = s * half;
        k.block(Brick, [x - 0.4, foot + 1.0, -2.4], [x + 0.4, foot + high + 1.3, -1.8], 0.03);
        for i in 0..3 {
            let pot = [[0.1, -0.02], [0.09, 0.3], [0.11, 0.34], [0.08, 0.34], [0.07, 0.1], [0.0, 0.1]];
            k.turned(Terracotta, p(x - 0.24 + 0.24 * i as f32, foot + high + 1.3, -2.1), &pot, 14);
        }
    }
    // A rain pipe at the seam to the next house.
    let x = half - 0.16;
    k.pipe(
        Zinc,
        &[p(x, foot + 0.02, 0.2), p(x, top - 0.35, 0.2), p(x, top - 0.6, 0.09), p(x, 0.0, 0.09)],
        0.045,
        0.12,
        10,
    );
}

/// The gate at the street's west end, about the middle of its foot, looking along +Z: an arch over the roadway, a storey above.
pub(super) fn gate(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let half = FRONTS + 0.4;
    let arch: Geometry = arcade_wall(1, 2.0 * half, 2.9, [2.4, 6.4], 2.6, 0.0, detail.facets(40, 10));
    k.at(Stone, &arch, p(0.0, 0.0, -1.3));
    for s in [-1.0_f32, 1.0] {
        let (a, b) = (s * 2.9, s * half);
        k.plain(Stone, [a.min(b), -0.3, -2.6], [a.max(b), 2.4, 0.0]);
        let (a, b) = (s * 2.82, s * 3.5);
        k.block(Trim, [a.min(b), 2.22, -2.66], [a.max(b), 2.46, 0.08], 0.02);
        k.block(Trim, [a.min(b), -0.3, -2.68], [a.max(b), 0.5, 0.1], 0.03);
    }
    // Stones around the arch.
    let stones = 15;
    for i in 0..stones {
        let angle = std::f32::consts::PI * (i as f32 + 0.5) / stones as f32;
        let turn = glam::Quat::from_rotation_z(angle);
        let wide = 0.47 * 2.9 * std::f32::consts::PI / stones as f32;
        let long = if i == stones / 2 { 0.75 } else { 0.5 };
        let stone =
            crate::builtin::profile::block(detail, p(2.93, -wide, -0.05), p(2.93 + long, wide, 0.06), 0.015);
        k.add(Trim, &stone, &Affine3A::from_rotation_translation(turn, p(0.0, 2.4, 0.0)));
    }
    let openings: Vec<Opening> = (0..5).map(|i| Opening { at: -4.4 + 2.2 * i as f32, wide: 0.95 }).collect();
    let span = [7.2, 8.9];
    wall(&mut k, Sand, half, [6.4, 9.8], span, &openings);
    k.plain(Sand, [-half, 6.4, -2.6], [half, 9.8, -WALL]);
    for &o in &openings {
        glazing(&mut k, White, o, span, [2, 3]);
        surround(&mut k, o, span);
    }
    k.block(Trim, [-half, 6.3, -0.05], [half, 6.52, 0.16], 0.02);
    cornice(&mut k, half, 9.8);
    let gable = [[-half, 10.0], [half, 10.0], [0.0, 12.6]];
    k.prism(Slate, &gable, [-2.8, 0.3], &Affine3A::IDENTITY);
    // A clock.
    k.turned_along(Trim, p(0.0, 10.9, 0.28), Vec3::Z, &[[0.75, 0.0], [0.75, 0.1], [0.62, 0.12]], 40);
    k.turned_along(White, p(0.0, 10.9, 0.36), Vec3::Z, &[[0.6, 0.0], [0.6, 0.06]], 36);
    for (turn, long) in [(0.6, 0.34), (2.4, 0.5)] {
        let d = glam::Quat::from_rotation_z(turn) * Vec3::Y;
        k.plank(Black, p(0.0, 10.9, 0.43) - d * 0.08, p(0.0, 10.9, 0.43) + d * long, Vec3::Z, [0.012, 0.025]);
    }
    k
}

/// An awning's cloth over a shop: one layer with a scalloped hem, before a wall that looks along +Z; its foot on the wall is the origin.
pub(super) fn awning(detail: Detail) -> Geometry {
    let mut g = Geometry::new();
    let half = 3.7;
    let [nx, nz] = [detail.facets(96, 24), detail.facets(8, 3)];
    let surface = |s: f32, t: f32| {
        let x = 2.0 * half * (s - 0.5);
        let slope = (t / 0.85).min(1.0);
        let scallop = libm::fabsf(libm::sinf(std::f32::consts::PI * 12.0 * s));
        let drop = ((t - 0.85) / 0.15).max(0.0) * (0.2 + 0.08 * scallop);
        let billow = 0.035 * libm::sinf(std::f32::consts::PI * slope) * (1.0 + 0.5 * libm::sinf(24.0 * s));
        p(x, -0.62 * slope - drop + billow, 1.35 * slope + 0.02 * drop)
    };
    for j in 0..=nz {
        for i in 0..=nx {
            let t = if j == nz { 1.0 } else { 0.85 * j as f32 / (nz - 1) as f32 };
            let s = i as f32 / nx as f32;
            g.vertex(surface(s, t), Vec3::Y, Vec2::new(2.0 * half * s, 1.8 * t));
        }
    }
    for j in 0..nz {
        for i in 0..nx {
            let a = j * (nx + 1) + i;
            let (b, c, d) = (a + 1, a + nx + 2, a + nx + 1);
            g.triangles.extend([[a, d, c], [a, c, b]]);
        }
    }
    let mut sums = vec![Vec3::ZERO; g.positions.len()];
    for t in &g.triangles {
        let [a, b, c] = t.map(|v| g.positions[v as usize]);
        t.iter().for_each(|&v| sums[v as usize] += (b - a).cross(c - a));
    }
    g.normals = sums.into_iter().map(|n| n.normalize_or(Vec3::Y)).collect();
    g
}

/// The awning's frame.
pub(super) fn awning_frame(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    k.bar(Iron, &[p(-3.75, 0.0, 0.03), p(3.75, 0.0, 0.03)], 0.05, 10);
    k.bar(Iron, &[p(-3.7, -0.64, 1.33), p(3.7, -0.64, 1.33)], 0.02, 8);
    for x in [-3.5, 0.0, 3.5] {
        k.bar(Iron, &[p(x, -0.75, -0.02), p(x, -0.66, 1.33)], 0.016, 8);
        k.bar(Iron, &[p(x, -0.03, 0.02), p(x, -0.66, 1.33)], 0.012, 8);
    }
    k
}
