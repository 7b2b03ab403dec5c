//! What a client's processor does: load, updates, memory.

use std::sync::Arc;

use dapple_render::psao::atlas::{AtlasParams, PointChange, VisibilityAtlas};
use dapple_render::psao::cells::PointCells;
use dapple_render::psao::hash::PointHash;
use dapple_render::psao::{Hat, MovingLeastSquares};
use dapple_scene::Scene;
use dapple_store::points::PointStore;
use serde_json::{Value, json};

use crate::clock::{Took, median, time};

/// Share of the points that truly change in a frame of the atrium.
const CHANGED: f64 = 0.034;
/// Points of a cluster that changes together.
const CLUSTER: usize = 256;
/// What the store holds for each point: position, normal, value.
const STORE_BYTES: f64 = 15.0;

/// An atlas with all work done, and what that took.
pub(crate) fn load_atlas(scene: &Scene, store: &PointStore) -> (VisibilityAtlas, Took) {
    let mut atlas = VisibilityAtlas::new(store.layout().clone(), scene, None, AtlasParams::default());
    let took = time(|| while !atlas.work(scene, store.visibility(), usize::MAX).is_complete() {});
    (atlas, took)
}

/// Least and median. Other work on the machine only ever adds, so the least is what the work itself takes.
fn least_and_median(mut values: Vec<f64>) -> (f64, f64) {
    values.sort_by(f64::total_cmp);
    (values.first().copied().unwrap_or(f64::NAN), median(values))
}

/// Load, updates and memory of one store, printed and returned.
pub(crate) fn measure(scene: &Scene, store: &Arc<PointStore>, rounds: usize) -> Value {
    let points = store.layout().len();
    let loads: Vec<Took> = (0..rounds.min(3)).map(|_| load_atlas(scene, store).1).collect();
    // Several threads work for seconds, so processor time tells; of a millisecond it knows nothing.
    let load_cpu_s = least_and_median(loads.iter().map(|t| t.cpu_ms.unwrap_or(t.wall_ms) * 1e-3).collect()).0;
    let load_wall_s = median(loads.iter().map(|t| t.wall_ms * 1e-3).collect());
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
        let mut took = Vec::new();
        for round in 0..20 * rounds {
            let changes: Vec<PointChange> = changed
                .iter()
                .map(|&point| {
                    let old = values[point as usize];
                    let new = old.wrapping_add(if round % 2 == 0 { 37 } else { 219 });
                    values[point as usize] = new;
                    PointChange { point, old, new }
                })
                .collect();
            let one = time(|| {
                atlas.begin_update(1.0);
                atlas.apply(changes);
            });
            took.push(one.wall_ms);
            atlas.take_dirty();
        }
        least_and_median(took)
    };
    let (scattered_ms, clustered_ms) = (update(&scattered), update(&clustered));
    let atlas_bytes = atlas.memory_bytes() as f64 / points as f64;
    let paper =
        PointHash::new(store.layout(), store.visibility(), Hat::default()).expect("the tables are made");
    let direct = PointCells::new(store.layout(), store.visibility(), MovingLeastSquares::default())
        .expect("the tables are made");
    let a_point = |(shown, kept): (u64, u64)| (shown + kept) as f64 / points as f64;
    println!("\nprocessor, {points} points");
    println!(
        "  atlas, load (charts, weights, sums): {load_cpu_s:.2} s of processor time, {load_wall_s:.2} s of the wall's"
    );
    println!(
        "  atlas, update of {count} points, least and median: scattered {scattered_ms:.3?} ms, clustered {clustered_ms:.3?} ms"
    );
    println!("  atlas, memory: {atlas_bytes:.1} bytes a point, and {STORE_BYTES} of the store");
    println!("  paper: {:.1} bytes a point, {:?}", a_point(paper.bytes()), paper.overflow());
    println!("  direct: {:.1} bytes a point", a_point(direct.bytes()));
    json!({
        "points": points,
        "atlas_load_cpu_s": load_cpu_s,
        "atlas_load_wall_s": load_wall_s,
        "changed_points": count,
        "update_scattered_least_ms": scattered_ms.0,
        "update_scattered_median_ms": scattered_ms.1,
        "update_clustered_least_ms": clustered_ms.0,
        "update_clustered_median_ms": clustered_ms.1,
        "atlas_bytes_a_point": atlas_bytes,
        "store_bytes_a_point": STORE_BYTES,
        "paper_bytes_a_point": a_point(paper.bytes()),
        "paper_discarded": paper.overflow().points(),
        "direct_bytes_a_point": a_point(direct.bytes()),
    })
}
