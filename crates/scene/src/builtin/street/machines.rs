//! Wheels of fortune and the carriage, each about its own foot; what turns about its axle.

use std::f32::consts::TAU;

use glam::{Affine3A, Mat3, Quat, Vec3};

use super::palette::Stuff::{self, *};
use crate::builtin::Detail;
use crate::builtin::joinery::{Wheel, torus};
use crate::builtin::kit::Kit;

type Things = Kit<Stuff>;

fn p(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(x, y, z)
}

/// A wheel of fortune: what turns, about the Z axis.
pub(super) fn fortune(detail: Detail, radius: f32, spokes: u32) -> Things {
    let mut k: Things = Kit::new(detail);
    let wheel = Wheel { radius, rim: [0.1, 0.11], spokes: (spokes, 0.024), hub: [0.13, 0.22] };
    k.wheel(&wheel, [Wood, Brass, Iron]);
    let ring = torus(0.55 * radius, 0.018, [detail.facets(48, 12), detail.facets(8, 4)]);
    k.at(Brass, &ring, Vec3::ZERO);
    for i in 0..2 * spokes {
        let turn = Quat::from_rotation_z(TAU * (i as f32 + 0.25) / (2 * spokes) as f32);
        let d = turn * Vec3::Y;
        k.bar(Steel, &[d * (radius - 0.06), d * (radius - 0.06) + Vec3::Z * 0.11], 0.009, 6);
        if i % 2 == 0 {
            let plate = crate::builtin::profile::block(
                detail,
                p(-0.08 * radius, 0.6 * radius, -0.012),
                p(0.08 * radius, 0.86 * radius, 0.012),
                0.006,
            );
            let turn = Quat::from_rotation_z(TAU * (i as f32 + 1.0) / (2 * spokes) as f32);
            k.add([Red, White, Blue][(i / 2 % 3) as usize], &plate, &Affine3A::from_quat(turn));
        }
    }
    k
}

/// The stand of a wheel of fortune whose axle is `height` above the foot.
pub(super) fn stand(detail: Detail, height: f32) -> Things {
    let mut k: Things = Kit::new(detail);
    for z in [-0.2, 0.2] {
        for x in [-0.72, 0.72] {
            k.bar(Iron, &[p(x, 0.02, 1.5 * z), p(0.0, height, z)], 0.034, 10);
            k.turned(Iron, p(x, 0.0, 1.5 * z), &[[0.09, 0.0], [0.09, 0.02], [0.05, 0.04]], 16);
        }
        k.bar(Iron, &[p(-0.45, 0.44 * height, 1.31 * z), p(0.45, 0.44 * height, 1.31 * z)], 0.018, 8);
        k.turned_along(Brass, p(0.0, height, z - 0.04), Vec3::Z, &[[0.07, 0.0], [0.07, 0.08]], 18);
    }
    k.bar(Steel, &[p(0.0, height, -0.24), p(0.0, height, 0.24)], 0.028, 12);
    k
}

/// Radii of the carriage's wheels, front and rear, and where their axles are (x, z).
pub(super) const ROLL: [f32; 2] = [0.44, 0.56];
pub(super) const AXLES: ([f32; 2], f32) = ([1.05, -0.95], 0.72);

/// A wheel of the carriage.
pub(super) fn carriage_wheel(detail: Detail, radius: f32) -> Things {
    let mut k: Things = Kit::new(detail);
    let wheel = Wheel { radius, rim: [0.055, 0.065], spokes: (14, 0.014), hub: [0.075, 0.17] };
    k.wheel(&wheel, [Red, Iron, Brass]);
    k
}

/// The carriage without its wheels: an open body on springs, its front towards +X, wheels' foot at y = 0.
pub(super) fn carriage(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let ([front, rear], half) = AXLES;
    for (x, r) in [(front, ROLL[0]), (rear, ROLL[1])] {
        k.bar(Iron, &[p(x, r, -half - 0.1), p(x, r, half + 0.1)], 0.024, 10);
        for s in [-1.0_f32, 1.0] {
            // Leaf springs: two bows.
            let bow = |lift: f32| -> Vec<Vec3> {
                (0..=8)
                    .map(|i| {
                        let t = i as f32 / 4.0 - 1.0;
                        p(x + 0.34 * t, r + 0.1 + lift * (1.0 - t * t), s * 0.5)
                    })
                    .collect()
            };
            k.bar(Iron, &bow(0.1), 0.016, 6);
            k.bar(Iron, &bow(-0.1), 0.016, 6);
        }
    }
    k.bar(Iron, &[p(rear, 0.7, 0.0), p(-0.3, 0.62, 0.0), p(0.5, 0.62, 0.0), p(front, 0.66, 0.0)], 0.035, 10);
    // The tub: a sweep of its side's outline across.
    let axes = Affine3A::IDENTITY;
    let tub = [[-0.35, 0.66], [0.42, 0.66], [0.62, 0.78], [0.72, 1.12], [-0.66, 1.12], [-0.58, 0.78]];
    k.prism(Black, &tub, [-0.55, 0.55], &axes);
    for s in [-1.0_f32, 1.0] {
        k.bar(Brass, &[p(-0.68, 1.13, 0.56 * s), p(0.74, 1.13, 0.56 * s)], 0.016, 8);
        k.block(Red, [-0.2, 0.72, s * 0.552 - 0.008], [0.25, 1.06, s * 0.552 + 0.008], 0.004);
        // Mudguards.
        for (x, r) in [(front, ROLL[0]), (rear, ROLL[1])] {
            let arc: Vec<Vec3> = (0..=10)
                .map(|i| {
                    let (sin, cos) = libm::sincosf(std::f32::consts::PI * (0.12 + 0.076 * i as f32));
                    p(x + (r + 0.07) * cos, r + (r + 0.07) * sin, 0.0)
                })
                .collect();
            for pair in arc.windows(2) {
                let along = (pair[1] - pair[0]).normalize();
                let z = Vec3::Z * (s * half);
                k.plank(
                    Black,
                    pair[0] - along * 0.01 + z,
                    pair[1] + along * 0.01 + z,
                    Vec3::Z,
                    [0.075, 0.006],
                );
            }
            k.bar(Iron, &[arc[5] + Vec3::Z * (s * half), p(x, r + 0.3, 0.5 * s)], 0.01, 6);
        }
        // Lamps, off.
        k.turned(Brass, p(0.86, 1.12, 0.5 * s), &[[0.0, 0.0], [0.05, 0.02], [0.06, 0.05], [0.05, 0.06]], 14);
        k.turned(Glass, p(0.86, 1.175, 0.5 * s), &[[0.05, 0.0], [0.055, 0.12]], 14);
        k.turned(Brass, p(0.86, 1.29, 0.5 * s), &[[0.07, 0.0], [0.06, 0.03], [0.02, 0.08], [0.0, 0.09]], 14);
        k.bar(Iron, &[p(0.86, 1.13, 0.5 * s), p(0.66, 1.06, 0.5 * s)], 0.011, 6);
    }
    // Seats and their backs.
    k.block(Red, [-0.62, 1.1, -0.5], [-0.12, 1.26, 0.5], 0.05);
    k.block(Red, [-0.76, 1.16, -0.5], [-0.6, 1.72, 0.5], 0.06);
    k.block(Black, [0.5, 1.1, -0.46], [1.22, 1.16, 0.46], 0.02);
    k.block(Red, [0.55, 1.15, -0.44], [0.98, 1.3, 0.44], 0.05);
    k.plank(Black, p(1.18, 1.13, 0.0), p(1.42, 1.5, 0.0), Vec3::Z, [0.46, 0.012]);
    // A folded hood behind.
    let axes = Mat3::from_cols(Vec3::X, Vec3::Y, Vec3::Z);
    for (i, lean) in [0.5_f32, 0.72, 0.94, 1.16].into_iter().enumerate() {
        let (s, c) = libm::sincosf(lean);
        let end = p(-0.68 - 0.75 * s, 1.3 + 0.75 * c, 0.0);
        let at = p(-0.68, 1.3, 0.0);
        let wide = 0.57 + 0.004 * i as f32;
        k.add(
            Black,
            &crate::builtin::joinery::plank(at, end, Vec3::Z, [wide, 0.02]),
            &Affine3A::from_mat3(axes),
        );
    }
    // Shafts.
    for s in [-1.0_f32, 1.0] {
        k.bar(
            Wood,
            &[p(front - 0.1, 0.6, 0.3 * s), p(1.5, 0.72, 0.32 * s), p(2.5, 0.95, 0.26 * s)],
            0.022,
            10,
        );
    }
    k.bar(Wood, &[p(1.5, 0.72, -0.36), p(1.5, 0.72, 0.36)], 0.02, 8);
    k
}
