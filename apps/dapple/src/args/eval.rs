//! Arguments of `dapple eval`. What can be said for one scene can also stand in a suite's file, under the same names.

use std::path::PathBuf;
use std::str::FromStr;

use clap::Args;
use serde::de::Error;
use serde::{Deserialize, Deserializer};

use dapple_render::Preset as AoPreset;

use super::{BitRate, EvalVerb, JudgeArgs, Method, Preset, Radius, Size};
use crate::screen_space::Effort;

pub(super) const EVAL_EXAMPLES: &str = "\
Examples:
  dapple eval                                    a small built-in setting, under a minute on two cores
  dapple eval room.glb --radius auto --out out/room
  dapple eval --builtin atrium,lab --path all --points 512,1024 --hz 15,60 --size 960x540 --frames 8
  dapple eval --suite builtins --frames 2        every built-in scene, in a few minutes
  dapple eval --suite sao                        screen-space methods, with the tables and plots of SAO's paper
  dapple eval --suite stochastic                 hidden surfaces: a paper's tables and figures, in ten minutes
  dapple eval --suite slc                        area lights by rays and by light cones: a paper's tables and figures, in 16 minutes
  dapple eval --builtin street --methods slc,none         what it costs to stream how much of area lights is seen
  dapple eval --suite mine.toml --threads 1      scenes and settings from a file (docs/suites.md)
  dapple eval --smoke                            assert the bounds that the tests assert

The same command again continues where it was stopped, and a finished one only writes its files anew. DIR gets results.json,
results.csv, frames.csv, results.md, report.html and the pictures; docs/evaluation.md describes the columns.";

#[derive(Debug, Clone, Args)]
#[command(args_conflicts_with_subcommands = true)]
pub(crate) struct EvalArgs {
    #[command(subcommand)]
    pub(crate) verb: Option<EvalVerb>,
    #[command(flatten)]
    pub(crate) scenes: ScenesArgs,
    #[command(flatten)]
    pub(crate) options: Options,
    #[command(flatten)]
    pub(crate) judge: JudgeArgs,
    /// Folder for results, report, pictures, and what is needed to continue.
    #[arg(long, value_name = "DIR", default_value = "out/eval")]
    pub(crate) out: PathBuf,
    /// Folder for traced truth, which runs with different --out can share [default: DIR/truth].
    #[arg(long, value_name = "DIR", env = "DAPPLE_TRUTH_CACHE")]
    pub(crate) truth_cache: Option<PathBuf>,
    /// Compute everything again, except truth.
    #[arg(long)]
    pub(crate) fresh: bool,
    /// Keep what the server sends, with its times, in this file; with several settings, their names are added to it.
    #[arg(long, value_name = "FILE.dapple")]
    pub(crate) record: Option<PathBuf>,
    /// Run the small built-in setting and fail if similarity or bytes leave their bounds.
    #[arg(long, conflicts_with_all = [
        "scenes", "builtin", "suite", "detail", "animation", "methods", "frames", "size", "points", "hz", "path",
        "seconds", "reference_rays", "supersample", "radius", "point_rays", "threshold", "seed", "adaptive", "bent_normals", "gather_ambient",
        "ray_budget", "rays_still", "budget", "preset", "max_points", "ao_preset", "half_resolution", "guard_band", "hdr_flip", "record", "ppd",
    ])]
    pub(crate) smoke: bool,
    /// Threads; 0 is one for each core.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) threads: usize,
}

/// Which scenes.
#[derive(Debug, Clone, Args)]
pub(crate) struct ScenesArgs {
    /// .gltf, .glb or .obj files [default: a small setting of the built-in atrium].
    #[arg(value_name = "SCENE")]
    pub(crate) scenes: Vec<PathBuf>,
    /// Built-in scenes (`dapple scene` lists them).
    #[arg(long, value_delimiter = ',', value_name = "NAME,…")]
    pub(crate) builtin: Vec<String>,
    /// Scenes and settings from a file, or a built-in suite by name (an unknown name lists them). Other flags override it.
    #[arg(long, value_name = "NAME|FILE.toml", conflicts_with_all = ["scenes", "builtin"])]
    pub(crate) suite: Option<String>,
    /// Folder that a suite's scene files are in [default: that of the suite's file].
    #[arg(long, value_name = "DIR", requires = "suite")]
    pub(crate) scenes_folder: Option<PathBuf>,
}

/// What can be chosen for each scene. A suite's file has the same names.
#[derive(Debug, Clone, Default, PartialEq, Args, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields, default)]
pub(crate) struct Options {
    /// Tessellation of built-in scenes, above 0 to 1 [default: 1; 0.15 without a scene].
    #[arg(long, value_name = "D")]
    pub(crate) detail: Option<f32>,
    /// Animation to play: a name or an index in the file [default: the first].
    #[arg(long, value_name = "NAME|INDEX")]
    pub(crate) animation: Option<String>,
    /// Methods to compare: psao, psao-mls, psao-hat (the paper's kernel on the same points; psao-hat-1.5: with 1.5 times its
    /// radius), psao-paper (the paper's whole scheme; psao-paper-mls: with the fit of psao-mls), slc (psao, and direct light
    /// of whatever emits by how much of each light points see; all pictures have that light then, those of other methods unshadowed, or by R rays to lights), sas-B (shading
    /// atlas streaming with B pixels of a side to a texel; a program built with `--features sas`), rtao-R (R rays a pixel), ssao
    /// (screen-space occlusion as in Falcor's defaults), alchemy, sao, hbao, hbao-plus, gtao (other screen-space methods), sd-ssao,
    /// sd-hbao, sd-hbao-plus (over a stochastic depth map of 4 samples; sd-hbao-16: of 16; sd-ssao-mv, sd-hbao-plus-mv: of two cameras; sd-hbao-paper: with the
    /// paper's parameters), ssao-peeled, hbao-peeled, hbao-plus-peeled (over all layers), none
    /// [default: psao,psao-hat,rtao-16,none].
    #[arg(long, value_delimiter = ',', value_name = "METHOD,…")]
    #[serde(deserialize_with = "list")]
    pub(crate) methods: Option<Vec<Method>>,
    /// Pictures compared, evenly spread over the path [default: 4; 2 without a scene].
    #[arg(long, value_name = "N")]
    pub(crate) frames: Option<u32>,
    /// Picture size in pixels [default: 480x270].
    #[arg(long, value_name = "WxH")]
    pub(crate) size: Option<Size>,
    /// Points spawned a square metre (half are kept); several are evaluated in one run
    /// [default: 512; 256 without a scene].
    #[arg(long, value_delimiter = ',', value_name = "N,…")]
    #[serde(deserialize_with = "list")]
    pub(crate) points: Option<Vec<f32>>,
    /// Server updates a second; several are evaluated in one run [default: 15].
    #[arg(long, value_delimiter = ',', value_name = "H,…")]
    #[serde(deserialize_with = "list")]
    pub(crate) hz: Option<Vec<f64>>,
    /// Camera paths by name (an unknown name lists them), files of them (.json), or `all` that move
    /// [default: the scene's first].
    #[arg(long, value_delimiter = ',', value_name = "NAME,…")]
    #[serde(deserialize_with = "list")]
    pub(crate) path: Option<Vec<String>>,
    /// Seconds of each path that are played [default: all of it; 2 without a scene].
    #[arg(long, value_name = "S")]
    pub(crate) seconds: Option<f64>,
    /// Rays a pixel of the ray-traced truth [default: 512; 128 without a scene].
    #[arg(long, value_name = "R")]
    pub(crate) reference_rays: Option<u32>,
    /// Samples a pixel along each axis; 2 is 4× supersampling [default: 2].
    #[arg(long, value_name = "N")]
    pub(crate) supersample: Option<u32>,
    /// Occlusion distance in metres, or `auto`: 2 % of the scene's diagonal, for files that are not in metres
    /// (points are then counted per (radius / 0.6)² instead of per m²) [default: 0.6].
    #[arg(long, value_name = "METRES|auto", allow_hyphen_values = true)]
    pub(crate) radius: Option<Radius>,
    /// Rays a point, 1 to 256 [default: 64].
    #[arg(long, value_name = "N")]
    pub(crate) point_rays: Option<u32>,
    /// How far the visibility that is sent may be off, 0 to 127 of 255; smaller changes are not sent [default: 4].
    #[arg(long, value_name = "T")]
    pub(crate) threshold: Option<u8>,
    /// Seed of all random numbers [default: 1].
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u32>,
    /// How far the density of points follows the gradient of visibility, at the same number of points: 0 (uniform) to 1
    /// [default: 0].
    #[arg(long, value_name = "X")]
    pub(crate) adaptive: Option<f32>,
    /// Points carry bent normals, two bytes each, and psao gathers ambient light from where it comes. Implies --gather-ambient
    /// [default: false].
    #[arg(long, num_args = 0..=1, require_equals = true, default_missing_value = "true", value_name = "BOOL")]
    pub(crate) bent_normals: Option<bool>,
    /// In the truth's pictures ambient light is gathered from the directions that rays find open, instead of from about the normal
    /// [default: false].
    #[arg(long, num_args = 0..=1, require_equals = true, default_missing_value = "true", value_name = "BOOL")]
    pub(crate) gather_ambient: Option<bool>,
    /// Rays a server step may take, spent first on what is seen, on what changes and on what has waited; the rest is done
    /// in later steps [default: as many as it takes].
    #[arg(long, value_name = "RAYS")]
    pub(crate) ray_budget: Option<u64>,
    /// Rays that a point gets in time while nothing moves near it, from --point-rays to 1024, out of what --ray-budget
    /// leaves over; 0: no more than --point-rays [default: 0].
    #[arg(long, value_name = "N")]
    pub(crate) rays_still: Option<u32>,
    /// Most bits of updates in any second, as in 500k or 2M: what is out of view, far away or nearly right waits or is less
    /// exact. Not of psao-paper and sas-B [default: as many as it takes].
    #[arg(long, value_name = "BITS/S")]
    pub(crate) budget: Option<BitRate>,
    /// Points, updates a second and budget that fit a device, where they are not given.
    #[arg(long, value_enum)]
    pub(crate) preset: Option<Preset>,
    /// Most points at a time: those of whole instances come when the camera sees them, and go when others need the room
    /// [default: all points of all instances are there throughout].
    #[arg(long, value_name = "N")]
    pub(crate) max_points: Option<u32>,
    /// Work of the screen-space methods: low, medium (both at half resolution), high (their defaults) or ultra [default: high].
    #[arg(long, value_name = "PRESET")]
    #[serde(deserialize_with = "ao_preset")]
    pub(crate) ao_preset: Option<AoPreset>,
    /// Screen-space methods look at a quarter of the samples, and the rest is filled in along surfaces [default: the preset's].
    #[arg(long, num_args = 0..=1, require_equals = true, default_missing_value = "true", value_name = "BOOL")]
    pub(crate) half_resolution: Option<bool>,
    /// How far screen-space methods see beyond the picture, as a part of its height, 0 to 0.5 [default: 0.1].
    #[arg(long, value_name = "PART")]
    pub(crate) guard_band: Option<f32>,
    /// Also compute HDR-FLIP, on linear light before tone mapping (several times the work of FLIP).
    #[arg(long, num_args = 0..=1, require_equals = true, default_missing_value = "true", value_name = "BOOL")]
    pub(crate) hdr_flip: Option<bool>,
}

impl Options {
    /// These, and where they say nothing, what `other` says.
    pub(crate) fn or(self, other: &Options) -> Options {
        let other = other.clone();
        // A preset that is given here comes before what is said there.
        let preset = self.preset;
        Options {
            detail: self.detail.or(other.detail),
            animation: self.animation.or(other.animation),
            methods: self.methods.or(other.methods),
            frames: self.frames.or(other.frames),
            size: self.size.or(other.size),
            points: self.points.or(preset.map(|p| vec![p.points_per_m2()])).or(other.points),
            hz: self.hz.or(preset.map(|p| vec![p.hz()])).or(other.hz),
            path: self.path.or(other.path),
            seconds: self.seconds.or(other.seconds),
            reference_rays: self.reference_rays.or(other.reference_rays),
            supersample: self.supersample.or(other.supersample),
            radius: self.radius.or(other.radius),
            point_rays: self.point_rays.or(other.point_rays),
            threshold: self.threshold.or(other.threshold),
            seed: self.seed.or(other.seed),
            adaptive: self.adaptive.or(other.adaptive),
            bent_normals: self.bent_normals.or(other.bent_normals),
            gather_ambient: self.gather_ambient.or(other.gather_ambient),
            ray_budget: self.ray_budget.or(other.ray_budget),
            rays_still: self.rays_still.or(other.rays_still),
            budget: self.budget.or(preset.map(Preset::budget)).or(other.budget),
            preset: self.preset.or(other.preset),
            max_points: self.max_points.or(other.max_points),
            ao_preset: self.ao_preset.or(other.ao_preset),
            half_resolution: self.half_resolution.or(other.half_resolution),
            guard_band: self.guard_band.or(other.guard_band),
            hdr_flip: self.hdr_flip.or(other.hdr_flip),
        }
    }

    /// How screen-space methods run.
    pub(crate) fn effort(&self) -> Effort {
        Effort {
            preset: self.ao_preset.unwrap_or_default(),
            half_resolution: self.half_resolution,
            guard_band: self.guard_band.unwrap_or(Effort::GUARD_BAND),
            ..Effort::default()
        }
    }
}

/// In files, its name.
fn ao_preset<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<AoPreset>, D::Error> {
    let name = String::deserialize(deserializer)?;
    name.parse().map(Some).map_err(|help| D::Error::custom(format!("'{name}': {help}")))
}

/// In files, a list may be one value, and a text may hold several with commas between them, as on the command line.
fn list<'de, T: FromStr<Err: std::fmt::Display>, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Option<Vec<T>>, D::Error> {
    let items = match List::deserialize(deserializer)? {
        List::Many(items) => items,
        List::One(item) => vec![item],
    };
    let texts = items.into_iter().flat_map(|item| match item {
        Text::Text(text) => text.split(',').map(|part| part.trim().to_owned()).collect(),
        Text::Number(number) => vec![number.to_string()],
    });
    let parse =
        |text: String| T::from_str(&text).map_err(|help| D::Error::custom(format!("'{text}': {help}")));
    texts.map(parse).collect::<Result<_, _>>().map(Some)
}

#[derive(Deserialize)]
#[serde(untagged)]
enum List {
    Many(Vec<Text>),
    One(Text),
}

/// In files, what has a text on the command line is that text, or a number where it is one.
macro_rules! deserialize_as_text {
    ($($type:ty),*) => {$(
        impl<'de> Deserialize<'de> for $type {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                let text = match Text::deserialize(deserializer)? {
                    Text::Text(text) => text,
                    Text::Number(number) => number.to_string(),
                };
                <$type>::from_str(&text).map_err(|help| D::Error::custom(format!("'{text}': {help}")))
            }
        }
    )*};
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Text {
    Text(String),
    Number(f64),
}

deserialize_as_text!(Method, Size, Radius, BitRate);
