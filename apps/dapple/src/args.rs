//! Command-line arguments.

pub(crate) mod bake;
mod bench;
mod bit_rate;
mod effort;
mod eval;
mod serve;
mod verbs;
mod view;
mod watch;
mod worker;

use std::path::PathBuf;
use std::str::FromStr;

use clap::{Args, Parser, Subcommand, ValueEnum};
use dapple_scene::glam::Vec3;

use crate::screen_space::ScreenSpace;

pub(crate) use bake::BakeArgs;
pub(crate) use bench::{Bench, BenchArgs, JoinArgs, ServedArgs, SoakArgs, ViewersArgs};
pub(crate) use bit_rate::BitRate;
pub(crate) use effort::EffortArgs;
pub(crate) use eval::{EvalArgs, Options, ScenesArgs};
pub(crate) use serve::{LogFormat, Named, ServeArgs};
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
  dapple render room.glb --method rtao --view visibility -o visibility.exr";

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

/// A method as `render` names it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum RenderMethod {
    /// Points, reconstructed by moving least squares.
    Psao,
    /// Points, reconstructed by the paper's kernel.
    PsaoHat,
    /// Rays at every pixel: the truth.
    Rtao,
    /// From the picture alone.
    Screen(ScreenSpace),
    None,
}

impl FromStr for RenderMethod {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        match s {
            "psao" => Ok(RenderMethod::Psao),
            "psao-hat" => Ok(RenderMethod::PsaoHat),
            "rtao" => Ok(RenderMethod::Rtao),
            "none" => Ok(RenderMethod::None),
            name => ScreenSpace::from_name(name)
                .map(RenderMethod::Screen)
                .ok_or_else(|| format!("known methods: psao, psao-hat, rtao, {}, none", ScreenSpace::KNOWN)),
        }
    }
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

/// A method as `eval` names it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Method {
    /// Through the visibility atlas.
    Psao,
    /// Least squares at every sample.
    PsaoMls,
    /// With the radius in units of the spacing.
    PsaoHat {
        radius: f32,
    },
    /// The paper's whole scheme, server, wire and client.
    PsaoPaper,
    /// The paper's scheme with least squares at every sample.
    PsaoPaperMls,
    /// Shading atlas streaming, with so many pixels of a side to a texel.
    Sas {
        bias: u32,
    },
    Rtao {
        rays: u32,
    },
    /// From the picture's depth and normals alone.
    Screen(ScreenSpace),
    None,
}

impl Method {
    /// Whether it depends on points and server rate.
    pub(crate) fn uses_points(self) -> bool {
        matches!(self, Method::Psao | Method::PsaoMls | Method::PsaoHat { .. }) || self.is_paper()
    }

    /// Whether its server and its stream are the paper's.
    pub(crate) fn is_paper(self) -> bool {
        matches!(self, Method::PsaoPaper | Method::PsaoPaperMls)
    }
}

impl std::fmt::Display for Method {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Method::Psao => write!(f, "psao"),
            Method::PsaoMls => write!(f, "psao-mls"),
            Method::PsaoHat { radius: 1.0 } => write!(f, "psao-hat"),
            Method::PsaoHat { radius } => write!(f, "psao-hat-{radius}"),
            Method::PsaoPaper => write!(f, "psao-paper"),
            Method::PsaoPaperMls => write!(f, "psao-paper-mls"),
            Method::Sas { bias } => write!(f, "sas-{bias}"),
            Method::Rtao { rays } => write!(f, "rtao-{rays}"),
            Method::Screen(method) => write!(f, "{}", method.name()),
            Method::None => write!(f, "none"),
        }
    }
}

impl FromStr for Method {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        match s {
            "psao" => Ok(Method::Psao),
            "psao-mls" => Ok(Method::PsaoMls),
            "psao-hat" => Ok(Method::PsaoHat { radius: 1.0 }),
            "psao-paper" => Ok(Method::PsaoPaper),
            "psao-paper-mls" => Ok(Method::PsaoPaperMls),
            "none" => Ok(Method::None),
            "rtao" => Ok(Method::Rtao { rays: 16 }),
            _ => {
                if let Some(method) = ScreenSpace::from_name(s) {
                    return Ok(Method::Screen(method));
                }
                let rays = s.strip_prefix("rtao-").and_then(|r| r.parse().ok());
                let radius = s.strip_prefix("psao-hat-").and_then(|r| r.parse::<f32>().ok());
                let bias = s.strip_prefix("sas-").and_then(|b| b.parse().ok());
                match (rays, radius, bias) {
                    (Some(rays @ 1..=65536), ..) => Ok(Method::Rtao { rays }),
                    (_, Some(radius), _) if (0.1..=8.0).contains(&radius) => Ok(Method::PsaoHat { radius }),
                    (.., Some(bias @ 1..=1024)) => Ok(Method::Sas { bias }),
                    _ => Err(format!(
                        "known methods: psao, psao-mls, psao-hat, psao-hat-F with its radius times F from 0.1 to 8, \
                         psao-paper, psao-paper-mls, sas-B with B from 1 to 1024, rtao-R with R from 1 to 65536 (rtao-16), \
                         {}, none",
                        ScreenSpace::KNOWN
                    )),
                }
            }
        }
    }
}

/// Picture size.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Size {
    pub(crate) width: u32,
    pub(crate) height: u32,
}

impl FromStr for Size {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let parsed = s.split_once(['x', 'X']).and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
        match parsed {
            Some((width @ 1..=16384, height @ 1..=16384)) => Ok(Size { width, height }),
            _ => Err("write WIDTHxHEIGHT in pixels, each 1 to 16384, as in 1280x720".into()),
        }
    }
}

impl std::fmt::Display for Size {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

/// Occlusion distance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Radius {
    Auto,
    Metres(f32),
}

impl FromStr for Radius {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        if s == "auto" {
            return Ok(Radius::Auto);
        }
        match s.parse::<f32>() {
            Ok(m) if m.is_finite() && m > 0.0 => Ok(Radius::Metres(m)),
            _ => Err("write a length in metres above 0, or auto".into()),
        }
    }
}

/// A camera given on the command line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CameraText {
    pub(crate) eye: Vec3,
    pub(crate) target: Vec3,
    pub(crate) fov_degrees: f32,
}

impl FromStr for CameraText {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let help = || format!("'{s}' is no camera: write eye=X,Y,Z,target=X,Y,Z,fov=DEGREES");
        // Commas separate both numbers and keys: a part with `=` opens the next key.
        let mut groups: Vec<(&str, Vec<f32>)> = Vec::new();
        for part in s.split(',') {
            let number = match part.split_once('=') {
                Some((key, number)) => {
                    groups.push((key.trim(), Vec::new()));
                    number
                }
                None => part,
            };
            let number = number.trim().parse::<f32>().ok().filter(|n| n.is_finite()).ok_or_else(help)?;
            groups.last_mut().ok_or_else(help)?.1.push(number);
        }
        let (mut eye, mut target, mut fov) = (None, None, 60.0f32);
        for (key, numbers) in groups {
            match (key, numbers.as_slice()) {
                ("eye", &[x, y, z]) => eye = Some(Vec3::new(x, y, z)),
                ("target", &[x, y, z]) => target = Some(Vec3::new(x, y, z)),
                ("fov", &[degrees]) if degrees > 0.0 && degrees < 180.0 => fov = degrees,
                _ => return Err(help()),
            }
        }
        match (eye, target) {
            (Some(eye), Some(target)) if eye != target => Ok(CameraText { eye, target, fov_degrees: fov }),
            _ => Err(help()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        use clap::CommandFactory;
        Cli::command().debug_assert();
    }

    #[test]
    fn cameras_are_read_in_any_order() {
        let expected = CameraText { eye: Vec3::new(1.0, -2.5, 30.0), target: Vec3::ZERO, fov_degrees: 45.0 };
        for text in ["eye=1,-2.5,3e1,target=0,0,0,fov=45", "fov=45,target=0,0,0,eye=1,-2.5,30"] {
            assert_eq!(text.parse(), Ok(expected), "{text}");
        }
        for text in [
            "",
            "eye=1,2,target=0,0,0",
            "eye=0,0,0,target=0,0,0",
            "eye=1,2,3",
            "eye=a,b,c,target=0,0,0",
            "fov=190",
        ] {
            assert!(text.parse::<CameraText>().is_err(), "{text}");
        }
    }

    #[test]
    fn sizes_methods_and_radii_refuse_nonsense() {
        assert_eq!("640x360".parse(), Ok(Size { width: 640, height: 360 }));
        for text in ["0x1", "640", "640x", "99999x1", "-1x2"] {
            assert!(text.parse::<Size>().is_err(), "{text}");
        }
        assert_eq!("rtao-512".parse(), Ok(Method::Rtao { rays: 512 }));
        let screen = ScreenSpace::ALL.map(Method::Screen);
        for method in [Method::PsaoPaper, Method::PsaoPaperMls, Method::PsaoHat { radius: 1.5 }]
            .into_iter()
            .chain(screen)
        {
            assert_eq!(method.to_string().parse(), Ok(method));
        }
        for text in ["rtao-0", "rtao-x", "ssao-16", "magic", ""] {
            assert!(text.parse::<Method>().is_err(), "{text}");
        }
        assert_eq!("auto".parse(), Ok(Radius::Auto));
        for text in ["0", "-1", "nan", "inf", "wide"] {
            assert!(text.parse::<Radius>().is_err(), "{text}");
        }
    }
}
