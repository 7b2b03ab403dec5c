//! Arguments of `dapple view`.

use std::path::PathBuf;
use std::sync::LazyLock;

use clap::builder::PossibleValue;
use clap::{Args, ValueEnum};
use dapple_client::viewer::{DebugView, Method};
use dapple_render::screen_space::ScreenKind;

use serde::Deserialize;

use super::{BitRate, EffortArgs, SceneChoice, Size, StepArgs, VisibilityArgs};

pub(crate) const VIEW_EXAMPLES: &str = "\
Examples:
  dapple view room.glb                           lights the room while you walk through it
  dapple view --builtin atrium --detail 0.5 --points 256 --hz 5
  dapple view --builtin street --area-lights     soft shadows of whatever emits
  dapple view room.glb --stream room.dapple      plays a recording (dapple record)
  dapple view --url http://127.0.0.1:8000/       what a page there shows (dapple demo), or a live session (dapple serve)
  dapple view room.glb --camera walk.json        along a camera path that was recorded (R) or written by hand
  dapple view --builtin atrium --method sd-hbao-plus --second-camera
  dapple view --builtin atrium --headless --frames 8 --view texels --size 640x360 -o out/texels

In the window H or F1 lists the keys.";

#[derive(Debug, Clone, Args)]
pub(crate) struct ViewArgs {
    #[command(flatten)]
    pub(crate) scene: SceneChoice,
    /// Folder of a page (its viewer.json, scene and recording or live session), over plain HTTP.
    #[arg(long, value_name = "URL", conflicts_with_all = ["scene", "builtin", "detail", "stream"])]
    pub(crate) url: Option<String>,
    /// What gives more rights in a live session, where its host asks for that (dapple serve --token).
    #[arg(long, value_name = "SECRET", requires = "url", env = "DAPPLE_TOKEN", hide_env_values = true)]
    pub(crate) token: Option<String>,
    /// Join the live session over QUIC (MoQ), as --url says, or at a relay's address: https://RELAY/, or http://RELAY/ for one that tells the hash of
    /// its certificate. Needs the feature moq.
    #[arg(long, value_name = "RELAY", requires = "url", num_args = 0..=1, default_missing_value = "")]
    pub(crate) moq: Option<String>,
    /// Recording to play; without it the scene is lit while it is shown.
    #[arg(long, value_name = "FILE.dapple", conflicts_with_all = ["points", "hz"])]
    pub(crate) stream: Option<PathBuf>,
    /// Points spawned a square metre; half are kept [default: the preset's].
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    pub(crate) points: Option<f32>,
    /// Server updates a second [default: 15].
    #[arg(long, value_name = "H", allow_hyphen_values = true)]
    pub(crate) hz: Option<f64>,
    /// Draw soft shadows of whatever emits: points say how much of each light they see. What plays a stream or a page draws them where the stream has them. L turns
    /// them off and on. T is as of dapple serve, 0.1 without it.
    #[arg(long, value_name = "T", require_equals = true, conflicts_with_all = ["stream", "url"])]
    pub(crate) area_lights: Option<Option<f32>>,
    #[command(flatten)]
    pub(crate) visibility: VisibilityArgs,
    #[command(flatten)]
    pub(crate) step: StepArgs,
    /// Effort: points, samples a pixel, shadow maps.
    #[arg(long, value_enum, default_value = "desktop")]
    pub(crate) preset: Preset,
    /// Samples a pixel, 1 or 4 [default: the preset's].
    #[arg(long, value_name = "N")]
    pub(crate) samples: Option<u32>,
    /// How visibility is found.
    #[arg(long, value_enum, default_value = "psao")]
    pub(crate) method: ViewMethod,
    /// What is drawn.
    #[arg(long, value_enum, default_value = "beauty")]
    pub(crate) view: ViewKind,
    /// Right of this part of the width (0 to 1) the other method is shown.
    #[arg(long, value_name = "PART")]
    pub(crate) split: Option<f32>,
    /// The other method of a split picture.
    #[arg(long, value_enum, default_value = "none")]
    pub(crate) other: ViewMethod,
    /// What stands in for points while there are none: a screen-space method, or none.
    #[arg(long, value_enum, value_name = "METHOD", default_value = "none")]
    pub(crate) fallback: ViewMethod,
    #[command(flatten)]
    pub(crate) effort: EffortArgs,
    /// sd-ssao and sd-hbao-plus see from a second camera, too, METRES to the right: what the first one looks along.
    #[arg(
        long,
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "2",
        allow_negative_numbers = true,
        value_name = "METRES"
    )]
    pub(crate) second_camera: Option<f32>,
    /// Seconds that an update fades in over; 0 for none [default: as long as updates are apart, at most half a second; 0 with --headless].
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub(crate) fade: Option<f32>,
    /// A camera of the scene by name, a camera path's FILE.json, or one given as eye=X,Y,Z,target=X,Y,Z,fov=DEGREES
    /// (vertical) [default: the scene's first camera path].
    #[arg(long, value_name = "CAMERA")]
    pub(crate) camera: Option<String>,
    /// Animation time to begin at, seconds.
    #[arg(long, value_name = "T", default_value_t = 0.0, allow_hyphen_values = true)]
    pub(crate) time: f64,
    /// Begin with time standing still.
    #[arg(long)]
    pub(crate) paused: bool,
    /// Size of window or pictures in pixels.
    #[arg(long, value_name = "WxH", default_value = "1280x720")]
    pub(crate) size: Size,
    /// Where camera paths are recorded to (R) [default: camera-path-1.json, or the next number that is free].
    #[arg(long, value_name = "FILE.json", conflicts_with = "headless")]
    pub(crate) record_path: Option<PathBuf>,
    /// Write pictures instead of opening a window.
    #[arg(long)]
    pub(crate) headless: bool,
    /// Pictures to write, evenly spread over the seconds from --time on.
    #[arg(long, value_name = "N", default_value_t = 1, requires = "headless")]
    pub(crate) frames: u32,
    /// Seconds that the pictures are spread over [default: the rest of the animation].
    #[arg(long, value_name = "S", requires = "headless")]
    pub(crate) seconds: Option<f64>,
    /// Folder for pictures and screenshots [default: out/view; the current folder for screenshots].
    #[arg(short, long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
}

/// How much effort a device can make, and how much a connection to it can carry.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Preset {
    /// 256 points a square metre; sent 15 times a second, 0.5 Mbit/s; drawn with 1 sample, small shadow maps.
    Phone,
    /// 512 points a square metre; sent 30 times a second, 2 Mbit/s; drawn with 4 samples, small shadow maps.
    Headset,
    /// 512 points a square metre; sent 60 times a second, 8 Mbit/s; drawn with 4 samples, large shadow maps.
    Desktop,
}

impl Preset {
    /// Points spawned a square metre.
    pub(crate) fn points_per_m2(self) -> f32 {
        match self {
            Preset::Phone => 256.0,
            Preset::Headset | Preset::Desktop => 512.0,
        }
    }

    /// Updates a second.
    pub(crate) fn hz(self) -> f64 {
        match self {
            Preset::Phone => 15.0,
            Preset::Headset => 30.0,
            Preset::Desktop => 60.0,
        }
    }

    /// Most bits of updates in any second.
    pub(crate) fn budget(self) -> BitRate {
        BitRate(match self {
            Preset::Phone => 500_000,
            Preset::Headset => 2_000_000,
            Preset::Desktop => 8_000_000,
        })
    }
}

/// A viewer's [`Method`] by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct ViewMethod(pub(crate) Method);

impl ViewMethod {
    /// Which screen-space method it is, if it is one.
    pub(crate) fn screen_space(self) -> Option<ScreenKind> {
        match self.0 {
            Method::Screen(kind) => Some(kind),
            _ => None,
        }
    }
}

impl ValueEnum for ViewMethod {
    fn value_variants<'a>() -> &'a [ViewMethod] {
        static ALL: LazyLock<Vec<ViewMethod>> =
            LazyLock::new(|| Method::ALL.into_iter().map(ViewMethod).collect());
        &ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let help = match self.0 {
            Method::Psao => "Points, through the visibility atlas",
            Method::PsaoPaper => "Points, by the paper's look-up",
            Method::None => "No occlusion",
            Method::Screen(ScreenKind::Ssao) => "Screen space: random places in a hemisphere",
            Method::Screen(ScreenKind::Alchemy) => "Screen space: AlchemyAO",
            Method::Screen(ScreenKind::Sao) => "Screen space: scalable ambient obscurance",
            Method::Screen(ScreenKind::Hbao) => "Screen space: horizons",
            Method::Screen(ScreenKind::HbaoPlus) => "Screen space: HBAO+",
            Method::Screen(ScreenKind::Gtao) => "Screen space: GTAO with a visibility bitmask",
            Method::Screen(ScreenKind::SdSsao) => "Screen space: SSAO over a stochastic depth map",
            Method::Screen(ScreenKind::SdHbao) => "Screen space: horizons over a stochastic depth map",
            Method::Screen(ScreenKind::SdHbaoPlus) => "Screen space: HBAO+ over a stochastic depth map",
        };
        Some(PossibleValue::new(self.0.name()).help(help))
    }
}

/// A viewer's [`DebugView`] by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ViewKind {
    /// The lit scene.
    Beauty,
    /// Visibility alone, white is open.
    Visibility,
    /// World normals as colours.
    Normal,
    /// The points in the shade of their visibility.
    Points,
    /// The texels of the atlas, charts in different colours.
    Texels,
    /// How many points a texel depends on.
    Weights,
    /// Time since visibility last changed.
    Age,
    /// Difference of --method and --other.
    Error,
}

impl From<ViewKind> for DebugView {
    fn from(kind: ViewKind) -> DebugView {
        match kind {
            ViewKind::Beauty => DebugView::Beauty,
            ViewKind::Visibility => DebugView::Visibility,
            ViewKind::Normal => DebugView::Normal,
            ViewKind::Points => DebugView::Points,
            ViewKind::Texels => DebugView::Texels,
            ViewKind::Weights => DebugView::Weights,
            ViewKind::Age => DebugView::Age,
            ViewKind::Error => DebugView::Error,
        }
    }
}
