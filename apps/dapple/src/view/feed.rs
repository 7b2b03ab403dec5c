//! Where frames come from: a server in this program, a recording, or nowhere.

use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError};

use anyhow::{Context, Result, anyhow, bail};
use dapple_scene::{PosedCamera, Scene, SceneHash};
use dapple_stream::{FrameHeader, Limits, Recording, Replay};

use super::fetch::Piece;
use super::live::{Live, Start};
use super::remote::Remote;
use crate::inspect::MAX_RECORDING_BYTES;
use crate::light::microseconds;
use crate::live::LinkState;
use crate::source::read_limited;

/// What lights the scene.
pub(super) enum Feed {
    /// Nothing: everything is open.
    None,
    /// A server.
    Live(Live),
    /// A recording.
    Recorded(Player),
    /// A live session of another program.
    Remote(Remote),
}

/// A recording that is played, and perhaps still fetched.
pub(super) struct Player {
    recording: Recording,
    replay: Replay,
    incoming: Option<Receiver<Piece>>,
    scene_hash: SceneHash,
    checked: bool,
}

impl Player {
    /// Plays a file, which must belong to the scene.
    pub(super) fn open(path: &Path, scene: &Scene) -> Result<Player> {
        let bytes = read_limited(path, MAX_RECORDING_BYTES)
            .with_context(|| format!("cannot read the recording {}", path.display()))?;
        let recording =
            Recording::parse(bytes, &Limits::default()).with_context(|| path.display().to_string())?;
        let mut player = Player::new(recording, None, scene);
        player.check().with_context(|| path.display().to_string())?;
        Ok(player)
    }

    /// Plays what comes.
    pub(super) fn incoming(pieces: Receiver<Piece>, scene: &Scene) -> Player {
        Player::new(Recording::new(&Limits::default()), Some(pieces), scene)
    }

    fn new(recording: Recording, incoming: Option<Receiver<Piece>>, scene: &Scene) -> Player {
        Player { recording, replay: Replay::new(0), incoming, scene_hash: scene.hash(), checked: false }
    }

    /// Whether the light is the scene's, once that is known.
    fn check(&mut self) -> Result<()> {
        if self.checked {
            return Ok(());
        }
        let Some(header) = self.recording.header() else { return Ok(()) };
        if header.scene_hash != self.scene_hash.0 {
            bail!(
                "the recording holds light of another scene ({}) than the one shown ({}): record this one, or show that \
                 one (a built-in scene with the same --detail)",
                SceneHash(header.scene_hash),
                self.scene_hash
            );
        }
        self.checked = true;
        Ok(())
    }

    /// Takes what has been fetched by now; with `wait`, all of it.
    fn fetch(&mut self, wait: bool) -> Result<()> {
        while let Some(incoming) = &self.incoming {
            let piece = if wait {
                incoming.recv().map_err(|_| TryRecvError::Disconnected)
            } else {
                incoming.try_recv()
            };
            match piece {
                Ok(Ok(bytes)) => {
                    self.recording.push(&bytes)?;
                    self.check()?;
                }
                Ok(Err(reason)) => {
                    self.incoming = None;
                    return Err(anyhow!(reason));
                }
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) => {
                    self.incoming = None;
                    self.recording.finish()?;
                }
            }
        }
        Ok(())
    }

    fn frames_to(&mut self, time_s: f64) -> Vec<Arc<[u8]>> {
        if self.recording.is_empty() || !self.checked {
            return Vec::new();
        }
        let frames = self.replay.frames_to(&self.recording, microseconds(time_s));
        frames.into_iter().map(Arc::from).collect()
    }
}

impl Feed {
    /// The frames that bring a viewer to `time_s`, as far as they are there. An error ends the feed; what was shown
    /// stays.
    pub(super) fn poll(&mut self, time_s: f64) -> Result<Vec<Arc<[u8]>>> {
        let failure = match self {
            // What a session brings is asked for by itself: it comes with more than frames.
            Feed::None | Feed::Remote(_) => None,
            Feed::Live(live) => {
                let frames = live.poll(time_s);
                match live.progress() {
                    Start::Failed(reason) => Some(anyhow!("{reason}")),
                    _ => return Ok(frames),
                }
            }
            Feed::Recorded(player) => match player.fetch(false) {
                Ok(()) => return Ok(player.frames_to(time_s)),
                Err(error) => Some(error),
            },
        };
        match failure {
            None => Ok(Vec::new()),
            Some(error) => {
                *self = Feed::None;
                Err(error)
            }
        }
    }

    /// Says how the viewer looks, in a picture of that aspect ratio.
    pub(super) fn look(&mut self, camera: &PosedCamera, aspect: f32) {
        match self {
            Feed::Live(live) => live.look(camera),
            Feed::Remote(remote) => remote.look(camera, aspect),
            Feed::None | Feed::Recorded(_) => {}
        }
    }

    /// The session, if it is one.
    pub(super) fn remote(&mut self) -> Option<&mut Remote> {
        match self {
            Feed::Remote(remote) => Some(remote),
            _ => None,
        }
    }

    /// Waits for all of a recording.
    pub(super) fn prepare(&mut self) -> Result<()> {
        match self {
            Feed::Recorded(player) => player.fetch(true),
            _ => Ok(()),
        }
    }

    /// The frames that bring a viewer to `time_s`, however long that takes.
    pub(super) fn wait_until(&mut self, time_s: f64, progress: &dyn Fn(&Start)) -> Result<Vec<Arc<[u8]>>> {
        match self {
            Feed::None | Feed::Remote(_) => Ok(Vec::new()),
            Feed::Live(live) => live.wait_until(time_s, progress),
            Feed::Recorded(player) => Ok(player.frames_to(time_s)),
        }
    }

    /// A viewer joins that holds nothing.
    pub(super) fn join(&mut self) {
        match self {
            Feed::None => {}
            Feed::Live(live) => live.join(),
            Feed::Recorded(player) => player.replay = Replay::new(0),
            Feed::Remote(remote) => remote.forget_light(),
        }
    }

    /// What is still being prepared, and the part of it that is done.
    pub(super) fn preparing(&self) -> Option<(&'static str, f32)> {
        match self {
            Feed::Live(live) => match live.progress() {
                Start::Doing(what, part) => Some((*what, *part)),
                _ => None,
            },
            Feed::Recorded(player) if player.incoming.is_some() => {
                let all_us = player.recording.header().map_or(0, |header| header.duration_us);
                Some(("fetching light", player.recording.loaded_us() as f32 / all_us.max(1) as f32))
            }
            _ => None,
        }
    }

    /// Seconds of scene time that a recording covers and that have come: both endless for a server.
    pub(super) fn extent_s(&self) -> Option<(f64, f64)> {
        let Feed::Recorded(player) = self else { return None };
        let header = player.recording.header()?;
        Some((header.duration_us as f64 * 1e-6, player.recording.loaded_us() as f64 * 1e-6))
    }

    /// Where the light comes from, for an overlay.
    pub(super) fn label(&self) -> String {
        match self {
            Feed::None => "no light".to_owned(),
            Feed::Live(live) => {
                format!("server here: {:.0} ms, {} traced", 1e3 * live.step_seconds, live.traced)
            }
            Feed::Remote(remote) => match remote.state() {
                LinkState::Connected => "live".to_owned(),
                LinkState::Connecting => "connecting".to_owned(),
                LinkState::Waiting(_, seconds) => format!("broken, again in {seconds:.1} s"),
                LinkState::Ended(_) => "ended".to_owned(),
            },
            Feed::Recorded(player) => match player.recording.header() {
                Some(header) if !header.name.is_empty() => format!("recording \"{}\"", header.name),
                _ => "recording".to_owned(),
            },
        }
    }
}

/// The group of a frame.
pub(super) fn group_of(frame: &[u8]) -> Option<u64> {
    FrameHeader::parse(frame, &Limits::default()).ok().map(|header| header.group)
}
