//! Recording, inspecting and showing: what `record` writes, `inspect` describes and `view` plays.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod common;

use std::path::Path;
use std::process::Command;

use common::command::{dapple, fail, files, partial_files, png_size, succeed};
use common::made;
use dapple_scene::NoFiles;
use dapple_server::Server;
use dapple_stream::{FrameKind, Limits, Recording, Replay, Subscriber};
use tempfile::TempDir;

/// A folder with a small animated scene in it.
fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("sheet.glb"), made::folding_sheet()).unwrap();
    std::fs::write(folder.path().join("lid.glb"), made::two_squares_under_a_lid("{}", "{}")).unwrap();
    folder
}

const RECORD: [&str; 10] =
    ["record", "sheet.glb", "--points", "200", "--hz", "10", "--snapshot-every", "0.5", "-o", "sheet.dapple"];

#[test]
fn a_recording_holds_what_the_server_sent() {
    let folder = folder();
    let at = folder.path();
    let said = succeed(at, &RECORD);
    assert!(said.contains("sheet.dapple") && said.contains("2.00 s"), "{said}");
    let bytes = std::fs::read(at.join("sheet.dapple")).unwrap();
    let recording = Recording::parse(bytes.clone(), &Limits::default()).unwrap();
    assert_eq!(recording.header().unwrap().duration_us, 2_000_000);
    assert_eq!(recording.header().unwrap().name, "sheet");
    let kinds: Vec<FrameKind> = recording.entries().map(|e| e.header.kind).collect();
    assert!(kinds.iter().filter(|k| **k == FrameKind::Snapshot).count() >= 2, "{kinds:?}");
    assert!(kinds.contains(&FrameKind::Delta));

    // The same again, with another number of threads.
    succeed(at, &[&RECORD[..9], &["again.dapple", "--threads", "1"]].concat());
    assert!(bytes == std::fs::read(at.join("again.dapple")).unwrap());

    // Any time holds what a server at that time does, however it is reached.
    let scene =
        dapple_scene::load("sheet.glb", &std::fs::read(at.join("sheet.glb")).unwrap(), &NoFiles).unwrap();
    let scene = std::sync::Arc::new(scene);
    let mut config = common::config(200.0, 64);
    config.generate =
        dapple_trace::psao::generate::GenerateParams { points_per_m2: 200.0, seed: 1, ..Default::default() };
    let mut server = Server::new(scene.clone(), &config, &|_| ()).unwrap();
    let mut states = vec![server.store().clone()];
    for tick in 1..=20 {
        server.step(f64::from(tick) / 10.0).unwrap();
        states.push(server.store().clone());
    }
    let mut replay = Replay::new(0);
    let mut viewer = Subscriber::new(Some(scene.hash().0), Limits::default());
    for tick in [0, 7, 3, 20, 11, 12, 0, 19] {
        for frame in replay.frames_to(&recording, tick * 100_000 + 50_000) {
            viewer.receive(&frame).unwrap();
        }
        assert!(viewer.store() == Some(&states[tick as usize]), "tick {tick}");
    }
}

#[test]
fn inspecting_describes_and_names_damage() {
    let folder = folder();
    let at = folder.path();
    succeed(at, &RECORD);
    let said = succeed(at, &["inspect", "sheet.dapple", "--scene", "sheet.glb"]);
    for word in [
        "name       sheet",
        "duration   2.000 s",
        "points",
        "snapshots",
        "deltas",
        "kbit/s",
        "whole",
        "belongs",
    ] {
        assert!(said.contains(word), "{word}: {said}");
    }
    fail(at, &["inspect", "sheet.dapple", "--scene", "lid.glb"], &["another scene", "lid.glb"]);
    let bytes = std::fs::read(at.join("sheet.dapple")).unwrap();
    std::fs::write(at.join("cut.dapple"), &bytes[..bytes.len() / 2]).unwrap();
    let mut flipped = bytes.clone();
    flipped[bytes.len() / 2] ^= 4;
    std::fs::write(at.join("flipped.dapple"), flipped).unwrap();
    for (file, says) in [
        ("cut.dapple", "was cut"),
        ("flipped.dapple", "damaged"),
        ("sheet.glb", "no .dapple file"),
        ("absent.dapple", "absent.dapple"),
    ] {
        fail(at, &["inspect", file], &[file, says]);
    }
    // What came before the damage is described all the same.
    let output = dapple(at, &["inspect", "cut.dapple"]).output().unwrap();
    assert!(String::from_utf8_lossy(&output.stdout).contains("deltas"));
}

#[test]
fn what_cannot_be_recorded_is_named() {
    let folder = folder();
    let at = folder.path();
    let before = files(at);
    for (arguments, names) in [
        (&["--points", "0"][..], &["--points"][..]),
        (&["--hz", "-1"], &["--hz"]),
        (&["--hz", "nan"], &["--hz"]),
        (&["--seconds", "0"], &["--seconds"]),
        (&["--seconds", "inf"], &["--seconds"]),
        (&["--snapshot-every", "0"], &["--snapshot-every"]),
        (&["-o", "sheet.png"], &["sheet.png", ".dapple"]),
        (&["-o", "lid.glb/x.dapple"], &["lid.glb"]),
        (&["--point-rays", "0"], &["rays"]),
    ] {
        fail(at, &[&["record", "sheet.glb"], arguments].concat(), names);
    }
    let long = "n".repeat(300);
    fail(at, &["record", "sheet.glb", "--name", &long], &["--name", "255"]);
    fail(at, &["record", "-o", "x.dapple"], &["--builtin"]);
    assert_eq!(files(at), before);
}

#[cfg(unix)]
#[test]
fn an_interrupted_recording_leaves_nothing() {
    let folder = folder();
    let at = folder.path();
    let before = files(at);
    let mut child =
        dapple(at, &["record", "sheet.glb", "--points", "3000", "--hz", "1000", "--seconds", "2000"])
            .spawn()
            .unwrap();
    std::thread::sleep(std::time::Duration::from_millis(500));
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    assert!(!child.wait().unwrap().success());
    assert_eq!(files(at), before);
}

#[test]
fn what_cannot_be_shown_is_named() {
    let folder = folder();
    let at = folder.path();
    succeed(at, &RECORD);
    for (arguments, names) in [
        (&["view", "sheet.glb", "--samples", "3"][..], &["--samples"][..]),
        (&["view", "sheet.glb", "--time", "-1"], &["--time"]),
        (&["view", "sheet.glb", "--split", "2"], &["--split"]),
        (&["view", "sheet.glb", "--fade", "-1"], &["--fade"]),
        (&["view", "sheet.glb", "--second-camera"], &["--second-camera", "sd-ssao or sd-hbao-plus"]),
        (&["view", "sheet.glb", "--method", "sd-hbao", "--second-camera"], &["--second-camera"]),
        (
            &["view", "sheet.glb", "--method", "sd-ssao", "--second-camera=-1"],
            &["--second-camera", "above 0"],
        ),
        (&["view", "sheet.glb", "--camera", "roof"], &["roof", "front"]),
        (&["view", "sheet.glb", "--view", "depth"], &["depth", "beauty"]),
        (&["view", "sheet.glb", "--frames", "3"], &["--headless"]),
        (&["view", "sheet.glb", "--stream", "lid.glb"], &["lid.glb", "no .dapple file"]),
        (&["view", "lid.glb", "--stream", "sheet.dapple"], &["sheet.dapple", "another scene"]),
        (&["view", "--url", "https://host/"], &["plain HTTP"]),
        (&["view", "--url", "host"], &["http://"]),
        (&["view", "--url", "http://127.0.0.1:9/"], &["127.0.0.1:9"]),
        (&["view"], &["--builtin"]),
    ] {
        fail(at, arguments, names);
    }
    // No display.
    let output = dapple(at, &["view", "sheet.glb", "--points", "50"])
        .env_remove("DISPLAY")
        .env_remove("WAYLAND_DISPLAY")
        .env_remove("WAYLAND_SOCKET")
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    if cfg!(target_os = "linux") {
        assert!(
            !output.status.success() && said.contains("DISPLAY") && said.contains("--headless"),
            "{said}"
        );
    }
    assert_eq!(partial_files(at), Vec::<std::path::PathBuf>::new());
}

/// What `view --headless` says; nothing where there is no adapter.
fn headless(at: &Path, arguments: &[&str]) -> Option<String> {
    let output = dapple(at, &[&["view", "--headless"], arguments].concat()).output().unwrap();
    let [out, err] = [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text).into_owned());
    if err.contains("there is no graphics adapter") && std::env::var("REQUIRE_GPU").as_deref() != Ok("1") {
        eprintln!("skipped: pictures without a window, because {err}");
        return None;
    }
    assert!(output.status.success(), "{arguments:?}: {out}\n{err}");
    Some(out)
}

#[test]
fn a_second_camera_sees_more() {
    let folder = folder();
    let at = folder.path();
    let common = [
        "--builtin",
        "atrium",
        "--detail",
        "0.1",
        "--points",
        "20",
        "--size",
        "160x90",
        "--view",
        "visibility",
    ];
    for method in ["sd-ssao", "sd-hbao-plus"] {
        let names = [format!("{method}-one"), format!("{method}-two")];
        for (name, second) in names.iter().zip([None, Some("--second-camera=1.5")]) {
            let own = ["--method", method, "-o", name];
            let arguments: Vec<_> = common.into_iter().chain(own).chain(second).collect();
            let Some(said) = headless(at, &arguments) else { return };
            assert!(said.contains("1 picture"), "{said}");
        }
        let [one, two] =
            names.map(|name| image::open(at.join(name).join("frame-000.png")).unwrap().to_luma8());
        // Darker somewhere, and nowhere brighter by more than rounding.
        let off: Vec<i32> = one.iter().zip(two.iter()).map(|(a, b)| i32::from(*b) - i32::from(*a)).collect();
        assert!(off.iter().all(|off| *off <= 1), "{method}");
        assert!(off.iter().filter(|off| **off < -5).count() > 100, "{method}");
    }
}

#[test]
fn pictures_without_a_window() {
    let folder = folder();
    let at = folder.path();
    succeed(at, &RECORD);
    let played =
        ["sheet.glb", "--stream", "sheet.dapple", "--size", "96x64", "--frames", "3", "-o", "played"];
    let Some(said) = headless(at, &played) else { return };
    assert!(said.contains("3 pictures of 96x64"), "{said}");
    let lit = ["sheet.glb", "--points", "200", "--hz", "10", "--size", "96x64", "--frames", "3", "-o", "lit"];
    headless(at, &lit);
    for name in ["frame-000.png", "frame-001.png", "frame-002.png"] {
        assert_eq!(png_size(&at.join("played").join(name)), (96, 64));
        // The same light, whether it comes from a file or from a server.
        let read = |folder: &str| std::fs::read(at.join(folder).join(name)).unwrap();
        assert!(read("played") == read("lit"), "{name}");
    }
    for view in ["beauty", "visibility", "normal", "points", "texels", "weights", "age", "error"] {
        let out = format!("views/{view}");
        headless(
            at,
            &["sheet.glb", "--stream", "sheet.dapple", "--size", "64x48", "--view", view, "-o", &out],
        );
        assert_eq!(png_size(&at.join(out).join("frame-000.png")), (64, 48));
    }
    fail(at, &["view", "sheet.glb", "--headless", "--frames", "0"], &["--frames"]);
}
