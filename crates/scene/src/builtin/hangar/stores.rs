//! What stands along the walls and lies in the aisles, each about the middle of its foot; stores look along +Z, into the hall.

use std::f32::consts::TAU;

use glam::{Affine3A, Quat, Vec3};

use super::machines;
use super::palette::Stuff::{self, *};
use super::plan::Store;
use crate::builtin::Detail;
use crate::builtin::kit::Kit;
use crate::builtin::noise::unit;

type Things = Kit<Stuff>;

fn p(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(x, y, z)
}

/// A store, within its bay's extents.
pub(super) fn store(detail: Detail, kind: Store) -> Things {
    match kind {
        Store::Containers => containers(detail),
        Store::Crates => crates(detail),
        Store::Rack => rack(detail),
        Store::Bench => bench(detail),
        Store::Engine => machines::engine(detail),
        Store::Barrels => barrels(detail),
        Store::Steps => steps(detail),
    }
}

/// A container of 3.2 × 1.3 × 1.3 m with ribs and doors at its end.
fn container(detail: Detail, color: Stuff) -> Things {
    let mut k: Things = Kit::new(detail);
    k.plain(color, [-1.56, 0.06, -0.61], [1.56, 1.24, 0.61]);
    for x in [-1.6, 1.48] {
        for z in [-0.65, 0.53] {
            k.block(color, [x, 0.0, z], [x + 0.12, 1.3, z + 0.12], 0.015);
        }
    }
    for y in [0.0, 1.2] {
        for z in [-0.645, 0.565] {
            k.block(color, [-1.5, y + 0.004, z], [1.5, y + 0.096, z + 0.08], 0.012);
        }
        for x in [-1.595, 1.515] {
            k.block(color, [x, y + 0.004, -0.55], [x + 0.08, y + 0.096, 0.55], 0.012);
        }
    }
    let ribs = detail.count(17, 7);
    for i in 0..ribs {
        let x = -1.38 + 2.76 * i as f32 / (ribs - 1) as f32;
        for z in [-0.636, 0.6] {
            k.plain(color, [x - 0.05, 0.09, z], [x + 0.05, 1.21, z + 0.036]);
        }
        k.plain(color, [x - 0.05, 1.235, -0.55], [x + 0.05, 1.262, 0.55]);
    }
    for z in [-0.42, -0.14, 0.14, 0.42] {
        k.bar(Steel, &[p(1.585, 0.08, z), p(1.585, 1.22, z)], 0.016, 8);
        k.block(DarkSteel, [1.55, 0.5, z - 0.05], [1.63, 0.56, z + 0.05], 0.008);
    }
    k
}

fn containers(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    k.at_all(&container(detail, Blue), p(0.0, 0.0, -0.55));
    let turned = |x: f32, y: f32, z: f32, turn: f32| {
        Affine3A::from_rotation_translation(Quat::from_rotation_y(turn), p(x, y, z))
    };
    k.all(&container(detail, Olive), &turned(0.06, 1.302, -0.52, 0.03));
    // Cases before them.
    for (i, (x, of)) in [(-1.1, Orange), (-0.2, DarkSteel), (0.85, Orange)].into_iter().enumerate() {
        let place = turned(x, 0.0, 0.72, 0.2 * (i as f32 - 1.0));
        k.all(&flight_case(detail, of), &place);
    }
    k
}

/// A case with metal edges and handles, 0.7 × 0.5 × 0.45 m.
fn flight_case(detail: Detail, of: Stuff) -> Things {
    let mut k: Things = Kit::new(detail);
    k.plain(of, [-0.34, 0.03, -0.22], [0.34, 0.49, 0.22]);
    if !k.fine() {
        k.plain(Rubber, [-0.3, 0.0, -0.19], [0.3, 0.04, 0.19]);
        return k;
    }
    for s in [-1.0_f32, 1.0] {
        for e in [-1.0_f32, 1.0] {
            k.plain(Steel, [s * 0.34 - 0.02, 0.02, e * 0.22 - 0.02], [s * 0.34 + 0.02, 0.5, e * 0.22 + 0.02]);
        }
        for y in [0.02, 0.33, 0.47] {
            k.plain(Steel, [-0.32, y, s * 0.222 - 0.01], [0.32, y + 0.03, s * 0.222 + 0.01]);
            k.plain(Steel, [s * 0.342 - 0.01, y, -0.2], [s * 0.342 + 0.01, y + 0.03, 0.2]);
        }
        k.bar(
            Rubber,
            &[
                p(s * 0.35, 0.2, -0.08),
                p(s * 0.39, 0.2, -0.06),
                p(s * 0.39, 0.2, 0.06),
                p(s * 0.35, 0.2, 0.08),
            ],
            0.012,
            8,
        );
        for e in [-1.0, 1.0] {
            k.turned(Rubber, p(0.28 * s, 0.0, 0.17 * e), &[[0.035, 0.0], [0.035, 0.035]], 12);
        }
    }
    k
}

fn crates(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let mut one: Things = Kit::new(detail);
    one.crate_box([Wood, Wood]);
    let places = [
        (-1.2, 0.0, -0.7, 1.2, 0.04),
        (-0.1, 0.0, -0.75, 1.15, -0.08),
        (1.15, 0.0, -0.6, 1.3, 0.1),
        (-1.15, 0.0, 0.55, 1.0, 0.3),
        (0.2, 0.0, 0.5, 1.1, -0.12),
        (1.3, 0.0, 0.6, 0.9, 0.5),
        (-1.1, 0.96, -0.7, 1.05, 0.14),
        (0.0, 0.92, -0.74, 1.0, 0.3),
        (1.12, 1.04, -0.62, 0.9, -0.2),
        (0.24, 0.88, 0.5, 0.75, 0.4),
        (-0.6, 1.8, -0.72, 0.9, -0.1),
    ];
    for (x, y, z, scale, turn) in places {
        let place = Affine3A::from_scale_rotation_translation(
            Vec3::splat(scale),
            Quat::from_rotation_y(turn),
            p(x, y, z),
        );
        k.all(&one, &place);
    }
    k
}

fn rack(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    for x in [-1.7, 0.0, 1.7] {
        for z in [-0.55, 0.55] {
            k.block(Blue, [x - 0.045, -0.01, z - 0.04], [x + 0.045, 3.1, z + 0.04], 0.008);
            k.block(DarkSteel, [x - 0.08, -0.01, z - 0.08], [x + 0.08, 0.015, z + 0.08], 0.004);
        }
        for i in 0..5 {
            let y = 0.2 + 0.56 * i as f32;
            let (a, b) = if i % 2 == 0 { (-0.55, 0.55) } else { (0.55, -0.55) };
            k.bar(Blue, &[p(x, y, a), p(x, y + 0.56, b)], 0.016, 6);
        }
    }
    for level in 0..4 {
        let y = 0.12 + 0.92 * level as f32;
        for z in [-0.55, 0.55] {
            k.block(Orange, [-1.72, y - 0.09, z - 0.03], [1.72, y, z + 0.03], 0.008);
        }
        let slats = detail.count(14, 7);
        for i in 0..slats {
            let x = -1.62 + 3.24 * i as f32 / (slats - 1) as f32;
            k.plain(Wood, [x - 0.08, y - 0.005, -0.56], [x + 0.08, y + 0.018, 0.56]);
        }
        if level == 3 {
            break;
        }
        let mut x = -1.6;
        let mut slot = 0;
        while x < 1.2 {
            let r = |c: u32| unit(921 + level, slot * 8 + c);
            let (w, h) = (0.3 + 0.34 * r(0), 0.22 + 0.46 * r(1));
            // Not across the middle posts.
            if x < 0.06 && x + w > -0.06 {
                x = 0.07;
            }
            let base = y + 0.018;
            let depth = 0.24 + 0.22 * r(2);
            match (4.0 * r(3)) as u32 {
                0 => k.block(
                    [Red, Blue, White][(r(4) * 2.99) as usize],
                    [x, base, -depth],
                    [x + w, base + h, depth],
                    0.02,
                ),
                1 => {
                    let radius = (0.5 * w).min(0.22);
                    k.turned(
                        Steel,
                        p(x + radius, base, 0.1),
                        &[[radius, 0.0], [radius, 0.9 * h], [0.5 * radius, h], [0.3 * radius, h + 0.04]],
                        18,
                    );
                }
                _ => k.plain(Card, [x, base, -depth], [x + w, base + h, depth]),
            }
            x += w + 0.05;
            slot += 1;
        }
    }
    k
}

fn bench(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    k.block(Wood, [-1.7, 0.84, -0.9], [1.7, 0.91, 0.1], 0.012);
    for x in [-1.6, -0.05, 1.5] {
        k.block(Structure, [x, -0.01, -0.85], [x + 0.1, 0.85, -0.75], 0.01);
        k.block(Structure, [x, -0.01, -0.05], [x + 0.1, 0.85, 0.05], 0.01);
    }
    for x in [-1.45, 0.3] {
        k.block(Red, [x, 0.1, -0.8], [x + 1.05, 0.84, 0.02], 0.015);
        for i in 0..4 {
            let y = 0.14 + 0.175 * i as f32;
            k.block(Red, [x + 0.04, y, 0.0], [x + 1.01, y + 0.155, 0.045], 0.01);
            k.bar(Chrome, &[p(x + 0.3, y + 0.09, 0.07), p(x + 0.75, y + 0.09, 0.07)], 0.012, 8);
            for at in [0.3, 0.75] {
                k.bar(Chrome, &[p(x + at, y + 0.09, 0.03), p(x + at, y + 0.09, 0.07)], 0.008, 6);
            }
        }
    }
    // A board with tools, a vice, a grinder.
    k.block(Structure, [-1.7, 0.9, -0.98], [1.7, 2.3, -0.92], 0.01);
    for i in 0..18 {
        let r = |c: u32| unit(931, 4 * i + c);
        let (x, y) = (-1.55 + 0.182 * i as f32, 2.15 - 0.25 * r(0));
        let long = 0.25 + 0.4 * r(1);
        k.bar(
            if i % 3 == 0 { Chrome } else { Steel },
            &[p(x, y, -0.9), p(x, y - long, -0.9)],
            0.012 + 0.008 * r(2),
            8,
        );
        k.bar(
            [Red, Yellow, Rubber][(i % 3) as usize],
            &[p(x, y - long + 0.02, -0.9), p(x, y - long - 0.14, -0.9)],
            0.02,
            8,
        );
    }
    k.block(DarkSteel, [0.9, 0.9, -0.2], [1.1, 1.08, 0.08], 0.02);
    k.block(DarkSteel, [0.88, 1.0, 0.1], [1.12, 1.12, 0.18], 0.015);
    k.bar(Chrome, &[p(1.0, 1.03, -0.1), p(1.0, 1.03, 0.34)], 0.02, 10);
    k.bar(Chrome, &[p(0.86, 1.03, 0.33), p(1.14, 1.03, 0.33)], 0.01, 8);
    k.turned(Olive, p(-1.1, 0.9, -0.4), &[[0.16, 0.0], [0.16, 0.03], [0.07, 0.06], [0.06, 0.2]], 20);
    k.turned_along(
        Olive,
        p(-1.32, 1.14, -0.4),
        Vec3::X,
        &[[0.04, 0.0], [0.04, 0.08], [0.11, 0.1], [0.11, 0.34], [0.04, 0.36], [0.04, 0.44]],
        22,
    );
    for x in [-1.34, -0.9] {
        k.turned_along(DarkSteel, p(x, 1.14, -0.4), Vec3::X, &[[0.12, 0.0], [0.12, 0.04]], 26);
    }
    // A stool and a bin.
    k.turned(Chrome, p(0.1, 0.0, 0.75), &[[0.2, 0.0], [0.2, 0.02], [0.03, 0.04], [0.03, 0.5]], 20);
    k.turned(Rubber, p(0.1, 0.5, 0.75), &[[0.17, 0.0], [0.19, 0.02], [0.18, 0.07], [0.0, 0.08]], 24);
    k.turned(
        DarkSteel,
        p(-1.2, 0.0, 0.7),
        &[[0.0, 0.0], [0.2, 0.0], [0.25, 0.6], [0.24, 0.6], [0.19, 0.02], [0.0, 0.02]],
        24,
    );
    k
}

/// A steel barrel.
pub(super) fn barrel(detail: Detail, of: Stuff) -> Things {
    let mut k: Things = Kit::new(detail);
    let side = [
        [0.0, 0.0],
        [0.28, 0.0],
        [0.3, 0.02],
        [0.3, 0.28],
        [0.312, 0.3],
        [0.3, 0.32],
        [0.3, 0.57],
        [0.312, 0.59],
        [0.3, 0.61],
        [0.3, 0.87],
        [0.285, 0.89],
        [0.27, 0.86],
        [0.0, 0.86],
    ];
    k.turned(of, Vec3::ZERO, &side, 28);
    k.turned(Steel, p(0.17, 0.855, 0.0), &[[0.04, 0.0], [0.04, 0.03]], 12);
    k
}

fn barrels(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let kinds = [Blue, Red, Chrome, Olive].map(|of| barrel(detail, of));
    for i in 0..5 {
        for j in 0..3 {
            let r = |c: u32| unit(941, (i * 4 + j) * 4 + c);
            if r(0) < 0.14 {
                continue;
            }
            let at = p(-1.36 + 0.68 * i as f32, 0.0, -0.9 + 0.68 * j as f32);
            k.all(
                &kinds[(r(1) * 3.99) as usize],
                &Affine3A::from_rotation_translation(Quat::from_rotation_y(6.0 * r(2)), at),
            );
        }
    }
    // Lying ones on a cradle.
    for i in 0..2 {
        let turn = Quat::from_rotation_z(TAU / 4.0);
        let at = p(0.45 + 1.0 * i as f32 - 0.5, 0.36, 0.98);
        k.all(&kinds[i + 1], &Affine3A::from_rotation_translation(turn, at + Vec3::X * 0.44));
        for x in [-0.3, 0.3] {
            k.block(Wood, [at.x + x - 0.04, -0.01, 0.72], [at.x + x + 0.04, 0.1, 1.24], 0.01);
        }
    }
    k
}

/// Movable steps with a platform, up along +X.
fn steps(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let (count, rise, tread) = (8, 0.24, 0.2);
    let top = rise * count as f32;
    for i in 0..count {
        let (x, y) = (-1.5 + tread * i as f32, rise * (i + 1) as f32);
        k.block(DarkSteel, [x, y - 0.03, -0.45], [x + 0.24, y, 0.45], 0.006);
        for j in 0..4 {
            let z = -0.36 + 0.24 * j as f32;
            k.plain(Steel, [x + 0.02, y - 0.002, z - 0.03], [x + 0.22, y + 0.006, z + 0.03]);
        }
    }
    let edge = -1.5 + tread * count as f32;
    k.block(DarkSteel, [edge, top - 0.05, -0.5], [1.6, top, 0.5], 0.01);
    for s in [-1.0_f32, 1.0] {
        let z = 0.48 * s;
        k.bar(Yellow, &[p(-1.55, 0.1, z), p(edge + 0.1, top - 0.02, z)], 0.04, 12);
        k.bar(Yellow, &[p(-1.5, 0.3 + 0.9, z), p(edge, top + 0.95, z), p(1.55, top + 0.95, z)], 0.022, 10);
        k.bar(Yellow, &[p(edge, top + 0.48, z), p(1.55, top + 0.48, z)], 0.016, 8);
        for x in [edge, 0.85, 1.55] {
            k.bar(Yellow, &[p(x, top - 0.05, z), p(x, top + 0.95, z)], 0.022, 10);
            k.bar(Yellow, &[p(x, 0.1, z), p(x, top - 0.04, z)], 0.035, 10);
        }
        for (x, y) in [(-1.2, 0.36), (-0.6, 1.08)] {
            k.bar(Yellow, &[p(x, y, z), p(x, y + 1.18, z)], 0.016, 8);
        }
        k.bar(Yellow, &[p(edge, 0.3, z), p(1.55, top - 0.3, z)], 0.02, 8);
        k.bar(Yellow, &[p(-1.5, 0.12, z), p(1.55, 0.12, z)], 0.035, 10);
        for x in [-1.3, 1.4] {
            k.turned_along(
                Rubber,
                p(x, 0.11, z + 0.06 * s - 0.035),
                Vec3::Z,
                &[[0.11, 0.0], [0.11, 0.07]],
                20,
            );
        }
    }
    k.bar(Yellow, &[p(1.55, top + 0.95, -0.48), p(1.55, top + 0.95, 0.48)], 0.022, 10);
    k
}
