//! The envelope of a frame: magic, version, kind, group, epoch, length, checksum.

use super::varint::{MAX_VARINT_BYTES, Reader, write_varint};
use super::{DecodeError, Limits};

/// First bytes of every frame: "DP".
pub const MAGIC: [u8; 2] = [0x44, 0x50];

/// Version of the format that this code writes, and the only one it reads.
pub const VERSION: u8 = 4;

/// Bytes before the numbers of the header: magic, version, kind.
const FIXED_BYTES: usize = 4;

/// Bytes of the checksum that closes a frame.
const CHECKSUM_BYTES: usize = 4;

/// What a frame carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameKind {
    /// A whole store. Starts a group, or lets a receiver join one.
    Snapshot,
    /// What changed since an epoch that the receiver must hold.
    Delta,
    /// Which instances have points, and what else changed since an epoch that the receiver must hold.
    Sets,
}

impl FrameKind {
    fn byte(self) -> u8 {
        match self {
            FrameKind::Snapshot => 1,
            FrameKind::Delta => 2,
            FrameKind::Sets => 3,
        }
    }
}

/// What a frame says of itself, readable from its first bytes and before its checksum is checked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameHeader {
    /// What it carries.
    pub kind: FrameKind,
    /// Number of its group; a larger one is newer.
    pub group: u64,
    /// Epoch of the store after it was applied.
    pub epoch: u64,
    /// Bytes of the payload.
    pub payload_bytes: usize,
    /// Bytes before the payload.
    pub header_bytes: usize,
}

impl FrameHeader {
    /// Bytes of the whole frame: how much to read from a transport that delivers bytes without bounds.
    pub fn frame_bytes(&self) -> usize {
        self.header_bytes + self.payload_bytes + CHECKSUM_BYTES
    }

    /// Reads the header at the start of `bytes`, which need not hold the whole frame: 34 bytes always suffice.
    /// [`DecodeError::Truncated`] asks for more, every other error is final. Nothing is verified but the header.
    pub fn parse(bytes: &[u8], limits: &Limits) -> Result<FrameHeader, DecodeError> {
        let unknown = |kind| DecodeError::UnknownKind { found: kind };
        let (kind, header) = parse_envelope(bytes, limits)?;
        Ok(FrameHeader { kind: kind_of(kind).ok_or(unknown(kind))?, ..header })
    }
}

/// A complete frame around a payload. The payload is not looked at.
pub fn seal(kind: FrameKind, group: u64, epoch: u64, payload: &[u8]) -> Vec<u8> {
    let mut out = Vec::with_capacity(FIXED_BYTES + 3 * MAX_VARINT_BYTES + payload.len() + CHECKSUM_BYTES);
    out.extend(MAGIC);
    out.push(VERSION);
    out.push(kind.byte());
    write_varint(&mut out, group);
    write_varint(&mut out, epoch);
    write_varint(&mut out, payload.len() as u64);
    out.extend(payload);
    let checksum = crc32fast::hash(&out);
    out.extend(checksum.to_le_bytes());
    out
}

/// Checks a complete frame; gives its header and payload.
pub(crate) fn open<'a>(bytes: &'a [u8], limits: &Limits) -> Result<(FrameHeader, &'a [u8]), DecodeError> {
    let (kind, header) = parse_envelope(bytes, limits)?;
    let need = header.frame_bytes();
    if bytes.len() < need {
        return Err(DecodeError::Truncated { have: bytes.len(), need });
    }
    if bytes.len() > need {
        return Err(DecodeError::TrailingBytes { extra: bytes.len() - need });
    }
    let (body, tail) = bytes.split_at(need - CHECKSUM_BYTES);
    let stored = Reader::new(tail).array("checksum").map(u32::from_le_bytes)?;
    let computed = crc32fast::hash(body);
    if stored != computed {
        return Err(DecodeError::Corrupt { stored, computed });
    }
    // Only now is an odd kind the sender's doing and not the line's.
    let kind = kind_of(kind).ok_or(DecodeError::UnknownKind { found: kind })?;
    Ok((FrameHeader { kind, ..header }, &body[header.header_bytes..]))
}

fn kind_of(byte: u8) -> Option<FrameKind> {
    [FrameKind::Snapshot, FrameKind::Delta, FrameKind::Sets].into_iter().find(|k| k.byte() == byte)
}

/// The kind as its byte, and the header with a kind still to be filled in.
fn parse_envelope(bytes: &[u8], limits: &Limits) -> Result<(u8, FrameHeader), DecodeError> {
    if let Some(found) = bytes.first_chunk::<2>()
        && *found != MAGIC
    {
        return Err(DecodeError::BadMagic { found: *found });
    }
    if let Some(&found) = bytes.get(2)
        && found != VERSION
    {
        return Err(DecodeError::UnsupportedVersion { found });
    }
    let truncated = DecodeError::Truncated { have: bytes.len(), need: bytes.len() + 1 };
    let mut reader = Reader::new(bytes);
    let kind = match reader.take(FIXED_BYTES, "header") {
        Ok(fixed) => fixed[3],
        Err(_) => return Err(truncated),
    };
    let mut number = || {
        // A number that ends with the bytes may yet go on; one that is wrong already is final.
        let ends_with_bytes = reader.len() < MAX_VARINT_BYTES
            && bytes[bytes.len() - reader.len()..].iter().all(|b| b & 0x80 != 0);
        if ends_with_bytes { Err(truncated.clone()) } else { reader.varint("header") }
    };
    let (group, epoch, payload_bytes) = (number()?, number()?, number()?);
    let header_bytes = bytes.len() - reader.len();
    let limit = limits.max_frame_bytes.saturating_sub(header_bytes + CHECKSUM_BYTES) as u64;
    if payload_bytes > limit {
        return Err(DecodeError::TooLarge { what: "payload bytes", value: payload_bytes, limit });
    }
    let payload_bytes = payload_bytes as usize;
    Ok((kind, FrameHeader { kind: FrameKind::Snapshot, group, epoch, payload_bytes, header_bytes }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn opening_inverts_sealing(group: u64, epoch: u64, payload in prop::collection::vec(any::<u8>(), 0..300)) {
            let limits = Limits::default();
            let bytes = seal(FrameKind::Delta, group, epoch, &payload);
            let (header, inside) = open(&bytes, &limits).unwrap();
            prop_assert_eq!((header.kind, header.group, header.epoch), (FrameKind::Delta, group, epoch));
            prop_assert_eq!(inside, &payload[..]);
            prop_assert_eq!(header.frame_bytes(), bytes.len());
            for cut in 0..bytes.len() {
                let truncated = matches!(open(&bytes[..cut], &limits), Err(DecodeError::Truncated { .. }));
                prop_assert!(truncated, "cut at {}", cut);
                if cut >= header.header_bytes {
                    prop_assert_eq!(FrameHeader::parse(&bytes[..cut], &limits).unwrap(), header);
                }
            }
        }

        #[test]
        fn every_flipped_bit_is_noticed(payload in prop::collection::vec(any::<u8>(), 0..40), bit: prop::sample::Index) {
            let mut bytes = seal(FrameKind::Snapshot, 300, 7, &payload);
            let bit = bit.index(bytes.len() * 8);
            bytes[bit / 8] ^= 1 << (bit % 8);
            prop_assert!(open(&bytes, &Limits::default()).is_err());
        }
    }

    #[test]
    fn damage_is_named_as_such() {
        let limits = Limits::default();
        let good = seal(FrameKind::Delta, 1, 2, b"payload");
        let with = |at: usize, byte: u8| {
            let mut bytes = good.clone();
            bytes[at] = byte;
            open(&bytes, &limits).unwrap_err()
        };
        assert_eq!(with(0, 0), DecodeError::BadMagic { found: [0, 0x50] });
        assert_eq!(with(2, 9), DecodeError::UnsupportedVersion { found: 9 });
        for at in [3, 4, 5, 8, good.len() - 1] {
            assert!(matches!(with(at, 0x55), DecodeError::Corrupt { .. }), "byte {at}");
        }
        let mut odd = good[..good.len() - 4].to_vec();
        odd[3] = 77;
        let checksum = crc32fast::hash(&odd);
        odd.extend(checksum.to_le_bytes());
        assert_eq!(open(&odd, &limits), Err(DecodeError::UnknownKind { found: 77 }));
        let small = Limits { max_frame_bytes: good.len() - 1, ..limits };
        assert!(matches!(open(&good, &small), Err(DecodeError::TooLarge { .. })));
        assert!(open(&good, &Limits { max_frame_bytes: good.len(), ..limits }).is_ok());
    }
}
