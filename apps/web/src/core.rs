//! The handle behind `page/dapple.js`: one canvas, one scene, and its light, recorded or live.

use std::sync::Arc;

use dapple_client::clock::Clock;
use dapple_client::rate::Rate;
use dapple_client::viewer::{DebugView, DrawOptions, LoadProgress, ScreenOptions, Viewer, ViewerConfig};
use dapple_render::sdao::SideParams;
use dapple_render::shade::ShadeParams;
use dapple_scene::{NoFiles, Scene, Spare};
use dapple_stream::{Limits, Recording, Replay};
use js_sys::{Object, Reflect};
use wasm_bindgen::prelude::*;
use web_sys::HtmlCanvasElement;

use crate::canvas::Screen;
use crate::edit::Hand;
use crate::live::Live;
use crate::names;
use crate::steer::Steering;

/// Seconds that are still drawn after the last change, for whatever settles late.
const LINGER_S: f64 = 0.3;
/// Seconds between two pictures while nothing changes but how much light is laid out: each takes time from that work.
const LOADING_PICTURE_S: f64 = 0.25;

/// A viewer on a canvas. Not for pages: `createViewer` of `dapple.js` wraps it.
#[wasm_bindgen]
pub struct Core {
    screen: Screen,
    pub(crate) shown: Option<Shown>,
    pub(crate) live: Option<Live>,
    pub(crate) hand: Hand,
    limits: Limits,
    recording: Recording,
    replay: Replay,
    pub(crate) clock: Clock,
    last_tick_s: Option<f64>,
    options: DrawOptions,
    pub(crate) steering: Steering,
    progress: LoadProgress,
    /// Whether light was laid out that no picture shows yet, and when the last picture was drawn.
    has_new_light: bool,
    drawn_s: f64,
    /// Clock of the page up to which pictures are drawn.
    draw_until_s: f64,
    pub(crate) changed: bool,
    pub(crate) bytes: Rate,
    pub(crate) points: Rate,
    pictures: Rate,
}

/// What there is once the scene is loaded.
pub(crate) struct Shown {
    pub(crate) scene: Arc<Scene>,
    pub(crate) viewer: Viewer,
}

#[wasm_bindgen]
impl Core {
    /// Takes a canvas, by `auto`, `webgpu` or `webgl2`. Where the browser has none of them, the error is called
    /// `NoGraphics`.
    pub async fn open(canvas: HtmlCanvasElement, backend: &str) -> Result<Core, JsValue> {
        console_error_panic_hook::set_once();
        let backend = names::backend(backend).map_err(JsError::from)?;
        let screen = Screen::open(canvas, backend).await.map_err(|reason| {
            let error = js_sys::Error::new(&reason);
            error.set_name("NoGraphics");
            error
        })?;
        let limits = Limits::default();
        Ok(Core {
            screen,
            shown: None,
            live: None,
            hand: Hand::default(),
            limits,
            recording: Recording::new(&limits),
            replay: Replay::new(1),
            clock: Clock::default(),
            last_tick_s: None,
            options: DrawOptions::default(),
            steering: Steering::default(),
            progress: LoadProgress::default(),
            has_new_light: false,
            drawn_s: f64::NEG_INFINITY,
            draw_until_s: 0.0,
            changed: true,
            bytes: Rate::default(),
            points: Rate::default(),
            pictures: Rate::default(),
        })
    }

    /// Loads a self-contained scene file; its name says the format. `shadow_resolution` and `samples` as in
    /// `ViewerConfig`; 0 takes the default. `animation` plays instead of the file's first. `spares` are pairs: an instance, and how
    /// many more there may be of it.
    #[wasm_bindgen(js_name = loadScene)]
    pub fn load_scene(
        &mut self,
        name: &str,
        bytes: &[u8],
        shadow_resolution: u32,
        samples: u32,
        animation: Option<u32>,
        spares: &[u32],
    ) -> Result<(), JsError> {
        let mut scene = dapple_scene::load(name, bytes, &NoFiles)?;
        if scene.triangle_count() == 0 {
            return Err(JsError::new(&format!("{name} has no triangles: there is nothing to show")));
        }
        if let Some(animation) = animation {
            let count = scene.animations.len();
            if animation as usize >= count {
                let message =
                    format!("there is no animation {animation}: {name} has {count}, counted from 0");
                return Err(JsError::new(&message));
            }
            scene.set_active_animation(Some(animation));
        }
        let (spares, _) = spares.as_chunks::<2>();
        let spares: Vec<Spare> = spares.iter().map(|&[instance, count]| Spare { instance, count }).collect();
        scene.add_spares(&spares)?;
        let scene = Arc::new(scene);
        let mut shade = ShadeParams::default();
        if shadow_resolution > 0 {
            shade.shadow_resolution = shadow_resolution.clamp(16, 8192);
        }
        let config = ViewerConfig {
            samples: if samples == 1 { 1 } else { 4 },
            shade,
            limits: self.limits,
            ..ViewerConfig::new(self.screen.format())
        };
        let viewer = Viewer::new(&self.screen.gpu, Arc::clone(&scene), config)?;
        self.steering = Steering::new(&scene);
        self.clock.set_extent(self.steering.duration_s(&scene), f64::INFINITY);
        self.shown = Some(Shown { scene, viewer });
        self.changed = true;
        Ok(())
    }

    /// Takes the next bytes of a recorded stream, as they come.
    #[wasm_bindgen(js_name = pushStream)]
    pub fn push_stream(&mut self, bytes: &[u8]) -> Result<(), JsError> {
        self.recording.push(bytes)?;
        if let Some(header) = self.recording.header() {
            let duration_s = header.duration_us as f64 / 1e6;
            self.clock.set_extent(duration_s, self.recording.loaded_us() as f64 / 1e6);
        }
        self.changed = true;
        Ok(())
    }

    /// Says after the last bytes whether any are missing.
    #[wasm_bindgen(js_name = finishStream)]
    pub fn finish_stream(&self) -> Result<(), JsError> {
        Ok(self.recording.finish()?)
    }

    /// Goes on with the work after a snapshot, about so many texels; gives `{ done, total }`.
    pub fn work(&mut self, texels: u32) -> JsValue {
        if let Some(shown) = &mut self.shown {
            let before = self.progress;
            self.progress = shown.viewer.work(texels as usize);
            self.has_new_light |= self.progress != before;
        }
        let LoadProgress { done, total } = self.progress;
        object(&[("done", (done as f64).into()), ("total", (total as f64).into())])
    }

    /// Plays up to `now_s` (seconds on the page's clock) and draws if anything changed; true if it drew.
    pub fn frame(&mut self, now_s: f64) -> Result<bool, JsError> {
        if let Some(fault) = self.screen.gpu.take_fault() {
            return Err(fault.into());
        }
        let elapsed_s = self.last_tick_s.map_or(0.0, |last| now_s - last);
        self.last_tick_s = Some(now_s);
        self.follow_host(now_s);
        let Some(Shown { scene, viewer }) = &mut self.shown else { return Ok(false) };
        self.changed |= self.clock.advance(elapsed_s);

        let time_us = (self.clock.time_s() * 1e6).round() as u64;
        for frame in self.replay.frames_to(&self.recording, time_us) {
            let applied = viewer.receive(&frame, now_s)?;
            self.bytes.add(now_s, frame.len() as f64);
            self.points.add(now_s, f64::from(viewer.changed_by(&applied)));
            self.changed = true;
        }
        self.changed |= self.steering.advance(elapsed_s);
        // The last of it fades in.
        self.changed |= self.has_new_light && self.progress.is_complete();
        if self.changed {
            self.draw_until_s = now_s + LINGER_S + f64::from(viewer.fade_s(&self.options));
        }
        let shows_light = self.has_new_light && now_s - self.drawn_s >= LOADING_PICTURE_S;
        if now_s > self.draw_until_s && self.options.view != DebugView::Age && !shows_light {
            return Ok(false);
        }
        let camera = self.steering.camera(scene, self.clock.time_s());
        let (size, time_s) = (self.screen.size(), self.clock.time_s());
        if let Some(live) = &mut self.live {
            live.guest.look(&camera, size.0 as f32 / size.1 as f32);
        }
        let options = &self.options;
        let drew =
            self.screen.draw(|gpu, target| viewer.draw(gpu, target, size, &camera, time_s, now_s, options));
        self.changed = false;
        if drew.map_err(|reason| JsError::new(&reason))? {
            self.pictures.add(now_s, 1.0);
            (self.has_new_light, self.drawn_s) = (false, now_s);
            return Ok(true);
        }
        Ok(false)
    }

    /// Lets time go on or wait.
    #[wasm_bindgen(js_name = setPlaying)]
    pub fn set_playing(&mut self, playing: bool) {
        self.clock.set_playing(playing);
        self.changed = true;
    }

    /// Whether the end is followed by the beginning.
    #[wasm_bindgen(js_name = setLooping)]
    pub fn set_looping(&mut self, looping: bool) {
        self.clock.set_looping(looping);
    }

    /// Goes to a time, seconds.
    pub fn seek(&mut self, time_s: f64) {
        self.clock.seek(time_s);
        self.bytes.clear();
        self.points.clear();
        self.changed = true;
    }

    /// How visibility is found, by name.
    #[wasm_bindgen(js_name = setMethod)]
    pub fn set_method(&mut self, name: &str) -> Result<(), JsError> {
        self.options.method = names::method(name)?;
        self.changed = true;
        Ok(())
    }

    /// What stands in for points while there are none, by name.
    #[wasm_bindgen(js_name = setFallback)]
    pub fn set_fallback(&mut self, name: &str) -> Result<(), JsError> {
        self.options.fallback = names::fallback(name)?;
        self.changed = true;
        Ok(())
    }

    /// Of methods that look at the picture alone: how far away what blocks may be, metres; how far beyond the picture is looked, as a part
    /// of its height; how much work they do, by name; whether at half the resolution, if not as the preset has it; how far to the right a second camera
    /// stands, metres, where a method takes one: 0 or less for none.
    #[wasm_bindgen(js_name = setScreenSpace)]
    pub fn set_screen_space(
        &mut self,
        radius_m: f32,
        guard_band: f32,
        preset: &str,
        half_resolution: Option<bool>,
        second_camera_m: f32,
    ) -> Result<(), JsError> {
        let usual = ScreenOptions::default();
        let is_positive = |metres: f32| metres.is_finite() && metres > 0.0;
        self.options.screen = ScreenOptions {
            radius_m: if is_positive(radius_m) { radius_m } else { usual.radius_m },
            guard_band: if guard_band.is_finite() { guard_band.clamp(0.0, 0.5) } else { usual.guard_band },
            preset: names::effort(preset)?,
            half_resolution,
            second_camera: is_positive(second_camera_m)
                .then(|| SideParams { aside_m: second_camera_m, ..SideParams::default() }),
        };
        self.changed = true;
        Ok(())
    }

    /// Whether area lights are drawn whose visibility the stream has.
    #[wasm_bindgen(js_name = setAreaLights)]
    pub fn set_area_lights(&mut self, on: bool) {
        self.options.area_lights = on;
        self.changed = true;
    }

    /// What is shown, by name.
    #[wasm_bindgen(js_name = setView)]
    pub fn set_view(&mut self, name: &str) -> Result<(), JsError> {
        self.options.view = names::view(name)?;
        self.changed = true;
        Ok(())
    }

    /// The other method, right of `position` (0 … 1 of the width).
    #[wasm_bindgen(js_name = setSplit)]
    pub fn set_split(&mut self, position: f32, method: &str) -> Result<(), JsError> {
        let position = if position.is_finite() { position.clamp(0.0, 1.0) } else { 0.5 };
        self.options.split = Some((position, names::method(method)?));
        self.changed = true;
        Ok(())
    }

    /// One method over the whole width.
    #[wasm_bindgen(js_name = clearSplit)]
    pub fn clear_split(&mut self) {
        self.options.split = None;
        self.changed = true;
    }

    /// Seconds that an update fades in over; 0 for none. Until this is called, as long as updates are apart.
    #[wasm_bindgen(js_name = setFade)]
    pub fn set_fade(&mut self, fade_s: f32) {
        self.options.fade_s = Some(if fade_s.is_finite() { fade_s.clamp(0.0, 10.0) } else { 0.0 });
        self.changed = true;
    }

    /// Size of the canvas in pixels of the device.
    pub fn resize(&mut self, width: u32, height: u32) {
        self.screen.resize(width, height);
        self.changed = true;
    }

    /// Draws the next frame whether anything changed or not.
    pub fn invalidate(&mut self) {
        self.changed = true;
    }

    /// Figures for an overlay; the names are those of `dapple.d.ts`.
    pub fn stats(&mut self, now_s: f64) -> JsValue {
        let stats = self.shown.as_ref().map(|shown| shown.viewer.stats()).unwrap_or_default();
        let problem = self.shown.as_ref().and_then(|shown| shown.viewer.problem());
        let info = self.screen.gpu.adapter.get_info();
        let backend =
            if info.backend == dapple_gpu::wgpu::Backend::BrowserWebGpu { "webgpu" } else { "webgl2" };
        let age_s = stats.last_frame_s.map_or(JsValue::NULL, |last| (now_s - last).max(0.0).into());
        let (heap_bytes, card_bytes) = stats.memory_bytes;
        let (time_s, duration_s, is_playing) = self.shown_time(now_s);
        object(&[
            ("fps", self.pictures.per_second(now_s).into()),
            ("megabitsPerSecond", (self.bytes.per_second(now_s) * 8e-6).into()),
            ("changedPerSecond", self.points.per_second(now_s).into()),
            ("bytes", (stats.bytes_received as f64).into()),
            ("frames", (stats.frames_received as f64).into()),
            ("points", stats.points.into()),
            ("areaLights", stats.area_lights.into()),
            ("changed", stats.changed.into()),
            ("texels", stats.texels.into()),
            ("memoryBytes", (heap_bytes as f64).into()),
            ("cardBytes", (card_bytes as f64).into()),
            ("age", age_s),
            ("backend", backend.into()),
            ("adapter", info.name.into()),
            ("width", self.screen.size().0.into()),
            ("height", self.screen.size().1.into()),
            ("time", time_s.into()),
            ("duration", duration_s.into()),
            ("playing", is_playing.into()),
            ("problem", problem.map_or(JsValue::NULL, JsValue::from_str)),
        ])
    }

    /// What the loader mended in the scene, one sentence each.
    pub fn warnings(&self) -> Vec<String> {
        let scene = self.shown.as_ref().map(|shown| &shown.scene);
        scene.iter().flat_map(|scene| &scene.warnings).map(|warning| warning.message.clone()).collect()
    }

    /// Time of the scene and where it begins again (0 for never), seconds, and whether it runs.
    fn shown_time(&self, now_s: f64) -> (f64, f64, bool) {
        match (&self.live, &self.shown) {
            (Some(live), Some(shown)) => {
                // The host's time knows no end: it is shown as that of the animation.
                let time_s = self.host_time_s(now_s).unwrap_or(self.clock.time_s());
                let duration_s = self.steering.duration_s(&shown.scene);
                let time_s = if duration_s > 0.0 { time_s.rem_euclid(duration_s) } else { time_s };
                (time_s, duration_s, live.guest.clock().playing)
            }
            _ => (self.clock.time_s(), self.clock.duration_s(), self.clock.is_playing()),
        }
    }

    /// Pixels of the picture, width and height.
    pub(crate) fn size(&self) -> (u32, u32) {
        self.screen.size()
    }

    /// Width of the picture per height.
    pub(crate) fn aspect(&self) -> f32 {
        let (width, height) = self.screen.size();
        width as f32 / height as f32
    }

    pub(crate) fn scene(&self) -> Option<Arc<Scene>> {
        self.shown.as_ref().map(|shown| Arc::clone(&shown.scene))
    }
}

/// A JavaScript object of these fields.
pub(crate) fn object(fields: &[(&str, JsValue)]) -> JsValue {
    let object = Object::new();
    for (name, value) in fields {
        // Setting a field of a plain object cannot fail.
        let _ = Reflect::set(&object, &JsValue::from_str(name), value);
    }
    object.into()
}
