//! Studies of a suite: what they leave in every file, and that a second run takes them from the first.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod common;

use common::command::{dapple, succeed};
use serde_json::Value;
use tempfile::TempDir;

const SUITE: &str = r#"
title = "Studies"

[defaults]
size = "64x48"
frames = 2
seconds = 0.5
detail = 0.05
reference-rays = 16
supersample = 1

[[study]]
kind = "z-precision"
distances = [1.0, 10.0]
triangles = 200

[[study]]
kind = "mip-filters"
builtin = "atrium"

[[study]]
kind = "presets"
builtin = "atrium"
methods = ["sao"]
"#;

fn evaluate(folder: &TempDir, more: &[&str]) -> (String, Value) {
    let arguments = ["eval", "--suite", "studies.toml", "--out", "out"];
    let said = succeed(folder.path(), &[&arguments[..], more].concat());
    let results = std::fs::read(folder.path().join("out/results.json")).unwrap();
    (said, serde_json::from_slice(&results).unwrap())
}

#[test]
fn studies_are_in_every_file() {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("studies.toml"), SUITE).unwrap();
    let (said, results) = evaluate(&folder, &[]);
    assert_eq!(results["cases"].as_array().unwrap().len(), 0);
    let studies = results["studies"].as_array().unwrap();
    let kinds: Vec<&str> = studies.iter().map(|study| study["kind"].as_str().unwrap()).collect();
    assert_eq!(kinds, ["z-precision", "mip-filters", "presets"]);
    assert_eq!(studies[0].get("subject"), Some(&Value::Null));
    assert!(studies[1]["subject"].as_str().unwrap().starts_with("atrium / "));
    // One method was asked for.
    assert_eq!(studies[2]["tables"][0]["rows"].as_array().unwrap().len(), 1);
    let page = std::fs::read_to_string(folder.path().join("out/report.html")).unwrap();
    let markdown = std::fs::read_to_string(folder.path().join("out/results.md")).unwrap();
    for words in ["rotated grid", "24-bit fixed, standard z", "Visibility against the truth"] {
        for text in [&said, &page, &markdown] {
            assert!(text.contains(words), "{words}");
        }
    }
    assert!(page.contains("href=\"#studies\""));

    // All is taken from the first run, times too.
    let (_, again) = evaluate(&folder, &[]);
    assert_eq!(again["studies"], results["studies"]);
    // Another size is another study; what has no scene stays.
    let (_, other) = evaluate(&folder, &["--size", "32x24"]);
    assert_eq!(other["studies"][0], results["studies"][0]);
    assert_ne!(other["studies"][1]["tables"], results["studies"][1]["tables"]);
}

#[test]
fn a_study_that_fails_is_named() {
    let folder = TempDir::new().unwrap();
    let text = "[[study]]\nkind = \"radius\"\nbuiltin = \"atrium\"\nradii = [-1.0]\n[[study]]\nkind = \"z-precision\"\ntriangles = 50\n";
    std::fs::write(folder.path().join("studies.toml"), text).unwrap();
    let arguments =
        ["eval", "--suite", "studies.toml", "--out", "out", "--size", "32x24", "--detail", "0.05"];
    let output = dapple(folder.path(), &arguments).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success() && !said.contains("panicked"), "{said}");
    assert!(said.contains("radii must be lengths") && said.contains("study radius"), "{said}");
    let results: Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("out/results.json")).unwrap()).unwrap();
    assert_eq!(results["studies"].as_array().unwrap().len(), 1, "the other was measured");
}
