//! Events that the host has not answered yet.

use std::collections::VecDeque;

use dapple_scene::Edit;

use crate::Event;

/// Most events that wait.
const MAX_PENDING: usize = 256;

/// What was said and not answered is said again after this, microseconds.
const AGAIN_US: u64 = 1_000_000;

/// Most events under way at a time.
const MAX_UNDER_WAY: usize = 64;

/// Numbered, until they are answered.
#[derive(Debug)]
pub(super) struct Pending {
    events: VecDeque<(u32, Event)>,
    /// Number of the next new event.
    next_number: u32,
    /// Of the events in order, how many have been said since `said_us`.
    said: usize,
    said_us: u64,
    /// When the next may be said.
    free_us: u64,
}

impl Default for Pending {
    fn default() -> Self {
        Pending { events: VecDeque::new(), next_number: 1, said: 0, said_us: 0, free_us: 0 }
    }
}

impl Pending {
    pub(super) fn push(&mut self, event: Event) -> bool {
        if self.events.len() > self.said
            && let Some((_, last)) = self.events.back_mut()
            && supersedes(&event, last)
        {
            *last = event;
            return true;
        }
        if self.events.len() >= MAX_PENDING {
            return false;
        }
        self.events.push_back((self.next_number, event));
        self.next_number += 1;
        true
    }

    /// Everything has to be said again.
    pub(super) fn connected(&mut self) {
        self.said = 0;
    }

    /// The host does not know this viewer: what is left counts from 1.
    pub(super) fn renumber(&mut self) {
        for (number, (of_event, _)) in (1..).zip(&mut self.events) {
            *of_event = number;
        }
        self.next_number = self.events.len() as u32 + 1;
    }

    /// Events up to this number are answered.
    pub(super) fn heard(&mut self, number: u32) {
        while self.events.front().is_some_and(|(first, _)| *first <= number) {
            self.events.pop_front();
            self.said = self.said.saturating_sub(1);
        }
        // A host that goes on from before may know of more than is left here.
        self.next_number = self.next_number.max(number.saturating_add(1));
    }

    /// The next to be said, no more than so many a second: what is said too fast would be rejected.
    pub(super) fn next(&mut self, now_us: u64, per_s: u32) -> Option<(u32, Event)> {
        let apart_us = 1_000_000 / u64::from(per_s.max(1));
        // Half a second's worth may be said at once.
        self.free_us = self.free_us.max(now_us.saturating_sub(500_000));
        if self.free_us > now_us {
            return None;
        }
        let next = self.next_unpaced(now_us)?;
        self.free_us += apart_us;
        Some(next)
    }

    fn next_unpaced(&mut self, now_us: u64) -> Option<(u32, Event)> {
        if self.said > 0 && now_us.saturating_sub(self.said_us) >= AGAIN_US {
            self.said = 0;
        }
        if self.said >= MAX_UNDER_WAY {
            return None;
        }
        let next = self.events.get(self.said)?.clone();
        self.said += 1;
        self.said_us = now_us;
        Some(next)
    }

    pub(super) fn is_empty(&self) -> bool {
        self.events.is_empty()
    }
}

/// Whether of two events one after the other the first does not matter.
fn supersedes(event: &Event, before: &Event) -> bool {
    match (event, before) {
        (
            Event::Edit { change: Edit::Place { node: a, .. } },
            Event::Edit { change: Edit::Place { node: b, .. } },
        ) => a == b,
        (
            Event::Edit { change: Edit::Light { light: a, .. } },
            Event::Edit { change: Edit::Light { light: b, .. } },
        ) => a == b,
        (Event::Seek { .. }, Event::Seek { .. }) => true,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_are_said_until_they_are_heard() {
        let mut pending = Pending::default();
        for _ in 0..3 {
            assert!(pending.push(Event::Play));
        }
        let said: Vec<u32> =
            std::iter::from_fn(|| pending.next_unpaced(0)).map(|(number, _)| number).collect();
        assert_eq!(said, [1, 2, 3]);
        pending.heard(1);
        assert!(pending.next_unpaced(AGAIN_US - 1).is_none());
        assert_eq!(pending.next_unpaced(AGAIN_US).unwrap().0, 2);
        pending.connected();
        assert_eq!(pending.next_unpaced(AGAIN_US).unwrap().0, 2);
        pending.renumber();
        pending.connected();
        assert_eq!(pending.next_unpaced(AGAIN_US).unwrap().0, 1);
        pending.heard(2);
        assert!(pending.is_empty());
        assert!(pending.push(Event::Pause));
        assert_eq!(pending.next_unpaced(0).unwrap().0, 3);
    }

    #[test]
    fn of_a_drag_that_waits_only_the_end_is_said() {
        let mut pending = Pending::default();
        for time in 0..1000 {
            assert!(pending.push(Event::Seek { time_s: f64::from(time) }));
        }
        assert_eq!(pending.next_unpaced(0), Some((1, Event::Seek { time_s: 999.0 })));
        // What has been said stays as it is.
        assert!(pending.push(Event::Seek { time_s: 1.0 }));
        assert_eq!(pending.next_unpaced(0), Some((2, Event::Seek { time_s: 1.0 })));
        let taken = (0..1000).filter(|i| pending.push(if i % 2 == 0 { Event::Play } else { Event::Pause }));
        assert_eq!(taken.count(), MAX_PENDING - 2);
    }

    #[test]
    fn events_are_said_no_faster_than_they_are_taken() {
        let mut pending = Pending::default();
        let mut said = 0;
        for ms in 0..10_000u64 {
            pending.push(if ms % 2 == 0 { Event::Play } else { Event::Pause });
            while let Some((number, _)) = pending.next(1_000_000 + ms * 1000, 60) {
                said += 1;
                pending.heard(number);
            }
        }
        assert!((595..=635).contains(&said), "{said} in ten seconds");
    }
}
