//! Rays a second of the tracer beside Embree, obvhs and parry, in one process: see `README.md`.
//! `cargo bench -p dapple-trace --bench rays -- --help`.

mod builds;
mod clock;
mod embree;
mod measure;
mod moving;
mod print;
mod rays;
mod results;
mod scenes;
mod tracers;

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;

use anyhow::{Result, bail};
use clap::Parser;

use builds::Built;
use embree::{Device, Embree, SceneFlags};
use measure::Measured;
use rays::Batch;
use scenes::Triangles;

/// Rays a second of the tracer, side by side with others'.
#[derive(Parser)]
struct Arguments {
    /// Scenes, of those that --help lists last; all by default.
    #[arg(long, value_delimiter = ',')]
    scenes: Vec<String>,
    /// Points on each scene's surface, with 64 rays each.
    #[arg(long, default_value_t = 4096)]
    points: usize,
    /// Rounds; in each, every tracer is timed once, in turn.
    #[arg(long, default_value_t = 9)]
    repetitions: usize,
    /// A quarter of the points and three rounds.
    #[arg(long)]
    quick: bool,
    /// Embree's library, or a folder that holds it; otherwise the environment's EMBREE_LIB says. Cargo starts benches
    /// in their package's folder, so give whole paths.
    #[arg(long)]
    embree: Option<PathBuf>,
    /// Builds Embree's scenes with its robust flag: fewer disagreements, slower.
    #[arg(long)]
    robust: bool,
    /// Where the figures are written.
    #[arg(long, default_value = results::FILE)]
    out: PathBuf,
    /// Given by cargo.
    #[arg(long, hide = true)]
    bench: bool,
}

impl Arguments {
    fn flags(&self) -> SceneFlags {
        if self.robust { SceneFlags::Robust } else { SceneFlags::Fastest }
    }

    fn build_repetitions(&self) -> usize {
        if self.quick { 1 } else { 3 }
    }
}

/// Rays of one length, as a part of the scene's diagonal.
#[derive(Clone, Copy)]
struct Length {
    name: &'static str,
    part: f32,
    /// Our speed ÷ Embree's fastest: the least that is wanted, and the goal.
    least: f64,
    goal: f64,
}

const LENGTHS: [Length; 2] = [
    Length { name: "short", part: 0.02, least: 1.3, goal: 2.0 },
    Length { name: "long", part: 0.25, least: 1.0, goal: 1.25 },
];

/// The figures of one scene.
struct SceneFigures {
    name: String,
    mesh: Triangles,
    rays: usize,
    /// Parallel to [`LENGTHS`].
    lengths: Vec<(f32, Vec<Measured>)>,
    built: Vec<Built>,
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
        println!("skipped: a bench, run by `cargo bench -p dapple-trace --bench rays`");
        return Ok(());
    }
    let mut arguments = Arguments::parse();
    if arguments.quick {
        (arguments.points, arguments.repetitions) = (arguments.points.div_ceil(4), 3);
    }
    if arguments.points == 0 || arguments.repetitions == 0 {
        bail!("--points and --repetitions are 1 or more");
    }
    let all = scenes::names();
    if arguments.scenes.is_empty() {
        arguments.scenes = all.iter().map(|name| (*name).to_owned()).collect();
    }
    if let Some(unknown) = arguments.scenes.iter().find(|name| !all.contains(&name.as_str())) {
        bail!("there is no scene {unknown:?}; known are: {}", all.join(", "));
    }

    let embree = find_embree(arguments.embree.clone())?;
    let mut figures = Vec::new();
    for name in &arguments.scenes {
        figures.extend(measure_scene(name, embree.as_ref(), &arguments)?);
    }
    println!("moving scenes ...");
    let moving = moving::measure(if arguments.quick { 20 } else { 60 })?;
    println!("building on all threads ...");
    for scene in &mut figures {
        let (flags, repetitions) = (arguments.flags(), arguments.build_repetitions());
        builds::build_on_all_threads(&scene.mesh, embree.as_ref(), flags, repetitions, &mut scene.built)?;
    }

    print::rays(&figures);
    print::disagreements(&figures);
    print::builds(&figures);
    print::moving(&moving);
    let section = print::json(&figures, &moving, embree.is_some(), arguments.robust, arguments.repetitions);
    results::merge(&arguments.out, "rays", section)
}

/// Embree, or none after saying so aloud.
fn find_embree(path: Option<PathBuf>) -> Result<Option<Arc<Embree>>> {
    let from_environment = || std::env::var_os("EMBREE_LIB").filter(|v| !v.is_empty()).map(PathBuf::from);
    let Some(path) = path.or_else(from_environment) else {
        println!(
            "skipped: Embree, neither --embree nor EMBREE_LIB names its library (see the bench's README)"
        );
        return Ok(None);
    };
    let embree = Embree::load(&path)?;
    let native =
        Device::new(&embree, 1)?.native_packets().map(|n| if n { "as packets" } else { "one by one" });
    println!("Embree 4: packets of 8 are traced {}, packets of 16 {}", native[0], native[1]);
    Ok(Some(embree))
}

fn measure_scene(
    name: &str,
    embree: Option<&Arc<Embree>>,
    arguments: &Arguments,
) -> Result<Option<SceneFigures>> {
    let Some(mesh) = scenes::make(name)? else { return Ok(None) };
    if mesh.triangles.is_empty() {
        bail!("the scene {name} has no triangles");
    }
    println!("{name}: {} triangles, diagonal {:.2} m ...", mesh.triangles.len(), mesh.bounds.diagonal());
    let batch = Batch::new(&mesh, arguments.points);
    let (tracers, built) = builds::build(&mesh, embree, arguments.flags(), arguments.build_repetitions())?;
    let candidates = tracers.candidates();
    let lengths = LENGTHS
        .iter()
        .map(|length| {
            let t_max = length.part * mesh.bounds.diagonal();
            (t_max, measure::measure(&candidates, &batch, t_max, arguments.repetitions))
        })
        .collect();
    let rays = measure::ray_count(&batch);
    Ok(Some(SceneFigures { name: name.to_owned(), mesh, rays, lengths, built }))
}
