//! Soft shadows of area lights from a server to viewers: evaluated, recorded, and served live.
#![cfg(unix)]
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod common;

use std::time::Duration;

use common::command::{dapple, fail, succeed};
use common::live::{Served, Viewer};
use common::made;
use dapple_scene::area_lights::AreaLights;
use dapple_scene::{Edit, Placement};
use dapple_session::{Event, GuestConfig};
use dapple_store::light_visibility::LightVisibility;
use serde_json::Value;
use tempfile::TempDir;

/// A scene with five lamps, and little work.
const SMALL: [&str; 6] = ["--builtin", "cornell", "--detail", "0.2", "--points", "60"];

/// Its points.
const POINTS: usize = 42_489;

fn row<'a>(results: &'a Value, method: &str) -> &'a Value {
    let rows = results["cases"][0]["rows"].as_array().unwrap();
    rows.iter().find(|row| row["method"] == method).unwrap_or_else(|| panic!("no row of {method}"))
}

#[test]
fn shadows_that_are_streamed_bring_pictures_nearer_to_rays() {
    let folder = TempDir::new().unwrap();
    let more = [
        "--methods",
        "slc,psao,rtao-16,none",
        "--size",
        "96x54",
        "--frames",
        "2",
        "--seconds",
        "0.5",
        "--reference-rays",
        "64",
        "--supersample",
        "1",
        "--point-rays",
        "16",
        "--points",
        "60",
        "--out",
        "out",
    ];
    let common = ["eval", "--builtin", "cornell", "--detail", "0.2"];
    succeed(folder.path(), &[&common[..], &more[..]].concat());
    let text = std::fs::read_to_string(folder.path().join("out/results.json")).unwrap();
    let results: Value = serde_json::from_str(&text).unwrap();
    let psnr = |method| row(&results, method)["psnr_db"]["value"].as_f64().unwrap();
    let [slc, psao, rays, none] = ["slc", "psao", "rtao-16", "none"].map(psnr);
    println!("slc {slc:.2} dB, psao with lights unshadowed {psao:.2}, 16 rays {rays:.2}, none {none:.2}");
    assert!(slc > psao + 3.0 && psao > none - 0.5 && rays > psao, "{slc}, {psao}, {rays}, {none}");
    // Both have the same ambient light, and lights are bits.
    let of = |method: &str, what: &str| row(&results, method)[what].clone();
    assert_eq!(of("slc", "visibility_psnr_db"), of("psao", "visibility_psnr_db"));
    let bytes = |method| of(method, "snapshot_bytes").as_u64().unwrap();
    assert!(bytes("slc") > bytes("psao"));
    let kbit = |method| of(method, "kbit_per_s")["value"].as_f64().unwrap();
    assert!(kbit("slc") >= kbit("psao") && kbit("psao") > 0.0);
    let traced = |method| of(method, "rays").as_u64().unwrap();
    assert!(traced("slc") > traced("psao"));
    // Nothing emits there.
    std::fs::write(folder.path().join("lid.glb"), made::two_squares_under_a_lid("{}", "{}")).unwrap();
    fail(folder.path(), &["eval", "lid.glb", "--methods", "slc", "--out", "dark"], &["slc", "emits"]);
    assert!(!folder.path().join("dark/results.json").exists());
}

#[test]
fn a_recording_holds_them_and_says_so() {
    let folder = TempDir::new().unwrap();
    let record = |name: &str, more: &[&str]| {
        let common = [&["record"], &SMALL[..], &["--seconds", "1", "-o", name]].concat();
        succeed(folder.path(), &[&common[..], more].concat());
        succeed(folder.path(), &["inspect", name])
    };
    assert!(!record("plain.dapple", &[]).contains("lights"));
    let told = record("lit.dapple", &["--area-lights"]);
    assert!(told.contains("lights     5: how much of each"), "{told}");
    let bytes = |name: &str| std::fs::metadata(folder.path().join(name)).unwrap().len();
    assert!(bytes("lit.dapple") > bytes("plain.dapple"));
    // What is hardly seen may wait, and some of it never comes.
    record("at-once.dapple", &["--area-lights=0"]);
    record("late.dapple", &["--area-lights=0.5"]);
    let sizes = ["at-once.dapple", "lit.dapple", "late.dapple"].map(bytes);
    assert!(sizes[0] > sizes[1] && sizes[1] > sizes[2], "{sizes:?}");
    for wrong in ["--area-lights=2", "--area-lights=-1", "--area-lights=nan"] {
        let refused = [&["record"], &SMALL[..], &["-o", "none.dapple", wrong]].concat();
        fail(folder.path(), &refused, &["--area-lights", "0 to 1"]);
    }
}

fn lights(viewer: &Viewer) -> Option<LightVisibility> {
    viewer.subscriber.lights().cloned()
}

#[test]
fn who_watches_holds_the_lights_that_the_server_traced() {
    live(&[]);
}

#[test]
fn lights_of_workers_come_together() {
    live(&["--workers", "2"]);
}

/// Joins, moves something into the light, and joins late.
fn live(more: &[&str]) {
    let folder = TempDir::new().unwrap();
    let common = [&["serve"], &SMALL[..], &["--hz", "20", "--area-lights", "--port", "0"]].concat();
    let served = Served::run(folder.path(), &[&common[..], more].concat());
    let scene = served.scene();
    let url = format!("http://127.0.0.1:{}/", served.port);
    let workers: Vec<_> = ["1/2", "2/2"]
        .into_iter()
        .filter(|_| !more.is_empty())
        .map(|part| {
            let mut command = dapple(folder.path(), &["worker", "--connect", &url, "--shard", part]);
            Killed(command.stdout(std::process::Stdio::null()).spawn().unwrap())
        })
        .collect();
    let join = |seed| Viewer::join(served.port, &scene, GuestConfig { seed, ..GuestConfig::default() });
    let mut first = join(1);
    let points = |viewer: &Viewer| lights(viewer).map_or(0, |lights| lights.points());
    first.until("light of all parts", |viewer| points(viewer) == POINTS);
    assert!(first.guest.send(Event::Pause));
    first.until("time stands still", |viewer| !viewer.guest.has_pending());
    first.run(Duration::from_millis(1500));
    let before = lights(&first).unwrap();
    let seen = before.values();
    let there = AreaLights::new(&scene, &scene.pose(0.0)).len() as u32;
    assert_eq!(before.lights(), there);
    assert!(seen.contains(&0) && seen.contains(&31));

    // A small box goes elsewhere: its shadow does too.
    let placement =
        Placement { translation: [0.3, 0.4, 0.2], rotation: [0.0, 0.0, 0.0, 1.0], scale: [0.5; 3] };
    let change = Edit::Place { node: scene.instances[1].node, placement };
    assert!(first.guest.send(Event::Edit { change }));
    first.until("the event is answered", |viewer| !viewer.guest.has_pending());
    first.until("the shadow moves", |viewer| lights(viewer).as_ref() != Some(&before));
    first.run(Duration::from_millis(1000));
    let mut late = join(2);
    late.until("light of lights", |viewer| lights(viewer).is_some());
    late.until("all of it", |viewer| points(viewer) == POINTS);
    first.run(Duration::from_millis(500));
    late.run(Duration::from_millis(500));
    let [first, late] = [&first, &late].map(|viewer| lights(viewer).unwrap().values().to_vec());
    let differ: Vec<_> = (0..).zip(first.iter().zip(&late)).filter(|(_, (a, b))| a != b).collect();
    assert!(differ.is_empty(), "{} values, such as {:?}", differ.len(), &differ[..differ.len().min(5)]);
    drop(workers);
}

/// A program that does not outlive its test.
struct Killed(std::process::Child);

impl Drop for Killed {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}
