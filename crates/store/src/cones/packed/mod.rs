//! Entries in few bits: the paper's 286 ([Stadlbauer2023] sec. 3.3), and ours with finer angles and with lights.

mod bits;
mod floats;
mod moment;
mod paper;
#[cfg(test)]
mod tests;

pub use floats::{energy_from_bits, energy_to_bits};
pub use moment::PackedMoment;
pub use paper::{PAPER_BITS, PackedPaper};
