//! A run of bytes, stored as it is or compressed, with its expanded size known before anything is expanded.

use std::io::Read;

use ruzstd::decoding::{BlockDecodingStrategy, FrameDecoder};

use super::varint::Reader;
use super::{DecodeError, ZSTD_MAGIC};

/// Appends `raw`, compressed at `level` where that is shorter.
#[cfg(feature = "zstd")]
pub(crate) fn pack(out: &mut Vec<u8>, raw: &[u8], level: i32) -> Result<(), std::io::Error> {
    use super::varint::write_varint;
    // The magic number says nothing here, and 4 bytes count in a delta of a few changes.
    let packed = if raw.len() < 16 { Vec::new() } else { zstd::bulk::compress(raw, level)? };
    match packed.strip_prefix(&ZSTD_MAGIC) {
        Some(coded) if coded.len() + 2 < raw.len() => {
            write_varint(out, (coded.len() as u64) << 1 | 1);
            write_varint(out, raw.len() as u64);
            out.extend(coded);
        }
        _ => {
            write_varint(out, (raw.len() as u64) << 1);
            out.extend(raw);
        }
    }
    Ok(())
}

/// Reads a section that must expand to between `least` and `most` bytes.
pub(crate) fn unpack(
    reader: &mut Reader<'_>,
    part: &'static str,
    least: usize,
    most: usize,
) -> Result<Vec<u8>, DecodeError> {
    let bad = |reason| DecodeError::Malformed { part, reason };
    let head = reader.varint(part)?;
    let coded_bytes = usize::try_from(head >> 1).map_err(|_| bad("ends early"))?;
    let compressed = head & 1 == 1;
    let raw_bytes = if compressed { reader.varint(part)? } else { head >> 1 };
    if raw_bytes < least as u64 || raw_bytes > most as u64 {
        return Err(bad("its size does not fit the number of points"));
    }
    let coded = reader.take(coded_bytes, part)?;
    if !compressed {
        return Ok(coded.to_vec());
    }
    expand(coded, raw_bytes as usize).ok_or(bad("is not valid Zstandard data of the stated size"))
}

/// Expands to exactly `raw_bytes`. Memory grows with what really comes out, never beyond the stated size by more
/// than a window (at most the next power of two) and a block (128 KiB).
pub(crate) fn expand(coded: &[u8], raw_bytes: usize) -> Option<Vec<u8>> {
    let mut decoder = FrameDecoder::new();
    decoder.set_max_window_size(raw_bytes.next_power_of_two().max(1024) as u64);
    let mut source = ZSTD_MAGIC.as_slice().chain(coded);
    decoder.init(&mut source).ok()?;
    let mut out = Vec::new();
    while !decoder.is_finished() {
        decoder.decode_blocks(&mut source, BlockDecodingStrategy::UptoBlocks(1)).ok()?;
        let ready = decoder.can_collect();
        if ready > raw_bytes - out.len() {
            return None;
        }
        if ready > 0 {
            out.extend(decoder.collect()?);
        }
    }
    let all_read = source.into_inner().1.is_empty();
    (out.len() == raw_bytes && all_read).then_some(out)
}

#[cfg(all(test, feature = "zstd"))]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn unpack_inverts_pack(
            raw in prop::collection::vec(0u8..4, 0..2000),
            level in 1i32..19,
        ) {
            let mut bytes = Vec::new();
            pack(&mut bytes, &raw, level).unwrap();
            let mut reader = Reader::new(&bytes);
            prop_assert_eq!(unpack(&mut reader, "test", raw.len(), raw.len()).unwrap(), raw.clone());
            prop_assert!(reader.is_empty());
            prop_assert!(unpack(&mut Reader::new(&bytes), "test", raw.len() + 1, usize::MAX).is_err());
        }
    }

    #[test]
    fn long_runs_of_several_blocks_come_back() {
        let mut state = 1u32;
        let raw: Vec<u8> = (0..700_000u32)
            .map(|i| {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                if i % 3 == 0 { (state >> 24) as u8 } else { (i >> 12) as u8 }
            })
            .collect();
        for level in [1, 3, 15, 19] {
            let mut bytes = Vec::new();
            pack(&mut bytes, &raw, level).unwrap();
            assert_eq!(unpack(&mut Reader::new(&bytes), "test", 0, raw.len()).unwrap(), raw);
        }
    }

    #[test]
    fn a_section_that_lies_about_its_size_is_refused() {
        let coded = zstd::bulk::compress(&vec![7; 1 << 20], 3).unwrap();
        for claim in [1000, (1 << 20) - 1, (1 << 20) + 1] {
            assert_eq!(expand(&coded[4..], claim), None, "claimed {claim}");
        }
        assert!(expand(&coded[4..], 1 << 20).is_some());
        let longer = [&coded[4..], &[0]].concat();
        assert_eq!(expand(&longer, 1 << 20), None, "a byte after the end");
    }
}
