//! One viewer, as the host knows it.

use std::collections::VecDeque;
use std::sync::Arc;

use super::bucket::Bucket;
use super::ladder::{Entry, Rung, Step};
use super::pace::Pace;
use super::{Arrival, HostConfig, HostCounts};
use crate::{FromHost, Held, Look, LookCamera, PROTOCOL, Reason, Refusal, Role, Status, Welcome};

/// Most texts that wait to be sent; a viewer that lets more pile up is let go.
const MAX_WAITING_TEXTS: usize = 256;

/// Without other light a viewer hears this often that what it has is right, microseconds.
const TICK_EVERY_US: u64 = 250_000;

/// How often it hears how the host is, microseconds.
const STATUS_EVERY_US: u64 = 1_000_000;

/// After so long without progress light counts as lost where links may lose it, microseconds.
const LOST_AFTER_US: u64 = 1_000_000;

/// More than that light is still right says so: so many bytes from one look to the next are progress.
const PROGRESS_BYTES: u64 = 1024;

/// Shortest time between two repairs, microseconds: what was on its way before the first must not cause the second.
const REPAIR_EVERY_US: u64 = 250_000;

pub(super) struct Viewer {
    pub(super) key: String,
    /// It stands for all who share the state, and is no viewer itself.
    pub(super) is_observer: bool,
    /// Light, and the state unless it is an observer, come to it otherwise.
    shares: bool,
    pub(super) role: Role,
    pub(super) connection: u32,
    pub(super) left_us: Option<u64>,
    pub(super) last_message_us: u64,
    pub(super) messages: Bucket,
    pub(super) events: Bucket,
    /// Number of the last event that was taken, dealt with, and told to be.
    pub(super) events_taken: u32,
    pub(super) events_done: u32,
    /// Events of it that wait for a step.
    pub(super) waiting: u32,
    events_told: u32,
    pub(super) camera: Option<LookCamera>,
    /// Texts that wait.
    pub(super) control: VecDeque<Arc<str>>,
    /// Why it is let go.
    pub(super) expelled: Option<Refusal>,
    /// Version of the state that it was sent last.
    pub(super) state_sent: u64,
    pub(super) rung: usize,
    /// The rung that it asked for.
    asked: usize,
    pace: Pace,
    /// Bytes that were given out over this connection once the stream's first light was.
    first_given: Option<u64>,
    /// When it came, by the calendar and by the host's clock, microseconds.
    came_us: (u64, u64),
    light: Sent,
    look_number: u64,
    status_us: u64,
    round_trip_us: u64,
    queue_us: u64,
}

/// Light on its way.
#[derive(Default)]
struct Sent {
    is_reliable: bool,
    /// What it holds once everything has come.
    held: Option<Held>,
    /// A frame of which pieces are still to be sent.
    sending: Option<(Arc<Entry>, usize)>,
    /// Bytes given out over this connection, and those that came.
    given: u64,
    came: u64,
    /// Bytes given out up to a message, and when that was.
    on_its_way: VecDeque<(u64, u64)>,
    /// When light, or that there is none, was last given out, and when light was.
    last_us: u64,
    frame_us: u64,
    /// Breaks that the viewer told of and that were mended, when one was mended last, and when more last came.
    lost: u32,
    repaired_us: u64,
    progress_us: u64,
}

impl Viewer {
    pub(super) fn new(key: String, config: &HostConfig, now_us: u64) -> Viewer {
        Viewer {
            key,
            is_observer: false,
            shares: false,
            role: Role::View,
            connection: 0,
            left_us: None,
            last_message_us: now_us,
            messages: Bucket::new(config.messages_per_s, now_us),
            events: Bucket::new(config.events_per_s, now_us),
            events_taken: 0,
            events_done: 0,
            waiting: 0,
            events_told: 0,
            camera: None,
            control: VecDeque::new(),
            expelled: None,
            state_sent: 0,
            rung: 0,
            asked: 0,
            pace: Pace::new(now_us),
            first_given: None,
            came_us: (0, now_us),
            light: Sent::default(),
            look_number: 0,
            status_us: now_us,
            round_trip_us: 0,
            queue_us: 0,
        }
    }

    /// It is here, over a new connection.
    pub(super) fn connect(
        &mut self,
        role: Role,
        rung: usize,
        held: Option<Held>,
        arrival: &Arrival,
        now_us: u64,
    ) {
        let is_reliable = arrival.is_reliable;
        self.shares = arrival.shares;
        self.connection = self.connection.wrapping_add(1);
        (self.role, self.rung, self.left_us, self.expelled) = (role, rung, None, None);
        self.first_given = None;
        (self.asked, self.pace, self.came_us) = (rung, Pace::new(now_us), (arrival.unix_us, now_us));
        (self.last_message_us, self.state_sent) = (now_us, 0);
        if is_reliable {
            // Nothing of an earlier connection comes after this.
            self.look_number = 0;
        }
        self.control.clear();
        // What was taken and not dealt with yet still will be.
        self.events_told = self.events_done;
        self.light = Sent { held, is_reliable, last_us: now_us, progress_us: now_us, ..Sent::default() };
    }

    /// Whether it is connected, and counts as one who is.
    pub(super) fn is_here(&self) -> bool {
        self.left_us.is_none() && !self.is_observer
    }

    /// Whether light is sent over its connection.
    pub(super) fn takes_light(&self) -> bool {
        self.left_us.is_none() && !self.shares
    }

    /// Whether the scene's state is told over its connection.
    pub(super) fn is_told_state(&self) -> bool {
        self.is_observer || !self.shares
    }

    /// Puts it into a stream that suits its link better, if there is one; its light begins anew.
    pub(super) fn change_stream(&mut self, leanest: usize, now_us: u64) -> bool {
        if !self.takes_light() || self.light.sending.is_some() {
            return false;
        }
        let Some(rung) = self.pace.better(self.rung, self.asked, leanest, now_us) else { return false };
        (self.rung, self.light.held, self.first_given) = (rung, None, None);
        true
    }

    /// What it is told as it comes, or as its stream changes.
    pub(super) fn welcome(&mut self, id: u64, goes_on: bool, config: &HostConfig, now_us: u64) {
        let (unix_us, since_us) = self.came_us;
        self.tell(&FromHost::Welcome(Welcome {
            protocol: PROTOCOL,
            viewer: id,
            key: self.key.clone(),
            role: self.role,
            hz: config.hz,
            heard: self.events_done,
            goes_on,
            bits_per_s: config.rungs[self.rung],
            events_per_s: config.events_per_s,
            clock_us: now_us,
            unix_us: unix_us + now_us.saturating_sub(since_us),
            parts: match self.is_observer {
                true => config.parts.iter().map(|part| ranges(part)).collect(),
                false => Vec::new(),
            },
        }));
    }

    /// Lets it go: its connection learns why when it asks what to do next.
    pub(super) fn expel(&mut self, refusal: Refusal, now_us: u64) {
        self.expelled.get_or_insert(refusal);
        self.left_us.get_or_insert(now_us);
    }

    /// Queues a text.
    pub(super) fn tell(&mut self, message: &FromHost) {
        if self.left_us.is_some() {
            return;
        }
        if self.control.len() >= MAX_WAITING_TEXTS {
            let message = "the viewer does not take what it is sent: it was let go";
            self.expel(Refusal::new(Reason::TooMany, message), self.last_message_us);
            return;
        }
        self.control.push_back(message.to_text().into());
    }

    /// One of its events that waited has been dealt with, or (`None`) one was as it came.
    pub(super) fn deal(&mut self, number: Option<u32>) {
        if let Some(number) = number {
            self.waiting = self.waiting.saturating_sub(1);
            self.events_done = self.events_done.max(number);
        }
        if self.waiting == 0 {
            self.events_done = self.events_taken;
        }
    }

    /// Tells which events have been dealt with, if that is news.
    pub(super) fn answer_events(&mut self) {
        if self.events_told != self.events_done {
            self.events_told = self.events_done;
            self.tell(&FromHost::Heard { number: self.events_done });
        }
    }

    /// Tells it whether it is news or not: the answer may have been lost.
    pub(super) fn answer_events_again(&mut self) {
        self.events_told = self.events_done;
        if self.events_done > 0 {
            self.tell(&FromHost::Heard { number: self.events_done });
        }
    }

    /// Tells how the host is, if it is time.
    pub(super) fn tell_status(&mut self, status: &Status, now_us: u64) {
        if now_us.saturating_sub(self.status_us) >= STATUS_EVERY_US && self.control.is_empty() {
            self.status_us = now_us;
            let (round_trip_us, queue_us) = (self.round_trip_us, self.queue_us);
            self.tell(&FromHost::Status(Status { round_trip_us, queue_us, ..*status }));
        }
    }

    /// Takes a look; gives the age of the newest light as it came, microseconds.
    pub(super) fn look(&mut self, look: &Look, now_us: u64) -> Option<u32> {
        if look.number <= self.look_number {
            return None;
        }
        self.look_number = look.number;
        self.camera = look.camera;
        if look.state < self.state_sent && !self.light.is_reliable {
            // Either it is on its way, or it was lost: then it comes again with the next look.
            if now_us.saturating_sub(self.light.repaired_us) >= REPAIR_EVERY_US {
                self.state_sent = look.state;
            }
        }
        self.light.heard(look, now_us);
        self.pace.has_light |= self.first_given.is_some_and(|given| look.came >= given);
        // A stamp of the future is none of ours.
        let passed_us = now_us.checked_sub(look.heard_us).filter(|_| look.heard_us > 0)?;
        let round_us = passed_us.checked_sub(look.waited_us)?;
        self.round_trip_us = if self.round_trip_us == 0 {
            round_us
        } else {
            // The shortest of late: ages of light contain the step, this must not.
            round_us.min(self.round_trip_us + self.round_trip_us / 16 + 100)
        };
        Some(u32::try_from(round_us).unwrap_or(u32::MAX))
    }

    /// The next message of light, if it may have one now.
    pub(super) fn next_light(
        &mut self,
        rung: &mut Rung,
        tick: Option<&Arc<[u8]>>,
        counts: &mut HostCounts,
        config: &HostConfig,
        now_us: u64,
    ) -> Option<Arc<[u8]>> {
        if self.shares {
            return None;
        }
        let light = &mut self.light;
        if let Some((entry, next)) = &mut light.sending {
            let message = entry.messages[*next].clone();
            *next += 1;
            let is_whole = *next == entry.messages.len();
            light.frame_us = now_us;
            light.give(&message, now_us);
            if is_whole {
                light.sending = None;
                self.first_given.get_or_insert(light.given);
            }
            return Some(message);
        }
        let is_full = light.is_congested(config.window_us, now_us);
        self.pace.note(is_full, now_us);
        if is_full {
            return None;
        }
        let entry = match rung.step(light.held, light.is_reliable) {
            Step::UpToDate => {
                if now_us.saturating_sub(light.last_us) < TICK_EVERY_US {
                    return None;
                }
                let tick = tick?.clone();
                light.give(&tick, now_us);
                return Some(tick);
            }
            Step::Wait => return None,
            Step::Delta(entry) => {
                counts.deltas += 1;
                entry
            }
            Step::Snapshot(entry) => {
                counts.snapshots += 1;
                counts.jumps += u64::from(light.held.is_some());
                entry
            }
        };
        (light.held, light.frame_us) = (Some(entry.held), now_us);
        self.queue_us = now_us.saturating_sub(entry.made_us);
        let message = entry.messages[0].clone();
        light.give(&message, now_us);
        if entry.messages.len() > 1 {
            light.sending = Some((entry, 1));
        } else {
            self.first_given.get_or_insert(light.given);
        }
        Some(message)
    }
}

impl Sent {
    fn give(&mut self, message: &[u8], now_us: u64) {
        self.given += message.len() as u64;
        self.last_us = now_us;
        if self.is_reliable {
            self.on_its_way.push_back((self.given, now_us));
        }
    }

    /// Whether light that was given out long ago has not come yet.
    fn is_congested(&self, window_us: u64, now_us: u64) -> bool {
        self.on_its_way.front().is_some_and(|(_, since_us)| now_us.saturating_sub(*since_us) > window_us)
    }

    /// What a look says of the light that came.
    fn heard(&mut self, look: &Look, now_us: u64) {
        if look.came.saturating_sub(self.came) >= PROGRESS_BYTES {
            self.progress_us = now_us;
        }
        self.came = self.came.max(look.came);
        while self.on_its_way.front().is_some_and(|(given, _)| *given <= self.came) {
            self.on_its_way.pop_front();
        }
        let stale_us = now_us.saturating_sub(self.frame_us.max(self.progress_us));
        let is_silent = !self.is_reliable && look.held != self.held && stale_us > LOST_AFTER_US;
        let has_broken = look.lost > self.lost || is_silent;
        if has_broken && now_us.saturating_sub(self.repaired_us) >= REPAIR_EVERY_US {
            (self.lost, self.repaired_us) = (look.lost, now_us);
            // Where messages overtake each other one is surer to come whole than many in their order.
            self.held = look.held.filter(|_| self.is_reliable);
            self.sending = None;
        }
    }
}

/// Ascending numbers as ranges: the first of each, and the one after its last.
fn ranges(numbers: &[u32]) -> Vec<[u32; 2]> {
    let mut ranges: Vec<[u32; 2]> = Vec::new();
    for &number in numbers {
        match ranges.last_mut() {
            Some([_, end]) if *end == number => *end = number.saturating_add(1),
            _ => ranges.push([number, number.saturating_add(1)]),
        }
    }
    ranges
}
