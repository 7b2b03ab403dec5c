//! Weights are whole, sum to 256, keep constants and planes, and are the same wherever they are made.

use proptest::prelude::*;

use super::*;
use crate::points::{PackedNormal, morton_code};

/// Points about every `spacing` on the square (0 … 1)² of y = 0, off the lattice by a fixed pattern.
fn plane(spacing: f32) -> PointLayout {
    let steps = (1.0 / spacing) as u32;
    let mut positions = Vec::new();
    for i in 0..=steps {
        for j in 0..=steps {
            let jitter = |k: u32| (k.wrapping_mul(2_654_435_761) >> 24) % 11;
            positions.push([i * 32 + jitter(i * 77 + j), 0, j * 32 + jitter(j * 131 + i)]);
        }
    }
    layout(spacing, positions.into_iter().map(|p| (p, PackedNormal::pack(Vec3::Y))).collect())
}

fn layout(spacing: f32, mut points: Vec<([u32; 3], PackedNormal)>) -> PointLayout {
    points.sort_unstable_by_key(|&(p, n)| (morton_code(p), n));
    let (positions, normals) = points.into_iter().unzip();
    let set = PointSet { instance: 3, first: 0, origin_rest: Vec3::ZERO, positions, normals };
    PointLayout::new(spacing / 32.0, spacing, vec![set]).unwrap()
}

fn weigh(layout: &PointLayout, site: &Site, cut: u16) -> TexelWeights {
    let set = &layout.sets()[0];
    PointNeighbours::new(layout, set, &WeightParams::default()).weigher(set).weigh(site, cut)
}

fn site(x: f32, y: f32, z: f32) -> Site {
    Site { texel: 0, position_rest: Vec3::new(x, y, z), normal_rest: Vec3::Y }
}

fn sum(weights: &TexelWeights) -> u16 {
    weights.iter().map(|(_, w)| w).sum()
}

#[test]
fn planes_are_kept_away_from_borders() {
    let layout = plane(0.05);
    let set = &layout.sets()[0];
    let slope = |p: Vec3| 0.1 + 0.5 * p.x + 0.2 * p.z;
    for i in 0..200 {
        let x = 0.1 + 0.8 * (i as f32 * 0.618).fract();
        let z = 0.1 + 0.8 * (i as f32 * 0.414).fract();
        let weights = weigh(&layout, &site(x, 0.0, z), 0);
        let value: f32 = weights
            .iter()
            .map(|(p, w)| f32::from(w) / 256.0 * slope(set.position_rest(p as usize, layout.quantum_m())))
            .sum();
        let truth = slope(Vec3::new(x, 0.0, z));
        // Weights of 1/256 place the value to within a hundredth of the kernel's width.
        assert!((value - truth).abs() < 0.001, "{value} instead of {truth} at {x}, {z}");
    }
}

#[test]
fn the_nearest_point_on_the_side_serves_where_nothing_has_weight() {
    let up = PackedNormal::pack(Vec3::Y);
    let down = PackedNormal::pack(-Vec3::Y);
    let layout = layout(0.05, vec![([64, 0, 64], up), ([80, 60, 64], down), ([640, 0, 64], up)]);
    let near = weigh(&layout, &site(0.15, 0.2, 0.1), 0);
    assert_eq!(near.iter().collect::<Vec<_>>(), [(0, 256)], "the nearer one faces away");
    // Seen from below the only one on that side is the second.
    let below = Site { normal_rest: -Vec3::Y, ..site(0.15, -0.1, 0.1) };
    let facing = weigh(&layout, &below, 0);
    assert_eq!(facing.len(), 1);
    assert_eq!(layout.sets()[0].normals[facing.iter().next().unwrap().0 as usize], down);
    assert!(weigh(&layout, &site(0.1, 3.0, 0.1), 0).is_empty(), "nobody within 8 spacings");
}

#[test]
fn what_is_cut_does_not_count() {
    let layout = plane(0.05);
    let set = &layout.sets()[0];
    let at = site(0.5, 0.0, 0.5);
    let neighbours = PointNeighbours::new(&layout, set, &WeightParams::default());
    let mut weigher = neighbours.weigher(set);
    let candidates = weigher.candidates(&at).to_vec();
    assert!(candidates.len() > 8 && candidates.windows(2).all(|w| w[0].point < w[1].point));
    let mut cut = 0;
    for (i, c) in candidates.iter().enumerate() {
        if c.position_rest.x > 0.5 {
            cut |= 1 << i;
        }
    }
    let weights = weigher.weigh(&at, cut);
    assert_eq!(sum(&weights), WEIGHT_SUM);
    for (point, _) in weights.iter() {
        assert!(set.position_rest(point as usize, layout.quantum_m()).x <= 0.5);
    }
    // If all are cut, the nearest of the others serves.
    let weights = weigher.weigh(&at, u16::MAX);
    assert_eq!(weights.len(), 1);
    assert!(candidates.iter().all(|c| c.point != weights.iter().next().unwrap().0));
}

proptest! {
    #[test]
    fn weights_sum_to_256_and_do_not_depend_on_the_way_there(
        points in prop::collection::vec((prop::array::uniform3(0u32..200), 0u8..4), 1..120),
        places in prop::collection::vec((prop::array::uniform3(-2f32..8.0), 0u8..4), 1..20),
        cut: u16,
    ) {
        let normals = [Vec3::Y, -Vec3::Y, Vec3::X, Vec3::new(0.6, 0.8, 0.0)];
        let points = points.into_iter().map(|(p, n)| (p, PackedNormal::pack(normals[usize::from(n)]))).collect();
        let layout = layout(1.0, points);
        let set = &layout.sets()[0];
        let neighbours = PointNeighbours::new(&layout, set, &WeightParams::default());
        let mut weigher = neighbours.weigher(set);
        for (p, n) in places {
            let site = Site { texel: 0, position_rest: Vec3::from(p), normal_rest: normals[usize::from(n)] };
            let weights = weigher.weigh(&site, cut);
            prop_assert!(weights.is_empty() || sum(&weights) == WEIGHT_SUM);
            prop_assert!(weights.len() <= WeightParams::default().most);
            let listed: Vec<(u32, u16)> = weights.iter().collect();
            prop_assert!(listed.windows(2).all(|w| w[0].0 < w[1].0) && listed.iter().all(|e| e.1 > 0));
            // A worker that saw other places before gives the same.
            prop_assert_eq!(weights, neighbours.weigher(set).weigh(&site, cut));
        }
    }
}

#[test]
fn odd_sites_and_layouts_do_no_harm() {
    let mut layouts = vec![plane(0.2)];
    for (quantum, spacing) in [(1e-30, 1e30), (1e30, 1e-30), (1e-38, 1e-38), (1e38, 3e38)] {
        let set = PointSet {
            instance: 0,
            first: 0,
            origin_rest: Vec3::splat(-3e38),
            positions: vec![[0; 3], [1; 3], [(1 << 21) - 1; 3]],
            normals: vec![PackedNormal::pack(Vec3::Y); 3],
        };
        layouts.push(PointLayout::new(quantum, spacing, vec![set]).unwrap());
    }
    let places = [Vec3::ZERO, Vec3::NAN, Vec3::INFINITY, Vec3::splat(-3e38), Vec3::splat(3e38)];
    for layout in &layouts {
        for position_rest in places {
            for normal_rest in [Vec3::Y, Vec3::ZERO, Vec3::NAN] {
                let weights = weigh(layout, &Site { texel: 0, position_rest, normal_rest }, 0);
                assert!(weights.is_empty() || sum(&weights) == WEIGHT_SUM);
            }
        }
    }
}
