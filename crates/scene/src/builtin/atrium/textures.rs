//! Procedural textures of the atrium: RGBA texels from integer noise, a whole number of features a metre.

use crate::builtin::noise::hash;
use crate::builtin::paint::{SIZE, paint, tiling};

/// Floor tiles, two by two a metre, alternately light and dark, each of its own shade, with grout.
pub(super) fn floor() -> Vec<u8> {
    let tile = SIZE / 2;
    paint(|x, y| {
        let (i, j) = (x / tile, y / tile);
        let (px, py) = (x % tile, y % tile);
        let edge = px.min(tile - 1 - px).min(py.min(tile - 1 - py));
        if edge < 2 {
            return [0.36, 0.33, 0.30, 1.0];
        }
        let vein = tiling(10 + i * 2 + j, x, y, [7.0, 7.0], 4);
        let base = if (i + j) % 2 == 0 { [0.80, 0.74, 0.65] } else { [0.60, 0.46, 0.37] };
        let shade = 1.0 + 0.16 * vein + (i as f32 - 0.5) * 0.05 - if edge < 4 { 0.08 } else { 0.0 };
        [base[0] * shade, base[1] * shade, base[2] * shade, 1.0]
    })
}

/// Ashlar: courses of a quarter of a metre, blocks of half a metre, every second course shifted.
pub(super) fn stone() -> Vec<u8> {
    let (course, block) = (SIZE / 4, SIZE / 2);
    paint(|x, y| {
        let row = y / course;
        let shifted = (x + (row % 2) * block / 2) % SIZE;
        let (px, py) = (shifted % block, y % course);
        let edge = px.min(block - 1 - px).min(py.min(course - 1 - py));
        let own = (hash(5, (shifted / block) as i32, row as i32, 0) >> 16) as f32 / 65536.0 - 0.5;
        let grain = tiling(21, x, y, [9.0, 9.0], 4);
        let joint = if edge < 1 { 0.84 } else { 1.0 };
        let shade = (0.93 + 0.06 * own + 0.07 * grain) * joint;
        [0.86 * shade, 0.78 * shade, 0.66 * shade, 1.0]
    })
}

/// Dark wood: boards a quarter of a metre wide along v, with grain.
pub(super) fn wood() -> Vec<u8> {
    let board = SIZE / 4;
    paint(|x, y| {
        let own = (hash(9, (x / board) as i32, 0, 0) >> 16) as f32 / 65536.0 - 0.5;
        let gap = if x % board < 2 { 0.45 } else { 1.0 };
        let grain = tiling(31, x, y, [26.0, 2.5], 4);
        let shade = (1.0 + 0.2 * own + 0.35 * grain) * gap;
        [0.40 * shade, 0.25 * shade, 0.15 * shade, 1.0]
    })
}

/// Light floor boards, eight a metre along v.
pub(super) fn boards() -> Vec<u8> {
    let board = SIZE / 8;
    paint(|x, y| {
        let row = x / board;
        let along = (y + row * 97) % SIZE;
        let own = (hash(19, row as i32, i32::from(along < SIZE / 2), 0) >> 16) as f32 / 65536.0 - 0.5;
        let gap = if x % board < 1 || along % (SIZE / 2) < 1 { 0.5 } else { 1.0 };
        let grain = tiling(37, x, y, [40.0, 3.0], 3);
        let shade = (1.0 + 0.22 * own + 0.2 * grain) * gap;
        [0.56 * shade, 0.40 * shade, 0.26 * shade, 1.0]
    })
}

/// A lattice of crossed bars with eight-pointed openings, four a metre; alpha 0 in the openings.
pub(super) fn lattice() -> Vec<u8> {
    let cell = SIZE as f32 / 4.0;
    paint(|x, y| {
        let local = |v: u32| ((v as f32 + 0.5) % cell) / cell - 0.5;
        let (u, v) = (local(x), local(y));
        let (a, b) = (u.abs(), v.abs());
        // Union of a square and the same square turned by 45°: a star.
        let star = (a.max(b) < 0.30) || (a + b < 0.425);
        let small = (0.5 - a) + (0.5 - b) < 0.13;
        let grain = 1.0 + 0.2 * tiling(41, x, y, [4.0, 20.0], 3);
        let alpha = if star || small { 0.0 } else { 1.0 };
        [0.36 * grain, 0.22 * grain, 0.13 * grain, alpha]
    })
}
