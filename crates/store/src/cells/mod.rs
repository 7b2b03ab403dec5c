//! The paper's own structure: points in cells of posed local space, found through a hash table ([Neff2023] sec. 3.2).
//!
//! Takes grids of instances; holds [`HashBucket`]s of eight entries and [`CellData`] of seven packed points, which both
//! ends keep alike. See `README.md`.

mod grid;
mod layout;
mod point;
mod table;

pub use grid::{GridTooLarge, VirtualGrid};
pub use layout::{AREA_OF_A_POINT, InstanceGrid, TableLayout, TableLayoutError, buckets_for};
pub use point::{PackedPoint, pack_normal, unpack_normal};
pub use table::{BucketEntry, CellChanges, CellData, CellTable, HashBucket, Overflow};

/// Points in a cell ([Neff2023] sec. 3.2).
pub const CELL_POINTS: usize = 7;
/// Entries in a bucket ([Neff2023] sec. 3.2).
pub const BUCKET_CELLS: usize = 8;
