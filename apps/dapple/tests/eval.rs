//! `dapple eval`: what it writes, that it repeats, and that stopping it leaves nothing half written.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod common;

use std::path::Path;

use common::command::{dapple, files, partial_files, png_size, succeed};
use common::made;
use serde_json::Value;
use tempfile::TempDir;

/// The smallest evaluation that has everything in it.
const ATRIUM: [&str; 18] = [
    "eval",
    "--builtin",
    "atrium",
    "--detail",
    "0.05",
    "--size",
    "64x48",
    "--frames",
    "1",
    "--seconds",
    "0.5",
    "--points",
    "16",
    "--reference-rays",
    "16",
    "--point-rays",
    "16",
    "--supersample=1",
];

fn evaluate(folder: &Path, arguments: &[&str]) -> (String, Value) {
    let out = succeed(folder, arguments);
    let name = arguments.iter().skip_while(|a| **a != "--out").nth(1).unwrap();
    let json = std::fs::read(folder.join(name).join("results.json")).unwrap();
    (out, serde_json::from_slice(&json).unwrap())
}

/// Names and bytes of the pictures in a folder.
fn pictures(folder: &Path) -> Vec<(String, Vec<u8>)> {
    files(folder)
        .into_iter()
        .filter(|path| path.extension().is_some_and(|e| e == "png"))
        .map(|path| (path.file_name().unwrap().to_string_lossy().into_owned(), std::fs::read(&path).unwrap()))
        .collect()
}

/// Without what may differ: wall time, the machine, and how the program was called.
fn comparable(mut results: Value) -> Value {
    let object = results.as_object_mut().unwrap();
    object.remove("machine").unwrap();
    object["run"].as_object_mut().unwrap().remove("command").unwrap();
    for row in object["rows"].as_array_mut().unwrap() {
        for column in ["server_ms", "client_ms"] {
            row.as_object_mut().unwrap().remove(column).unwrap();
        }
    }
    results
}

#[test]
fn results_report_and_pictures_are_written() {
    let folder = TempDir::new().unwrap();
    let arguments = ["--methods", "psao,psao-hat,rtao-4,none", "--hz", "5,15", "--out", "results"];
    let (out, results) = evaluate(folder.path(), &[&ATRIUM[..], &arguments].concat());
    let at = folder.path().join("results");
    let rows = results["rows"].as_array().unwrap();
    let methods: Vec<&str> = rows.iter().map(|row| row["method"].as_str().unwrap()).collect();
    assert_eq!(methods, ["psao", "psao", "psao-hat", "psao-hat", "rtao-4", "none"]);
    for row in rows {
        let method = row["method"].as_str().unwrap();
        for column in ["visibility_psnr_db", "psnr_db", "ssim", "flip", "rays", "client_ms"] {
            assert!(row[column].as_f64().is_some_and(f64::is_finite), "{method}, {column}: {row}");
        }
        assert!((0.0..=1.0).contains(&row["ssim"].as_f64().unwrap()) && row["flip"].as_f64().unwrap() < 1.0);
        for column in ["kbit_per_s", "snapshot_bytes", "points", "server_ms"] {
            let found = row[column].as_f64();
            // Every column is there; those that do not apply are null.
            assert!(row.as_object().unwrap().contains_key(column), "{method}, {column}");
            assert_eq!(
                found.is_some_and(|n| n > 0.0),
                method.starts_with("psao"),
                "{method}, {column}: {row}"
            );
        }
        let params = row["params"].as_object().unwrap();
        let expected: &[&str] = match method {
            "psao" | "psao-hat" => &["hz", "point_rays", "points_per_m2", "threshold"],
            "rtao-4" => &["rays_per_pixel"],
            _ => &[],
        };
        assert_eq!(params.keys().map(String::as_str).collect::<Vec<_>>(), expected, "{method}");
        let frames = row["frames"].as_array().unwrap();
        assert_eq!(frames.len(), 1);
        for picture in ["beauty", "visibility", "error"] {
            assert_eq!(png_size(&at.join(frames[0][picture].as_str().unwrap())), (64, 48));
        }
        assert!(out.contains(method), "the table names {method}:\n{out}");
    }
    let psnr = |i: usize| rows[i]["visibility_psnr_db"].as_f64().unwrap();
    assert!(psnr(0) > psnr(2) && psnr(2) > psnr(5), "least squares, the paper's kernel, no occlusion");
    assert_eq!(results["run"]["width"], 64);
    assert_eq!(results["run"]["path"], "path-walk");

    // The page shows every picture that was written, and nothing else.
    let page = std::fs::read_to_string(at.join("report.html")).unwrap();
    assert!(out.contains("report.html"), "{out}");
    let pictures = pictures(&at);
    assert_eq!(pictures.len(), 2 + 3 * rows.len());
    for (picture, _) in &pictures {
        assert!(page.contains(&format!("src=\"{picture}\"")), "{picture} is not in the report");
    }
    assert_eq!(page.matches("<img ").count(), pictures.len());
    assert!(!page.contains("http"), "the report needs nothing from elsewhere");
    assert_eq!(partial_files(&at).len(), 0);
}

/// Runs and gives what must not differ: results and every picture.
fn outcome(folder: &Path, arguments: &[&str], threads: &str, out: &str) -> (Value, Vec<(String, Vec<u8>)>) {
    let results = evaluate(folder, &[arguments, &["--threads", threads, "--out", out]].concat()).1;
    assert_eq!(results["machine"]["threads"].to_string(), threads);
    (comparable(results), pictures(&folder.join(out)))
}

#[test]
fn results_do_not_depend_on_threads() {
    let folder = TempDir::new().unwrap();
    let atrium = [&ATRIUM[..], &["--methods", "psao,rtao-4"]].concat();
    let one = outcome(folder.path(), &atrium, "1", "one");
    let two = outcome(folder.path(), &atrium, "2", "two");
    assert_eq!(one.0, two.0);
    assert!(one.1 == two.1, "the pictures differ");
}

#[test]
fn results_do_not_depend_on_repetition() {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("sheet.glb"), made::folding_sheet()).unwrap();
    let sheet = [
        "eval",
        "sheet.glb",
        "--size",
        "64x48",
        "--frames",
        "3",
        "--points",
        "100,200",
        "--reference-rays",
        "16",
    ];
    let first = outcome(folder.path(), &sheet, "2", "first");
    let again = outcome(folder.path(), &sheet, "2", "again");
    assert_eq!(first.0, again.0);
    assert!(first.1 == again.1, "the pictures differ");
    // Another seed is another run.
    let other = outcome(folder.path(), &[&sheet[..], &["--seed", "7"]].concat(), "2", "other");
    assert!(other.0["rows"] != first.0["rows"]);
}

/// Ctrl-C while pictures are being written.
#[cfg(unix)]
#[test]
fn an_interrupted_run_leaves_no_file_half_written() {
    use std::process::Stdio;
    use std::time::{Duration, Instant};

    let folder = TempDir::new().unwrap();
    let at = folder.path().join("out");
    std::fs::write(folder.path().join("sheet.glb"), made::folding_sheet()).unwrap();
    // More pictures than it will ever get to.
    let arguments =
        ["eval", "sheet.glb", "--size", "64x48", "--frames", "90000", "--methods", "none", "--out", "out"];
    let mut child =
        dapple(folder.path(), &arguments).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let start = Instant::now();
    while start.elapsed() < Duration::from_secs(60) && !(at.is_dir() && pictures(&at).len() > 5) {
        std::thread::sleep(Duration::from_millis(5));
    }
    let sent = std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    let status = child.wait().unwrap();
    assert!(sent.success() && !status.success(), "it was stopped before its end");
    assert!(!at.join("results.json").exists() && !at.join("report.html").exists());
    let pictures = pictures(&at);
    assert!(pictures.len() > 5);
    for (name, _) in pictures {
        assert_eq!(png_size(&at.join(name)), (64, 48));
    }
}
