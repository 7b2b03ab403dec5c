//! The thread that lights: a step a tick, frames for all viewers.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, Result};
use dapple_server::{Progress, Server, ServerConfig};
use dapple_session::Status;
use dapple_session::host::Tick;
use dapple_trace::psao::update::{ConvexVolume, StepInput};

use super::hub::{Hub, Phase};
use super::ration::Ration;
use super::recording::LiveRecording;

/// Most views that a step looks through; where there are more viewers, others each time.
const MOST_VIEWS: usize = 32;

/// What comes into view before the next step, metres around what is seen.
const MARGIN_M: f32 = 0.5;

/// How a scene is lit while it is served.
pub(crate) struct Engine {
    pub(crate) hub: Arc<Hub>,
    pub(crate) config: ServerConfig,
    /// Updates a second.
    pub(crate) hz: f64,
    pub(crate) ration: Ration,
    pub(crate) recording: Option<LiveRecording>,
    pub(crate) stop: Arc<AtomicBool>,
}

impl Engine {
    /// Lights until told to stop. Whatever the end, the hub says how it came.
    pub(crate) fn run(mut self) -> Result<()> {
        let result = self.light();
        if let Err(error) = &result {
            self.hub.set_phase(Phase::Failed(format!("{error:#}")));
        }
        if let Some(recording) = self.recording.take() {
            let seconds = recording.finish()?;
            tracing::info!(seconds, "the recording is complete");
        }
        result
    }

    fn light(&mut self) -> Result<()> {
        let hub = self.hub.clone();
        let scene = hub.host().scene().clone();
        let part = |done: usize, of: usize| (1000 * done / of.max(1)) as u32;
        let progress = |progress| {
            hub.set_phase(match progress {
                Progress::Laying(done, of) => Phase::Starting("laying points", part(done, of)),
                Progress::Tracing(done, of) => Phase::Starting("tracing points", part(done, of)),
                Progress::Cutting(done, of) => Phase::Starting("finding what stands between", part(done, of)),
            });
        };
        let started = Instant::now();
        let mut server = Server::new(scene, &self.config, &progress)?;
        let rungs = hub.host().config().rungs.clone();
        for bits_per_s in rungs.iter().skip(1) {
            server.add_stream(*bits_per_s);
        }
        tracing::info!(
            points = server.store().layout().len(),
            seconds = started.elapsed().as_secs_f64(),
            "the light is there"
        );
        hub.set_phase(Phase::Serving);
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
            self.step(&mut server, turn, is_late)?;
            turn += 1;
        }
        Ok(())
    }

    fn step(&mut self, server: &mut Server, turn: u64, is_late: bool) -> Result<()> {
        let hub = self.hub.clone();
        let (tick, looks, watched) = {
            let mut host = hub.host();
            let tick = host.begin_step(hub.now_us());
            let watched: Vec<bool> =
                (0..host.config().rungs.len()).map(|rung| host.rung_viewers(rung) > 0).collect();
            (tick, host.looks(MOST_VIEWS, turn), watched)
        };
        if let Some(edits) = &tick.edits {
            server.set_edits(edits.clone());
        }
        if !watched.contains(&true) && self.recording.is_none() {
            // Nobody looks. Who comes gets what has changed since with the next step.
            hub.step_done();
            return Ok(());
        }
        let interest: Vec<ConvexVolume> = looks
            .iter()
            .map(|look| ConvexVolume::frustum(&look.posed(), look.aspect, f32::INFINITY, MARGIN_M))
            .collect();
        let start = Instant::now();
        let input = StepInput { ray_budget: self.ration.rays(), interest: &interest };
        let (scene_s, sent_s) = (tick.scene_us as f64 * 1e-6, tick.stamp_us as f64 * 1e-6);
        let report = server.step_at(scene_s, sent_s, &input)?;
        let made_us = hub.now_us();
        let frames: Vec<_> = (1..watched.len())
            .map(|rung| {
                // Changes of sets must be told in the step in which they happen, whether anyone listens or not.
                let publishes = watched[rung] || report.spawned > 0 || report.evicted > 0;
                publishes.then(|| server.publish_stream(rung, sent_s, &interest)).flatten()
            })
            .collect();
        let took_us = start.elapsed().as_micros() as u64;
        self.ration.note(report.rays, start.elapsed().as_secs_f64());
        self.record(server, &tick, report.frame.as_ref())?;
        let status = Status {
            ray_budget: self.ration.rays().unwrap_or(0),
            waiting: report.counts.backlog.max(report.held_back),
            ..Status::default()
        };
        let counts = {
            let mut host = hub.host();
            host.publish(0, &tick, report.frame.as_ref(), made_us);
            for (rung, frame) in frames.iter().enumerate() {
                host.publish(rung + 1, &tick, frame.as_ref(), hub.now_us());
            }
            let wanted: Vec<usize> = (0..watched.len()).filter(|rung| host.wants_snapshot(*rung)).collect();
            drop(host);
            let snapshots: Vec<_> = wanted.iter().map(|rung| (*rung, server.join_stream(*rung))).collect();
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
        hub.figures.ages(&counts);
        hub.figures.step(&report, took_us, hub.now_us().saturating_sub(made_us), is_late);
        hub.figures.set_ray_budget(status.ray_budget);
        tracing::debug!(rays = report.rays, changed = report.changed, us = took_us, "step");
        Ok(())
    }

    fn record(
        &mut self,
        server: &mut Server,
        tick: &Tick,
        frame: Option<&dapple_stream::Frame>,
    ) -> Result<()> {
        let Some(recording) = &mut self.recording else { return Ok(()) };
        let recorded = if recording.wants_snapshot() {
            let joined = server.join()?.context("a server publishes as it starts")?;
            recording.frame(tick.scene_us, &joined)
        } else {
            frame.map_or(Ok(()), |frame| recording.frame(tick.scene_us, frame))
        };
        // A full disk ends the recording, not the light.
        if let Err(error) = recorded {
            tracing::error!("the recording has ended: {error:#}");
            self.recording = None;
        }
        Ok(())
    }
}
