//! A link with faults, one direction of it: what is put in comes out later, twice, in another order, or not at all.

use std::collections::BTreeMap;

/// What can go wrong. The default is a good link.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Faults {
    /// Part of messages that are lost, in thousandths.
    pub(super) loss: u32,
    /// Part that comes twice, in thousandths.
    pub(super) duplicates: u32,
    /// Shortest time on the way.
    pub(super) delay_us: u64,
    /// Up to so much longer, each message for itself: they overtake each other.
    pub(super) jitter_us: u64,
    /// Bytes a second that fit through; 0 for any number.
    pub(super) bytes_per_s: u64,
    /// What comes, comes once and in order, as over TCP.
    pub(super) is_ordered: bool,
}

/// What did go wrong.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Happened {
    pub(super) lost: u32,
    pub(super) twice: u32,
    pub(super) overtaken: u32,
    pub(super) cut: u32,
}

/// Splitmix64.
#[derive(Clone, Debug)]
pub(super) struct Random(pub(super) u64);

impl Random {
    pub(super) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    pub(super) fn below(&mut self, n: u64) -> u64 {
        self.bits() % n.max(1)
    }
}

/// Bytes that a full link takes in beyond what has gone through, as a socket's buffer does.
const BUFFER_US: u64 = 100_000;

#[derive(Clone, Debug)]
pub(super) struct FaultyLink<M> {
    faults: Faults,
    random: Random,
    /// By time of arrival and number.
    on_its_way: BTreeMap<(u64, u64), M>,
    sent: u64,
    delivered: u64,
    /// When the last byte that was put in has gone through.
    busy_until_us: u64,
    last_arrival_us: u64,
    pub(super) happened: Happened,
}

impl<M: Clone> FaultyLink<M> {
    pub(super) fn new(faults: Faults, seed: u64) -> FaultyLink<M> {
        FaultyLink {
            faults,
            random: Random(seed),
            on_its_way: BTreeMap::new(),
            sent: 0,
            delivered: 0,
            busy_until_us: 0,
            last_arrival_us: 0,
            happened: Happened::default(),
        }
    }

    /// From now on so many bytes a second fit through; 0 for any number.
    pub(super) fn set_width(&mut self, bytes_per_s: u64) {
        self.faults.bytes_per_s = bytes_per_s;
    }

    /// Whether it takes another message now.
    pub(super) fn has_room(&self, now_us: u64) -> bool {
        self.busy_until_us <= now_us + BUFFER_US
    }

    pub(super) fn put(&mut self, message: M, bytes: usize, now_us: u64) {
        if let Some(takes_us) = (bytes as u64 * 1_000_000).checked_div(self.faults.bytes_per_s) {
            self.busy_until_us = self.busy_until_us.max(now_us) + takes_us;
        }
        let through_us = self.busy_until_us.max(now_us);
        if self.random.below(1000) < u64::from(self.faults.loss) && !self.faults.is_ordered {
            self.happened.lost += 1;
            return;
        }
        let twice = self.random.below(1000) < u64::from(self.faults.duplicates) && !self.faults.is_ordered;
        self.happened.twice += u32::from(twice);
        for _ in 0..1 + u32::from(twice) {
            let mut arrival_us = through_us + self.faults.delay_us + self.random.below(self.faults.jitter_us);
            if self.faults.is_ordered {
                arrival_us = arrival_us.max(self.last_arrival_us);
            } else if arrival_us < self.last_arrival_us {
                self.happened.overtaken += 1;
            }
            self.last_arrival_us = self.last_arrival_us.max(arrival_us);
            self.on_its_way.insert((arrival_us, self.sent), message.clone());
            self.sent += 1;
        }
    }

    /// The next message that has arrived.
    pub(super) fn take(&mut self, now_us: u64) -> Option<M> {
        let (&key, _) = self.on_its_way.range(..=(now_us, u64::MAX)).next()?;
        self.delivered += 1;
        self.on_its_way.remove(&key)
    }

    /// The connection breaks: what is on its way is gone.
    pub(super) fn cut(&mut self) {
        self.happened.cut += 1;
        self.on_its_way.clear();
        (self.busy_until_us, self.last_arrival_us) = (0, 0);
    }
}
