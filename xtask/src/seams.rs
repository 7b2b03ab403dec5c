//! Which crate may use which: the tables of `ARCHITECTURE.md` against the manifests.
//!
//! Two tables are read there. `| crate | may use |` names for each crate of the workspace the others that it may
//! depend on (`all`, or `–` for none); `| outside crate | owner |` names for each crate from elsewhere those that
//! may depend on it. Dependencies for tests only are free.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::{Context, Result, bail};
use cargo_metadata::{DependencyKind, Metadata};

use crate::markdown::{code_spans, table};

const FILE: &str = "ARCHITECTURE.md";
const SEAMS_HEAD: [&str; 2] = ["crate", "may use"];
const OWNERS_HEAD: [&str; 2] = ["outside crate", "owner"];
const PACKAGE_PREFIX: &str = "dapple-";

/// The crates of the workspace, each with those it depends on; short names (`scene` for `dapple-scene`).
#[derive(Debug, Default)]
struct Manifests {
    inside: BTreeMap<String, BTreeSet<String>>,
    outside: BTreeMap<String, BTreeSet<String>>,
}

/// Compares the workspace with the tables and prints every edge that they do not allow.
pub(crate) fn check(metadata: &Metadata) -> Result<()> {
    let path = metadata.workspace_root.join(FILE);
    let text = std::fs::read_to_string(&path).with_context(|| format!("cannot read {path}"))?;
    let manifests = manifests(metadata);
    let problems = problems(&text, &manifests)?;
    for problem in &problems {
        eprintln!("{problem}");
    }
    if !problems.is_empty() {
        bail!("{} dependencies and {FILE} disagree: change one or the other", problems.len());
    }
    let count = |edges: &BTreeMap<String, BTreeSet<String>>| edges.values().map(BTreeSet::len).sum::<usize>();
    println!(
        "{} crates: {} dependencies inside and {} outside are as {FILE} says",
        manifests.inside.len(),
        count(&manifests.inside),
        count(&manifests.outside)
    );
    Ok(())
}

fn manifests(metadata: &Metadata) -> Manifests {
    let packages = metadata.workspace_packages();
    let members: BTreeSet<&str> = packages.iter().map(|package| package.name.as_str()).collect();
    let mut manifests = Manifests::default();
    for package in &packages {
        let inside = manifests.inside.entry(short(&package.name)).or_default();
        let outside = manifests.outside.entry(short(&package.name)).or_default();
        for dependency in package.dependencies.iter().filter(|d| d.kind != DependencyKind::Development) {
            if members.contains(dependency.name.as_str()) {
                inside.insert(short(&dependency.name));
            } else {
                outside.insert(dependency.name.clone());
            }
        }
    }
    manifests
}

fn short(package: &str) -> String {
    package.strip_prefix(PACKAGE_PREFIX).unwrap_or(package).to_owned()
}

/// What one row allows.
struct Permission {
    all: bool,
    names: BTreeSet<String>,
    line: usize,
}

impl Permission {
    fn allows(&self, name: &str) -> bool {
        self.all || self.names.contains(name)
    }
}

/// Every disagreement, one sentence each.
fn problems(architecture: &str, manifests: &Manifests) -> Result<Vec<String>> {
    let mut problems = Vec::new();
    let seams = permissions(architecture, SEAMS_HEAD, &mut problems)?;
    let owners = permissions(architecture, OWNERS_HEAD, &mut problems)?;

    for (from, used) in &manifests.inside {
        let Some(row) = seams.get(from) else {
            problems.push(format!(
                "`{from}` has no row in the table of crates: add one that says what it may use"
            ));
            continue;
        };
        for to in used.iter().filter(|to| !row.allows(to)) {
            problems
                .push(format!("`{from}` uses `{to}`, which its row does not allow ({FILE}:{})", row.line));
        }
    }
    for (name, row) in &seams {
        if !manifests.inside.contains_key(name) {
            problems.push(format!("{FILE}:{}: there is no crate `{name}`: remove its row", row.line));
        }
        for to in row.names.iter().filter(|to| !manifests.inside.contains_key(*to)) {
            problems.push(format!("{FILE}:{}: `{name}` may use `{to}`, which does not exist", row.line));
        }
    }

    let mut used_anywhere = BTreeSet::new();
    for (from, used) in &manifests.outside {
        for to in used {
            used_anywhere.insert(to);
            match owners.get(to) {
                None => problems.push(format!(
                    "`{from}` uses `{to}`, which has no owner: add it to the table of outside crates"
                )),
                Some(row) if !row.allows(from) => problems.push(format!(
                    "`{from}` uses `{to}`, which belongs to {} ({FILE}:{})",
                    row.names.iter().map(|n| format!("`{n}`")).collect::<Vec<_>>().join(", "),
                    row.line
                )),
                Some(_) => {}
            }
        }
    }
    for (name, row) in owners.iter().filter(|(name, _)| !used_anywhere.contains(name)) {
        problems.push(format!("{FILE}:{}: nothing uses `{name}` any more: remove it", row.line));
    }
    Ok(problems)
}

/// The rows of a table by the names in their first cell; a name that has two rows is a problem.
fn permissions(
    text: &str,
    head: [&str; 2],
    problems: &mut Vec<String>,
) -> Result<BTreeMap<String, Permission>> {
    let rows =
        table(text, &head).with_context(|| format!("{FILE} has no table `| {} | {} |`", head[0], head[1]))?;
    let mut permissions = BTreeMap::new();
    for row in rows {
        let [subject, allowed, ..] = row.cells.as_slice() else {
            problems.push(format!("{FILE}:{}: the row needs at least two cells", row.line));
            continue;
        };
        for name in code_spans(subject) {
            let names = code_spans(allowed).map(str::to_owned).collect();
            let permission = Permission { all: allowed == "all", names, line: row.line };
            if permissions.insert(name.to_owned(), permission).is_some() {
                problems.push(format!("{FILE}:{}: `{name}` has a row already", row.line));
            }
        }
    }
    Ok(permissions)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLES: &str = "\
| crate | may use | because |
|---|---|---|
| `scene` | – | |
| `trace` | `scene` | |
| `app` | all | |

| outside crate | owner |
|---|---|
| `glam`, `rayon` | all |
| `gltf` | `scene` |
";

    fn edges(inside: &[(&str, &[&str])], outside: &[(&str, &[&str])]) -> Manifests {
        let map = |edges: &[(&str, &[&str])]| {
            edges
                .iter()
                .map(|(k, v)| ((*k).to_owned(), v.iter().map(|v| (*v).to_owned()).collect()))
                .collect()
        };
        Manifests { inside: map(inside), outside: map(outside) }
    }

    fn allowed() -> Manifests {
        edges(
            &[("scene", &[]), ("trace", &["scene"]), ("app", &["scene", "trace"])],
            &[("scene", &["glam", "gltf"]), ("trace", &["glam", "rayon"])],
        )
    }

    #[test]
    fn what_the_tables_allow_passes() {
        assert_eq!(problems(TABLES, &allowed()).unwrap(), Vec::<String>::new());
    }

    #[test]
    fn a_forbidden_edge_is_named_with_its_row() {
        let mut manifests = allowed();
        manifests.inside.insert("scene".into(), ["trace".to_owned()].into());
        assert_eq!(
            problems(TABLES, &manifests).unwrap(),
            ["`scene` uses `trace`, which its row does not allow (ARCHITECTURE.md:3)"]
        );
    }

    #[test]
    fn an_outside_crate_of_another_owner_is_named() {
        let mut manifests = allowed();
        manifests.outside.insert("trace".into(), ["gltf".to_owned(), "rayon".to_owned()].into());
        assert_eq!(
            problems(TABLES, &manifests).unwrap(),
            ["`trace` uses `gltf`, which belongs to `scene` (ARCHITECTURE.md:10)"]
        );
    }

    #[test]
    fn crates_and_rows_must_match() {
        let mut manifests = allowed();
        manifests.inside.insert("new".into(), BTreeSet::new());
        manifests.inside.remove("trace");
        manifests.outside.remove("trace");
        manifests.outside.insert("new".into(), ["serde".to_owned()].into());
        let found = problems(TABLES, &manifests).unwrap();
        let expected = [
            "`new` has no row",
            "there is no crate `trace`",
            "`new` uses `serde`, which has no owner",
            "nothing uses `rayon`",
        ];
        for part in expected {
            assert!(found.iter().any(|problem| problem.contains(part)), "{part}: {found:?}");
        }
        assert_eq!(found.len(), expected.len(), "{found:?}");
    }

    #[test]
    fn a_missing_table_and_a_second_row_are_errors() {
        assert!(problems("no table", &allowed()).is_err());
        let twice = TABLES.replace("| `app` |", "| `scene` | all | |\n| `app` |");
        assert!(problems(&twice, &allowed()).unwrap()[0].contains("`scene` has a row already"));
    }

    #[test]
    fn names_are_short() {
        assert_eq!(short("dapple-scene"), "scene");
        assert_eq!(short("dapple"), "dapple");
    }
}
