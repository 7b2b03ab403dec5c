//! What a client's processor does: load, updates, memory.

use std::sync::Arc;
use std::time::Instant;

use dapple_render::psao::atlas::{AtlasParams, PointChange, VisibilityAtlas};
use dapple_render::psao::cells::PointCells;
use dapple_render::psao::hash::PointHash;
use dapple_render::psao::{Hat, MovingLeastSquares};
use dapple_scene::Scene;
use dapple_store::points::PointStore;
use serde_json::{Value, json};

use crate::clock::median;

/// Share of the points that truly change in a frame of the atrium.
const CHANGED: f64 = 0.034;
/// Points of a cluster that changes together.
const CLUSTER: usize = 256;
/// What the store holds for each point: position, normal, value.
const STORE_BYTES: f64 = 15.0;

/// An atlas with all work done, and how many seconds that took.
pub(crate) fn load_atlas(scene: &Scene, store: &PointStore) -> (VisibilityAtlas, f64) {
    let start = Instant::now();
    let mut atlas = VisibilityAtlas::new(store.layout().clone(), scene, None, AtlasParams::default());
    while !atlas.work(scene, store.visibility(), usize::MAX).is_complete() {}
    (atlas, start.elapsed().as_secs_f64())
}

/// Load, updates and memory of one store, printed and returned.
pub(crate) fn measure(scene: &Scene, store: &Arc<PointStore>, rounds: usize) -> Value {
    let points = store.layout().len();
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool of one thread");
    let loads = |pool: Option<&rayon::ThreadPool>| {
        let once = || load_atlas(scene, store).1;
        median((0..rounds.min(5)).map(|_| pool.map_or_else(once, |pool| pool.install(once))).collect())
    };
    let (load_all_s, load_one_s) = (loads(None), loads(Some(&one)));
    let (mut atlas, _) = load_atlas(scene, store);
    let count = (CHANGED * points as f64) as usize;
    let scattered: Vec<u32> = (0..count).map(|i| (i * points / count) as u32).collect();
    let clusters = count.div_ceil(CLUSTER);
    let clustered: Vec<u32> = (0..clusters)
        .flat_map(|c| (0..CLUSTER).map(move |i| (c * points / clusters + i) as u32))
        .filter(|&p| (p as usize) < points)
        .take(count)
        .collect();
    let mut update = |changed: &[u32]| {
        let mut values = store.visibility().to_vec();
        let mut took = (Vec::new(), Vec::new());
        for round in 0..2 * rounds {
            let changes: Vec<PointChange> = changed
                .iter()
                .map(|&point| {
                    let old = values[point as usize];
                    let new = old.wrapping_add(if round % 2 == 0 { 37 } else { 219 });
                    values[point as usize] = new;
                    PointChange { point, old, new }
                })
                .collect();
            let start = Instant::now();
            atlas.begin_update();
            let begun = start.elapsed().as_secs_f64() * 1e3;
            atlas.apply(changes);
            took.1.push(start.elapsed().as_secs_f64() * 1e3);
            took.0.push(begun);
            atlas.take_dirty();
        }
        (median(took.0), median(took.1))
    };
    let (scattered_ms, clustered_ms) = (update(&scattered), update(&clustered));
    let atlas_bytes = atlas.memory_bytes() as f64 / points as f64;
    let start = Instant::now();
    let paper = PointHash::new(store.layout(), store.visibility(), Hat::default()).expect("the tables are made");
    let paper_s = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let direct = PointCells::new(store.layout(), store.visibility(), MovingLeastSquares::default())
        .expect("the tables are made");
    let direct_s = start.elapsed().as_secs_f64();
    let a_point = |(shown, kept): (u64, u64)| (shown + kept) as f64 / points as f64;
    println!("\nprocessor, {points} points");
    println!("  atlas, load (charts, weights, sums): {load_all_s:.2} s, on one thread {load_one_s:.2} s");
    println!("  atlas, update of {count} points: scattered {:.3} ms, clustered {:.3} ms", scattered_ms.1, clustered_ms.1);
    println!("    of which to begin it: {:.3} ms, {:.3} ms", scattered_ms.0, clustered_ms.0);
    println!("  atlas, memory: {atlas_bytes:.1} bytes a point, and {STORE_BYTES} of the store");
    println!("  paper: made in {paper_s:.2} s, {:.1} bytes a point, {:?}", a_point(paper.bytes()), paper.overflow());
    println!("  direct: made in {direct_s:.2} s, {:.1} bytes a point", a_point(direct.bytes()));
    json!({
        "points": points,
        "atlas_load_s": load_all_s,
        "atlas_load_one_thread_s": load_one_s,
        "changed_points": count,
        "update_scattered_ms": scattered_ms.1,
        "update_clustered_ms": clustered_ms.1,
        "begin_update_scattered_ms": scattered_ms.0,
        "begin_update_clustered_ms": clustered_ms.0,
        "atlas_bytes_a_point": atlas_bytes,
        "store_bytes_a_point": STORE_BYTES,
        "paper_bytes_a_point": a_point(paper.bytes()),
        "paper_discarded": paper.overflow().points(),
        "direct_bytes_a_point": a_point(direct.bytes()),
    })
}
