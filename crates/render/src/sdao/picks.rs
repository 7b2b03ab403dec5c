//! Which samples of a stochastic depth map keep a fragment.

use crate::noise::hash;

/// Bits of a depth that do not take part in choosing: a card's depths differ from the rasteriser's in the last ones.
const DEPTH_BITS_LEFT_OUT: u32 = 8;

/// How the samples that keep a fragment are chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Picks {
    /// ⌊α S + ξ⌋ samples, any set of that size alike (\[Vermeer2021\] Alg. 1).
    #[default]
    Stratified,
    /// Each sample by itself with probability α (sec. 3.1, "the fastest and easiest").
    Independent,
}

/// Random bits of a fragment: of its column and row, of what its depth's sign, exponent and 15 leading bits are, of a seed, and of what they are for.
///
/// Whole numbers alone, all of which a fragment shader has (`position` and `bitcast`).
pub(super) fn fragment_bits(at: [u32; 2], depth: f32, seed: u32, purpose: u32) -> u32 {
    hash([seed, purpose, at[0], at[1], depth.to_bits() >> DEPTH_BITS_LEFT_OUT])
}

/// All sets of samples, by size.
pub(super) struct Subsets {
    /// Of each size its first entry in `masks`; one more at the end.
    starts: Vec<u32>,
    masks: Vec<u16>,
}

impl Subsets {
    /// Of `samples` (at most 16) samples.
    pub(super) fn new(samples: u32) -> Subsets {
        let mut masks: Vec<u16> = (0..1u32 << samples).map(|mask| mask as u16).collect();
        masks.sort_by_key(|mask| mask.count_ones());
        let start = |size: u32| masks.partition_point(|mask| mask.count_ones() < size) as u32;
        let starts = (0..=samples + 1).map(start).collect();
        Subsets { starts, masks }
    }

    /// One of so many samples, each set for as many of the 2³² values of `bits`, up to one.
    pub(super) fn pick(&self, size: u32, bits: u32) -> u16 {
        let (start, end) = (self.starts[size as usize], self.starts[size as usize + 1]);
        // The upper word of a product, in words: a shader has no longer ones. There are less than 2^16 sets.
        let count = end - start;
        let chosen = ((bits >> 16) * count + (((bits & 0xffff) * count) >> 16)) >> 16;
        self.masks[(start + chosen) as usize]
    }
}

/// Chooses samples for fragments.
pub(super) struct Chooser {
    picks: Picks,
    samples: u32,
    /// α in 2⁻²⁴.
    alpha: u32,
    /// ⌊α S⌋, and what is left, in 2⁻²⁴.
    whole: u32,
    part: u32,
    subsets: Subsets,
    seed: u32,
}

/// What a card chooses by.
#[cfg(feature = "gpu")]
pub(crate) struct ChoiceTable {
    /// α in 2⁻²⁴.
    pub(crate) alpha: u32,
    /// ⌊α S⌋, and what is left, in 2⁻²⁴.
    pub(crate) whole: u32,
    pub(crate) part: u32,
    /// Of each size of sets the first in `masks`; one more at the end.
    pub(crate) starts: Vec<u32>,
    pub(crate) masks: Vec<u16>,
}

#[cfg(feature = "gpu")]
impl ChoiceTable {
    pub(crate) fn new(params: &super::MapParams) -> ChoiceTable {
        let Chooser { alpha, whole, part, subsets, .. } =
            Chooser::new(params.picks, params.samples, params.alpha, params.seed);
        ChoiceTable { alpha, whole, part, starts: subsets.starts, masks: subsets.masks }
    }
}

impl Chooser {
    /// `samples` is 1 … 16, `alpha` 0 … 1.
    pub(super) fn new(picks: Picks, samples: u32, alpha: f32, seed: u32) -> Chooser {
        let fixed = |part: f64| (part * f64::from(1u32 << 24)).round() as u32;
        // Rounding keeps α = 0.1 of 10 samples from being less than one.
        let expected = fixed(f64::from(alpha) * f64::from(samples));
        Chooser {
            picks,
            samples,
            alpha: fixed(alpha.into()),
            whole: expected >> 24,
            part: expected & 0x00ff_ffff,
            subsets: Subsets::new(samples),
            seed,
        }
    }

    /// A bit for each sample that keeps the fragment.
    pub(super) fn mask(&self, at: [u32; 2], depth: f32) -> u16 {
        match self.picks {
            Picks::Stratified => {
                // Eq. 1: ⌊α S + ξ⌋ is one more than ⌊α S⌋ for ξ in the last part of [0, 1), or, just as likely, in the first.
                let xi = fragment_bits(at, depth, self.seed, 0) >> 8;
                let size = self.whole + u32::from(xi < self.part);
                self.subsets.pick(size, fragment_bits(at, depth, self.seed, 1))
            }
            Picks::Independent => (0..self.samples).fold(0, |mask, sample| {
                let xi = fragment_bits(at, depth, self.seed, 2 + sample) >> 8;
                mask | u16::from(xi < self.alpha) << sample
            }),
        }
    }
}
