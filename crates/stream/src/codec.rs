//! The bits of frames: what `docs/wire.md` specifies, as pure functions.
//!
//! A snapshot is a layout and one value a point. Points are in Morton order, so a position is the distance of
//! its cell from the previous point's cell and the place within the cell; of that place one coordinate follows
//! nearly from the other two, because points lie on surfaces whose normals are known ([`plane`]). With the layout come
//! the cuts: which points do not count at which texels. Values, and what changed of them, are foretold from neighbours and
//! written by an entropy coder (`values/`, `entropy/`); a delta builds on the values the receiver holds and on nothing else. Sets
//! of points that come are a small snapshot of their own ([`sets`]). Bent normals, where a store has them, are two more planes of
//! values like those of visibility ([`planes`]); how much of each light points see follows them.

mod columns;
mod decode;
#[cfg(feature = "publish")]
mod encode;
pub(crate) mod entropy;
mod frame;
mod plane;
mod planes;
mod sets;
mod values;
pub(crate) mod varint;

pub(crate) use decode::{
    DecodedLayout, DeltaParts, decode_changes, decode_layout, decode_values, parse_delta, parse_snapshot,
};
#[cfg(feature = "publish")]
pub(crate) use encode::{EncodedLayout, append_changes, encode_layout, local_bits, snapshot_payload};
pub(crate) use frame::open;
pub use frame::{FrameHeader, FrameKind, MAGIC, VERSION, seal};
pub(crate) use planes::{Changes, Extras};
#[cfg(feature = "publish")]
pub(crate) use planes::{PLANES, planes};
#[cfg(feature = "publish")]
pub(crate) use sets::sets_head;
pub(crate) use sets::{DecodedSets, decode_sets_change};
pub(crate) use values::{BLOCK, Back, Candidates, Near, SHARES, Scratch};
#[cfg(feature = "publish")]
pub(crate) use values::{Fit, Goal, LEAF, Tolerances};
pub use values::{ValueChange, first_chances};

use dapple_store::points::LayoutError;

/// Most bits of a coordinate within its cell: they are coded as one byte.
pub(crate) const MAX_LOCAL_BITS: u32 = 8;

/// What a receiver is willing to take. Every allocation of a decoder is bounded by these, whatever the bytes say:
/// at most 64 bytes for each of `max_points`, 256 for each of `max_sets`, 32 for each of `max_cuts`, 48 for each of `max_light_values`, and 8 MiB.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Longest frame, bytes. Default 64 MiB.
    pub max_frame_bytes: usize,
    /// Most points of a layout. Default 2²² (4 million, some 16,000 m² at 6.7 cm); at most
    /// [`MAX_POINTS`](dapple_store::points::MAX_POINTS) has an effect.
    pub max_points: u32,
    /// Most sets (instances with points) of a layout. Default 65,536.
    pub max_sets: u32,
    /// Most texels of which points are cut. Default 2²¹ (2 million; a building of 4 million points has about a tenth).
    pub max_cuts: u32,
    /// Most values of lights: points, or sets if they are more, × lights. Default
    /// [`MAX_VALUES`](dapple_store::light_visibility::MAX_VALUES), 2²⁴, and no more than that has an effect.
    pub max_light_values: u32,
}

impl Default for Limits {
    fn default() -> Limits {
        Limits {
            max_frame_bytes: 64 << 20,
            max_points: 1 << 22,
            max_sets: 1 << 16,
            max_cuts: 1 << 21,
            max_light_values: dapple_store::light_visibility::MAX_VALUES as u32,
        }
    }
}

/// Why bytes are not a frame.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DecodeError {
    /// The bytes end before the frame does.
    #[error("frame: {have} bytes, at least {need} needed; the frame was cut")]
    Truncated {
        /// Bytes given.
        have: usize,
        /// Bytes that a complete frame would have at the least.
        need: usize,
    },
    /// There are more bytes than the frame has.
    #[error("frame: {extra} bytes after its end; hand over one frame at a time")]
    TrailingBytes {
        /// How many.
        extra: usize,
    },
    /// Not a frame of this protocol.
    #[error("frame: begins with {found:02x?}, not with {MAGIC:02x?}; this is no Dapple stream")]
    BadMagic {
        /// First two bytes.
        found: [u8; 2],
    },
    /// A version this code does not speak.
    #[error("frame: version {found}, this end speaks {VERSION}; update the older end")]
    UnsupportedVersion {
        /// Version of the frame.
        found: u8,
    },
    /// A bit was changed on the way.
    #[error("frame: checksum {computed:08x}, it says {stored:08x}; the frame was damaged on its way")]
    Corrupt {
        /// Checksum in the frame.
        stored: u32,
        /// Checksum of the bytes that came.
        computed: u32,
    },
    /// A kind of frame that this version does not have.
    #[error("frame: unknown kind {found}")]
    UnknownKind {
        /// The byte.
        found: u8,
    },
    /// A number exceeds the receiver's [`Limits`].
    #[error("frame: {what} {value}, this end takes at most {limit}; raise its limits if that is meant")]
    TooLarge {
        /// Of what there is too much.
        what: &'static str,
        /// How much.
        value: u64,
        /// How much is allowed.
        limit: u64,
    },
    /// The frame is whole, but breaks a rule of the format: the sender is at fault.
    #[error("frame: {part}: {reason}; the sender does not follow the wire format")]
    Malformed {
        /// Which part.
        part: &'static str,
        /// What is wrong.
        reason: &'static str,
    },
    /// The layout breaks a rule of the store.
    #[error("frame: {0}")]
    Layout(#[from] LayoutError),
}

/// Maps small differences of either sign, modulo 256, to small bytes.
pub(crate) fn zigzag(difference: u8) -> u8 {
    let d = difference as i8;
    ((d << 1) ^ (d >> 7)) as u8
}

/// The inverse of [`zigzag`].
pub(crate) fn unzigzag(code: u8) -> u8 {
    (code >> 1) ^ (code & 1).wrapping_neg()
}
