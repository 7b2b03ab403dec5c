//! A live session of another program: its light and its scene's state, over a network.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel, sync_channel};

use anyhow::{Context, Result};
use dapple_scene::{Edits, PosedCamera, Scene};
use dapple_session::guest::Latency;
use dapple_session::{Event, Guest, GuestConfig, Held, News, Role, Status};
use tokio::sync::watch;

use crate::live::{Address, LinkState, SharedGuest, keep};

/// Most frames that wait to be applied; a window that is hidden for longer gets a snapshot when it is seen again.
const MAX_WAITING: usize = 4096;

/// A session that is kept up by a thread of its own until this is dropped.
pub(super) struct Remote {
    shared: Arc<SharedGuest>,
    frames: Receiver<Piece>,
    state: watch::Receiver<LinkState>,
    stop: watch::Sender<bool>,
    thread: Option<std::thread::JoinHandle<()>>,
    /// Version of the scene's state that was handed on last.
    version: u64,
    apply_s: f64,
    /// Frames came that nobody had room for.
    has_overflown: Arc<AtomicBool>,
    rejected: Receiver<String>,
}

/// What comes for the viewer.
pub(super) enum Piece {
    /// A frame of a part of the light, or of all of it.
    Frame(Option<u8>, Vec<u8>),
    /// What is held is another stream's from here on.
    Anew,
}

/// What an overlay says of a session.
pub(super) struct RemoteFigures {
    pub(super) role: Option<Role>,
    pub(super) age_s: Option<f64>,
    pub(super) latency: Latency,
    pub(super) status: Status,
}

impl Remote {
    /// Joins a session.
    pub(super) fn join(address: Address, scene: &Arc<Scene>, config: GuestConfig) -> Result<Remote> {
        let shared = Arc::new(SharedGuest::new(Guest::new(scene.clone(), config)));
        let (frame_sender, frames) = sync_channel(MAX_WAITING);
        let has_overflown = Arc::new(AtomicBool::new(false));
        let overflows = has_overflown.clone();
        let (rejected_sender, rejected) = channel();
        let (state_sender, state) = watch::channel(LinkState::Connecting);
        let (stop, stopped) = watch::channel(false);
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .context("cannot start the thread that receives")?;
        let thread_shared = shared.clone();
        let run = move || {
            // Who listens no more has ended; who does not listen now will hear of it.
            let hand_on = |piece| {
                if frame_sender.try_send(piece).is_err() {
                    overflows.store(true, Ordering::Relaxed);
                }
            };
            let on_news = |_: &mut Guest, news| match news {
                News::Light { part, frame } if !frame.is_empty() => hand_on(Piece::Frame(part, frame)),
                News::Welcome(false) => hand_on(Piece::Anew),
                News::Rejected(message) => drop(rejected_sender.send(message)),
                _ => {}
            };
            runtime.block_on(keep(&address, &thread_shared, &state_sender, stopped, on_news));
            // What it still asks of others is not waited for.
            runtime.shutdown_background();
        };
        let thread = std::thread::Builder::new()
            .name("receive".to_owned())
            .spawn(run)
            .context("cannot start the thread that receives")?;
        Ok(Remote {
            shared,
            frames,
            state,
            stop,
            thread: Some(thread),
            version: 0,
            apply_s: 0.0,
            has_overflown,
            rejected,
        })
    }

    /// Frames that have come.
    pub(super) fn take_frames(&mut self) -> Vec<Piece> {
        let mut frames: Vec<Piece> = self.frames.try_iter().collect();
        if self.has_overflown.swap(false, Ordering::Relaxed) {
            // What follows builds on what was dropped.
            self.shared.lock().forget_light();
            frames.push(Piece::Anew);
        }
        frames
    }

    /// Says what is held after frames were applied, or that one did not fit, and how long that took.
    pub(super) fn applied(&mut self, held: Option<Held>, did_fit: bool, seconds: f64) {
        self.apply_s += 0.1 * (seconds - self.apply_s);
        self.shared.lock().applied(held, did_fit);
    }

    /// What is held is gone.
    pub(super) fn forget_light(&mut self) {
        self.shared.lock().forget_light();
    }

    /// The scene's edits, if they are not those that were asked for last.
    pub(super) fn new_edits(&mut self) -> Option<Edits> {
        let guest = self.shared.lock();
        (guest.version() != self.version && guest.version() > 0).then(|| {
            self.version = guest.version();
            guest.edits().clone()
        })
    }

    /// The scene's time now, seconds, and whether it runs.
    pub(super) fn scene_time(&self) -> (f64, bool) {
        let guest = self.shared.lock();
        (guest.scene_time_s(self.shared.now_us()), guest.clock().playing)
    }

    pub(super) fn look(&mut self, camera: &PosedCamera, aspect: f32) {
        self.shared.lock().look(camera, aspect);
    }

    /// Asks for something to happen; says why it will not.
    pub(super) fn send(&mut self, event: Event) -> Result<(), &'static str> {
        let mut guest = self.shared.lock();
        match guest.role() {
            Some(Role::View) => return Err("this viewer may only look: --token gives it more rights"),
            None => return Err("not connected"),
            Some(Role::Interact) => {}
        }
        if guest.send(event) { Ok(()) } else { Err("too much waits for an answer") }
    }

    /// Why an event of this viewer changed nothing, if one did.
    pub(super) fn rejected(&mut self) -> Option<String> {
        self.rejected.try_iter().last()
    }

    pub(super) fn state(&self) -> LinkState {
        self.state.borrow().clone()
    }

    pub(super) fn figures(&self) -> RemoteFigures {
        let guest = self.shared.lock();
        RemoteFigures {
            role: guest.role(),
            age_s: guest.age_s(self.shared.now_us()),
            latency: Latency { apply_s: self.apply_s, ..guest.latency() },
            status: *guest.status(),
        }
    }
}

impl Drop for Remote {
    fn drop(&mut self) {
        self.stop.send_replace(true);
        if let Some(thread) = self.thread.take() {
            // It ends at once: whatever it waits for, it waits for this too.
            let _ = thread.join();
        }
    }
}
