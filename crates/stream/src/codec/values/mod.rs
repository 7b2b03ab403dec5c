//! Values of points ⇄ choices: foretold from neighbours, and what is left as few small numbers.

mod delta;
#[cfg(feature = "publish")]
mod goal;
mod near;
mod nearest;
mod ranks;
mod snapshot;
mod start;

#[cfg(feature = "publish")]
pub(crate) use delta::LEAF;
pub use delta::ValueChange;
pub(crate) use delta::{Guide, MOST_FOLLOW, Scale, Scratch, code_changes};
#[cfg(feature = "publish")]
pub(crate) use goal::{Fit, Goal, Tolerances};
pub(crate) use near::{BLOCK, Back, Near, SHARES};
pub(crate) use nearest::Candidates;
pub(crate) use snapshot::code_values;
pub use start::first_chances;
