//! Every rule, shown failing and passing.

use super::rules::{self, MAX_GOLDEN_BYTES, MAX_LINES, PAPERS, WARN_LINES};
use super::{File, Finding};

fn file(path: &str, text: &str) -> File {
    File { path: path.to_owned(), size_bytes: text.len(), text: Some(text.to_owned()) }
}

/// Findings of all rules on one file, as the messages that are printed.
fn check(path: &str, text: &str) -> Vec<String> {
    check_all(&[file(path, text)])
}

fn check_all(files: &[File]) -> Vec<String> {
    rules::apply(files).iter().map(Finding::to_string).collect()
}

#[track_caller]
fn assert_finds(found: &[String], place: &str, part: &str) {
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(found[0].starts_with(&format!("{place}: ")) && found[0].contains(part), "{found:?}");
}

const NOTHING: [&str; 0] = [];

#[test]
fn a_rust_file_says_what_it_is() {
    assert_eq!(check("a.rs", "//! What it is.\n"), NOTHING);
    for text in ["fn main() {}\n", "//!\n", "", "// what\n//! What.\n"] {
        assert_finds(&check("a.rs", text), "a.rs:1", "first line");
    }
    assert_eq!(check("a.toml", "x = 1\n"), NOTHING);
}

#[test]
fn long_files_are_warned_of_then_refused() {
    let source = |lines: usize| format!("//! A.\n{}", "\n".repeat(lines - 1));
    assert_eq!(check("a.rs", &source(WARN_LINES)), NOTHING);
    assert_finds(&check("a.rs", &source(WARN_LINES + 1)), "a.rs", "warning: 501 lines");
    assert_finds(&check("a.rs", &source(MAX_LINES)), "a.rs", "warning: 600 lines");
    let refused = rules::apply(&[file("a.rs", &source(MAX_LINES + 1))]);
    assert!(refused.len() == 1 && !refused[0].warning, "{refused:?}");
    assert_eq!(check("Cargo.lock", &"\n".repeat(9000)), NOTHING);
}

#[test]
fn lines_end_without_space_and_files_with_a_newline() {
    assert_finds(&check("a.md", "one \ntwo\n"), "a.md:1", "space at the end");
    assert_finds(&check("a.md", "one\n\t\n"), "a.md:2", "space at the end");
    assert_finds(&check("a.md", "one\r\n"), "a.md:1", "space at the end");
    assert_finds(&check("a.md", "one\ntwo"), "a.md:2", "no newline");
    assert_eq!(check("a.md", ""), NOTHING);
}

#[test]
fn machine_paths_are_found_and_others_are_not() {
    for folder in ["home", "root", "Users", "work"] {
        let path = format!("see /{folder}/someone/x\n");
        assert_finds(&check("a.md", &path), "a.md:1", "path of one machine");
        assert_finds(&check("a.md", &format!("file://{}", &path[4..])), "a.md:1", "path of one machine");
    }
    assert_finds(&check("a.md", &format!("C:\\{}\\x\n", "Users")), "a.md:1", "path of one machine");
    for fine in ["https://example.org/home/x", "apps/work/x", "~/work/x", "/usr/bin/env", "$HOME/x"] {
        assert_eq!(check("a.txt", &format!("{fine}\n")), NOTHING, "{fine}");
    }
}

#[test]
fn unfinished_code_is_found() {
    for name in ["todo", "unimplemented"] {
        let text = format!("//! A.\nfn f() {{\n    {name}!()\n}}\n");
        assert_finds(&check("a.rs", &text), "a.rs:3", "finish it");
        assert_eq!(check("a.rs", &format!("//! A.\n// No `{name}!` here.\n")), NOTHING);
    }
}

#[test]
fn an_ignored_test_says_why() {
    assert_finds(&check("a.rs", &format!("//! A.\n    #[{}]\n", "ignore")), "a.rs:2", "reason");
    assert_eq!(check("a.rs", "//! A.\n#[ignore = \"takes a minute\"]\n"), NOTHING);
}

#[test]
fn golden_images_stay_small() {
    let image = |path: &str, size_bytes| File { path: path.to_owned(), size_bytes, text: None };
    let path = "crates/render/src/psao/golden/wall.png";
    assert_eq!(check_all(&[image(path, MAX_GOLDEN_BYTES)]), NOTHING);
    assert_finds(&check_all(&[image(path, MAX_GOLDEN_BYTES + 1)]), path, "golden");
    assert_eq!(check_all(&[image("docs/picture.png", MAX_GOLDEN_BYTES + 1)]), NOTHING);
}

#[test]
fn links_lead_somewhere() {
    let with = |text: &str| {
        check_all(&[
            file("docs/a.md", text),
            file("README.md", ""),
            file("crates/scene/src/lib.rs", "//! S.\n"),
        ])
    };
    let good = "[a](../README.md#top) [b](../crates/scene) [c](../crates/scene/) [d](https://x.org/y) [e](#here) \
                [f](a.md) [g](..)\n";
    assert_eq!(with(good), NOTHING);
    assert_finds(&with("\n[a](README.md)\n"), "docs/a.md:2", "`README.md` leads nowhere");
    assert_finds(&with("![a](../../README.md)\n"), "docs/a.md:1", "leads nowhere");
}

#[test]
fn a_method_of_a_paper_has_a_readme() {
    let papers = file(
        PAPERS,
        "| section | folder | tests |\n|---|---|---|\n| 1 | `crates/x/src/m/n` | |\n| 2 | not yet | |\n",
    );
    let code = file("crates/x/src/m/n/mod.rs", "//! N.\n");
    assert_finds(
        &check_all(std::slice::from_ref(&papers)),
        "docs/papers.md:3",
        "no folder `crates/x/src/m/n`",
    );
    let found = check_all(&[papers.clone(), code.clone(), file("crates/README.md", "")]);
    assert_finds(&found, "docs/papers.md:3", "has no README.md");
    for readme in ["crates/x/src/m/n/README.md", "crates/x/src/m/README.md", "crates/x/README.md"] {
        assert_eq!(check_all(&[papers.clone(), code.clone(), file(readme, "# M\n")]), NOTHING);
    }
    assert_finds(&check_all(&[file(PAPERS, "# Papers\n")]), "docs/papers.md:1", "no table");
}
