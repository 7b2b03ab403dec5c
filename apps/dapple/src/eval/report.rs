//! Temporary.
use super::results::Results;
use anyhow::Result;
use std::path::Path;
pub(super) fn html(results: &Results, _folder: &Path) -> Result<String> {
    Ok(super::table::markdown(results))
}
