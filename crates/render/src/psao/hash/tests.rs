//! The paper's structure: nothing is lost but what overflows, and the kernel is the paper's.

use dapple_store::cells::AREA_OF_A_POINT;
use dapple_store::points::{PackedNormal, PointSet, morton_code};
use glam::Vec3;

use super::*;
use crate::gbuffer::RestSurface;

const SPACING: f32 = 0.125;
const QUANTUM: f32 = SPACING / 32.0;

/// A layout of one set (instance 2) with those integer positions, all facing up.
fn layout(mut positions: Vec<[u32; 3]>) -> PointLayout {
    positions.sort_by_key(|&p| morton_code(p));
    let normals = vec![PackedNormal::pack(Vec3::Y); positions.len()];
    let set = PointSet { instance: 2, first: 0, origin_rest: Vec3::new(0.5, 0.0, -1.0), positions, normals };
    PointLayout::new(QUANTUM, SPACING, vec![set]).unwrap()
}

/// One point a spacing, on a floor of 20 × 20 spacings.
fn floor() -> PointLayout {
    layout((0..400).map(|i| [i % 20 * 32 + i * 7 % 5, 0, i / 20 * 32 + i * 3 % 5]).collect())
}

fn at(layout: &PointLayout, x: f32, y: f32, z: f32) -> RestSurface {
    let origin = layout.sets()[0].origin_rest;
    RestSurface { instance: 2, position_rest: origin + Vec3::new(x, y, z) * SPACING, normal_rest: Vec3::Y }
}

#[test]
fn points_that_find_no_place_are_counted_and_the_others_are_kept() {
    let mut positions: Vec<[u32; 3]> = (0..400).map(|i| [i % 20 * 32, 0, i / 20 * 32]).collect();
    // Two spacings a cell: the cell at the origin has four already.
    positions.extend((0..10).map(|i| [i + 1, 0, 3]));
    let layout = layout(positions);
    let paper = PointHash::new(&layout, &vec![9; layout.len()], Hat::default()).unwrap();
    assert_eq!(paper.overflow(), Overflow { cell: 7, bucket: 0 });
    assert_eq!(paper.places.iter().filter(|&&p| p == DISCARDED).count(), 7);
    assert_eq!(paper.overflow().points(), 7);
    let mut places: Vec<u32> = paper.places.iter().copied().filter(|&p| p != DISCARDED).collect();
    places.sort_unstable();
    places.dedup();
    assert_eq!(places.len(), layout.len() - 7, "no two points share a place");
}

#[test]
fn cells_that_find_their_bucket_full_are_counted() {
    // A line of points three cells apart: one instance, but more cells than its points make expected.
    let layout = layout((0..64).map(|i| [i * 192, i * 192, i * 192]).collect());
    let paper = PointHash::new(&layout, &[0; 64], Hat::default()).unwrap();
    let expected_cells = (64.0 / (4.0 / AREA_OF_A_POINT)).ceil() as usize;
    let room = (4 * expected_cells).div_ceil(BUCKET_CELLS) * BUCKET_CELLS;
    assert!(room < 64, "the test needs more cells than places");
    assert!(paper.overflow().bucket as usize >= 64 - room && paper.overflow().cell == 0);
    let kept = paper.places.iter().filter(|&&p| p != DISCARDED).count();
    assert_eq!(kept + paper.overflow().points() as usize, 64);
}

/// [Neff2023] eq. 2 to 4 over all points as they are packed, without cells: what the structure must find.
fn hat_over_packed_points(layout: &PointLayout, values: &[u8], fragment: &RestSurface) -> f32 {
    let hat = Hat::default();
    let set = &layout.sets()[0];
    let (r, edge) = (hat.radius * SPACING, 2.0 * hat.radius * SPACING);
    let (mut sum, mut weights) = (0.0f64, 0.0f64);
    for (i, &value) in values.iter().enumerate() {
        let position_cells = (set.position_rest(i, QUANTUM) - set.origin_rest) / edge;
        let cell = position_cells.floor();
        let normal = pack_normal(set.normal_rest(i));
        let point = PackedPoint::pack(position_cells, cell.to_array().map(|c| c as u32), normal, value);
        let position_rest = set.origin_rest + (cell + point.position_in_cell()) * edge;
        let to_point = position_rest - fragment.position_rest;
        let (distance, point_normal) = (to_point.length(), point.normal());
        let along = point_normal.dot(to_point) / distance;
        if distance < r
            && point_normal.dot(fragment.normal_rest) > hat.normal_threshold
            && along * along < hat.direction_threshold
        {
            let alpha = f64::from((r - distance) / r);
            sum += alpha * f64::from(value);
            weights += alpha;
        }
    }
    if weights > 0.0 { (sum / weights / 255.0) as f32 } else { 1.0 }
}

#[test]
fn it_is_the_hat_over_the_points_as_they_are_packed() {
    let layout = floor();
    let values: Vec<u8> =
        (0..layout.len()).map(|i| 100 + (layout.sets()[0].positions[i][0] / 8) as u8).collect();
    let paper = PointHash::new(&layout, &values, Hat::default()).unwrap();
    assert_eq!(paper.overflow(), Overflow::default());
    let mut covered = 0;
    for i in 0..300 {
        let (x, z) = (i as f32 * 0.06 + 0.5, (i * 7 % 300) as f32 * 0.06 + 0.5);
        let fragment = at(&layout, x, 0.02, z);
        let (found, expected) =
            (paper.visibility(&fragment), hat_over_packed_points(&layout, &values, &fragment));
        assert!((found - expected).abs() < 1e-5, "{found} instead of {expected} at {x}, {z}");
        covered += usize::from(expected < 1.0);
    }
    assert!(covered > 290, "{covered} fragments have points near");
}

#[test]
fn an_update_reaches_the_fragment_and_strays_do_no_harm() {
    let layout = floor();
    let mut paper = PointHash::new(&layout, &vec![10; layout.len()], Hat::default()).unwrap();
    let here = at(&layout, 4.4, 0.0, 6.3);
    assert!((paper.visibility(&here) - 10.0 / 255.0).abs() < 1e-6);
    let change = |point| Change { point, visibility: 200 };
    paper.apply(&(0..layout.len() as u32 + 5).map(change).collect::<Vec<_>>());
    assert!((paper.visibility(&here) - 200.0 / 255.0).abs() < 1e-6);
}

#[test]
fn other_instances_other_sides_and_far_places_are_open() {
    let layout = floor();
    let paper = PointHash::new(&layout, &vec![10; layout.len()], Hat::default()).unwrap();
    let here = at(&layout, 4.0, 0.0, 6.0);
    for instance in [0, 1, 3, u32::MAX] {
        assert_eq!(paper.visibility(&RestSurface { instance, ..here }), 1.0);
    }
    assert_eq!(paper.visibility(&RestSurface { normal_rest: -Vec3::Y, ..here }), 1.0);
    for far in [Vec3::splat(1e30), Vec3::splat(-1e30), Vec3::new(0.0, 50.0, 0.0)] {
        assert_eq!(paper.visibility(&RestSurface { position_rest: far, ..here }), 1.0);
    }
    let wrong = PointHash::new(&layout, &[1, 2], Hat::default());
    assert_eq!(wrong.unwrap_err(), TableError::WrongCount { values: 2, points: 400 });
}

#[test]
fn a_grid_of_too_many_cells_is_refused() {
    let far = (1 << 21) - 1;
    let mut layout = layout(vec![[0, 0, 0], [far, far, far]]);
    assert!(PointHash::new(&layout, &[0, 0], Hat { radius: 32.0, ..Hat::default() }).is_ok());
    layout = PointLayout::new(QUANTUM, SPACING / 16.0, layout.sets().to_vec()).unwrap();
    let error = PointHash::new(&layout, &[0, 0], Hat::default()).unwrap_err();
    assert!(matches!(error, TableError::GridTooLarge { instance: 2, .. }), "{error}");
}
