//! Light and state for many at once, where something else fans them out: what one viewer would get who never falls behind.

use std::sync::Arc;

use super::ladder::{Entry, Step};
use super::viewer::Viewer;
use super::{Admission, Arrival, Host, Link, Shared, SharedLight};
use crate::{Held, Role};

impl Host {
    /// Lets in an observer: [`Host::next`] gives for it what all may hear who share the scene's state (a welcome to look, the state and its changes, how
    /// the host is), and no light. It is no viewer, need say nothing, and stays until [`Host::leave`].
    pub fn observe(&mut self, arrival: Arrival, now_us: u64) -> Link {
        let id = self.next_viewer;
        self.next_viewer += 1;
        let arrival = Arrival { key: String::new(), shares: true, ..arrival };
        let mut viewer = Viewer::new(arrival.key.clone(), &self.config, now_us);
        viewer.is_observer = true;
        self.viewers.insert(id, viewer);
        let admission = Admission { role: Role::View, rung: 0, held: None, goes_on: false };
        self.welcome(id, admission, &arrival, now_us)
    }

    /// What comes next in a shared stream after what was given out last (`None` at first).
    pub fn next_shared(&mut self, rung: usize, held: Option<Held>) -> Shared {
        match self.rungs[rung].step(held, true) {
            Step::UpToDate => Shared::UpToDate,
            Step::Wait => Shared::Wait,
            Step::Delta(entry) => Shared::Delta(self.share(&entry)),
            Step::Snapshot(entry) => Shared::Snapshot(self.share(&entry)),
        }
    }

    /// A snapshot of exactly what was given out last, for those who join there. If there is none, one is made with the next step.
    pub fn shared_snapshot(&mut self, rung: usize, held: Held) -> Option<SharedLight> {
        let entry = self.rungs[rung].snapshot_of(held)?;
        Some(self.share(&entry))
    }

    /// The last step's message for those who get no light with it; `None` before the first step.
    pub fn tick(&self) -> Option<&Arc<[u8]>> {
        self.tick.as_ref()
    }

    /// Says whether somebody takes a shared stream, who is no viewer of this host: then it counts as watched ([`Host::is_watched`]).
    pub fn set_shared(&mut self, rung: usize, is_taken: bool) {
        self.shared[rung] = is_taken;
    }

    fn share(&mut self, entry: &Entry) -> SharedLight {
        self.counts.bytes += entry.bytes as u64;
        SharedLight { held: entry.held, messages: entry.messages.clone() }
    }
}
