//! Benches, shelves and what stands on them, each about the middle of its underside, fronts towards +Z.

use std::f32::consts::TAU;

use glam::{Affine3A, Quat, Vec3};

use super::palette::Stuff::{self, *};
use crate::builtin::Detail;
use crate::builtin::kit::Kit;
use crate::builtin::noise::unit;

type Things = Kit<Stuff>;

/// A bench of 1.8 × 0.8 m, its top at 0.9 m, with a rail behind the top.
fn bench(detail: Detail) -> Things {
    let mut k = Kit::new(detail);
    k.block(Enamel, [-0.9, 0.86, -0.4], [0.9, 0.90, 0.4], 0.008);
    for x in [-0.84, 0.84] {
        for z in [-0.34, 0.34] {
            k.block(Steel, [x - 0.025, 0.015, z - 0.025], [x + 0.025, 0.865, z + 0.025], 0.005);
            k.turned(Rubber, Vec3::new(x, 0.0, z), &[[0.035, 0.0], [0.035, 0.012], [0.02, 0.03]], 12);
        }
        k.plain(Steel, [x - 0.02, 0.20, -0.33], [x + 0.02, 0.23, 0.33]);
    }
    k.block(Steel, [-0.85, 0.22, -0.34], [0.85, 0.24, 0.34], 0.004);
    // A chest of drawers under one half.
    k.block(Enamel, [0.12, 0.26, -0.32], [0.78, 0.865, 0.33], 0.008);
    for i in 0..3 {
        let y = 0.29 + 0.19 * i as f32;
        k.block(Blue, [0.15, y, 0.322], [0.75, y + 0.165, 0.342], 0.004);
        let grip = [[0.33, 0.335], [0.33, 0.37], [0.57, 0.37], [0.57, 0.335]];
        let grip: Vec<Vec3> = grip.iter().map(|&[x, z]| Vec3::new(x, y + 0.11, z)).collect();
        k.pipe(Steel, &grip, 0.006, 0.02, 5);
    }
    k
}

/// A bench with a shelf, racks of test tubes, flasks and a microscope.
pub(super) fn glass_bench(detail: Detail) -> Things {
    let mut k = bench(detail);
    for x in [-0.86, 0.0, 0.86] {
        k.bar(Steel, &[Vec3::new(x, 0.89, -0.34), Vec3::new(x, 1.5, -0.34)], 0.014, 8);
    }
    k.block(Glass, [-0.9, 1.28, -0.40], [0.9, 1.295, -0.20], 0.003);
    for i in 0..5 {
        bottle(&mut k, Vec3::new(-0.75 + 0.37 * i as f32, 1.294, -0.30), 0.75, i);
    }
    tube_rack(&mut k, Vec3::new(-0.5, 0.899, 0.06), 0);
    for (i, (x, z, size)) in [(0.1, 0.1, 1.0), (0.28, -0.05, 0.8), (0.15, -0.18, 0.7)].into_iter().enumerate()
    {
        flask(&mut k, Vec3::new(x, 0.899, z), size, [RedLiquid, GreenLiquid, BlueLiquid][i]);
    }
    microscope(&mut k, Vec3::new(0.6, 0.899, 0.0));
    k
}

/// A bench with two screens and their keyboards.
pub(super) fn screen_bench(detail: Detail) -> Things {
    let mut k = bench(detail);
    for (x, turn) in [(-0.42, 0.16), (0.42, -0.16)] {
        let mut screen: Things = Kit::new(detail);
        screen.turned(DarkSteel, Vec3::ZERO, &[[0.12, 0.0], [0.12, 0.008], [0.03, 0.022]], 20);
        screen.bar(DarkSteel, &[Vec3::Y * 0.01, Vec3::new(0.0, 0.24, -0.02)], 0.018, 10);
        screen.block(Rubber, [-0.29, 0.14, -0.01], [0.29, 0.50, 0.022], 0.006);
        screen.plain(Screen, [-0.275, 0.155, 0.015], [0.275, 0.485, 0.024]);
        screen.block(Rubber, [-0.21, 0.0, 0.16], [0.21, 0.016, 0.30], 0.004);
        for row in 0..detail.count(3, 1) {
            for key in 0..detail.count(10, 4) {
                let (x, z) = (-0.195 + 0.04 * key as f32, 0.172 + 0.04 * row as f32);
                screen.plain(Enamel, [x, 0.012, z], [x + 0.032, 0.022, z + 0.032]);
            }
        }
        let place =
            Affine3A::from_rotation_translation(Quat::from_rotation_y(turn), Vec3::new(x, 0.899, -0.12));
        k.all(&screen, &place);
    }
    flask(&mut k, Vec3::new(0.0, 0.899, -0.25), 0.8, BlueLiquid);
    k
}

/// A rack of 2 × 6 test tubes, filled to different heights.
fn tube_rack(k: &mut Things, at: Vec3, seed: u32) {
    let mut rack: Things = Kit::new(k.detail);
    for y in [0.01, 0.075] {
        rack.block(Wood, [-0.15, y, -0.05], [0.15, y + 0.012, 0.05], 0.002);
    }
    for x in [-0.15, 0.14] {
        rack.plain(Wood, [x, 0.0, -0.05], [x + 0.012, 0.1, 0.05]);
    }
    for i in 0..k.detail.count(6, 2) {
        for j in 0..2 {
            let foot = Vec3::new(-0.115 + 0.046 * i as f32, 0.02, -0.024 + 0.048 * j as f32);
            let fill = 0.03 + 0.06 * unit(311 + seed, i * 2 + j);
            let liquid = [RedLiquid, GreenLiquid, BlueLiquid][((i + j * 2 + seed) % 3) as usize];
            rack.turned(liquid, foot, &[[0.0, 0.0], [0.009, 0.005], [0.0122, 0.014], [0.0122, fill]], 7);
            rack.turned(
                Glass,
                foot + Vec3::Y * (fill - 0.001),
                &[[0.0115, 0.0], [0.0115, 0.13 - fill], [0.014, 0.134 - fill]],
                7,
            );
        }
    }
    k.at_all(&rack, at);
}

/// An Erlenmeyer flask with something in it.
fn flask(k: &mut Things, at: Vec3, size: f32, liquid: Stuff) {
    let s = |p: &[[f32; 2]]| p.iter().map(|&[r, y]| [r * size, y * size]).collect::<Vec<_>>();
    k.turned(liquid, at, &s(&[[0.07, 0.0], [0.082, 0.008], [0.085, 0.02], [0.062, 0.075]]), 16);
    k.turned(
        Glass,
        at,
        &s(&[[0.0, 0.07], [0.0635, 0.07], [0.03, 0.15], [0.024, 0.17], [0.024, 0.21], [0.03, 0.216]]),
        16,
    );
}

/// A bottle with a cap.
fn bottle(k: &mut Things, at: Vec3, size: f32, which: u32) {
    let s = |p: &[[f32; 2]]| p.iter().map(|&[r, y]| [r * size, y * size]).collect::<Vec<_>>();
    let stuff = [Glass, BlueLiquid, Enamel, GreenLiquid, Card][(which % 5) as usize];
    let body = [[0.056, 0.0], [0.062, 0.008], [0.062, 0.15], [0.05, 0.175], [0.024, 0.19], [0.024, 0.215]];
    k.turned(stuff, at, &s(&body), 10);
    if k.fine() {
        k.turned(Rubber, at, &s(&[[0.028, 0.21], [0.028, 0.235], [0.024, 0.24]]), 8);
    }
}

fn microscope(k: &mut Things, at: Vec3) {
    let mut m: Things = Kit::new(k.detail);
    m.block(Enamel, [-0.09, 0.0, -0.12], [0.09, 0.04, 0.12], 0.008);
    m.block(Enamel, [-0.03, 0.035, -0.12], [0.03, 0.34, -0.06], 0.008);
    m.block(DarkSteel, [-0.07, 0.14, -0.07], [0.07, 0.155, 0.08], 0.003);
    m.block(Enamel, [-0.03, 0.30, -0.09], [0.03, 0.35, 0.06], 0.008);
    m.turned(
        Steel,
        Vec3::new(0.0, 0.19, 0.02),
        &[[0.009, 0.0], [0.014, 0.03], [0.024, 0.05], [0.024, 0.115]],
        16,
    );
    m.turned_along(
        Rubber,
        Vec3::new(0.0, 0.335, 0.02),
        Vec3::new(0.0, 0.8, 0.55),
        &[[0.02, 0.0], [0.02, 0.12], [0.026, 0.125], [0.026, 0.15]],
        16,
    );
    for x in [-0.055, 0.03] {
        m.turned_along(Rubber, Vec3::new(x, 0.1, -0.09), Vec3::X, &[[0.024, 0.0], [0.024, 0.025]], 14);
    }
    k.at_all(&m, at);
}

/// A stool on five legs.
pub(super) fn stool(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    k.turned(
        Rubber,
        Vec3::Y * 0.53,
        &[[0.15, 0.0], [0.18, 0.012], [0.185, 0.04], [0.16, 0.065], [0.0, 0.06]],
        28,
    );
    k.turned(Steel, Vec3::Y * 0.1, &[[0.03, 0.0], [0.03, 0.2], [0.018, 0.205], [0.018, 0.435]], 16);
    let ring: Vec<Vec3> =
        (0..5).map(|i| Quat::from_rotation_y(TAU * i as f32 / 5.0) * Vec3::new(0.2, 0.03, 0.0)).collect();
    for foot in ring {
        k.bar(Steel, &[Vec3::new(0.0, 0.14, 0.0), foot + Vec3::Y * 0.02], 0.012, 8);
        k.turned(Rubber, foot - Vec3::Y * 0.03, &[[0.02, 0.0], [0.024, 0.02], [0.012, 0.05]], 10);
    }
    k
}

/// A shelf of 1.6 × 0.4 × 2.2 m with bottles and boxes.
pub(super) fn shelf(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    for x in [-0.82, 0.79] {
        k.block(DarkSteel, [x, 0.0, -0.2], [x + 0.03, 2.2, 0.2], 0.004);
    }
    k.plain(Enamel, [-0.795, 0.05, -0.2], [0.795, 2.15, -0.188]);
    for i in 0..5 {
        let y = 0.08 + 0.5 * i as f32;
        k.block(Enamel, [-0.8, y, -0.19], [0.8, y + 0.03, 0.19], 0.004);
        if i == 4 {
            break;
        }
        let top = y + 0.029;
        let mut x = -0.74;
        let mut slot = 0;
        while x < 0.5 {
            let r = |c: u32| unit(320 + i, slot * 4 + c);
            if r(0) < 0.35 {
                let size = 0.9 + 0.5 * r(1);
                bottle(&mut k, Vec3::new(x + 0.08, top, 0.02 + 0.1 * (r(2) - 0.5)), size, slot + i);
                x += 0.17 + 0.05 * r(3);
            } else {
                let (w, h) = (0.14 + 0.14 * r(1), 0.12 + 0.2 * r(2));
                let stuff = [Card, Blue, Enamel, Orange][(r(3) * 3.99) as usize];
                k.plain(stuff, [x + 0.01, top, -0.14], [x + w, top + h, 0.12]);
                x += w + 0.03;
            }
            slot += 1;
        }
    }
    k
}

/// A cupboard with a sloping window, its bench inside, a duct on top.
pub(super) fn hood(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    k.block(Enamel, [-0.78, 0.0, -0.4], [0.78, 0.88, 0.36], 0.01);
    k.block(DarkSteel, [-0.79, 0.875, -0.4], [0.79, 0.92, 0.39], 0.006);
    for x in [-0.38, 0.38] {
        k.block(Blue, [x - 0.35, 0.08, 0.352], [x + 0.35, 0.82, 0.378], 0.006);
        let side = -x.signum() * 0.28;
        k.bar(Steel, &[Vec3::new(x + side, 0.5, 0.385), Vec3::new(x + side, 0.7, 0.385)], 0.009, 8);
    }
    for x in [-0.78, 0.70] {
        k.block(Enamel, [x, 0.915, -0.4], [x + 0.08, 2.1, 0.30], 0.006);
    }
    k.plain(Steel, [-0.71, 0.915, -0.4], [0.71, 2.1, -0.38]);
    k.block(Enamel, [-0.78, 1.75, -0.39], [0.78, 2.12, 0.34], 0.01);
    k.plain(Lamp, [-0.6, 1.742, -0.1], [0.6, 1.755, 0.1]);
    k.block(Glass, [-0.71, 1.35, 0.26], [0.71, 1.77, 0.275], 0.003);
    k.block(Steel, [-0.71, 1.33, 0.25], [0.71, 1.36, 0.29], 0.004);
    k.turned(Steel, Vec3::new(0.0, 2.11, -0.05), &[[0.2, 0.0], [0.2, 0.02], [0.15, 0.03], [0.15, 0.28]], 28);
    for (i, x) in [-0.4, -0.1, 0.3].into_iter().enumerate() {
        flask(
            &mut k,
            Vec3::new(x, 0.919, -0.1 + 0.08 * i as f32),
            1.1,
            [GreenLiquid, RedLiquid, BlueLiquid][i],
        );
    }
    k
}

/// A desk with a slanted panel of screens, buttons and lamps.
pub(super) fn console(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    k.block(Enamel, [-0.78, 0.0, -0.38], [0.78, 0.80, 0.18], 0.012);
    k.block(DarkSteel, [-0.8, 0.795, -0.4], [0.8, 0.85, 0.4], 0.01);
    for x in [-0.7, 0.7] {
        k.block(Steel, [x - 0.03, 0.0, 0.30], [x + 0.03, 0.80, 0.36], 0.006);
    }
    let mut panel: Things = Kit::new(detail);
    panel.block(Enamel, [-0.78, 0.0, -0.04], [0.78, 0.46, 0.04], 0.01);
    for i in 0..3 {
        let x = -0.73 + 0.5 * i as f32;
        panel.plain(Screen, [x, 0.17, 0.035], [x + 0.44, 0.42, 0.046]);
    }
    for i in 0..detail.count(22, 6) {
        let x = -0.72 + 0.068 * i as f32;
        let stuff = [Signal, Orange, Yellow, Blue][(unit(330, i) * 3.99) as usize];
        panel.turned_along(
            stuff,
            Vec3::new(x, 0.09, 0.038),
            Vec3::Z,
            &[[0.018, 0.0], [0.018, 0.012], [0.013, 0.018]],
            12,
        );
    }
    let lean = Affine3A::from_rotation_translation(Quat::from_rotation_x(-0.45), Vec3::new(0.0, 0.84, -0.12));
    k.all(&panel, &lean);
    for i in 0..detail.count(30, 8) {
        let (x, z) = (-0.6 + 0.042 * (i % 15) as f32 * 2.0, 0.12 + 0.1 * (i / 15) as f32);
        k.plain(Rubber, [x, 0.845, z], [x + 0.05, 0.862, z + 0.06]);
    }
    k
}
