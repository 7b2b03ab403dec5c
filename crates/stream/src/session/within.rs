//! Deltas that may take no more than so many bytes: how far off values may be is raised until they fit.

use super::precision::Precision;
use crate::codec::LEAF;

/// What a delta may take, and where errors show least.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spending<'a> {
    /// Most bytes of the frame. `None` (default): as many as the precision takes.
    pub most_bytes: Option<usize>,
    /// For each 16 points of the store ([`Spending::STRETCH`]) a number of at least 0: where not everything fits, values may be off by
    /// this times a number that is the same for all, and never have to be nearer than the precision asks for. Twice as far from
    /// the eye, an error shows on a quarter of the pixels, so that bits are spent best in proportion to the distance.
    /// Empty, or of another length: 1 everywhere (default).
    pub coarseness: &'a [f32],
    /// By how many steps values of lights may be off before one sees it: index and steps, ascending; those that are not listed, by none (default). Where it lies
    /// what is seen of them ([`Lean`](dapple_store::light_visibility::Lean)) may be a step off, or more where as many steps as there are would not be seen.
    /// Under a limit this is raised as far as it takes (that of those not listed is 1 then), and lights get at most half of the bytes.
    pub light_tolerances: &'a [(u32, u8)],
}

impl Spending<'_> {
    /// Points that share one number of [`Spending::coarseness`].
    pub const STRETCH: usize = LEAF;
}

/// Frames around payloads of deltas take at most so much more.
pub(super) const ENVELOPE_BYTES: usize = 40;
/// Deltas are made at most so often to find one that fits.
const MOST_TRIES: u32 = 8;
/// What fills so much of what it may take is not made again.
const FULL: f64 = 0.85;
/// Multiples that differ by less are the same.
const CLOSE: f32 = 1.1;

/// By which multiple of the coarseness values may be off; 0: by what the precision says.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Pressure(f32);

/// Looks for the smallest pressure under which a delta fits.
pub(super) struct Search {
    at: f32,
    /// Of the pressures that were tried: the largest that was too little, the smallest that was enough.
    too_little: Option<f32>,
    enough: Option<f32>,
    /// The least that makes a difference.
    least: f32,
    tries: u32,
}

impl Search {
    /// `last` is what the delta before took.
    pub(super) fn new(last: Pressure, precision: Precision, coarseness: &[f32]) -> Search {
        // What does not matter at all is infinite.
        let coarsest = coarseness.iter().copied().filter(|c| c.is_finite()).fold(0.0, f32::max);
        let coarsest = if coarsest > 0.0 { coarsest } else { 1.0 };
        let least = (f32::from(precision.tolerance) + 1.0) / coarsest;
        let at = if last.0 < least { 0.0 } else { last.0 };
        Search { at, too_little: None, enough: None, least, tries: 0 }
    }

    pub(super) fn pressure(&self) -> Pressure {
        Pressure(self.at)
    }

    /// What to try after a delta of `bytes` where `most` may be; `None` when there is nothing better to find.
    pub(super) fn next(mut self, bytes: usize, most: usize) -> Option<Search> {
        self.tries += 1;
        if bytes > most {
            self.too_little = Some(self.at);
        } else {
            self.enough = Some(self.at);
            if self.at == 0.0 || bytes as f64 >= FULL * most as f64 {
                return None;
            }
        }
        if self.tries >= MOST_TRIES {
            return None;
        }
        // Bytes fall about as the pressure rises.
        let ratio = (bytes as f32 / most.max(1) as f32).clamp(0.1, 16.0);
        let guess = self.at.max(0.7 * self.least) * ratio;
        self.at = match (self.too_little, self.enough) {
            (Some(low), Some(high)) => {
                let low = low.max(self.least / CLOSE);
                if high <= CLOSE * low {
                    return None;
                }
                (low * high).sqrt()
            }
            // Further each time, so that something is enough in the end.
            (Some(low), None) => guess.max(1.3 * low).max(self.least) * (1 << (self.tries - 1)) as f32,
            (None, Some(high)) => {
                let lower = guess.min(high / 1.3);
                if lower < self.least { 0.0 } else { lower }
            }
            (None, None) => return None,
        };
        Some(self)
    }
}

impl Pressure {
    pub(super) fn is_none(self) -> bool {
        self.0 == 0.0
    }

    /// How far off values may be in each stretch of `points`, and with which step they are said.
    pub(super) fn tolerances(self, precision: Precision, coarseness: &[f32], points: usize) -> (Vec<u8>, u8) {
        let least = f32::from(precision.tolerance);
        // Also what is no number.
        let of = |coarseness: f32| (self.0 * coarseness).min(255.0).max(least) as u8;
        let stretches = points.div_ceil(LEAF);
        let tolerances: Vec<u8> = match coarseness.len() == stretches {
            true => coarseness.iter().map(|c| of(*c)).collect(),
            false => vec![of(1.0); stretches],
        };
        let tightest = tolerances.iter().copied().min().unwrap_or(precision.tolerance).min(127);
        let step = Precision { tolerance: tightest, step: 0 }.in_range().step;
        (tolerances, step.max(precision.step).min(2 * tightest + 1))
    }
}
