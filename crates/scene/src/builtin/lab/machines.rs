//! Machines, each about the middle of its underside, fronts towards +Z.

use std::f32::consts::{FRAC_PI_2, TAU};

use glam::{Affine3A, Quat, Vec3};

use super::palette::Stuff::{self, *};
use crate::builtin::Detail;
use crate::builtin::kit::Kit;
use crate::builtin::noise::unit;

type Things = Kit<Stuff>;

fn p(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(x, y, z)
}

/// A vessel with domed ends on four legs, with flanges, a gauge, a sight glass and pipes.
pub(super) fn reactor(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let hull = [
        [0.0, 0.45],
        [0.16, 0.47],
        [0.36, 0.56],
        [0.47, 0.70],
        [0.50, 0.86],
        [0.50, 1.25],
        [0.50, 1.64],
        [0.47, 1.80],
        [0.36, 1.94],
        [0.16, 2.03],
        [0.0, 2.05],
    ];
    k.round(Steel, Vec3::ZERO, &hull, 36);
    for y in [0.84, 1.25, 1.66] {
        k.turned(
            DarkSteel,
            p(0.0, y, 0.0),
            &[[0.49, -0.025], [0.535, -0.02], [0.535, 0.02], [0.49, 0.025]],
            36,
        );
        for i in 0..detail.count(10, 6) {
            let d = Quat::from_rotation_y(TAU * i as f32 / detail.count(10, 6) as f32);
            k.turned_along(
                Steel,
                p(0.0, y, 0.0) + d * Vec3::X * 0.53,
                d * Vec3::X,
                &[[0.014, 0.0], [0.014, 0.016]],
                6,
            );
        }
    }
    for i in 0..4 {
        let d = Quat::from_rotation_y(FRAC_PI_2 * (i as f32 + 0.5));
        k.bar(Steel, &[d * p(0.56, 0.015, 0.0), d * p(0.46, 0.9, 0.0)], 0.035, 12);
        k.turned(Rubber, d * p(0.56, 0.0, 0.0), &[[0.07, 0.0], [0.07, 0.02], [0.045, 0.035]], 16);
    }
    // The manhole and its screws.
    k.turned(
        DarkSteel,
        p(0.0, 2.0, 0.0),
        &[[0.2, 0.0], [0.2, 0.08], [0.24, 0.085], [0.24, 0.125], [0.16, 0.15]],
        32,
    );
    k.turned(
        Steel,
        p(0.0, 2.14, 0.0),
        &[[0.07, 0.0], [0.07, 0.16], [0.10, 0.17], [0.10, 0.30], [0.05, 0.33]],
        24,
    );
    // A jacket pipe, a drain, an inlet.
    k.pipe(
        Copper,
        &[p(0.45, 0.7, 0.18), p(0.6, 0.7, 0.18), p(0.6, 1.8, 0.18), p(0.40, 1.8, 0.18)],
        0.03,
        0.1,
        12,
    );
    k.pipe(
        Copper,
        &[p(-0.45, 0.95, -0.2), p(-0.6, 0.95, -0.2), p(-0.6, 2.28, -0.2), p(-0.05, 2.28, -0.05)],
        0.026,
        0.1,
        12,
    );
    k.pipe(Blue, &[p(0.0, 0.5, 0.0), p(0.0, 0.22, 0.0), p(0.0, 0.22, -0.6)], 0.04, 0.12, 14);
    for at in [p(0.6, 1.0, 0.18), p(0.6, 1.5, 0.18)] {
        k.flange(DarkSteel, at, Vec3::Y, 0.03);
    }
    k.flange(DarkSteel, p(0.0, 0.22, -0.45), Vec3::Z, 0.04);
    // A sight glass and a gauge.
    k.turned_along(DarkSteel, p(0.0, 1.42, 0.48), Vec3::Z, &[[0.11, 0.0], [0.11, 0.05], [0.085, 0.055]], 24);
    k.turned_along(Screen, p(0.0, 1.42, 0.50), Vec3::Z, &[[0.08, 0.0], [0.08, 0.038]], 24);
    k.bar(Steel, &[p(-0.2, 1.1, 0.44), p(-0.2, 1.1, 0.56)], 0.012, 8);
    k.turned_along(Enamel, p(-0.2, 1.1, 0.55), Vec3::Z, &[[0.06, 0.0], [0.06, 0.04], [0.052, 0.045]], 20);
    k
}

/// A cabinet of 0.6 × 0.8 × 2 m with slots and lamps.
pub(super) fn rack(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    k.block(DarkSteel, [-0.31, 0.04, -0.4], [0.31, 2.02, 0.36], 0.012);
    k.plain(Rubber, [-0.29, 0.0, -0.38], [0.29, 0.05, 0.34]);
    for x in [-0.30, 0.27] {
        k.block(Steel, [x, 0.1, 0.35], [x + 0.03, 1.98, 0.385], 0.004);
    }
    for i in 0..9 {
        let y = 0.12 + 0.205 * i as f32;
        let stuff = [Enamel, DarkSteel, Steel, Blue][(unit(340, i) * 3.99) as usize];
        k.block(stuff, [-0.265, y, 0.34], [0.265, y + 0.185, 0.375], 0.005);
        if k.fine() {
            for x in [-0.235, 0.235] {
                k.plain(Steel, [x - 0.006, y + 0.03, 0.372], [x + 0.006, y + 0.042, 0.41]);
                k.plain(Steel, [x - 0.006, y + 0.14, 0.372], [x + 0.006, y + 0.152, 0.41]);
                k.plain(Steel, [x - 0.008, y + 0.02, 0.40], [x + 0.008, y + 0.162, 0.412]);
            }
        }
        if i % 3 == 1 {
            k.plain(Screen, [-0.18, y + 0.04, 0.37], [0.06, y + 0.15, 0.379]);
        } else {
            for slat in 0..detail.count(4, 2) {
                let v = y + 0.03 + 0.034 * slat as f32;
                k.plain(Rubber, [-0.19, v, 0.37], [0.08, v + 0.016, 0.381]);
            }
        }
        for lamp in 0..detail.count(3, 1) {
            let x = 0.11 + 0.035 * lamp as f32;
            let stuff = if unit(341, i * 3 + lamp) < 0.6 { Signal } else { Orange };
            k.turned_along(stuff, p(x, y + 0.09, 0.373), Vec3::Z, &[[0.009, 0.0], [0.009, 0.008]], 8);
        }
    }
    k
}

/// The housing of a centrifuge; [`rotor`] turns in it.
pub(super) fn centrifuge(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let drum = [
        [0.62, 0.06],
        [0.70, 0.09],
        [0.72, 0.16],
        [0.72, 0.86],
        [0.76, 0.90],
        [0.77, 0.96],
        [0.74, 1.0],
        [0.66, 1.0],
        [0.64, 0.96],
        [0.64, 0.62],
        [0.0, 0.60],
    ];
    k.turned(Enamel, Vec3::ZERO, &drum, 56);
    for i in 0..6 {
        let d = Quat::from_rotation_y(TAU * i as f32 / 6.0);
        k.turned(Rubber, d * p(0.55, 0.0, 0.0), &[[0.06, 0.0], [0.06, 0.07]], 14);
    }
    k.turned(Blue, Vec3::Y * 0.3, &[[0.715, 0.0], [0.735, 0.01], [0.735, 0.13], [0.715, 0.14]], 56);
    k.block(DarkSteel, [-0.24, 0.52, 0.66], [0.24, 0.82, 0.775], 0.01);
    k.plain(Screen, [-0.2, 0.62, 0.77], [0.08, 0.79, 0.778]);
    for i in 0..3 {
        let at = p(0.15, 0.57 + 0.09 * i as f32, 0.765);
        k.turned_along([Signal, Yellow, Orange][i], at, Vec3::Z, &[[0.022, 0.0], [0.022, 0.01]], 14);
    }
    k
}

/// The rotor of a centrifuge about its axis, from which sample tubes hang.
pub(super) fn rotor(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    k.turned(
        Steel,
        Vec3::Y * 0.60,
        &[[0.13, 0.01], [0.13, 0.16], [0.19, 0.22], [0.19, 0.28], [0.06, 0.33], [0.045, 0.5], [0.0, 0.52]],
        32,
    );
    for i in 0..8 {
        let d = Quat::from_rotation_y(TAU * i as f32 / 8.0);
        k.bar(Steel, &[d * p(0.15, 0.84, 0.0), d * p(0.50, 0.84, 0.0)], 0.028, 10);
        k.turned(
            Orange,
            d * p(0.50, 0.68, 0.0),
            &[[0.0, 0.0], [0.05, 0.012], [0.065, 0.05], [0.065, 0.22], [0.075, 0.23], [0.075, 0.26]],
            18,
        );
        k.turned(GreenLiquid, d * p(0.50, 0.93, 0.0), &[[0.045, 0.0], [0.045, 0.06], [0.03, 0.07]], 14);
    }
    k
}

/// Three glass columns with coils in a frame.
pub(super) fn coils(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    k.block(DarkSteel, [-0.94, 0.0, -0.33], [0.94, 0.12, 0.33], 0.012);
    k.block(Enamel, [-0.92, 0.115, -0.31], [0.92, 0.5, 0.31], 0.012);
    k.block(DarkSteel, [-0.94, 2.2, -0.14], [0.94, 2.28, 0.14], 0.008);
    for x in [-0.9, 0.9] {
        k.block(Steel, [x - 0.03, 0.49, -0.03], [x + 0.03, 2.21, 0.03], 0.006);
    }
    for (i, x) in [-0.55_f32, 0.0, 0.55].into_iter().enumerate() {
        let liquid = [RedLiquid, BlueLiquid, GreenLiquid][i];
        k.turned(Steel, p(x, 0.49, 0.0), &[[0.2, 0.0], [0.2, 0.05], [0.15, 0.07]], 28);
        k.turned(liquid, p(x, 0.55, 0.0), &[[0.055, 0.0], [0.055, 1.5]], 20);
        k.turned(Steel, p(x, 2.03, 0.0), &[[0.07, 0.0], [0.13, 0.02], [0.13, 0.1], [0.05, 0.18]], 28);
        let turns = 9.0;
        let steps = detail.facets(108, 63);
        let coil: Vec<Vec3> = (0..=steps)
            .map(|s| {
                let t = s as f32 / steps as f32;
                Quat::from_rotation_y(TAU * turns * t) * p(0.14, 0.62 + 1.36 * t, 0.0) + p(x, 0.0, 0.0)
            })
            .collect();
        k.bar(if i == 1 { Copper } else { Glass }, &coil, 0.014, 6);
    }
    let over = |x: f32, z: f32| {
        [p(x, 2.12, z), p(x, 2.24, z + 0.18), p(x + 0.55, 2.24, z + 0.18), p(x + 0.55, 2.12, z)]
    };
    k.pipe(Copper, &over(-0.55, 0.0), 0.018, 0.06, 8);
    k.pipe(Copper, &over(0.0, 0.0), 0.018, 0.06, 8);
    for i in 0..5 {
        let x = -0.7 + 0.35 * i as f32;
        k.turned_along(DarkSteel, p(x, 0.33, 0.30), Vec3::Z, &[[0.05, 0.0], [0.05, 0.02]], 18);
        k.plain(Yellow, [x - 0.008, 0.29, 0.315], [x + 0.008, 0.37, 0.335]);
    }
    k
}

/// The base of an arm; [`robot_arm`] turns on it.
pub(super) fn robot_base(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    k.block(DarkSteel, [-0.45, 0.0, -0.45], [0.45, 0.06, 0.45], 0.012);
    k.turned(
        Yellow,
        Vec3::Y * 0.05,
        &[[0.34, 0.0], [0.30, 0.08], [0.24, 0.42], [0.27, 0.46], [0.27, 0.55]],
        40,
    );
    for i in 0..8 {
        let d = Quat::from_rotation_y(TAU * (i as f32 + 0.5) / 8.0);
        k.turned(Steel, d * p(0.40, 0.055, 0.0), &[[0.025, 0.0], [0.025, 0.025]], 6);
    }
    k
}

/// An arm about the axis of its base.
pub(super) fn robot_arm(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    k.turned(DarkSteel, Vec3::Y * 0.595, &[[0.25, 0.0], [0.25, 0.06], [0.16, 0.08], [0.16, 0.2]], 36);
    let across = |k: &mut Things, at: Vec3, r: f32, half: f32| {
        k.turned_along(
            DarkSteel,
            at,
            Vec3::X,
            &[[r, -half], [r + 0.015, -half + 0.015], [r + 0.015, half - 0.015], [r, half]],
            28,
        );
    };
    let (shoulder, elbow, wrist) = (p(0.0, 0.86, 0.0), p(0.0, 1.78, -0.22), p(0.0, 1.95, 0.42));
    across(&mut k, shoulder, 0.15, 0.17);
    across(&mut k, elbow, 0.12, 0.14);
    across(&mut k, wrist, 0.07, 0.09);
    k.bar(Yellow, &[shoulder, elbow], 0.10, 16);
    k.bar(Yellow, &[elbow, wrist], 0.075, 16);
    k.bar(Steel, &[shoulder + p(0.13, 0.05, -0.1), elbow + p(0.13, -0.1, -0.02)], 0.03, 12);
    k.pipe(
        Rubber,
        &[
            p(0.0, 0.72, -0.15),
            p(-0.14, 1.2, -0.32),
            p(-0.14, 1.75, -0.38),
            p(-0.08, 1.98, -0.1),
            p(-0.06, 2.0, 0.36),
        ],
        0.018,
        0.2,
        8,
    );
    let hand = wrist + p(0.0, -0.22, 0.06);
    k.bar(Steel, &[wrist, hand], 0.045, 14);
    k.block(
        DarkSteel,
        [hand.x - 0.1, hand.y - 0.04, hand.z - 0.04],
        [hand.x + 0.1, hand.y + 0.01, hand.z + 0.04],
        0.008,
    );
    for x in [-0.085, 0.055] {
        k.block(Steel, [x, hand.y - 0.19, hand.z - 0.02], [x + 0.03, hand.y - 0.035, hand.z + 0.02], 0.006);
    }
    k
}

/// A motor that drives a pump, on a frame.
pub(super) fn pump(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    for z in [-0.22, 0.18] {
        k.block(DarkSteel, [-0.82, 0.0, z], [0.82, 0.1, z + 0.05], 0.006);
    }
    for x in [-0.7, -0.2, 0.3, 0.6] {
        k.block(DarkSteel, [x, 0.04, -0.2], [x + 0.08, 0.16, 0.21], 0.006);
    }
    let axis = p(-0.75, 0.42, 0.0);
    let motor = [[0.14, 0.0], [0.22, 0.03], [0.24, 0.06], [0.24, 0.56], [0.21, 0.62], [0.09, 0.64]];
    k.turned_along(Blue, axis, Vec3::X, &motor, 32);
    // Cooling fins.
    for i in 0..detail.count(20, 5) {
        let d = Quat::from_rotation_x(TAU * i as f32 / detail.count(20, 5) as f32);
        let fin = crate::builtin::shapes::cuboid(p(0.09, 0.22, -0.006), p(0.54, 0.265, 0.006));
        k.add(Blue, &fin, &Affine3A::from_rotation_translation(d, axis));
    }
    k.bar(Steel, &[axis + Vec3::X * 0.6, axis + Vec3::X * 0.95], 0.035, 14);
    k.turned_along(Orange, axis + Vec3::X * 0.72, Vec3::X, &[[0.09, 0.0], [0.09, 0.12]], 24);
    k.block(DarkSteel, [-0.66, 0.14, -0.14], [-0.2, 0.24, 0.14], 0.01);
    k.block(DarkSteel, [0.3, 0.14, -0.14], [0.6, 0.24, 0.14], 0.01);
    let volute = [[0.12, 0.0], [0.24, 0.03], [0.28, 0.09], [0.28, 0.16], [0.24, 0.22], [0.13, 0.25]];
    k.turned_along(Enamel, axis + Vec3::X * 0.95, Vec3::X, &volute, 36);
    k.bar(Enamel, &[p(0.45, 0.42, 0.0), p(0.82, 0.42, 0.0)], 0.08, 18);
    k.flange(Steel, p(0.80, 0.42, 0.0), Vec3::X, 0.08);
    k.bar(Enamel, &[p(0.33, 0.42, 0.19), p(0.33, 0.90, 0.19)], 0.065, 18);
    k.flange(Steel, p(0.33, 0.90, 0.19), Vec3::Y, 0.065);
    k
}
