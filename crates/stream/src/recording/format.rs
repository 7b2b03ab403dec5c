//! The fields of a recording around its frames. All have a fixed width, so that no checksum is needed to find the next.

use super::RecordingError;

/// First bytes of every recording: "DAPPLE" and a line break that careless transfers change.
pub const MAGIC: [u8; 8] = *b"DAPPLE\r\n";

/// Version of the format that this code writes, and the only one it reads.
pub const VERSION: u8 = 1;

/// Longest name of a recording, bytes of UTF-8.
pub const MAX_NAME_BYTES: usize = 255;

/// Longest recording, microseconds: numbers up to here are exact in 64-bit floating point (285 years).
pub const MAX_DURATION_US: u64 = (1 << 53) - 1;

/// Bytes before the name: magic, version, scene hash, duration, size of the name.
pub(super) const HEADER_FIXED_BYTES: usize = 8 + 1 + 32 + 8 + 1;

/// Bytes of an entry before its frame: tag, time, size of the frame, checksum.
pub(super) const ENTRY_HEAD_BYTES: usize = 1 + 8 + 4 + 4;

/// Bytes of the closing part without its list: tag, entries, length of the list, size, checksum.
pub(super) const CLOSING_FIXED_BYTES: usize = 1 + 8 + 4 + 4 + 4;

/// Bytes of one snapshot in the closing list.
pub(super) const SNAPSHOT_BYTES: usize = 3 * 8;

/// First byte of an entry.
pub(super) const TAG_ENTRY: u8 = 1;

/// First byte of the closing part.
pub(super) const TAG_CLOSING: u8 = 0;

const CHECKSUM_BYTES: usize = 4;

/// What a recording says of itself before its first frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecordingHeader {
    /// Hash of the scene that the light belongs to.
    pub scene_hash: [u8; 32],
    /// What it shows, for people. At most [`MAX_NAME_BYTES`] of UTF-8; may be empty.
    pub name: String,
    /// Scene time that it covers, from 0, microseconds. At most [`MAX_DURATION_US`]; after it a player may begin again.
    pub duration_us: u64,
}

/// A place where reading can begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SnapshotAt {
    /// Number of the entry that holds the snapshot, from 0.
    pub entry: u64,
    /// Where that entry begins in the file, bytes.
    pub offset: u64,
    /// Its time, microseconds.
    pub time_us: u64,
}

/// Appends the checksum of `out[from..]`.
pub(super) fn seal_from(out: &mut Vec<u8>, from: usize) {
    let checksum = crc32fast::hash(&out[from..]);
    out.extend(checksum.to_le_bytes());
}

/// Checks a part that begins at `offset` and whose last 4 bytes are its checksum; gives the rest.
pub(super) fn unseal<'a>(
    bytes: &'a [u8],
    part: &'static str,
    offset: usize,
) -> Result<&'a [u8], RecordingError> {
    let (body, tail) = bytes.split_at(bytes.len().saturating_sub(CHECKSUM_BYTES));
    let stored = Fields(tail).u32();
    let computed = crc32fast::hash(body);
    if stored != computed {
        return Err(RecordingError::Corrupt { part, offset, stored, computed });
    }
    Ok(body)
}

/// Reads fields one after the other from a part whose length was checked; beyond its end all is 0.
pub(super) struct Fields<'a>(pub(super) &'a [u8]);

impl<'a> Fields<'a> {
    pub(super) fn array<const N: usize>(&mut self) -> [u8; N] {
        let (taken, rest) = self.0.split_at(self.0.len().min(N));
        self.0 = rest;
        let mut out = [0; N];
        out[..taken.len()].copy_from_slice(taken);
        out
    }

    pub(super) fn u8(&mut self) -> u8 {
        self.array::<1>()[0]
    }

    pub(super) fn u32(&mut self) -> u32 {
        u32::from_le_bytes(self.array())
    }

    pub(super) fn u64(&mut self) -> u64 {
        u64::from_le_bytes(self.array())
    }
}

/// Why a header cannot be, if it cannot.
pub(super) fn check_header(header: &RecordingHeader) -> Result<(), &'static str> {
    if header.name.len() > MAX_NAME_BYTES {
        return Err("has a name longer than 255 bytes");
    }
    if header.duration_us > MAX_DURATION_US {
        return Err("has a duration of 2^53 microseconds or more");
    }
    Ok(())
}

/// The bytes of a header that [`check_header`] accepts.
pub(super) fn encode_header(header: &RecordingHeader) -> Vec<u8> {
    let mut out = Vec::with_capacity(HEADER_FIXED_BYTES + header.name.len() + CHECKSUM_BYTES);
    out.extend(MAGIC);
    out.push(VERSION);
    out.extend(header.scene_hash);
    out.extend(header.duration_us.to_le_bytes());
    out.push(header.name.len() as u8);
    out.extend(header.name.as_bytes());
    seal_from(&mut out, 0);
    out
}

/// The header at the start of `bytes` and its length, or `None` while it has not come whole.
pub(super) fn decode_header(bytes: &[u8]) -> Result<Option<(RecordingHeader, usize)>, RecordingError> {
    let begun = bytes.len().min(MAGIC.len());
    if bytes[..begun] != MAGIC[..begun] {
        return Err(RecordingError::BadMagic { found: Fields(bytes).array() });
    }
    if let Some(&found) = bytes.get(MAGIC.len())
        && found != VERSION
    {
        return Err(RecordingError::UnsupportedVersion { found });
    }
    let Some(&name_bytes) = bytes.get(HEADER_FIXED_BYTES - 1) else { return Ok(None) };
    let length = HEADER_FIXED_BYTES + usize::from(name_bytes) + CHECKSUM_BYTES;
    let Some(part) = bytes.get(..length) else { return Ok(None) };
    let mut fields = Fields(&unseal(part, "header", 0)?[MAGIC.len() + 1..]);
    let malformed = |reason| RecordingError::Malformed { part: "header", offset: 0, reason };
    let (scene_hash, duration_us, _) = (fields.array(), fields.u64(), fields.u8());
    let name = std::str::from_utf8(fields.0).map_err(|_| malformed("has a name that is not UTF-8"))?;
    let header = RecordingHeader { scene_hash, name: name.to_owned(), duration_us };
    check_header(&header).map_err(malformed)?;
    Ok(Some((header, length)))
}

/// The bytes of the head of an entry.
pub(super) fn encode_entry_head(time_us: u64, frame_bytes: u32) -> Vec<u8> {
    let mut out = Vec::with_capacity(ENTRY_HEAD_BYTES + frame_bytes as usize);
    out.push(TAG_ENTRY);
    out.extend(time_us.to_le_bytes());
    out.extend(frame_bytes.to_le_bytes());
    seal_from(&mut out, 0);
    out
}

/// The bytes of the closing part.
pub(super) fn encode_closing(entries: u64, snapshots: &[SnapshotAt]) -> Vec<u8> {
    let length = CLOSING_FIXED_BYTES + SNAPSHOT_BYTES * snapshots.len();
    let mut out = Vec::with_capacity(length);
    out.push(TAG_CLOSING);
    out.extend(entries.to_le_bytes());
    out.extend((snapshots.len() as u32).to_le_bytes());
    for at in snapshots {
        for number in [at.entry, at.offset, at.time_us] {
            out.extend(number.to_le_bytes());
        }
    }
    out.extend((length as u32).to_le_bytes());
    seal_from(&mut out, 0);
    out
}
