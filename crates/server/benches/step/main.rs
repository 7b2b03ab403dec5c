//! What a step of the server costs, and how many points a second it updates: pose, refit, select, trace, encode.
//! `cargo bench -p dapple-server --bench step -- --help`.

#[path = "../../../trace/benches/rays/clock.rs"]
#[allow(dead_code, reason = "the other bench times threads, too")]
mod clock;
#[path = "../../../trace/benches/rays/results.rs"]
mod results;

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use clap::Parser;
use dapple_scene::builtin::{self, BUILTINS};
use dapple_scene::{NoFiles, Pose, Scene};
use dapple_server::ServerConfig;
use dapple_stream::Publisher;
use dapple_trace::Tracer;
use dapple_trace::psao::generate::{GenerateParams, GeneratedPoints, generate_points};
use dapple_trace::psao::update::{StepInput, UpdateParams, Updater};
use serde_json::{Value, json};

use clock::{Took, median, time_process};

const STEPS_PER_SECOND: f64 = 30.0;
/// Processor time of a step, all threads together: half of two cores at 30 steps a second.
const GOAL_MS: f64 = 1000.0 / STEPS_PER_SECOND;
const PARTS: [&str; 5] = ["pose", "refit", "select", "trace", "encode"];

/// What a step of the server costs.
#[derive(Parser)]
struct Arguments {
    /// Built-in scenes; all by default.
    #[arg(long, value_delimiter = ',')]
    scenes: Vec<String>,
    /// About so many points.
    #[arg(long, default_value_t = 200_000)]
    points: u32,
    /// Steps, 1/30 s apart.
    #[arg(long, default_value_t = 60)]
    steps: usize,
    /// Threads.
    #[arg(long, default_value_t = 2)]
    threads: usize,
    /// A tenth of the points and 20 steps.
    #[arg(long)]
    quick: bool,
    /// Where the figures are written.
    #[arg(long, default_value = results::FILE)]
    out: PathBuf,
    /// Given by cargo.
    #[arg(long, hide = true)]
    bench: bool,
}

/// The figures of one step.
struct Step {
    /// Parallel to [`PARTS`].
    took: [Took; PARTS.len()],
    movers: usize,
    traced: u32,
    rays: u64,
    changed: usize,
    bytes: usize,
}

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<()> {
    // As a test (`cargo test --all-targets`) it has nothing to say.
    if !std::env::args().any(|a| ["--bench", "--help", "-h"].contains(&a.as_str())) {
        println!("skipped: a bench, run by `cargo bench -p dapple-server --bench step`");
        return Ok(());
    }
    let mut arguments = Arguments::parse();
    if arguments.quick {
        (arguments.points, arguments.steps) = (arguments.points / 10, 20);
    }
    if arguments.points == 0 || arguments.steps == 0 {
        bail!("--points and --steps are 1 or more");
    }
    if arguments.scenes.is_empty() {
        arguments.scenes = BUILTINS.iter().map(|b| b.name.to_owned()).collect();
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(arguments.threads).build()?;
    println!(
        "{} steps of 1/{STEPS_PER_SECOND} s on {} threads; goal: a step of 200000 points takes at most {GOAL_MS:.1} ms of \
         processor time",
        arguments.steps, arguments.threads
    );
    let mut all = Vec::new();
    for name in &arguments.scenes {
        let glb = builtin::glb(name, 1.0)?;
        let scene = dapple_scene::load(&format!("{name}.glb"), &glb, &NoFiles)?;
        all.push(pool.install(|| measure(name, &scene, &arguments))?);
    }
    let section = json!({
        "schema": 1, "steps": arguments.steps, "threads": arguments.threads,
        "steps_per_second": STEPS_PER_SECOND, "goal_cpu_ms": GOAL_MS, "scenes": all,
    });
    results::merge(&arguments.out, "step", section)
}

fn measure(name: &str, scene: &Scene, arguments: &Arguments) -> Result<Value> {
    let mut pose = scene.pose(0.0);
    let mut tracer = Tracer::new(scene, &pose);
    let points = lay(scene, &pose, &tracer, arguments.points)?;
    let count = points.anchors.len();
    let params = UpdateParams::default();
    let mut updater = Updater::new(scene, &pose, &tracer, points, params, &|_| ())?;
    let mut publisher = Publisher::new([0; 32], ServerConfig::default().publish);
    publisher.publish(updater.store());

    let mut steps = Vec::new();
    for step in 1..=arguments.steps {
        let before = pose;
        let (now, posing) = time_process(|| scene.pose(step as f64 / STEPS_PER_SECOND));
        pose = now;
        let ((), refitting) = time_process(|| tracer.update(scene, &pose));
        let input = StepInput::default();
        let ((), selecting) = time_process(|| updater.select(scene, &pose, &mut tracer, &input));
        let (report, tracing) = time_process(|| updater.trace_selected(scene, &pose, &tracer));
        let (frame, encoding) = time_process(|| publisher.publish(updater.store()));
        steps.push(Step {
            took: [posing, refitting, selecting, tracing, encoding],
            movers: movers(&before, &pose),
            traced: report.counts.traced(),
            rays: report.counts.rays(),
            changed: publisher.changed() as usize,
            bytes: frame.map_or(0, |frame| frame.bytes.len()),
        });
    }
    let bytes = updater.bytes_per_point();
    Ok(summary(name, scene, (count, bytes), params.rays, &steps, arguments.threads))
}

/// About `wanted` points, laid with the default settings but for their density.
fn lay(scene: &Scene, pose: &Pose, tracer: &Tracer, wanted: u32) -> Result<GeneratedPoints> {
    const FEW_PER_M2: f32 = 16.0;
    let lay = |points_per_m2: f32| {
        let params = GenerateParams { points_per_m2, ..GenerateParams::default() };
        generate_points(scene, pose, tracer, &params, &|_| ())
    };
    let few = lay(FEW_PER_M2)?.anchors.len().max(1);
    lay(FEW_PER_M2 * wanted as f32 / few as f32).context("points cannot be laid")
}

/// Instances that are placed or bent differently.
fn movers(before: &Pose, after: &Pose) -> usize {
    let pairs = before.instances.iter().zip(&after.instances);
    pairs.filter(|(a, b)| a.world_from_mesh != b.world_from_mesh || a.deformed != b.deformed).count()
}

/// Prints and returns medians over the steps.
fn summary(
    name: &str,
    scene: &Scene,
    (points, bytes_per_point): (usize, f64),
    rays: u32,
    steps: &[Step],
    threads: usize,
) -> Value {
    let of = |pick: &dyn Fn(&Step) -> f64| median(steps.iter().map(pick));
    let sum = |pick: fn(&Took) -> f64| move |step: &Step| step.took.iter().map(pick).sum::<f64>() * 1e3;
    let (cpu, wall) = (sum(|t| t.cpu_s), sum(|t| t.wall_s));
    let (cpu_ms, wall_ms) = (of(&cpu), of(&wall));
    let slowest_ms = steps.iter().map(&cpu).fold(0.0, f64::max);
    let movers = of(&|s| s.movers as f64);
    let traced: f64 = steps.iter().map(|s| f64::from(s.traced)).sum();
    let per_second = traced / steps.len() as f64 * STEPS_PER_SECOND;
    // As if nothing else ran on the machine: processor time spread evenly over the threads.
    let most_per_second = traced / (steps.iter().map(&cpu).sum::<f64>() * 1e-3) * threads as f64;
    println!(
        "\n{name}: {} triangles, {points} points, {rays} rays each, {movers} movers",
        scene.triangle_count()
    );
    println!("  {:<10}{:>12}{:>12}", "", "cpu ms", "wall ms");
    let mut parts = serde_json::Map::new();
    for (i, part) in PARTS.iter().enumerate() {
        let (cpu, wall) = (of(&|s| s.took[i].cpu_s * 1e3), of(&|s| s.took[i].wall_s * 1e3));
        println!("  {part:<10}{cpu:>12.3}{wall:>12.3}");
        parts.insert((*part).to_owned(), json!({ "cpu_ms": cpu, "wall_ms": wall }));
    }
    let met = if cpu_ms <= GOAL_MS { "met" } else { "MISSED" };
    println!(
        "  {:<10}{cpu_ms:>12.3}{wall_ms:>12.3}  goal {GOAL_MS:.1} {met}; slowest step {slowest_ms:.1}",
        "step"
    );
    let (traced, changed) = (of(&|s| f64::from(s.traced)), of(&|s| s.changed as f64));
    let bytes = of(&|s| s.bytes as f64);
    let rays_asked = of(&|s| s.rays as f64);
    println!(
        "  a step traces {traced} points by {rays_asked} rays, changes {changed}, sends {bytes} bytes (medians)"
    );
    println!("  the server holds {bytes_per_point:.1} bytes a point");
    println!(
        "  points updated a second: {per_second:.0} at {STEPS_PER_SECOND} steps a second, {most_per_second:.0} with all of {threads} threads"
    );
    json!({
        "scene": name, "triangles": scene.triangle_count(), "points": points, "rays_per_point": rays, "movers": movers,
        "parts": parts, "cpu_ms": cpu_ms, "wall_ms": wall_ms, "slowest_cpu_ms": slowest_ms,
        "bytes_per_point": bytes_per_point, "traced": traced, "rays": rays_asked, "changed": changed, "bytes": bytes,
        "updated_per_s": per_second, "most_updated_per_s": most_per_second,
    })
}
