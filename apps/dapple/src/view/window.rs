//! The window: events in, pictures and the overlay out.

use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use winit::application::ApplicationHandler;
use winit::dpi::PhysicalSize;
use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop};
use winit::window::{Window, WindowId};

use super::screen::Screen;
use super::session::{Outputs, Session};
use super::show::Opening;
use crate::args::Size;

/// How often an idle window looks for news.
const IDLE: Duration = Duration::from_millis(30);

/// Shows what was opened until its window is closed.
pub(super) fn run(opening: Opening, size: Size, outputs: Outputs, paused: bool, time_s: f64) -> Result<()> {
    check_display()?;
    let event_loop =
        EventLoop::new().context("cannot open a window; --headless writes pictures without one")?;
    let started = Instant::now();
    let start = Start { opening, size, outputs, paused, time_s };
    let mut app = App { start: Some(start), session: None, error: None, started, hidden: false };
    event_loop.run_app(&mut app).context("the window system failed")?;
    app.error.map_or(Ok(()), Err)
}

/// Says what to do where there is no display.
fn check_display() -> Result<()> {
    let has_variables = cfg!(any(target_os = "windows", target_os = "macos"))
        || ["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"]
            .into_iter()
            .any(|name| std::env::var_os(name).is_some_and(|value| !value.is_empty()));
    if !has_variables {
        bail!(
            "there is no display (neither DISPLAY nor WAYLAND_DISPLAY is set): --headless --frames N -o DIR writes \
             pictures without one, `xvfb-run dapple view …` makes one up"
        );
    }
    Ok(())
}

/// What the window begins with.
struct Start {
    opening: Opening,
    size: Size,
    outputs: Outputs,
    paused: bool,
    time_s: f64,
}

struct App {
    start: Option<Start>,
    session: Option<Session>,
    error: Option<anyhow::Error>,
    started: Instant,
    /// Whether nobody sees the window.
    hidden: bool,
}

impl App {
    fn now_s(&self) -> f64 {
        self.started.elapsed().as_secs_f64()
    }

    fn open(&mut self, event_loop: &ActiveEventLoop) -> Result<()> {
        let Some(start) = self.start.take() else { return Ok(()) };
        let attributes = Window::default_attributes()
            .with_title(format!("dapple – {}", start.opening.title))
            .with_min_inner_size(PhysicalSize::new(160, 120))
            .with_inner_size(PhysicalSize::new(start.size.width, start.size.height));
        let window = event_loop
            .create_window(attributes)
            .context("cannot open a window; --headless writes pictures without one")?;
        let screen = Screen::open(event_loop, Arc::new(window))?;
        let mut session = Session::new(screen, start.opening, start.outputs)?;
        session.show.clock.seek(start.time_s);
        session.show.clock.set_playing(!start.paused);
        self.session = Some(session);
        Ok(())
    }

    /// Ends with an error.
    fn fail(&mut self, event_loop: &ActiveEventLoop, error: anyhow::Error) {
        self.error.get_or_insert(error);
        event_loop.exit();
    }
}

impl ApplicationHandler for App {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        if let Err(error) = self.open(event_loop) {
            self.fail(event_loop, error);
        }
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let now_s = self.now_s();
        let Some(session) = &mut self.session else { return };
        let result = match &event {
            WindowEvent::CloseRequested => {
                event_loop.exit();
                Ok(())
            }
            WindowEvent::Occluded(hidden) => {
                self.hidden = *hidden;
                Ok(())
            }
            WindowEvent::Resized(size) => {
                // A minimised window has no size on some systems.
                self.hidden = size.width == 0 || size.height == 0;
                session.resize((size.width, size.height), now_s);
                Ok(())
            }
            WindowEvent::RedrawRequested if self.hidden => Ok(()),
            WindowEvent::RedrawRequested => session.draw(event_loop, now_s),
            _ => session.input(&event, now_s),
        };
        if let Err(error) = result {
            self.fail(event_loop, error);
        }
    }

    fn about_to_wait(&mut self, event_loop: &ActiveEventLoop) {
        let now_s = self.now_s();
        let Some(session) = &mut self.session else { return };
        if self.hidden {
            event_loop.set_control_flow(ControlFlow::WaitUntil(Instant::now() + 4 * IDLE));
            return;
        }
        if session.advance(now_s) {
            session.request_redraw();
        }
        event_loop.set_control_flow(ControlFlow::WaitUntil(Instant::now() + IDLE));
    }

    fn exiting(&mut self, _: &ActiveEventLoop) {
        // What is still being recorded is kept.
        let now_s = self.now_s();
        if let Some(session) = &mut self.session {
            session.stop_recording(now_s);
        }
        // Before the event loop goes, which surfaces hold on to.
        self.session = None;
    }
}
