//! Whole numbers in 1 to 10 bytes, and a reader over bytes that cannot run past their end.

use super::DecodeError;

/// Longest varint, bytes.
pub(crate) const MAX_VARINT_BYTES: usize = 10;

/// Appends `value`, 7 bits a byte, lowest first; all but the last byte have bit 7 set.
pub(crate) fn write_varint(out: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

/// Bytes that are still to be read. Every method names the `part` it is reading in its error.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reader<'a> {
    rest: &'a [u8],
}

impl<'a> Reader<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Reader<'a> {
        Reader { rest: bytes }
    }

    pub(crate) fn len(&self) -> usize {
        self.rest.len()
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.rest.is_empty()
    }

    pub(crate) fn take(&mut self, count: usize, part: &'static str) -> Result<&'a [u8], DecodeError> {
        let (taken, rest) =
            self.rest.split_at_checked(count).ok_or(DecodeError::Malformed { part, reason: "ends early" })?;
        self.rest = rest;
        Ok(taken)
    }

    pub(crate) fn array<const N: usize>(&mut self, part: &'static str) -> Result<[u8; N], DecodeError> {
        let mut out = [0; N];
        out.copy_from_slice(self.take(N, part)?);
        Ok(out)
    }

    pub(crate) fn byte(&mut self, part: &'static str) -> Result<u8, DecodeError> {
        Ok(self.array::<1>(part)?[0])
    }

    pub(crate) fn f32(&mut self, part: &'static str) -> Result<f32, DecodeError> {
        Ok(f32::from_le_bytes(self.array(part)?))
    }

    /// Reads what [`write_varint`] wrote; only the shortest form of a number is one.
    pub(crate) fn varint(&mut self, part: &'static str) -> Result<u64, DecodeError> {
        let bad = |reason| DecodeError::Malformed { part, reason };
        let mut value = 0u64;
        for index in 0..MAX_VARINT_BYTES {
            let byte = self.byte(part)?;
            let bits = u64::from(byte & 0x7f);
            if index == MAX_VARINT_BYTES - 1 && bits > 1 {
                return Err(bad("a number exceeds 64 bits"));
            }
            value |= bits << (7 * index);
            if byte & 0x80 == 0 {
                if byte == 0 && index > 0 {
                    return Err(bad("a number is not in its shortest form"));
                }
                return Ok(value);
            }
        }
        Err(bad("a number exceeds 64 bits"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn reading_inverts_writing(value: u64, shift in 0u32..64) {
            let mut bytes = Vec::new();
            write_varint(&mut bytes, value >> shift);
            let mut reader = Reader::new(&bytes);
            prop_assert_eq!(reader.varint("test").unwrap(), value >> shift);
            prop_assert_eq!(reader.len(), 0);
        }
    }

    #[test]
    fn only_the_shortest_form_is_read() {
        for bytes in [&[0x80, 0x00][..], &[0xff; 10], &[0x80; 12], &[], &[0x80]] {
            assert!(Reader::new(bytes).varint("test").is_err(), "{bytes:02x?}");
        }
        assert_eq!(
            Reader::new(&[0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 1]).varint("test").unwrap(),
            u64::MAX
        );
    }
}
