//! A server at one density and rate, and the client that follows it.

use std::time::Instant;

use anyhow::{Context, Result};
use dapple_scene::{CameraPath, Pose, Scene};
use dapple_server::{Progress, Server, ServerConfig};
use dapple_stream::{Recorder, RecordingHeader};
use dapple_trace::Tracer;
use dapple_trace::psao::generate::{GenerateParams, generate_points};
use dapple_trace::psao::update::{ConvexVolume, StepInput, UpdateParams};
use dapple_trace::slc::TrackerParams;

use super::ends::{AnyClient, AnyServer};
use super::results::Steps;
use super::stage::Stage;
use crate::args::StepArgs;
use crate::light::{microseconds, publish};

/// Servers at their start are kept for other rates and paths while they have no more points than this together.
const MAX_KEPT_POINTS: usize = 6_000_000;

/// What a server at its start depends on, beside the scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Start {
    pub(super) points_per_m2: f32,
    pub(super) update: UpdateParams,
    /// What values may be off, 255ths.
    pub(super) tolerance: u8,
    pub(super) seed: u32,
    pub(super) max_points: Option<u32>,
    /// How far density follows the gradient of visibility.
    pub(super) adaptive: f32,
    /// Whether points say how much of each light they see.
    pub(super) area_lights: bool,
}

impl Start {
    pub(super) fn new(stage: &Stage<'_>, points_per_m2: f32) -> Start {
        let settings = stage.settings;
        Start {
            points_per_m2: points_per_m2 * stage.density_factor,
            update: UpdateParams {
                rays: settings.point_rays,
                radius_m: stage.radius_m,
                rays_still: settings.step.rays_still,
                bent_normals: settings.bent_normals,
            },
            tolerance: settings.threshold,
            seed: settings.seed,
            max_points: settings.step.max_points,
            adaptive: settings.adaptive,
            area_lights: false,
        }
    }

    fn config(&self) -> ServerConfig {
        let generate = GenerateParams {
            points_per_m2: self.points_per_m2,
            seed: self.seed,
            adaptive: self.adaptive,
            radius_m: self.update.radius_m,
            ..GenerateParams::default()
        };
        ServerConfig {
            generate,
            update: self.update,
            publish: publish(self.tolerance),
            max_resident_points: self.max_points,
            lights: self.area_lights.then(TrackerParams::default),
            ..ServerConfig::default()
        }
    }

    /// Whether a server would refuse these settings; quick.
    pub(super) fn check(&self, scene: &Scene) -> Result<()> {
        Ok(self.config().check(scene)?)
    }
}

/// Servers of one scene at time 0, which are the same for every rate and path.
pub(super) struct Starts {
    rest_pose: Pose,
    tracer: Tracer,
    kept: Vec<(Start, Server)>,
}

impl Starts {
    pub(super) fn new(scene: &Scene) -> Starts {
        let rest_pose = scene.pose(0.0);
        let tracer = Tracer::new(scene, &rest_pose);
        Starts { rest_pose, tracer, kept: Vec::new() }
    }

    /// The scene's tracer, at rest.
    pub(super) fn tracer(&self) -> &Tracer {
        &self.tracer
    }

    /// A server at its start; `progress` gets the part that is done.
    pub(super) fn server(
        &mut self,
        stage: &Stage<'_>,
        hz: f64,
        start: &Start,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<Server> {
        if let Some((_, server)) = self.kept.iter().find(|(kept, _)| kept == start) {
            return Ok(server.clone());
        }
        let scene = &stage.loaded.scene;
        let config = start.config();
        let part = |done: usize, of: usize| done as f64 / of.max(1) as f64;
        let start_progress = |p| match p {
            Progress::Laying(done, of) => progress(0.3 * part(done, of)),
            Progress::Tracing(done, of) => progress(0.3 + 0.5 * part(done, of)),
            Progress::Cutting(done, of) => progress(0.8 + 0.2 * part(done, of)),
        };
        if start.max_points.is_some() {
            // What is there at the start depends on where the path looks.
            let seen = seen(0.0, hz, stage);
            let input = StepInput { interest: &seen, ..StepInput::default() };
            let server = Server::watched(scene.clone(), &config, &input, &start_progress)?;
            if !server.too_large().is_empty() {
                tracing::warn!(
                    "--max-points: {} instances alone have more points and stay open",
                    server.too_large().len()
                );
            }
            return Ok(server);
        }
        let instances = scene.instances.len();
        let laid = |done| progress(0.3 * part(done, instances));
        let points = generate_points(scene, &self.rest_pose, &self.tracer, &config.generate, &laid)?;
        let server = Server::with_points(
            scene.clone(),
            self.rest_pose.clone(),
            self.tracer.clone(),
            points,
            &config,
            &start_progress,
        )?;
        let points = |server: &Server| server.store().layout().len();
        while !self.kept.is_empty()
            && self.kept.iter().map(|(_, s)| points(s)).sum::<usize>() + points(&server) > MAX_KEPT_POINTS
        {
            self.kept.remove(0);
        }
        if points(&server) <= MAX_KEPT_POINTS {
            self.kept.push((*start, server.clone()));
        }
        Ok(server)
    }
}

/// A server, its client, and what was counted between them.
pub(super) struct Pair {
    pub(super) client: AnyClient,
    /// Absent for a method that has none.
    pub(super) points_per_m2: Option<f32>,
    pub(super) hz: f64,
    /// At the start.
    pub(super) points: u64,
    pub(super) snapshot_bytes: u64,
    /// Bytes of each step's update.
    pub(super) step_bytes: Vec<u32>,
    pub(super) rays: u64,
    pub(super) steps: Steps,
    pub(super) server_seconds: f64,
    pub(super) apply_seconds: f64,
    server: AnyServer,
    step: StepArgs,
    /// When the next frame that is not counted would go out, seconds; after all that are.
    clock_s: f64,
    recording: Option<Recording>,
}

/// What an uncounted step did.
pub(super) struct StepAt {
    /// Whether the client's light changed.
    pub(super) changed: bool,
    /// Points left to later steps, for want of rays or bits.
    pub(super) backlog: u32,
}

/// What is kept of the stream.
struct Recording {
    recorder: Recorder,
    bytes: Vec<u8>,
    duration_us: u64,
}

impl Pair {
    /// A client joins the server at its start. `record` is the name of a recording to make.
    pub(super) fn new(
        mut server: AnyServer,
        (points_per_m2, hz): (Option<f32>, f64),
        stage: &Stage<'_>,
        record: Option<&str>,
    ) -> Result<Pair> {
        let mut client = AnyClient::of(&server)?;
        let snapshot = server.join(stage)?;
        client.receive(&snapshot).context("the client refused the server's snapshot")?;
        let mut recording = None;
        if let Some(name) = record {
            let duration_us = microseconds(stage.seconds);
            let scene_hash = server.scene().hash().0;
            let header = RecordingHeader { scene_hash, name: name.to_owned(), duration_us };
            let (mut recorder, mut bytes) = Recorder::new(&header).context("--record")?;
            bytes.extend(recorder.frame(0, &snapshot.bytes)?);
            recording = Some(Recording { recorder, bytes, duration_us });
        }
        let points = server.points();
        let rays = points * u64::from(stage.settings.point_rays) + server.first_light_rays();
        Ok(Pair {
            client,
            points_per_m2,
            hz,
            points,
            snapshot_bytes: snapshot.bytes.len() as u64,
            step_bytes: Vec::new(),
            rays,
            steps: Steps::default(),
            server_seconds: 0.0,
            apply_seconds: 0.0,
            server,
            step: stage.settings.step,
            clock_s: 0.0,
            recording,
        })
    }

    /// Steps up to and including `until_s`; the client takes every frame. Whether its light changed.
    pub(super) fn advance(&mut self, until_s: f64, stage: &Stage<'_>) -> Result<bool> {
        let mut changed = false;
        loop {
            let tick_s = (self.step_bytes.len() + 1) as f64 / self.hz;
            // The sum of many ticks must not lose the last one to rounding.
            if tick_s > until_s + 1e-9 {
                return Ok(changed);
            }
            let start = Instant::now();
            let seen = self.seen(tick_s, stage);
            let input = self.input(&seen);
            let report = self.server.step((tick_s, tick_s), &input, stage)?;
            self.clock_s = tick_s;
            self.server_seconds += start.elapsed().as_secs_f64();
            self.rays += report.rays;
            self.steps.add(&report.counts);
            if let (Some(_), Some([points, spawned, evicted])) = (self.step.max_points, report.sets) {
                self.steps.add_sets(points, spawned, evicted);
            }
            let start = Instant::now();
            let mut bytes = 0;
            if let Some(packet) = &report.packet {
                bytes = packet.bytes.len() as u32;
                changed = true;
                self.client.receive(packet).context("the client refused the server's frame")?;
            }
            self.apply_seconds += start.elapsed().as_secs_f64();
            if let (Some(recording), Some(packet)) = (&mut self.recording, &report.packet) {
                let time_us = microseconds(tick_s).min(recording.duration_us);
                recording.bytes.extend(recording.recorder.frame(time_us, &packet.bytes)?);
            }
            self.step_bytes.push(bytes);
        }
    }

    /// Steps once with the scene at `time_s`, uncounted.
    pub(super) fn step_at(&mut self, time_s: f64, stage: &Stage<'_>) -> Result<StepAt> {
        let seen = self.seen(time_s, stage);
        let input = self.input(&seen);
        self.clock_s += 1.0 / self.hz;
        let report = self.server.step((time_s, self.clock_s), &input, stage)?;
        if let Some(packet) = &report.packet {
            self.client.receive(packet).context("the client refused the server's frame")?;
        }
        Ok(StepAt { changed: report.packet.is_some(), backlog: report.counts.backlog.max(report.held_back) })
    }

    /// What the viewer sees by the next tick, where a budget or a cap asks for it.
    fn seen(&self, tick_s: f64, stage: &Stage<'_>) -> Vec<ConvexVolume> {
        let StepArgs { ray_budget, budget, max_points, .. } = self.step;
        match ray_budget.is_some() || budget.is_some() || max_points.is_some() {
            true => seen(tick_s, self.hz, stage),
            false => Vec::new(),
        }
    }

    fn input<'a>(&self, seen: &'a [ConvexVolume]) -> StepInput<'a> {
        StepInput { ray_budget: self.step.ray_budget, interest: seen }
    }

    pub(super) fn cut_bytes(&self) -> u64 {
        self.server.cut_bytes()
    }

    /// The whole recording, if one was made.
    pub(super) fn take_recording(&mut self) -> Option<Vec<u8>> {
        let Recording { recorder, mut bytes, .. } = self.recording.take()?;
        bytes.extend(recorder.finish());
        Some(bytes)
    }
}

/// What the viewer sees by the next tick.
fn seen(tick_s: f64, hz: f64, stage: &Stage<'_>) -> Vec<ConvexVolume> {
    let scene = stage.scene();
    let path: &CameraPath = &stage.path;
    let size = stage.settings.size;
    let aspect = size.width as f32 / size.height as f32;
    let frustum = |time_s: f64| {
        let camera = path.camera(scene, &scene.pose_undeformed(time_s));
        ConvexVolume::frustum(&camera, aspect, f32::INFINITY, stage.radius_m)
    };
    vec![frustum(tick_s), frustum(tick_s + 1.0 / hz)]
}
