//! The windmill about its foot, its door along +Z, and its sails about their axle, which points along +Z.

use std::f32::consts::TAU;

use glam::{Affine3A, Quat, Vec3};

use super::palette::Stuff::{self, *};
use super::plan::MILL;
use crate::builtin::Detail;
use crate::builtin::kit::Kit;

type Things = Kit<Stuff>;

fn p(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(x, y, z)
}

/// How far the sails turn before the tower's middle.
pub(super) const AHEAD: f32 = 2.15;

/// Tower, cap and gallery.
pub(super) fn tower(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let (_, _, axle, _) = MILL;
    // Eight-sided at every detail: a loft of two skins would be round.
    let mut side = |of: Stuff, profile: &[[f32; 2]]| {
        let profile: Vec<glam::Vec2> = profile.iter().map(|&[r, y]| glam::Vec2::new(r, y)).collect();
        let mut piece = crate::builtin::shapes::lathe(&profile, 8);
        // Flat faces: every triangle its own normal.
        let mut flat = crate::builtin::shapes::Geometry::new();
        for t in &piece.triangles {
            flat.polygon(&t.map(|v| piece.positions[v as usize]));
        }
        std::mem::swap(&mut piece, &mut flat);
        k.add(of, &piece, &Affine3A::from_quat(Quat::from_rotation_y(TAU / 16.0)));
    };
    side(Stone, &[[3.0, -1.6], [2.75, 2.3]]);
    side(Stone, &[[2.85, 2.25], [2.85, 2.4]]);
    side(Boards, &[[2.55, 2.38], [1.75, axle - 0.55]]);
    side(Oak, &[[1.95, axle - 0.65], [1.95, axle - 0.45]]);
    k.turned(
        Shingle,
        p(0.0, axle - 0.46, 0.0),
        &[[1.85, 0.0], [1.85, 0.35], [1.6, 1.0], [1.05, 1.55], [0.4, 1.85], [0.0, 1.92]],
        24,
    );
    // Battens up the corners.
    for i in 0..8 {
        let d = Quat::from_rotation_y(TAU * (i as f32 + 0.5) / 8.0) * Vec3::X;
        k.plank(
            Timber,
            d * 2.57 + Vec3::Y * 2.39,
            d * 1.77 + Vec3::Y * (axle - 0.6),
            d.cross(Vec3::Y),
            [0.1, 0.05],
        );
        k.plank(Timber, d * 2.7 + Vec3::Y * 2.4, d * 3.55 + Vec3::Y * 3.05, Vec3::Y, [0.06, 0.06]);
    }
    // The gallery: planks around on brackets, with a rail.
    for i in 0..24 {
        let turn = Quat::from_rotation_y(TAU * i as f32 / 24.0);
        let half = 3.62 * libm::tanf(TAU / 48.0);
        k.add(
            Boards,
            &crate::builtin::profile::block(detail, p(2.2, 3.05, -half), p(3.62, 3.11, half), 0.01),
            &Affine3A::from_quat(turn),
        );
        if i % 2 == 0 {
            let d = turn * Vec3::X;
            k.bar(Oak, &[d * 3.52 + Vec3::Y * 3.08, d * 3.52 + Vec3::Y * 4.05], 0.035, 8);
        }
    }
    for y in [3.55, 4.0] {
        let rail = crate::builtin::joinery::torus(3.52, 0.03, [detail.facets(48, 24), detail.facets(8, 4)]);
        k.add(
            Oak,
            &rail,
            &Affine3A::from_rotation_translation(Quat::from_rotation_x(TAU / 4.0), Vec3::Y * y),
        );
    }
    k.bar(Oak, &[p(0.0, axle, -0.8), p(0.0, axle, AHEAD + 0.25)], 0.17, 16);
    k.turned_along(
        Iron,
        p(0.0, axle, AHEAD - 0.35),
        Vec3::Z,
        &[[0.2, 0.0], [0.22, 0.03], [0.22, 0.1], [0.2, 0.13]],
        18,
    );
    // Door and windows.
    for (y, size) in [(0.0, [0.6, 2.0]), (5.2, [0.35, 0.6])] {
        let z = if y < 1.0 { 2.46 } else { 1.8 };
        k.block(Timber, [-size[0] - 0.1, y, z - 0.2], [size[0] + 0.1, y + size[1] + 0.1, z + 0.13], 0.02);
        k.plain(if y < 1.0 { Oak } else { Pane }, [-size[0], y + 0.02, z], [size[0], y + size[1], z + 0.16]);
    }
    k.block(Stone, [-1.0, -1.4, 2.4], [1.0, 0.0, 3.6], 0.04);
    k
}

/// Four sails of lattice and cloth about the origin.
pub(super) fn sails(detail: Detail) -> Things {
    let mut k: Things = Kit::new(detail);
    let reach = MILL.3;
    k.turned_along(
        Iron,
        Vec3::Z * -0.2,
        Vec3::Z,
        &[[0.26, 0.0], [0.3, 0.06], [0.3, 0.32], [0.2, 0.42], [0.0, 0.46]],
        20,
    );
    for i in 0..4 {
        let turn = Affine3A::from_quat(Quat::from_rotation_z(TAU * i as f32 / 4.0));
        let mut sail: Things = Kit::new(detail);
        sail.plank(Oak, p(0.0, 0.1, 0.0), p(0.0, reach, 0.0), Vec3::X, [0.075, 0.06]);
        for x in [0.5, 1.0] {
            sail.plank(Oak, p(x, 1.25, 0.03), p(x, reach - 0.05, 0.03), Vec3::X, [0.028, 0.02]);
        }
        let count = 13;
        for j in 0..count {
            let y = 1.3 + (reach - 1.4) * j as f32 / (count - 1) as f32;
            sail.plank(Oak, p(-0.28, y, 0.03), p(1.06, y, 0.03), Vec3::Y, [0.026, 0.018]);
        }
        // The cloth is rolled up half way.
        sail.plain(Sack, [0.04, 2.9, -0.012], [1.04, reach - 0.12, 0.014]);
        sail.bar(Sack, &[p(0.02, 2.88, 0.0), p(1.06, 2.88, 0.0)], 0.07, 10);
        k.all(&sail, &turn);
    }
    k
}
