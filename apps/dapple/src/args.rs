//! Command-line arguments.

pub(crate) mod bake;
mod bench;
mod bit_rate;
mod effort;
mod eval;
mod method;
mod serve;
mod values;
mod verbs;
mod view;
mod watch;
mod worker;

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

use crate::direct_light::CONES_MIB;
use crate::direct_light::picture::DirectLight;
pub(crate) use bake::BakeArgs;
pub(crate) use bench::{Bench, BenchArgs, JoinArgs, ServedArgs, SoakArgs, ViewersArgs};
pub(crate) use bit_rate::BitRate;
pub(crate) use effort::EffortArgs;
pub(crate) use eval::{EvalArgs, Options, ScenesArgs};
pub(crate) use method::{Method, RenderMethod};
pub(crate) use serve::{LogFormat, Named, ServeArgs};
pub(crate) use values::{CameraText, Radius, Size};
pub(crate) use verbs::{CompareArgs, DiffArgs, ErrorMap, EvalVerb, JudgeArgs, PictureFormat, ReferenceArgs};
pub(crate) use view::{Preset, ViewArgs, ViewKind, ViewMethod};
pub(crate) use watch::{DemoArgs, InspectArgs, LightArgs, RecordArgs};
pub(crate) use worker::WorkerArgs;

/// Ray-traced ambient visibility, computed once on a server and streamed to thin clients.
#[derive(Debug, Parser)]
#[command(name = "dapple", version, about, arg_required_else_help = true)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Run server and client along a camera path and compare the pictures with ray-traced truth.
    #[command(after_help = eval::EVAL_EXAMPLES)]
    Eval(Box<EvalArgs>),
    /// Render one picture of a scene.
    #[command(after_help = RENDER_EXAMPLES)]
    Render(RenderArgs),
    /// Compare reconstructions of visibility over all surfaces of a scene, or near thin walls, with traced truth.
    #[command(after_help = QUALITY_EXAMPLES)]
    Quality(QualityArgs),
    /// Write ray-traced visibility into a scene's file, as a texture or at vertices, or into one of points.
    #[command(after_help = bake::BAKE_EXAMPLES)]
    Bake(BakeArgs),
    /// Write a built-in scene as a GLB that any glTF viewer opens.
    #[command(after_help = SCENE_EXAMPLES)]
    Scene(SceneArgs),
    /// Light a scene along its animation and keep the stream in a .dapple file.
    #[command(after_help = watch::RECORD_EXAMPLES)]
    Record(RecordArgs),
    /// Say what is in a .dapple file, and whether it is whole.
    #[command(after_help = watch::INSPECT_EXAMPLES)]
    Inspect(InspectArgs),
    /// Show a scene and its light in a window, or as pictures without one.
    #[command(after_help = view::VIEW_EXAMPLES)]
    View(ViewArgs),
    /// Serve a built-in scene and its light to browsers on this machine.
    #[command(after_help = watch::DEMO_EXAMPLES)]
    Demo(DemoArgs),
    /// Light a scene for any number of viewers, live: browsers and `dapple view --url`.
    #[command(after_help = serve::SERVE_EXAMPLES)]
    Serve(Box<ServeArgs>),
    /// Trace some instances of a scene for a server elsewhere (dapple serve --workers).
    #[command(after_help = worker::WORKER_EXAMPLES)]
    Worker(WorkerArgs),
    /// Measure a live server: viewers, joining, and a long run.
    Bench(BenchArgs),
}

const RENDER_EXAMPLES: &str = "\
Examples:
  dapple render room.glb -o room.png
  dapple render --builtin atrium --time 4 --camera eye=2,1.7,5,target=0,1,0,fov=60 --method rtao -o truth.png
  dapple render city.glb --method psao --points 256 --radius auto --view visibility -o visibility.png
  dapple render --builtin atrium --view error -o error.png        psao against rtao, per pixel
  dapple render --builtin atrium --method ssao --view visibility -o ssao.png
  dapple render --builtin atrium --method sao --ao-preset low --guard-band 0.2 -o sao.png
  dapple render room.glb --method rtao --view visibility -o visibility.exr
  dapple render --builtin street --method none --direct-light slc -o street.png       soft shadows of whatever emits
  dapple render room.glb --direct-light rt-64 --environment sky.hdr -o room.png";

const QUALITY_EXAMPLES: &str = "\
Examples:
  dapple quality                                 the built-in atrium at 256, 512 and 1024 points a square metre
  dapple quality room.glb --radius auto --points 512 -o room.json
  dapple quality --leaks                         two made scenes with thin walls";

const SCENE_EXAMPLES: &str = "\
Examples:
  dapple scene                                   list the built-in scenes
  dapple scene atrium -o atrium.glb
  dapple scene atrium --detail 0.2 -o small.glb";

/// Which scene.
#[derive(Debug, Clone, Args)]
pub(crate) struct SceneChoice {
    /// A .gltf, .glb or .obj file.
    #[arg(value_name = "SCENE", conflicts_with = "builtin")]
    pub(crate) scene: Option<PathBuf>,
    /// A built-in scene (`dapple scene` lists them).
    #[arg(long, value_name = "NAME")]
    pub(crate) builtin: Option<String>,
    /// Tessellation of a built-in scene, above 0 to 1.
    #[arg(long, value_name = "D")]
    pub(crate) detail: Option<f32>,
    /// Animation to play: a name or an index in the file [default: the first].
    #[arg(long, value_name = "NAME|INDEX")]
    pub(crate) animation: Option<String>,
}

/// How visibility is computed.
#[derive(Debug, Clone, Args)]
pub(crate) struct VisibilityArgs {
    /// Occlusion distance in metres, or `auto`: 2 % of the scene's diagonal, for files that are not in metres
    /// (points are then counted per (radius / 0.6)² instead of per m²).
    #[arg(long, value_name = "METRES|auto", default_value = "0.6", allow_hyphen_values = true)]
    pub(crate) radius: Radius,
    /// Rays a point, 1 to 256.
    #[arg(long, value_name = "N", default_value_t = 64)]
    pub(crate) point_rays: u32,
    /// How far off the visibility of a point (0 to 255) may be where it moves: less is more exact, and more bits.
    #[arg(long, value_name = "T", default_value_t = 4)]
    pub(crate) threshold: u8,
    /// Seed of all random numbers.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) seed: u32,
    /// How far the density of points follows the gradient of visibility, at the same number of points: 0 (uniform) to 1.
    #[arg(long, value_name = "X", default_value_t = 0.0)]
    pub(crate) adaptive: f32,
    /// Two more bytes a point that say from where light comes to it, so that ambient light of several colours is gathered from there.
    /// In pictures of `eval` and `render`; windows and pages do not use them yet. `render` has them of rtao, and of hbao and hbao-plus, with hidden surfaces too,
    /// from the picture alone.
    #[arg(long)]
    pub(crate) bent_normals: bool,
}

/// What a server spends: on each of its steps, and on what it sends.
#[derive(Debug, Clone, Copy, Default, PartialEq, Args)]
pub(crate) struct StepArgs {
    /// Rays a server step may take, spent first on what is seen, on what changes and on what has waited; the rest is done
    /// in later steps [default: as many as it takes].
    #[arg(long, value_name = "RAYS")]
    pub(crate) ray_budget: Option<u64>,
    /// Rays that a point gets in time while nothing moves near it, from --point-rays to 1024, out of what --ray-budget
    /// leaves over; 0: no more than --point-rays. Without --ray-budget the first steps are as slow as the start.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) rays_still: u32,
    /// Most bits of updates in any second, as in 500k or 2M: what is out of view, far away or nearly right waits or is less
    /// exact [default: as many as it takes].
    #[arg(long, value_name = "BITS/S")]
    pub(crate) budget: Option<BitRate>,
    /// Most points at a time: those of whole instances come when they are seen, and go when others need the room; where nobody
    /// says what is seen, the largest instances have points [default: all points of all instances are there throughout].
    #[arg(long, value_name = "N")]
    pub(crate) max_points: Option<u32>,
}

#[derive(Debug, Clone, Args)]
pub(crate) struct RenderArgs {
    #[command(flatten)]
    pub(crate) scene: SceneChoice,
    /// Where visibility comes from: psao (points, by least squares), psao-hat (points, by the paper's kernel), rtao (rays at every sample: the truth),
    /// a screen-space method as `dapple eval` names it (ssao, alchemy, sao, hbao, hbao-plus, gtao, sd-hbao-plus, hbao-plus-peeled and others), none.
    #[arg(long, default_value = "psao")]
    pub(crate) method: RenderMethod,
    /// What is drawn.
    #[arg(long, value_enum, default_value = "beauty")]
    pub(crate) view: View,
    /// Animation time in seconds.
    #[arg(long, value_name = "T", default_value_t = 0.0, allow_hyphen_values = true)]
    pub(crate) time: f64,
    /// A camera of the scene by name, or one given as eye=X,Y,Z,target=X,Y,Z,fov=DEGREES (vertical)
    /// [default: the scene's first camera path].
    #[arg(long, value_name = "CAMERA")]
    pub(crate) camera: Option<String>,
    /// Picture size in pixels.
    #[arg(long, value_name = "WxH", default_value = "1280x720")]
    pub(crate) size: Size,
    /// Rays a pixel (rtao).
    #[arg(long, value_name = "R", default_value_t = 512)]
    pub(crate) rays: u32,
    /// Points spawned a square metre (psao); half are kept.
    #[arg(long, value_name = "N", default_value_t = 512.0)]
    pub(crate) points: f32,
    #[command(flatten)]
    pub(crate) direct: DirectLightArgs,
    /// Samples a pixel along each axis.
    #[arg(long, value_name = "N", default_value_t = 2)]
    pub(crate) supersample: u32,
    #[command(flatten)]
    pub(crate) visibility: VisibilityArgs,
    #[command(flatten)]
    pub(crate) effort: EffortArgs,
    /// The PNG to write, or the EXR: 32-bit floats, linear and without tone mapping (R, G, B; for visibility and error Y).
    #[arg(short, long, value_name = "FILE.png|FILE.exr")]
    pub(crate) output: PathBuf,
    /// Threads; 0 is one for each core.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) threads: usize,
}

/// Light of whatever emits.
#[derive(Debug, Clone, Args)]
pub(crate) struct DirectLightArgs {
    /// Light surfaces by what emits, by rt-N (N rays a sample), ris, restir-di, slc (light cones; slc-quick with coarser ones
    /// for a quarter to a half of the rays; slc-fast for still less, unblended; slc-fine with fine ones, for what stands still:
    /// the best with --light-steps 256; slc-card has a graphics card shade them) or slc-paper; with -power behind it lights are picked as the paper does. No sun is made up then. Without it what emits is seen, but lights nothing.
    #[arg(long, value_name = "METHOD")]
    pub(crate) direct_light: Option<DirectLight>,
    /// Steps at 15 Hz that lead to the picture, for methods that remember (restir-di and those of cones).
    #[arg(long, value_name = "N", default_value_t = 16, requires = "direct_light")]
    pub(crate) light_steps: u32,
    /// Memory that light cones may take, MiB. What does not fit stays dark, and is told.
    #[arg(long, value_name = "MIB", default_value_t = CONES_MIB, requires = "direct_light")]
    pub(crate) light_memory: u64,
    /// Light from all around: an equirectangular Radiance picture. Its middle lies towards −Z.
    #[arg(long, value_name = "FILE.hdr", requires = "direct_light")]
    pub(crate) environment: Option<PathBuf>,
}

#[derive(Debug, Clone, Args)]
pub(crate) struct QualityArgs {
    #[command(flatten)]
    pub(crate) scene: SceneChoice,
    /// Points spawned a square metre (half are kept).
    #[arg(long, value_delimiter = ',', value_name = "N,…", default_values_t = [256.0, 512.0, 1024.0])]
    pub(crate) points: Vec<f32>,
    /// Places on surfaces that are compared, about.
    #[arg(long, value_name = "N", default_value_t = 40_000)]
    pub(crate) samples: u32,
    /// Rays a place of the ray-traced truth.
    #[arg(long, value_name = "R", default_value_t = 512)]
    pub(crate) reference_rays: u32,
    /// Animation time in seconds.
    #[arg(long, value_name = "T", default_value_t = 2.0, allow_hyphen_values = true)]
    pub(crate) time: f64,
    /// Compare near the thin walls of two made scenes instead.
    #[arg(long, conflicts_with_all = ["scene", "builtin", "detail", "animation", "time", "radius"])]
    pub(crate) leaks: bool,
    #[command(flatten)]
    pub(crate) visibility: VisibilityArgs,
    /// Write every figure to this file.
    #[arg(short, long, value_name = "FILE.json")]
    pub(crate) output: Option<PathBuf>,
    /// Threads; 0 is one for each core.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) threads: usize,
}

#[derive(Debug, Clone, Args)]
pub(crate) struct SceneArgs {
    /// Which; without a name the scenes are listed.
    pub(crate) name: Option<String>,
    /// Tessellation, above 0 to 1.
    #[arg(long, value_name = "D", default_value_t = 1.0)]
    pub(crate) detail: f32,
    /// The file to write [default: NAME.glb].
    #[arg(short, long, value_name = "FILE.glb")]
    pub(crate) output: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum View {
    /// The shaded picture.
    Beauty,
    /// Visibility alone, white is open.
    Visibility,
    /// World normals as colors.
    Normal,
    /// Difference between the method's visibility and rtao with --rays rays.
    Error,
    /// The points and their visibility over the dimmed picture.
    Points,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        use clap::CommandFactory;
        Cli::command().debug_assert();
    }
}
