//! What is shown, without the window: scene, light, clock, camera, choices and figures.

use std::sync::Arc;
use std::time::Instant;

use anyhow::Result;
use dapple_client::clock::Clock;
use dapple_client::rate::Rate;
use dapple_client::viewer::{DrawOptions, LoadProgress, Viewer, ViewerConfig, ViewerStats};
use dapple_gpu::{Gpu, wgpu};
use dapple_render::shade::ShadeParams;
use dapple_scene::{KeyedPath, Scene};
use dapple_server::ServerConfig;
use dapple_session::{Event, Held};
use dapple_stream::PublisherConfig;

use super::feed::{Feed, group_of};
use super::live::Live;
use super::quality::Quality;
use super::record_path::PathRecorder;
use super::remote::Piece;
use super::steer::Steering;
use crate::args::LightArgs;
use crate::light::{scene_seconds, server_config};
use crate::live::LinkState;

/// Texels that are worked on at a time: some milliseconds.
const WORK_TEXELS: usize = 512;

/// Part of the time between two pictures that may go into work after a snapshot, and its bounds in seconds.
const WORK_PART: f64 = 0.25;
const WORK_S: (f64, f64) = (0.008, 0.25);

/// A scene and everything that goes on with it.
pub(super) struct Show {
    pub(super) scene: Arc<Scene>,
    pub(super) title: String,
    pub(super) clock: Clock,
    pub(super) steering: Steering,
    pub(super) options: DrawOptions,
    pub(super) feed: Feed,
    quality: Quality,
    light: LightArgs,
    viewer: Viewer,
    progress: LoadProgress,
    /// The first group that a new server may use.
    next_group: u64,
    bytes: Rate,
    points: Rate,
    pictures: Rate,
    last_s: Option<f64>,
    /// Of the last picture.
    aspect: f32,
    /// What a host said no to.
    rejected: Option<String>,
    /// The problem of the viewer that was logged last.
    logged: Option<String>,
}

/// Figures for an overlay.
pub(super) struct Figures {
    pub(super) fps: f64,
    pub(super) megabits_per_second: f64,
    pub(super) changed_per_second: f64,
    pub(super) age_s: Option<f64>,
    pub(super) viewer: ViewerStats,
    pub(super) progress: LoadProgress,
}

/// What a show is opened with.
pub(super) struct Opening {
    pub(super) scene: Arc<Scene>,
    pub(super) title: String,
    pub(super) feed: Feed,
    pub(super) steering: Steering,
    pub(super) options: DrawOptions,
    pub(super) quality: Quality,
    pub(super) light: LightArgs,
}

impl Show {
    /// Uploads the scene; pictures are drawn in `format`.
    pub(super) fn new(gpu: &Gpu, opening: Opening, format: wgpu::TextureFormat) -> Result<Show> {
        let Opening { scene, title, feed, steering, options, quality, light } = opening;
        let viewer = Viewer::new(gpu, scene.clone(), viewer_config(&quality, format))?;
        let mut clock = Clock::default();
        clock.set_extent(extent_s(&scene, &steering), f64::INFINITY);
        Ok(Show {
            scene,
            title,
            clock,
            steering,
            options,
            feed,
            quality,
            light,
            viewer,
            progress: LoadProgress::default(),
            next_group: 0,
            bytes: Rate::default(),
            points: Rate::default(),
            pictures: Rate::default(),
            last_s: None,
            aspect: 16.0 / 9.0,
            rejected: None,
            logged: None,
        })
    }

    /// What records its camera.
    pub(super) fn recorder(&self) -> PathRecorder {
        PathRecorder::new(self.steering.diagonal_m(), self.clock.duration_s())
    }

    /// Offers a camera path beside the scene's own.
    pub(super) fn add_path(&mut self, path: KeyedPath) {
        self.steering.add(path.into());
        if self.feed.extent_s().is_none() {
            self.clock.set_extent(extent_s(&self.scene, &self.steering), f64::INFINITY);
        }
    }

    pub(super) fn quality(&self) -> Quality {
        self.quality
    }

    /// Takes on another effort: uploads the scene anew, and starts another server if the points differ.
    pub(super) fn set_quality(&mut self, gpu: &Gpu, quality: Quality) -> Result<()> {
        let viewer = Viewer::new(gpu, self.scene.clone(), viewer_config(&quality, self.viewer.format()))?;
        let points_differ = quality.points_per_m2 != self.quality.points_per_m2;
        if points_differ && matches!(self.feed, Feed::Live(_)) {
            let light = LightArgs { points: Some(quality.points_per_m2), ..self.light.clone() };
            self.feed = start_server(&self.scene, &light, self.next_group)?;
            self.light = light;
        }
        self.quality = quality;
        self.take_viewer(viewer);
        Ok(())
    }

    /// Goes on with another device.
    pub(super) fn move_to(&mut self, gpu: &Gpu, format: wgpu::TextureFormat) -> Result<()> {
        let viewer = Viewer::new(gpu, self.scene.clone(), viewer_config(&self.quality, format))?;
        self.take_viewer(viewer);
        Ok(())
    }

    fn take_viewer(&mut self, viewer: Viewer) {
        let edits = self.viewer.edits().clone();
        self.viewer = viewer;
        self.viewer.set_edits(&edits);
        self.progress = LoadProgress::default();
        self.feed.join();
    }

    /// Goes on to `now_s` (seconds on the caller's clock); true if there is something new to draw. `elapsed` tells the
    /// seconds since the call began. An error says why the light stays as it is.
    pub(super) fn advance(&mut self, now_s: f64, elapsed: &dyn Fn() -> f64) -> Result<bool> {
        let elapsed_s = self.last_s.map_or(0.0, |last| now_s - last);
        self.last_s = Some(now_s);
        let mut changed = self.clock.advance(elapsed_s);
        self.look();
        changed |= self.receive_live(now_s)?;
        let frames = self.feed.poll(self.clock.time_s())?;
        if let Some((duration_s, loaded_s)) = self.feed.extent_s() {
            self.clock.set_extent(duration_s, loaded_s);
        }
        for frame in frames {
            changed |= true;
            self.receive(&frame, now_s)?;
        }
        changed |= self.steering.advance(&self.scene, self.clock.time_s(), elapsed_s);
        let work_s = (WORK_PART * elapsed_s).clamp(WORK_S.0, WORK_S.1);
        while elapsed() < work_s {
            let progress = self.viewer.work(WORK_TEXELS);
            changed |= progress != self.progress;
            self.progress = progress;
            if progress.is_complete() {
                break;
            }
        }
        Ok(changed)
    }

    /// Tells the server how the viewer looks.
    pub(super) fn look(&mut self) {
        let camera = self.steering.camera(&self.scene, self.clock.time_s());
        self.feed.look(&camera, self.aspect);
    }

    /// Takes what a live session brought; true if there is something new to draw.
    fn receive_live(&mut self, now_s: f64) -> Result<bool> {
        let Some(remote) = self.feed.remote() else { return Ok(false) };
        let mut changed = false;
        if let Some(edits) = remote.new_edits() {
            self.viewer.set_edits(&edits);
            changed = true;
        }
        let (time_s, playing) = remote.scene_time();
        let duration_s = self.clock.duration_s();
        let time_s = if duration_s > 0.0 { time_s.rem_euclid(duration_s) } else { time_s };
        changed |= time_s != self.clock.time_s();
        self.clock.set_playing(playing);
        self.clock.seek(time_s);
        self.rejected = remote.rejected().or(self.rejected.take());
        for piece in remote.take_frames() {
            let (part, frame) = match piece {
                Piece::Frame(part, frame) => (part, frame),
                Piece::Anew => {
                    self.viewer.outdate();
                    continue;
                }
            };
            let start = Instant::now();
            let applied = self.viewer.receive_part(part, &frame, now_s);
            let held = self.viewer.held().map(|(group, epoch)| Held { group, epoch });
            remote.applied(held, applied.is_ok(), start.elapsed().as_secs_f64());
            match applied {
                Ok(applied) => {
                    changed = true;
                    self.bytes.add(now_s, frame.len() as f64);
                    self.points.add(now_s, f64::from(self.viewer.changed_by(&applied)));
                }
                // The host hears of it, and sends what helps.
                Err(error) if error.snapshot_helps() => tracing::debug!("{error}"),
                Err(error) => return Err(error.into()),
            }
        }
        Ok(changed)
    }

    /// What a host has said no to since this was last asked.
    pub(super) fn take_rejected(&mut self) -> Option<String> {
        self.rejected.take()
    }

    /// Lets time go on or wait: for everyone, in a live session.
    pub(super) fn set_playing(&mut self, playing: bool) {
        let event = if playing { Event::Play } else { Event::Pause };
        if !self.tell_host(event) {
            self.clock.set_playing(playing);
        }
    }

    /// Goes to a time: everyone, in a live session.
    pub(super) fn seek(&mut self, time_s: f64) {
        if !self.tell_host(Event::Seek { time_s: time_s.max(0.0) }) {
            self.clock.seek(time_s);
        }
    }

    /// Tells the host of a live session; false if there is none.
    fn tell_host(&mut self, event: Event) -> bool {
        let Some(remote) = self.feed.remote() else { return false };
        if let Err(reason) = remote.send(event) {
            self.rejected = Some(reason.to_owned());
        }
        true
    }

    /// Hands a frame to the viewer.
    pub(super) fn receive(&mut self, frame: &[u8], now_s: f64) -> Result<()> {
        if let Some(group) = group_of(frame) {
            self.next_group = self.next_group.max(group.saturating_add(1));
        }
        let applied = self.viewer.receive(frame, now_s)?;
        self.bytes.add(now_s, frame.len() as f64);
        self.points.add(now_s, f64::from(self.viewer.changed_by(&applied)));
        Ok(())
    }

    /// Whether there is any light to show.
    pub(super) fn has_light(&self) -> bool {
        self.viewer.store().is_some()
    }

    /// Why a live session has ended for good, if it has.
    pub(super) fn ended(&mut self) -> Option<String> {
        match self.feed.remote()?.state() {
            LinkState::Ended(reason) => Some(reason),
            _ => None,
        }
    }

    /// Does all work that is left after a snapshot.
    pub(super) fn finish_work(&mut self) {
        loop {
            self.progress = self.viewer.work(WORK_TEXELS);
            if self.progress.is_complete() {
                return;
            }
        }
    }

    /// Draws the present into `target`.
    pub(super) fn draw(
        &mut self,
        gpu: &Gpu,
        target: &wgpu::TextureView,
        size: (u32, u32),
        now_s: f64,
    ) -> Result<()> {
        let time_s = self.clock.time_s();
        self.aspect = size.0 as f32 / size.1.max(1) as f32;
        let camera = self.steering.camera(&self.scene, time_s);
        self.viewer.draw(gpu, target, size, &camera, time_s, now_s, &self.options)?;
        let problem = self.viewer.problem();
        if problem != self.logged.as_deref() {
            if let Some(problem) = problem {
                tracing::warn!("{problem}; drawing goes on without it");
            }
            self.logged = problem.map(str::to_owned);
        }
        Ok(())
    }

    /// Why a look-up is left out of pictures, if one is.
    pub(super) fn problem(&self) -> Option<&str> {
        self.viewer.problem()
    }

    /// Seconds that an update fades in over.
    pub(super) fn fade_s(&self) -> f32 {
        self.viewer.fade_s(&self.options)
    }

    /// Counts a picture that was shown.
    pub(super) fn count_picture(&mut self, now_s: f64) {
        self.pictures.add(now_s, 1.0);
    }

    pub(super) fn format(&self) -> wgpu::TextureFormat {
        self.viewer.format()
    }

    pub(super) fn figures(&mut self, now_s: f64) -> Figures {
        let viewer = self.viewer.stats();
        Figures {
            fps: self.pictures.per_second(now_s),
            megabits_per_second: 8e-6 * self.bytes.per_second(now_s),
            changed_per_second: self.points.per_second(now_s),
            age_s: viewer.last_frame_s.map(|last| (now_s - last).max(0.0)),
            viewer,
            progress: self.progress,
        }
    }
}

/// Seconds after which the clock begins again: those of the scene, or of a longer camera path that is not its own.
fn extent_s(scene: &Scene, steering: &Steering) -> f64 {
    scene_seconds(scene).max(steering.added_s())
}

/// A server for the scene, whose groups begin at `first_group`.
pub(super) fn start_server(scene: &Arc<Scene>, light: &LightArgs, first_group: u64) -> Result<Feed> {
    let config = server_config(scene, light)?;
    let publish = PublisherConfig { first_group, ..config.publish };
    let config = ServerConfig { publish, ..config };
    Ok(Feed::Live(Live::start(scene.clone(), config, light.hz(), light.step.ray_budget)?))
}

fn viewer_config(quality: &Quality, format: wgpu::TextureFormat) -> ViewerConfig {
    let shade = ShadeParams { shadow_resolution: quality.shadow_resolution, ..ShadeParams::default() };
    ViewerConfig { samples: quality.samples, shade, ..ViewerConfig::new(format) }
}
