//! Moving least squares a fragment, over static lists of points in cells.
//!
//! Takes a layout, its values and a [`MovingLeastSquares`]; returns tables for [`PointCells::visibility`] and for
//! `cells.wgsl`, which agree. See `README.md`.

mod fit;
#[cfg(test)]
mod tests;
mod twin;

use dapple_store::cells::VirtualGrid;
use dapple_store::points::{Change, PointLayout};

use super::MovingLeastSquares;
use super::tables::{TableError, Tables, Texels, check_count, empty_grids, grid_around, grid_texels};

/// The function `cells_visibility` and its bindings (group 3, bindings 3 to 5), to be joined with a shader.
pub const WGSL: &str = include_str!("cells.wgsl");

/// Points sorted by cell, found through a table with open addressing.
///
/// A slot is (cell's number, its first point, number of points, 0), free if the last but one is 0. A point is its
/// position at rest, and 16 bits of normal with 8 of visibility.
#[derive(Clone, Debug)]
pub struct PointCells {
    mls: MovingLeastSquares,
    radius_m: f32,
    edge_m: f32,
    grids: Vec<VirtualGrid>,
    tables: Tables,
    /// For each point its texel.
    places: Vec<u32>,
}

/// Slots a cell that exists.
const SLOTS_A_CELL: usize = 2;

impl PointCells {
    /// Sorts a layout's points into cells with an edge of twice the kernel's radius, so that the 2×2×2 nearest hold all
    /// that has weight. `visibility` are the store's values in the layout's order.
    pub fn new(
        layout: &PointLayout,
        visibility: &[u8],
        mls: MovingLeastSquares,
    ) -> Result<PointCells, TableError> {
        check_count(layout, visibility)?;
        let radius_m = mls.radius * layout.spacing_m();
        let edge_m = 2.0 * radius_m;
        let mut grids = empty_grids(layout);
        let (mut slots, mut points) = (Vec::new(), Vec::with_capacity(layout.len()));
        let mut places = vec![0; layout.len()];
        for set in layout.sets() {
            let mut grid = grid_around(set, layout, edge_m)?;
            let position = |i: usize| set.position_rest(i, layout.quantum_m());
            let key = |i: usize| grid.key(grid.cell(grid.position_cells(position(i), edge_m)));
            let mut keyed: Vec<(u32, u32)> = (0..set.len()).map(|i| (key(i), i as u32)).collect();
            keyed.sort_unstable();
            let runs: Vec<&[(u32, u32)]> = keyed.chunk_by(|a, b| a.0 == b.0).collect();
            let count = (SLOTS_A_CELL * runs.len()).next_power_of_two();
            (grid.first, grid.count) = (slots.len() as u32, count as u32);
            slots.resize(slots.len() + count, [0; 4]);
            let own = &mut slots[grid.first as usize..];
            for run in runs {
                let key = run[0].0;
                let mut slot = hash(key) as usize & (count - 1);
                while own[slot][2] != 0 {
                    slot = (slot + 1) & (count - 1);
                }
                own[slot] = [key, points.len() as u32, run.len() as u32, 0];
                for &(_, i) in run {
                    let point = set.first as usize + i as usize;
                    places[point] = points.len() as u32;
                    let [x, y, z] = position(i as usize).to_array().map(f32::to_bits);
                    let [u, v] = set.normals[i as usize].0.map(u32::from);
                    points.push([x, y, z, u << 16 | v << 8 | u32::from(visibility[point])]);
                }
            }
            grids[set.instance as usize] = grid;
        }
        let params = [edge_m, radius_m, mls.plane, mls.normal_power.max(1).ilog2() as f32];
        let tables = Tables {
            grids: Texels::new(grid_texels(params, &grids)),
            slots: Texels::new(slots),
            points: Texels::new(points),
        };
        Ok(PointCells { mls, radius_m, edge_m, grids, tables, places })
    }

    /// Takes new values; those of points that do not exist are ignored.
    pub fn apply(&mut self, changes: &[Change]) {
        for change in changes {
            if let Some(&place) = self.places.get(change.point as usize) {
                let word = &mut self.tables.points.get_mut(place as usize)[3];
                *word = *word & !0xff | u32::from(change.visibility);
            }
        }
    }

    /// Bytes that a shader reads from, and bytes that only updates need.
    pub fn bytes(&self) -> (u64, u64) {
        (self.tables.bytes(), size_of_val(self.places.as_slice()) as u64)
    }
}

#[cfg(feature = "gpu")]
impl PointCells {
    /// Textures of the right size; [`PointCells::upload`] fills them.
    pub fn make_textures(
        &self,
        device: &dapple_gpu::wgpu::Device,
    ) -> Result<super::TableTextures, TableError> {
        super::TableTextures::new(device, &self.tables)
    }

    /// Writes what changed since the last call.
    pub fn upload(&mut self, queue: &dapple_gpu::wgpu::Queue, textures: &super::TableTextures) {
        textures.upload(queue, &mut self.tables);
    }
}

/// Spreads the numbers of cells over slots.
fn hash(key: u32) -> u32 {
    let mut h = key.wrapping_mul(0x9e37_79b1);
    h ^= h >> 15;
    h = h.wrapping_mul(0x2c1b_3c6d);
    h ^ h >> 13
}
