//! Houses of stone, timber and shingles, each about the middle of its floor; the front looks along +Z, the ridge runs along X.

use glam::{Affine3A, Quat, Vec3};

use super::palette::Stuff::{self, *};
use super::plan::{DESIGNS, Design};
use crate::builtin::Detail;
use crate::builtin::kit::Kit;
use crate::builtin::noise::unit;
use crate::builtin::shapes::Geometry;

type Things = Kit<Stuff>;

fn p(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(x, y, z)
}

/// Height of the stone plinth.
const PLINTH: f32 = 0.42;
/// How far roofs reach over walls: at the eaves, at the gables.
const OVERHANG: [f32; 2] = [0.5, 0.55];

/// A house of a design.
pub(super) fn house(detail: Detail, which: usize) -> Things {
    let mut k: Things = Kit::new(detail);
    let design = &DESIGNS[which];
    let [hx, hz] = design.half;
    let (eaves, ridge) = (design.eaves, design.ridge);
    // Plinth and walls; the gables end below the roof.
    k.block(Stone, [-hx - 0.12, -0.9, -hz - 0.12], [hx + 0.12, PLINTH, hz + 0.12], 0.05);
    let wall = [Plaster, Ochre, Daub, Boards][which];
    let top = eaves + (ridge - eaves) * (1.0 - 0.1);
    let gable = [
        [-hz, PLINTH - 0.05],
        [hz, PLINTH - 0.05],
        [hz, eaves],
        [0.1 * hz, top],
        [-0.1 * hz, top],
        [-hz, eaves],
    ];
    // Outlines in (z, y) swept along X: turned by −90° about the vertical, +X of the outline is +Z of the house.
    let across = Affine3A::from_quat(Quat::from_rotation_y(-std::f32::consts::FRAC_PI_2));
    k.prism(wall, &gable, [-hx, hx], &across);
    frame(&mut k, design);
    openings(&mut k, design, which);
    roof(&mut k, design, which);
    if which == 3 {
        porch(&mut k, design);
    } else {
        chimney(&mut k, design, which);
    }
    k
}

/// The timber frame, proud of the walls.
fn frame(k: &mut Things, design: &Design) {
    let [hx, hz] = design.half;
    let (eaves, ridge) = (design.eaves, design.ridge);
    let proud = 0.04;
    let wide = 0.09;
    let low = PLINTH + 0.08;
    let middle = PLINTH + 0.5 * (eaves - PLINTH);
    // Long walls.
    for s in [-1.0_f32, 1.0] {
        let z = s * hz;
        let bays = libm::roundf(2.0 * hx / 1.35) as u32;
        let step = 2.0 * hx / bays as f32;
        for i in 0..=bays {
            let x = -hx + step * i as f32;
            let x = x.clamp(-hx + 0.06, hx - 0.06);
            k.plank(Timber, p(x, PLINTH - 0.02, z), p(x, eaves, z), Vec3::X, [wide, proud + 0.02]);
        }
        for y in [low, middle, eaves - 0.12] {
            k.plank(Timber, p(-hx, y, z), p(hx, y, z), Vec3::Y, [wide, proud]);
        }
        for (i, d) in [(0, 1.0), (bays - 1, -1.0)] {
            let x0 = -hx + step * i as f32;
            let (a, b) = if d > 0.0 { (x0 + 0.1, x0 + step - 0.05) } else { (x0 + step - 0.1, x0 + 0.05) };
            k.plank(Timber, p(a, low, z), p(b, middle, z), Vec3::X, [0.07, proud - 0.01]);
        }
    }
    // Gables.
    for s in [-1.0_f32, 1.0] {
        let x = s * hx;
        let rise = |z: f32| eaves + (ridge - eaves) * (1.0 - z.abs() / hz);
        let posts = 5;
        for i in 0..posts {
            let z = hz * (-1.0 + 2.0 * i as f32 / (posts - 1) as f32);
            let z = z.clamp(-hz + 0.06, hz - 0.06);
            let head = rise(z).min(ridge - 0.45) - 0.05;
            k.plank(Timber, p(x, PLINTH - 0.02, z), p(x, head, z), Vec3::Z, [wide, proud + 0.02]);
        }
        for y in [low, middle, eaves - 0.05] {
            k.plank(Timber, p(x, y, -hz), p(x, y, hz), Vec3::Y, [wide, proud]);
        }
        let y = eaves + 0.5 * (ridge - eaves);
        k.plank(Timber, p(x, y, -0.52 * hz), p(x, y, 0.52 * hz), Vec3::Y, [wide, proud]);
        for side in [-1.0_f32, 1.0] {
            let (a, b) = (p(x, low, side * (hz - 0.1)), p(x, middle, side * (0.5 * hz + 0.06)));
            k.plank(Timber, a, b, Vec3::Z, [0.07, proud - 0.01]);
            let (a, b) = (p(x, eaves, side * 0.45 * hz), p(x, y, side * 0.06));
            k.plank(Timber, a, b, Vec3::Z, [0.07, proud - 0.01]);
        }
    }
}

/// A window of a size on a wall that looks along +Z at z = 0, about its middle.
fn window(k: &mut Things, [w, h]: [f32; 2], place: &Affine3A) {
    let mut piece: Things = Kit::new(k.detail);
    piece.plain(Pane, [-0.5 * w, -0.5 * h, -0.02], [0.5 * w, 0.5 * h, 0.025]);
    for s in [-1.0, 1.0] {
        piece.plank(
            Timber,
            p(s * 0.5 * w, -0.5 * h - 0.05, 0.02),
            p(s * 0.5 * w, 0.5 * h + 0.05, 0.02),
            Vec3::X,
            [0.05, 0.06],
        );
        piece.plank(
            Timber,
            p(-0.5 * w - 0.09, s * 0.5 * h, 0.02),
            p(0.5 * w + 0.09, s * 0.5 * h, 0.02),
            Vec3::Y,
            [0.05, 0.065],
        );
        // Shutters, open.
        let (a, b) = (s * (0.5 * w + 0.08), s * (w + 0.06));
        for i in 0..3 {
            let (y0, y1) =
                (-0.5 * h + h * i as f32 / 3.0 + 0.008, -0.5 * h + h * (i + 1) as f32 / 3.0 - 0.008);
            piece.plain(Paint, [a.min(b), y0, 0.065], [a.max(b), y1, 0.095]);
        }
        piece.plain(Timber, [a.min(b) + 0.06, -0.46 * h, 0.09], [a.min(b) + 0.11, 0.46 * h, 0.115]);
    }
    piece.bar(Timber, &[p(0.0, -0.5 * h, 0.025), p(0.0, 0.5 * h, 0.025)], 0.018, 6);
    for y in [-0.17 * h, 0.17 * h] {
        piece.bar(Timber, &[p(-0.5 * w, y, 0.025), p(0.5 * w, y, 0.025)], 0.016, 6);
    }
    k.all(&piece, place);
}

fn openings(k: &mut Things, design: &Design, which: usize) {
    let [hx, hz] = design.half;
    let eaves = design.eaves;
    // The door: planks with iron bands in a heavy frame, two steps before it.
    let wide = if which == 3 { 1.0 } else { 0.55 };
    let high = if which == 3 { 2.05 } else { 1.85 };
    let (x, y0) = ([0.75, -0.75, 0.3, 0.0][which], PLINTH - 0.1);
    let planks = if which == 3 { 8 } else { 5 };
    for i in 0..planks {
        let a = x - wide + 2.0 * wide * i as f32 / planks as f32;
        let b = a + 2.0 * wide / planks as f32 - 0.012;
        k.plain(Oak, [a, y0, hz - 0.03], [b, y0 + high, hz + 0.05]);
    }
    for s in [-1.0, 1.0] {
        let at = x + s * (wide + 0.06);
        k.plank(Timber, p(at, -0.05, hz + 0.01), p(at, y0 + high + 0.1, hz + 0.01), Vec3::X, [0.09, 0.1]);
    }
    let lintel = y0 + high + 0.09;
    k.plank(
        Timber,
        p(x - wide - 0.3, lintel, hz + 0.01),
        p(x + wide + 0.3, lintel, hz + 0.01),
        Vec3::Y,
        [0.11, 0.12],
    );
    for y in [y0 + 0.35, y0 + high - 0.4] {
        k.plank(
            Iron,
            p(x - wide + 0.03, y, hz + 0.055),
            p(x + wide - 0.12, y, hz + 0.055),
            Vec3::Y,
            [0.04, 0.012],
        );
    }
    k.turned_along(
        Iron,
        p(x + 0.7 * wide, y0 + 0.5 * high, hz + 0.045),
        Vec3::Z,
        &[[0.06, 0.0], [0.06, 0.02], [0.03, 0.05]],
        14,
    );
    k.block(Stone, [x - wide - 0.25, -0.5, hz], [x + wide + 0.25, 0.3, hz + 0.5], 0.03);
    k.block(Stone, [x - wide - 0.45, -0.5, hz + 0.1], [x + wide + 0.45, 0.14, hz + 0.9], 0.03);
    // Windows beside the door, behind, and in the gables.
    let sill = PLINTH + 0.5 * (eaves - PLINTH) + 0.02;
    let size = [0.62, 0.72];
    let front: &[f32] = [&[-1.7][..], &[1.15], &[-2.2, 2.35], &[-4.6, -2.9, 2.9, 4.6]][which];
    for &at in front {
        window(k, size, &Affine3A::from_translation(p(at, sill + 0.22, hz)));
    }
    let behind: &[f32] = [&[-1.2, 1.6][..], &[-1.3, 1.3], &[-2.2, 0.4, 2.2], &[-4.4, -1.6, 1.6, 4.4]][which];
    for &at in behind {
        let turn = Quat::from_rotation_y(std::f32::consts::PI);
        window(k, size, &Affine3A::from_rotation_translation(turn, p(at, sill + 0.22, -hz)));
    }
    for s in [-1.0_f32, 1.0] {
        let turn = Quat::from_rotation_y(s * std::f32::consts::FRAC_PI_2);
        let y = eaves + 0.22 * (design.ridge - eaves);
        for (y, size) in [(sill + 0.22, size), (y, [0.5, 0.55])] {
            let z = if y > eaves { 0.0 } else { s * 0.25 * hz };
            window(k, size, &Affine3A::from_rotation_translation(turn, p(s * hx, y, z)));
        }
    }
}

/// A strip of shingles down a slope: x across between two lines, y down from 0 to `long`, z out of the slope. Its underside is flat; its
/// outside steps in `rows`, each of which juts out and is lifted by what `uneven` tells. Closed.
fn steps([x0, x1]: [f32; 2], long: f32, rows: u32, uneven: impl Fn(u32) -> [f32; 2]) -> Geometry {
    let mut g = Geometry::new();
    let low = 0.07;
    let mut from = 0.0;
    for row in 0..rows {
        let [jut, lift] = uneven(row);
        let last = row + 1 == rows;
        let to = if last { long } else { long * (row + 1) as f32 / rows as f32 + jut };
        let high = 0.125 + lift;
        // The outside and the underside.
        g.polygon(&[p(x0, from, low), p(x1, from, low), p(x1, to, high), p(x0, to, high)]);
        g.polygon(&[p(x1, from, 0.0), p(x0, from, 0.0), p(x0, to, 0.0), p(x1, to, 0.0)]);
        // The step down to the next row, and the sides with a corner where that row begins.
        let foot = if last { 0.0 } else { low };
        g.polygon(&[p(x0, to, high), p(x1, to, high), p(x1, to, foot), p(x0, to, foot)]);
        let mut side = vec![[from, 0.0], [to, 0.0]];
        if !last {
            side.push([to, low]);
        }
        side.extend([[to, high], [from, low]]);
        let right: Vec<Vec3> = side.iter().map(|&[y, z]| p(x1, y, z)).collect();
        g.polygon(&right);
        let mut left: Vec<Vec3> = side.iter().map(|&[y, z]| p(x0, y, z)).collect();
        left[1..].reverse();
        g.polygon(&left);
        from = to;
    }
    g.polygon(&[p(x0, 0.0, 0.0), p(x1, 0.0, 0.0), p(x1, 0.0, low), p(x0, 0.0, low)]);
    g
}

/// Two slopes of shingles, rafters' ends, barge boards that cross over the ridge.
fn roof(k: &mut Things, design: &Design, which: usize) {
    let [hx, hz] = design.half;
    let (eaves, ridge) = (design.eaves, design.ridge);
    let slope = libm::atan2f(ridge - eaves, hz);
    let (sin, cos) = libm::sincosf(slope);
    let long = hz / cos + OVERHANG[0];
    let half = hx + OVERHANG[1];
    let shingle = [Shingle, Slate, Shingle, Thatch][which];
    for s in [1.0_f32, -1.0] {
        // In the slope's space: x along the ridge, y down the slope, z out of it.
        let turn = if s > 0.0 { Quat::IDENTITY } else { Quat::from_rotation_y(std::f32::consts::PI) };
        let down = p(0.0, -sin, cos);
        let out = p(0.0, cos, sin);
        let axes = glam::Mat3::from_cols(Vec3::NEG_X, down, out);
        let place = Affine3A::from_quat(turn) * Affine3A::from_mat3_translation(axes, p(0.0, ridge, 0.0));
        let mut piece: Things = Kit::new(k.detail);
        let rows = libm::roundf(long / if which == 3 { 0.42 } else { 0.34 }) as u32;
        // At full detail every column of shingles is a strip of its own, whose steps are uneven.
        let columns = if k.fine() { libm::roundf(2.0 * half / 0.36) as u32 } else { 1 };
        let width = 2.0 * half / columns as f32;
        let gap = if k.fine() { 0.003 } else { 0.0 };
        for column in 0..columns {
            let seed = 530 + which as u32 * 2 + u32::from(s > 0.0);
            let x = -half + width * column as f32;
            let strip = steps([x + gap, x + width - gap], long, rows, |row| match k.detail.0 >= 0.4 {
                true => [0.045, 0.014]
                    .map(|most| most * unit(seed, (row * 64 + column) * 2 + u32::from(most < 0.03))),
                false => [0.0; 2],
            });
            piece.at(shingle, &strip, Vec3::ZERO);
        }
        k.all(&piece, &place);
        // Rafters' ends under the eaves.
        let mut at = -hx;
        while at <= hx + 0.01 {
            let head = turn * (p(at, ridge, 0.0) + down * (long - 1.0) - out * 0.075);
            let foot = turn * (p(at, ridge, 0.0) + down * (long - 0.06) - out * 0.075);
            k.plank(Timber, head, foot, Vec3::X, [0.05, 0.08]);
            at += 0.75;
        }
        for end in [-1.0_f32, 1.0] {
            let x = end * (half + 0.03);
            let from = turn * (p(x, ridge, 0.0) - down * 0.62 + out * 0.06);
            let to = turn * (p(x, ridge, 0.0) + down * (long + 0.06) + out * 0.06);
            // Boards of the two slopes cross beside each other.
            let aside = Vec3::X * (end * s * 0.022);
            k.plank(Timber, from + aside, to + aside, Vec3::X, [0.02, 0.13]);
        }
    }
    k.bar(Timber, &[p(-half, ridge + 0.1, 0.0), p(half, ridge + 0.1, 0.0)], 0.1, 10);
    // Purlins that show under the gables' overhang.
    for (y, z) in [
        (ridge - 0.2, 0.0),
        (eaves + 0.45 * (ridge - eaves), 0.5 * hz),
        (eaves + 0.45 * (ridge - eaves), -0.5 * hz),
    ] {
        for s in [-1.0_f32, 1.0] {
            k.plank(Timber, p(s * (hx - 0.2), y, z), p(s * (half - 0.05), y, z), Vec3::Y, [0.08, 0.08]);
        }
    }
}

fn chimney(k: &mut Things, design: &Design, which: usize) {
    let [hx, hz] = design.half;
    let x = [-0.55, 0.4, 0.6][which.min(2)] * hx;
    let z = -0.35 * hz;
    let top = design.ridge + 0.7;
    k.block(Stone, [x - 0.36, design.eaves, z - 0.32], [x + 0.36, top, z + 0.32], 0.03);
    k.block(Stone, [x - 0.44, top - 0.18, z - 0.4], [x + 0.44, top + 0.02, z + 0.4], 0.03);
    for s in [-1.0, 1.0] {
        k.turned(
            Clay,
            p(x + 0.17 * s, top, z),
            &[[0.13, -0.02], [0.12, 0.28], [0.14, 0.3], [0.14, 0.34], [0.09, 0.34], [0.09, 0.1], [0.0, 0.1]],
            18,
        );
    }
}

/// The hall's porch: carved posts under a roof of its own, and shields along the wall.
fn porch(k: &mut Things, design: &Design) {
    let [_, hz] = design.half;
    for x in [-1.9, 1.9] {
        let foot = p(x, -0.3, hz + 1.9);
        let post = [
            [0.2, 0.0],
            [0.2, 0.55],
            [0.14, 0.62],
            [0.17, 0.9],
            [0.13, 1.3],
            [0.17, 1.7],
            [0.12, 1.8],
            [0.15, 2.3],
            [0.2, 2.42],
            [0.2, 2.75],
        ];
        k.turned(Oak, foot, &post, 22);
        k.plank(Timber, p(x, 2.35, hz - 0.05), p(x, 2.35, hz + 2.15), Vec3::X, [0.1, 0.1]);
    }
    k.plank(Timber, p(-2.3, 2.42, hz + 1.9), p(2.3, 2.42, hz + 1.9), Vec3::Y, [0.11, 0.11]);
    let gable = [[-2.4, 2.5], [2.4, 2.5], [0.0, 4.0]];
    k.prism(Boards, &gable, [hz - 0.05, hz + 1.85], &Affine3A::IDENTITY);
    for s in [-1.0_f32, 1.0] {
        let (top, foot) = (p(0.0, 4.12, 0.0), p(s * 2.75, 2.4, 0.0));
        let rows = if k.fine() { 9 } else { 3 };
        for i in 0..rows {
            let (a, b) =
                (top.lerp(foot, i as f32 / rows as f32), top.lerp(foot, (i + 1) as f32 / rows as f32 + 0.02));
            let lift = p(0.84 * s, 0.9, 0.0).normalize() * 0.035;
            k.plank(Thatch, a + Vec3::Z * hz, b + Vec3::Z * hz + lift, Vec3::Y, [0.045, 0.01]);
            // The boards of the small roof, from the wall to its front.
            let along = Vec3::Z;
            let middle = 0.5 * (a + b) + lift;
            let wide = 0.5 * a.distance(b) + 0.02;
            k.plank(
                Thatch,
                middle + along * (hz - 0.02),
                middle + along * (hz + 2.25),
                foot - top,
                [wide, 0.04],
            );
        }
        let cross = p(s * -0.34, 4.36, hz + 2.27 + 0.02 * s);
        k.plank(Timber, cross, p(s * 2.85, 2.36, hz + 2.27 + 0.02 * s), Vec3::Z, [0.02, 0.12]);
    }
    // Shields: wood with a rim and a boss of metal.
    for (i, x) in [-5.55_f32, -3.75, -2.0, 2.0, 3.75, 5.55].into_iter().enumerate() {
        let at = p(x, 1.98, hz + 0.07);
        let face = [Paint, Red, Ochre][i % 3];
        k.turned_along(face, at, Vec3::Z, &[[0.36, 0.0], [0.36, 0.03], [0.2, 0.06], [0.0, 0.07]], 36);
        k.turned_along(
            Brass,
            at,
            Vec3::Z,
            &[[0.35, -0.01], [0.39, -0.01], [0.39, 0.045], [0.35, 0.045], [0.34, 0.03]],
            36,
        );
        k.turned_along(
            Steel,
            at + Vec3::Z * 0.06,
            Vec3::Z,
            &[[0.12, 0.0], [0.12, 0.01], [0.085, 0.05], [0.04, 0.075], [0.0, 0.08]],
            24,
        );
    }
}
