//! Moving least squares over the points of the paper's cells: the literal format with the kernel of `psao-mls`.

use dapple_store::cells::CellTable;
use dapple_store::charts::{MovingLeastSquares, Weighed};
use glam::Vec3;

use super::InGrid;
use crate::gbuffer::LocalSurface;
use crate::psao::mls::fitted;

/// A point of a cell, unpacked.
#[derive(Clone, Copy, Debug)]
struct NearPoint {
    position_local: Vec3,
    normal_local: Vec3,
    visibility: f32,
}

/// Candidates of the last fragment, kept for the next.
#[derive(Debug, Default)]
pub(super) struct Near {
    /// Instance, cell and reach that they are of.
    key: Option<(u32, [i32; 3], u32)>,
    points: Vec<NearPoint>,
    weighed: Vec<(Weighed, f32)>,
}

/// Farthest that a fragment without weights looks for a point, in spacings; as `psao-mls`.
const FARTHEST_SPACINGS: [f32; 4] = [1.0, 2.0, 4.0, 8.0];

impl Near {
    /// Collects all points in the cells that come within `radius_m` of the fragment, and some beyond.
    fn collect(&mut self, table: &CellTable, place: &InGrid<'_>, fragment: &LocalSurface, radius_m: f32) {
        let reach = (radius_m / place.edge_m).ceil().clamp(1.0, 16.0) as u32;
        let cell = place.position.floor().to_array().map(|c| c as i32);
        let key = Some((fragment.instance, cell, reach));
        // Neighbouring fragments mostly share a cell.
        if self.key == key {
            return;
        }
        self.key = key;
        self.points.clear();
        for cell in place.grid.cells_around(place.position, reach) {
            let corner = Vec3::from_array(cell.map(|c| c as f32));
            let points = table.points_of(place.grid, cell).iter();
            self.points.extend(points.map(|point| NearPoint {
                position_local: place.grid.origin + (corner + point.position_in_cell()) * place.edge_m,
                normal_local: point.normal(),
                visibility: f32::from(point.visibility()),
            }));
        }
    }

    /// Value of the nearest point on the fragment's side, or of all if none is there; `None` if there are none near.
    fn nearest(&mut self, table: &CellTable, place: &InGrid<'_>, fragment: &LocalSurface) -> Option<f32> {
        let farthest = FARTHEST_SPACINGS[FARTHEST_SPACINGS.len() - 1];
        for reach in FARTHEST_SPACINGS {
            self.collect(table, place, fragment, reach * table.layout().spacing_m());
            let ranked = self.points.iter().map(|p| {
                let opposed = p.normal_local.dot(fragment.normal_local) <= 0.0;
                (opposed, p.position_local.distance_squared(fragment.position_local), p.visibility)
            });
            let best =
                ranked.min_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.total_cmp(&b.2)));
            if let Some((opposed, _, visibility)) = best
                && (!opposed || reach == farthest)
            {
                return Some(visibility);
            }
        }
        None
    }
}

pub(super) fn visibility(
    table: &CellTable,
    kernel: &MovingLeastSquares,
    fragment: &LocalSurface,
    near: &mut Near,
) -> f32 {
    let Some(place) = InGrid::new(table, fragment) else { return 1.0 };
    let r = kernel.radius * table.layout().spacing_m();
    near.collect(table, &place, fragment, r);
    let n = fragment.normal_local;
    let (tangent, bitangent) = n.any_orthonormal_pair();
    near.weighed.clear();
    for p in &near.points {
        let d = (p.position_local - fragment.position_local) / r;
        let weight = kernel.weight(d, n, p.normal_local);
        if weight > 0.0 {
            near.weighed
                .push((Weighed { weight, tangent: [d.dot(tangent), d.dot(bitangent)] }, p.visibility));
        }
    }
    let value =
        fitted(&near.weighed).unwrap_or_else(|| near.nearest(table, &place, fragment).unwrap_or(255.0));
    (value / 255.0).clamp(0.0, 1.0)
}
