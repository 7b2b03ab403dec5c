//! Numbers that samples are drawn with: they depend on a seed, a place, a frame and an index, and on nothing else.

use crate::sampling::{hash, unit_interval};

/// How the numbers of a place's samples relate to each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sequence {
    /// Not at all.
    Random,
    /// Points of a lattice that fills the cube, and each of its sides, evenly however many there are, moved by a random offset of each place. The index
    /// goes on over frames, so that what frames average to gets better as more samples of one frame would.
    #[default]
    Lattice,
}

/// Steps of the lattice along its dimensions, in units of 2⁻⁶⁴: 0.70758825, 0.77398938, 0.63920735. Found by a search for those of the least discrepancy
/// (that of distances around the corners: `README.md`) of 3 to 4096 points in every projection. Powers of the root of x⁴ = x + 1 (\[Roberts2018\]) are as good where three dimensions count,
/// but thrice their second is 2.013: 24 points lie there in three runs, with a quarter of the range open between any two.
const LATTICE: [u64; 3] = [0xb524_80fa_ca8b_f001, 0xc624_2b11_d965_0001, 0xa3a3_17b3_b838_d001];

/// The numbers of one place in one frame.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Draws {
    Random { stream: u64 },
    Lattice { offset: [u64; 3], first: u64 },
}

impl Draws {
    /// Of a place that draws `count` samples a frame.
    pub(crate) fn new(sequence: Sequence, seed: u64, site: u64, frame: u64, count: u32) -> Draws {
        match sequence {
            Sequence::Random => Draws::Random { stream: stream(seed, site, frame, 0) },
            Sequence::Lattice => Draws::Lattice {
                offset: [0, 1, 2].map(|d| u64::from(hash(seed, site, d)) << 32),
                first: frame.wrapping_mul(u64::from(count)),
            },
        }
    }

    /// Those of sample `index` of the frame, each in `[0, 1)`.
    pub(crate) fn at(&self, index: u32) -> [f32; 3] {
        match self {
            Draws::Random { stream } => [0, 1, 2].map(|d| unit_interval(hash(*stream, u64::from(index), d))),
            Draws::Lattice { offset, first } => {
                let index = first.wrapping_add(u64::from(index));
                [0, 1, 2].map(|d| {
                    let at = offset[d].wrapping_add(index.wrapping_mul(LATTICE[d]));
                    unit_interval((at >> 32) as u32)
                })
            }
        }
    }
}

/// A seed for one place, frame and purpose.
pub(super) fn stream(seed: u64, site: u64, frame: u64, purpose: u32) -> u64 {
    let frame_seed = u64::from(hash(seed, frame, purpose)) << 32 | u64::from(hash(!seed, frame, purpose));
    u64::from(hash(frame_seed, site, 0)) << 32 | u64::from(hash(frame_seed, site, 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Along every dimension no gap is much wider than the mean, however many points there are.
    #[test]
    fn a_lattice_fills_its_sides() {
        let draws = Draws::new(Sequence::Lattice, 3, 5, 0, 1);
        for n in [2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 128, 256, 512, 1024, 4096] {
            for d in 0..3 {
                let mut places: Vec<f32> = (0..n).map(|i| draws.at(i)[d]).collect();
                places.sort_by(f32::total_cmp);
                let around = places[0] + 1.0 - places[n as usize - 1];
                let gap = places.windows(2).map(|pair| pair[1] - pair[0]).fold(around, f32::max);
                assert!(gap * (n as f32) < 3.0, "{n} points, dimension {d}: {}", gap * n as f32);
            }
        }
    }
}
