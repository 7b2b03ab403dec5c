//! A recording → the frames that bring one subscriber to any time, forwards, backwards and round and round.

use super::Recording;
use crate::codec::{FrameKind, seal};

/// Plays a [`Recording`] to one subscriber, as a publisher would.
///
/// Subscribers take the newest group only, so a replay counts groups by itself: whenever it jumps it begins a new one,
/// with a recorded snapshot. To the subscriber that is a stream like any other.
#[derive(Clone, Debug)]
pub struct Replay {
    /// Group of the frames that are given.
    group: u64,
    /// Entry that comes next; the subscriber holds the state before it.
    next: usize,
}

impl Replay {
    /// A replay for a subscriber that holds nothing, or groups below `first_group` only.
    pub fn new(first_group: u64) -> Replay {
        Replay { group: first_group.min(u64::MAX >> 1), next: 0 }
    }

    /// The frames that bring a subscriber, which took all frames so far, to the state at `time_us` (microseconds).
    /// None where nothing changed. Forwards these are the frames in between, or a snapshot and what follows where
    /// one lies in between; backwards always the latter.
    ///
    /// `recording` must be the same every time, but may have grown.
    pub fn frames_to(&mut self, recording: &Recording, time_us: u64) -> Vec<Vec<u8>> {
        let wanted = recording.seek(time_us);
        if wanted.end == self.next {
            return Vec::new();
        }
        let start = if wanted.end < self.next { wanted.start } else { wanted.start.max(self.next) };
        self.next = wanted.end;
        (start..wanted.end).filter_map(|number| self.renumbered(recording, number)).collect()
    }

    /// The frame of an entry, in the group that is being given.
    fn renumbered(&mut self, recording: &Recording, number: usize) -> Option<Vec<u8>> {
        let entry = recording.entry(number)?;
        let header = entry.header;
        let payload = &entry.frame[header.header_bytes..][..header.payload_bytes];
        if header.kind == FrameKind::Snapshot {
            self.group += 1;
        }
        Some(seal(header.kind, self.group, header.epoch, payload))
    }
}
