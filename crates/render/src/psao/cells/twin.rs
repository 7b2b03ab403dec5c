//! The look-up of `cells.wgsl` in Rust, step by step.

use dapple_store::cells::VirtualGrid;
use dapple_store::points::PackedNormal;
use glam::Vec3;
use rayon::prelude::*;

use super::fit::Fit;
use super::{PointCells, hash};
use crate::gbuffer::RestSurface;

/// The point that serves where nothing has weight.
struct Nearest {
    /// On the fragment's other side.
    opposed: bool,
    distance_squared: f32,
    visibility: f32,
}

impl PointCells {
    /// Visibility 0 … 1 of a fragment: the fit of [`crate::psao::MovingLeastSquares`], or the nearest point of the
    /// cells that the kernel reaches, or 1.
    pub fn visibility(&self, fragment: &RestSurface) -> f32 {
        let Some(grid) = self.grids.get(fragment.instance as usize).filter(|g| g.count > 0) else {
            return 1.0;
        };
        let position = grid.position_cells(fragment.position_rest, self.edge_m);
        let (tangent, bitangent) = fragment.normal_rest.any_orthonormal_pair();
        let mut fit = Fit::new();
        let mut nearest = Nearest { opposed: true, distance_squared: f32::MAX, visibility: 255.0 };
        for cell in grid.nearest_cells(position) {
            if !reaches(position, cell) {
                continue;
            }
            for at in self.points_in(grid, cell) {
                let [x, y, z, word] = self.tables.points.get(at as usize);
                let position_rest = Vec3::from_array([x, y, z].map(f32::from_bits));
                let point_normal = PackedNormal([(word >> 16) as u8, (word >> 8) as u8]).unpack();
                let visibility = (word & 0xff) as f32;
                let d = (position_rest - fragment.position_rest) / self.radius_m;
                let weight = self.mls.weight(d, fragment.normal_rest, point_normal);
                if weight > 0.0 {
                    fit.add(weight, d.dot(tangent), d.dot(bitangent), visibility);
                }
                let opposed = point_normal.dot(fragment.normal_rest) <= 0.0;
                let distance_squared = d.length_squared();
                let closer = distance_squared < nearest.distance_squared;
                if !opposed && nearest.opposed || opposed == nearest.opposed && closer {
                    nearest = Nearest { opposed, distance_squared, visibility };
                }
            }
        }
        (fit.value_at_origin().unwrap_or(nearest.visibility) / 255.0).clamp(0.0, 1.0)
    }

    /// [`PointCells::visibility`] of each (1 for `None`), in parallel in the caller's rayon pool.
    pub fn reconstruct(&self, fragments: &[Option<RestSurface>]) -> Vec<f32> {
        fragments.par_iter().map(|f| f.as_ref().map_or(1.0, |f| self.visibility(f))).collect()
    }

    fn points_in(&self, grid: &VirtualGrid, cell: [u32; 3]) -> std::ops::Range<u32> {
        let key = grid.key(cell);
        let mut slot = hash(key) & (grid.count - 1);
        loop {
            let [found, first, count, _] = self.tables.slots.get((grid.first + slot) as usize);
            if count == 0 {
                return 0..0;
            }
            if found == key {
                return first..first + count;
            }
            slot = (slot + 1) & (grid.count - 1);
        }
    }
}

/// Whether a cell comes within the radius (half an edge) of a position in cells.
fn reaches(position: Vec3, cell: [u32; 3]) -> bool {
    let corner = Vec3::from_array(cell.map(|c| c as f32));
    let outside = (corner - position).max(position - corner - 1.0).max(Vec3::ZERO);
    outside.length_squared() < 0.25
}
