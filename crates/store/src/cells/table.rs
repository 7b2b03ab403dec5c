//! Buckets and cells as either end holds them, and the look-up of a cell.

use std::sync::Arc;

use super::{BUCKET_CELLS, CELL_POINTS, PackedPoint, TableLayout, VirtualGrid};

/// A cell that exists: its number in its grid, and where its points are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BucketEntry {
    /// [`VirtualGrid::key`] of the cell.
    pub key: u32,
    /// Index of its [`CellData`] + 1; 0 in a free entry.
    pub cell: u32,
}

impl BucketEntry {
    /// An entry without a cell.
    pub const FREE: BucketEntry = BucketEntry { key: 0, cell: 0 };
}

/// Entries of cells that share a value of [Neff2023] eq. 1; free ones are at the end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct HashBucket(pub [BucketEntry; BUCKET_CELLS]);

impl HashBucket {
    /// Whether it has no cells.
    pub fn is_empty(&self) -> bool {
        self.0.iter().all(|entry| *entry == BucketEntry::FREE)
    }
}

/// The points of one cell; free places are at the end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CellData(pub [PackedPoint; CELL_POINTS]);

/// Points that found no place. The paper discards them and so does this; nothing else fails.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Overflow {
    /// Points whose cell held seven already.
    pub cell: u32,
    /// Points whose cell found its bucket full.
    pub bucket: u32,
}

impl Overflow {
    /// All discarded points.
    pub fn points(&self) -> u32 {
        self.cell + self.bucket
    }
}

/// What changed in a table: indices, ascending.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CellChanges {
    /// Buckets.
    pub buckets: Vec<u32>,
    /// Cells, which then exist.
    pub cells: Vec<u32>,
}

impl CellChanges {
    /// Whether nothing changed.
    pub fn is_empty(&self) -> bool {
        self.buckets.is_empty() && self.cells.is_empty()
    }
}

/// The hash table of all instances.
#[derive(Clone, Debug)]
pub struct CellTable {
    layout: Arc<TableLayout>,
    buckets: Vec<HashBucket>,
    /// What no bucket refers to has no meaning.
    cells: Vec<CellData>,
}

impl CellTable {
    /// An empty table: 64 bytes a bucket, and 28 a cell once there are some.
    pub fn new(layout: Arc<TableLayout>) -> CellTable {
        let buckets = vec![HashBucket::default(); layout.bucket_count() as usize];
        CellTable { layout, buckets, cells: Vec::new() }
    }

    /// Its shape.
    pub fn layout(&self) -> &Arc<TableLayout> {
        &self.layout
    }

    /// All buckets.
    pub fn buckets(&self) -> &[HashBucket] {
        &self.buckets
    }

    /// All cells, those that no bucket refers to among them.
    pub fn cells(&self) -> &[CellData] {
        &self.cells
    }

    /// A bucket, to be changed.
    ///
    /// # Panics
    /// There is no such bucket.
    pub fn bucket_mut(&mut self, bucket: u32) -> &mut HashBucket {
        &mut self.buckets[bucket as usize]
    }

    /// A cell, to be changed; the table grows to hold it.
    ///
    /// # Panics
    /// The index reaches [`TableLayout::max_cells`].
    pub fn cell_mut(&mut self, cell: u32) -> &mut CellData {
        assert!(cell < self.layout.max_cells(), "cell {cell} of {}", self.layout.max_cells());
        if self.cells.len() <= cell as usize {
            self.cells.resize(cell as usize + 1, CellData::default());
        }
        &mut self.cells[cell as usize]
    }

    /// The points of a cell of a grid of this table ([Neff2023] sec. 3.5: eq. 1, then a linear search of the bucket up to its
    /// first free entry); none if it does not exist.
    pub fn points_of(&self, grid: &VirtualGrid, cell: [u32; 3]) -> &[PackedPoint] {
        let key = grid.key(cell);
        let Some(bucket) = self.buckets.get(grid.bucket(cell) as usize) else { return &[] };
        let used = bucket.0.iter().take_while(|entry| entry.cell != 0);
        let Some(entry) = used.into_iter().find(|entry| entry.key == key) else { return &[] };
        let Some(cell) = self.cells.get(entry.cell as usize - 1) else { return &[] };
        let end = cell.0.iter().position(|point| !point.is_allocated()).unwrap_or(CELL_POINTS);
        &cell.0[..end]
    }

    /// Everything that exists: what a joiner needs.
    pub fn everything(&self) -> CellChanges {
        let used = |bucket: &&HashBucket| !bucket.is_empty();
        let buckets = (0..).zip(&self.buckets).filter(|(_, b)| used(b)).map(|(i, _)| i).collect();
        let entries = self.buckets.iter().flat_map(|b| &b.0).filter(|entry| entry.cell != 0);
        let mut cells: Vec<u32> = entries.map(|entry| entry.cell - 1).collect();
        cells.sort_unstable();
        // What came from outside may name a cell twice.
        cells.dedup();
        CellChanges { buckets, cells }
    }

    /// Whether both tables give the same answer to every look-up, with cells at the same places.
    pub fn holds_same(&self, other: &CellTable) -> bool {
        self.layout == other.layout
            && self.buckets == other.buckets
            && self.everything().cells.iter().all(|&cell| {
                let of = |table: &CellTable| table.cells.get(cell as usize).copied();
                of(self) == of(other)
            })
    }

    /// Points in all cells that exist.
    pub fn point_count(&self) -> usize {
        let cells = self.everything().cells;
        let points = cells.iter().filter_map(|&cell| self.cells.get(cell as usize));
        points.flat_map(|cell| cell.0).filter(|point| point.is_allocated()).count()
    }
}
