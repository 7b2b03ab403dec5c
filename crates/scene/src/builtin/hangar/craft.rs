//! The craft in the middle of the hangar, its nose towards +X, its wheels on the floor.

use glam::{Affine3A, Mat3, Vec2, Vec3};

use super::palette::Stuff::{self, *};
use crate::builtin::Detail;
use crate::builtin::joinery::prism;
use crate::builtin::kit::Kit;
use crate::builtin::shapes::{Geometry, Girth, between, loft, oval};

type Things = Kit<Stuff>;

fn p(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(x, y, z)
}

/// A skin over ovals along X: middle (x, y, z), half height, half width.
fn hull(detail: Detail, ovals: &[[f32; 5]], power: f32) -> Geometry {
    let girths: Vec<Girth> = ovals
        .iter()
        .map(|&[x, y, z, high, wide]| Girth { center: p(x, y, z), half: Vec2::new(high, wide) })
        .collect();
    let rings: Vec<Vec<Vec3>> = between(&girths, detail.facets(60, 14))
        .into_iter()
        .map(|girth| oval(girth, [Vec3::Y, Vec3::Z], power, detail.facets(44, 12)))
        .collect();
    loft(&rings)
}

/// A flat wing with a plan in (x, z), between two heights.
fn wing(k: &mut Things, of: Stuff, plan: &[[f32; 2]], [low, high]: [f32; 2]) {
    // The outline's y is −Z, so that it is swept upwards; its order decides nothing.
    let mut outline: Vec<Vec2> = plan.iter().map(|&[x, z]| Vec2::new(x, -z)).collect();
    let area: f32 = (0..outline.len()).map(|i| outline[i].perp_dot(outline[(i + 1) % outline.len()])).sum();
    if area < 0.0 {
        outline.reverse();
    }
    let axes = Affine3A::from_mat3(Mat3::from_cols(Vec3::X, Vec3::NEG_Z, Vec3::Y));
    k.add(of, &prism(&outline, [low, high]), &axes);
}

/// The craft.
pub(super) fn craft(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let body = [
        [-7.2, 2.35, 0.0, 0.35, 0.6],
        [-6.2, 2.3, 0.0, 0.75, 1.05],
        [-4.0, 2.2, 0.0, 1.0, 1.35],
        [-1.0, 2.15, 0.0, 1.1, 1.4],
        [2.0, 2.15, 0.0, 1.1, 1.3],
        [4.2, 2.1, 0.0, 0.95, 1.05],
        [6.0, 1.95, 0.0, 0.6, 0.68],
        [7.3, 1.8, 0.0, 0.22, 0.26],
        [7.6, 1.77, 0.0, 0.05, 0.06],
    ];
    k.at(Hull, &hull(detail, &body, 2.6), Vec3::ZERO);
    let canopy = [
        [1.3, 2.95, 0.0, 0.1, 0.25],
        [2.2, 3.1, 0.0, 0.42, 0.62],
        [3.4, 3.0, 0.0, 0.48, 0.68],
        [4.5, 2.7, 0.0, 0.4, 0.56],
        [5.4, 2.4, 0.0, 0.12, 0.25],
    ];
    k.at(Canopy, &hull(detail, &canopy, 2.0), Vec3::ZERO);
    for x in [2.3, 3.5] {
        // Bows over the canopy, a little outside of it.
        let arc: Vec<Vec3> = (0..=14)
            .map(|i| {
                let (s, c) = libm::sincosf(std::f32::consts::PI * i as f32 / 14.0);
                let (mid, high, wide) = if x < 3.0 { (3.1, 0.44, 0.645) } else { (2.98, 0.49, 0.69) };
                p(x, mid + high * s, wide * c)
            })
            .collect();
        k.bar(HullDark, &arc, 0.035, 8);
    }
    for s in [-1.0_f32, 1.0] {
        wing(
            &mut k,
            Hull,
            &[[2.6, 1.0 * s], [-1.6, 5.0 * s], [-3.9, 5.0 * s], [-5.0, 1.0 * s]],
            [1.72, 1.94],
        );
        wing(
            &mut k,
            Orange,
            &[[-2.2, 4.98 * s], [-2.4, 5.1 * s], [-3.9, 5.1 * s], [-4.2, 4.98 * s]],
            [1.45, 2.75],
        );
        wing(
            &mut k,
            HullDark,
            &[[2.85, 0.9 * s], [2.55, 1.25 * s], [-1.55, 5.1 * s], [-1.75, 4.9 * s]],
            [1.76, 1.9],
        );
        // Flaps with a gap, proud of the trailing edge.
        wing(
            &mut k,
            HullDark,
            &[[-4.85, 1.4 * s], [-5.25, 1.4 * s], [-4.7, 3.0 * s], [-4.35, 3.0 * s]],
            [1.76, 1.9],
        );
        wing(
            &mut k,
            HullDark,
            &[[-4.32, 3.1 * s], [-4.65, 3.1 * s], [-4.2, 4.7 * s], [-3.9, 4.7 * s]],
            [1.76, 1.9],
        );
        // Fins.
        let fin = [[-6.9, 2.6], [-4.6, 2.6], [-6.2, 4.5], [-7.3, 4.5]];
        let lean =
            Affine3A::from_rotation_translation(glam::Quat::from_rotation_x(0.3 * s), p(0.0, 0.1, s * 1.55));
        k.prism(Hull, &fin, [-0.07, 0.07], &lean);
        k.prism(Orange, &[[-7.32, 4.1], [-6.0, 4.1], [-6.3, 4.62], [-7.4, 4.62]], [-0.085, 0.085], &lean);
        // Engines.
        let at = s * 1.6;
        let nacelle = [
            [-7.3, 2.2, at, 0.42, 0.42],
            [-6.6, 2.2, at, 0.56, 0.56],
            [-4.6, 2.2, at, 0.66, 0.66],
            [-2.6, 2.2, at, 0.62, 0.62],
            [-1.7, 2.2, at, 0.5, 0.5],
        ];
        k.at(Hull, &hull(detail, &nacelle, 2.0), Vec3::ZERO);
        let nozzle = [[0.0, 0.0], [0.5, 0.0], [0.5, 0.1], [0.44, 0.62], [0.38, 0.62], [0.3, 0.1], [0.0, 0.1]];
        k.turned_along(DarkSteel, p(-7.25, 2.2, at), Vec3::NEG_X, &nozzle, 40);
        k.turned_along(
            Copper,
            p(-7.3, 2.2, at),
            Vec3::NEG_X,
            &[[0.0, 0.0], [0.16, 0.2], [0.05, 0.45], [0.0, 0.46]],
            24,
        );
        let lip = [[0.42, -0.12], [0.5, -0.1], [0.56, 0.02], [0.52, 0.1], [0.44, 0.06]];
        k.turned_along(Chrome, p(-1.7, 2.2, at), Vec3::X, &lip, 40);
        k.turned_along(DarkSteel, p(-1.62, 2.2, at), Vec3::X, &[[0.42, -0.1], [0.42, 0.015]], 32);
        k.turned_along(Chrome, p(-1.62, 2.2, at), Vec3::X, &[[0.14, 0.0], [0.1, 0.12], [0.0, 0.2]], 24);
        // Main gear.
        k.bar(Chrome, &[p(-2.6, 1.75, 1.9 * s), p(-2.5, 0.45, 2.1 * s)], 0.075, 14);
        k.bar(Steel, &[p(-1.7, 1.75, 1.9 * s), p(-2.5, 0.7, 2.06 * s)], 0.045, 12);
        for z in [1.88, 2.32] {
            tyre(&mut k, p(-2.5, 0.42, z * s), 0.42);
        }
        k.bar(Steel, &[p(-2.5, 0.42, 1.8 * s), p(-2.5, 0.42, 2.4 * s)], 0.06, 12);
        // A door of the gear's bay.
        k.plank(Hull, p(-3.2, 1.74, 1.55 * s), p(-3.2, 1.0, 1.5 * s), Vec3::X, [0.05, 0.02]);
        // Pipes and small boxes on the hull's back.
        k.bar(HullDark, &[p(-3.8, 3.12, 0.3 * s), p(-0.6, 3.22, 0.32 * s)], 0.07, 12);
    }
    // The nose gear, a probe, a ladder.
    k.bar(Chrome, &[p(4.4, 1.3, 0.0), p(4.5, 0.35, 0.0)], 0.06, 14);
    k.bar(Steel, &[p(3.7, 1.25, 0.0), p(4.48, 0.6, 0.0)], 0.04, 12);
    for z in [-0.17, 0.17] {
        tyre(&mut k, p(4.5, 0.32, z), 0.32);
    }
    k.bar(Steel, &[p(4.5, 0.32, -0.2), p(4.5, 0.32, 0.2)], 0.05, 12);
    k.bar(Steel, &[p(7.5, 1.77, 0.0), p(8.5, 1.76, 0.0)], 0.02, 10);
    for z in [1.0, 1.45] {
        k.bar(Yellow, &[p(3.2, 0.0, z + 0.42), p(3.2, 3.2, z - 0.42 + 0.3)], 0.025, 10);
    }
    let rungs = 9;
    for i in 0..rungs {
        let y = 0.3 + 0.32 * i as f32;
        let lean = 0.42 - 0.54 * y / 3.2;
        k.bar(Yellow, &[p(3.2, y, 1.0 + lean), p(3.2, y, 1.45 + lean)], 0.018, 8);
    }
    k
}

/// A wheel about an axle along Z.
fn tyre(k: &mut Things, at: Vec3, radius: f32) {
    let profile = [
        [0.0, -0.06],
        [0.55 * radius, -0.06],
        [0.6 * radius, -0.11],
        [0.9 * radius, -0.11],
        [radius, -0.06],
        [radius, 0.06],
        [0.9 * radius, 0.11],
        [0.6 * radius, 0.11],
        [0.55 * radius, 0.06],
        [0.0, 0.06],
    ];
    k.turned_along(Rubber, at, Vec3::Z, &profile, 36);
    for s in [-1.0, 1.0] {
        k.turned_along(
            Steel,
            at + Vec3::Z * (0.05 * s),
            Vec3::Z * s,
            &[[0.52 * radius, 0.0], [0.52 * radius, 0.02], [0.2 * radius, 0.045]],
            26,
        );
    }
}
