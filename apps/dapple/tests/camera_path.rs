//! Camera paths from files: wherever a camera is named, a path file does, and what is wrong with one is told.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod common;

use common::command::{fail, succeed};
use common::made;
use tempfile::TempDir;

/// A camera that rises over two seconds and looks at the middle all the time.
const RISE: &str = r#"{"version": 1, "name": "rise", "interpolation": "linear", "keys": [
    {"time_s": 0, "eye": [0, 1, 2], "target": [0, 0, 0], "fov_degrees": 50},
    {"time_s": 2, "eye": [0, 3, 2], "target": [0, 0, 0]}]}"#;

fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes).unwrap();
    write("lid.glb", &made::two_squares_under_a_lid("{}", "{}"));
    write("rise.json", RISE.as_bytes());
    write("odd=name.JSON", RISE.as_bytes());
    write("late.json", RISE.replace("\"time_s\": 2", "\"time_s\": -2").as_bytes());
    write("cut.json", &RISE.as_bytes()[..RISE.len() / 2]);
    folder
}

#[test]
fn a_path_file_is_a_camera_at_each_time() {
    let folder = folder();
    let at = folder.path();
    let render = |name: &str, arguments: &[&str]| {
        let common = ["render", "lid.glb", "--method", "none", "--size", "48x32", "-o", name];
        succeed(at, &[&common, arguments].concat());
        std::fs::read(at.join(name)).unwrap()
    };
    for (time, eye) in [("0", "0,1,2"), ("1", "0,2,2"), ("2", "0,3,2"), ("9", "0,3,2")] {
        let camera = format!("eye={eye},target=0,0,0,fov=50");
        let placed = render("placed.png", &["--time", time, "--camera", &camera]);
        assert!(placed == render("path.png", &["--time", time, "--camera", "rise.json"]), "at {time} s");
    }
    assert!(render("a.png", &["--camera", "rise.json"]) == render("b.png", &["--camera", "odd=name.JSON"]));
}

#[test]
fn an_evaluation_follows_a_path_file() {
    let folder = folder();
    let at = folder.path();
    let eval = |out: &str, path: &str| {
        let common = ["eval", "lid.glb", "--frames", "2", "--size", "48x32", "--points", "200", "--hz", "5"];
        let rest = ["--reference-rays", "16", "--methods", "none", "--path", path, "--out", out];
        succeed(at, &[&common[..], &rest].concat())
    };
    eval("rise", "rise.json");
    let results = std::fs::read_to_string(at.join("rise/results.json")).unwrap();
    assert!(results.contains("\"rise\""), "the results name the path: {results}");
}

#[test]
fn what_is_wrong_with_a_path_file_is_told() {
    let folder = folder();
    let at = folder.path();
    for (file, names) in [
        ("none.json", &["none.json", "camera path"][..]),
        ("late.json", &["late.json", "key 1", "time_s", "-2"]),
        ("cut.json", &["cut.json", "docs/camera-path.md"]),
        (".", &["above", "orbit", ".json"]),
    ] {
        fail(at, &["render", "lid.glb", "--camera", file, "-o", "x.png"], names);
        fail(at, &["eval", "lid.glb", "--path", file, "--out", "x"], names);
        fail(at, &["view", "lid.glb", "--headless", "--camera", file, "-o", "x"], names);
    }
    // Where a path is to be recorded is checked before a window opens.
    for (file, names) in [("walk.txt", &["walk.txt", ".json"][..]), ("rise.json", &["rise.json", "exists"])] {
        fail(at, &["view", "lid.glb", "--record-path", file], names);
    }
}
