//! The paper's look-up, literally: a hash table of cells of at most seven points ([Neff2023] sec. 3.2, 3.5).
//!
//! Takes a layout, its values and a [`Hat`]; returns tables for [`PointHash::visibility`] and for `hash.wgsl`, which
//! agree. See `README.md`.

#[cfg(test)]
mod tests;
mod twin;

pub use dapple_store::cells::{BUCKET_CELLS, CELL_POINTS, Overflow};
use dapple_store::cells::{PackedPoint, VirtualGrid, buckets_for, pack_normal};
use dapple_store::points::{Change, PointLayout};

use super::Hat;
use super::tables::{TableError, Tables, Texels, check_count, empty_grids, grid_around, grid_texels};

/// The function `hash_visibility` and its bindings (group 3, bindings 0 to 2), to be joined with a shader.
pub const WGSL: &str = include_str!("hash.wgsl");

/// The tables of the paper's look-up, as a client holds them.
///
/// A bucket is two texels: eight entries, each the number of a cell + 1, or 0 at the end. A cell is two texels: seven
/// packed points and the cell's number in its grid.
#[derive(Clone, Debug)]
pub struct PointHash {
    hat: Hat,
    radius_m: f32,
    edge_m: f32,
    grids: Vec<VirtualGrid>,
    tables: Tables,
    /// For each point its word in the table of cells, or [`DISCARDED`].
    places: Vec<u32>,
    overflow: Overflow,
}

const DISCARDED: u32 = u32::MAX;

impl PointHash {
    /// Sorts a layout's points into cells; `visibility` are the store's values in its order.
    ///
    /// A cell's edge is twice the kernel's radius: the least for which the 2×2×2 nearest cells hold everything that
    /// [Neff2023] eq. 2 gives weight. Each instance gets 4 × (expected cells) / 8 buckets, at least one.
    pub fn new(layout: &PointLayout, visibility: &[u8], hat: Hat) -> Result<PointHash, TableError> {
        check_count(layout, visibility)?;
        let radius_m = hat.radius * layout.spacing_m();
        let edge_m = 2.0 * radius_m;
        let mut grids = empty_grids(layout);
        let mut builder = Builder { places: vec![DISCARDED; layout.len()], ..Builder::default() };
        for set in layout.sets() {
            let mut grid = grid_around(set, layout, edge_m)?;
            grid.first = builder.buckets.len() as u32;
            grid.count = buckets_for(set.len(), 2.0 * f64::from(hat.radius));
            builder.buckets.resize(builder.buckets.len() + grid.count as usize, [0; BUCKET_CELLS]);
            for i in 0..set.len() {
                let position = grid.position_cells(set.position_rest(i, layout.quantum_m()), edge_m);
                let cell = grid.cell(position);
                let point = set.first as usize + i;
                let normal = pack_normal(set.normal_rest(i));
                let packed = PackedPoint::pack(position, cell, normal, visibility[point]);
                builder.add(&grid, cell, point, packed.0);
            }
            grids[set.instance as usize] = grid;
        }
        let Builder { buckets, cells, places, overflow } = builder;
        let params = [edge_m, radius_m, hat.normal_threshold, hat.direction_threshold];
        let tables = Tables {
            grids: Texels::new(grid_texels(params, &grids)),
            slots: Texels::new(halves(&buckets)),
            points: Texels::new(halves(&cells)),
        };
        Ok(PointHash { hat, radius_m, edge_m, grids, tables, places, overflow })
    }

    /// Takes new values; those of discarded points and of points that do not exist are ignored.
    pub fn apply(&mut self, changes: &[Change]) {
        for change in changes {
            let place = self.places.get(change.point as usize).copied().unwrap_or(DISCARDED);
            if place != DISCARDED {
                let word = &mut self.tables.points.get_mut(place as usize / 4)[place as usize % 4];
                *word = PackedPoint(*word).with_visibility(change.visibility).0;
            }
        }
    }

    /// What found no place.
    pub fn overflow(&self) -> Overflow {
        self.overflow
    }

    /// Bytes that a shader reads from, and bytes that only updates need.
    pub fn bytes(&self) -> (u64, u64) {
        (self.tables.bytes(), size_of_val(self.places.as_slice()) as u64)
    }
}

#[cfg(feature = "gpu")]
impl PointHash {
    /// Textures of the right size; [`PointHash::upload`] fills them.
    pub fn make_textures(
        &self,
        device: &dapple_gpu::wgpu::Device,
    ) -> Result<super::TableTextures, TableError> {
        super::TableTextures::new(device, &self.tables)
    }

    /// How the forward pass looks up in these tables. Its group 3 binds the views of [`super::TableTextures`] as 0, 1, 2.
    pub fn lookup(device: &dapple_gpu::wgpu::Device) -> crate::forward::Lookup {
        let entries = super::TableTextures::layout_entries(0);
        let descriptor = dapple_gpu::wgpu::BindGroupLayoutDescriptor {
            label: Some("the paper's look-up"),
            entries: &entries,
        };
        crate::forward::Lookup {
            label: "the paper's look-up",
            wgsl: vec![WGSL, include_str!("lookup.wgsl")],
            needs_rest: true,
            layout: Some(device.create_bind_group_layout(&descriptor)),
        }
    }

    /// Writes what changed since the last call.
    pub fn upload(&mut self, queue: &dapple_gpu::wgpu::Queue, textures: &super::TableTextures) {
        textures.upload(queue, &mut self.tables);
    }
}

/// Two texels of each row of eight words.
fn halves(rows: &[[u32; 8]]) -> Vec<[u32; 4]> {
    rows.iter().flat_map(|&[a, b, c, d, e, f, g, h]| [[a, b, c, d], [e, f, g, h]]).collect()
}

#[derive(Default)]
struct Builder {
    buckets: Vec<[u32; BUCKET_CELLS]>,
    /// Seven points and the cell's number.
    cells: Vec<[u32; CELL_POINTS + 1]>,
    places: Vec<u32>,
    overflow: Overflow,
}

impl Builder {
    fn add(&mut self, grid: &VirtualGrid, cell: [u32; 3], point: usize, word: u32) {
        let key = grid.key(cell);
        let bucket = &mut self.buckets[grid.bucket(cell) as usize];
        let at =
            bucket.iter().position(|&entry| entry == 0 || self.cells[entry as usize - 1][CELL_POINTS] == key);
        let Some(at) = at else {
            self.overflow.bucket += 1;
            return;
        };
        if bucket[at] == 0 {
            let mut fresh = [0; CELL_POINTS + 1];
            fresh[CELL_POINTS] = key;
            self.cells.push(fresh);
            bucket[at] = self.cells.len() as u32;
        }
        let index = bucket[at] as usize - 1;
        match self.cells[index][..CELL_POINTS].iter().position(|&w| w == 0) {
            Some(slot) => {
                self.cells[index][slot] = word;
                self.places[point] = (index * (CELL_POINTS + 1) + slot) as u32;
            }
            None => self.overflow.cell += 1,
        }
    }
}
