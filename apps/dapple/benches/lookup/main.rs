//! What a look-up costs: atlas, the paper's hash table and direct least squares against screen-space occlusion, on one
//! adapter in one run, and what a client's processor does. `make bench`, or
//! `cargo bench -p dapple --bench lookup -- --help`.

mod clock;
mod cpu;
#[path = "../../tests/common/fullscreen.rs"]
mod fullscreen;
mod passes;
#[path = "../../../../crates/trace/benches/rays/results.rs"]
mod results;
mod view;

use std::sync::Arc;

use anyhow::{Context, Result, bail};
use clap::Parser;
use dapple_gpu::testing::block_on;
use dapple_gpu::{Gpu, wgpu};
use dapple_render::psao::cells::PointCells;
use dapple_render::psao::hash::PointHash;
use dapple_render::psao::{Hat, MovingLeastSquares};
use dapple_store::points::PointStore;
use dapple_trace::Tracer;
use dapple_trace::psao::generate::{GenerateParams, generate_points};
use serde_json::{Value, json};

use clock::{Took, median, time};
use fullscreen::Fragments;
use passes::Candidate;
use view::{GeometryPass, View};

/// Occlusion distance, metres ([Neff2023] sec. 4).
const RADIUS_M: f32 = 0.6;

/// Cost of looking visibility up.
#[derive(Parser)]
struct Arguments {
    /// Numbers of points.
    #[arg(long, value_delimiter = ',', default_values_t = [64_000, 200_000, 1_000_000, 3_000_000])]
    points: Vec<u32>,
    /// Rounds; in each, every candidate is timed once, in turn.
    #[arg(long, default_value_t = 15)]
    rounds: usize,
    /// Picture size; on software adapters at most 640x360.
    #[arg(long, default_value = "640x360")]
    size: String,
    /// Tessellation of the atrium.
    #[arg(long, default_value_t = 0.5)]
    detail: f32,
    /// Where the figures are written.
    #[arg(long, default_value = results::FILE)]
    out: std::path::PathBuf,
    /// Processor only.
    #[arg(long)]
    no_gpu: bool,
    /// Given by cargo.
    #[arg(long, hide = true)]
    bench: bool,
}

fn main() -> Result<()> {
    let arguments = Arguments::parse();
    let size = arguments.size.split_once('x').and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
    let Some((mut width, mut height)): Option<(u32, u32)> = size.filter(|s| s.0 > 0 && s.1 > 0) else {
        bail!("--size is {}, write WIDTHxHEIGHT", arguments.size);
    };
    let gpu = if arguments.no_gpu { None } else { find_gpu()? };
    let software =
        gpu.as_ref().is_some_and(|gpu| gpu.adapter.get_info().device_type == wgpu::DeviceType::Cpu);
    if software && (width > 640 || height > 360) {
        println!("a software adapter: 640x360 instead of {width}x{height}");
        (width, height) = (640, 360);
    }
    let seen = View::new(arguments.detail, width, height);
    println!(
        "atrium, {} triangles, {width}x{height}, {} rounds",
        seen.scene.triangle_count(),
        arguments.rounds
    );

    let (mut costs, mut processor) = (Vec::new(), Value::Null);
    for &wanted in &arguments.points {
        let store = Arc::new(lay_points(&seen, wanted)?);
        if let Some(gpu) = &gpu {
            costs.push(compare(gpu, &seen, &store, arguments.rounds, if software { 1 } else { 20 })?);
        }
        // The figures of the processor are those of some 200,000 points, or of the only number asked for.
        if processor.is_null() && (wanted >= 200_000 || arguments.points.len() == 1) {
            processor = cpu::measure(&seen.scene, &store, arguments.rounds);
        }
    }
    let section = json!({
        "schema": 1,
        "adapter": gpu.as_ref().map(Gpu::description),
        "software": software,
        "width": width,
        "height": height,
        "rounds": arguments.rounds,
        "costs": costs,
        "processor": processor,
    });
    results::merge(&arguments.out, "lookup", section)
}

/// The adapter, or none after saying so aloud.
fn find_gpu() -> Result<Option<Gpu>> {
    match block_on(Gpu::headless()) {
        Ok(gpu) => {
            println!("adapter: {}", gpu.description());
            Ok(Some(gpu))
        }
        Err(error) if std::env::var_os("REQUIRE_GPU").is_some_and(|v| v == "1") => {
            Err(error).context("REQUIRE_GPU=1")
        }
        Err(error) => {
            println!("NO ADAPTER, so only the processor is measured: {error}");
            Ok(None)
        }
    }
}

/// About `wanted` points on the atrium, with values that nobody traced: cost does not depend on them.
fn lay_points(seen: &View, wanted: u32) -> Result<PointStore> {
    let pose = seen.scene.pose(0.0);
    let tracer = Tracer::new(&seen.scene, &pose);
    let lay = |points_per_m2: f32| {
        let params = GenerateParams { points_per_m2, inside_rays: 0, ..GenerateParams::default() };
        generate_points(&seen.scene, &pose, &tracer, &params, &|_| ())
    };
    let few = lay(8.0)?.layout.len();
    let layout = lay(8.0 * wanted as f32 / few as f32)?.layout;
    let values = layout
        .sets()
        .iter()
        .flat_map(|set| {
            (0..set.len()).map(|i| {
                let p = set.position_rest(i, layout.quantum_m());
                ((p.x + p.y + p.z).fract().abs() * 200.0) as u8 + 55
            })
        })
        .collect();
    Ok(PointStore::new(layout, values)?)
}

/// Times every candidate on one store.
fn compare(gpu: &Gpu, seen: &View, store: &PointStore, rounds: usize, repeat: u32) -> Result<Value> {
    let points = store.layout().len();
    let (atlas, load) = cpu::load_atlas(&seen.scene, store);
    let frame = Fragments::new(gpu.clone(), seen.gbuffer.width, &seen.fragments, &seen.charts(&atlas));
    let mut paper = PointHash::new(store.layout(), store.visibility(), Hat::default())?;
    let mut direct = PointCells::new(store.layout(), store.visibility(), MovingLeastSquares::default())?;
    let candidates = [
        passes::base(&frame),
        passes::ssao(&frame, seen, RADIUS_M),
        passes::atlas(&frame, &atlas),
        passes::paper(&frame, &mut paper),
        passes::direct(&frame, &mut direct),
    ];
    check(&candidates, &frame, seen)?;
    let geometry = GeometryPass::new(seen, &frame);

    let mut took = vec![Vec::new(); candidates.len() + 1];
    // The first round warms up and is dropped.
    for round in 0..=rounds {
        for (i, took) in took.iter_mut().enumerate() {
            let one = time(|| {
                let mut encoder = gpu.device.create_command_encoder(&Default::default());
                for _ in 0..repeat {
                    match candidates.get(i) {
                        Some(candidate) => candidate.record(&frame, &mut encoder),
                        None => geometry.record(&mut encoder),
                    }
                }
                gpu.queue.submit([encoder.finish()]);
                // A failure shows as a fault below.
                let _ = gpu.device.poll(wgpu::PollType::wait_indefinitely());
            });
            if round > 0 {
                took.push(one);
            }
        }
    }
    if let Some(fault) = gpu.take_fault() {
        bail!("{fault}");
    }
    Ok(summary(points, load.wall_ms * 1e-3, &candidates, &took, f64::from(repeat)))
}

/// Every candidate must show what its twin gives: who measures nothing is fast.
fn check(candidates: &[Candidate; 5], frame: &Fragments, seen: &View) -> Result<()> {
    let shown: Vec<Vec<f32>> = candidates.iter().map(|c| c.visibility(frame)).collect();
    let mean = |found: &[f32]| {
        let covered = found.iter().zip(&seen.fragments).filter(|(_, f)| f.is_some());
        let (sum, count) = covered.fold((0.0f64, 0u32), |(s, n), (v, _)| (s + f64::from(*v), n + 1));
        sum / f64::from(count.max(1))
    };
    for (candidate, shown) in candidates.iter().zip(&shown).skip(1) {
        if !(0.05..0.99).contains(&mean(shown)) {
            bail!("{}: mean visibility {}, so it looks nothing up", candidate.name, mean(shown));
        }
    }
    let (atlas, direct) = (mean(&shown[2]), mean(&shown[4]));
    if (atlas - direct).abs() > 0.03 {
        bail!("atlas and direct least squares differ: mean visibility {atlas} and {direct}");
    }
    Ok(())
}

/// Prints and returns medians, and what each adds to the base as a part of what screen-space occlusion adds, of the
/// least of all rounds.
fn summary(points: usize, load_s: f64, candidates: &[Candidate], took: &[Vec<Took>], repeat: f64) -> Value {
    let wall = |i: usize| median(took[i].iter().map(|t| t.wall_ms / repeat).collect());
    let cpu = |i: usize| {
        let all: Option<Vec<f64>> = took[i].iter().map(|t| t.cpu_ms.map(|ms| ms / repeat)).collect();
        all.map(median)
    };
    // Other work on the machine only ever adds, so the least of the rounds comes nearest to what the work itself takes.
    let ratio = |i: usize, of: &dyn Fn(&Took) -> Option<f64>| -> Option<f64> {
        let least = |i: usize| {
            let rounds: Option<Vec<f64>> = took[i].iter().map(of).collect();
            rounds?.into_iter().reduce(f64::min)
        };
        Some((least(i)? - least(0)?) / (least(1)? - least(0)?))
    };
    println!("\n{points} points (atlas made in {load_s:.2} s)");
    println!("  {:<14}{:>10}{:>10}{:>14}{:>14}", "", "wall ms", "cpu ms", "of SSAO, wall", "of SSAO, cpu");
    let number = |v: Option<f64>| v.map_or_else(|| "–".to_owned(), |v| format!("{v:.3}"));
    let mut rows = Vec::new();
    for i in 0..took.len() {
        let name = candidates.get(i).map_or("g-buffer", |c| c.name);
        let is_added = i > 0 && i < candidates.len();
        let of_wall = is_added.then(|| ratio(i, &|t| Some(t.wall_ms))).flatten();
        let of_cpu = is_added.then(|| ratio(i, &|t| t.cpu_ms)).flatten();
        println!(
            "  {name:<14}{:>10.2}{:>10}{:>14}{:>14}",
            wall(i),
            number(cpu(i)),
            number(of_wall),
            number(of_cpu)
        );
        rows.push(json!({
            "name": name, "wall_ms": wall(i), "cpu_ms": cpu(i), "of_ssao_wall": of_wall, "of_ssao_cpu": of_cpu,
        }));
    }
    json!({ "points": points, "atlas_load_s": load_s, "candidates": rows })
}
