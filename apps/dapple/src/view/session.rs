//! A show in a window: pointer, keys and the overlay steer it.

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result, bail};
use dapple_client::viewer::{DebugView, Method, ViewerError};
use dapple_gpu::GpuFault;
use dapple_scene::glam::Vec3;
use winit::event::{ElementState, KeyEvent, MouseButton, MouseScrollDelta, WindowEvent};
use winit::event_loop::ActiveEventLoop;
use winit::keyboard::{KeyCode, PhysicalKey};
use winit::window::Fullscreen;

use super::overlay::{Overlay, Wish};
use super::paint::Painter;
use super::picture;
use super::quality::{Quality, next_of};
use super::record_path::{Going, PathRecorder, write_new};
use super::retries::Retries;
use super::screen::{Next, Screen};
use super::show::{Opening, Show};
use crate::picture::write_png;

/// Seconds that are still drawn after the last change, for whatever settles late.
const LINGER_S: f64 = 0.3;

/// Seconds of scene time that an arrow key goes.
const STEP_S: f64 = 1.0 / 15.0;

/// Keys that walk: ahead, back, right, left, up, down.
const WALK_KEYS: [(KeyCode, Vec3); 6] = [
    (KeyCode::KeyW, Vec3::X),
    (KeyCode::KeyS, Vec3::NEG_X),
    (KeyCode::KeyD, Vec3::Y),
    (KeyCode::KeyA, Vec3::NEG_Y),
    (KeyCode::KeyE, Vec3::Z),
    (KeyCode::KeyQ, Vec3::NEG_Z),
];

const VIEW_KEYS: [KeyCode; 8] = [
    KeyCode::Digit1,
    KeyCode::Digit2,
    KeyCode::Digit3,
    KeyCode::Digit4,
    KeyCode::Digit5,
    KeyCode::Digit6,
    KeyCode::Digit7,
    KeyCode::Digit8,
];

/// Everything behind one window.
pub(super) struct Session {
    pub(super) show: Show,
    // The painter holds what the device made; it goes first.
    painter: Painter,
    screen: Screen,
    overlay: Overlay,
    outputs: Outputs,
    /// A camera path that is being recorded.
    recorder: Option<PathRecorder>,
    pointer: Pointer,
    /// Which of [`WALK_KEYS`] are held.
    held: [bool; 6],
    /// Clock up to which pictures are drawn.
    draw_until_s: f64,
    drawn_s: f64,
    /// Devices and surfaces that were made anew.
    retries: Retries,
}

/// Where pictures and camera paths are written to.
pub(super) struct Outputs {
    /// Folder of screenshots.
    pub(super) screenshots: PathBuf,
    /// File of camera paths; `None` is a numbered one in the current folder.
    pub(super) camera_paths: Option<PathBuf>,
}

#[derive(Default)]
struct Pointer {
    at: Option<(f64, f64)>,
    /// Turns (false) or moves sideways (true) while a button is held.
    drag: Option<bool>,
    shift: bool,
}

impl Session {
    pub(super) fn new(screen: Screen, opening: Opening, outputs: Outputs) -> Result<Session> {
        let show = Show::new(&screen.gpu, opening, screen.format())?;
        let painter = Painter::new(&screen);
        let mut overlay = Overlay::default();
        overlay.tell("H or F1: keys".to_owned(), 0.0);
        Ok(Session {
            show,
            painter,
            screen,
            overlay,
            outputs,
            recorder: None,
            pointer: Pointer::default(),
            held: [false; 6],
            draw_until_s: 1.0,
            drawn_s: f64::NEG_INFINITY,
            retries: Retries::default(),
        })
    }

    pub(super) fn request_redraw(&self) {
        self.screen.window.request_redraw();
    }

    pub(super) fn resize(&mut self, size: (u32, u32), now_s: f64) {
        if size.0 > 0 && size.1 > 0 {
            self.screen.resize(size);
            self.linger(now_s);
        }
    }

    /// Goes on to `now_s`; true if the window is to be drawn.
    pub(super) fn advance(&mut self, now_s: f64) -> bool {
        let start = Instant::now();
        match self.show.advance(now_s, &|| start.elapsed().as_secs_f64()) {
            Ok(true) => self.linger(now_s),
            Ok(false) => {}
            Err(error) => {
                tracing::error!("{error:#}");
                self.overlay.failure = Some(format!("{error:#}"));
                self.linger(now_s);
            }
        }
        if let Some(reason) = self.show.take_rejected() {
            self.overlay.tell(reason, now_s);
            self.linger(now_s);
        }
        self.record(now_s);
        let stale = now_s > self.drawn_s + self.overlay.stale_after_s() && !self.overlay.hidden;
        now_s < self.draw_until_s
            || stale
            || self.show.options.view == DebugView::Age
            || self.painter.wants_repaint()
    }

    fn linger(&mut self, now_s: f64) {
        self.draw_until_s = now_s + LINGER_S + f64::from(self.show.fade_s());
    }

    /// Draws and shows the present.
    pub(super) fn draw(&mut self, event_loop: &ActiveEventLoop, now_s: f64) -> Result<()> {
        if let Some(fault) = self.screen.gpu.take_fault() {
            return self.mend(event_loop, fault, now_s);
        }
        let canvas = match self.screen.next()? {
            Next::Canvas(canvas) => canvas,
            Next::Nothing => return Ok(()),
            Next::Again => {
                self.linger(now_s);
                return Ok(());
            }
            Next::SurfaceLost => return self.renew_surface(now_s),
            Next::Fault(fault) => return self.mend(event_loop, fault, now_s),
        };
        let size = self.screen.size();
        if let Err(error) = self.show.draw(&self.screen.gpu, &canvas.view, size, now_s) {
            return match error.downcast::<ViewerError>() {
                Ok(ViewerError::Fault(fault)) => {
                    drop(canvas);
                    self.mend(event_loop, fault, now_s)
                }
                Ok(error) => Err(error.into()),
                Err(error) => Err(error),
            };
        }
        let wish =
            self.painter.paint(&self.screen, &canvas.view, |ui| self.overlay.lay(ui, &mut self.show, now_s));
        self.screen.present(canvas);
        self.show.count_picture(now_s);
        self.drawn_s = now_s;
        match wish {
            Some(Wish::Screenshot) => self.screenshot(now_s),
            Some(Wish::Preset(preset)) => {
                let quality = Quality::of(preset);
                self.show.set_quality(&self.screen.gpu, quality)?;
                self.linger(now_s);
            }
            None => {}
        }
        Ok(())
    }

    /// Goes on with another surface after the window's was lost.
    fn renew_surface(&mut self, now_s: f64) -> Result<()> {
        if !self.retries.allow(now_s) {
            bail!("the window's surface is lost again and again");
        }
        tracing::warn!("the window's surface was lost; drawing goes on with a new one");
        self.screen.renew_surface()?;
        self.linger(now_s);
        Ok(())
    }

    /// After the loss of the device goes on with a new one, unless it is lost again and again. Other faults are mistakes
    /// of the program, or memory that is not there, and end it.
    fn mend(&mut self, event_loop: &ActiveEventLoop, fault: GpuFault, now_s: f64) -> Result<()> {
        match fault {
            GpuFault::Lost(_) if self.retries.allow(now_s) => {
                tracing::warn!("{fault}");
                self.screen = Screen::open(event_loop, self.screen.window.clone())
                    .context("the graphics device was lost, and there is no other")?;
                self.show.move_to(&self.screen.gpu, self.screen.format())?;
                self.painter = Painter::new(&self.screen);
                self.overlay
                    .tell("The graphics device was lost; drawing goes on with a new one.".to_owned(), now_s);
                self.linger(now_s);
                Ok(())
            }
            fault => Err(fault.into()),
        }
    }

    /// Takes a pointer or key event.
    pub(super) fn input(&mut self, event: &WindowEvent, now_s: f64) -> Result<()> {
        self.linger(now_s);
        if let WindowEvent::KeyboardInput { event, .. } = event {
            // The overlay is worked with the pointer; keys are all the picture's.
            return self.key(event, now_s);
        }
        self.painter.tell(&self.screen.window, event);
        let covered = self.pointer.at.is_some_and(|at| self.painter.covers(at));
        let (scene, time_s) = (self.show.scene.clone(), self.show.clock.time_s());
        let steering = &mut self.show.steering;
        match event {
            WindowEvent::ModifiersChanged(modifiers) => self.pointer.shift = modifiers.state().shift_key(),
            WindowEvent::MouseInput { state: ElementState::Pressed, button, .. } if !covered => {
                self.pointer.drag = Some(*button != MouseButton::Left || self.pointer.shift);
            }
            WindowEvent::MouseInput { state: ElementState::Released, .. } => self.pointer.drag = None,
            WindowEvent::CursorMoved { position, .. } => {
                let to = (position.x, position.y);
                if let (Some(sideways), Some(from)) = (self.pointer.drag, self.pointer.at) {
                    let height = f64::from(self.screen.size().1);
                    let (dx, dy) = (((to.0 - from.0) / height) as f32, ((to.1 - from.1) / height) as f32);
                    match sideways {
                        true => steering.pan(&scene, time_s, dx, dy),
                        false => steering.rotate(&scene, time_s, dx, dy),
                    }
                }
                self.pointer.at = Some(to);
            }
            WindowEvent::MouseWheel { delta, .. } if !covered => {
                let lines = match delta {
                    MouseScrollDelta::LineDelta(_, lines) => *lines,
                    MouseScrollDelta::PixelDelta(pixels) => pixels.y as f32 * 0.01,
                };
                steering.zoom(&scene, time_s, (0.15 * lines).exp());
            }
            WindowEvent::PinchGesture { delta, .. } => steering.zoom(&scene, time_s, 1.0 + *delta as f32),
            WindowEvent::Focused(false) => {
                // Keys that are released elsewhere are not heard of.
                self.held = [false; 6];
                self.pointer = Pointer::default();
                steering.push(Vec3::ZERO);
            }
            _ => {}
        }
        Ok(())
    }

    fn key(&mut self, event: &KeyEvent, now_s: f64) -> Result<()> {
        let PhysicalKey::Code(code) = event.physical_key else { return Ok(()) };
        if let Some(index) = WALK_KEYS.iter().position(|(key, _)| *key == code) {
            self.held[index] = event.state.is_pressed();
            let pushes = WALK_KEYS.iter().zip(self.held).filter(|(_, held)| *held);
            self.show.steering.push(pushes.map(|((_, direction), _)| *direction).sum());
            return Ok(());
        }
        let arrow = matches!(code, KeyCode::ArrowLeft | KeyCode::ArrowRight);
        if !event.state.is_pressed() || (event.repeat && !arrow) {
            return Ok(());
        }
        let (scene, time_s) = (self.show.scene.clone(), self.show.clock.time_s());
        let show = &mut self.show;
        match code {
            KeyCode::KeyH | KeyCode::F1 => self.overlay.help = !self.overlay.help,
            KeyCode::Escape => self.overlay.help = false,
            KeyCode::KeyU => self.overlay.hidden = !self.overlay.hidden,
            KeyCode::Space => show.set_playing(!show.clock.is_playing()),
            KeyCode::ArrowLeft | KeyCode::ArrowRight => {
                let step_s = if code == KeyCode::ArrowLeft { -STEP_S } else { STEP_S };
                show.set_playing(false);
                show.seek((time_s + step_s).max(0.0));
            }
            KeyCode::Home => show.seek(0.0),
            KeyCode::KeyO => show.steering.toggle_walking(&scene, time_s),
            KeyCode::KeyC => show.steering.next_path(),
            KeyCode::KeyF => {
                let (width, height) = self.screen.size();
                show.steering.fit(&scene, time_s, width as f32 / height as f32);
            }
            KeyCode::KeyR => self.toggle_recording(now_s),
            KeyCode::KeyM => show.options.method = next_of(&Method::ALL, show.options.method),
            KeyCode::KeyL => show.options.area_lights = !show.options.area_lights,
            KeyCode::KeyB => {
                show.options.split = match show.options.split {
                    None => Some((0.5, Method::None)),
                    Some(_) => None,
                };
            }
            KeyCode::KeyV => show.options.view = next_of(&DebugView::ALL, show.options.view),
            KeyCode::F12 | KeyCode::KeyP => self.screenshot(now_s),
            KeyCode::F11 => {
                let window = &self.screen.window;
                let fullscreen = window.fullscreen().is_none().then_some(Fullscreen::Borderless(None));
                window.set_fullscreen(fullscreen);
            }
            _ => {
                if let Some(index) = VIEW_KEYS.iter().position(|key| *key == code) {
                    show.options.view = DebugView::ALL[index];
                }
            }
        }
        Ok(())
    }

    /// Begins to record the camera, or stops and writes what was recorded.
    fn toggle_recording(&mut self, now_s: f64) {
        if self.recorder.is_some() {
            self.stop_recording(now_s);
        } else {
            self.recorder = Some(self.show.recorder());
            self.record(now_s);
        }
    }

    /// Takes the present camera, if one is recorded.
    fn record(&mut self, now_s: f64) {
        let Some(recorder) = &mut self.recorder else { return };
        let time_s = self.show.clock.time_s();
        let going = recorder.take(time_s, &self.show.steering.camera(&self.show.scene, time_s));
        self.overlay.recorded_s = Some(recorder.seconds());
        if going == Going::Ended {
            self.stop_recording(now_s);
        }
    }

    /// Writes the camera path that is being recorded, if one is, says where, and offers it as a camera.
    pub(super) fn stop_recording(&mut self, now_s: f64) {
        let Some(recorder) = self.recorder.take() else { return };
        self.overlay.recorded_s = None;
        let seconds = recorder.seconds();
        let text = match write_new(recorder, self.outputs.camera_paths.as_deref()) {
            Ok((file, path)) => {
                let keys = path.keys().len();
                self.show.add_path(path);
                format!("wrote {}: {seconds:.1} s of the camera in {keys} keys", file.display())
            }
            Err(error) => format!("no camera path: {error:#}"),
        };
        say!("{text}");
        self.overlay.tell(text, now_s);
        self.linger(now_s);
    }

    /// Writes what is shown into the next free numbered file, and says so.
    fn screenshot(&mut self, now_s: f64) {
        let size = self.screen.size();
        let written = picture::take(&self.screen.gpu, &mut self.show, size, now_s).and_then(|pixels| {
            let path = free_name(&self.outputs.screenshots);
            write_png(&path, size.0, size.1, &pixels)?;
            Ok(path)
        });
        let text = match written {
            Ok(path) => format!("wrote {}", path.display()),
            Err(error) => format!("no screenshot: {error:#}"),
        };
        say!("{text}");
        self.overlay.tell(text, now_s);
    }
}

/// The first of `dapple-001.png`, `dapple-002.png`, … that does not exist.
fn free_name(folder: &Path) -> PathBuf {
    let name = |number: u32| folder.join(format!("dapple-{number:03}.png"));
    let free = (1..u32::MAX).map(name).find(|path| !path.exists());
    free.unwrap_or_else(|| name(u32::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn screenshots_are_numbered() {
        let folder = tempfile::tempdir().unwrap();
        let first = free_name(folder.path());
        assert!(first.ends_with("dapple-001.png"));
        std::fs::write(first, b"").unwrap();
        assert!(free_name(folder.path()).ends_with("dapple-002.png"));
    }
}
