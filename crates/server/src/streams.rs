//! The same light under different budgets of bits.

use dapple_store::points::PointStore;
use dapple_stream::{Budget, Frame, Publisher, Spending};
use dapple_trace::psao::update::ConvexVolume;

use crate::{Server, lit};

/// One publisher and what it may spend.
#[derive(Clone)]
pub(crate) struct Stream {
    pub(crate) publisher: Publisher,
    pub(crate) budget: Option<Budget>,
}

impl Server {
    /// Another stream of the same light, under another budget; gives its number. [`Server::step_at`] publishes stream 0 alone; the others are
    /// published by [`Server::publish_stream`], as often as anyone needs it, but in every step in which points come or go.
    pub fn add_stream(&mut self, bits_per_s: Option<u64>) -> usize {
        // It begins with what stream 0 holds, and goes its own way from there.
        let publisher = self.streams[0].publisher.clone();
        self.streams.push(Stream { publisher, budget: bits_per_s.map(Budget::new) });
        self.streams.len() - 1
    }

    /// How many streams there are.
    pub fn streams(&self) -> usize {
        self.streams.len()
    }

    /// Publishes what was traced in a stream, with a budget that goes by `sent_s` (seconds, never falling) and is spent by what viewers see.
    /// Nothing where there is nothing to say.
    pub fn publish_stream(&mut self, stream: usize, sent_s: f64, interest: &[ConvexVolume]) -> Option<Frame> {
        let is_limited = self.streams[stream].budget.is_some();
        let coarseness =
            if is_limited { self.updater.coarseness(interest, Spending::STRETCH) } else { Vec::new() };
        let Some(lights) = &self.lights else {
            return self.streams[stream].publish(self.updater.store(), (&coarseness, &[]), sent_s);
        };
        let held = self.streams[stream].publisher.store().and_then(PointStore::lights);
        let tolerances = held
            .filter(|held| held.points() == lights.values().points())
            .map_or_else(Vec::new, |held| lights.tolerances(held, &self.scene, &self.pose));
        let store = lit(&self.updater, Some(lights));
        self.streams[stream].publish(&store, (&coarseness, &tolerances), sent_s)
    }

    /// The snapshot that brings a subscriber of a stream up to date. Encoded at most once an update.
    pub fn join_stream(&self, stream: usize) -> Option<Frame> {
        self.streams[stream].publisher.join()
    }

    /// From now on deltas of stream 0 take at most so many bits in any second; `None`: as many as they need.
    pub fn set_bits_per_s(&mut self, bits_per_s: Option<u64>) {
        let budget = &mut self.streams[0].budget;
        *budget = bits_per_s.map(|bits| match budget.take() {
            Some(budget) => budget.with_bits_per_s(bits),
            None => Budget::new(bits),
        });
    }
}
