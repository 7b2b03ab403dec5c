//! Frames and their times → the bytes of a recording.

use super::RecordingHeader;
use super::format::{SnapshotAt, check_header, encode_closing, encode_entry_head, encode_header};
use crate::codec::{DecodeError, FrameHeader, FrameKind, Limits};

/// Writes a recording piece by piece: every call gives the bytes to append to the file.
#[derive(Debug)]
pub struct Recorder {
    duration_us: u64,
    offset: u64,
    entries: u64,
    last_us: u64,
    last: Option<FrameHeader>,
    snapshots: Vec<SnapshotAt>,
}

/// Why something cannot be recorded. The recorder is as it was before.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RecordError {
    /// The header cannot be written.
    #[error("record: the header {reason}; shorten it")]
    Header {
        /// What is wrong.
        reason: &'static str,
    },
    /// The bytes are not one frame.
    #[error("record: {0}")]
    Frame(#[from] DecodeError),
    /// Times must not go back or leave the duration.
    #[error("record: a frame at {time_us} µs, must lie from {from_us} to {to_us} µs")]
    Time {
        /// Time of the frame, microseconds.
        time_us: u64,
        /// Time of the frame before.
        from_us: u64,
        /// Duration in the header.
        to_us: u64,
    },
    /// The frame does not follow from those before it.
    #[error("record: the frame {reason}; record a snapshot first")]
    Order {
        /// What is wrong.
        reason: &'static str,
    },
}

impl Recorder {
    /// A recorder, and the first bytes of the file.
    pub fn new(header: &RecordingHeader) -> Result<(Recorder, Vec<u8>), RecordError> {
        check_header(header).map_err(|reason| RecordError::Header { reason })?;
        let bytes = encode_header(header);
        let recorder = Recorder {
            duration_us: header.duration_us,
            offset: bytes.len() as u64,
            entries: 0,
            last_us: 0,
            last: None,
            snapshots: Vec::new(),
        };
        Ok((recorder, bytes))
    }

    /// The bytes that record one complete frame, valid from `time_us` (microseconds of scene time) on.
    ///
    /// Times may repeat but not go back. The first frame is a snapshot; a delta follows a frame of its own group.
    /// Whether deltas really build on each other is the publisher's affair.
    pub fn frame(&mut self, time_us: u64, frame: &[u8]) -> Result<Vec<u8>, RecordError> {
        let limits = Limits { max_frame_bytes: u32::MAX as usize, ..Limits::default() };
        let (header, _) = crate::codec::open(frame, &limits)?;
        if time_us < self.last_us || time_us > self.duration_us {
            return Err(RecordError::Time { time_us, from_us: self.last_us, to_us: self.duration_us });
        }
        check_order(self.last.as_ref(), &header).map_err(|reason| RecordError::Order { reason })?;
        if header.kind == FrameKind::Snapshot {
            self.snapshots.push(SnapshotAt { entry: self.entries, offset: self.offset, time_us });
        }
        // `open` has seen that its length fits 32 bits.
        let mut bytes = encode_entry_head(time_us, frame.len() as u32);
        bytes.extend(frame);
        self.offset += bytes.len() as u64;
        self.entries += 1;
        (self.last_us, self.last) = (time_us, Some(header));
        Ok(bytes)
    }

    /// The last bytes of the file.
    pub fn finish(self) -> Vec<u8> {
        encode_closing(self.entries, &self.snapshots)
    }
}

/// Why a frame cannot follow `last`, if it cannot.
pub(super) fn check_order(last: Option<&FrameHeader>, next: &FrameHeader) -> Result<(), &'static str> {
    match (last, next.kind) {
        (_, FrameKind::Snapshot) => Ok(()),
        (None, FrameKind::Delta | FrameKind::Sets) => Err("is a delta before any snapshot"),
        (Some(last), FrameKind::Delta | FrameKind::Sets) if last.group != next.group => {
            Err("is a delta of another group than the frame before it")
        }
        (Some(last), FrameKind::Delta | FrameKind::Sets) if last.epoch >= next.epoch => {
            Err("is a delta whose epoch is not above that of the frame before it")
        }
        (Some(_), FrameKind::Delta | FrameKind::Sets) => Ok(()),
    }
}
