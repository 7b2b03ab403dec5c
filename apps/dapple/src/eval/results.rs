//! `results.json`: the schema is documented in `docs/evaluation.md`.

use dapple_trace::psao::update::StepCounts;
use serde::{Deserialize, Serialize};

/// Version of this schema.
pub(crate) const SCHEMA: u32 = 4;

/// Everything one evaluation found.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Results {
    pub(crate) schema: u32,
    /// What was evaluated, in a few words.
    pub(crate) title: String,
    pub(crate) run: RunInfo,
    pub(crate) machine: Machine,
    pub(crate) judge: JudgeInfo,
    /// One scene along one path each.
    pub(crate) cases: Vec<Case>,
    /// What the suite measured beside them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) studies: Vec<StudyResult>,
    /// Scenes that could not be evaluated, or not along all of their paths.
    pub(crate) failures: Vec<Failure>,
    /// What the figures cannot tell, and what to do about it.
    pub(crate) advice: Vec<Advice>,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct RunInfo {
    pub(crate) dapple_version: String,
    /// Hash of the program's file, 16 hexadecimal digits.
    pub(crate) program: String,
    pub(crate) commit: Option<String>,
    pub(crate) command: String,
}

/// What metrics depend on beside the pictures.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct JudgeInfo {
    /// Of the observer of FLIP.
    pub(crate) pixels_per_degree: f32,
    /// Hash of the weights of LPIPS; absent without.
    pub(crate) lpips_weights: Option<String>,
}

/// What could not be evaluated, and why.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Failure {
    pub(crate) scene: String,
    pub(crate) error: String,
}

#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Machine {
    pub(crate) cpu: String,
    pub(crate) threads: usize,
    pub(crate) os: String,
}

/// One scene along one camera path: everything that its truth depends on, and the methods compared with it.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Case {
    /// Unique within the results.
    pub(crate) name: String,
    pub(crate) scene: SceneInfo,
    /// Of the file, that is played; absent where it has none.
    pub(crate) animation: Option<String>,
    pub(crate) path: String,
    /// Length of the path that is played.
    pub(crate) seconds: f64,
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) supersample: u32,
    pub(crate) reference_rays: u32,
    pub(crate) radius_m: f32,
    pub(crate) seed: u32,
    pub(crate) truth: Truth,
    pub(crate) rows: Vec<Row>,
}

#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct SceneInfo {
    pub(crate) name: String,
    pub(crate) hash: String,
    pub(crate) triangles: u64,
    pub(crate) instances: u64,
    pub(crate) warnings: Vec<String>,
}

/// The ray-traced pictures of a case.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(crate) struct Truth {
    /// Root mean square of the truth's own Monte Carlo noise in visibility, over pixels, 0 … 1. The error of a perfect
    /// method would be this.
    pub(crate) noise_rms: f64,
    pub(crate) frames: Vec<TruthFrame>,
}

/// One of the truth's pictures.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct TruthFrame {
    pub(crate) time_s: f64,
    /// Pixels that show geometry.
    pub(crate) covered_pixels: u64,
    pub(crate) noise_rms: f64,
    /// Paths relative to the results file.
    pub(crate) beauty: String,
    pub(crate) visibility: String,
}

/// A figure over the frames of a row.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Figure {
    /// Absent where it would be infinite (PSNR of equal pictures).
    pub(crate) value: Option<f64>,
    /// Half of its 95 % interval, for other frames of the same path; absent for fewer than three.
    pub(crate) ci95: Option<f64>,
}

/// One method in one setting.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Row {
    pub(crate) method: String,
    pub(crate) params: Params,
    /// Pixels of all frames that show geometry.
    pub(crate) compared_pixels: u64,
    pub(crate) visibility_psnr_db: Figure,
    /// Within reach of what moves.
    pub(crate) moving_psnr_db: Figure,
    pub(crate) psnr_db: Figure,
    pub(crate) ssim: Figure,
    pub(crate) flip: Figure,
    pub(crate) hdr_flip: Option<Figure>,
    pub(crate) lpips: Option<Figure>,
    /// Root mean square change, in 1/255 of visibility, of places at rest from one client frame to the next at 60 Hz.
    pub(crate) flicker: Option<Figure>,
    pub(crate) kbit_per_s: Option<Figure>,
    pub(crate) snapshot_bytes: Option<u64>,
    /// Of the snapshot: which points do not count at which texels.
    pub(crate) cut_bytes: Option<u64>,
    pub(crate) points: Option<u64>,
    pub(crate) rays: u64,
    /// Of the server's steps, the start not counted.
    pub(crate) steps: Option<Steps>,
    /// Bytes of the update of each server step, in order; step k is at (k + 1) / hz seconds.
    pub(crate) step_bytes: Vec<u32>,
    pub(crate) settling: Option<Settling>,
    pub(crate) frames: Vec<FrameRow>,
    /// The only part that differs between runs of one command.
    pub(crate) times: Times,
}

/// Wall times, which differ from run to run, and where they were taken: a run may continue on another machine.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(crate) struct Times {
    pub(crate) machine: Machine,
    /// Mean of a server step.
    pub(crate) server_ms: Option<f64>,
    /// Mean of reconstruction and of applying an update.
    pub(crate) client_ms: f64,
}

/// What is shown after everything moved at once and then stood still. The move comes just after a server step, the worst case.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Settling {
    /// Seconds after the move, one a client frame.
    pub(crate) after_s: Vec<f64>,
    /// Against the truth after the move; absent where equal to it.
    pub(crate) visibility_psnr_db: Vec<Option<f64>>,
    /// Root mean square difference of visibility to what is shown in the end, 0 … 1.
    pub(crate) behind_rms: Vec<f64>,
    /// Whether points still waited for rays or bits when watching ended, so that what is shown there is not the end.
    pub(crate) unfinished: bool,
    /// Seconds until no more than a twentieth of the squared difference is left; absent where nothing changed in view, or unfinished.
    pub(crate) settled_s: Option<f64>,
}

/// What the steps of a run did, in points and rays.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
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
    /// Where there is a cap on points: most points at a time, those that wait for their first rays counted; and how many instances'
    /// points came and went.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) most_points: Option<u64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) spawned: Option<u64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) evicted: Option<u64>,
}

impl Steps {
    /// Points of a step, and instances that came and went.
    pub(crate) fn add_sets(&mut self, points: u32, spawned: u32, evicted: u32) {
        self.most_points = self.most_points.max(Some(points.into()));
        self.spawned = Some(self.spawned.unwrap_or(0) + u64::from(spawned));
        self.evicted = Some(self.evicted.unwrap_or(0) + u64::from(evicted));
    }

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

/// What tells rows of one method apart.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Params {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) points_per_m2: Option<f32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) hz: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) point_rays: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) threshold: Option<u8>,
    /// How far the density of points follows the gradient of visibility; absent where it is uniform.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) adaptive: Option<f32>,
    /// Whether points carry bent normals; absent where they do not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) bent_normals: Option<bool>,
    /// Whether the truth gathers ambient light from the directions that are open; absent where it does not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) gather_ambient: Option<bool>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) ray_budget: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) rays_still: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) budget_kbit_per_s: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) max_points: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) rays_per_pixel: Option<u32>,
    /// Of screen-space methods: how much work they do; the resolution where it is not the preset's; and how far they see beyond the
    /// picture, as a part of its height.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) ao_preset: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) half_resolution: Option<bool>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) guard_band: Option<f32>,
}

/// One picture of a row.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct FrameRow {
    pub(crate) time_s: f64,
    /// Absent where equal to the truth, or without geometry.
    pub(crate) visibility_psnr_db: Option<f64>,
    /// Of pixels within reach of what moves, as above, and how many they are.
    pub(crate) moving_psnr_db: Option<f64>,
    pub(crate) moving_pixels: u64,
    pub(crate) psnr_db: Option<f64>,
    pub(crate) ssim: f64,
    pub(crate) flip: f64,
    pub(crate) hdr_flip: Option<f64>,
    pub(crate) lpips: Option<f64>,
    pub(crate) flicker: Option<f64>,
    /// Paths relative to the results file: the picture, its visibility, the signed error of visibility, FLIP as a heat map.
    pub(crate) beauty: String,
    pub(crate) visibility: String,
    pub(crate) error: String,
    pub(crate) flip_map: String,
}

/// What one study of a suite found.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct StudyResult {
    /// As the suite names it.
    pub(crate) kind: String,
    pub(crate) title: String,
    /// Scene and path; absent for a study without.
    pub(crate) subject: Option<String>,
    /// How it was measured, and what is known elsewhere.
    pub(crate) notes: Vec<String>,
    pub(crate) tables: Vec<StudyTable>,
    pub(crate) plots: Vec<StudyPlot>,
    #[serde(default)]
    pub(crate) pictures: Vec<StudyPicture>,
    /// Where times were taken.
    pub(crate) machine: Machine,
}

/// A picture that shows what the numbers say.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct StudyPicture {
    pub(crate) title: String,
    /// Relative to the results file.
    pub(crate) file: String,
}

/// Numbers with names.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct StudyTable {
    pub(crate) title: String,
    pub(crate) columns: Vec<StudyColumn>,
    pub(crate) rows: Vec<StudyRow>,
}

#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct StudyColumn {
    pub(crate) title: String,
    pub(crate) unit: String,
    /// Digits after the point, as the table shows them.
    pub(crate) digits: usize,
}

#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct StudyRow {
    pub(crate) name: String,
    /// One a column; absent where there is none or it is infinite.
    pub(crate) values: Vec<Option<f64>>,
}

/// Lines over a number.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct StudyPlot {
    pub(crate) title: String,
    pub(crate) x: StudyAxis,
    pub(crate) y: StudyAxis,
    pub(crate) lines: Vec<StudyLine>,
}

#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct StudyAxis {
    pub(crate) title: String,
    pub(crate) unit: String,
    pub(crate) is_log: bool,
}

/// Points are finite, and above 0 where the axis is logarithmic.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct StudyLine {
    pub(crate) name: String,
    pub(crate) points: Vec<[f64; 2]>,
}

/// Something that a reader of the figures should know, in words that say what to do.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Advice {
    /// Index into the cases; absent where it is about all.
    pub(crate) case: Option<usize>,
    pub(crate) text: String,
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

/// The commit that the program was built from, as far as can be told: where its file lies in a repository and git is installed, the
/// present one, with "+changes" where files differ from it or the program is older than it.
pub(crate) fn commit() -> Option<String> {
    let program = std::env::current_exe().ok()?;
    let run = |args: &[&str]| {
        let output =
            std::process::Command::new("git").arg("-C").arg(program.parent()?).args(args).output().ok()?;
        output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    let commit = run(&["rev-parse", "--short=12", "HEAD"])?;
    let clean = run(&["status", "--porcelain", ":/"]).is_some_and(|s| s.is_empty());
    let committed = run(&["log", "-1", "--format=%ct"]).and_then(|s| s.parse::<u64>().ok())?;
    let built = std::fs::metadata(&program).ok()?.modified().ok()?;
    let built = built.duration_since(std::time::UNIX_EPOCH).ok()?.as_secs();
    Some(if clean && built >= committed { commit } else { format!("{commit}+changes") })
}
