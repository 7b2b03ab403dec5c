//! Numbers that samples are drawn with: they depend on a seed, a place, a frame and an index, and on nothing else.

use crate::sampling::{hash, unit_interval};

/// How the numbers of a place's samples relate to each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sequence {
    /// Not at all.
    Random,
    /// Points of a lattice that fills the cube evenly however many there are, moved by a random offset of each place (\[Roberts2018\]). The index
    /// goes on over frames, so that what frames average to gets better as more samples of one frame would.
    #[default]
    Lattice,
}

/// Reciprocal powers of the root of x⁴ = x + 1, the golden ratio's relative in three dimensions, in units of 2⁻⁶⁴.
const LATTICE: [u64; 3] = [0xd1b5_4a32_d192_ed03, 0xabc9_8388_fb8f_ac02, 0x8cb9_2ba7_2f3d_8dd7];

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
