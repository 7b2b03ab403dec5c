//! `dapple eval`: what it writes, that it repeats, and that a stopped run continues.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod common;

use std::collections::BTreeMap;
use std::path::Path;

use common::command::{dapple, fail, files, partial_files, png_size, succeed};
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
    (out, read(&folder.join(name)))
}

fn read(out: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(out.join("results.json")).unwrap()).unwrap()
}

/// The pictures of a results folder, by the names that results give them.
fn pictures(out: &Path) -> BTreeMap<String, Vec<u8>> {
    let name = |path: &Path| path.strip_prefix(out).unwrap().to_string_lossy().into_owned();
    let png = files(out).into_iter().filter(|path| path.extension().is_some_and(|e| e == "png"));
    png.map(|path| (name(&path), std::fs::read(&path).unwrap())).collect()
}

/// Every picture that results name.
fn named(results: &Value) -> Vec<String> {
    let mut names = Vec::new();
    let mut frames = Vec::new();
    for case in results["cases"].as_array().unwrap() {
        frames.extend(case["truth"]["frames"].as_array().unwrap());
        for row in case["rows"].as_array().unwrap() {
            frames.extend(row["frames"].as_array().unwrap());
        }
    }
    for frame in frames {
        for kind in ["beauty", "visibility", "error", "flip_map"] {
            names.extend(frame.get(kind).map(|name| name.as_str().unwrap().to_owned()));
        }
    }
    names.sort();
    names
}

/// Without what may differ: wall time, the machine, and how the program was called.
fn comparable(mut results: Value) -> Value {
    let object = results.as_object_mut().unwrap();
    object.remove("machine").unwrap();
    object["run"].as_object_mut().unwrap().remove("command").unwrap();
    for case in object["cases"].as_array_mut().unwrap() {
        for row in case["rows"].as_array_mut().unwrap() {
            row.as_object_mut().unwrap().remove("times").unwrap();
        }
    }
    results
}

#[test]
fn results_report_and_pictures_are_written() {
    let folder = TempDir::new().unwrap();
    let arguments = ["--methods", "psao,psao-hat,rtao-4,ssao,none", "--hz", "5,15", "--out", "results"];
    let (out, results) = evaluate(folder.path(), &[&ATRIUM[..], &arguments].concat());
    let at = folder.path().join("results");
    let [case] = &results["cases"].as_array().unwrap()[..] else { panic!("one case") };
    assert_eq!(
        (&case["width"], &case["path"], &case["name"]),
        (&64.into(), &"path-walk".into(), &"atrium / path-walk".into())
    );
    assert!((0.01..0.2).contains(&case["truth"]["noise_rms"].as_f64().unwrap()), "16 rays are noisy");
    let rows = case["rows"].as_array().unwrap();
    let methods: Vec<&str> = rows.iter().map(|row| row["method"].as_str().unwrap()).collect();
    assert_eq!(methods, ["psao", "psao", "psao-hat", "psao-hat", "rtao-4", "ssao", "none"]);
    for row in rows {
        let method = row["method"].as_str().unwrap();
        for column in ["visibility_psnr_db", "psnr_db", "ssim", "flip", "flicker"] {
            assert!(row[column]["value"].as_f64().is_some_and(f64::is_finite), "{method}, {column}: {row}");
            assert_eq!(row[column]["ci95"], Value::Null, "one frame has no interval");
        }
        let (ssim, flip) = (&row["ssim"]["value"], &row["flip"]["value"]);
        assert!((0.0..=1.0).contains(&ssim.as_f64().unwrap()) && flip.as_f64().unwrap() < 1.0);
        let with_points = method.starts_with("psao");
        for column in ["snapshot_bytes", "points", "steps", "settling", "kbit_per_s"] {
            // Every column is there; those that do not apply are null.
            let found = row.as_object().unwrap().get(column).unwrap();
            assert_eq!(!found.is_null(), with_points, "{method}, {column}: {row}");
        }
        let params = row["params"].as_object().unwrap();
        let expected: &[&str] = match method {
            "psao" | "psao-hat" => &["hz", "point_rays", "points_per_m2", "threshold"],
            "rtao-4" => &["rays_per_pixel"],
            "ssao" => &["ao_preset", "guard_band"],
            _ => &[],
        };
        assert_eq!(params.keys().map(String::as_str).collect::<Vec<_>>(), expected, "{method}");
        let frames = row["frames"].as_array().unwrap();
        assert_eq!(frames.len(), 1);
        for picture in ["beauty", "visibility", "error", "flip_map"] {
            assert_eq!(png_size(&at.join(frames[0][picture].as_str().unwrap())), (64, 48));
        }
        assert!(out.contains(method), "the table names {method}:\n{out}");
    }
    let psnr = |i: usize| rows[i]["visibility_psnr_db"]["value"].as_f64().unwrap();
    assert!(psnr(0) > psnr(2) && psnr(2) > psnr(6), "least squares, the paper's kernel, no occlusion");
    assert!(psnr(5) > psnr(6), "screen space sees some of it");
    assert_eq!((&rows[5]["rays"], &rows[5]["flicker"]["value"]), (&0.into(), &0.0.into()));
    assert!(rows[5]["times"]["client_ms"].as_f64().unwrap() > 0.0);
    // Steps at 5 and at 15 Hz in half a second, and as many bits as their bytes say.
    for (row, steps) in [(0, 2), (1, 7)] {
        let bytes = rows[row]["step_bytes"].as_array().unwrap();
        assert_eq!(bytes.len(), steps);
        let sum: f64 = bytes.iter().map(|b| b.as_f64().unwrap()).sum();
        let kbit = rows[row]["kbit_per_s"]["value"].as_f64().unwrap();
        assert!(sum > 0.0 && (kbit - sum * 8e-3 / 0.5).abs() < 1e-9);
    }
    // After a move the error stays until the server's next step, then falls.
    for (row, period) in [(0, 0.2), (1, 1.0 / 15.0)] {
        let settled = rows[row]["settling"]["settled_s"].as_f64().unwrap();
        assert!((settled - period).abs() < 1e-9, "{settled}");
    }
    // Advice about one frame, noisy truth, and a short path.
    let advice = results["advice"].as_array().unwrap();
    for says in ["--frames", "--reference-rays", "--seconds"] {
        assert!(advice.iter().any(|a| a["text"].as_str().unwrap().contains(says)), "{says}: {advice:?}");
        assert!(out.contains(says));
    }
    assert_eq!(named(&results), pictures(&at).into_keys().collect::<Vec<_>>());
    assert_eq!(partial_files(&at).len(), 0);
}

#[test]
fn tables_for_other_programs_have_every_row_and_picture() {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("a, b.glb"), made::folding_sheet()).unwrap();
    let arguments =
        ["eval", "a, b.glb", "--size", "32x32", "--frames", "2", "--methods", "rtao-4,none", "--out", "o"];
    let (_, results) = evaluate(folder.path(), &[&arguments[..], &["--reference-rays", "16"]].concat());
    let at = folder.path().join("o");
    let lines = |name: &str| {
        let text = std::fs::read_to_string(at.join(name)).unwrap();
        text.lines().map(str::to_owned).collect::<Vec<String>>()
    };
    let rows = lines("results.csv");
    assert_eq!(rows.len(), 1 + 2);
    assert!(rows[1].starts_with("\"a, b / "), "commas are quoted: {}", rows[1]);
    let flip = results["cases"][0]["rows"][0]["flip"]["value"].to_string();
    assert!(rows[1].contains(&flip), "{flip} in full: {}", rows[1]);
    assert_eq!(lines("frames.csv").len(), 1 + 2 * 2);
    let markdown = lines("results.md");
    assert_eq!(markdown.iter().filter(|line| line.starts_with("| ")).count(), 2 + 2);
}

/// Runs and gives what must not differ: results and every picture.
fn outcome(
    folder: &Path,
    arguments: &[&str],
    threads: &str,
    out: &str,
) -> (Value, BTreeMap<String, Vec<u8>>) {
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

const SHEET: [&str; 12] = [
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
    "--methods",
    "psao,psao-hat,rtao-4,none",
];

#[test]
fn results_do_not_depend_on_repetition() {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("sheet.glb"), made::folding_sheet()).unwrap();
    let first = outcome(folder.path(), &SHEET, "2", "first");
    let again = outcome(folder.path(), &SHEET, "2", "again");
    assert_eq!(first.0, again.0);
    assert!(first.1 == again.1, "the pictures differ");
    // In the same folder everything is there already; results are the same to the last byte, times included.
    let before = std::fs::read(folder.path().join("first/results.json")).unwrap();
    let out = succeed(folder.path(), &[&SHEET[..], &["--threads", "2", "--out", "first"]].concat());
    assert!(out.contains("done before"), "{out}");
    assert!(before == std::fs::read(folder.path().join("first/results.json")).unwrap());
    // Another seed is another run, and so is a fresh one.
    let other = [&SHEET[..], &["--seed", "7", "--out", "first"]].concat();
    assert!(evaluate(folder.path(), &other).1["cases"] != first.0["cases"]);
    let fresh = [&SHEET[..], &["--fresh", "--threads", "2", "--out", "first"]].concat();
    let (out, results) = evaluate(folder.path(), &fresh);
    assert!(!out.contains("done before"), "{out}");
    assert_eq!(comparable(results), first.0);
}

#[test]
fn intervals_come_with_three_frames() {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("sheet.glb"), made::folding_sheet()).unwrap();
    let results = evaluate(folder.path(), &[&SHEET[..], &["--out", "o"]].concat()).1;
    let rows = results["cases"][0]["rows"].as_array().unwrap();
    for row in rows.iter().filter(|row| row["method"] != "none") {
        for column in ["visibility_psnr_db", "psnr_db", "ssim", "flip"] {
            assert!(row[column]["ci95"].as_f64().is_some_and(|c| c > 0.0), "{column}: {row}");
        }
    }
}

#[test]
fn runs_with_other_methods_share_their_truth() {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("sheet.glb"), made::folding_sheet()).unwrap();
    let short = ["eval", "sheet.glb", "--size", "64x48", "--frames", "2", "--reference-rays", "64"];
    let run = |out: &str, methods: &str, seed: &str| {
        let more = ["--methods", methods, "--seed", seed, "--truth-cache", "shared", "--out", out];
        evaluate(folder.path(), &[&short[..], &more].concat()).1
    };
    let kept = || files(&folder.path().join("shared"));
    let first = run("a", "none", "1");
    assert_eq!(kept().len(), 2, "one file a picture");
    let modified: Vec<_> = kept().iter().map(|f| f.metadata().unwrap().modified().unwrap()).collect();
    let second = run("b", "rtao-4", "1");
    assert_eq!(
        kept().iter().map(|f| f.metadata().unwrap().modified().unwrap()).collect::<Vec<_>>(),
        modified
    );
    assert_eq!(first["cases"][0]["truth"]["noise_rms"], second["cases"][0]["truth"]["noise_rms"]);
    // A damaged file is made again, the same.
    let whole = std::fs::read(&kept()[0]).unwrap();
    std::fs::write(&kept()[0], &whole[..whole.len() - 9]).unwrap();
    run("c", "none", "1");
    assert!(std::fs::read(&kept()[0]).unwrap() == whole);
    // Another seed has another truth.
    run("d", "none", "2");
    assert_eq!(kept().len(), 4);
}

/// Ctrl-C in the middle, and the same command again.
#[cfg(unix)]
#[test]
fn a_stopped_run_leaves_no_file_half_written_and_continues() {
    use std::process::Stdio;
    use std::time::{Duration, Instant};

    let folder = TempDir::new().unwrap();
    let at = folder.path().join("out");
    std::fs::write(folder.path().join("sheet.glb"), made::folding_sheet()).unwrap();
    let command = |out| {
        let mut arguments = [&SHEET[..], &["--threads", "1", "--out", out]].concat();
        arguments[5] = "9";
        arguments
    };
    let arguments = command("out");
    let mut child =
        dapple(folder.path(), &arguments).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let is_job = |path: &Path| path.extension().is_some_and(|e| e == "json");
    let jobs = || match at.join("jobs").is_dir() {
        true => files(&at.join("jobs")).iter().filter(|path| is_job(path)).count(),
        false => 0,
    };
    let start = Instant::now();
    while start.elapsed() < Duration::from_secs(60) && jobs() < 2 {
        std::thread::sleep(Duration::from_millis(1));
    }
    let sent = std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    let status = child.wait().unwrap();
    assert!(sent.success() && !status.success(), "it was stopped before its end");
    assert!(!at.join("results.json").exists() && !at.join("report.html").exists());
    let done = jobs();
    assert!(done >= 2, "the truth and a job");
    for name in pictures(&at).into_keys() {
        assert_eq!(png_size(&at.join(name)), (64, 48));
    }
    let out = succeed(folder.path(), &arguments);
    assert!(out.contains(&format!("{done} jobs done before")), "{out}");
    let uninterrupted = evaluate(folder.path(), &command("whole")).1;
    assert_eq!(comparable(read(&at)), comparable(uninterrupted));
    assert!(pictures(&at) == pictures(&folder.path().join("whole")));
}

#[test]
fn suites_run_every_case_and_flags_scale_them() {
    let folder = TempDir::new().unwrap();
    std::fs::create_dir(folder.path().join("scenes")).unwrap();
    std::fs::write(folder.path().join("scenes/sheet.glb"), made::folding_sheet()).unwrap();
    let suite = "title = \"Two <scenes>\"\n[defaults]\nsize = \"64x48\"\nframes = 3\nreference-rays = 16\n\
                 methods = [\"psao\", \"none\"]\npoints = [100]\n\
                 [[case]]\nscene = \"scenes/sheet.glb\"\npath = [\"orbit\"]\nhz = [5, 10]\n\
                 [[case]]\nbuiltin = \"atrium\"\ndetail = 0.05\npoints = [16]\nseconds = 0.5\npath = [\"all\"]\n";
    std::fs::write(folder.path().join("two.toml"), suite).unwrap();
    let results = evaluate(folder.path(), &["eval", "--suite", "two.toml", "--frames", "1", "--out", "o"]).1;
    assert_eq!(results["title"], "Two <scenes>");
    let cases = results["cases"].as_array().unwrap();
    let names: Vec<&str> = cases.iter().map(|c| c["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["sheet / orbit", "atrium / path-walk", "atrium / path-gallery"]);
    assert_eq!(cases[0]["rows"].as_array().unwrap().len(), 3);
    assert_eq!(cases[1]["rows"].as_array().unwrap().len(), 2);
    assert!(cases.iter().all(|c| c["truth"]["frames"].as_array().unwrap().len() == 1));

    for (arguments, says) in [
        (vec!["--suite", "nothing"], "builtins"),
        (vec!["--suite", "nothing.toml"], "nothing.toml"),
        (vec!["--suite", "others"], "--scenes-folder"),
        (vec!["--suite", "two.toml", "--builtin", "atrium"], "--builtin"),
    ] {
        let (mut command, says) = ([&["eval"], &arguments[..], &["--out", "x"]].concat(), says);
        if says == "--builtin" {
            // Refused by the command line itself.
            command.retain(|a| *a != "x" && *a != "--out");
            let output = dapple(folder.path(), &command).output().unwrap();
            assert!(String::from_utf8_lossy(&output.stderr).contains(says));
        } else {
            fail(folder.path(), &command, &[says]);
        }
    }
    assert!(!folder.path().join("x").exists(), "nothing was begun");
}

#[test]
fn a_scene_that_fails_does_not_cost_the_others() {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("sheet.glb"), made::folding_sheet()).unwrap();
    std::fs::write(folder.path().join("broken.glb"), b"glTF\x02\0\0\0 and no more").unwrap();
    let small = ["--size", "64x48", "--frames", "1", "--reference-rays", "16", "--methods", "none"];
    let run = |scenes: &[&str]| {
        let arguments = [&["eval"], scenes, &small, &["--out", "o"]].concat();
        let output = dapple(folder.path(), &arguments).output().unwrap();
        assert!(!output.status.success());
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    let err = run(&["broken.glb", "sheet.glb"]);
    assert!(err.contains("could not be evaluated") && err.contains("broken"), "{err}");
    let at = folder.path().join("o");
    let results = read(&at);
    assert_eq!(results["cases"].as_array().unwrap().len(), 1);
    let [failure] = &results["failures"].as_array().unwrap()[..] else { panic!("one failure") };
    assert_eq!(failure["scene"], "broken");
    assert!(
        std::fs::read_to_string(at.join("report.html")).unwrap().contains("broken could not be evaluated")
    );
    // With nothing left there are no results.
    std::fs::remove_dir_all(&at).unwrap();
    std::fs::copy(folder.path().join("broken.glb"), folder.path().join("worse.glb")).unwrap();
    assert!(run(&["broken.glb", "worse.glb"]).contains("none of the 2 scenes"));
    assert!(!at.join("results.json").exists());
}

#[test]
fn two_runs_do_not_share_a_folder() {
    let folder = TempDir::new().unwrap();
    let at = folder.path().join("o");
    std::fs::create_dir(&at).unwrap();
    let lock = std::fs::File::create(at.join("running.lock")).unwrap();
    lock.lock().unwrap();
    let arguments = [&ATRIUM[..], &["--methods", "none", "--out", "o"]].concat();
    fail(folder.path(), &arguments, &["another evaluation", "--out"]);
    drop(lock);
    succeed(folder.path(), &arguments);
}

#[test]
fn only_what_changes_at_rest_is_flicker() {
    let folder = TempDir::new().unwrap();
    let arguments = ["--methods", "psao,rtao-4,none", "--out", "o"];
    let results = evaluate(folder.path(), &[&ATRIUM[..], &arguments].concat()).1;
    let flicker: Vec<f64> = results["cases"][0]["rows"]
        .as_array()
        .unwrap()
        .iter()
        .map(|row| row["flicker"]["value"].as_f64().unwrap())
        .collect();
    // Points that nothing can reach keep their visibility; rays of another frame are others.
    assert!(flicker[0] < 0.5 && flicker[1] > 10.0 && flicker[2] == 0.0, "{flicker:?}");
}

#[test]
fn streams_are_recorded() {
    let folder = TempDir::new().unwrap();
    let record = ["--methods", "psao", "--record", "hall.dapple", "--out", "o"];
    let results = evaluate(folder.path(), &[&ATRIUM[..], &record].concat()).1;
    let told = succeed(folder.path(), &["inspect", "hall.dapple", "--builtin", "atrium", "--detail", "0.05"]);
    let row = &results["cases"][0]["rows"][0];
    let deltas: u64 = row["step_bytes"].as_array().unwrap().iter().map(|b| b.as_u64().unwrap()).sum();
    for says in [
        "integrity  whole".to_owned(),
        format!("snapshots  1 in {} bytes", row["snapshot_bytes"]),
        format!("in {deltas} bytes"),
        "duration   0.500 s".to_owned(),
    ] {
        assert!(told.contains(&says), "{says}: {told}");
    }
    // Another setting's recording under the same name is not taken for it.
    let made = std::fs::read(folder.path().join("hall.dapple")).unwrap();
    evaluate(folder.path(), &[&ATRIUM[..], &record, &["--hz", "5"]].concat());
    assert!(std::fs::read(folder.path().join("hall.dapple")).unwrap() != made);
    evaluate(folder.path(), &[&ATRIUM[..], &record].concat());
    assert!(std::fs::read(folder.path().join("hall.dapple")).unwrap() == made);
    // It is made again if it is gone, and several settings have several files.
    std::fs::remove_file(folder.path().join("hall.dapple")).unwrap();
    let hz = ["--hz", "5,15"];
    evaluate(folder.path(), &[&ATRIUM[..], &record, &hz].concat());
    let names: Vec<String> = files(folder.path())
        .iter()
        .filter(|f| f.extension().is_some_and(|e| e == "dapple"))
        .map(|f| f.file_name().unwrap().to_string_lossy().into_owned())
        .collect();
    assert_eq!(
        names,
        ["hall-atrium-path-walk-points-16-15hz.dapple", "hall-atrium-path-walk-points-16-5hz.dapple"]
    );
    fail(folder.path(), &[&ATRIUM[..], &["--record", "hall.mp4"]].concat(), &["hall.mp4", ".dapple"]);
}
