//! What judges pictures beside PSNR and SSIM, as the command line asks for it.

use anyhow::{Context, Result, bail};
use dapple_metrics::Lpips;

use crate::args::JudgeArgs;
use crate::source::read_limited;

/// The largest file of weights that is read; they take 2.9 MB.
const MAX_WEIGHTS_BYTES: u64 = 16 << 20;

/// Metrics with parameters.
pub(crate) struct Judge {
    pub(crate) lpips: Option<Lpips>,
    /// Hash of the weights.
    pub(crate) weights: Option<String>,
    /// For FLIP.
    pub(crate) pixels_per_degree: f32,
}

impl Judge {
    pub(crate) fn new(args: &JudgeArgs) -> Result<Judge> {
        if !(1.0..=1000.0).contains(&args.ppd) {
            bail!("--ppd is {}, must be 1 to 1000", args.ppd);
        }
        let mut judge = Judge { lpips: None, weights: None, pixels_per_degree: args.ppd };
        // A variable that is set to nothing names no file.
        if let Some(file) = args.lpips_weights.as_deref().filter(|file| !file.as_os_str().is_empty()) {
            let bytes = read_limited(file, MAX_WEIGHTS_BYTES)
                .with_context(|| format!("cannot read the weights {}", file.display()))?;
            let lpips = Lpips::from_safetensors(&bytes).with_context(|| file.display().to_string())?;
            judge.lpips = Some(lpips);
            judge.weights = Some(blake3::hash(&bytes).to_hex()[..16].to_owned());
        }
        Ok(judge)
    }
}
