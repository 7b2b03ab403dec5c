//! `target/bench.json`: one object with a section for each bench, each written by its own run.

use std::path::Path;

use anyhow::{Context, Result};
use serde_json::{Map, Value};

/// Where benches write unless told otherwise.
pub(crate) const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../target/bench.json");

/// Puts a bench's section into the file and keeps the others'.
pub(crate) fn merge(path: &Path, bench: &str, section: Value) -> Result<()> {
    let mut sections = read(path)?;
    sections.insert(bench.to_owned(), section);
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)
            .with_context(|| format!("cannot make the folder {}", folder.display()))?;
    }
    std::fs::write(path, serde_json::to_vec_pretty(&Value::Object(sections))?)
        .with_context(|| format!("cannot write {}", path.display()))?;
    let shown = std::fs::canonicalize(path).unwrap_or(path.to_owned());
    println!("\nwritten to {} as \"{bench}\"", shown.display());
    Ok(())
}

/// The sections there are: none if the file is missing, or holds anything else than sections.
fn read(path: &Path) -> Result<Map<String, Value>> {
    let text = match std::fs::read(path) {
        Ok(text) => text,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Map::new()),
        Err(error) => return Err(error).with_context(|| format!("cannot read {}", path.display())),
    };
    match serde_json::from_slice(&text) {
        Ok(Value::Object(sections)) if sections.values().all(Value::is_object) => Ok(sections),
        _ => {
            println!("\n{} holds something else than benches' sections: it is replaced", path.display());
            Ok(Map::new())
        }
    }
}
