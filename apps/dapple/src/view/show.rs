//! What is shown, without the window: scene, light, clock, camera, choices and figures.

use std::sync::Arc;

use anyhow::Result;
use dapple_client::clock::Clock;
use dapple_client::rate::Rate;
use dapple_client::viewer::{DrawOptions, LoadProgress, Viewer, ViewerConfig, ViewerStats};
use dapple_gpu::{Gpu, wgpu};
use dapple_render::shade::ShadeParams;
use dapple_scene::{KeyedPath, Scene};
use dapple_server::ServerConfig;
use dapple_stream::PublisherConfig;

use super::feed::{Feed, group_of};
use super::live::Live;
use super::quality::Quality;
use super::record_path::PathRecorder;
use super::steer::Steering;
use crate::args::LightArgs;
use crate::light::{scene_seconds, server_config};

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
        self.viewer = viewer;
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
        self.feed.look(&camera);
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
