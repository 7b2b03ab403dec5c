//! The look-up of `hash.wgsl` in Rust, step by step.

use dapple_store::cells::{PackedPoint, VirtualGrid};
use glam::Vec3;
use rayon::prelude::*;

use super::{BUCKET_CELLS, CELL_POINTS, PointHash};
use crate::gbuffer::RestSurface;

impl PointHash {
    /// Visibility 0 … 1 of a fragment ([Neff2023] eq. 4): 1 where no point has weight.
    pub fn visibility(&self, fragment: &RestSurface) -> f32 {
        let Some(grid) = self.grids.get(fragment.instance as usize).filter(|g| g.count > 0) else {
            return 1.0;
        };
        let position = grid.position_cells(fragment.position_rest, self.edge_m);
        let mut sums = [0.0f32; 2];
        for cell in grid.nearest_cells(position) {
            let Some(index) = self.find(grid, cell) else { continue };
            let corner_m = Vec3::from_array(cell.map(|c| c as f32)) - position;
            for slot in 0..CELL_POINTS {
                let word = self.tables.points.get(2 * index + slot / 4)[slot % 4];
                // Places are taken in order, so the first free one ends the cell.
                if word == 0 {
                    break;
                }
                self.add(word, corner_m, fragment.normal_rest, &mut sums);
            }
        }
        // [Neff2023] eq. 4
        if sums[1] > 0.0 { sums[0] / sums[1] / 255.0 } else { 1.0 }
    }

    /// [`PointHash::visibility`] of each (1 for `None`), in parallel in the caller's rayon pool.
    pub fn reconstruct(&self, fragments: &[Option<RestSurface>]) -> Vec<f32> {
        fragments.par_iter().map(|f| f.as_ref().map_or(1.0, |f| self.visibility(f))).collect()
    }

    /// A cell's index in the table of cells.
    fn find(&self, grid: &VirtualGrid, cell: [u32; 3]) -> Option<usize> {
        let bucket = grid.bucket(cell) as usize;
        let key = grid.key(cell);
        for at in 0..BUCKET_CELLS {
            let entry = self.tables.slots.get(2 * bucket + at / 4)[at % 4] as usize;
            if entry == 0 {
                return None;
            }
            if self.tables.points.get(2 * (entry - 1) + 1)[3] == key {
                return Some(entry - 1);
            }
        }
        None
    }

    /// Adds one point; `corner` is the vector from the fragment to its cell's corner, in cells.
    fn add(&self, word: u32, corner: Vec3, normal_rest: Vec3, sums: &mut [f32; 2]) {
        let point = PackedPoint(word);
        let to_point = (corner + point.position_in_cell()) * self.edge_m;
        let alpha = self.hat.weight(to_point, point.normal(), normal_rest, self.radius_m);
        sums[0] += alpha * f32::from(point.visibility());
        sums[1] += alpha;
    }
}
