//! The viewer's end: says hello, keeps the scene's state, puts light together, and knows what time it is.

mod backoff;
mod pending;
mod sight;
mod timing;

use std::collections::BTreeMap;
use std::sync::Arc;

use dapple_scene::{Edits, PosedCamera, Scene};

pub use timing::Latency;

use crate::light::{Assembled, Assembly};
use crate::{
    Event, FromHost, FromViewer, Held, Hello, LightHead, Look, LookCamera, MessageError, PROTOCOL, Refusal,
    Role, SceneClock, Status, Welcome,
};
use backoff::Backoff;
use pending::Pending;
use sight::Sight;
use timing::Timing;

/// Shortest time between two looks, microseconds.
const LOOK_EVERY_US: u64 = 100_000;

/// Shortest time between two looks that only say what has come: half of what a host waits for before it holds light back.
const RECEIPT_EVERY_US: u64 = 250_000;

/// Longest time between two looks: the host lets go whom it does not hear.
const ALIVE_EVERY_US: u64 = 1_000_000;

/// A hello that is not answered is said again after this, microseconds: links may lose it.
const HELLO_EVERY_US: u64 = 1_000_000;

/// What a viewer wants of a host.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GuestConfig {
    /// What gives it its role, where the host asks for that.
    pub token: Option<String>,
    /// Most bits of light a second; `None` (default): as many as there are.
    pub bits_per_s: Option<u64>,
    /// Longest frame that it takes, bytes; 0 (default) for as long as `dapple_stream::Limits` allow.
    pub max_frame_bytes: usize,
    /// Whether it takes the light in parts where it comes in some, and says which it needs. Default false.
    pub in_parts: bool,
    /// Spreads the times at which many viewers try again.
    pub seed: u64,
}

/// Why a conversation cannot go on.
#[derive(Debug, thiserror::Error)]
pub enum GuestError {
    /// What came is not understood.
    #[error("the host says what this viewer does not understand ({0}): use a viewer of the host's version")]
    Message(#[from] MessageError),
    /// Edits that do not fit the scene.
    #[error("the host changes what the scene does not have: {0}")]
    Edit(#[from] dapple_scene::EditError),
    /// The host said no.
    #[error("{0}")]
    Refused(Refusal),
}

/// What a message brought.
#[derive(Clone, Debug, PartialEq)]
pub enum News {
    /// Nothing to act on.
    Nothing,
    /// The host let it in; true if light goes on from what is held. If not, what is held stays to be looked at, and whoever holds it must take
    /// the next snapshot whatever its group is (`Subscriber::outdate`).
    Welcome(bool),
    /// The scene's state changed: see [`Guest::edits`] and [`Guest::clock`].
    State,
    /// A frame of light to be applied; then [`Guest::applied`] must be called. Empty where nothing has changed.
    Light {
        /// The part that it is of (`dapple_stream::Parts`); `None` where light comes as one.
        part: Option<u8>,
        /// The frame.
        frame: Vec<u8>,
    },
    /// One of its events changed nothing, and why.
    Rejected(String),
}

/// One viewer's end of a session. Times are microseconds of the viewer's own clock.
pub struct Guest {
    scene: Arc<Scene>,
    config: GuestConfig,
    hello_us: Option<u64>,
    welcome: Option<Welcome>,
    key: Option<String>,
    is_connected: bool,
    /// Whether the host has welcomed this very viewer over this connection.
    is_known: bool,
    edits: Edits,
    clock: SceneClock,
    version: u64,
    held: Option<Held>,
    /// Frames that have come in part, by part of the light.
    assemblies: BTreeMap<Option<u8>, Assembly>,
    /// What it sees of the parts of the light, if it comes in some.
    sight: Option<Sight>,
    pending: Pending,
    timing: Timing,
    backoff: Backoff,
    status: Status,
    newest: Option<LightHead>,
    look: Look,
    /// What was said in the last look, and when.
    said: Look,
    said_us: u64,
    heard_at_us: u64,
}

impl Guest {
    /// A viewer of a scene that has been loaded.
    pub fn new(scene: Arc<Scene>, config: GuestConfig) -> Guest {
        Guest {
            edits: Edits::new(&scene),
            scene,
            hello_us: None,
            welcome: None,
            key: None,
            is_connected: false,
            is_known: false,
            clock: SceneClock::default(),
            version: 0,
            held: None,
            assemblies: BTreeMap::new(),
            sight: None,
            pending: Pending::default(),
            timing: Timing::default(),
            backoff: Backoff::new(config.seed),
            status: Status::default(),
            newest: None,
            look: Look::default(),
            said: Look::default(),
            said_us: 0,
            heard_at_us: 0,
            config,
        }
    }

    /// There is a connection: the next message is a hello.
    pub fn connected(&mut self, now_us: u64) {
        (self.is_connected, self.hello_us, self.welcome) = (true, None, None);
        self.is_known = false;
        (self.look.came, self.look.lost, self.said_us) = (0, 0, now_us);
        (self.look.heard_us, self.heard_at_us) = (0, now_us);
        // Versions count anew with another host; what was changed stays until the state comes.
        self.version = 0;
        (self.assemblies, self.newest) = (BTreeMap::new(), None);
        (self.sight, self.look.parts) = (None, None);
        self.pending.connected();
    }

    /// The connection has broken; says after how long to try again, microseconds: longer each time, until one holds.
    pub fn disconnected(&mut self) -> u64 {
        self.is_connected = false;
        self.welcome = None;
        self.backoff.next_us()
    }

    /// Takes a text.
    ///
    /// # Errors
    /// The conversation cannot go on; what was held stays.
    pub fn receive_text(&mut self, text: &str) -> Result<News, GuestError> {
        Ok(match FromHost::parse(text)? {
            // That of a stream which many share: nobody's in particular.
            FromHost::Welcome(welcome) if welcome.key.is_empty() => {
                if self.is_known {
                    return Ok(News::Nothing);
                }
                self.backoff.reset();
                let goes_on = self.light_goes_on(&welcome);
                if self.config.in_parts && !welcome.parts.is_empty() {
                    self.sight = Some(Sight::new(&self.scene, &welcome.parts));
                }
                self.welcome = Some(welcome);
                News::Welcome(goes_on)
            }
            FromHost::Welcome(welcome) => {
                self.backoff.reset();
                self.is_known = true;
                if self.key.as_deref() != Some(&welcome.key) {
                    self.pending.renumber();
                }
                let goes_on = self.light_goes_on(&welcome);
                self.pending.heard(welcome.heard);
                self.key = Some(welcome.key.clone());
                self.welcome = Some(welcome);
                News::Welcome(goes_on)
            }
            FromHost::Refused(refusal) => return Err(GuestError::Refused(refusal)),
            FromHost::State { version, clock, edits } => {
                edits.check(&self.scene)?;
                // One that was overtaken on its way is old.
                if version <= self.version {
                    return Ok(News::Nothing);
                }
                (self.edits, self.version, self.clock) = (edits, version, clock);
                News::State
            }
            FromHost::Changes { from, to, clock, edits } => {
                if from != self.version {
                    // The next look says what it holds, and the host what is missing.
                    return Ok(News::Nothing);
                }
                let mut changed = self.edits.clone();
                for edit in &edits {
                    changed.apply(&self.scene, edit)?;
                }
                (self.edits, self.version, self.clock) = (changed, to, clock);
                News::State
            }
            FromHost::Heard { number } => {
                self.pending.heard(number);
                News::Nothing
            }
            FromHost::Rejected { number, message } => {
                self.pending.heard(number);
                News::Rejected(message)
            }
            FromHost::Status(mut status) => {
                if status.round_trip_us == 0 {
                    // One for all knows nothing of this viewer's way.
                    (status.round_trip_us, status.queue_us) =
                        (self.status.round_trip_us, self.status.queue_us);
                }
                self.status = status;
                self.timing.round_trip(status.round_trip_us);
                News::Nothing
            }
        })
    }

    /// Whether light goes on; if not, what is known of the stream before is of no use.
    fn light_goes_on(&mut self, welcome: &Welcome) -> bool {
        if !welcome.goes_on {
            self.held = None;
            self.timing = Timing::default();
        }
        welcome.goes_on
    }

    /// Takes bytes: a piece of light.
    ///
    /// # Errors
    /// The conversation cannot go on.
    pub fn receive_bytes(&mut self, bytes: &[u8], now_us: u64) -> Result<News, GuestError> {
        let (head, piece) = LightHead::parse(bytes)?;
        self.look.came += bytes.len() as u64;
        let most = match self.config.max_frame_bytes {
            0 => dapple_stream::Limits::default().max_frame_bytes,
            most => most,
        };
        // Frames of several parts may be on their way at once: together they may be as long as one.
        let others = self.assemblies.iter().filter(|(part, _)| **part != head.part);
        let others: usize = others.map(|(_, assembly)| assembly.progress().1).sum();
        let assembly = self.assemblies.entry(head.part).or_default();
        Ok(match assembly.push(head, piece, most.saturating_sub(others)) {
            Assembled::Part => News::Nothing,
            Assembled::Never if head.total as usize > most => {
                return Err(MessageError::TooLong { bytes: head.total as usize, limit: most }.into());
            }
            Assembled::Never => {
                return Err(MessageError::Light("a piece is not one of its frame's").into());
            }
            Assembled::Whole(head, frame) => {
                self.timing.light(&head, now_us);
                self.newest = Some(head);
                if head.stamp_us >= self.look.heard_us {
                    (self.look.heard_us, self.heard_at_us) = (head.stamp_us, now_us);
                }
                News::Light { part: head.part, frame }
            }
        })
    }

    /// Says what is held after a frame was applied, or that it did not fit.
    pub fn applied(&mut self, held: Option<Held>, did_fit: bool) {
        self.held = if did_fit { held } else { self.held };
        if !did_fit {
            self.look.lost += 1;
        }
    }

    /// What it holds is gone: a snapshot is needed.
    pub fn forget_light(&mut self) {
        self.held = None;
        self.look.lost += 1;
    }

    /// How it looks from now on.
    pub fn look(&mut self, camera: &PosedCamera, aspect: f32) {
        self.look.camera = Some(LookCamera::of(camera, aspect));
    }

    /// Asks for something to happen. It is said until the host has answered, over new connections too; a newer one of the same kind for the same
    /// thing takes the place of one that has not been said yet. False if too many wait already.
    pub fn send(&mut self, event: Event) -> bool {
        self.pending.push(event)
    }

    /// The next message to be said now, if any: ask until there is none. `None` while not connected.
    pub fn next(&mut self, now_us: u64) -> Option<String> {
        if !self.is_connected {
            return None;
        }
        if self.welcome.is_none() {
            if self.hello_us.is_some_and(|said_us| now_us.saturating_sub(said_us) < HELLO_EVERY_US) {
                return None;
            }
            self.hello_us = Some(now_us);
            return Some(FromViewer::Hello(self.hello()).to_text());
        }
        let per_s = self.welcome.as_ref().map_or(1, |welcome| welcome.events_per_s);
        if self.is_known
            && let Some((number, event)) = self.pending.next(now_us, per_s)
        {
            return Some(FromViewer::Event { number, event }.to_text());
        }
        self.next_look(now_us)
    }

    /// What it would say now to be let in.
    pub fn hello(&self) -> Hello {
        Hello {
            protocol: PROTOCOL,
            wire: dapple_stream::codec::VERSION,
            scene: self.scene.hash().0.iter().map(|byte| format!("{byte:02x}")).collect(),
            token: self.config.token.clone(),
            key: self.key.clone(),
            held: self.held,
            bits_per_s: self.config.bits_per_s,
        }
    }

    fn next_look(&mut self, now_us: u64) -> Option<String> {
        let since_us = now_us.saturating_sub(self.said_us);
        let is_news = self.look.camera != self.said.camera
            || self.look.lost != self.said.lost
            || self.version != self.said.state;
        let has_come = self.look.came != self.said.came || self.held != self.said.held;
        let is_due = is_news && since_us >= LOOK_EVERY_US
            || has_come && since_us >= RECEIPT_EVERY_US
            || since_us >= ALIVE_EVERY_US;
        if self.said.number > 0 && !is_due {
            return None;
        }
        self.look.number += 1;
        (self.look.held, self.look.state) = (self.held, self.version);
        self.look.waited_us = now_us.saturating_sub(self.heard_at_us);
        let time_s = self.scene_time_s(now_us);
        if let Some(sight) = &mut self.sight {
            let parts = sight.parts(self.look.camera.as_ref(), time_s, &self.edits, now_us);
            // What was on its way of others does not come any more.
            self.assemblies.retain(|part, _| part.is_none_or(|part| parts.contains(&part)));
            self.look.parts = Some(parts);
        }
        (self.said, self.said_us) = (self.look.clone(), now_us);
        Some(FromViewer::Look(self.look.clone()).to_text())
    }

    /// A last message for a host that is left for good.
    pub fn bye() -> String {
        FromViewer::Bye.to_text()
    }

    /// Everything that was changed of the scene.
    pub fn edits(&self) -> &Edits {
        &self.edits
    }

    /// Version of the state, 0 before it is known.
    pub fn version(&self) -> u64 {
        self.version
    }

    /// The scene's clock, by the host's.
    pub fn clock(&self) -> SceneClock {
        self.clock
    }

    /// The scene's time to be shown at a moment, seconds: that of the light which comes then. 0 before any came.
    pub fn scene_time_s(&self, now_us: u64) -> f64 {
        let shown_us = self.timing.shown_host_us(now_us);
        shown_us.map_or(self.clock.time_us, |host_us| self.clock.time_us(host_us)) as f64 * 1e-6
    }

    /// Seconds since the moment that the light which came last shows; `None` before any came.
    pub fn age_s(&self, now_us: u64) -> Option<f64> {
        self.timing.age_us(now_us).map(|age_us| age_us as f64 * 1e-6)
    }

    /// Where the time goes between the host's step and this viewer.
    pub fn latency(&self) -> Latency {
        self.timing.latency(&self.status)
    }

    /// The head of the light that came last; `None` before any came over this connection.
    pub fn newest(&self) -> Option<&LightHead> {
        self.newest.as_ref()
    }

    /// How the host was when it last said so.
    pub fn status(&self) -> &Status {
        &self.status
    }

    /// What the host said as it let the viewer in, while there is a connection.
    pub fn welcome(&self) -> Option<&Welcome> {
        self.welcome.as_ref()
    }

    /// What it may do; `None` before it was let in.
    pub fn role(&self) -> Option<Role> {
        self.welcome.as_ref().map(|welcome| welcome.role)
    }

    /// Whether events wait for an answer.
    pub fn has_pending(&self) -> bool {
        !self.pending.is_empty()
    }

    /// Bytes of an unfinished frame that have come, and all of it; zeros if there is none.
    pub fn progress(&self) -> (usize, usize) {
        let all = self.assemblies.values().map(Assembly::progress);
        all.fold((0, 0), |(came, total), (more, of)| (came + more, total + of))
    }
}
