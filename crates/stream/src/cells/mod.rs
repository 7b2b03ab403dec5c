//! The paper's networking ([Neff2023] sec. 3.4): changed buckets and whole changed cells ⇄ frames.
//!
//! Takes a [`CellTable`](dapple_store::cells::CellTable) and what changed in it; returns frames, which a [`CellSubscriber`]
//! turns back into the same table. The measured baseline; see `README.md`.

mod decode;
mod encode;

pub use decode::{CellError, CellLimits, CellSubscriber};
pub use encode::{CellFrame, CellPublisher};

/// First bytes of every payload, which keep it apart from those of `docs/wire.md`.
const TAG: [u8; 4] = *b"CELL";

/// The start of every Zstandard frame, which bodies leave out.
const ZSTD_MAGIC: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];

/// Bytes of a bucket: eight entries of two words.
const BUCKET_BYTES: usize = 64;
/// Bytes of a cell: seven packed points.
const CELL_BYTES: usize = 28;
/// Most bytes of a grid: instance, origin, cells along each axis, buckets.
const GRID_BYTES: usize = 5 + 12 + 4 * 5;
/// Most bytes of an index or a number of indices.
const INDEX_BYTES: usize = 5;

/// How bodies of frames are compressed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CellCodec {
    /// Zstandard at level 15 with strategy 4 (`ZSTD_lazy`), as [Neff2023] sec. 4 has it. Default.
    #[default]
    Zstd,
    /// LZ4, the paper's alternative.
    Lz4,
}

impl CellCodec {
    fn byte(self) -> u8 {
        match self {
            CellCodec::Zstd => 1,
            CellCodec::Lz4 => 2,
        }
    }

    fn of(byte: u8) -> Option<CellCodec> {
        [CellCodec::Zstd, CellCodec::Lz4].into_iter().find(|codec| codec.byte() == byte)
    }
}
