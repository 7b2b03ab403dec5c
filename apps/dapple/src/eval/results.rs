//! `results.json`: the schema is documented in `docs/evaluation.md`.

use dapple_trace::psao::update::StepCounts;
use serde::{Deserialize, Serialize};

/// Everything one evaluation found.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Results {
    /// Version of this schema.
    pub(crate) schema: u32,
    pub(crate) scene: SceneInfo,
    pub(crate) run: RunInfo,
    pub(crate) machine: Machine,
    pub(crate) rows: Vec<Row>,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct SceneInfo {
    pub(crate) name: String,
    pub(crate) hash: String,
    pub(crate) triangles: u64,
    pub(crate) instances: u64,
    pub(crate) warnings: Vec<String>,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct RunInfo {
    pub(crate) dapple_version: String,
    pub(crate) commit: Option<String>,
    pub(crate) command: String,
    pub(crate) path: String,
    pub(crate) seconds: f64,
    pub(crate) frame_times_s: Vec<f64>,
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) supersample: u32,
    pub(crate) reference_rays: u32,
    pub(crate) radius_m: f32,
    pub(crate) seed: u32,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Machine {
    pub(crate) cpu: String,
    pub(crate) threads: usize,
    pub(crate) os: String,
}

/// One method in one setting.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Row {
    pub(crate) method: String,
    pub(crate) params: Params,
    pub(crate) visibility_psnr_db: Option<f64>,
    pub(crate) compared_pixels: u64,
    pub(crate) psnr_db: Option<f64>,
    pub(crate) ssim: f64,
    pub(crate) flip: f64,
    pub(crate) kbit_per_s: Option<f64>,
    pub(crate) snapshot_bytes: Option<u64>,
    /// Of the snapshot: which points do not count at which texels.
    pub(crate) cut_bytes: Option<u64>,
    pub(crate) points: Option<u64>,
    pub(crate) rays: u64,
    /// Of the server's steps, the start not counted.
    pub(crate) steps: Option<Steps>,
    pub(crate) server_ms: Option<f64>,
    pub(crate) client_ms: f64,
    pub(crate) frames: Vec<FrameRow>,
}

/// What the steps of a run did, in points and rays.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
pub(crate) struct Steps {
    /// Points that motion may have changed.
    pub(crate) selected: u64,
    /// Points traced against everything.
    pub(crate) traced_full: u64,
    /// Points traced against movers alone.
    pub(crate) traced_movers: u64,
    /// Points at rest that got more rays.
    pub(crate) refined: u64,
    /// Most points that a step left to later ones.
    pub(crate) most_backlog: u64,
    pub(crate) rays_full: u64,
    pub(crate) rays_movers: u64,
    pub(crate) rays_refined: u64,
}

impl Steps {
    pub(crate) fn add(&mut self, counts: &StepCounts) {
        self.selected += u64::from(counts.selected);
        self.traced_full += u64::from(counts.traced_full);
        self.traced_movers += u64::from(counts.traced_movers);
        self.refined += u64::from(counts.refined);
        self.most_backlog = self.most_backlog.max(u64::from(counts.backlog));
        self.rays_full += counts.rays_full;
        self.rays_movers += counts.rays_movers;
        self.rays_refined += counts.rays_refined;
    }
}

#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(crate) struct Params {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) points_per_m2: Option<f32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) hz: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) point_rays: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) threshold: Option<u8>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) ray_budget: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) rays_still: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) rays_per_pixel: Option<u32>,
}

/// One picture of a row.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct FrameRow {
    pub(crate) time_s: f64,
    pub(crate) visibility_psnr_db: Option<f64>,
    pub(crate) psnr_db: Option<f64>,
    pub(crate) ssim: f64,
    pub(crate) flip: f64,
    /// Paths relative to the results file.
    pub(crate) beauty: String,
    pub(crate) visibility: String,
    pub(crate) error: String,
}

impl Machine {
    pub(crate) fn here() -> Machine {
        let cpu = std::fs::read_to_string("/proc/cpuinfo")
            .ok()
            .and_then(|text| {
                let line = text.lines().find(|l| l.starts_with("model name"))?;
                Some(line.split_once(':')?.1.trim().to_owned())
            })
            .unwrap_or_else(|| std::env::consts::ARCH.to_owned());
        Machine { cpu, threads: rayon::current_num_threads(), os: std::env::consts::OS.to_owned() }
    }
}

/// The commit the program runs from, where there is a repository around the current folder and git is installed.
pub(crate) fn commit() -> Option<String> {
    let run = |args: &[&str]| {
        let output = std::process::Command::new("git").args(args).output().ok()?;
        output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    let commit = run(&["rev-parse", "--short=12", "HEAD"])?;
    let clean = run(&["status", "--porcelain"]).is_some_and(|s| s.is_empty());
    Some(if clean { commit } else { format!("{commit}+changes") })
}

/// The mean squared error of several pictures as PSNR in dB; `None` when all are exactly equal.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct PooledError {
    sum: f64,
    count: f64,
}

impl PooledError {
    /// The weight of everything that was added.
    pub(crate) fn count(&self) -> f64 {
        self.count
    }

    /// Adds one picture's PSNR (peak 1), weighed by `samples`.
    pub(crate) fn add(&mut self, psnr_db: f64, samples: f64) {
        let mse = if psnr_db.is_finite() { 10f64.powf(-psnr_db / 10.0) } else { 0.0 };
        self.sum += mse * samples;
        self.count += samples;
    }

    pub(crate) fn psnr_db(&self) -> Option<f64> {
        (self.sum > 0.0).then(|| -10.0 * (self.sum / self.count).log10())
    }
}
