//! One setting of one case, from its start to its rows: the unit that a stopped run continues with.

use std::time::Instant;

use anyhow::Result;
use dapple_client::Drawn;
use dapple_metrics::Flicker;
use dapple_render::compose::resolve_plane;
use dapple_scene::glam::Vec3;
use dapple_trace::direct::DirectParams;
use dapple_trace::rtao::{RtaoParams, trace_visibility};
use serde::{Deserialize, Serialize};

use super::ends::AnyServer;
use super::figures::{FrameError, jackknife, mean, mean_of_all, pooled_psnr, root_mean_square};
use super::pair::{Pair, Start, Starts};
use super::plan::CLIENT_HZ;
use super::results::{Figure, FrameRow, Machine, Params, Row, Settling, Times, Truth};
use super::settle::settle;
use super::stage::{Frame, Stage};
use super::truth::Cache;
use crate::args::Method;
use crate::judge::Judge;
use crate::picture::{Compared, Shown, sites};

/// What is run together.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Job {
    /// One server, looked up in several ways: all of the paper's scheme, or none.
    Points { points_per_m2: f32, hz: f64, methods: Vec<Method> },
    /// A method with a server of its own.
    Served { method: Method, hz: f64 },
    /// A method without a server.
    Alone(Method),
}

/// What a job gave.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Outcome {
    pub(super) rows: Vec<Row>,
    /// Hash of the recording, if one was made.
    pub(super) recording: Option<String>,
}

impl Outcome {
    /// Every file that the rows name.
    pub(super) fn files(&self) -> Vec<String> {
        let frames = self.rows.iter().flat_map(|row| &row.frames);
        frames.flat_map(|f| [&f.beauty, &f.visibility, &f.error, &f.flip_map]).cloned().collect()
    }
}

/// Where a job's pictures go, and how they are judged.
pub(super) struct Desk<'a> {
    pub(super) out: &'a std::path::Path,
    /// Relative to `out`.
    pub(super) folder: String,
    pub(super) judge: &'a Judge,
    pub(super) cache: &'a Cache,
    pub(super) truth: &'a Truth,
    /// Name of the recording to make.
    pub(super) record: Option<&'a str>,
}

/// All jobs of a case, those with points first, as the methods ask for them.
pub(super) fn jobs(stage: &Stage<'_>) -> Vec<Job> {
    let settings = stage.settings;
    let (with_points, alone): (Vec<Method>, Vec<Method>) =
        settings.methods.iter().partition(|m| m.uses_points());
    let mut jobs = Vec::new();
    if !with_points.is_empty() {
        for &points_per_m2 in &settings.points_per_m2 {
            for &hz in &settings.hz {
                let (paper, own): (Vec<Method>, Vec<Method>) = with_points.iter().partition(|m| m.is_paper());
                // Lights are bits that the others are not to be charged for.
                let (lit, own): (Vec<Method>, Vec<Method>) = own.into_iter().partition(|m| *m == Method::Slc);
                for methods in [own, lit, paper].into_iter().filter(|methods| !methods.is_empty()) {
                    jobs.push(Job::Points { points_per_m2, hz, methods });
                }
            }
        }
    }
    for method in alone {
        match method {
            Method::Sas { .. } => {
                jobs.extend(settings.hz.iter().map(|&hz| Job::Served { method, hz }));
            }
            _ => jobs.push(Job::Alone(method)),
        }
    }
    jobs
}

impl Job {
    /// A few words, also for file names.
    pub(super) fn name(&self) -> String {
        match self {
            Job::Points { points_per_m2, hz, .. } => {
                let scheme = match (self.is_paper(), self.is_lit()) {
                    (true, _) => "paper",
                    (_, true) => "lights",
                    _ => "points",
                };
                format!("{scheme}-{points_per_m2}-{hz}hz")
            }
            Job::Served { method, hz } => format!("{method}-{hz}hz"),
            Job::Alone(method) => method.to_string(),
        }
    }

    /// Whether its ends are the paper's.
    fn is_paper(&self) -> bool {
        self.methods().iter().any(|m| m.is_paper())
    }

    /// Whether its points know of lights.
    fn is_lit(&self) -> bool {
        self.methods().contains(&Method::Slc)
    }

    /// Whether what its server sends can be kept in a recording.
    pub(super) fn can_be_recorded(&self) -> bool {
        matches!(self, Job::Points { .. }) && !self.is_paper()
    }

    fn methods(&self) -> Vec<Method> {
        match self {
            Job::Points { methods, .. } => methods.clone(),
            Job::Served { method, .. } | Job::Alone(method) => vec![*method],
        }
    }

    /// About how much work it is, in rays: tracing and metrics.
    pub(super) fn work(&self, stage: &Stage<'_>) -> f64 {
        let pictures = stage.frame_times_s.len() as f64 * stage.samples() as f64;
        match self {
            // Laying and first rays go by the surface, which is not known; a picture's worth of points is a fair guess.
            Job::Points { methods, points_per_m2, .. } => {
                pictures * 40.0 * methods.len() as f64 + 4e4 * f64::from(*points_per_m2)
            }
            Job::Alone(Method::Rtao { rays }) => {
                pictures * (40.0 + 2.0 * f64::from(stage.settings.rays_per_sample(*rays)))
            }
            // A picture's worth of texels, of which some change in each step.
            Job::Served { hz, .. } => {
                let texels = stage.samples() as f64 * f64::from(stage.settings.point_rays);
                pictures * 40.0 + texels * (1.0 + 0.05 * hz * stage.seconds)
            }
            Job::Alone(_) => pictures * 40.0,
        }
    }

    /// Runs it. `progress` gets the part that is done; the recording is returned with the rows.
    pub(super) fn run(
        &self,
        stage: &Stage<'_>,
        starts: &mut Starts,
        desk: &Desk<'_>,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<(Outcome, Option<Vec<u8>>)> {
        let mut pair = match self {
            Job::Points { points_per_m2, hz, .. } => {
                let start = Start { area_lights: self.is_lit(), ..Start::new(stage, *points_per_m2) };
                let server = starts.server(stage, *hz, &start, &|part| progress(0.3 * part))?;
                let server = AnyServer::new(
                    server,
                    self.is_paper(),
                    stage.settings.threshold,
                    stage.settings.step.budget.map(|budget| budget.0),
                )?;
                let pair = Pair::new(server, (Some(*points_per_m2), *hz), stage, desk.record)?;
                if self.methods().iter().any(|m| matches!(m, Method::Psao | Method::Slc)) {
                    // Made once a session, so not what a picture costs.
                    pair.client.make_atlas();
                }
                Some(pair)
            }
            Job::Served { method, hz } => {
                let server = AnyServer::served(stage, *method, *hz, starts.tracer())?;
                Some(Pair::new(server, (None, *hz), stage, None)?)
            }
            Job::Alone(_) => None,
        };
        let began = if pair.is_some() { 0.3 } else { 0.0 };
        let mut lines: Vec<Line> = self.methods().into_iter().map(Line::new).collect();
        let count = stage.frame_times_s.len();
        for number in 0..count {
            let frame = stage.frame(number, desk.cache, &|_| ())?;
            if let Some(pair) = &mut pair {
                pair.advance(frame.time_s, stage)?;
            }
            for line in &mut lines {
                line.compare(stage, pair.as_ref(), &frame, number, desk)?;
            }
            for &watched_s in &frame.watched_s {
                let changed = match &mut pair {
                    Some(pair) => pair.advance(watched_s, stage)?,
                    None => true,
                };
                for line in &mut lines {
                    line.see_flicker(stage, pair.as_ref(), &frame, watched_s, changed)?;
                }
                if pair.is_none() {
                    // Its pictures do not depend on each other, so that one change is like all others.
                    break;
                }
            }
            progress(began + (1.0 - began) * (number + 1) as f64 / count as f64);
        }
        let mut settlings: Vec<Option<Settling>> = vec![None; lines.len()];
        let mut recording = None;
        if let Some(pair) = &mut pair {
            pair.advance(stage.seconds, stage)?;
            recording = pair.take_recording();
            settlings = settle(stage, pair, &self.methods(), desk.cache)?.into_iter().map(Some).collect();
        }
        let rows = lines.into_iter().zip(settlings);
        let rows =
            rows.map(|(line, settling)| line.finish(stage, pair.as_ref(), settling, desk.truth)).collect();
        let hash = recording.as_ref().map(|bytes| blake3::hash(bytes).to_hex().to_string());
        Ok((Outcome { rows, recording: hash }, recording))
    }
}

/// One row while it grows.
struct Line {
    method: Method,
    reconstruct_seconds: f64,
    looks: u32,
    /// Of the pictures that were compared.
    rays: u64,
    rays_of_look: u64,
    /// Visibility of the latest picture's pixels, as last seen, and how it flickered.
    visibility: Vec<f32>,
    flicker: Flicker,
    frames: Vec<FrameRow>,
}

impl Line {
    fn new(method: Method) -> Line {
        Line {
            method,
            reconstruct_seconds: 0.0,
            looks: 0,
            rays: 0,
            rays_of_look: 0,
            visibility: Vec::new(),
            flicker: Flicker::new(),
            frames: Vec::new(),
        }
    }

    /// One visibility a sample of what is drawn, at time `now_s`; all open for `None`.
    fn look(
        &mut self,
        stage: &Stage<'_>,
        pair: Option<&Pair>,
        drawn: &Drawn,
        now_s: f64,
    ) -> Result<Option<Vec<f32>>> {
        let start = Instant::now();
        let mut own_time = None;
        let visibility = match (self.method, pair) {
            (method, Some(pair)) => Some(pair.client.visibility(drawn, method)?),
            (Method::Rtao { rays }, _) => {
                let rays = stage.settings.rays_per_sample(rays);
                let (indices, sites) = sites(stage.scene(), drawn);
                self.rays_of_look = sites.len() as u64 * u64::from(rays);
                // Other directions than the truth's, or it would be compared with a part of itself; and others in each frame.
                let number = (now_s * CLIENT_HZ).round() as u64;
                let seed = number << 40 | u64::from(stage.settings.seed) << 8 | 1;
                let params = RtaoParams { rays, radius_m: stage.radius_m, seed };
                let mut traced = vec![1.0; sites.len()];
                trace_visibility(&stage.tracer_at(drawn), &sites, &params, &mut traced);
                let mut visibility = vec![1.0; drawn.gbuffer.samples().len()];
                for (index, value) in indices.into_iter().zip(traced) {
                    visibility[index] = value;
                }
                Some(visibility)
            }
            (Method::Screen(method), _) => {
                let camera = stage.camera_at(drawn);
                let sight = stage.sight(stage.scene(), &drawn.pose, &camera, &drawn.gbuffer);
                let estimate = method.estimate(&sight, stage.settings.effort)?;
                own_time = Some(estimate.time);
                Some(estimate.visibility)
            }
            _ => None,
        };
        self.reconstruct_seconds += own_time.unwrap_or_else(|| start.elapsed()).as_secs_f64();
        self.looks += 1;
        Ok(visibility)
    }

    /// What each sample reflects of area lights, where pictures have that: by what the points see, by rays, or with nothing in the way.
    fn area_light(&mut self, stage: &Stage<'_>, pair: Option<&Pair>, frame: &Frame) -> Option<Vec<Vec3>> {
        let open = frame.open_light.as_ref()?;
        let start = Instant::now();
        let reflected = match (self.method, pair) {
            (Method::Slc, Some(pair)) => pair.client.area_light(&frame.drawn, stage)?,
            (Method::Rtao { rays }, _) => {
                // Other places than the truth's.
                let params = DirectParams {
                    samples: stage.settings.rays_per_sample(rays),
                    seed: ((frame.time_s * CLIENT_HZ).round() as u64) << 40
                        | u64::from(stage.settings.seed) << 8
                        | 1,
                    ..DirectParams::default()
                };
                let (reflected, counts) = stage.traced_light(&frame.drawn, &params);
                self.rays += counts;
                reflected
            }
            _ => return Some(open.clone()),
        };
        self.reconstruct_seconds += start.elapsed().as_secs_f64();
        Some(reflected)
    }

    fn compare(
        &mut self,
        stage: &Stage<'_>,
        pair: Option<&Pair>,
        frame: &Frame,
        number: usize,
        desk: &Desk<'_>,
    ) -> Result<()> {
        let visibility = self.look(stage, pair, &frame.drawn, frame.time_s)?;
        self.rays += self.rays_of_look;
        let ambient = match (self.method, pair, &visibility) {
            (Method::Psao | Method::Slc, Some(pair), Some(visibility)) => {
                let start = Instant::now();
                let ambient = pair.client.ambient(&frame.drawn, stage, visibility);
                self.reconstruct_seconds += start.elapsed().as_secs_f64();
                ambient
            }
            _ => None,
        };
        let reflected = self.area_light(stage, pair, frame);
        let shown =
            Shown::lit(&frame.drawn, ambient.as_deref(), reflected.as_deref(), visibility.as_deref())?;
        let touched = |pixel: usize| frame.still.touched[pixel];
        let compared = Compared::new(&frame.truth, &shown, desk.judge, stage.settings.hdr_flip, touched)?;
        let stem = format!("{}/{number:03}-{}", desk.folder, self.method);
        let files = shown.write(desk.out, &stem)?;
        let maps = compared.write(desk.out, &stem)?;
        self.frames.push(FrameRow {
            time_s: frame.time_s,
            visibility_psnr_db: compared.visibility_psnr_db.filter(|db| db.is_finite()),
            moving_psnr_db: compared.some_psnr_db.filter(|db| db.is_finite()),
            moving_pixels: compared.some_pixels as u64,
            psnr_db: Some(compared.psnr_db).filter(|db| db.is_finite()),
            ssim: compared.ssim,
            flip: compared.flip,
            hdr_flip: compared.hdr_flip,
            lpips: compared.lpips,
            flicker: None,
            beauty: files.beauty,
            visibility: files.visibility,
            error: maps.error,
            flip_map: maps.flip,
        });
        self.visibility = shown.into_visibility();
        self.flicker = Flicker::new();
        Ok(())
    }

    /// Compares what still places show now with what they showed a client frame before.
    fn see_flicker(
        &mut self,
        stage: &Stage<'_>,
        pair: Option<&Pair>,
        frame: &Frame,
        now_s: f64,
        changed: bool,
    ) -> Result<()> {
        let (drawn, before) = (&frame.drawn, std::mem::take(&mut self.visibility));
        let samples = if changed { self.look(stage, pair, drawn, now_s)? } else { None };
        let now = match samples {
            Some(samples) => resolve_plane(&drawn.gbuffer, &samples, 1.0)?.values.values,
            None => before.clone(),
        };
        let (width, height) = (drawn.gbuffer.width, drawn.gbuffer.height);
        self.flicker.add(width, height, &before, &now, &frame.still.places)?;
        self.visibility = now;
        if let Some(last) = self.frames.last_mut() {
            last.flicker = self.flicker.rms().map(|rms| 255.0 * rms);
        }
        Ok(())
    }

    fn finish(
        self,
        stage: &Stage<'_>,
        pair: Option<&Pair>,
        settling: Option<Settling>,
        truth: &Truth,
    ) -> Row {
        let settings = stage.settings;
        let covered: Vec<f64> = truth.frames.iter().map(|f| f.covered_pixels as f64).collect();
        let of = |value: fn(&FrameRow) -> f64| mean(&self.frames.iter().map(value).collect::<Vec<f64>>());
        let optional =
            |value: fn(&FrameRow) -> Option<f64>| self.frames.iter().map(value).collect::<Vec<_>>();
        let visibility: Vec<FrameError> = self
            .frames
            .iter()
            .zip(&covered)
            .map(|(f, &weight)| FrameError::new(f.visibility_psnr_db, weight))
            .collect();
        let moving = |f: &FrameRow| FrameError::new(f.moving_psnr_db, f.moving_pixels as f64);
        let moving: Vec<FrameError> = self.frames.iter().map(moving).collect();
        let picture: Vec<FrameError> = self.frames.iter().map(|f| FrameError::new(f.psnr_db, 1.0)).collect();
        // Absent for a method without points.
        let points_per_m2 = pair.and_then(|p| p.points_per_m2);
        let of_points = points_per_m2.map(|_| settings);
        let effort = matches!(self.method, Method::Screen(_)).then_some(settings.effort);
        let params = Params {
            points_per_m2,
            hz: pair.map(|p| p.hz),
            point_rays: pair.map(|_| settings.point_rays),
            threshold: of_points.map(|s| s.threshold),
            adaptive: of_points.map(|s| s.adaptive).filter(|adaptive| *adaptive > 0.0),
            bent_normals: of_points
                .filter(|_| matches!(self.method, Method::Psao | Method::Slc))
                .map(|s| s.bent_normals)
                .filter(|b| *b),
            gather_ambient: Some(settings.gather_ambient).filter(|gathers| *gathers),
            ray_budget: of_points.and_then(|s| s.step.ray_budget),
            rays_still: of_points.map(|s| s.step.rays_still).filter(|rays| *rays > 0),
            budget_kbit_per_s: of_points
                .filter(|_| !self.method.is_paper())
                .and_then(|s| s.step.budget)
                .map(|budget| budget.0 as f64 / 1e3),
            max_points: of_points.and_then(|s| s.step.max_points),
            ao_preset: effort.map(|e| e.preset.name().to_owned()),
            half_resolution: effort.and_then(|e| e.half_resolution),
            guard_band: effort.map(|e| e.guard_band),
            rays_per_pixel: match self.method {
                Method::Rtao { rays } => Some(rays),
                _ => None,
            },
        };
        let per_step = |seconds: f64, p: &Pair| 1e3 * seconds / p.step_bytes.len().max(1) as f64;
        let apply_ms = pair.map_or(0.0, |p| per_step(p.apply_seconds, p));
        Row {
            method: self.method.to_string(),
            params,
            compared_pixels: covered.iter().sum::<f64>() as u64,
            visibility_psnr_db: pooled_psnr(&visibility),
            moving_psnr_db: pooled_psnr(&moving),
            psnr_db: pooled_psnr(&picture),
            ssim: of(|f| f.ssim),
            flip: of(|f| f.flip),
            hdr_flip: mean_of_all(&optional(|f| f.hdr_flip)),
            lpips: mean_of_all(&optional(|f| f.lpips)),
            flicker: root_mean_square(&optional(|f| f.flicker)),
            kbit_per_s: pair.map(|p| kbit_per_s(&p.step_bytes, p.hz, stage.seconds)),
            snapshot_bytes: pair.map(|p| p.snapshot_bytes),
            cut_bytes: pair.map(Pair::cut_bytes),
            points: pair.map(|p| p.points),
            rays: self.rays + pair.map_or(0, |p| p.rays),
            steps: pair.map(|p| p.steps),
            step_bytes: pair.map(|p| p.step_bytes.clone()).unwrap_or_default(),
            settling,
            frames: self.frames,
            times: Times {
                machine: Machine::here(),
                server_ms: pair.filter(|p| !p.step_bytes.is_empty()).map(|p| per_step(p.server_seconds, p)),
                client_ms: 1e3 * self.reconstruct_seconds / f64::from(self.looks.max(1)) + apply_ms,
            },
        }
    }
}

/// Bits of all updates by the length of the path; the interval is that of its seconds.
fn kbit_per_s(step_bytes: &[u32], hz: f64, seconds: f64) -> Figure {
    let kbit = |bytes: f64, seconds: f64| bytes * 8e-3 / seconds;
    let total: f64 = step_bytes.iter().map(|b| f64::from(*b)).sum();
    // Whole seconds of the path, each one observation.
    let mut buckets = vec![0.0; seconds.floor() as usize];
    for (step, bytes) in step_bytes.iter().enumerate() {
        // A step at the very end of a second closes it.
        let second = (((step + 1) as f64 / hz - 1e-9).max(0.0)) as usize;
        if let Some(bucket) = buckets.get_mut(second) {
            *bucket += f64::from(*bytes);
        }
    }
    let spread = jackknife(buckets.len(), |left_out| {
        let kept = buckets.iter().enumerate().filter(|(i, _)| Some(*i) != left_out).map(|(_, b)| *b);
        let (sum, count) = kept.fold((0.0, 0.0), |(s, c), b| (s + b, c + 1.0));
        (count > 0.0).then(|| kbit(sum, count))
    });
    Figure { value: Some(kbit(total, seconds)), ci95: spread.ci95 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_counted_over_the_whole_path() {
        // Three seconds and a half at 2 Hz.
        let steps = [100, 0, 300, 0, 200, 0, 50];
        let figure = kbit_per_s(&steps, 2.0, 3.5);
        assert!((figure.value.unwrap() - 650.0 * 8e-3 / 3.5).abs() < 1e-12);
        // Seconds of 100, 300, 200 bytes: the usual interval of a mean of three.
        let expected = 4.303 * (100.0 * 100.0 / 3.0f64).sqrt() * 8e-3;
        assert!((figure.ci95.unwrap() - expected).abs() < 1e-9, "{figure:?}");
        assert_eq!(kbit_per_s(&[100], 15.0, 0.5).ci95, None);
    }
}
