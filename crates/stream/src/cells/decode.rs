//! Any bytes → a table, or what is wrong with them.

use std::sync::Arc;

use dapple_store::cells::{
    BUCKET_CELLS, BucketEntry, CELL_POINTS, CellChanges, CellData, CellTable, HashBucket, InstanceGrid,
    PackedPoint, TableLayout, TableLayoutError, VirtualGrid,
};
use glam::Vec3;

use super::{BUCKET_BYTES, CELL_BYTES, CellCodec, GRID_BYTES, INDEX_BYTES, TAG, ZSTD_MAGIC};
use crate::codec::varint::Reader;
use crate::codec::{DecodeError, FrameKind, Limits, open};

/// What a receiver is willing to take. Whatever the bytes say, it allocates at most 1 KiB for each of `max_buckets`, 128 bytes for
/// each of `max_grids`, and 8 MiB.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CellLimits {
    /// Longest frame, bytes. Default 64 MiB.
    pub max_frame_bytes: usize,
    /// Most buckets of a table. Default 2¹⁹, which is enough for some 4.8 million points.
    pub max_buckets: u32,
    /// Most instances with points. Default 65,536.
    pub max_grids: u32,
}

impl Default for CellLimits {
    fn default() -> CellLimits {
        CellLimits { max_frame_bytes: 64 << 20, max_buckets: 1 << 19, max_grids: 1 << 16 }
    }
}

/// Why a frame was not applied.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CellError {
    /// It is no frame.
    #[error(transparent)]
    Decode(#[from] DecodeError),
    /// Its table breaks a rule.
    #[error("frame: {0}")]
    Table(#[from] TableLayoutError),
    /// It is of another scene.
    #[error("frame: of another scene; load the scene that the server has")]
    OtherScene,
    /// A frame before it is missing.
    #[error("frame: update {found}, this end holds {held:?}; join again")]
    Gap {
        /// Epoch of the frame.
        found: u64,
        /// Epoch of the table, if there is one.
        held: Option<u64>,
    },
}

/// The receiving end: a table like the server's.
#[derive(Clone, Debug)]
pub struct CellSubscriber {
    scene_hash: Option<[u8; 32]>,
    limits: CellLimits,
    state: Option<State>,
}

#[derive(Clone, Debug)]
struct State {
    table: CellTable,
    epoch: u64,
    time_s: f64,
}

const PART: &str = "cells";

fn bad(reason: &'static str) -> DecodeError {
    DecodeError::Malformed { part: PART, reason }
}

impl CellSubscriber {
    /// A subscriber that holds nothing yet and accepts only frames of the scene with this hash, if one is given.
    pub fn new(scene_hash: Option<[u8; 32]>, limits: CellLimits) -> CellSubscriber {
        CellSubscriber { scene_hash, limits, state: None }
    }

    /// What it holds; nothing before the first snapshot.
    pub fn table(&self) -> Option<&CellTable> {
        self.state.as_ref().map(|state| &state.table)
    }

    /// Time of the server's scene at the latest frame, seconds.
    pub fn time_s(&self) -> Option<f64> {
        self.state.as_ref().map(|state| state.time_s)
    }

    /// Number of the update that it holds.
    pub fn epoch(&self) -> Option<u64> {
        self.state.as_ref().map(|state| state.epoch)
    }

    /// Takes one frame: a snapshot replaces everything, a delta must follow the update that is held. Returns what changed.
    ///
    /// # Errors
    /// The frame is damaged, too large, of another scene, or not the next one. Then nothing has changed.
    pub fn receive(&mut self, frame: &[u8]) -> Result<CellChanges, CellError> {
        let limits = Limits { max_frame_bytes: self.limits.max_frame_bytes, ..Limits::default() };
        let (header, payload) = open(frame, &limits)?;
        if header.kind == FrameKind::Sets {
            return Err(bad("cells have no such kind of frame").into());
        }
        let mut reader = Reader::new(payload);
        if reader.array(PART)? != TAG {
            return Err(bad("these are not cells").into());
        }
        let codec = CellCodec::of(reader.byte(PART)?).ok_or(bad("unknown compression"))?;
        let time_s = f64::from_le_bytes(reader.array(PART)?);
        if !time_s.is_finite() {
            return Err(bad("the time is not finite").into());
        }
        let raw_bytes = reader.varint(PART)?;
        let packed = reader.take(reader.len(), PART)?;
        let (epoch, held) = (header.epoch, self.epoch());
        let follows = held.and_then(|held| held.checked_add(1)) == Some(epoch);
        if header.kind == FrameKind::Delta && !follows {
            return Err(CellError::Gap { found: epoch, held });
        }
        let limit = self.most_bytes(header.kind) as u64;
        if raw_bytes > limit {
            return Err(DecodeError::TooLarge { what: "bytes of cells", value: raw_bytes, limit }.into());
        }
        match header.kind {
            FrameKind::Snapshot => {
                let body = unpack(codec, packed, raw_bytes as usize)?;
                let mut reader = Reader::new(&body);
                let scene_hash: [u8; 32] = reader.array(PART)?;
                if self.scene_hash.is_some_and(|own| own != scene_hash) {
                    return Err(CellError::OtherScene);
                }
                let mut table = CellTable::new(Arc::new(self.read_layout(&mut reader)?));
                let read = Read::new(&mut reader, &table)?;
                let changes = read.apply(&mut table);
                self.state = Some(State { table, epoch, time_s });
                Ok(changes)
            }
            FrameKind::Delta | FrameKind::Sets => {
                let Some(state) = self.state.as_mut() else {
                    return Err(CellError::Gap { found: epoch, held });
                };
                let body = unpack(codec, packed, raw_bytes as usize)?;
                let read = Read::new(&mut Reader::new(&body), &state.table)?;
                (state.epoch, state.time_s) = (epoch, time_s);
                Ok(read.apply(&mut state.table))
            }
        }
    }

    /// Most bytes that a body can have.
    fn most_bytes(&self, kind: FrameKind) -> usize {
        let contents = |buckets: u32| {
            let a_bucket = BUCKET_BYTES + INDEX_BYTES + BUCKET_CELLS * (CELL_BYTES + INDEX_BYTES);
            buckets as usize * a_bucket + 2 * INDEX_BYTES
        };
        match kind {
            FrameKind::Snapshot => {
                let grids = self.limits.max_grids as usize * GRID_BYTES;
                contents(self.limits.max_buckets) + grids + 32 + 8 + INDEX_BYTES
            }
            FrameKind::Delta | FrameKind::Sets => {
                contents(self.table().map_or(0, |table| table.layout().bucket_count()))
            }
        }
    }

    fn read_layout(&self, reader: &mut Reader<'_>) -> Result<TableLayout, CellError> {
        let (spacing_m, edge_m) = (reader.f32(PART)?, reader.f32(PART)?);
        let count = reader.varint(PART)?;
        let limit = u64::from(self.limits.max_grids);
        if count > limit {
            return Err(DecodeError::TooLarge { what: "instances", value: count, limit }.into());
        }
        let mut grids = Vec::new();
        let mut buckets = 0u64;
        for _ in 0..count {
            let instance = number(reader)?;
            let origin = Vec3::new(reader.f32(PART)?, reader.f32(PART)?, reader.f32(PART)?);
            let dims = [number(reader)?, number(reader)?, number(reader)?];
            let count = number(reader)?;
            buckets += u64::from(count);
            grids.push(InstanceGrid { instance, grid: VirtualGrid { origin, dims, first: 0, count } });
        }
        let limit = u64::from(self.limits.max_buckets);
        if buckets > limit {
            return Err(DecodeError::TooLarge { what: "buckets", value: buckets, limit }.into());
        }
        Ok(TableLayout::new(spacing_m, edge_m, grids)?)
    }
}

fn unpack(codec: CellCodec, packed: &[u8], raw_bytes: usize) -> Result<Vec<u8>, DecodeError> {
    match codec {
        CellCodec::Zstd => {
            expand(packed, raw_bytes).ok_or(bad("is not valid Zstandard data of the stated size"))
        }
        CellCodec::Lz4 => lz4_flex::block::decompress(packed, raw_bytes)
            .ok()
            .filter(|body| body.len() == raw_bytes)
            .ok_or(bad("is not valid LZ4 data of the stated size")),
    }
}

fn number(reader: &mut Reader<'_>) -> Result<u32, DecodeError> {
    u32::try_from(reader.varint(PART)?).map_err(|_| bad("a number exceeds 32 bits"))
}

/// A body that has been found sound.
struct Read<'a> {
    changes: CellChanges,
    buckets: &'a [u8],
    cells: &'a [u8],
}

impl<'a> Read<'a> {
    fn new(reader: &mut Reader<'a>, table: &CellTable) -> Result<Read<'a>, DecodeError> {
        let layout = table.layout();
        let buckets = read_indices(reader, layout.bucket_count())?;
        let cells = read_indices(reader, layout.max_cells())?;
        let bucket_bytes = reader.take(buckets.len() * BUCKET_BYTES, PART)?;
        let cell_bytes = reader.take(cells.len() * CELL_BYTES, PART)?;
        if !reader.is_empty() {
            return Err(bad("there is more than what is announced"));
        }
        let held = cells.last().map_or(0, |last| last + 1).max(table.cells().len() as u32);
        let read = Read { changes: CellChanges { buckets, cells }, buckets: bucket_bytes, cells: cell_bytes };
        if read.entries().any(|entry| entry.cell > held) {
            return Err(bad("a bucket refers to a cell that was never sent"));
        }
        Ok(read)
    }

    fn entries(&self) -> impl Iterator<Item = BucketEntry> {
        let words = self.buckets.as_chunks::<8>().0.iter();
        words.map(|&[a, b, c, d, e, f, g, h]| BucketEntry {
            key: u32::from_le_bytes([a, b, c, d]),
            cell: u32::from_le_bytes([e, f, g, h]),
        })
    }

    fn apply(self, table: &mut CellTable) -> CellChanges {
        let mut entries = self.entries();
        for &bucket in &self.changes.buckets {
            let entries = std::array::from_fn(|_| entries.next().unwrap_or_default());
            *table.bucket_mut(bucket) = HashBucket(entries);
        }
        drop(entries);
        for (&cell, bytes) in self.changes.cells.iter().zip(self.cells.as_chunks::<CELL_BYTES>().0) {
            let words = bytes.as_chunks::<4>().0;
            let point = |i: usize| PackedPoint(u32::from_le_bytes(words[i]));
            *table.cell_mut(cell) = CellData(std::array::from_fn::<_, CELL_POINTS, _>(point));
        }
        self.changes
    }
}

/// Ascending indices below `end`.
fn read_indices(reader: &mut Reader<'_>, end: u32) -> Result<Vec<u32>, DecodeError> {
    let count = reader.varint(PART)?;
    // Each takes a byte at least.
    if count > u64::from(end) || count > reader.len() as u64 {
        return Err(bad("more indices than there can be"));
    }
    let mut indices = Vec::with_capacity(count as usize);
    let mut next = 0u64;
    for _ in 0..count {
        let index = next.checked_add(reader.varint(PART)?).filter(|index| *index < u64::from(end));
        let index = index.ok_or(bad("an index beyond the table"))?;
        indices.push(index as u32);
        next = index + 1;
    }
    Ok(indices)
}

/// Expands one Zstandard frame without its magic number to exactly `raw_bytes`. Memory grows with what really comes out, never
/// beyond the stated size by more than a window of that size.
fn expand(coded: &[u8], raw_bytes: usize) -> Option<Vec<u8>> {
    use std::io::Read;
    let whole = std::io::BufReader::new(ZSTD_MAGIC.as_slice().chain(coded));
    let mut decoder = zstd::stream::read::Decoder::with_buffer(whole).ok()?.single_frame();
    decoder.window_log_max(raw_bytes.next_power_of_two().max(1024).ilog2()).ok()?;
    let mut out = Vec::new();
    let read = decoder.by_ref().take(raw_bytes as u64 + 1).read_to_end(&mut out).ok()?;
    let mut rest = [0];
    let is_last = decoder.finish().read(&mut rest).ok()? == 0;
    (read == raw_bytes && is_last).then_some(out)
}
