//! The paper's client: looks visibility up in a [`CellTable`] of posed local space ([Neff2023] sec. 3.5).
//!
//! Takes the table and fragments in the local space of the server's last update; returns one visibility a fragment, by the
//! paper's kernel or by moving least squares over the same points. See `README.md`.

mod fit;
mod hat;
#[cfg(test)]
mod tests;

use dapple_store::cells::{CellTable, PackedPoint, VirtualGrid};
use glam::Vec3;
use rayon::prelude::*;

use super::Kernel;
use crate::gbuffer::LocalSurface;

/// Visibility 0 … 1 of each fragment (1 for `None`), in parallel in the caller's rayon pool.
///
/// [`Kernel::Hat`] is the paper's look-up, complete as long as its radius is at most half of a cell's edge;
/// [`Kernel::MovingLeastSquares`] looks at as many cells as its radius reaches.
pub fn reconstruct(table: &CellTable, kernel: &Kernel, fragments: &[Option<LocalSurface>]) -> Vec<f32> {
    fragments
        .par_chunks(1024)
        .flat_map_iter(|chunk| {
            let mut near = fit::Near::default();
            chunk.iter().map(move |fragment| match (fragment, kernel) {
                (None, _) => 1.0,
                (Some(f), Kernel::Hat(kernel)) => hat::visibility(table, kernel, f),
                (Some(f), Kernel::MovingLeastSquares(kernel)) => fit::visibility(table, kernel, f, &mut near),
            })
        })
        .collect()
}

/// A fragment in its instance's grid.
struct InGrid<'a> {
    grid: &'a VirtualGrid,
    edge_m: f32,
    /// In cells from the grid's corner.
    position: Vec3,
}

impl<'a> InGrid<'a> {
    /// `None` where the instance has no points.
    fn new(table: &'a CellTable, fragment: &LocalSurface) -> Option<InGrid<'a>> {
        let layout = table.layout();
        let (grid, edge_m) = (layout.grid_of(fragment.instance)?, layout.edge_m());
        Some(InGrid { grid, edge_m, position: grid.position_cells(fragment.position_local, edge_m) })
    }

    /// The vector from the fragment to a point of a cell, metres.
    fn to_point(&self, cell: [u32; 3], point: PackedPoint) -> Vec3 {
        let corner = Vec3::from_array(cell.map(|c| c as f32)) - self.position;
        (corner + point.position_in_cell()) * self.edge_m
    }
}
