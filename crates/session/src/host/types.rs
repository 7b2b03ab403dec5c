//! What a host is told, and what it tells those who run it.

use std::sync::Arc;

use dapple_scene::Edits;

use super::Access;
use crate::{Held, LightHead, Refusal};

/// Settings of a host.
#[derive(Clone, Debug, PartialEq)]
pub struct HostConfig {
    /// Updates a second, as it tells viewers.
    pub hz: f64,
    /// Most viewers at a time, those counted that may still come back. Default 2000.
    pub max_viewers: u32,
    /// Most events a second of one viewer, on average; four seconds' worth may come at once. Default 60.
    pub events_per_s: u32,
    /// Most messages a second of one viewer, on average; more end its connection. Default 150.
    pub messages_per_s: u32,
    /// After so long without a message a viewer is let go, microseconds. Default 15 s.
    pub silence_us: u64,
    /// For so long a viewer whose connection broke may come back and go on, microseconds. Default 60 s.
    pub resume_us: u64,
    /// Light is held back while light that was sent so long ago has not come yet, microseconds. Default 0.5 s.
    pub window_us: u64,
    /// Who may do what. By default everyone may do everything.
    pub access: Access,
    /// Streams of the same light under different budgets, most bits in any second; `None` is without one. A viewer gets the richest that is within
    /// what it asked for, or else the leanest. Default: one without a budget.
    pub rungs: Vec<Option<u64>>,
    /// Instances of each part that the light can be had in, where streams are shared ([`super::Host::next_shared`]): as many more rungs, after those of
    /// `rungs`. At most [`crate::MAX_PARTS`]. Default: none.
    pub parts: Vec<Vec<u32>>,
    /// Whether scene time runs at the start. Default true.
    pub playing: bool,
}

impl Default for HostConfig {
    fn default() -> Self {
        HostConfig {
            hz: 30.0,
            max_viewers: 2000,
            events_per_s: 60,
            messages_per_s: 150,
            silence_us: 15_000_000,
            resume_us: 60_000_000,
            window_us: 500_000,
            access: Access::default(),
            rungs: vec![None],
            parts: Vec::new(),
            playing: true,
        }
    }
}

/// One connection of one viewer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Link {
    /// The viewer.
    pub viewer: u64,
    /// Counts its connections.
    pub connection: u32,
}

/// What is known of a connection when a viewer joins over it.
#[derive(Clone, Debug)]
pub struct Arrival {
    /// A secret for the viewer, that nobody can guess, should it be a new one.
    pub key: String,
    /// Whether what is sent comes, once and in order, unless the connection breaks.
    pub is_reliable: bool,
    /// Whether it comes from a page of somebody else's: without a token it may look at most.
    pub is_foreign: bool,
    /// Whether it gets light and the scene's state from what all share (see [`super::Host::next_shared`]): then this connection carries only what is
    /// said to it alone.
    pub shares: bool,
    /// Microseconds since 1970.
    pub unix_us: u64,
}

/// Light for all who share a stream.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SharedLight {
    /// What is held after it.
    pub held: Held,
    /// The messages that carry it.
    pub messages: Vec<Arc<[u8]>>,
}

/// What comes next in a stream that is shared.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Shared {
    /// Nothing: what was given out last is the newest.
    UpToDate,
    /// Nothing yet: a snapshot is made with the next step.
    Wait,
    /// What builds on that which was given out last.
    Delta(SharedLight),
    /// What stands by itself.
    Snapshot(SharedLight),
}

/// A message to be sent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Outgoing {
    /// As text.
    Text(Arc<str>),
    /// As bytes.
    Bytes(Arc<[u8]>),
}

/// What a connection is to do now.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Next {
    /// Send this and ask again.
    Send(Outgoing),
    /// Ask again after the next step, or after the viewer's next message.
    Wait,
    /// Send the refusal and close.
    Close(Refusal),
}

/// What a step is to light.
#[derive(Clone, Debug, PartialEq)]
pub struct Tick {
    /// The host's clock, microseconds.
    pub stamp_us: u64,
    /// The scene's time, microseconds.
    pub scene_us: u64,
    /// Version of the scene's state.
    pub state: u64,
    /// What was changed of the scene, if that is not what it was in the step before.
    pub edits: Option<Edits>,
}

/// Sums for whoever watches the host.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct HostCounts {
    /// Viewers connected now.
    pub viewers: u32,
    /// Viewers ever welcomed.
    pub joined: u64,
    /// Of them, again after a broken connection.
    pub resumed: u64,
    /// Hellos refused.
    pub refused: u64,
    /// Connections ended by the host, for what a viewer did or did not do.
    pub expelled: u64,
    /// Events that changed something, and those that were rejected.
    pub events: u64,
    /// See `events`.
    pub rejected: u64,
    /// Snapshots given out, and frames that build on what a viewer has.
    pub snapshots: u64,
    /// See `snapshots`.
    pub deltas: u64,
    /// Of the snapshots, those to viewers that had fallen behind.
    pub jumps: u64,
    /// Bytes given out.
    pub bytes: u64,
}

impl Tick {
    pub(super) fn head(&self, made_us: u64) -> LightHead {
        LightHead {
            part: None,
            stamp_us: self.stamp_us,
            made_us: made_us.max(self.stamp_us),
            scene_us: self.scene_us,
            state: self.state,
            total: 0,
            offset: 0,
        }
    }
}
