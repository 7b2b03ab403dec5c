//! Light in parts, each by a worker: viewers over MoQ take those that they see.
#![cfg(all(unix, feature = "moq"))]
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod common;

use std::process::Stdio;
use std::time::{Duration, Instant};

use common::live::{Served, Viewer};
use common::moq::{At, MoqViewer, config, runtime};
use common::relay::Relay;
use dapple_scene::glam::Vec3;
use dapple_scene::{PosedCamera, Scene};
use dapple_server::shards::Shard;
use dapple_session::Event;
use dapple_store::points::PointStore;
use dapple_trace::psao::generate::GenerateParams;
use tempfile::TempDir;

const PARTS: u32 = 4;

fn params() -> GenerateParams {
    GenerateParams { points_per_m2: 20.0, ..GenerateParams::default() }
}

/// A program that does not outlive its test.
struct Killed(std::process::Child);

impl Drop for Killed {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn worker(folder: &TempDir, port: u16, part: u32) -> Killed {
    let (url, part) = (format!("http://127.0.0.1:{port}/"), format!("{part}/{PARTS}"));
    let mut command = common::command::dapple(
        folder.path(),
        &["worker", "--connect", &url, "--shard", &part, "--threads", "1"],
    );
    Killed(command.stdout(Stdio::null()).spawn().unwrap())
}

/// The parts of which something is held.
fn parts_of(store: Option<&PointStore>, parts: &[Vec<u32>]) -> Vec<usize> {
    let has = |part: &&Vec<u32>| {
        store.is_some_and(|store| part.iter().any(|i| store.layout().set_of_instance(*i).is_some()))
    };
    (0..parts.len()).filter(|number| has(&&parts[*number])).collect()
}

/// The values of the points of some instances.
fn values(store: &PointStore, instances: &[u32]) -> Vec<u8> {
    let sets = instances.iter().filter_map(|instance| store.layout().set_of_instance(*instance));
    sets.flat_map(|set| store.visibility()[set.first as usize..][..set.len()].to_vec()).collect()
}

/// Whether both have the same values wherever the first has points.
fn agrees(some: &PointStore, all: &PointStore) -> bool {
    let instances: Vec<u32> = some.layout().sets().iter().map(|set| set.instance).collect();
    values(some, &instances) == values(all, &instances)
}

/// Cameras that see nothing, some parts and all of them.
fn cameras(scene: &Scene) -> [PosedCamera; 3] {
    let bounds = scene.bounds_world(&scene.pose(0.0));
    let (center, size) = (bounds.center(), bounds.max - bounds.min);
    let outside = center + Vec3::new(size.x, 0.0, 0.0);
    let corner = bounds.max - 0.1 * size;
    [
        PosedCamera::look_at(outside, outside + Vec3::X, 0.8),
        PosedCamera::look_at(corner, corner + Vec3::new(0.2, 0.3, 1.0), 0.3),
        PosedCamera::look_at(outside + Vec3::Y, center, 1.4),
    ]
}

async fn takes_what_it_sees(served: &Served, at: &At, oracle: &mut Viewer) {
    let scene = served.scene();
    let parts = Shard::all(PARTS, &scene, &params()).unwrap();
    let [nothing, some, everything] = cameras(&scene);
    let mut viewer = MoqViewer::join_as(at, &scene, config(5), true).await;
    viewer.guest.look(&nothing, 1.5);
    viewer.until("the least that it takes", |v| v.parts.store().is_some()).await;
    let start = Instant::now();
    while start.elapsed() < Duration::from_secs(2) {
        viewer.talk().await;
    }
    // One it takes in any case, so that it hears how old light is.
    let (one, none) = (parts_of(viewer.parts.store(), &parts), viewer.bytes);
    assert_eq!(one.len(), 1, "it sees nothing");
    viewer.guest.look(&some, 1.5);
    viewer.until("the light that it sees", |v| v.bytes > none).await;
    let start = Instant::now();
    while start.elapsed() < Duration::from_secs(2) {
        viewer.talk().await;
    }
    let (held, bytes) = (parts_of(viewer.parts.store(), &parts), viewer.bytes);
    assert!(!held.is_empty() && held.len() < PARTS as usize, "it sees some parts, and has {held:?}");
    viewer.guest.look(&everything, 1.5);
    viewer.until("all light", |v| parts_of(v.parts.store(), &parts).len() == PARTS as usize).await;
    assert!(viewer.bytes > bytes);
    println!("{} bytes for {} of {PARTS} parts, {} for all", bytes - none, held.len(), viewer.bytes);
    // When time stands still, what it holds is to the bit what one who takes the whole holds.
    let start = Instant::now();
    while viewer.parts.store() != oracle.subscriber.store() {
        assert!(start.elapsed() < Duration::from_secs(30), "they hold different light");
        oracle.run(Duration::from_millis(20));
        viewer.talk().await;
    }
    // Out of sight a part is taken no more, once it has been so for a while; what was held of it stays.
    viewer.guest.look(&nothing, 1.5);
    assert!(oracle.guest.send(Event::Play));
    oracle.until("the clock runs", |v| !v.guest.has_pending());
    let start = Instant::now();
    while start.elapsed() < Duration::from_secs(7) {
        oracle.run(Duration::from_millis(5));
        viewer.talk().await;
    }
    let held = viewer.parts.store().unwrap().clone();
    let start = Instant::now();
    while start.elapsed() < Duration::from_secs(2) {
        oracle.run(Duration::from_millis(5));
        viewer.talk().await;
    }
    let now = viewer.parts.store().unwrap();
    let taken = (0..parts.len()).filter(|part| values(now, &parts[*part]) != values(&held, &parts[*part]));
    assert!(taken.count() <= 1, "light that it does not see");
    assert!(
        !agrees(viewer.parts.store().unwrap(), oracle.subscriber.store().unwrap()),
        "nothing changed meanwhile"
    );
    assert!(oracle.guest.send(Event::Pause));
    oracle.until("the clock stands", |v| !v.guest.has_pending());
    viewer.guest.look(&everything, 1.5);
    let start = Instant::now();
    while viewer.parts.store() != oracle.subscriber.store() {
        assert!(start.elapsed() < Duration::from_secs(30), "they hold different light");
        oracle.run(Duration::from_millis(20));
        viewer.talk().await;
    }
    assert!(viewer.refused.is_none() && viewer.ended.is_none(), "{:?} {:?}", viewer.refused, viewer.ended);
}

#[test]
fn viewers_take_the_parts_that_they_see() {
    let folder = TempDir::new().unwrap();
    let relay = Relay::start(folder.path(), None);
    let workers = PARTS.to_string();
    let mut arguments =
        vec!["serve", "--builtin", "atrium", "--detail", "0.1", "--points", "20", "--hz", "10"];
    arguments.extend([
        "--port",
        "0",
        "--workers",
        &workers,
        "--threshold",
        "0",
        "--load",
        "1",
        "--moq",
        "--paused",
    ]);
    if let Some(relay) = &relay {
        arguments.extend(["--relay", &relay.url, "--moq-name", "test/parts"]);
    }
    let served = Served::run(folder.path(), &arguments);
    let at = At::of(&served);
    let mut oracle = Viewer::join(served.port, &served.scene(), config(1));
    let mut running: Vec<Killed> = (1..=PARTS).map(|part| worker(&folder, served.port, part)).collect();
    let instances = served.scene().instances.len();
    oracle.until("the light of all", |v| {
        v.subscriber.store().is_some_and(|store| store.layout().sets().len() == instances)
    });
    runtime().block_on(async {
        takes_what_it_sees(&served, &at, &mut oracle).await;
        if let Some(relay) = &relay {
            let by_relay = At { url: relay.url.clone(), name: "test/parts".to_owned(), certificate: None };
            takes_what_it_sees(&served, &by_relay, &mut oracle).await;
        }
        // One worker dies and another takes its place: who takes its part goes on.
        let scene = served.scene();
        let [nothing, _, everything] = cameras(&scene);
        let last = Shard::all(PARTS, &scene, &params()).unwrap().pop().unwrap();
        let mut viewer = MoqViewer::join_as(&at, &served.scene(), config(6), true).await;
        viewer.guest.look(&everything, 1.5);
        viewer.until("light", |v| v.parts.store().is_some()).await;
        drop(running.pop());
        assert!(oracle.guest.send(Event::Seek { time_s: 2.5 }));
        oracle.until("the clock is set", |v| !v.guest.has_pending());
        let of_last = |v: &Viewer| v.subscriber.store().map(|store| values(store, &last));
        let stale = of_last(&oracle);
        running.push(worker(&folder, served.port, PARTS));
        oracle.until("the new worker's light", |v| of_last(v) != stale);
        let start = Instant::now();
        let mut same_since = Instant::now();
        while same_since.elapsed() < Duration::from_secs(2) {
            assert!(start.elapsed() < Duration::from_secs(60), "they hold different light");
            oracle.run(Duration::from_millis(20));
            viewer.talk().await;
            if viewer.parts.store() != oracle.subscriber.store() {
                same_since = Instant::now();
            }
        }
        // Nobody else is there, and it looks away: it still hears that the light is right.
        drop(oracle);
        viewer.guest.look(&nothing, 1.5);
        let start = Instant::now();
        let (mut heard, mut longest) = (Instant::now(), Duration::ZERO);
        while start.elapsed() < Duration::from_secs(9) {
            let before = viewer.guest.newest().map(|head| head.stamp_us);
            viewer.talk().await;
            if viewer.guest.newest().map(|head| head.stamp_us) != before {
                longest = longest.max(heard.elapsed());
                heard = Instant::now();
            }
        }
        assert!(longest.max(heard.elapsed()) < Duration::from_secs(5), "{longest:?} without a word");
    });
}
