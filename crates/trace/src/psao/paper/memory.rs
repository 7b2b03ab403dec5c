//! Memory management ([Neff2023] sec. 3.2, 3.4): which cell and place each point has, and what of it is to be sent.

use std::sync::Arc;

use dapple_store::cells::{
    BucketEntry, CELL_POINTS, CellChanges, CellData, CellTable, HashBucket, Overflow, PackedPoint,
    TableLayout,
};

/// A cell of some instance: the bucket that [Neff2023] eq. 1 gives, and the cell's number in its grid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct CellName {
    /// Index into the table's buckets.
    pub bucket: u32,
    /// [`dapple_store::cells::VirtualGrid::key`].
    pub key: u32,
}

/// Where a point is to be, and what it is to carry; `None`: nowhere.
pub type PointUpdate = (u32, Option<(CellName, PackedPoint)>);

/// The server's table, with what only a server needs to know of it.
#[derive(Clone, Debug)]
pub struct CellMemory {
    table: CellTable,
    /// Cell · 8 + place of each point, or [`NOWHERE`].
    places: Vec<u32>,
    /// Of each of the table's cells.
    held: Vec<HeldCell>,
    /// Cells that are free, the next one last.
    free: Vec<u32>,
    dirty_cells: Dirty,
    dirty_buckets: Dirty,
    overflow: Overflow,
}

#[derive(Clone, Copy, Debug)]
struct HeldCell {
    name: CellName,
    points: [u32; CELL_POINTS],
}

const NOWHERE: u32 = u32::MAX;

impl CellMemory {
    /// An empty table for points 0 … `points` − 1.
    pub fn new(layout: Arc<TableLayout>, points: usize) -> CellMemory {
        CellMemory {
            dirty_buckets: Dirty::default(),
            dirty_cells: Dirty::default(),
            table: CellTable::new(layout),
            places: vec![NOWHERE; points],
            held: Vec::new(),
            free: Vec::new(),
            overflow: Overflow::default(),
        }
    }

    /// The table, which after [`CellMemory::commit`] is what subscribers are to hold.
    pub fn table(&self) -> &CellTable {
        &self.table
    }

    /// Points that found no place, counted each time that they asked for one.
    pub fn overflow(&self) -> Overflow {
        self.overflow
    }

    /// Points that have a place now.
    pub fn placed(&self) -> usize {
        self.places.iter().filter(|place| **place != NOWHERE).count()
    }

    /// Moves and changes points; each at most once. Those that leave a cell leave before others come, so that a full cell can
    /// change its points at one go. A point that finds no place is counted and left out until it is updated again.
    ///
    /// # Panics
    /// There is no such point or bucket.
    pub fn update(&mut self, updates: &[PointUpdate]) {
        for &(point, to) in updates {
            let place = self.places[point as usize];
            if place != NOWHERE && to.is_none_or(|(name, _)| self.held[place as usize / 8].name != name) {
                let (cell, slot) = (place / 8, place as usize % 8);
                self.table.cell_mut(cell).0[slot] = PackedPoint::FREE;
                self.places[point as usize] = NOWHERE;
                self.dirty_cells.mark(cell);
            }
        }
        for &(point, to) in updates {
            let Some((name, packed)) = to else { continue };
            let place = match self.places[point as usize] {
                NOWHERE => self.make_place(point, name),
                place => Some(place),
            };
            if let Some(place) = place {
                self.places[point as usize] = place;
                let word = &mut self.table.cell_mut(place / 8).0[place as usize % 8];
                if *word != packed {
                    *word = packed;
                    self.dirty_cells.mark(place / 8);
                }
            }
        }
    }

    /// A free place of a cell, which is allocated if it does not exist.
    fn make_place(&mut self, point: u32, name: CellName) -> Option<u32> {
        let Some(cell) = self.find(name).or_else(|| self.allocate(name)) else {
            self.overflow.bucket += 1;
            return None;
        };
        let Some(slot) = self.table.cell_mut(cell).0.iter().position(|p| !p.is_allocated()) else {
            self.overflow.cell += 1;
            return None;
        };
        self.held[cell as usize].points[slot] = point;
        Some(cell * 8 + slot as u32)
    }

    fn find(&self, name: CellName) -> Option<u32> {
        let bucket = &self.table.buckets()[name.bucket as usize];
        let entry = bucket.0.iter().find(|entry| entry.cell != 0 && entry.key == name.key)?;
        Some(entry.cell - 1)
    }

    /// A cell in the bucket's first free entry, or else in one whose points have all left.
    fn allocate(&mut self, name: CellName) -> Option<u32> {
        let cells = self.table.cells();
        let is_deserted = |entry: &BucketEntry| is_empty(&cells[entry.cell as usize - 1]);
        let bucket = &self.table.buckets()[name.bucket as usize].0;
        let at = bucket
            .iter()
            .position(|entry| *entry == BucketEntry::FREE)
            .or_else(|| bucket.iter().position(is_deserted))?;
        let cell = match bucket[at] {
            BucketEntry::FREE => self.free.pop().unwrap_or(self.held.len() as u32),
            entry => entry.cell - 1,
        };
        if cell as usize == self.held.len() {
            self.held.push(HeldCell { name, points: [NOWHERE; CELL_POINTS] });
        }
        self.held[cell as usize] = HeldCell { name, points: [NOWHERE; CELL_POINTS] };
        *self.table.cell_mut(cell) = CellData::default();
        self.table.bucket_mut(name.bucket).0[at] = BucketEntry { key: name.key, cell: cell + 1 };
        self.dirty_buckets.mark(name.bucket);
        self.dirty_cells.mark(cell);
        Some(cell)
    }

    /// Frees cells without points, moves empty places and entries to the end, and gives what changed since the last call.
    pub fn commit(&mut self) -> CellChanges {
        let mut cells = self.dirty_cells.take();
        cells.retain(|&cell| {
            let exists = !is_empty(&self.table.cells()[cell as usize]);
            if exists {
                self.compact(cell);
            } else {
                let name = self.held[cell as usize].name;
                let bucket = self.table.bucket_mut(name.bucket);
                if let Some(entry) = bucket.0.iter_mut().find(|entry| entry.cell == cell + 1) {
                    *entry = BucketEntry::FREE;
                }
                self.dirty_buckets.mark(name.bucket);
                self.free.push(cell);
            }
            exists
        });
        let buckets = self.dirty_buckets.take();
        for &bucket in &buckets {
            let HashBucket(entries) = self.table.bucket_mut(bucket);
            entries.sort_by_key(|entry| entry.cell == 0);
        }
        CellChanges { buckets, cells }
    }

    fn compact(&mut self, cell: u32) {
        let points = &mut self.table.cell_mut(cell).0;
        let owners = &mut self.held[cell as usize].points;
        let mut end = 0;
        for slot in 0..CELL_POINTS {
            if points[slot].is_allocated() {
                points.swap(slot, end);
                owners.swap(slot, end);
                self.places[owners[end] as usize] = cell * 8 + end as u32;
                end += 1;
            }
        }
    }
}

fn is_empty(cell: &CellData) -> bool {
    cell.0.iter().all(|point| !point.is_allocated())
}

/// A set of indices.
#[derive(Clone, Debug, Default)]
struct Dirty {
    is_marked: Vec<bool>,
    marked: Vec<u32>,
}

impl Dirty {
    fn mark(&mut self, index: u32) {
        if self.is_marked.len() <= index as usize {
            self.is_marked.resize(index as usize + 1, false);
        }
        if !std::mem::replace(&mut self.is_marked[index as usize], true) {
            self.marked.push(index);
        }
    }

    /// All of them, ascending; then there are none.
    fn take(&mut self) -> Vec<u32> {
        for &index in &self.marked {
            self.is_marked[index as usize] = false;
        }
        let mut marked = std::mem::take(&mut self.marked);
        marked.sort_unstable();
        marked
    }
}
