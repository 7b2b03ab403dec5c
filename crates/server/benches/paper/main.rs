//! What the paper's scheme sends, in several variants and beside Dapple's own, from one tracing of all points.
//! `cargo bench -p dapple-server --bench paper -- --help`.

use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use clap::Parser;
use dapple_scene::{NoFiles, Scene, builtin};
use dapple_stream::cells::{CellCodec, CellLimits, CellPublisher, CellSubscriber};
use dapple_stream::{Precision, Publisher, PublisherConfig};
use dapple_trace::Tracer;
use dapple_trace::psao::generate::{GenerateParams, generate_points};
use dapple_trace::psao::paper::{PaperCounts, PaperParams, PaperUpdater, extended_view};
use dapple_trace::psao::update::{StepInput, UpdateParams, Updater};

/// Width by height of the viewer's picture.
const ASPECT: f32 = 16.0 / 9.0;

/// What the paper's scheme sends.
#[derive(Parser)]
struct Arguments {
    /// Built-in scenes.
    #[arg(long, value_delimiter = ',', default_value = "atrium,lab")]
    scenes: Vec<String>,
    /// Points spawned a square metre; half are kept.
    #[arg(long, default_value_t = 512.0)]
    points: f32,
    /// Steps a second.
    #[arg(long, default_value_t = 15.0)]
    hz: f64,
    /// Seconds of the scene's first camera path.
    #[arg(long, default_value_t = 4.0)]
    seconds: f64,
    /// Rays a point.
    #[arg(long, default_value_t = 64)]
    rays: u32,
    /// Change of visibility (0 to 255) that is not sent.
    #[arg(long, default_value_t = 4)]
    threshold: u8,
    /// Given by cargo.
    #[arg(long, hide = true)]
    bench: bool,
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
        println!("skipped: a bench, run by `cargo bench -p dapple-server --bench paper`");
        return Ok(());
    }
    let arguments = Arguments::parse();
    if !(arguments.hz > 0.0 && arguments.seconds * arguments.hz >= 1.0) {
        bail!("--hz and --seconds must give one step at least");
    }
    for name in &arguments.scenes {
        let glb = builtin::glb(name, 1.0)?;
        let scene = dapple_scene::load(&format!("{name}.glb"), &glb, &NoFiles)?;
        measure(name, &scene, &arguments)?;
    }
    Ok(())
}

/// One way to send, and what it sent.
struct Variant {
    name: &'static str,
    margin_degrees: Option<f32>,
    paper: PaperUpdater,
    publisher: CellPublisher,
    subscriber: CellSubscriber,
    bytes: usize,
    counts: [u64; 4],
}

fn measure(name: &str, scene: &Scene, arguments: &Arguments) -> Result<()> {
    let path = scene.camera_paths().into_iter().next().context("the scene has no camera")?;
    let pose = scene.pose(0.0);
    let mut tracer = Tracer::new(scene, &pose);
    let generate = GenerateParams { points_per_m2: arguments.points, ..GenerateParams::default() };
    let points = generate_points(scene, &pose, &tracer, &generate, &|_| ())?;
    let update = UpdateParams { rays: arguments.rays, ..UpdateParams::default() };
    let mut updater = Updater::new(scene, &pose, &tracer, points, update, &|_| ())?;
    let precision = Precision { tolerance: arguments.threshold, ..Precision::default() };
    let mut own = Publisher::new(scene.hash().0, PublisherConfig { precision, ..PublisherConfig::default() });
    own.publish(updater.store());
    let own_join = own.join().map_or(0, |frame| frame.bytes.len());
    let mut own_bytes = 0;

    let variant = |name, margin_degrees, codec, still_bending: bool| -> Result<Variant> {
        // Points of what bends that never count as moved: what the paper's format would send at rest.
        let steps = if still_bending { f32::INFINITY } else { PaperParams::default().position_steps };
        let degrees = if still_bending { 180.0 } else { PaperParams::default().normal_degrees };
        let threshold = arguments.threshold;
        let params = PaperParams {
            threshold,
            position_steps: steps,
            normal_degrees: degrees,
            ..PaperParams::default()
        };
        let paper = PaperUpdater::new(scene, &pose, &updater, params)?;
        let publisher = CellPublisher::new(scene.hash().0, codec, 0.0);
        let subscriber = CellSubscriber::new(None, CellLimits::default());
        Ok(Variant { name, margin_degrees, paper, publisher, subscriber, bytes: 0, counts: [0; 4] })
    };
    let (zstd, lz4) = (CellCodec::Zstd, CellCodec::Lz4);
    let mut variants = vec![
        variant("zstd, view + 20°", Some(20.0), zstd, false)?,
        variant("LZ4, view + 20°", Some(20.0), lz4, false)?,
        variant("zstd, everything in view", None, zstd, false)?,
        variant("the same, bending points never moved", None, zstd, true)?,
    ];
    let first = &variants[0];
    let join = first.publisher.join(first.paper.table())?;
    println!(
        "{name}: {} points, {} in no cell; join {} kB as the paper has it, {} kB ours (without cuts)",
        updater.store().layout().len(),
        first.paper.unplaced(),
        join.bytes.len() / 1000,
        own_join / 1000,
    );
    for variant in &mut variants {
        variant.subscriber.receive(&variant.publisher.join(variant.paper.table())?.bytes)?;
    }

    let steps = (arguments.seconds * arguments.hz).round() as u32;
    for tick in 1..=steps {
        let now_s = f64::from(tick) / arguments.hz;
        let pose = scene.pose(now_s);
        tracer.update(scene, &pose);
        updater.step(scene, &pose, &mut tracer, &StepInput::default());
        let camera = path.camera(scene, &pose);
        for variant in &mut variants {
            let view = variant.margin_degrees.map(|margin| extended_view(&camera, ASPECT, margin));
            let (changes, counts) = variant.paper.step(scene, &pose, &updater, view.as_ref());
            let PaperCounts { updated, outside_box, cells, buckets, .. } = counts;
            for (sum, count) in variant.counts.iter_mut().zip([updated, cells, buckets, outside_box]) {
                *sum += u64::from(count);
            }
            if let Some(frame) = variant.publisher.publish(variant.paper.table(), &changes, now_s)? {
                variant.bytes += frame.bytes.len();
                variant.subscriber.receive(&frame.bytes)?;
            }
        }
        own_bytes += own.publish(updater.store()).map_or(0, |frame| frame.bytes.len());
    }
    let kbit_per_s = |bytes: usize| bytes as f64 * 8e-3 / (f64::from(steps) / arguments.hz);
    for Variant { name, paper, subscriber, bytes, counts, .. } in &variants {
        let held = subscriber.table().context("it has joined")?;
        if !held.holds_same(paper.table()) {
            bail!("{name}: the subscriber holds another table than the server");
        }
        let [updated, cells, buckets, outside] = counts.map(|sum| sum / u64::from(steps));
        println!(
            "  paper, {name}: {:.0} kbit/s; a step: {updated} points, {cells} cells, {buckets} buckets, {outside} outside \
             their box; {} points in no cell at the end",
            kbit_per_s(*bytes),
            paper.unplaced(),
        );
    }
    println!("  ours, everything: {:.0} kbit/s", kbit_per_s(own_bytes));
    Ok(())
}
