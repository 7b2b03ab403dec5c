//! What parts the hall: bookcase and closet, the slab of onyx, a folding screen, louvre and cabinet. World space but for slats.

use glam::{Affine3A, Quat, Vec3};

use super::palette::Stuff::{self, *};
use super::plan::*;
use crate::builtin::Detail;
use crate::builtin::builder::rotation_y;
use crate::builtin::kit::Kit;
use crate::builtin::noise::unit;
use crate::builtin::shapes::cuboid;

type Things = Kit<Stuff>;

/// The partition of the bookcase and its boards, which touch it, the panels and each other's ends.
pub(super) fn bookcase(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let ([line, from, to], [depth, low, step]) = (BOOKCASE, SHELVES);
    k.plain(Walnut, [from + HALF, 0.0, line - HALF], [to, MEZZANINE.1[0], line + HALF]);
    let (back, front) = (line - HALF, line - HALF - depth);
    let height = low + 6.0 * step + BOARD;
    for x in panels() {
        k.plain(Walnut, [x, 0.0, front], [x + BOARD, height, back]);
    }
    for [x0, x1] in bays() {
        for i in 0..7 {
            let y = low + step * i as f32;
            k.plain(Walnut, [x0, y, front], [x1, y + BOARD, back]);
        }
    }
    k
}

/// Where the bookcase's upright panels begin (x).
fn panels() -> [f32; 3] {
    [BOOKCASE[1] + 0.3, -5.35, BOOKCASE[2] - BOARD]
}

/// Ends of the boards (x), from panel to panel.
fn bays() -> [[f32; 2]; 2] {
    let [a, b, c] = panels();
    [[a + BOARD, b], [b + BOARD, c]]
}

/// Books side by side without gaps, backs against the partition.
pub(super) fn books(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let ([line, ..], [_, low, step]) = (BOOKCASE, SHELVES);
    for (bay, [x0, x1]) in bays().into_iter().enumerate() {
        for i in 0..6 {
            let y = low + step * i as f32 + BOARD;
            let r = |n: u32| unit(610 + 10 * bay as u32 + i, n);
            let end = x0 + (x1 - x0) * (0.45 + 0.5 * r(0));
            let (mut x, mut n) = (x0, 1);
            while x < end {
                let next = x + 0.018 + 0.035 * r(n);
                let (height, depth) = (0.19 + 0.11 * r(n + 1), 0.15 + 0.08 * r(n + 2));
                let of = [Paper, Coral, Teal, Ink, Mustard, Chalk, Paper][(r(n + 3) * 6.99) as usize];
                k.plain(of, [x, y, line - HALF - depth], [next, y + height, line - HALF]);
                (x, n) = (next, n + 4);
            }
            // What lies on its side, at the other end.
            if r(90) > 0.4 && x1 - end > 0.4 {
                let mut height = y;
                for n in 0..2 + (3.0 * r(91)) as u32 {
                    let thick = 0.02 + 0.025 * r(92 + n);
                    let of = [Ink, Paper, Teal, Coral, Mustard][n as usize];
                    k.plain(of, [x1 - 0.28, height, line - 0.24], [x1, height + thick, line - HALF]);
                    height += thick;
                }
            }
        }
    }
    k
}

/// The closet: walls of 2 cm around a doorway, a low ceiling, shelves along the wall towards the hall.
pub(super) fn closet(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let ([x, z], [line, side, _], [z0, z1, lintel]) = (HALL, BOOKCASE, DOORWAY);
    let top = MEZZANINE.1[0];
    let (inside, outside) = (side - HALF, side + HALF);
    k.plain(Chalk, [-x, 0.0, line - HALF], [inside, top, line + HALF]);
    k.plain(Chalk, [inside, 0.0, -z], [outside, top, z0]);
    k.plain(Chalk, [inside, 0.0, z1], [outside, top, line + HALF]);
    k.plain(Chalk, [inside, lintel, z0], [outside, top, z1]);
    k.plain(Chalk, [-x, CLOSET, -z], [inside, CLOSET + 2.0 * HALF, line - HALF]);
    for i in 0..5 {
        let y = 0.12 + 0.42 * i as f32;
        k.plain(Oak, [-x, y, line - HALF - 0.42], [inside, y + BOARD, line - HALF]);
        // Boxes, each against the next.
        let mut at = -x + 0.05 + 0.25 * unit(650, i);
        for n in 0..4 {
            let r = |c: u32| unit(651 + i, 3 * n + c);
            let next = at + 0.2 + 0.16 * r(0);
            if i == 4 || next > inside {
                break;
            }
            let of = [Paper, Rust, Ink, Mustard][n as usize];
            let back = line - HALF - 0.02;
            k.plain(of, [at, y + BOARD, back - 0.34], [next, y + BOARD + 0.2 + 0.18 * r(1), back]);
            at = next;
        }
    }
    k
}

/// The closet's sliding door about the middle of its lower edge: 1.8 cm thick, along Z.
pub(super) fn door(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let half = 0.5 * (DOORWAY[1] - DOORWAY[0]) + 0.05;
    k.plain(Coral, [0.0, 0.004, -half], [0.018, DOORWAY[2] + 0.05, half]);
    k.bar(Steel, &[Vec3::new(0.04, 0.9, half - 0.09), Vec3::new(0.04, 1.25, half - 0.09)], 0.011, 12);
    for y in [0.92, 1.23] {
        k.bar(Steel, &[Vec3::new(0.01, y, half - 0.09), Vec3::new(0.04, y, half - 0.09)], 0.008, 8);
    }
    k
}

/// Slab of onyx without a frame, and a pillar whose edge meets its edge.
pub(super) fn onyx(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let [line, x0, x1, height] = ONYX;
    k.plain(Onyx, [x0, 0.0, line - HALF], [x1, height, line + HALF]);
    k.plain(Chalk, [x1, 0.0, line + HALF], [x1 + 0.16, CEILING, line + HALF + 0.16]);
    k
}

/// Canvases 2 cm thick on the north and east walls, half a centimetre off.
pub(super) fn pictures(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let ([x, z], gap, thick) = (HALL, SHEET, 2.0 * HALF);
    for (of, from, to) in
        [(Ink, [3.2, 1.1], [4.3, 2.7]), (Coral, [4.7, 1.1], [5.3, 1.7]), (Mustard, [4.7, 1.9], [5.3, 2.7])]
    {
        k.plain(of, [from[0], from[1], -z + gap], [to[0], to[1], -z + gap + thick]);
    }
    for (of, from, to) in [(Teal, [-3.9, 0.9], [-2.3, 2.3]), (Linen, [-1.9, 0.9], [-0.9, 2.3])] {
        k.plain(of, [x - gap - thick, from[1], from[0]], [x - gap, to[1], to[0]]);
    }
    k
}

/// A screen of six sheets of 5 mm that stand in a zigzag, edge to edge.
pub(super) fn screen(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let (width, fold) = (0.62, 0.5);
    let sheet = cuboid(Vec3::new(0.0, 0.0, -0.5 * SHEET), Vec3::new(width, 1.75, 0.5 * SHEET));
    let mut at = Vec3::new(-3.1, 0.0, 5.05);
    for i in 0..6 {
        let turn = rotation_y(if i % 2 == 0 { fold } else { -fold });
        k.add(Rust, &sheet, &Affine3A::from_rotation_translation(turn, at));
        at += turn * Vec3::X * width;
    }
    k
}

/// The cabinet behind the louvre: two sides and a top of 2 cm, a bench from side to side.
pub(super) fn cabinet(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let ([x, _], [front, z0, z1, height], thick) = (HALL, CABINET, 2.0 * HALF);
    k.plain(Walnut, [front, 0.0, z0], [x, height, z0 + thick]);
    k.plain(Walnut, [front, 0.0, z1 - thick], [x, height, z1]);
    k.plain(Walnut, [front, height, z0], [x, height + thick, z1]);
    k.plain(Oak, [x - 0.55, 0.0, z0 + thick], [x, 0.44, z1 - thick]);
    k.plain(Linen, [x - 0.5, 0.44, z0 + 0.3], [x, 0.52, z0 + 1.3]);
    k.plain(Teal, [x - 0.5, 0.44, z0 + 1.3], [x, 0.52, z1 - 0.3]);
    // A shelf of 1.6 cm above it.
    k.plain(Walnut, [x - 0.3, 1.5, z0 + thick], [x, 1.5 + BOARD, z1 - thick]);
    k
}

/// A slat of the louvre about its axis, which is Z: 15 cm wide, 1.2 cm thick.
pub(super) fn slat(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let half = 0.5 * (CABINET[2] - CABINET[1]) - 2.0 * HALF - 0.004;
    k.block(Oak, [-0.075, -0.006, -half], [0.075, 0.006, half], 0.003);
    for s in [-1.0_f32, 1.0] {
        let pin = cuboid(Vec3::new(-0.006, -0.006, 0.0), Vec3::new(0.006, 0.006, 0.004));
        let end = Affine3A::from_translation(Vec3::Z * (s * half));
        let turn = if s > 0.0 { Quat::IDENTITY } else { Quat::from_rotation_y(std::f32::consts::PI) };
        k.add(Steel, &pin, &(end * Affine3A::from_quat(turn)));
    }
    k
}
