//! Light of one rung: the frames that viewers share, each kept once.

use std::collections::VecDeque;
use std::sync::Arc;

use dapple_stream::{Frame, FrameKind};

use crate::{Held, LightHead};

/// Frames are kept for viewers that are behind until they are longer together than a snapshot, but so many bytes at least.
const MIN_KEPT_BYTES: usize = 256 << 10;

/// Nobody jumps who is behind by less.
const MIN_JUMP_BYTES: usize = 16 << 10;

/// Most frames that are kept.
const MAX_KEPT_FRAMES: usize = 2048;

/// A frame as messages.
#[derive(Debug)]
pub(super) struct Entry {
    /// Epoch that it builds on; for a snapshot its own.
    pub(super) base: u64,
    pub(super) held: Held,
    pub(super) made_us: u64,
    pub(super) messages: Vec<Arc<[u8]>>,
    pub(super) bytes: usize,
}

/// One rung.
#[derive(Debug, Default)]
pub(super) struct Rung {
    /// What those hold who are up to date.
    now: Option<Held>,
    /// Frames that lead there, oldest first: each builds on the one before.
    kept: VecDeque<Arc<Entry>>,
    kept_bytes: usize,
    snapshot: Option<Arc<Entry>>,
    snapshot_bytes: usize,
    is_wanted: bool,
}

/// What brings a viewer on.
pub(super) enum Step {
    /// It holds the newest.
    UpToDate,
    /// This, which builds on what it holds.
    Delta(Arc<Entry>),
    /// This, whatever it holds.
    Snapshot(Arc<Entry>),
    /// A snapshot that has yet to be made.
    Wait,
}

impl Rung {
    pub(super) fn is_wanted(&self) -> bool {
        self.is_wanted
    }

    /// A frame for all who are up to date.
    pub(super) fn publish(&mut self, head: LightHead, frame: &Frame) {
        let held = Held { group: frame.group, epoch: frame.epoch };
        match self.now {
            Some(now) if frame.kind != FrameKind::Snapshot && now.group == frame.group => {
                let entry = Arc::new(entry(head, frame, now.epoch));
                self.kept_bytes += entry.bytes;
                self.kept.push_back(entry);
                while self.kept_bytes > self.snapshot_bytes.max(MIN_KEPT_BYTES)
                    || self.kept.len() > MAX_KEPT_FRAMES
                {
                    let Some(oldest) = self.kept.pop_front() else { break };
                    self.kept_bytes -= oldest.bytes;
                }
                self.now = Some(held);
            }
            _ => {
                (self.kept, self.kept_bytes) = (VecDeque::new(), 0);
                self.now = Some(held);
                self.snapshot = None;
                if frame.kind == FrameKind::Snapshot {
                    self.put_snapshot(head, frame);
                }
            }
        }
    }

    /// A snapshot of what those hold who are up to date.
    pub(super) fn put_snapshot(&mut self, head: LightHead, frame: &Frame) {
        let entry = Arc::new(entry(head, frame, frame.epoch));
        self.snapshot_bytes = entry.bytes;
        self.now.get_or_insert(entry.held);
        self.snapshot = Some(entry);
        self.is_wanted = false;
    }

    /// What brings on a viewer that holds this. Where messages overtake each other (`in_order` false) a snapshot must be the newest, so that nothing
    /// has to follow it.
    pub(super) fn step(&mut self, held: Option<Held>, in_order: bool) -> Step {
        let Some(now) = self.now else {
            self.is_wanted = true;
            return Step::Wait;
        };
        if held == Some(now) {
            return Step::UpToDate;
        }
        if let Some(held) = held.filter(|held| held.group == now.group)
            && let Some(at) = self.position(held.epoch)
            // Behind by more than a snapshot is long: it jumps.
            && self.bytes_from(at) <= self.jump_bytes()
        {
            return Step::Delta(self.kept[at].clone());
        }
        // One that is not quite new will do, as long as what came since is short.
        let usable = self.snapshot.clone().filter(|snapshot| {
            snapshot.held.group == now.group
                && (snapshot.held == now
                    || in_order
                        && self
                            .position(snapshot.held.epoch)
                            .is_some_and(|at| self.bytes_from(at) <= snapshot.bytes / 4 + 4096))
        });
        match usable {
            Some(snapshot) => Step::Snapshot(snapshot),
            None => {
                self.is_wanted = true;
                Step::Wait
            }
        }
    }

    /// A snapshot of just what is held; if there is none, one is wanted.
    pub(super) fn snapshot_of(&mut self, held: Held) -> Option<Arc<Entry>> {
        let snapshot = self.snapshot.clone().filter(|snapshot| snapshot.held == held);
        self.is_wanted |= snapshot.is_none();
        snapshot
    }

    /// Who is behind by more gets a snapshot instead.
    fn jump_bytes(&self) -> usize {
        // Before one was made its length is not known.
        if self.snapshot_bytes == 0 { MIN_KEPT_BYTES } else { self.snapshot_bytes.max(MIN_JUMP_BYTES) }
    }

    fn position(&self, epoch: u64) -> Option<usize> {
        self.kept.binary_search_by_key(&epoch, |entry| entry.base).ok()
    }

    fn bytes_from(&self, at: usize) -> usize {
        self.kept.iter().skip(at).map(|entry| entry.bytes).sum()
    }
}

fn entry(head: LightHead, frame: &Frame, base: u64) -> Entry {
    let messages = head.messages(&frame.bytes);
    let bytes = messages.iter().map(|message| message.len()).sum();
    let held = Held { group: frame.group, epoch: frame.epoch };
    Entry { base, held, made_us: head.made_us, messages, bytes }
}
