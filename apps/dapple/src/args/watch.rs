//! Arguments of the verbs around streams: record, inspect, demo.

use std::path::PathBuf;

use clap::Args;

use super::{Preset, SceneChoice, StepArgs, VisibilityArgs};

pub(crate) const RECORD_EXAMPLES: &str = "\
Examples:
  dapple record room.glb -o room.dapple
  dapple record --builtin atrium --seconds 10 --hz 15 --points 512 -o atrium.dapple
  dapple record city.glb --radius auto --snapshot-every 2 -o city.dapple
  dapple record --builtin street --area-lights -o street.dapple

The scene itself is not in the file: who plays it loads the same scene (a built-in one with the same detail).
docs/recording.md specifies the file.";

pub(crate) const INSPECT_EXAMPLES: &str = "\
Examples:
  dapple inspect room.dapple
  dapple inspect room.dapple --scene room.glb            does the light belong to this scene?
  dapple inspect atrium.dapple --builtin atrium";

pub(crate) const DEMO_EXAMPLES: &str = "\
Examples:
  dapple demo                                    the built-in atrium; make demo builds the page first
  dapple demo --port 9000 --page target/web
  dapple demo --detail 0.5 --points 512 --out out/large --fresh

With the environment variable CI set it fetches its own page once and ends.";

/// How points are laid and updated.
#[derive(Debug, Clone, Args)]
pub(crate) struct LightArgs {
    /// Points, updates a second and budget that fit a device, where they are not given.
    #[arg(long, value_enum)]
    pub(crate) preset: Option<Preset>,
    /// Points spawned a square metre; half are kept [default: 512, or the preset's].
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    pub(crate) points: Option<f32>,
    /// Server updates a second [default: 15, or the preset's].
    #[arg(long, value_name = "H", allow_hyphen_values = true)]
    pub(crate) hz: Option<f64>,
    /// Points say how much of each area light they see too (whatever emits: 5 bits a point and light), and viewers draw soft shadows of them.
    /// What is off by less than a share T of a point's light waits: 0.5 for a third of the bits where lights move, 0 for everything at once. T comes behind =; without it, it is 0.1.
    #[arg(long, value_name = "T", require_equals = true)]
    pub(crate) area_lights: Option<Option<f32>>,
    #[command(flatten)]
    pub(crate) visibility: VisibilityArgs,
    #[command(flatten)]
    pub(crate) step: StepArgs,
}

impl LightArgs {
    pub(crate) fn points_per_m2(&self) -> f32 {
        self.points.or(self.preset.map(Preset::points_per_m2)).unwrap_or(512.0)
    }

    pub(crate) fn hz(&self) -> f64 {
        self.hz.or(self.preset.map(Preset::hz)).unwrap_or(15.0)
    }

    /// Most bits of updates in any second.
    pub(crate) fn bits_per_s(&self) -> Option<u64> {
        self.step.budget.or(self.preset.map(Preset::budget)).map(|rate| rate.0)
    }
}

#[derive(Debug, Clone, Args)]
pub(crate) struct RecordArgs {
    #[command(flatten)]
    pub(crate) scene: SceneChoice,
    #[command(flatten)]
    pub(crate) light: LightArgs,
    /// Seconds that are recorded, from the start of the animation [default: all of it; 10 of a still scene].
    #[arg(long, value_name = "S", allow_hyphen_values = true)]
    pub(crate) seconds: Option<f64>,
    /// Seconds after which a snapshot is recorded again, where a player can begin.
    #[arg(long, value_name = "S", default_value_t = 5.0, allow_hyphen_values = true)]
    pub(crate) snapshot_every: f64,
    /// What it shows, for people [default: the scene's name].
    #[arg(long, value_name = "TEXT")]
    pub(crate) name: Option<String>,
    /// The file to write [default: the scene's name with .dapple].
    #[arg(short, long, value_name = "FILE.dapple")]
    pub(crate) output: Option<PathBuf>,
    /// Threads; 0 is one for each core.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) threads: usize,
}

#[derive(Debug, Clone, Args)]
pub(crate) struct InspectArgs {
    /// The file.
    #[arg(value_name = "FILE.dapple")]
    pub(crate) file: PathBuf,
    /// Compare with the scene in this file.
    #[arg(long, value_name = "SCENE", conflicts_with = "builtin")]
    pub(crate) scene: Option<PathBuf>,
    /// Compare with this built-in scene.
    #[arg(long, value_name = "NAME")]
    pub(crate) builtin: Option<String>,
    /// Tessellation of the built-in scene, above 0 to 1.
    #[arg(long, value_name = "D")]
    pub(crate) detail: Option<f32>,
}

#[derive(Debug, Clone, Args)]
pub(crate) struct DemoArgs {
    /// The built-in scene that is shown.
    #[arg(long, value_name = "NAME", default_value = "atrium")]
    pub(crate) builtin: String,
    /// Its tessellation, above 0 to 1.
    #[arg(long, value_name = "D", default_value_t = 0.25)]
    pub(crate) detail: f32,
    #[command(flatten)]
    pub(crate) light: LightArgs,
    /// Seconds that are recorded and played round and round [default: the whole animation].
    #[arg(long, value_name = "S", allow_hyphen_values = true)]
    pub(crate) seconds: Option<f64>,
    /// Folder of the built page [default: target/web].
    #[arg(long, value_name = "DIR")]
    pub(crate) page: Option<PathBuf>,
    /// Folder that is filled and served.
    #[arg(long, value_name = "DIR", default_value = "out/demo-page")]
    pub(crate) out: PathBuf,
    /// Make scene and light again, whether they are up to date or not.
    #[arg(long)]
    pub(crate) fresh: bool,
    /// Address to listen on; 0.0.0.0 lets others in the network in.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1")]
    pub(crate) host: String,
    /// Port to listen on; 0 takes any [default: 8000, or the next that is free].
    #[arg(long, value_name = "PORT")]
    pub(crate) port: Option<u16>,
}
