//! `dapple eval reference`: traced truth alone, as pictures, with the cameras that they were taken by.

use std::path::Path;

use anyhow::{Context, Result};
use dapple_scene::glam::{Mat4, Vec3};
use dapple_scene::{PosedCamera, Projection};
use serde::Serialize;

use super::pair::Starts;
use super::plan::Plan;
use super::results::commit;
use super::run::{command_line, paths, slug};
use super::stage::{Frame, Stage};
use super::truth::Cache;
use super::work::Work;
use crate::args::{PictureFormat, ReferenceArgs};
use crate::exr_file::write_rgb;
use crate::picture::write_file;
use crate::source;

/// `truth.json`.
#[derive(Serialize)]
struct Index {
    command: String,
    dapple_version: &'static str,
    commit: Option<String>,
    cases: Vec<Case>,
}

#[derive(Serialize)]
struct Case {
    name: String,
    scene: String,
    scene_hash: String,
    path: String,
    width: u32,
    height: u32,
    supersample: u32,
    reference_rays: u32,
    radius_m: f32,
    seed: u32,
    frames: Vec<FrameEntry>,
}

#[derive(Serialize)]
struct FrameEntry {
    time_s: f64,
    /// Columns of a 4 × 4 matrix; the camera looks along −z, y is up.
    world_from_view: [f32; 16],
    projection: ProjectionEntry,
    /// Root mean square, over pixels, of what the rays leave to chance.
    noise_rms: f64,
    /// Relative to this file, without ending.
    beauty: String,
    visibility: String,
}

#[derive(Serialize)]
#[serde(rename_all = "snake_case")]
enum ProjectionEntry {
    Perspective { yfov_radians: f32, near_m: f32 },
    Orthographic { half_height_m: f32, near_m: f32, far_m: f32 },
}

pub(super) fn run(args: &ReferenceArgs) -> Result<()> {
    let plan = Plan::new(&args.scenes, &args.options)?;
    let cache = Cache::new(&args.truth_cache.clone().unwrap_or_else(|| args.out.join("truth")));
    let mut work = Work::new();
    let mut cases: Vec<Case> = Vec::new();
    for (number, entry) in plan.entries.iter().enumerate() {
        work.message(&format!("loading {}", entry.name));
        let loaded = source::load(&entry.scene, None)?;
        let radius = source::radius_of(&loaded.scene, entry.settings.radius)?;
        let tracer = Starts::new(&loaded.scene).tracer().clone();
        let stages: Vec<Stage<'_>> = paths(&loaded, &entry.settings.paths)?
            .into_iter()
            .map(|path| Stage::new(&loaded, &entry.settings, path, radius, tracer.clone()))
            .collect();
        let all: f64 = stages.iter().map(Stage::truth_work).sum();
        work.expect(stages.len(), all, plan.entries.len() - number - 1);
        for stage in stages {
            let name = format!("{} / {}", entry.name, stage.path.name);
            let taken = cases.iter().filter(|case| case.name == name).count();
            let folder = if taken == 0 { slug(&name) } else { format!("{}-{}", slug(&name), taken + 1) };
            let size = stage.truth_work();
            work.begin(&name);
            let frames = trace(&stage, &cache, &folder, args, &|part| work.part(size, part))?;
            work.finish(&name, size, true);
            cases.push(Case {
                name,
                scene: loaded.title.clone(),
                scene_hash: loaded.scene.hash().to_string(),
                path: stage.path.name.clone(),
                width: entry.settings.size.width,
                height: entry.settings.size.height,
                supersample: entry.settings.supersample,
                reference_rays: entry.settings.reference_rays,
                radius_m: stage.radius_m,
                seed: entry.settings.seed,
                frames,
            });
        }
    }
    drop(work);
    let pictures: usize = cases.iter().map(|case| case.frames.len()).sum();
    let index =
        Index { command: command_line(), dapple_version: env!("CARGO_PKG_VERSION"), commit: commit(), cases };
    let file = args.out.join("truth.json");
    write_file(&file, &serde_json::to_vec_pretty(&index)?)?;
    say!("{pictures} pictures; {} says of what", file.display());
    Ok(())
}

/// All pictures of one path.
fn trace(
    stage: &Stage<'_>,
    cache: &Cache,
    folder: &str,
    args: &ReferenceArgs,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Vec<FrameEntry>> {
    let count = stage.frame_times_s.len();
    let mut entries = Vec::with_capacity(count);
    for (number, &time_s) in stage.frame_times_s.iter().enumerate() {
        let part = |part: f64| progress((number as f64 + part) / count as f64);
        let frame = stage.frame(number, cache, &part)?;
        let [beauty, visibility] =
            ["beauty", "visibility"].map(|kind| format!("{folder}/{kind}/{number:04}"));
        for format in &args.formats {
            write(&args.out, &frame, *format, [&beauty, &visibility])
                .with_context(|| format!("the picture at {time_s:.3} s"))?;
        }
        let scene = stage.scene();
        let camera = stage.path.camera(scene, &scene.pose_undeformed(time_s));
        entries.push(FrameEntry {
            time_s,
            world_from_view: Mat4::from(camera.world_from_view).to_cols_array(),
            projection: projection(&camera),
            noise_rms: frame.noise_mse.sqrt(),
            beauty,
            visibility,
        });
    }
    Ok(entries)
}

fn write(out: &Path, frame: &Frame, format: PictureFormat, [beauty, visibility]: [&String; 2]) -> Result<()> {
    let truth = &frame.truth;
    match format {
        PictureFormat::Png => {
            truth.write_as(&out.join(format!("{beauty}.png")), &out.join(format!("{visibility}.png")))
        }
        PictureFormat::Exr => {
            let (width, height) = (truth.width, truth.height);
            write_rgb(&out.join(format!("{beauty}.exr")), width, height, truth.radiance())?;
            // Three equal channels: not every reader takes one.
            let gray: Vec<Vec3> = truth.visibility().iter().map(|v| Vec3::splat(*v)).collect();
            write_rgb(&out.join(format!("{visibility}.exr")), width, height, &gray)
        }
    }
}

fn projection(camera: &PosedCamera) -> ProjectionEntry {
    match camera.projection {
        Projection::Perspective { yfov, near } => {
            ProjectionEntry::Perspective { yfov_radians: yfov, near_m: near }
        }
        Projection::Orthographic { half_height, near, far } => {
            ProjectionEntry::Orthographic { half_height_m: half_height, near_m: near, far_m: far }
        }
    }
}
