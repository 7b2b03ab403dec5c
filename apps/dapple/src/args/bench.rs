//! Arguments of `dapple bench`.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::BitRate;

const VIEWERS_EXAMPLES: &str = "\
Examples:
  dapple bench viewers                           1, 10, 100 and 1000 viewers of the atrium that this program serves itself
  dapple bench viewers --counts 1,50 --seconds 5 --builtin lab --points 512
  dapple bench viewers --url http://host:8000/ --counts 100          of a server that runs elsewhere

The server is a process of its own. Viewers take every message and answer as real ones do; --checked of them decode every frame.";

const SOAK_EXAMPLES: &str = "\
Examples:
  dapple bench soak                              ten minutes
  dapple bench soak --seconds 60 --viewers 20
";

#[derive(Debug, Clone, Args)]
pub(crate) struct BenchArgs {
    #[command(subcommand)]
    pub(crate) what: Bench,
}

#[derive(Debug, Clone, Subcommand)]
pub(crate) enum Bench {
    /// What a viewer costs a live server, and how old its light is.
    #[command(after_help = VIEWERS_EXAMPLES)]
    Viewers(ViewersArgs),
    /// How long a viewer waits for the first light over a link of a given width and delay, and what that takes.
    Join(JoinArgs),
    /// Viewers that join, leave, stall, break off and move things for a long while; the light must come to all, and memory stay flat.
    #[command(after_help = SOAK_EXAMPLES)]
    Soak(SoakArgs),
}

/// What is served for the test.
#[derive(Debug, Clone, Args)]
pub(crate) struct ServedArgs {
    /// Built-in scene that is served.
    #[arg(long, value_name = "NAME", default_value = "atrium")]
    pub(crate) builtin: String,
    /// Its tessellation, above 0 to 1.
    #[arg(long, value_name = "D", default_value_t = 0.25)]
    pub(crate) detail: f32,
    /// Points spawned a square metre; half are kept.
    #[arg(long, value_name = "N", default_value_t = 256.0)]
    pub(crate) points: f32,
    /// Updates a second.
    #[arg(long, value_name = "H", default_value_t = 20.0)]
    pub(crate) hz: f64,
    /// With how much of each area light is seen, too (as dapple serve --area-lights[=T], T 0.1 without it).
    #[arg(long, value_name = "T", require_equals = true)]
    pub(crate) area_lights: Option<Option<f32>>,
    /// Join over QUIC (MoQ), as the server says, or at a relay's address (as dapple view --moq). Needs the feature moq.
    #[arg(long, value_name = "RELAY", num_args = 0..=1, default_missing_value = "")]
    pub(crate) moq: Option<String>,
}

#[derive(Debug, Clone, Args)]
pub(crate) struct ViewersArgs {
    #[command(flatten)]
    pub(crate) served: ServedArgs,
    /// Address of a server that runs already, over plain HTTP.
    #[arg(long, value_name = "URL", conflicts_with_all = ["builtin", "detail", "points", "hz", "area_lights"])]
    pub(crate) url: Option<String>,
    /// Numbers of viewers that are tried, one after the other.
    #[arg(long, value_name = "N,…", value_delimiter = ',', default_values_t = [1, 10, 100, 1000])]
    pub(crate) counts: Vec<u32>,
    /// Seconds that each is measured for, after all have joined.
    #[arg(long, value_name = "S", default_value_t = 10.0)]
    pub(crate) seconds: f64,
    /// Viewers that decode every frame and compare what they hold at the end.
    #[arg(long, value_name = "N", default_value_t = 2)]
    pub(crate) checked: u32,
    /// Bits a second that viewers ask for, which decides on the stream that they get [default: the full one].
    #[arg(long, value_name = "BITS/S")]
    pub(crate) budget: Option<BitRate>,
    /// Also write the figures as JSON.
    #[arg(short, long, value_name = "FILE.json")]
    pub(crate) output: Option<PathBuf>,
}

#[derive(Debug, Clone, Args)]
pub(crate) struct JoinArgs {
    #[command(flatten)]
    pub(crate) served: ServedArgs,
    /// Bits a second that the link carries towards the viewer.
    #[arg(long, value_name = "BITS/S", default_value = "10M")]
    pub(crate) link: BitRate,
    /// Delay of the link, there and back, milliseconds.
    #[arg(long, value_name = "MS", default_value_t = 50.0)]
    pub(crate) delay: f64,
    /// How often.
    #[arg(long, value_name = "N", default_value_t = 5)]
    pub(crate) times: u32,
}

#[derive(Debug, Clone, Args)]
pub(crate) struct SoakArgs {
    #[command(flatten)]
    pub(crate) served: ServedArgs,
    /// Seconds that it lasts.
    #[arg(long, value_name = "S", default_value_t = 600.0)]
    pub(crate) seconds: f64,
    /// Viewers at a time.
    #[arg(long, value_name = "N", default_value_t = 24)]
    pub(crate) viewers: u32,
    /// Seed of who does what when.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) seed: u64,
}
