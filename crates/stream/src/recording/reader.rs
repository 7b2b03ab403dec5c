//! The bytes of a recording, as they come or all at once → frames and their times.

use super::format::{
    CLOSING_FIXED_BYTES, ENTRY_HEAD_BYTES, Fields, SNAPSHOT_BYTES, SnapshotAt, TAG_CLOSING, TAG_ENTRY,
    decode_header, encode_closing, unseal,
};
use super::recorder::check_order;
use super::{RecordingError, RecordingHeader};
use crate::codec::{FrameHeader, FrameKind, Limits, open};

/// A recording, whole or as far as it has come.
///
/// Every entry was checked: its frame has a right checksum and keeps the [`Limits`]. Whether the frames lead to a
/// store is for a [`Subscriber`](crate::Subscriber) to find. Memory: the bytes handed over, and at most four
/// times as much again while they grow.
#[derive(Clone, Debug)]
pub struct Recording {
    limits: Limits,
    bytes: Vec<u8>,
    /// Bytes that were understood.
    read: usize,
    header: Option<RecordingHeader>,
    entries: Vec<Slot>,
    snapshots: Vec<SnapshotAt>,
    complete: bool,
    failed: Option<RecordingError>,
}

/// Where an entry's frame lies.
#[derive(Clone, Copy, Debug)]
struct Slot {
    time_us: u64,
    /// Of the frame, in the bytes.
    offset: usize,
    header: FrameHeader,
}

/// One frame of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry<'a> {
    /// Scene time from which on it is valid, microseconds.
    pub time_us: u64,
    /// What the frame says of itself.
    pub header: FrameHeader,
    /// The complete frame.
    pub frame: &'a [u8],
}

impl Recording {
    /// Nothing yet; [`Recording::push`] the bytes as they come. Of `limits` the longest frame matters here.
    pub fn new(limits: &Limits) -> Recording {
        Recording {
            limits: *limits,
            bytes: Vec::new(),
            read: 0,
            header: None,
            entries: Vec::new(),
            snapshots: Vec::new(),
            complete: false,
            failed: None,
        }
    }

    /// A complete recording. Any bytes give `Ok` or `Err`.
    pub fn parse(bytes: Vec<u8>, limits: &Limits) -> Result<Recording, RecordingError> {
        let mut recording = Recording { bytes, ..Recording::new(limits) };
        recording.advance()?;
        recording.finish()?;
        Ok(recording)
    }

    /// Takes the next bytes; gives how many entries they completed. After an error what came before the damage can
    /// still be played, and every further call gives the same error.
    pub fn push(&mut self, bytes: &[u8]) -> Result<usize, RecordingError> {
        let before = self.entries.len();
        if self.failed.is_none() {
            self.bytes.extend_from_slice(bytes);
        }
        self.advance()?;
        Ok(self.entries.len() - before)
    }

    /// Says at the end of all bytes whether anything is missing.
    pub fn finish(&self) -> Result<(), RecordingError> {
        if let Some(error) = &self.failed {
            return Err(error.clone());
        }
        if self.complete {
            return Ok(());
        }
        let part = match (&self.header, self.bytes.get(self.read)) {
            (None, _) => "header",
            (_, Some(&TAG_ENTRY)) => "entries",
            _ => "closing part",
        };
        Err(RecordingError::Truncated { have: self.bytes.len(), part })
    }

    /// What the recording says of itself, once that has come.
    pub fn header(&self) -> Option<&RecordingHeader> {
        self.header.as_ref()
    }

    /// Whether it has come whole.
    pub fn is_complete(&self) -> bool {
        self.complete
    }

    /// Entries that have come.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Whether no entry has come.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Bytes that have come.
    pub fn size_bytes(&self) -> usize {
        self.bytes.len()
    }

    /// The entry of that number, from 0.
    pub fn entry(&self, number: usize) -> Option<Entry<'_>> {
        self.entries.get(number).map(|slot| self.view(slot))
    }

    /// All entries that have come, in order of time.
    pub fn entries(&self) -> impl ExactSizeIterator<Item = Entry<'_>> {
        self.entries.iter().map(|slot| self.view(slot))
    }

    /// The snapshots that have come, in order of time.
    pub fn snapshots(&self) -> &[SnapshotAt] {
        &self.snapshots
    }

    /// Numbers of the entries that lead to the state at `time_us`: the last snapshot that is not later, and what
    /// follows it up to that time. Before the first entry, the first alone; empty for an empty recording.
    pub fn seek(&self, time_us: u64) -> std::ops::Range<usize> {
        let end = self.entries.partition_point(|slot| slot.time_us <= time_us).max(1).min(self.entries.len());
        let snapshots = self.snapshots.partition_point(|at| at.entry < end as u64);
        let start = snapshots.checked_sub(1).map_or(0, |last| self.snapshots[last].entry as usize);
        start..end
    }

    /// Time up to which frames have come, microseconds: the duration once it is complete.
    pub fn loaded_us(&self) -> u64 {
        match (&self.header, self.complete) {
            (Some(header), true) => header.duration_us,
            _ => self.entries.last().map_or(0, |slot| slot.time_us),
        }
    }

    fn view(&self, slot: &Slot) -> Entry<'_> {
        let frame = &self.bytes[slot.offset..slot.offset + slot.header.frame_bytes()];
        Entry { time_us: slot.time_us, header: slot.header, frame }
    }

    /// Reads on as far as the bytes go.
    fn advance(&mut self) -> Result<(), RecordingError> {
        if let Some(error) = &self.failed {
            return Err(error.clone());
        }
        let result = self.read_parts();
        self.failed = result.clone().err();
        result
    }

    fn read_parts(&mut self) -> Result<(), RecordingError> {
        if self.header.is_none() {
            let Some((header, length)) = decode_header(&self.bytes)? else { return Ok(()) };
            (self.header, self.read) = (Some(header), length);
        }
        while !self.complete {
            let whole = match self.bytes.get(self.read) {
                None => return Ok(()),
                Some(&TAG_CLOSING) => self.read_closing()?,
                Some(_) => self.read_entry()?,
            };
            if !whole {
                return Ok(());
            }
        }
        match self.bytes.len() - self.read {
            0 => Ok(()),
            extra => Err(RecordingError::TrailingBytes { extra }),
        }
    }

    /// Reads an entry; false if it has not come whole.
    fn read_entry(&mut self) -> Result<bool, RecordingError> {
        let offset = self.read;
        let malformed = |reason| RecordingError::Malformed { part: "entry", offset, reason };
        let Some(head) = self.bytes.get(offset..offset + ENTRY_HEAD_BYTES) else { return Ok(false) };
        let mut fields = Fields(unseal(head, "entry", offset)?);
        let (tag, time_us, frame_bytes) = (fields.u8(), fields.u64(), fields.u32() as usize);
        if tag != TAG_ENTRY {
            return Err(malformed("has an unknown tag"));
        }
        if time_us < self.entries.last().map_or(0, |slot| slot.time_us) {
            return Err(malformed("is earlier than the entry before it"));
        }
        if self.header.as_ref().is_some_and(|header| time_us > header.duration_us) {
            return Err(malformed("is later than the duration"));
        }
        let start = offset + ENTRY_HEAD_BYTES;
        let wrong = |error| RecordingError::Frame { entry: self.entries.len(), offset: start, error };
        if frame_bytes > self.limits.max_frame_bytes {
            let (value, limit) = (frame_bytes as u64, self.limits.max_frame_bytes as u64);
            return Err(wrong(crate::DecodeError::TooLarge { what: "frame bytes", value, limit }));
        }
        let Some(frame) = self.bytes.get(start..start.saturating_add(frame_bytes)) else { return Ok(false) };
        let (header, _) = open(frame, &self.limits).map_err(wrong)?;
        check_order(self.entries.last().map(|slot| &slot.header), &header).map_err(malformed)?;
        if header.kind == FrameKind::Snapshot {
            let (entry, offset) = (self.entries.len() as u64, offset as u64);
            self.snapshots.push(SnapshotAt { entry, offset, time_us });
        }
        self.entries.push(Slot { time_us, offset: start, header });
        self.read = start + frame_bytes;
        Ok(true)
    }

    /// Reads the closing part; false if it has not come whole. Its length follows from the entries, so that damage to
    /// the length it states is still seen as damage.
    fn read_closing(&mut self) -> Result<bool, RecordingError> {
        let offset = self.read;
        let length = CLOSING_FIXED_BYTES + SNAPSHOT_BYTES * self.snapshots.len();
        let Some(part) = self.bytes.get(offset..offset + length) else { return Ok(false) };
        unseal(part, "closing part", offset)?;
        if part != encode_closing(self.entries.len() as u64, &self.snapshots) {
            let reason = "does not list the snapshots that there are";
            return Err(RecordingError::Malformed { part: "closing part", offset, reason });
        }
        self.read = offset + length;
        self.complete = true;
        Ok(true)
    }
}

/// The snapshots of a recording from its end alone, for who wants to fetch from the middle. `tail` is any number of
/// its last bytes, at least what [`closing_bytes`] says.
pub fn parse_closing(tail: &[u8]) -> Result<Vec<SnapshotAt>, RecordingError> {
    let part = "closing part";
    let truncated = RecordingError::Truncated { have: tail.len(), part };
    let length = closing_bytes(tail)?;
    let offset = tail.len().checked_sub(length).ok_or(truncated)?;
    let malformed = |reason| RecordingError::Malformed { part, offset, reason };
    let mut fields = Fields(unseal(&tail[offset..], part, offset)?);
    let (tag, _entries, count) = (fields.u8(), fields.u64(), fields.u32() as usize);
    // The number may be any, and the product more than a machine of 32 bits counts.
    let listed = count.checked_mul(SNAPSHOT_BYTES).and_then(|bytes| bytes.checked_add(CLOSING_FIXED_BYTES));
    if tag != TAG_CLOSING || listed != Some(length) {
        return Err(malformed("does not fit its length"));
    }
    let snapshot = |_| SnapshotAt { entry: fields.u64(), offset: fields.u64(), time_us: fields.u64() };
    Ok((0..count).map(snapshot).collect())
}

/// Length of the closing part, which the last 8 bytes of a recording tell. Not yet checked against its checksum.
pub fn closing_bytes(tail: &[u8]) -> Result<usize, RecordingError> {
    let part = "closing part";
    let Some((_, end)) = tail.split_last_chunk::<8>() else {
        return Err(RecordingError::Truncated { have: tail.len(), part });
    };
    let length = Fields(end).u32() as usize;
    if length < CLOSING_FIXED_BYTES || !(length - CLOSING_FIXED_BYTES).is_multiple_of(SNAPSHOT_BYTES) {
        let reason = "has an impossible length";
        return Err(RecordingError::Malformed { part, offset: tail.len(), reason });
    }
    Ok(length)
}
