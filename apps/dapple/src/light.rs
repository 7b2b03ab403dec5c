//! The server's settings from the command line, and the recording of what it sends.

use anyhow::{Context, Result, bail};
use dapple_render::area_lights::MAX_AREA_LIGHTS;
use dapple_scene::Scene;
use dapple_scene::area_lights::AreaLights;
use dapple_server::{BENT_PRECISION, Progress, Server, ServerConfig};
use dapple_stream::{Precision, PublisherConfig, Recorder, RecordingHeader};
use dapple_trace::psao::generate::GenerateParams;
use dapple_trace::psao::update::{StepInput, UpdateParams};
use dapple_trace::slc::TrackerParams;

use crate::args::{LightArgs, VisibilityArgs};
use crate::direct_light::warn_of_lights;
use crate::progress::Bar;
use crate::source::{self, Loaded};

/// Longest recording, seconds.
const MAX_SECONDS: f64 = 86_400.0;

/// Seconds shown of a scene without animation.
const STILL_SECONDS: f64 = 10.0;

/// What a server is to do.
pub(crate) fn server_config(scene: &Scene, args: &LightArgs) -> Result<ServerConfig> {
    let LightArgs { visibility, step, .. } = args;
    let (points, hz) = (args.points_per_m2(), args.hz());
    if !(points.is_finite() && points > 0.0) {
        bail!("--points is {points}, must be above 0");
    }
    if !(hz.is_finite() && hz > 0.0 && hz <= 1000.0) {
        bail!("--hz is {hz}, must be above 0 to 1000");
    }
    let (radius_m, density_factor) = source::resolve_radius(scene, visibility)?;
    Ok(ServerConfig {
        generate: GenerateParams {
            points_per_m2: points * density_factor,
            seed: visibility.seed,
            adaptive: adaptive(visibility)?,
            radius_m,
            ..GenerateParams::default()
        },
        update: UpdateParams {
            rays: visibility.point_rays,
            rays_still: step.rays_still,
            radius_m,
            bent_normals: visibility.bent_normals,
        },
        publish: publish(visibility.threshold),
        bits_per_s: args.bits_per_s(),
        max_resident_points: step.max_points,
        lights: area_lights(scene, args.area_lights),
        ..ServerConfig::default()
    })
}

/// How visibility of area lights is kept, if that is wanted; says so where there are none.
fn area_lights(scene: &Scene, wanted: Option<Option<f32>>) -> Option<TrackerParams> {
    let defaults = TrackerParams::default();
    let tolerance = wanted?.unwrap_or(defaults.tolerance);
    let lights = AreaLights::new(scene, &scene.pose(0.0));
    if lights.is_empty() {
        tracing::warn!(
            "--area-lights: nothing in this scene emits, so there are none: give a material an emissive factor, or leave it out"
        );
    }
    warn_of_lights(&lights);
    warn_of_many(&lights);
    Some(TrackerParams { tolerance, ..defaults })
}

/// Tells of more lights than viewers are told of.
pub(crate) fn warn_of_many(lights: &AreaLights<'_>) {
    if lights.len() > MAX_AREA_LIGHTS {
        tracing::warn!("of {} area lights viewers show the {MAX_AREA_LIGHTS} most powerful", lights.len());
    }
}

/// How far density follows the gradient of visibility.
pub(crate) fn adaptive(args: &VisibilityArgs) -> Result<f32> {
    if !(0.0..=1.0).contains(&args.adaptive) {
        bail!("--adaptive is {}, must be 0 to 1", args.adaptive);
    }
    Ok(args.adaptive)
}

/// How exactly changes are sent: values of visibility may be off by the threshold.
pub(crate) fn publish(threshold: u8) -> PublisherConfig {
    let precision = Precision { tolerance: threshold, ..Precision::default() };
    PublisherConfig { precision, bent_precision: BENT_PRECISION, ..PublisherConfig::default() }
}

/// Seconds after which the scene repeats: those of its animation, or ten of a still scene.
pub(crate) fn scene_seconds(scene: &Scene) -> f64 {
    let animation = scene.active_animation.and_then(|i| scene.animations.get(i as usize));
    let seconds = animation.map_or(0.0, |animation| f64::from(animation.duration()));
    if seconds > 0.0 { seconds } else { STILL_SECONDS }
}

/// Seconds of scene time in the units of recordings.
pub(crate) fn microseconds(seconds: f64) -> u64 {
    (seconds * 1e6).round() as u64 // saturates
}

/// What is to be recorded.
pub(crate) struct Take<'a> {
    pub(crate) loaded: &'a Loaded,
    pub(crate) light: &'a LightArgs,
    pub(crate) seconds: Option<f64>,
    pub(crate) snapshot_every_s: f64,
    pub(crate) name: String,
}

/// A finished recording and its figures.
pub(crate) struct Taken {
    pub(crate) bytes: Vec<u8>,
    pub(crate) seconds: f64,
    pub(crate) points: usize,
    pub(crate) updates: usize,
    pub(crate) frame_bytes: u64,
}

/// Lights the scene along its animation and records what subscribers would receive.
pub(crate) fn record(take: &Take<'_>) -> Result<Taken> {
    let scene = &take.loaded.scene;
    let seconds = take.seconds.unwrap_or_else(|| scene_seconds(scene));
    if !(seconds > 0.0 && seconds <= MAX_SECONDS) {
        bail!("--seconds is {seconds}, must be above 0 to {MAX_SECONDS}");
    }
    if !(take.snapshot_every_s > 0.0 && take.snapshot_every_s.is_finite()) {
        bail!("--snapshot-every is {}, must be above 0", take.snapshot_every_s);
    }
    let hz = take.light.hz();
    let mut config = server_config(scene, take.light)?;
    // A group of D deltas is closed by a snapshot, so D + 1 updates lie between snapshots.
    let deltas = (take.snapshot_every_s * hz).ceil() - 1.0;
    config.publish = PublisherConfig { deltas_per_group: deltas.max(1.0) as u32, ..config.publish };
    let header = RecordingHeader {
        scene_hash: scene.hash().0,
        name: take.name.clone(),
        duration_us: microseconds(seconds),
    };
    let (mut recorder, mut bytes) = Recorder::new(&header).context("--name")?;

    let input = StepInput { ray_budget: take.light.step.ray_budget, ..StepInput::default() };
    let ticks = (seconds * hz + 1e-9).floor() as u64;
    let bar = Bar::new("points", 1000);
    let mut server = Server::new(scene.clone(), &config, &|progress| match progress {
        Progress::Laying(done, of) => bar.set((done * 400 / of.max(1)) as u64),
        Progress::Tracing(done, of) => bar.set((400 + done * 500 / of.max(1)) as u64),
        Progress::Cutting(done, of) => bar.set((900 + done * 100 / of.max(1)) as u64),
    })?;
    drop(bar);
    let mut frame_bytes = 0;
    let mut updates = 0;
    if let Some(frame) = server.join()? {
        frame_bytes += frame.bytes.len() as u64;
        bytes.extend(recorder.frame(0, &frame.bytes)?);
    }
    let bar = Bar::new("recording", ticks);
    for tick in 1..=ticks {
        let time_s = tick as f64 / hz;
        if let Some(frame) = server.step_with(time_s, &input)?.frame {
            frame_bytes += frame.bytes.len() as u64;
            updates += 1;
            bytes.extend(recorder.frame(microseconds(time_s).min(header.duration_us), &frame.bytes)?);
        }
        bar.set(tick);
    }
    bytes.extend(recorder.finish());
    Ok(Taken { bytes, seconds, points: server.store().layout().len(), updates, frame_bytes })
}
