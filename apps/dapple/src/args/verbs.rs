//! Arguments of `dapple eval diff` and `dapple eval compare`: pictures that already exist.

use std::path::PathBuf;

use clap::builder::{OsStringValueParser, TypedValueParser};
use clap::{Args, Subcommand, ValueEnum};
use dapple_metrics::PIXELS_PER_DEGREE;

use super::{Options, ScenesArgs};

/// What `eval` does with pictures instead of a scene.
#[derive(Debug, Clone, Subcommand)]
pub(crate) enum EvalVerb {
    /// Compare two pictures: PSNR, SSIM, FLIP and, with weights, LPIPS; HDR-FLIP for linear ones.
    #[command(after_help = DIFF_EXAMPLES)]
    Diff(DiffArgs),
    /// Compare folders of pictures of equal names with a folder of references.
    #[command(after_help = COMPARE_EXAMPLES)]
    Compare(CompareArgs),
    /// Trace the truth along camera paths and write its pictures, for other programs to be compared with.
    #[command(after_help = REFERENCE_EXAMPLES)]
    Reference(Box<ReferenceArgs>),
    /// Write the report of results again, without tracing anything.
    Report(ReportArgs),
}

const REFERENCE_EXAMPLES: &str = "\
Examples:
  dapple eval reference room.glb --radius auto --frames 30 --reference-rays 4096 --out out/truth
  dapple eval reference --builtin lab --path all --size 1920x1080 --formats png,exr
  dapple eval compare out/truth/room-orbit/beauty out/mine/

DIR/CASE/beauty and DIR/CASE/visibility get a picture a frame, DIR/truth.json says of what.";

const DIFF_EXAMPLES: &str = "\
Examples:
  dapple eval diff truth.png test.png
  dapple eval diff truth.png test.png --kind flip,signed -o error.png     writes error-flip.png and error-signed.png
  dapple eval diff truth.exr test.exr --kind flip -o error.png            HDR-FLIP of linear light
  dapple eval diff truth.png test.png --lpips-weights lpips_v0.1_squeeze.safetensors --json

PNG and JPEG files are sRGB-encoded, of 8 or 16 bits; EXR and HDR files hold linear light. FLIP and LPIPS see encoded
pictures rounded to 8 bits. Transparent pixels are compared over black.";

const COMPARE_EXAMPLES: &str = "\
Examples:
  dapple eval compare truth/ out/psao/ out/none/
  dapple eval compare truth/ out/ --still-camera --maps out/maps          flicker, where it is, and the worst pictures
  dapple eval compare truth/ out/ --csv out/frames.csv --json > out/compared.json

Pictures belong together by name and follow one another as names do, frame-9 before frame-10.";

/// How pictures are judged.
#[derive(Debug, Clone, Args)]
pub(crate) struct JudgeArgs {
    /// Weights for LPIPS (SqueezeNet), a .safetensors file; without them it is not computed.
    #[arg(
        long,
        value_name = "FILE",
        env = "DAPPLE_LPIPS_WEIGHTS",
        // Of paths clap refuses the empty one, which a variable that is set to nothing would be.
        value_parser = OsStringValueParser::new().map(PathBuf::from)
    )]
    pub(crate) lpips_weights: Option<PathBuf>,
    /// Pixels a degree of visual angle, for FLIP, 1 to 1000.
    #[arg(long, value_name = "N", default_value_t = PIXELS_PER_DEGREE)]
    pub(crate) ppd: f32,
}

#[derive(Debug, Clone, Args)]
pub(crate) struct DiffArgs {
    /// The picture that is right.
    pub(crate) reference: PathBuf,
    /// The picture that is judged.
    pub(crate) test: PathBuf,
    #[command(flatten)]
    pub(crate) judge: JudgeArgs,
    /// Write a map of the error; with several kinds, their names are added to it.
    #[arg(short, long, value_name = "FILE.png")]
    pub(crate) output: Option<PathBuf>,
    /// Which error the map shows; several can be listed.
    #[arg(
        long,
        value_enum,
        value_delimiter = ',',
        value_name = "KIND,…",
        default_value = "flip",
        requires = "output"
    )]
    pub(crate) kind: Vec<ErrorMap>,
    /// Print JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Clone, Args)]
pub(crate) struct CompareArgs {
    /// The folder of pictures that are right.
    pub(crate) reference: PathBuf,
    /// Folders of pictures that are judged.
    #[arg(required = true, value_name = "TEST")]
    pub(crate) tests: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) judge: JudgeArgs,
    /// The camera stands still: measure how much pixels change from picture to picture.
    #[arg(long)]
    pub(crate) still_camera: bool,
    /// How many of the worst pictures are named, by FLIP.
    #[arg(long, value_name = "N", default_value_t = 3)]
    pub(crate) worst: usize,
    /// Write FLIP's maps of the worst pictures, and with --still-camera those of flicker, into this folder.
    #[arg(long, value_name = "DIR")]
    pub(crate) maps: Option<PathBuf>,
    /// Write a line for each picture to this file.
    #[arg(long, value_name = "FILE.csv")]
    pub(crate) csv: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

/// What a picture is written as.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum PictureFormat {
    /// 8 bits, tone-mapped.
    Png,
    /// Linear light in single precision.
    Exr,
}

#[derive(Debug, Clone, Args)]
pub(crate) struct ReferenceArgs {
    #[command(flatten)]
    pub(crate) scenes: ScenesArgs,
    #[command(flatten)]
    pub(crate) options: Options,
    /// What pictures are written as.
    #[arg(long, value_enum, value_delimiter = ',', value_name = "FORMAT,…", default_values_t = [PictureFormat::Png])]
    pub(crate) formats: Vec<PictureFormat>,
    /// Folder for the pictures, and for traced truth.
    #[arg(long, value_name = "DIR", default_value = "out/reference")]
    pub(crate) out: PathBuf,
    /// Folder for traced truth, which evaluations can share [default: DIR/truth].
    #[arg(long, value_name = "DIR", env = "DAPPLE_TRUTH_CACHE")]
    pub(crate) truth_cache: Option<PathBuf>,
    /// Threads; 0 is one for each core.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) threads: usize,
}

#[derive(Debug, Clone, Args)]
pub(crate) struct ReportArgs {
    /// A results.json, beside the pictures that it names.
    #[arg(value_name = "results.json")]
    pub(crate) results: PathBuf,
    /// The page to write [default: report.html beside the results].
    #[arg(short, long, value_name = "FILE.html")]
    pub(crate) output: Option<PathBuf>,
}

/// What a map of errors shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ErrorMap {
    /// FLIP (HDR-FLIP of linear pictures): black is 0, pale yellow 1.
    Flip,
    /// test - reference, mean of the channels: blue is too dark, brown too light, from -0.25 to 0.25.
    Signed,
    /// Its size, mean over the channels: black is 0, yellow 0.25 and above.
    Absolute,
    /// Its square, mean over the channels: black is 0, yellow 0.0625 and above.
    Squared,
    /// 1 - SSIM around each pixel: black is 0, pale yellow 1 and above.
    Ssim,
    /// LPIPS: black is 0, pale yellow 0.5 and above. Needs weights.
    Lpips,
}

impl ErrorMap {
    /// As on the command line.
    pub(crate) fn name(self) -> &'static str {
        match self {
            ErrorMap::Flip => "flip",
            ErrorMap::Signed => "signed",
            ErrorMap::Absolute => "absolute",
            ErrorMap::Squared => "squared",
            ErrorMap::Ssim => "ssim",
            ErrorMap::Lpips => "lpips",
        }
    }
}
