//! Folders of pictures: which belong together, and in which order.

use std::cmp::Ordering;
use std::collections::BTreeSet;
use std::path::Path;

use anyhow::{Context, Result, bail};

use super::read::ENDINGS;

/// Names of pictures that all folders have, in the order of [`natural`], and names that only some have.
pub(super) struct Names {
    pub(super) common: Vec<String>,
    pub(super) left_out: Vec<String>,
}

impl Names {
    pub(super) fn of(folders: &[&Path]) -> Result<Names> {
        let sets: Vec<BTreeSet<String>> = folders.iter().map(|f| pictures(f)).collect::<Result<_>>()?;
        let all: BTreeSet<&String> = sets.iter().flatten().collect();
        let (common, left_out): (Vec<_>, Vec<_>) =
            all.into_iter().cloned().partition(|name| sets.iter().all(|set| set.contains(name)));
        let mut names = Names { common, left_out };
        names.common.sort_by(|a, b| natural(a, b));
        names.left_out.sort_by(|a, b| natural(a, b));
        if names.common.is_empty() {
            let listed: Vec<String> = folders.iter().map(|f| f.display().to_string()).collect();
            bail!("no picture has the same name in each of {}", listed.join(", "));
        }
        Ok(names)
    }
}

/// Names of the pictures right in a folder.
fn pictures(folder: &Path) -> Result<BTreeSet<String>> {
    let context = || format!("cannot read the folder {}", folder.display());
    if folder.is_file() {
        bail!("{} is no folder: compare two pictures with `dapple eval diff`", folder.display());
    }
    let mut names = BTreeSet::new();
    for entry in std::fs::read_dir(folder).with_context(context)? {
        let path = entry.with_context(context)?.path();
        let is_picture =
            path.extension().is_some_and(|e| ENDINGS.iter().any(|ending| e.eq_ignore_ascii_case(ending)));
        if is_picture && path.is_file() {
            // A name that is no text cannot be told apart in tables and files.
            names.extend(path.file_name().and_then(|name| name.to_str()).map(str::to_owned));
        }
    }
    if names.is_empty() {
        bail!("{} holds no pictures ({})", folder.display(), ENDINGS.join(", "));
    }
    Ok(names)
}

/// As people count: runs of digits by their number, the rest by its letters.
pub(super) fn natural(a: &str, b: &str) -> Ordering {
    let (mut a_rest, mut b_rest) = (a, b);
    loop {
        let ((a_text, a_digits), (b_text, b_digits)) = (split(&mut a_rest), split(&mut b_rest));
        let number = |digits: &str| digits.trim_start_matches('0').len();
        let order = a_text
            .cmp(b_text)
            .then_with(|| number(a_digits).cmp(&number(b_digits)))
            .then_with(|| a_digits.trim_start_matches('0').cmp(b_digits.trim_start_matches('0')));
        if order != Ordering::Equal || a_rest.is_empty() && b_rest.is_empty() {
            return order.then_with(|| a.cmp(b));
        }
    }
}

/// Takes what is in front of the next digits, and those, off `rest`.
fn split<'a>(rest: &mut &'a str) -> (&'a str, &'a str) {
    let (text, tail) = rest.split_at(rest.find(|c: char| c.is_ascii_digit()).unwrap_or(rest.len()));
    let (digits, tail) = tail.split_at(tail.find(|c: char| !c.is_ascii_digit()).unwrap_or(tail.len()));
    *rest = tail;
    (text, digits)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_follow_one_another_as_people_count() {
        let mut names = [
            "f10.png",
            "f9.png",
            "f1.png",
            "a2-b10",
            "a2-b9",
            "f010.png",
            "f",
            "9999999999999999999999",
            "10",
        ];
        names.sort_by(|a, b| natural(a, b));
        let expected = [
            "10",
            "9999999999999999999999",
            "a2-b9",
            "a2-b10",
            "f",
            "f1.png",
            "f9.png",
            "f010.png",
            "f10.png",
        ];
        assert_eq!(names, expected);
        assert_eq!(natural("x1", "x1"), Ordering::Equal);
    }
}
