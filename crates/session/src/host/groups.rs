//! Shared streams cut into groups, for transports that let viewers join at the beginning of any of them.
//!
//! Light: whoever holds the snapshot of a group can take all that is in it, and goes on with the next group without its snapshot. State: every group stands by
//! itself.

use std::sync::Arc;

use super::{Arrival, Host, Link, Next, Outgoing, Shared, SharedLight};
use crate::{FromHost, Held};

/// A group begins no sooner after the one before, microseconds.
const SHORTEST_US: u64 = 1_000_000;

/// A group of light is no longer than this, microseconds: what nobody has asked for since then may have been forgotten on its way.
const LONGEST_US: u64 = 15_000_000;

/// Most messages of a group of light: some viewers take no more than 1024.
const MAX_LIGHT_MESSAGES: usize = 512;

/// Most messages of a group of state: so many are read by whoever joins.
const MAX_STATE_MESSAGES: usize = 64;

/// Without other light it is said this often that what is held is right, microseconds.
const TICK_EVERY_US: u64 = 250_000;

/// What comes next.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Piece<T> {
    /// A new group. Of light: its snapshot, of which nothing is in the group itself. Of state: its first message.
    Begin(T),
    /// More of the group.
    More(T),
    /// Nothing now: ask after the next step.
    Wait,
    /// Nothing any more but this: the host is being stopped.
    End(T),
}

/// The light of a rung.
#[derive(Debug)]
pub struct LightGroups {
    rung: usize,
    held: Option<Held>,
    began_us: u64,
    last_us: u64,
    snapshot_bytes: usize,
    bytes: usize,
    messages: usize,
}

impl LightGroups {
    /// Of a rung, 0 for the richest.
    pub fn new(rung: usize) -> LightGroups {
        LightGroups { rung, held: None, began_us: 0, last_us: 0, snapshot_bytes: 0, bytes: 0, messages: 0 }
    }

    /// What is to be written next.
    pub fn next(&mut self, host: &mut Host, now_us: u64) -> Piece<Vec<Arc<[u8]>>> {
        match host.next_shared(self.rung, self.held) {
            Shared::Wait => Piece::Wait,
            Shared::Snapshot(snapshot) => self.begin(snapshot, now_us),
            Shared::Delta(light) => {
                self.held = Some(light.held);
                self.more(light.messages, now_us)
            }
            // Asked for only now, so that none is made which is not used.
            Shared::UpToDate
                if self.is_due(now_us)
                    && let Some(held) = self.held
                    && let Some(snapshot) = host.shared_snapshot(self.rung, held) =>
            {
                self.begin(snapshot, now_us)
            }
            Shared::UpToDate => match host.tick() {
                Some(tick) if now_us.saturating_sub(self.last_us) >= TICK_EVERY_US => {
                    self.more(vec![tick.clone()], now_us)
                }
                _ => Piece::Wait,
            },
        }
    }

    /// Whoever joins must take the snapshot and the whole group: it should cost little more than the snapshot alone.
    fn is_due(&self, now_us: u64) -> bool {
        let lasted_us = now_us.saturating_sub(self.began_us);
        let is_long = self.bytes > self.snapshot_bytes / 4 + 4096 || self.messages >= MAX_LIGHT_MESSAGES;
        is_long && lasted_us >= SHORTEST_US || lasted_us >= LONGEST_US
    }

    fn begin(&mut self, snapshot: SharedLight, now_us: u64) -> Piece<Vec<Arc<[u8]>>> {
        let snapshot_bytes = length(&snapshot.messages);
        *self = LightGroups {
            held: Some(snapshot.held),
            began_us: now_us,
            last_us: now_us,
            snapshot_bytes,
            ..LightGroups::new(self.rung)
        };
        Piece::Begin(snapshot.messages)
    }

    fn more(&mut self, messages: Vec<Arc<[u8]>>, now_us: u64) -> Piece<Vec<Arc<[u8]>>> {
        self.last_us = now_us;
        self.bytes += length(&messages);
        self.messages += messages.len();
        Piece::More(messages)
    }
}

fn length(messages: &[Arc<[u8]>]) -> usize {
    messages.iter().map(|message| message.len()).sum()
}

/// The scene's state: a welcome, the whole of it, and what changes.
#[derive(Debug, Default)]
pub struct StateGroups {
    link: Option<Link>,
    began_us: u64,
    messages: usize,
}

impl StateGroups {
    /// What is to be written next. Of the arrival only the time counts.
    pub fn next(&mut self, host: &mut Host, arrival: &Arrival, now_us: u64) -> Piece<Arc<str>> {
        let is_due =
            self.messages >= MAX_STATE_MESSAGES && now_us.saturating_sub(self.began_us) >= SHORTEST_US;
        if is_due && let Some(link) = self.link.take() {
            host.leave(link, now_us);
        }
        let is_new = self.link.is_none();
        let link = *self.link.get_or_insert_with(|| host.observe(arrival.clone(), now_us));
        if is_new {
            (self.began_us, self.messages) = (now_us, 0);
        }
        match host.next(link, now_us) {
            Next::Send(Outgoing::Text(text)) => {
                self.messages += 1;
                if is_new { Piece::Begin(text) } else { Piece::More(text) }
            }
            Next::Send(Outgoing::Bytes(_)) | Next::Wait => Piece::Wait,
            Next::Close(refusal) => Piece::End(FromHost::Refused(refusal).to_text().into()),
        }
    }
}
