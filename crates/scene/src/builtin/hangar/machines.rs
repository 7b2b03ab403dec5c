//! Machines: an engine on its stand, a fan, and what lies on pallets; each about the middle of its foot.

use std::f32::consts::TAU;

use glam::{Quat, Vec3};

use super::palette::Stuff::{self, *};
use super::stores::barrel;
use crate::builtin::Detail;
use crate::builtin::joinery::torus;
use crate::builtin::kit::Kit;
use crate::builtin::noise::unit;

type Things = Kit<Stuff>;

fn p(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(x, y, z)
}

/// A jet engine on a stand, its axis along X.
pub(super) fn engine(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let axis = p(0.0, 1.25, -0.1);
    let casing = [
        [0.0, -1.0],
        [0.3, -1.0],
        [0.62, -1.35],
        [0.7, -1.38],
        [0.74, -1.3],
        [0.76, -0.8],
        [0.62, -0.3],
        [0.5, 0.2],
        [0.48, 0.6],
        [0.56, 0.9],
        [0.5, 1.3],
        [0.36, 1.62],
        [0.33, 1.6],
        [0.4, 1.2],
        [0.0, 1.1],
    ];
    k.turned_along(Steel, axis, Vec3::X, &casing, 48);
    k.turned_along(
        DarkSteel,
        axis - Vec3::X * 1.4,
        Vec3::X,
        &[[0.0, 0.0], [0.08, 0.04], [0.15, 0.14], [0.19, 0.3], [0.19, 0.42]],
        26,
    );
    for i in 0..22 {
        let turn = Quat::from_rotation_x(TAU * i as f32 / 22.0);
        let (a, b) = (turn * p(-1.1, 0.15, 0.0), turn * p(-1.12, 0.63, 0.0));
        let side = turn * p(0.7, 0.0, 0.7);
        k.plank(Chrome, axis + a, axis + b, side, [0.055, 0.006]);
    }
    for i in 0..9 {
        let turn = TAU * i as f32 / 9.0;
        let at = |x: f32, r: f32, lag: f32| axis + Quat::from_rotation_x(turn + lag) * p(x, r, 0.0);
        k.pipe(
            [Copper, Steel, DarkSteel][i % 3],
            &[at(-0.5, 0.66, 0.0), at(-0.3, 0.74, 0.0), at(0.5, 0.6, 0.3), at(0.85, 0.56, 0.3)],
            0.018,
            0.08,
            8,
        );
    }
    for x in [-0.25, 0.25, 0.7] {
        k.turned_along(
            DarkSteel,
            axis + Vec3::X * x,
            Vec3::X,
            &[[0.5, -0.03], [0.6, -0.02], [0.6, 0.02], [0.5, 0.03]],
            44,
        );
    }
    for s in [-1.0_f32, 1.0] {
        for x in [-0.75, 0.75] {
            k.bar(Yellow, &[p(x, 0.14, -0.1 + 0.75 * s), p(x, 1.0, -0.1 + 0.56 * s)], 0.05, 12);
            k.bar(Yellow, &[p(x, 0.95, -0.1 + 0.62 * s), p(x, 1.25, -0.1 + 0.66 * s)], 0.06, 12);
            k.turned_along(
                Rubber,
                p(x, 0.12, -0.1 + 0.75 * s - 0.04),
                Vec3::Z,
                &[[0.12, 0.0], [0.12, 0.08]],
                22,
            );
        }
        k.bar(Yellow, &[p(-1.1, 0.2, -0.1 + 0.75 * s), p(1.1, 0.2, -0.1 + 0.75 * s)], 0.045, 12);
    }
    for x in [-0.9, 0.0, 0.9] {
        k.bar(Yellow, &[p(x, 0.2, -0.85), p(x, 0.2, 0.65)], 0.04, 12);
    }
    k
}

/// A pallet with a load.
pub(super) fn pallet(detail: Detail, which: u32) -> Things {
    let mut k: Things = Kit::new(detail);
    for z in [-0.38, 0.0, 0.38] {
        for x in [-0.5, 0.0, 0.5] {
            k.plain(Wood, [x - 0.07, 0.02, z - 0.05], [x + 0.07, 0.11, z + 0.05]);
        }
        k.plain(Wood, [-0.6, 0.0, z - 0.05], [0.6, 0.02, z + 0.05]);
    }
    for i in 0..7 {
        let x = -0.6 + 0.185 * i as f32;
        k.plain(Wood, [x, 0.11, -0.43], [x + 0.1, 0.132, 0.43]);
    }
    match which % 3 {
        0 => {
            for i in 0..3 {
                for j in 0..2 {
                    for h in 0..3 {
                        let r = unit(951, (i * 2 + j) * 4 + h);
                        if h == 2 && r < 0.45 {
                            continue;
                        }
                        let (x, z) = (-0.57 + 0.385 * i as f32, -0.41 + 0.42 * j as f32);
                        let y = 0.133 + 0.33 * h as f32;
                        k.plain(Card, [x, y, z], [x + 0.37, y + 0.325, z + 0.4]);
                    }
                }
            }
        }
        1 => {
            for (x, z) in [(-0.3, -0.1), (0.31, 0.08)] {
                k.at_all(&barrel(detail, [Orange, Chrome][usize::from(x > 0.0)]), p(x, 0.132, z));
            }
        }
        _ => {
            // A machine under way: a gear box with flanges.
            k.block(Olive, [-0.4, 0.132, -0.3], [0.4, 0.7, 0.3], 0.05);
            k.turned_along(
                Olive,
                p(-0.5, 0.5, 0.0),
                Vec3::X,
                &[
                    [0.18, 0.0],
                    [0.22, 0.02],
                    [0.22, 0.06],
                    [0.14, 0.1],
                    [0.14, 0.9],
                    [0.22, 0.94],
                    [0.22, 0.98],
                    [0.18, 1.0],
                ],
                28,
            );
            k.turned_along(Chrome, p(-0.6, 0.5, 0.0), Vec3::X, &[[0.06, 0.0], [0.06, 1.2]], 20);
            k.turned(
                Steel,
                p(0.1, 0.68, 0.0),
                &[[0.2, 0.0], [0.2, 0.05], [0.12, 0.1], [0.1, 0.28], [0.16, 0.3], [0.16, 0.34]],
                26,
            );
            for i in 0..8 {
                let d = Quat::from_rotation_x(TAU * i as f32 / 8.0) * p(0.0, 0.19, 0.0);
                k.bar(DarkSteel, &[p(-0.52, 0.5, 0.0) + d, p(-0.42, 0.5, 0.0) + d], 0.016, 6);
            }
        }
    }
    k
}

/// The fan's blades about the Z axis.
pub(super) fn blades(detail: Detail, radius: f32) -> Things {
    let mut k: Things = Kit::new(detail);
    k.turned_along(
        Chrome,
        p(0.0, 0.0, -0.12),
        Vec3::Z,
        &[[0.12, 0.0], [0.17, 0.03], [0.17, 0.2], [0.1, 0.28], [0.0, 0.3]],
        24,
    );
    for i in 0..7 {
        let turn = Quat::from_rotation_z(TAU * i as f32 / 7.0);
        let side = turn * p(0.82, 0.0, 0.57);
        k.plank(Steel, turn * p(0.0, 0.12, 0.0), turn * p(0.0, radius - 0.04, 0.0), side, [0.13, 0.008]);
    }
    k
}

/// The fan's cage and stand; its axle is `height` above the foot.
pub(super) fn fan_stand(detail: Detail, radius: f32, height: f32) -> Things {
    let mut k: Things = Kit::new(detail);
    let middle = p(0.0, height, 0.0);
    let rim = [detail.facets(56, 16), detail.facets(8, 4)];
    for z in [-0.22, 0.22] {
        for part in [1.0, 0.72, 0.44] {
            let thick = if part == 1.0 { 0.022 } else { 0.007 };
            k.at(
                if part == 1.0 { Yellow } else { Steel },
                &torus((radius + 0.06) * part, thick, rim),
                middle + Vec3::Z * z,
            );
        }
        for i in 0..18 {
            let d = Quat::from_rotation_z(TAU * i as f32 / 18.0) * Vec3::Y;
            k.bar(
                Steel,
                &[middle + d * 0.14 + Vec3::Z * z, middle + d * (radius + 0.06) + Vec3::Z * z],
                0.006,
                6,
            );
        }
        k.turned_along(DarkSteel, middle + Vec3::Z * (z - 0.02), Vec3::Z, &[[0.15, 0.0], [0.15, 0.04]], 22);
    }
    for i in 0..6 {
        let d = Quat::from_rotation_z(TAU * (i as f32 + 0.5) / 6.0) * Vec3::Y;
        let at = middle + d * (radius + 0.06);
        k.bar(Yellow, &[at - Vec3::Z * 0.22, at + Vec3::Z * 0.22], 0.018, 8);
    }
    k.block(DarkSteel, [-0.16, height - 0.16, -0.62], [0.16, height + 0.16, -0.2], 0.03);
    for s in [-1.0, 1.0] {
        k.bar(Yellow, &[p(0.75 * s, 0.03, -0.55), p(0.18 * s, height, -0.42)], 0.035, 10);
        k.bar(Yellow, &[p(0.75 * s, 0.03, -0.6), p(0.75 * s, 0.03, 0.45)], 0.035, 10);
    }
    k.bar(Yellow, &[p(-0.75, 0.03, -0.55), p(0.75, 0.03, -0.55)], 0.03, 10);
    k
}
