//! `dapple eval diff` and `dapple eval compare`: metrics of pictures that are files.

mod compare;
mod diff;
mod folder;
mod interval;
mod measure;
mod read;

use anyhow::Result;

use crate::args::EvalVerb;

/// Does what the verb says.
pub(crate) fn run(verb: &EvalVerb) -> Result<()> {
    match verb {
        EvalVerb::Diff(args) => diff::run(args),
        EvalVerb::Compare(args) => compare::run(args),
    }
}
