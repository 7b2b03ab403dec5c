//! Fields of some bits in bytes, lowest bits first.

/// Writes fields one after the other; bits beyond the end are lost.
pub(super) struct BitWriter<'a> {
    bytes: &'a mut [u8],
    at: usize,
}

impl<'a> BitWriter<'a> {
    /// Onto bytes that are zero.
    pub(super) fn new(bytes: &'a mut [u8]) -> BitWriter<'a> {
        BitWriter { bytes, at: 0 }
    }

    /// The lowest `count` bits (≤ 32) of a value.
    pub(super) fn put(&mut self, value: u32, count: usize) {
        let mut left = u64::from(value) & ((1 << count) - 1);
        let mut remaining = count;
        while remaining > 0 {
            let (byte, shift) = (self.at / 8, self.at % 8);
            let taken = remaining.min(8 - shift);
            if let Some(byte) = self.bytes.get_mut(byte) {
                *byte |= (left << shift) as u8;
            }
            left >>= taken;
            self.at += taken;
            remaining -= taken;
        }
    }
}

/// Reads fields one after the other; bits beyond the end are zero.
pub(super) struct BitReader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> BitReader<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> BitReader<'a> {
        BitReader { bytes, at: 0 }
    }

    /// The next `count` bits (≤ 32).
    pub(super) fn take(&mut self, count: usize) -> u32 {
        let (mut value, mut filled) = (0u64, 0);
        while filled < count {
            let (byte, shift) = (self.at / 8, self.at % 8);
            let taken = (count - filled).min(8 - shift);
            let byte = u64::from(self.bytes.get(byte).copied().unwrap_or(0));
            value |= (byte >> shift & ((1 << taken) - 1)) << filled;
            filled += taken;
            self.at += taken;
        }
        value as u32
    }
}
