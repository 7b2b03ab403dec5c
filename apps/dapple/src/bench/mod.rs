//! `dapple bench`: a live server under many viewers, over a narrow link, and for a long while.

mod join;
mod served;
mod shaper;
mod soak;
mod swarm;
mod viewers;

use anyhow::Result;

use crate::args::{Bench, BenchArgs};

/// Measures what the arguments name.
pub(crate) fn run(args: &BenchArgs) -> Result<()> {
    match &args.what {
        Bench::Viewers(args) => viewers::run(args),
        Bench::Join(args) => join::run(args),
        Bench::Soak(args) => soak::run(args),
    }
}

/// The value below which a part of the sorted numbers lies.
fn percentile(sorted: &[f64], part: f64) -> f64 {
    let last = sorted.len().saturating_sub(1);
    sorted.get(((last as f64) * part).round() as usize).copied().unwrap_or(0.0)
}
