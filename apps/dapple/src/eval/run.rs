//! The evaluation itself: all servers advance together, each picture is compared while it is in memory.

use std::path::Path;
use std::time::Instant;

use anyhow::{Context, Result};
use dapple_client::{Client, Drawn, PictureParams, Reconstruction, draw};
use dapple_render::psao::{Hat, Kernel};
use dapple_scene::Pose;
use dapple_server::{Progress, Server, ServerConfig};
use dapple_stream::Limits;
use dapple_trace::Tracer;
use dapple_trace::psao::generate::{GenerateParams, generate_points};
use dapple_trace::psao::update::{ConvexVolume, StepInput, UpdateParams};
use dapple_trace::rtao::{RtaoParams, trace_visibility_with_progress};

use super::results::{
    FrameRow, Machine, Params, PooledError, Results, Row, RunInfo, SceneInfo, Steps, commit,
};
use super::settings::Settings;
use crate::args::Method;
use crate::picture::{Compared, Shown, sites};
use crate::progress::Bar;
use crate::source::Loaded;

/// A server at one density and rate, and its client.
struct Pair {
    points_per_m2: f32,
    hz: f64,
    server: Server,
    client: Client,
    ticks: u64,
    delta_bytes: u64,
    snapshot_bytes: u64,
    rays: u64,
    steps: Steps,
    server_seconds: f64,
    apply_seconds: f64,
}

impl Pair {
    /// Ticks up to and including `until_s`; the client takes every frame.
    fn advance(&mut self, until_s: f64, settings: &Settings) -> Result<()> {
        loop {
            let tick_s = (self.ticks + 1) as f64 / self.hz;
            // The sum of many ticks must not lose the last one to rounding.
            if tick_s > until_s + 1e-9 {
                return Ok(());
            }
            self.ticks += 1;
            let interest = self.interest(tick_s, settings);
            let input = StepInput { ray_budget: settings.step.ray_budget, interest: &interest };
            let start = Instant::now();
            let report = self.server.step_with(tick_s, &input)?;
            self.server_seconds += start.elapsed().as_secs_f64();
            self.rays += report.rays;
            self.steps.add(&report.counts);
            let start = Instant::now();
            if let Some(frame) = &report.frame {
                self.delta_bytes += frame.bytes.len() as u64;
                self.client.receive(&frame.bytes).context("the client refused the server's frame")?;
            }
            self.apply_seconds += start.elapsed().as_secs_f64();
        }
    }

    /// What the viewer sees by the next tick, where a budget asks for it.
    fn interest(&self, tick_s: f64, settings: &Settings) -> Vec<ConvexVolume> {
        if settings.step.ray_budget.is_none() {
            return Vec::new();
        }
        let scene = self.server.scene();
        let aspect = settings.size.width as f32 / settings.size.height as f32;
        let frustum = |time_s: f64| {
            let camera = settings.path.camera(scene, &scene.pose_undeformed(time_s));
            ConvexVolume::frustum(&camera, aspect, f32::INFINITY, settings.radius_m)
        };
        vec![frustum(tick_s), frustum(tick_s + 1.0 / self.hz)]
    }
}

/// One line of the table while it grows.
struct Line {
    method: Method,
    pair: Option<usize>,
    file_stem: String,
    visibility_error: PooledError,
    error: PooledError,
    reconstruct_seconds: f64,
    rays: u64,
    frames: Vec<FrameRow>,
}

pub(super) fn evaluate(loaded: &Loaded, settings: &Settings, out: &Path) -> Result<Results> {
    let scene = &loaded.scene;
    let rest_pose = scene.pose(0.0);
    let mut tracer = Tracer::new(scene, &rest_pose);
    let mut pairs = start_servers(loaded, settings, &rest_pose, &tracer)?;
    let mut lines = lines(settings, &pairs);
    let picture_params = PictureParams {
        width: settings.size.width,
        height: settings.size.height,
        supersample: settings.supersample,
        shade: Default::default(),
    };

    let frames = settings.frame_times_s.len();
    let bar = Bar::new("frames", (frames * 100) as u64);
    for (number, &time_s) in settings.frame_times_s.iter().enumerate() {
        bar.message(&format!("frame {} of {frames}: server", number + 1));
        for pair in &mut pairs {
            pair.advance(time_s, settings)?;
        }
        bar.message(&format!("frame {} of {frames}: truth", number + 1));
        let pose = scene.pose(time_s);
        tracer.update(scene, &pose);
        let camera = settings.path.camera(scene, &pose);
        let drawn = draw(scene, &camera, time_s, &picture_params)?;
        let truth_rays = settings.rays_per_sample(settings.reference_rays);
        let traced = |done: u64, of: usize| bar.set((number * 100) as u64 + done * 80 / of.max(1) as u64);
        let truth = trace_samples(loaded, &tracer, &drawn, truth_rays, settings, 0, &traced);
        let truth = Shown::new(&drawn, Some(&truth))?;
        if truth.covered_pixels == 0 {
            tracing::warn!(
                "frame {number} at {time_s:.3} s shows no geometry: its visibility is not compared"
            );
        }
        truth.write(out, &format!("{number:03}-truth"))?;
        for (index, line) in lines.iter_mut().enumerate() {
            bar.message(&format!("frame {} of {frames}: {}", number + 1, line.file_stem));
            line.compare(loaded, settings, &pairs, &tracer, &drawn, &truth, (number, time_s), out)?;
            bar.set((number * 100 + 80 + (index + 1) * 20 / lines_len(settings, &pairs).max(1)) as u64);
        }
    }
    bar.message("server to the end of the path");
    for pair in &mut pairs {
        pair.advance(settings.seconds, settings)?;
    }
    drop(bar);
    let rows = lines.into_iter().map(|line| line.finish(settings, &pairs)).collect();
    Ok(results(loaded, settings, rows))
}

/// Rays at every covered sample; open where there is nothing.
pub(super) fn trace_samples(
    loaded: &Loaded,
    tracer: &Tracer,
    drawn: &Drawn,
    rays: u32,
    settings: &Settings,
    stream: u64,
    progress: &(dyn Fn(u64, usize) + Sync),
) -> Vec<f32> {
    let (indices, sites) = sites(&loaded.scene, drawn);
    let seed = u64::from(settings.seed) << 8 | stream;
    let params = RtaoParams { rays, radius_m: settings.radius_m, seed };
    let mut traced = vec![1.0; sites.len()];
    let count = sites.len();
    trace_visibility_with_progress(tracer, &sites, &params, &mut traced, &|done| progress(done, count));
    let mut visibility = vec![1.0; drawn.gbuffer.samples().len()];
    for (index, value) in indices.into_iter().zip(traced) {
        visibility[index] = value;
    }
    visibility
}

fn start_servers(loaded: &Loaded, settings: &Settings, pose: &Pose, tracer: &Tracer) -> Result<Vec<Pair>> {
    let mut pairs = Vec::new();
    if !settings.methods.iter().any(|m| m.uses_points()) {
        return Ok(pairs);
    }
    let scene = &loaded.scene;
    for &points_per_m2 in &settings.points_per_m2 {
        let generate = GenerateParams {
            points_per_m2: points_per_m2 * settings.density_factor,
            seed: settings.seed,
            ..GenerateParams::default()
        };
        let update = UpdateParams {
            rays: settings.point_rays,
            radius_m: settings.radius_m,
            threshold: settings.threshold,
            rays_still: settings.step.rays_still,
        };
        let config = ServerConfig { generate, update, ..ServerConfig::default() };
        let bar = Bar::new(&format!("points, N = {points_per_m2}"), scene.instances.len() as u64);
        let points = generate_points(scene, pose, tracer, &generate, &|done| bar.set(done as u64))?;
        drop(bar);
        for &hz in &settings.hz {
            let bar =
                Bar::new(&format!("first visibility, N = {points_per_m2}"), points.anchors.len() as u64);
            let progress = |p: Progress| {
                if let Progress::Tracing(done, _) = p {
                    bar.set(done as u64);
                }
            };
            let rays = points.anchors.len() as u64 * u64::from(update.rays);
            let mut server = Server::with_points(
                scene.clone(),
                pose.clone(),
                tracer.clone(),
                points.clone(),
                &config,
                &progress,
            )?;
            let mut client = Client::new(scene.clone(), Limits::default());
            let mut snapshot_bytes = 0;
            if let Some(frame) = server.join()? {
                snapshot_bytes = frame.bytes.len() as u64;
                client.receive(&frame.bytes).context("the client refused the server's snapshot")?;
            }
            pairs.push(Pair {
                points_per_m2,
                hz,
                server,
                client,
                ticks: 0,
                delta_bytes: 0,
                snapshot_bytes,
                rays,
                steps: Steps::default(),
                server_seconds: 0.0,
                apply_seconds: 0.0,
            });
        }
    }
    Ok(pairs)
}

/// Every method in every setting it depends on.
fn lines(settings: &Settings, pairs: &[Pair]) -> Vec<Line> {
    let mut lines = Vec::new();
    for &method in &settings.methods {
        let line = |pair: Option<usize>, file_stem| Line {
            method,
            pair,
            file_stem,
            visibility_error: PooledError::default(),
            error: PooledError::default(),
            reconstruct_seconds: 0.0,
            rays: 0,
            frames: Vec::new(),
        };
        if method.uses_points() {
            for (index, pair) in pairs.iter().enumerate() {
                lines.push(line(Some(index), format!("{method}-{}-{}hz", pair.points_per_m2, pair.hz)));
            }
        } else {
            lines.push(line(None, method.to_string()));
        }
    }
    lines
}

fn lines_len(settings: &Settings, pairs: &[Pair]) -> usize {
    settings.methods.iter().map(|m| if m.uses_points() { pairs.len() } else { 1 }).sum()
}

impl Line {
    #[allow(clippy::too_many_arguments, reason = "one call site that hands over one frame")]
    fn compare(
        &mut self,
        loaded: &Loaded,
        settings: &Settings,
        pairs: &[Pair],
        tracer: &Tracer,
        drawn: &Drawn,
        truth: &Shown,
        (number, time_s): (usize, f64),
        out: &Path,
    ) -> Result<()> {
        let start = Instant::now();
        let visibility = match (self.method, self.pair) {
            (Method::Psao, Some(pair)) => Some(pairs[pair].client.visibility(drawn, &Reconstruction::Atlas)),
            (Method::PsaoMls, Some(pair)) => {
                Some(pairs[pair].client.visibility(drawn, &Kernel::default().into()))
            }
            (Method::PsaoHat { radius }, Some(pair)) => {
                let hat = Hat { radius, ..Hat::default() };
                Some(pairs[pair].client.visibility(drawn, &Kernel::Hat(hat).into()))
            }
            (Method::Rtao { rays }, _) => {
                let rays = settings.rays_per_sample(rays);
                let covered = drawn.gbuffer.samples().iter().filter(|s| s.is_covered()).count() as u64;
                self.rays += covered * u64::from(rays);
                // Other directions than the truth's, or it would be compared with a part of itself.
                Some(trace_samples(loaded, tracer, drawn, rays, settings, 1, &|_, _| ()))
            }
            _ => None,
        };
        self.reconstruct_seconds += start.elapsed().as_secs_f64();
        let shown = Shown::new(drawn, visibility.as_deref())?;
        let files = shown.write(out, &format!("{number:03}-{}", self.file_stem))?;
        let compared = Compared::new(truth, &shown)?;
        let error = compared.write_error(out, &format!("{number:03}-{}", self.file_stem))?;
        if let Some(db) = compared.visibility_psnr_db {
            self.visibility_error.add(db, truth.covered_pixels as f64);
        }
        self.error.add(compared.psnr_db, 1.0);
        self.frames.push(FrameRow {
            time_s,
            visibility_psnr_db: compared.visibility_psnr_db.filter(|db| db.is_finite()),
            psnr_db: Some(compared.psnr_db).filter(|db| db.is_finite()),
            ssim: compared.ssim,
            flip: compared.flip,
            beauty: files.beauty,
            visibility: files.visibility,
            error,
        });
        Ok(())
    }

    fn finish(self, settings: &Settings, pairs: &[Pair]) -> Row {
        let count = self.frames.len().max(1) as f64;
        let mean = |of: fn(&FrameRow) -> f64| self.frames.iter().map(of).sum::<f64>() / count;
        let pair = self.pair.map(|p| &pairs[p]);
        let params = Params {
            points_per_m2: pair.map(|p| p.points_per_m2),
            hz: pair.map(|p| p.hz),
            point_rays: pair.map(|_| settings.point_rays),
            threshold: pair.map(|_| settings.threshold),
            ray_budget: pair.and(settings.step.ray_budget),
            rays_still: pair.map(|_| settings.step.rays_still).filter(|rays| *rays > 0),
            rays_per_pixel: match self.method {
                Method::Rtao { rays } => Some(rays),
                _ => None,
            },
        };
        let per_tick = |seconds: f64, p: &Pair| 1e3 * seconds / p.ticks.max(1) as f64;
        let apply_ms = pair.map_or(0.0, |p| per_tick(p.apply_seconds, p));
        Row {
            method: self.method.to_string(),
            params,
            visibility_psnr_db: self.visibility_error.psnr_db(),
            compared_pixels: self.visibility_error.count() as u64,
            psnr_db: self.error.psnr_db(),
            ssim: mean(|f| f.ssim),
            flip: mean(|f| f.flip),
            kbit_per_s: pair.map(|p| p.delta_bytes as f64 * 8.0 / 1000.0 / settings.seconds),
            snapshot_bytes: pair.map(|p| p.snapshot_bytes),
            cut_bytes: pair.map(|p| p.server.cut_bytes() as u64),
            points: pair.map(|p| p.server.store().layout().len() as u64),
            rays: self.rays + pair.map_or(0, |p| p.rays),
            steps: pair.map(|p| p.steps),
            server_ms: pair.filter(|p| p.ticks > 0).map(|p| per_tick(p.server_seconds, p)),
            client_ms: 1e3 * self.reconstruct_seconds / count + apply_ms,
            frames: self.frames,
        }
    }
}

fn results(loaded: &Loaded, settings: &Settings, rows: Vec<Row>) -> Results {
    let scene = &loaded.scene;
    Results {
        schema: 1,
        scene: SceneInfo {
            name: loaded.title.clone(),
            hash: scene.hash().to_string(),
            triangles: scene.triangle_count() as u64,
            instances: scene.instances.len() as u64,
            warnings: scene.warnings.iter().map(|w| w.message.clone()).collect(),
        },
        run: RunInfo {
            dapple_version: env!("CARGO_PKG_VERSION").to_owned(),
            commit: commit(),
            command: std::env::args().skip(1).fold("dapple".to_owned(), |line, a| line + " " + &a),
            path: settings.path.name.clone(),
            seconds: settings.seconds,
            frame_times_s: settings.frame_times_s.clone(),
            width: settings.size.width,
            height: settings.size.height,
            supersample: settings.supersample,
            reference_rays: settings.reference_rays,
            radius_m: settings.radius_m,
            seed: settings.seed,
        },
        machine: Machine::here(),
        rows,
    }
}
