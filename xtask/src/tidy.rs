//! Rules on the tracked files that neither rustfmt nor clippy knows.
//!
//! Each rule is a function of files to findings, so that a test can show it failing.

mod rules;
#[cfg(test)]
mod tests;

use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail};

/// A tracked file, as the rules see it.
#[derive(Debug, Clone)]
struct File {
    /// Path from the root, with `/`.
    path: String,
    /// Length of the file.
    size_bytes: usize,
    /// Its text; `None` if it is not UTF-8.
    text: Option<String>,
}

impl File {
    fn has_extension(&self, extension: &str) -> bool {
        Path::new(&self.path).extension().is_some_and(|e| e == extension)
    }
}

/// What a rule found.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Finding {
    path: String,
    /// Line number from 1; `None` where the whole file is meant.
    line: Option<usize>,
    message: String,
    /// A warning is printed, but passes.
    warning: bool,
}

impl std::fmt::Display for Finding {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}", self.path)?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
        }
        write!(f, ": {}{}", if self.warning { "warning: " } else { "" }, self.message)
    }
}

/// Applies all rules to the tracked files under `root` and prints what they find.
pub(crate) fn check(root: &Path) -> Result<()> {
    let files = tracked_files(root)?;
    let findings = rules::apply(&files);
    for finding in &findings {
        eprintln!("{finding}");
    }
    let errors = findings.iter().filter(|f| !f.warning).count();
    if errors > 0 {
        bail!("{errors} finding(s) in {} files", files.len());
    }
    println!("{} files are tidy", files.len());
    Ok(())
}

fn tracked_files(root: &Path) -> Result<Vec<File>> {
    // The checkout may belong to another user, as it does in many containers; it is only listed.
    let output = Command::new("git")
        .args(["-c", "safe.directory=*", "ls-files", "-z"])
        .current_dir(root)
        .stdin(Stdio::null())
        .output()
        .context("cannot start git, which lists the files to look at: install it")?;
    if !output.status.success() {
        bail!(
            "`git ls-files` failed, and only tracked files are looked at: {}",
            String::from_utf8_lossy(&output.stderr).trim()
        );
    }
    let list = String::from_utf8(output.stdout).context("a tracked file's name is not UTF-8: rename it")?;
    let mut files = Vec::new();
    for path in list.split_terminator('\0') {
        let full = root.join(path);
        // Deleted, but not yet in the index.
        if !full.exists() {
            continue;
        }
        let bytes = std::fs::read(&full).with_context(|| format!("cannot read {path}"))?;
        // Fuzz input is data even where its bytes happen to be text; what others wrote stays as they wrote it.
        let is_data = path.starts_with("fuzz/corpus/") || path.contains("/vendor/");
        files.push(File {
            path: path.to_owned(),
            size_bytes: bytes.len(),
            text: String::from_utf8(bytes).ok().filter(|_| !is_data),
        });
    }
    Ok(files)
}
