//! What `dapple eval` does with files: metrics of pictures, and reports made again; and truth alone.

mod compare;
mod diff;
mod folder;
mod measure;
mod read;

use anyhow::Result;

use super::{reference, report};
use crate::args::EvalVerb;

/// Does what the verb says.
pub(crate) fn run(verb: &EvalVerb) -> Result<()> {
    match verb {
        EvalVerb::Diff(args) => diff::run(args),
        EvalVerb::Compare(args) => compare::run(args),
        EvalVerb::Reference(args) => reference::run(args),
        EvalVerb::Report(args) => report::rebuild(&args.results, args.output.as_deref()),
    }
}
