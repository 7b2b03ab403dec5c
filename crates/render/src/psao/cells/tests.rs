//! The static lists give what moving least squares gives.

use dapple_store::points::{PackedNormal, PointSet, morton_code};
use glam::Vec3;

use super::*;
use crate::gbuffer::RestSurface;
use crate::psao::{Kernel, PointIndex, reconstruct};

/// A number for `i`, without any pattern between neighbours.
fn scatter(i: u32) -> u32 {
    let mut h = i.wrapping_mul(0x9e37_79b1);
    h ^= h >> 15;
    h = h.wrapping_mul(0x85eb_ca77);
    h ^= h >> 13;
    h.wrapping_mul(0xc2b2_ae3d) >> 8
}

/// A corner of three walls of one instance, and a lone floor of another; values from 0 to 255.
fn corner() -> (PointLayout, Vec<u8>) {
    let (spacing, quantum) = (0.1, 0.1 / 32.0);
    let wall = |axis: usize, count: u32| {
        (0..count).map(move |i| {
            let mut p = [scatter(3 * i) % 640, scatter(3 * i + 1) % 640, scatter(3 * i + 2) % 640];
            p[axis] = 0;
            (p, PackedNormal::pack([Vec3::X, Vec3::Y, Vec3::Z][axis]))
        })
    };
    let set = |instance, points: Vec<([u32; 3], PackedNormal)>| {
        let mut points = points;
        points.sort_by_key(|&(p, n)| (morton_code(p), n));
        points.dedup();
        let (positions, normals) = points.into_iter().unzip();
        PointSet { instance, first: 0, origin_rest: Vec3::splat(instance as f32), positions, normals }
    };
    let all = (0..3).flat_map(|axis| wall(axis, 500)).collect();
    let sets = vec![set(1, all), set(5, wall(1, 600).collect())];
    let layout = PointLayout::new(quantum, spacing, sets).unwrap();
    let values = (0..layout.len() as u32).map(|i| scatter(i) as u8).collect();
    (layout, values)
}

fn fragments() -> Vec<Option<RestSurface>> {
    (0..3000u32)
        .map(|i| {
            let r = |k: u32| scatter(100_000 + 4 * i + k) as f32 / 16_777_216.0;
            let axis = i as usize % 3;
            let mut offset = Vec3::new(r(0), r(1), r(2)) * 2.0;
            offset[axis] = r(3) * 0.03;
            let normal_rest = [Vec3::X, Vec3::Y, Vec3::Z][axis];
            let instance = if i % 4 == 0 { 5 } else { 1 };
            Some(RestSurface { instance, position_rest: Vec3::splat(instance as f32) + offset, normal_rest })
        })
        .collect()
}

#[test]
fn they_agree_with_moving_least_squares() {
    let (layout, values) = corner();
    let mls = MovingLeastSquares::default();
    let direct = PointCells::new(&layout, &values, mls).unwrap().reconstruct(&fragments());
    let index = PointIndex::new(&layout);
    let reference = reconstruct(&index, &values, &Kernel::MovingLeastSquares(mls), &fragments());
    let mut compared = 0;
    for ((fragment, a), b) in fragments().iter().flatten().zip(&direct).zip(&reference) {
        // Where nothing has weight the nearest point serves, which the lists look for less far.
        if has_weight(&layout, &mls, fragment) {
            // The order of summation differs.
            assert!((a - b).abs() < 1e-4, "{a} instead of {b}");
            compared += 1;
        }
    }
    // The lone floor has no walls, and a corner here and there no point.
    assert!(compared > 2200, "{compared} of 3000");
}

/// Whether any point counts at a fragment, by looking at all of them.
fn has_weight(layout: &PointLayout, mls: &MovingLeastSquares, fragment: &RestSurface) -> bool {
    let set = layout.set_of_instance(fragment.instance).unwrap();
    (0..set.len()).any(|i| {
        let d = (set.position_rest(i, layout.quantum_m()) - fragment.position_rest)
            / (mls.radius * layout.spacing_m());
        mls.weight(d, fragment.normal_rest, set.normal_rest(i)) > 1e-6
    })
}

#[test]
fn the_nearest_point_in_reach_serves_where_nothing_has_weight() {
    let (layout, _) = corner();
    let set = layout.set_of_instance(5).unwrap();
    let values: Vec<u8> = (0..layout.len()).map(|i| if i as u32 >= set.first { 51 } else { 255 }).collect();
    let direct = PointCells::new(&layout, &values, MovingLeastSquares::default()).unwrap();
    let place = |height: f32| RestSurface {
        instance: 5,
        position_rest: set.origin_rest + Vec3::new(1.0, height, 1.0),
        normal_rest: -Vec3::Y,
    };
    assert!((direct.visibility(&place(0.02)) - 0.2).abs() < 1e-6);
    assert_eq!(direct.visibility(&place(5.0)), 1.0);
    assert_eq!(direct.visibility(&RestSurface { instance: 3, ..place(0.0) }), 1.0);
}

#[test]
fn updates_are_those_of_a_new_table() {
    let (layout, values) = corner();
    let changed: Vec<u8> = values.iter().map(|v| v.wrapping_mul(7)).collect();
    let mut direct = PointCells::new(&layout, &values, MovingLeastSquares::default()).unwrap();
    let change = |(i, &visibility): (usize, &u8)| Change { point: i as u32, visibility };
    direct.apply(&changed.iter().enumerate().map(change).collect::<Vec<_>>());
    direct.apply(&[Change { point: u32::MAX, visibility: 0 }]);
    let fresh = PointCells::new(&layout, &changed, MovingLeastSquares::default()).unwrap();
    assert_eq!(direct.reconstruct(&fragments()), fresh.reconstruct(&fragments()));
}
