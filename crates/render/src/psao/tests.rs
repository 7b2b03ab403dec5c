//! What reconstruction must do on surfaces whose visibility is known.

use dapple_store::points::{PackedNormal, PointLayout, PointSet, morton_code};
use glam::Vec3;
use proptest::prelude::*;

use super::*;
use crate::gbuffer::RestSurface;

/// Points about every `spacing` on the square (0 … 1)² of y = `height`, with values from `value(position)`.
fn plane(spacing: f32, height: f32, value: impl Fn(Vec3) -> f32) -> (PointLayout, Vec<u8>) {
    let quantum = spacing / 32.0;
    let steps = (1.0 / spacing) as u32;
    let mut points: Vec<(u64, [u32; 3])> = Vec::new();
    for i in 0..=steps {
        for j in 0..=steps {
            // Off the lattice by a fixed pattern, so that nothing is symmetric by accident.
            let jitter = |k: u32| (k.wrapping_mul(2_654_435_761) >> 24) % 11;
            let p = [i * 32 + jitter(i * 77 + j), 0, j * 32 + jitter(j * 131 + i)];
            points.push((morton_code(p), p));
        }
    }
    points.sort_unstable();
    let positions: Vec<[u32; 3]> = points.into_iter().map(|p| p.1).collect();
    let normals = vec![PackedNormal::pack(Vec3::Y); positions.len()];
    let origin_rest = Vec3::new(0.0, height, 0.0);
    let set = PointSet { instance: 3, first: 0, origin_rest, positions, normals };
    let layout = PointLayout::new(quantum, spacing, vec![set]).unwrap();
    let set = &layout.sets()[0];
    let values =
        (0..set.len()).map(|i| (value(set.position_rest(i, quantum)) * 255.0).round() as u8).collect();
    (layout, values)
}

fn at(x: f32, y: f32, z: f32) -> Option<RestSurface> {
    Some(RestSurface { instance: 3, position_rest: Vec3::new(x, y, z), normal_rest: Vec3::Y })
}

fn kernels() -> [Kernel; 2] {
    [Kernel::Hat(Hat::default()), Kernel::default()]
}

#[test]
fn a_constant_is_kept() {
    let (layout, values) = plane(0.05, 0.0, |_| 0.4);
    let index = PointIndex::new(&layout);
    for kernel in kernels() {
        let out = reconstruct(
            &index,
            &values,
            &kernel,
            &[at(0.5, 0.0, 0.5), at(0.0, 0.0, 0.0), at(0.313, 0.0, 0.77)],
        );
        for v in out {
            assert!((v - 0.4).abs() < 1e-6, "{kernel:?} gave {v}");
        }
    }
}

#[test]
fn least_squares_reproduces_a_gradient_even_at_the_border() {
    let slope = |p: Vec3| 0.1 + 0.5 * p.x + 0.2 * p.z;
    let (layout, values) = plane(0.05, 0.0, slope);
    let index = PointIndex::new(&layout);
    let places = [[0.5, 0.5], [0.02, 0.5], [0.98, 0.97], [0.41, 0.26]];
    let fragments: Vec<_> = places.iter().map(|&[x, z]| at(x, 0.0, z)).collect();
    let out = reconstruct(&index, &values, &Kernel::default(), &fragments);
    for (v, f) in out.iter().zip(&fragments) {
        let truth = slope(f.unwrap().position_rest);
        assert!((v - truth).abs() < 0.006, "{v} instead of {truth}");
    }
    // The hat is biased at the border: this is what the better kernel is for.
    let hat = reconstruct(&index, &values, &kernels()[0], &[at(0.0, 0.0, 0.5)])[0];
    assert!(hat - slope(Vec3::new(0.0, 0.0, 0.5)) > 0.002, "{hat}");
}

#[test]
fn other_instances_and_other_sides_are_not_read() {
    let (layout, values) = plane(0.05, 0.0, |_| 0.2);
    let index = PointIndex::new(&layout);
    let other = RestSurface { instance: 2, ..at(0.5, 0.0, 0.5).unwrap() };
    let beyond = RestSurface { instance: 9, ..other };
    for kernel in kernels() {
        assert_eq!(reconstruct(&index, &values, &kernel, &[None, Some(other), Some(beyond)]), [1.0; 3]);
    }
    let below = RestSurface { normal_rest: -Vec3::Y, ..at(0.5, 0.0, 0.5).unwrap() };
    assert_eq!(reconstruct(&index, &values, &kernels()[0], &[Some(below)]), [1.0]);
}

#[test]
fn the_nearest_point_serves_where_nothing_has_weight() {
    let (layout, values) = plane(0.05, 0.0, |p| if p.x < 0.5 { 0.2 } else { 0.8 });
    let index = PointIndex::new(&layout);
    // 0.2 m off the plane: outside every kernel, within the search.
    let out = reconstruct(&index, &values, &Kernel::default(), &[at(0.2, 0.2, 0.5), at(0.9, 0.2, 0.5)]);
    assert!((out[0] - 0.2).abs() < 1e-6 && (out[1] - 0.8).abs() < 1e-6, "{out:?}");
    assert_eq!(reconstruct(&index, &values, &kernels()[0], &[at(0.2, 0.2, 0.5)]), [1.0]);
}

#[test]
fn an_empty_layout_is_open() {
    let layout = PointLayout::new(0.01, 0.1, Vec::new()).unwrap();
    let index = PointIndex::new(&layout);
    for kernel in kernels() {
        assert_eq!(reconstruct(&index, &[], &kernel, &[at(0.0, 0.0, 0.0)]), [1.0]);
    }
}

proptest! {
    #[test]
    fn the_result_stays_within_the_values(
        seed: u32,
        x in -0.3f32..1.3, y in -0.3f32..0.3, z in -0.3f32..1.3,
        nx in -1f32..1.0, nz in -1f32..1.0,
    ) {
        let (layout, _) = plane(0.1, 0.0, |_| 0.0);
        let values: Vec<u8> = (0..layout.len() as u32).map(|i| 40 + ((i ^ seed).wrapping_mul(2_654_435_761) >> 25) as u8).collect();
        let index = PointIndex::new(&layout);
        let normal_rest = Vec3::new(nx, 0.5, nz).normalize();
        let f = RestSurface { instance: 3, position_rest: Vec3::new(x, y, z), normal_rest };
        let v = reconstruct(&index, &values, &Kernel::default(), &[Some(f)])[0] * 255.0;
        prop_assert!((39.99..=167.01).contains(&v), "{}", v);
    }
}
