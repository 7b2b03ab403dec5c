//! The rules, one function each.

use std::collections::BTreeSet;

use super::{File, Finding};
use crate::markdown::{code_spans, links, table};

/// Longest source file, in lines; above [`WARN_LINES`] there is a warning.
pub(super) const MAX_LINES: usize = 600;
pub(super) const WARN_LINES: usize = 500;
/// Largest golden image.
pub(super) const MAX_GOLDEN_BYTES: usize = 16 * 1024;
/// The table of papers, and the columns it begins with.
pub(super) const PAPERS: &str = "docs/papers.md";
const PAPERS_HEAD: [&str; 2] = ["section", "folder"];

/// All findings of all rules.
pub(super) fn apply(files: &[File]) -> Vec<Finding> {
    let mut findings = Vec::new();
    for file in files {
        golden_size(file, &mut findings);
        let Some(text) = &file.text else { continue };
        if file.has_extension("rs") {
            head(file, text, &mut findings);
            unfinished(file, text, &mut findings);
            ignored_without_reason(file, text, &mut findings);
        }
        if ["rs", "wgsl", "js", "sh"].iter().any(|e| file.has_extension(e)) {
            length(file, text, &mut findings);
        }
        trailing_space(file, text, &mut findings);
        machine_paths(file, text, &mut findings);
    }
    dead_links(files, &mut findings);
    methods_without_readme(files, &mut findings);
    findings
}

fn error(file: &File, line: usize, message: impl Into<String>) -> Finding {
    Finding { path: file.path.clone(), line: Some(line), message: message.into(), warning: false }
}

/// A Rust file says in its first line what it is.
pub(super) fn head(file: &File, text: &str, findings: &mut Vec<Finding>) {
    let first = text.lines().next().unwrap_or_default();
    if first.strip_prefix("//! ").is_none_or(|sentence| sentence.trim().is_empty()) {
        findings.push(error(file, 1, "the first line must be a `//!` sentence that says what the file is"));
    }
}

/// Files stay short enough to read at one go.
pub(super) fn length(file: &File, text: &str, findings: &mut Vec<Finding>) {
    let lines = text.lines().count();
    if lines > WARN_LINES {
        findings.push(Finding {
            path: file.path.clone(),
            line: None,
            message: format!("{lines} lines; split it (more than {MAX_LINES} is an error)"),
            warning: lines <= MAX_LINES,
        });
    }
}

/// No space at the end of a line, and a newline at the end of the file.
pub(super) fn trailing_space(file: &File, text: &str, findings: &mut Vec<Finding>) {
    for (index, line) in text.split('\n').enumerate() {
        if line.ends_with([' ', '\t', '\r']) {
            findings.push(error(file, index + 1, "space at the end of the line"));
        }
    }
    if !text.is_empty() && !text.ends_with('\n') {
        findings.push(error(file, text.lines().count(), "no newline at the end of the file"));
    }
}

/// Folders that are someone's own on some machine.
const MACHINE_FOLDERS: [&str; 4] = ["home", "root", "Users", "work"];

/// No absolute path of a home or work folder: it would mean nothing to others.
pub(super) fn machine_paths(file: &File, text: &str, findings: &mut Vec<Finding>) {
    for (index, line) in text.lines().enumerate() {
        for folder in MACHINE_FOLDERS {
            let path = format!("/{folder}/");
            let found = line.match_indices(&path).any(|(at, _)| {
                // Part of a longer, relative path or of an address otherwise.
                !line[..at].ends_with(|c: char| c.is_alphanumeric() || "._-~}*".contains(c))
            });
            if found || line.contains(&path.replace('/', "\\")) {
                findings.push(error(file, index + 1, format!("a path of one machine: `{path}...`")));
            }
        }
    }
}

/// No code that only promises to be written.
pub(super) fn unfinished(file: &File, text: &str, findings: &mut Vec<Finding>) {
    for (index, line) in text.lines().enumerate() {
        // The names are put together so that this file passes.
        for name in [concat!("todo", "!"), concat!("unimplemented", "!")] {
            if line.contains(name) && !line.trim_start().starts_with("//") {
                findings.push(error(
                    file,
                    index + 1,
                    format!("`{name}` is not code: finish it or leave it out"),
                ));
            }
        }
    }
}

/// A test that does not run says why.
pub(super) fn ignored_without_reason(file: &File, text: &str, findings: &mut Vec<Finding>) {
    for (index, line) in text.lines().enumerate() {
        if line.trim() == concat!("#[", "ignore]") {
            findings.push(error(file, index + 1, "an ignored test needs a reason: #[ignore = \"why\"]"));
        }
    }
}

/// Golden images stay small.
pub(super) fn golden_size(file: &File, findings: &mut Vec<Finding>) {
    let golden = file.path.split('/').rev().nth(1) == Some("golden");
    if golden && file.has_extension("png") && file.size_bytes > MAX_GOLDEN_BYTES {
        let message = format!("{} bytes; a golden image has at most {MAX_GOLDEN_BYTES}", file.size_bytes);
        findings.push(Finding { path: file.path.clone(), line: None, message, warning: false });
    }
}

/// Relative links in Markdown lead to tracked files or folders.
pub(super) fn dead_links(files: &[File], findings: &mut Vec<Finding>) {
    let known = known_paths(files);
    for file in files.iter().filter(|f| f.has_extension("md")) {
        for (line, target) in links(file.text.as_deref().unwrap_or_default()) {
            let outside = target.contains("://") || target.starts_with("mailto:") || target.starts_with('#');
            let path = target.split('#').next().unwrap_or_default();
            if !outside && !resolve(&file.path, path).is_some_and(|path| known.contains(&path)) {
                findings.push(error(
                    file,
                    line,
                    format!("the link `{target}` leads nowhere in this repository"),
                ));
            }
        }
    }
}

/// A folder that implements a section of a paper exists and has a `README.md`, or its crate's own part above it has.
pub(super) fn methods_without_readme(files: &[File], findings: &mut Vec<Finding>) {
    let known = known_paths(files);
    let Some(papers) = files.iter().find(|f| f.path == PAPERS) else { return };
    let text = papers.text.as_deref().unwrap_or_default();
    let Some(rows) = table(text, &PAPERS_HEAD) else {
        let head = PAPERS_HEAD.join(" | ");
        findings.push(error(papers, 1, format!("no table `| {head} |`")));
        return;
    };
    for row in rows {
        for folder in row.cells.get(1).into_iter().flat_map(|cell| code_spans(cell)) {
            if !known.contains(folder) {
                findings.push(error(papers, row.line, format!("there is no folder `{folder}`")));
            } else if !readmes(folder).any(|readme| known.contains(&readme)) {
                findings.push(error(
                    papers,
                    row.line,
                    format!("`{folder}` implements a paper and has no README.md"),
                ));
            }
        }
    }
}

/// Where a folder's document may lie: in it or above it, but not above its crate (`crates/name`).
fn readmes(folder: &str) -> impl Iterator<Item = String> {
    let parts: Vec<&str> = folder.split('/').collect();
    (2..=parts.len()).rev().map(move |n| format!("{}/README.md", parts[..n].join("/")))
}

/// All tracked files and the folders that hold them; the root is the empty path.
fn known_paths(files: &[File]) -> BTreeSet<String> {
    let mut known = BTreeSet::new();
    for file in files {
        let mut path = file.path.as_str();
        known.insert(path.to_owned());
        while let Some((folder, _)) = path.rsplit_once('/') {
            known.insert(folder.to_owned());
            path = folder;
        }
    }
    known.insert(String::new());
    known
}

/// `target` as seen from the file `from`, as a path from the root; `None` if it leaves the root.
fn resolve(from: &str, target: &str) -> Option<String> {
    let mut parts: Vec<&str> = from.split('/').collect();
    parts.pop();
    for part in target.split('/') {
        match part {
            "" | "." => {}
            ".." => {
                parts.pop()?;
            }
            name => parts.push(name),
        }
    }
    Some(parts.join("/"))
}
