//! A stream kept in a file: frames with the times they belong to, as `docs/recording.md` specifies.
//!
//! A [`Recorder`] turns frames into the bytes of a file, a [`Recording`] reads them as they come or all at once, a
//! [`Replay`] says which frames bring a subscriber to any time, forwards or backwards. None of them knows a file,
//! a socket or a clock.

mod format;
mod reader;
mod recorder;
mod replay;

pub use format::{MAGIC, MAX_DURATION_US, MAX_NAME_BYTES, RecordingHeader, SnapshotAt, VERSION};
pub use reader::{Entry, Recording, closing_bytes, parse_closing};
pub use recorder::{RecordError, Recorder};
pub use replay::Replay;

use crate::codec::DecodeError;

/// Why bytes are not a recording, or no longer one.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RecordingError {
    /// The bytes end before the recording does.
    #[error("recording: it ends after {have} bytes, in its {part}; it was cut, fetch or record it again")]
    Truncated {
        /// Bytes that came.
        have: usize,
        /// Where the next part begins that is not whole.
        part: &'static str,
    },
    /// Another kind of file.
    #[error("recording: it begins with {found:02x?}, not with {MAGIC:02x?}; this is no .dapple file")]
    BadMagic {
        /// First bytes.
        found: [u8; 8],
    },
    /// A version this code does not read.
    #[error("recording: version {found}, this end reads {VERSION}; update the older end")]
    UnsupportedVersion {
        /// Version of the file.
        found: u8,
    },
    /// A bit was changed.
    #[error(
        "recording: the {part} at byte {offset} has checksum {computed:08x}, it says {stored:08x}; the file was \
         damaged, fetch or record it again"
    )]
    Corrupt {
        /// Which part.
        part: &'static str,
        /// Where it begins.
        offset: usize,
        /// Checksum in the file.
        stored: u32,
        /// Checksum of the bytes that came.
        computed: u32,
    },
    /// A frame is damaged, too large, or none.
    #[error("recording: entry {entry} at byte {offset}: {error}")]
    Frame {
        /// Number of the entry, from 0.
        entry: usize,
        /// Where its frame begins.
        offset: usize,
        /// What is wrong with it.
        error: DecodeError,
    },
    /// All checksums are right, but a rule of the format is broken: the writer is at fault.
    #[error("recording: the {part} at byte {offset} {reason}; its writer does not follow the format")]
    Malformed {
        /// Which part.
        part: &'static str,
        /// Where it begins.
        offset: usize,
        /// What is wrong.
        reason: &'static str,
    },
    /// There are bytes after the end.
    #[error("recording: {extra} bytes follow its end; remove them")]
    TrailingBytes {
        /// How many.
        extra: usize,
    },
}
