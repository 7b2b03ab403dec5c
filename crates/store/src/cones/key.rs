//! Names of texels of the on-surface cache: instance, chart, level of detail, block and texel.

use std::hash::{BuildHasher, Hasher};

/// Finest level: texels of 1/64 of the charts' own.
pub const FINEST_LEVEL: i8 = -6;

/// Coarsest level: texels 4096 times the charts' own.
pub const COARSEST_LEVEL: i8 = 12;

/// Texels along a side of a block ([Stadlbauer2023] sec. 2.1).
pub const BLOCK_SIDE: i32 = 8;

/// Its logarithm.
const BLOCK_BITS: u32 = BLOCK_SIDE.trailing_zeros();

/// Texels of a block.
pub const BLOCK_TEXELS: usize = 64;

/// Set in a [`BlockKey::chart`] that is a family of slabs, not a chart; the axis is in the low bits.
pub const SLABS: u32 = 1 << 31;

/// Set in a [`BlockKey::chart`] of surfaces seen from behind: light on the two sides of a thing has nothing in common.
pub const BACK: u32 = 1 << 30;

/// A block of 8×8 texels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct BlockKey {
    /// Index of the instance.
    pub instance: u32,
    /// Chart of the instance's set, or [`SLABS`] + axis.
    pub chart: u32,
    /// Texels have an edge of 2^level of the chart's own.
    pub level: i8,
    /// Which slab along the axis, in texels of the level; 0 on a chart.
    pub slab: i32,
    /// Block along x.
    pub x: i32,
    /// Block along y.
    pub y: i32,
}

/// A texel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct TexelKey {
    /// Its block.
    pub block: BlockKey,
    /// Row · 8 + column in the block.
    pub texel: u8,
}

impl BlockKey {
    /// The level `steps` coarser (finer if negative), if both it and this one are levels.
    fn level_at(self, steps: i32) -> Option<i8> {
        let levels = i32::from(FINEST_LEVEL)..=i32::from(COARSEST_LEVEL);
        let (level, other) = (i32::from(self.level), i32::from(self.level) + steps);
        (levels.contains(&level) && levels.contains(&other)).then_some(other as i8)
    }

    /// The blocks of another level that hold what texels of this one could begin with: for `steps` > 0 the one that many levels
    /// coarser, otherwise those so many finer. Empty beyond the coarsest and the finest level.
    pub(super) fn relatives(self, steps: i8) -> impl Iterator<Item = BlockKey> {
        let level = self.level_at(i32::from(steps));
        let (up, down) = (steps.clamp(0, 18), (-steps.max(-18)).max(0));
        let side = 1i32 << down;
        let (slabs, first_slab) = match (self.chart & SLABS, down) {
            (0, _) => (1, 0),
            (_, 0) => (1, self.slab >> up),
            (_, down) => (2, self.slab.wrapping_shl(down as u32).wrapping_add((1 << (down - 1)) - 1)),
        };
        let [x, y] = [self.x, self.y].map(|v| (v >> up).wrapping_shl(down as u32));
        level.into_iter().flat_map(move |level| {
            (0..slabs * side * side).map(move |i| BlockKey {
                level,
                slab: first_slab.wrapping_add(i / (side * side)),
                x: x.wrapping_add(i % side),
                y: y.wrapping_add(i / side % side),
                ..self
            })
        })
    }

    /// The same for all blocks of a square of 2^`up` × 2^`up` on a chart (`up` 0 … 16, more counts as that).
    pub fn square(self, up: u8) -> BlockKey {
        let up = up.min(16);
        BlockKey { x: self.x >> up, y: self.y >> up, ..self }
    }

    /// The texel at x, y of the level, in the same chart (and slab) as this block.
    pub(super) fn texel_at(self, x: i32, y: i32) -> TexelKey {
        let texel = (y.rem_euclid(BLOCK_SIDE) * BLOCK_SIDE + x.rem_euclid(BLOCK_SIDE)) as u8;
        TexelKey { block: BlockKey { x: x >> BLOCK_BITS, y: y >> BLOCK_BITS, ..self }, texel }
    }
}

impl TexelKey {
    /// x and y in texels of the level.
    pub fn xy(&self) -> [i32; 2] {
        let texel = i32::from(self.texel);
        let first = |block: i32| block.wrapping_mul(BLOCK_SIDE);
        [
            first(self.block.x).wrapping_add(texel % BLOCK_SIDE),
            first(self.block.y).wrapping_add(texel / BLOCK_SIDE),
        ]
    }

    /// The texel of a coarser level (`up` levels, 1 … 18) that holds this one; none beyond the coarsest.
    pub fn coarser(&self, up: u8) -> Option<TexelKey> {
        let level = self.block.level_at(i32::from(up))?;
        let [x, y] = self.xy();
        let block = BlockKey { level, slab: self.block.slab >> up, ..self.block };
        Some(block.texel_at(x >> up, y >> up))
    }

    /// The texels of a finer level (`down` levels, 1 … 18) about this one's centre: 4, in slabs 8.
    pub fn finer(&self, down: u8) -> impl Iterator<Item = TexelKey> + use<> {
        let level = self.block.level_at(-i32::from(down)).filter(|_| down > 0);
        // Not used where there is no level.
        let down = down.clamp(1, 18);
        let centre = |v: i32| {
            let v = i64::from(v).saturating_mul(1 << down) + (1 << (down - 1));
            v.clamp(i64::from(i32::MIN) + 1, i64::from(i32::MAX)) as i32
        };
        let [x, y] = self.xy().map(centre);
        let (slabs, slab) = match self.block.chart & SLABS {
            0 => (1, 0),
            _ => (2, centre(self.block.slab)),
        };
        let block = self.block;
        level.into_iter().flat_map(move |level| {
            (0..slabs * 4).map(move |i| {
                let block = BlockKey { level, slab: slab - i / 4, ..block };
                block.texel_at(x - i % 2, y - i / 2 % 2)
            })
        })
    }
}

/// Level of detail of a place: round(log2(bias · footprint / texel)), −6 … 12. `None` where that is no number.
pub fn level_of(footprint_m: f32, texel_m: f32, bias: f32) -> Option<i8> {
    let ratio = bias * footprint_m / texel_m;
    if !ratio.is_finite() || ratio <= 0.0 {
        return None;
    }
    let bits = ratio.to_bits();
    // Exponent, and one more from √2 on: the same as rounding the logarithm, without taking it. Subnormal numbers are below the
    // finest level anyway.
    let exponent = (bits >> 23) as i32 - 127;
    let up = i32::from(bits & 0x007f_ffff > std::f32::consts::SQRT_2.to_bits() & 0x007f_ffff);
    Some((exponent + up).clamp(i32::from(FINEST_LEVEL), i32::from(COARSEST_LEVEL)) as i8)
}

/// The largest integer not above, at the limits of 32 bits where there is none; 0 for what is no number. A good deal quicker
/// than `f32::floor` where that is a call.
pub(super) fn floor(v: f32) -> i32 {
    let towards_zero = v as i32;
    towards_zero.saturating_sub(i32::from(v < towards_zero as f32))
}

/// Edge of a level's texel in texels of the chart.
pub(super) fn edge_of(level: i8) -> f32 {
    f32::from_bits(((127 + i32::from(level)) as u32) << 23)
}

/// A quick hash for keys, the same everywhere.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct KeyHash(u64);

impl BuildHasher for KeyHash {
    type Hasher = KeyHash;

    fn build_hasher(&self) -> KeyHash {
        KeyHash(0)
    }
}

impl Hasher for KeyHash {
    fn finish(&self) -> u64 {
        let mixed = (self.0 ^ self.0 >> 32).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        mixed ^ mixed >> 29
    }

    fn write(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.write_u32(u32::from(byte));
        }
    }

    fn write_u32(&mut self, word: u32) {
        self.0 = (self.0.rotate_left(23) ^ u64::from(word)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    }

    fn write_i32(&mut self, word: i32) {
        self.write_u32(word as u32);
    }

    fn write_i8(&mut self, byte: i8) {
        self.write_u32(byte as u32);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_level_is_the_rounded_logarithm(ratio in 1e-3f32..1e5) {
            let level = level_of(ratio, 1.0, 1.0).unwrap();
            let exact = f64::from(ratio).log2();
            let rounded = exact.round().clamp(-6.0, 12.0);
            prop_assert!(f64::from(level) == rounded || (exact.fract().abs() - 0.5).abs() < 1e-6);
            prop_assert_eq!(edge_of(level), libm::exp2f(f32::from(level)));
        }

        #[test]
        fn coarser_texels_hold_finer_ones(
            x in -100_000i32..100_000, y in -100_000i32..100_000, slab in -100i32..100, level in -5i8..10,
            steps in 1u8..3, slabs: bool,
        ) {
            let (chart, slab) = if slabs { (SLABS + 2, slab) } else { (7, 0) };
            let block = BlockKey { instance: 1, chart, level, slab, x: 0, y: 0 };
            let texel = block.texel_at(x, y);
            prop_assert_eq!(texel.xy(), [x, y]);
            let mut count = 0;
            for finer in texel.finer(steps) {
                prop_assert_eq!(finer.coarser(steps), Some(texel));
                prop_assert!(texel.block.relatives(-(steps as i8)).any(|block| block == finer.block));
                count += 1;
            }
            let expected = if level - (steps as i8) < FINEST_LEVEL { 0 } else if slabs { 8 } else { 4 };
            prop_assert_eq!(count, expected);
            let coarser: Vec<_> = texel.block.relatives(steps as i8).collect();
            prop_assert_eq!(coarser, [texel.coarser(steps).unwrap().block]);
        }
    }

    #[test]
    fn floors() {
        for v in [0.0f32, -0.0, 0.5, -0.5, 1.0, -1.0, -1.5, 8_388_607.5, -8_388_607.5, 2e9, -2e9] {
            assert_eq!(f64::from(floor(v)), f64::from(v).floor(), "{v}");
        }
        assert_eq!([f32::NAN, 1e20, -1e20].map(floor), [0, i32::MAX, i32::MIN]);
    }

    #[test]
    fn no_level_without_a_number_and_ends_at_the_limits() {
        for (footprint, texel) in [(0.0, 1.0), (1.0, 0.0), (f32::NAN, 1.0), (-1.0, 1.0), (f32::INFINITY, 1.0)]
        {
            assert_eq!(level_of(footprint, texel, 1.0), None);
        }
        assert_eq!(level_of(1e-30, 1.0, 1.0), Some(FINEST_LEVEL));
        assert_eq!(level_of(1e30, 1.0, 1.0), Some(COARSEST_LEVEL));
        assert_eq!((level_of(0.1, 0.1, 1.0), level_of(0.1, 0.1, 4.0)), (Some(0), Some(2)));
        let far =
            BlockKey { instance: 0, chart: 0, level: 12, slab: 0, x: 0, y: 0 }.texel_at(i32::MAX, i32::MIN);
        assert_eq!((far.coarser(1), far.xy()), (None, [i32::MAX, i32::MIN]));
        assert_eq!(far.finer(2).count(), 4);
        // Any numbers are a key, if not one of a texel.
        let odd = TexelKey { block: BlockKey { level: -128, ..far.block }, texel: 255 };
        assert_eq!(
            (odd.coarser(130), odd.coarser(255), odd.finer(255).count(), far.finer(0).count()),
            (None, None, 0, 0)
        );
    }
}
