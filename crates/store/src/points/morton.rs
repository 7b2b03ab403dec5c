//! Morton (Z-order) codes of 21-bit coordinates.

/// Interleaves three 21-bit coordinates: bit 3k is bit k of x, 3k+1 of y, 3k+2 of z.
pub fn morton_code(position: [u32; 3]) -> u64 {
    spread(position[0]) | spread(position[1]) << 1 | spread(position[2]) << 2
}

/// The inverse of [`morton_code`]; bit 63 is ignored.
pub fn morton_decode(code: u64) -> [u32; 3] {
    [gather(code), gather(code >> 1), gather(code >> 2)]
}

fn spread(v: u32) -> u64 {
    let mut x = u64::from(v) & 0x1f_ffff;
    x = (x | x << 32) & 0x001f_0000_0000_ffff;
    x = (x | x << 16) & 0x001f_0000_ff00_00ff;
    x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

fn gather(code: u64) -> u32 {
    let mut x = code & 0x1249_2492_4924_9249;
    x = (x | x >> 2) & 0x10c3_0c30_c30c_30c3;
    x = (x | x >> 4) & 0x100f_00f0_0f00_f00f;
    x = (x | x >> 8) & 0x001f_0000_ff00_00ff;
    x = (x | x >> 16) & 0x001f_0000_0000_ffff;
    ((x | x >> 32) & 0x1f_ffff) as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn decode_inverts_code(p in prop::array::uniform3(0u32..1 << 21)) {
            prop_assert_eq!(morton_decode(morton_code(p)), p);
        }
    }

    #[test]
    fn bits_interleave() {
        assert_eq!(morton_code([1, 0, 0]), 1);
        assert_eq!(morton_code([0, 1, 0]), 2);
        assert_eq!(morton_code([0, 0, 1]), 4);
        assert_eq!(morton_code([(1 << 21) - 1; 3]), (1 << 63) - 1);
    }
}
