//! A table and its changes → frames.

use dapple_store::cells::{CellChanges, CellTable};

use super::{BUCKET_BYTES, CELL_BYTES, CellCodec, INDEX_BYTES, TAG, ZSTD_MAGIC};
use crate::codec::varint::write_varint;
use crate::codec::{FrameKind, seal};

/// [Neff2023] sec. 4.
const LEVEL: i32 = 15;
const STRATEGY: zstd::zstd_safe::Strategy = zstd::zstd_safe::Strategy::ZSTD_lazy;

/// One frame, ready for any transport.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CellFrame {
    /// A snapshot holds everything, a delta what changed since the frame before.
    pub kind: FrameKind,
    /// Number of the update that it leads to.
    pub epoch: u64,
    /// The complete bytes on the wire.
    pub bytes: Vec<u8>,
    /// Buckets in it.
    pub buckets: u32,
    /// Cells in it.
    pub cells: u32,
}

/// The sending end: numbers the updates of one table.
#[derive(Clone, Debug)]
pub struct CellPublisher {
    scene_hash: [u8; 32],
    codec: CellCodec,
    /// Of the latest update that changed something.
    epoch: u64,
    time_s: f64,
}

impl CellPublisher {
    /// A publisher of the scene with this hash, whose table stands at `time_s`; that is epoch 0.
    pub fn new(scene_hash: [u8; 32], codec: CellCodec, time_s: f64) -> CellPublisher {
        CellPublisher { scene_hash, codec, epoch: 0, time_s }
    }

    /// The frame that takes subscribers from the table before `changes` to `table`, which stands at `time_s` (seconds);
    /// `None` if nothing changed.
    ///
    /// # Errors
    /// The compressor failed, which means that memory ran out.
    pub fn publish(
        &mut self,
        table: &CellTable,
        changes: &CellChanges,
        time_s: f64,
    ) -> std::io::Result<Option<CellFrame>> {
        if changes.is_empty() {
            return Ok(None);
        }
        let mut body = Vec::new();
        write_changes(&mut body, table, changes);
        let next = CellPublisher { epoch: self.epoch + 1, time_s, ..self.clone() };
        let frame = next.frame(FrameKind::Delta, &body, changes)?;
        *self = next;
        Ok(Some(frame))
    }

    /// The frame that brings anyone to `table`, which is the one last published.
    ///
    /// # Errors
    /// The compressor failed, which means that memory ran out.
    pub fn join(&self, table: &CellTable) -> std::io::Result<CellFrame> {
        let mut body = Vec::new();
        body.extend(self.scene_hash);
        let layout = table.layout();
        body.extend(layout.spacing_m().to_le_bytes());
        body.extend(layout.edge_m().to_le_bytes());
        write_varint(&mut body, layout.grids().len() as u64);
        for placed in layout.grids() {
            write_varint(&mut body, u64::from(placed.instance));
            placed.grid.origin.to_array().iter().for_each(|c| body.extend(c.to_le_bytes()));
            placed.grid.dims.iter().for_each(|d| write_varint(&mut body, u64::from(*d)));
            write_varint(&mut body, u64::from(placed.grid.count));
        }
        let everything = table.everything();
        write_changes(&mut body, table, &everything);
        self.frame(FrameKind::Snapshot, &body, &everything)
    }

    fn frame(&self, kind: FrameKind, body: &[u8], changes: &CellChanges) -> std::io::Result<CellFrame> {
        let mut payload = Vec::new();
        payload.extend(TAG);
        payload.push(self.codec.byte());
        payload.extend(self.time_s.to_le_bytes());
        write_varint(&mut payload, body.len() as u64);
        match self.codec {
            CellCodec::Zstd => {
                let mut compressor = zstd::bulk::Compressor::new(LEVEL)?;
                compressor.set_parameter(zstd::zstd_safe::CParameter::Strategy(STRATEGY))?;
                let packed = compressor.compress(body)?;
                payload.extend(packed.strip_prefix(&ZSTD_MAGIC).unwrap_or(&packed));
            }
            CellCodec::Lz4 => payload.extend(lz4_flex::block::compress(body)),
        }
        Ok(CellFrame {
            kind,
            epoch: self.epoch,
            bytes: seal(kind, 0, self.epoch, &payload),
            buckets: changes.buckets.len() as u32,
            cells: changes.cells.len() as u32,
        })
    }
}

/// Indices as gaps, then the contents as they lie in memory, little endian.
fn write_changes(out: &mut Vec<u8>, table: &CellTable, changes: &CellChanges) {
    let CellChanges { buckets, cells } = changes;
    out.reserve(buckets.len() * (BUCKET_BYTES + INDEX_BYTES) + cells.len() * (CELL_BYTES + INDEX_BYTES));
    for indices in [buckets, cells] {
        write_varint(out, indices.len() as u64);
        let mut next = 0;
        for &index in indices {
            write_varint(out, u64::from(index - next));
            next = index + 1;
        }
    }
    for &bucket in buckets {
        for entry in table.buckets()[bucket as usize].0 {
            out.extend(entry.key.to_le_bytes());
            out.extend(entry.cell.to_le_bytes());
        }
    }
    for &cell in cells {
        for point in table.cells()[cell as usize].0 {
            out.extend(point.0.to_le_bytes());
        }
    }
}
