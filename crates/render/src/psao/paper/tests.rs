//! The look-up finds what a search of all points finds, and nothing else.

use std::sync::Arc;

use dapple_store::cells::{
    BucketEntry, CellTable, InstanceGrid, PackedPoint, TableLayout, VirtualGrid, buckets_for, pack_normal,
};
use dapple_store::charts::MovingLeastSquares;
use glam::Vec3;

use super::*;
use crate::psao::Hat;

const SPACING: f32 = 0.125;
const EDGE: f32 = 2.0 * SPACING;
const INSTANCE: u32 = 2;

/// A number in 0 … 1 for each index and dimension.
fn random(i: usize, dimension: usize) -> f32 {
    let mut h = (i as u32).wrapping_mul(0x9e37_79b1) ^ (dimension as u32).wrapping_mul(0x85eb_ca77);
    h ^= h >> 15;
    h = h.wrapping_mul(0x2c1b_3c6d);
    h ^= h >> 12;
    (h.wrapping_mul(0x297a_2d39) >> 8) as f32 / (1 << 24) as f32
}

/// Points as the table holds them: place, normal, value.
struct Cloud {
    table: CellTable,
    points: Vec<(Vec3, Vec3, u8)>,
}

/// Points all over a box of 2 × 0.5 × 2 m, one cell at a time: at most seven each.
fn cloud() -> Cloud {
    let origin = Vec3::new(-1.0, 0.5, -1.0);
    let mut grid = VirtualGrid::spanning(origin, Vec3::new(2.0, 0.5, 2.0) / EDGE).unwrap();
    grid.count = buckets_for(400, 2.0);
    let layout = TableLayout::new(SPACING, EDGE, vec![InstanceGrid { instance: INSTANCE, grid }]).unwrap();
    let grid = *layout.grid_of(INSTANCE).unwrap();
    let mut cloud = Cloud { table: CellTable::new(Arc::new(layout)), points: Vec::new() };
    let mut cells: Vec<([u32; 3], usize)> = Vec::new();
    for i in 0..700 {
        let inside = Vec3::new(random(i, 0), random(i, 1), random(i, 2)) * Vec3::new(2.0, 0.5, 2.0);
        let normal = Vec3::new(random(i, 3) - 0.5, 1.0, random(i, 4) - 0.5).normalize();
        let visibility = (random(i, 5) * 255.0) as u8;
        let position_cells = grid.position_cells(origin + inside, EDGE);
        let cell = grid.cell(position_cells);
        let index = match cells.iter().position(|(c, _)| *c == cell) {
            Some(index) => index,
            None => {
                let bucket = cloud.table.bucket_mut(grid.bucket(cell));
                let Some(free) = bucket.0.iter_mut().find(|entry| entry.cell == 0) else { continue };
                *free = BucketEntry { key: grid.key(cell), cell: cells.len() as u32 + 1 };
                cells.push((cell, 0));
                cells.len() - 1
            }
        };
        let slot = &mut cells[index].1;
        if *slot < 7 {
            let point = PackedPoint::pack(position_cells, cell, pack_normal(normal), visibility);
            cloud.table.cell_mut(index as u32).0[*slot] = point;
            *slot += 1;
            let corner = Vec3::from_array(cell.map(|c| c as f32));
            let position = origin + (corner + point.position_in_cell()) * EDGE;
            cloud.points.push((position, point.normal(), visibility));
        }
    }
    cloud
}

fn fragments() -> Vec<LocalSurface> {
    let at = |i: usize| LocalSurface {
        instance: INSTANCE,
        position_local: Vec3::new(-1.0, 0.5, -1.0)
            + Vec3::new(random(i, 6), random(i, 7), random(i, 8)) * Vec3::new(2.0, 0.5, 2.0),
        normal_local: Vec3::new(random(i, 9) - 0.5, 0.7, random(i, 10) - 0.5).normalize(),
    };
    (0..400).map(at).collect()
}

/// [Neff2023] eq. 2 to 4, written out over all points.
fn hat_of_all(cloud: &Cloud, fragment: &LocalSurface) -> f32 {
    let (mut sum, mut weights) = (0.0f64, 0.0f64);
    for &(position, normal, visibility) in &cloud.points {
        let to_point = position - fragment.position_local;
        let alpha = ((SPACING - to_point.length()) / SPACING).max(0.0);
        let along = normal.dot(to_point.normalize_or_zero());
        if normal.dot(fragment.normal_local) > 0.1 && along * along < 0.7 {
            sum += f64::from(alpha) * f64::from(visibility);
            weights += f64::from(alpha);
        }
    }
    if weights > 0.0 { (sum / weights / 255.0) as f32 } else { 1.0 }
}

#[test]
fn the_look_up_is_equations_2_to_4_over_all_points() {
    let cloud = cloud();
    let fragments = fragments();
    let found = reconstruct(
        &cloud.table,
        &Kernel::Hat(Hat::default()),
        &fragments.iter().copied().map(Some).collect::<Vec<_>>(),
    );
    let mut covered = 0;
    for (fragment, found) in fragments.iter().zip(found) {
        let expected = hat_of_all(&cloud, fragment);
        // Places come out of the cells by other sums, so a point at the very edge of a threshold may differ.
        assert!((found - expected).abs() < 1e-3, "{found} instead of {expected} at {fragment:?}");
        covered += usize::from(expected < 1.0);
    }
    assert!(covered > 250, "{covered} fragments have points near");
}

/// The fit over all points.
fn fit_of_all(cloud: &Cloud, fragment: &LocalSurface) -> Option<f32> {
    use dapple_store::charts::{Fit, Weighed};
    let kernel = MovingLeastSquares::default();
    let r = kernel.radius * SPACING;
    let (tangent, bitangent) = fragment.normal_local.any_orthonormal_pair();
    let weighed: Vec<(Weighed, f32)> = cloud
        .points
        .iter()
        .filter_map(|&(position, normal, visibility)| {
            let d = (position - fragment.position_local) / r;
            let weight = kernel.weight(d, fragment.normal_local, normal);
            let tangent = [d.dot(tangent), d.dot(bitangent)];
            (weight > 0.0).then_some((Weighed { weight, tangent }, f32::from(visibility)))
        })
        .collect();
    let fit = Fit::new(weighed.iter().map(|w| w.0))?;
    let values = || weighed.iter().map(|w| w.1);
    let value: f32 = weighed.iter().map(|&(p, value)| fit.coefficient(p) * value).sum();
    Some(value.clamp(values().fold(f32::MAX, f32::min), values().fold(0.0, f32::max)) / 255.0)
}

#[test]
fn least_squares_sees_every_point_that_it_gives_weight() {
    let cloud = cloud();
    let fragments = fragments();
    let kernel = Kernel::MovingLeastSquares(MovingLeastSquares::default());
    let found = reconstruct(&cloud.table, &kernel, &fragments.iter().copied().map(Some).collect::<Vec<_>>());
    let mut fitted = 0;
    for (fragment, found) in fragments.iter().zip(found) {
        if let Some(expected) = fit_of_all(&cloud, fragment) {
            assert!((found - expected).abs() < 5e-3, "{found} instead of {expected} at {fragment:?}");
            fitted += 1;
        }
    }
    assert!(fitted > 350, "{fitted} fragments have a fit");
}

#[test]
fn where_nothing_has_weight_the_hat_is_open_and_least_squares_takes_the_nearest() {
    let cloud = cloud();
    let above = LocalSurface {
        instance: INSTANCE,
        position_local: Vec3::new(0.1, 1.0 + 2.5 * SPACING, 0.2),
        normal_local: Vec3::Y,
    };
    let look =
        |kernel: &Kernel, fragment: LocalSurface| reconstruct(&cloud.table, kernel, &[Some(fragment), None]);
    let (hat, mls) = (Kernel::Hat(Hat::default()), Kernel::default());
    assert_eq!(look(&hat, above), [1.0, 1.0]);
    let nearest = cloud
        .points
        .iter()
        .min_by(|a, b| a.0.distance(above.position_local).total_cmp(&b.0.distance(above.position_local)))
        .unwrap();
    assert_eq!(look(&mls, above), [f32::from(nearest.2) / 255.0, 1.0]);
    let elsewhere = LocalSurface { instance: INSTANCE + 1, ..above };
    let far = LocalSurface { position_local: Vec3::splat(1e30), ..above };
    for kernel in [hat, mls] {
        assert_eq!(look(&kernel, elsewhere), [1.0, 1.0]);
        assert_eq!(look(&kernel, far), [1.0, 1.0]);
    }
}
