//! The thread that lights: a step a tick, frames for all viewers.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::{Duration, Instant};

use anyhow::Result;
use dapple_scene::Edits;
use dapple_server::shards::Merger;
use dapple_server::{Progress, Server, ServerConfig, StepReport};
use dapple_session::host::Tick;
use dapple_session::{LookCamera, Status};
use dapple_stream::{Frame, Limits};
use dapple_trace::psao::update::{ConvexVolume, StepInput};

use super::hub::{Hub, Phase};
use super::ration::Ration;
use super::recording::LiveRecording;
use super::work::{Sent, Workforce};

/// Most views that a step looks through; where there are more viewers, others each time.
const MOST_VIEWS: usize = 32;

/// What comes into view before the next step, metres around what is seen.
pub(crate) const MARGIN_M: f32 = 0.5;

/// Where light comes from.
enum Light {
    Here(Box<Server>),
    Workers(Box<Merger>, Workforce, Duration),
}

/// What a step made: a frame for each stream that wants one.
struct Made {
    report: StepReport,
    frames: Vec<Option<Frame>>,
    /// The host's clock once the full stream's frame was there.
    made_us: u64,
}

/// How a scene is lit while it is served.
pub(crate) struct Engine {
    pub(crate) hub: Arc<Hub>,
    pub(crate) config: ServerConfig,
    /// Updates a second.
    pub(crate) hz: f64,
    pub(crate) ration: Ration,
    pub(crate) recording: Option<LiveRecording>,
    /// Who traces, if that is not this program, and how long a step waits for them.
    pub(crate) workers: Option<(Workforce, Duration)>,
    pub(crate) stop: Arc<AtomicBool>,
}

impl Engine {
    /// Lights until told to stop. Whatever the end, the hub says how it came.
    pub(crate) fn run(mut self) -> Result<()> {
        let result = self.light();
        if let Err(error) = &result {
            self.hub.set_phase(Phase::Failed(format!("{error:#}")));
        }
        self.finish_recording("the recording is complete");
        result
    }

    /// Puts the recording in its place, and says why.
    fn finish_recording(&mut self, why: &str) {
        let Some(recording) = self.recording.take() else { return };
        match recording.finish() {
            Ok(seconds) => tracing::info!(seconds, "{why}"),
            Err(error) => tracing::error!("the recording was lost: {error:#}"),
        }
    }

    fn light(&mut self) -> Result<()> {
        let mut light = self.start()?;
        // What viewers have changed meanwhile.
        let edits = self.hub.host().state().2.clone();
        light.set_edits(&edits);
        let period = Duration::from_secs_f64(1.0 / self.hz);
        let mut due = Instant::now();
        let mut turn = 0;
        while !self.stop.load(Ordering::Relaxed) {
            let now = Instant::now();
            if now < due {
                std::thread::sleep(due - now);
            }
            let is_late = now > due + period;
            // Steps that were missed are not made up for.
            due = if is_late { Instant::now() + period } else { due + period };
            self.step(&mut light, turn, is_late)?;
            turn += 1;
        }
        Ok(())
    }

    fn start(&mut self) -> Result<Light> {
        let hub = self.hub.clone();
        let (scene, rungs, offered) = {
            let host = hub.host();
            let config = host.config();
            (host.scene().clone(), config.rungs.clone(), config.parts.len())
        };
        if let Some((workforce, patience)) = self.workers.take() {
            let most = u32::try_from(scene.instances.len()).unwrap_or(u32::MAX);
            let limits = Limits::default();
            let limits = Limits { max_sets: limits.max_sets.max(most), ..limits };
            let mut merger = Merger::new(&scene, self.config.publish, self.config.bits_per_s, limits);
            merger.offer_parts(offered as u32);
            for bits_per_s in rungs.iter().skip(1) {
                merger.add_stream(*bits_per_s);
            }
            return Ok(Light::Workers(Box::new(merger), workforce, patience));
        }
        let part = |done: usize, of: usize| (1000 * done / of.max(1)) as u32;
        let company = Company::default();
        let progress = |progress| {
            // Laying, tracing and cutting take about these parts of a start, as they do of a recording's.
            let (what, of_stage, from, to) = match progress {
                Progress::Laying(done, of) => ("laying points", part(done, of), 0, 400),
                Progress::Tracing(done, of) => ("tracing points", part(done, of), 400, 900),
                Progress::Cutting(done, of) => ("finding what stands between", part(done, of), 900, 1000),
            };
            hub.set_phase(Phase::Starting(what, of_stage));
            company.mille.store(from + (to - from) * of_stage / 1000, Ordering::Relaxed);
        };
        let started = Instant::now();
        let mut server = std::thread::scope(|scope| {
            scope.spawn(|| company.keep(&hub));
            // However the start ends, so does the company.
            let _end = End(&company.is_over);
            Server::new(scene, &self.config, &progress)
        })?;
        for bits_per_s in rungs.iter().skip(1) {
            server.add_stream(*bits_per_s);
        }
        let (points, seconds) = (server.store().layout().len(), started.elapsed().as_secs_f64());
        tracing::info!(points, seconds, "the light is there");
        Ok(Light::Here(Box::new(server)))
    }

    fn step(&mut self, light: &mut Light, turn: u64, is_late: bool) -> Result<()> {
        let hub = self.hub.clone();
        let (tick, looks, watched) = {
            let mut host = hub.host();
            let tick = host.begin_step(hub.now_us());
            let watched: Vec<bool> = (0..host.rungs()).map(|rung| host.is_watched(rung)).collect();
            (tick, host.looks(MOST_VIEWS, turn), watched)
        };
        if let Some(edits) = &tick.edits {
            light.set_edits(edits);
        }
        self.hub.set_phase(light.phase());
        if !watched.contains(&true) && self.recording.is_none() && light.is_warm() {
            light.idle(&tick);
            // Nobody looks. Who comes gets what has changed since with the next step.
            hub.step_done();
            return Ok(());
        }
        let start = Instant::now();
        // Stream 0 goes into a recording, watched or not; of a server it is what its steps bring.
        let always = self.recording.is_some() || matches!(light, Light::Here(_));
        let wants = |rung: usize| watched[rung] || rung == 0 && always;
        let Made { report, frames, made_us } = light.step(&hub, &tick, looks, self.ration.rays(), &wants)?;
        let took_us = start.elapsed().as_micros() as u64;
        if matches!(light, Light::Here(_)) {
            self.ration.note(report.rays, start.elapsed().as_secs_f64());
        }
        self.record(light, &tick, frames[0].as_ref());
        let status = Status {
            ray_budget: self.ration.rays().unwrap_or(0),
            waiting: report.counts.backlog.max(report.held_back),
            started: 1000,
            ..Status::default()
        };
        let wanted: Vec<usize> = {
            let mut host = hub.host();
            for (rung, frame) in frames.iter().enumerate() {
                host.publish(rung, &tick, frame.as_ref(), if rung == 0 { made_us } else { hub.now_us() });
            }
            (0..watched.len()).filter(|rung| host.wants_snapshot(*rung)).collect()
        };
        // Without the lock: a snapshot takes its time.
        let snapshots: Vec<_> = wanted.iter().map(|rung| (*rung, light.join(*rung))).collect();
        let ages_us = {
            let mut host = hub.host();
            for (rung, frame) in snapshots {
                if let Some(frame) = frame {
                    host.put_snapshot(rung, &tick, &frame, hub.now_us());
                }
            }
            host.end_step(&tick, hub.now_us(), status);
            host.take_ages()
        };
        hub.step_done();
        hub.figures.ages(&ages_us);
        hub.figures.step(&report, took_us, hub.now_us().saturating_sub(made_us), is_late);
        hub.figures.set_ray_budget(status.ray_budget);
        hub.figures.set_workers(light.workers());
        tracing::debug!(rays = report.rays, changed = report.changed, us = took_us, "step");
        Ok(())
    }

    fn record(&mut self, light: &Light, tick: &Tick, frame: Option<&Frame>) {
        if self.recording.as_ref().is_some_and(|recording| recording.has_jumped(tick.scene_us)) {
            self.finish_recording("scene time has jumped: the recording ends before that");
        }
        let Some(recording) = &mut self.recording else { return };
        let joined = if recording.wants_snapshot() { light.join(0) } else { None };
        let recorded = match joined.as_ref().or(frame) {
            Some(frame) => recording.frame(tick.scene_us, frame),
            None => Ok(()),
        };
        // A full disk ends the recording, not the light.
        if let Err(error) = recorded {
            tracing::error!("the recording has ended: {error:#}");
            self.recording = None;
        }
    }
}

/// Keeps viewers company while there is no light yet: they hear how far it is, and each other's events.
#[derive(Default)]
struct Company {
    mille: AtomicU32,
    is_over: AtomicBool,
}

impl Company {
    const EVERY: Duration = Duration::from_millis(250);

    fn keep(&self, hub: &Hub) {
        while !self.is_over.load(Ordering::Relaxed) {
            // 0 says nothing, and 1000 that it is there.
            let started = self.mille.load(Ordering::Relaxed).clamp(1, 999);
            let mut host = hub.host();
            let tick = host.begin_step(hub.now_us());
            host.end_step(&tick, hub.now_us(), Status { started, ..Status::default() });
            drop(host);
            hub.step_done();
            std::thread::sleep(Company::EVERY);
        }
    }
}

/// Sets a flag when it goes.
struct End<'a>(&'a AtomicBool);

impl Drop for End<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

impl Light {
    fn set_edits(&mut self, edits: &Edits) {
        match self {
            Light::Here(server) => server.set_edits(edits.clone()),
            Light::Workers(_, workforce, _) => workforce.set_edits(edits.clone()),
        }
    }

    fn phase(&self) -> Phase {
        match self {
            Light::Workers(_, workforce, _) if workforce.begun() < workforce.parts() => {
                let mille = 1000 * workforce.begun() / workforce.parts();
                Phase::Starting("waiting for workers", mille as u32)
            }
            _ => Phase::Serving,
        }
    }

    /// Whether everyone who traces has begun: the first light takes long, and should not be waited for by a viewer.
    fn is_warm(&self) -> bool {
        match self {
            Light::Here(_) => true,
            Light::Workers(_, workforce, _) => workforce.is_warm(),
        }
    }

    /// Nothing is to be lit; who comes and goes is heard all the same.
    fn idle(&mut self, tick: &Tick) {
        if let Light::Workers(merger, workforce, _) = self {
            let news = workforce.idle(tick);
            take_light(merger, workforce, news);
        }
    }

    fn step(
        &mut self,
        hub: &Hub,
        tick: &Tick,
        looks: Vec<LookCamera>,
        ray_budget: Option<u64>,
        wants: &dyn Fn(usize) -> bool,
    ) -> Result<Made> {
        let (scene_s, sent_s) = (tick.scene_us as f64 * 1e-6, tick.stamp_us as f64 * 1e-6);
        match self {
            Light::Here(server) => {
                let interest: Vec<ConvexVolume> = looks
                    .iter()
                    .map(|look| ConvexVolume::frustum(&look.posed(), look.aspect, f32::INFINITY, MARGIN_M))
                    .collect();
                let input = StepInput { ray_budget, interest: &interest };
                let mut report = server.step_at(scene_s, sent_s, &input)?;
                let made_us = hub.now_us();
                // Points that come or go must be told in their step, whether anyone listens or not.
                let all = report.spawned > 0 || report.evicted > 0;
                let mut frames = vec![report.frame.take()];
                for rung in 1..server.streams() {
                    let publishes = all || wants(rung);
                    frames.push(publishes.then(|| server.publish_stream(rung, sent_s, &interest)).flatten());
                }
                Ok(Made { report, frames, made_us })
            }
            Light::Workers(merger, workforce, patience) => {
                let work = workforce.step(tick, looks, *patience);
                let mut report = StepReport { rays: work.rays, points: work.points, ..StepReport::default() };
                report.counts.backlog = work.waiting;
                report.changed = work.changed;
                take_light(merger, workforce, work.light);
                let frames = merger.publish(sent_s, wants);
                Ok(Made { report, frames, made_us: hub.now_us() })
            }
        }
    }

    fn join(&self, stream: usize) -> Option<Frame> {
        match self {
            Light::Here(server) => server.join_stream(stream),
            Light::Workers(merger, ..) => merger.join_stream(stream),
        }
    }

    /// Workers that are there.
    fn workers(&self) -> usize {
        match self {
            Light::Here(_) => 0,
            Light::Workers(_, workforce, _) => workforce.present(),
        }
    }
}

/// Puts what workers sent into the whole. Whose frame does not fit is let go: the next connection begins with a snapshot.
fn take_light(merger: &mut Merger, workforce: &Workforce, light: Vec<(u32, Sent)>) {
    for (shard, sent) in light {
        let Sent::Frame(frame) = sent else {
            merger.begin(shard);
            continue;
        };
        if let Err(error) = merger.receive(shard, &frame) {
            tracing::warn!(part = shard + 1, "a worker's light does not fit: {error}");
            workforce.let_go(shard, &error);
        }
    }
}
