//! Light of one scene from several servers: which instances each lights, and their stores put together.

use std::sync::Arc;

use dapple_scene::Scene;
use dapple_store::charts::Cuts;
use dapple_store::points::{BentChange, Change, LayoutError, PointLayout, PointStore};
use dapple_stream::{
    Applied, Budget, Frame, FrameKind, Limits, Publisher, PublisherConfig, ReceiveError, Spending, Subscriber,
};
use dapple_trace::psao::generate::{GenerateError, GenerateParams, PointLayer};

use crate::streams::Stream;

/// A part of a scene's instances: those that one of several servers lights. All instances block rays in each of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Which, from 0.
    pub number: u32,
    /// Of how many.
    pub of: u32,
}

impl Shard {
    /// Most parts.
    pub const MOST: u32 = 256;

    /// Its instances, ascending: parts have about as many points. A function of scene and parameters alone, so servers need not agree
    /// on more than those.
    ///
    /// # Errors
    /// The density is no number above 0.
    pub fn instances(&self, scene: &Scene, params: &GenerateParams) -> Result<Vec<u32>, GenerateError> {
        let layer = PointLayer::new(scene, params)?;
        let points = |instance: &u32| layer.most_points(*instance as usize);
        let mut order: Vec<u32> = (0..scene.instances.len() as u32).collect();
        order.sort_by_key(|instance| (std::cmp::Reverse(points(instance)), *instance));
        // The largest first, each to who has least.
        let mut loads = vec![0u64; self.of.max(1) as usize];
        let mut own = Vec::new();
        for instance in order {
            let least = (0..loads.len()).min_by_key(|part| loads[*part]).expect("there is a part");
            loads[least] += points(&instance);
            if least as u32 == self.number {
                own.push(instance);
            }
        }
        own.sort_unstable();
        Ok(own)
    }
}

/// Why a part was not put into the whole. It is as it was before.
#[derive(Debug, thiserror::Error)]
pub enum MergeError {
    /// The frame could not be used.
    #[error(transparent)]
    Receive(#[from] ReceiveError),
    /// Its points do not fit those of the others: it lights other instances than its own, or with another density.
    #[error(transparent)]
    Layout(#[from] LayoutError),
}

/// Puts the stores of several servers together and publishes them as one.
pub struct Merger {
    shards: Vec<Part>,
    store: PointStore,
    cuts: Cuts,
    streams: Vec<Stream>,
    /// The layout is another one than the one that was published.
    is_new: bool,
}

/// One server's light.
struct Part {
    subscriber: Subscriber,
    /// Its instances that have points in the whole.
    instances: Vec<u32>,
}

impl Merger {
    /// Of so many servers of a scene; as [`crate::ServerConfig`] for the rest. It publishes nothing before the first has light.
    pub fn new(
        scene: &Arc<Scene>,
        shards: u32,
        config: PublisherConfig,
        bits_per_s: Option<u64>,
        limits: Limits,
    ) -> Merger {
        let hash = scene.hash().0;
        let part = || Part { subscriber: Subscriber::new(Some(hash), limits), instances: Vec::new() };
        let publisher = Publisher::new(hash, config);
        Merger {
            shards: (0..shards).map(|_| part()).collect(),
            store: PointStore::default(),
            cuts: Cuts::default(),
            streams: vec![Stream { publisher, budget: bits_per_s.map(Budget::new) }],
            is_new: false,
        }
    }

    /// A server begins anew, perhaps another one in its place: its next frame is a snapshot of any group. What came before stays until then.
    pub fn begin(&mut self, shard: u32) {
        self.shards[shard as usize].subscriber.forget();
    }

    /// Takes a frame of a server.
    ///
    /// # Errors
    /// It does not fit; a snapshot of that server mends it.
    pub fn receive(&mut self, shard: u32, frame: &[u8]) -> Result<(), MergeError> {
        let applied = self.shards[shard as usize].subscriber.receive(frame)?;
        let part = &self.shards[shard as usize];
        match applied {
            Applied::Ignored(_) => Ok(()),
            Applied::Changes(changes) => {
                let layout = part.subscriber.store().expect("changes are of a store").layout();
                let mut place = self.places_of(layout);
                let news = changes.iter().filter_map(|change| {
                    Some(Change { point: place(change.point)?, visibility: change.new })
                });
                let news: Vec<Change> = news.collect();
                let mut place = self.places_of(layout);
                let bent = part.subscriber.bent_changes().iter();
                let bent: Vec<BentChange> = bent
                    .filter_map(|change| Some(BentChange { point: place(change.point)?, ..*change }))
                    .collect();
                self.store.apply(&news).expect("they are points of the whole");
                self.store.apply_bent(&bent).expect("the whole has what its parts have");
                Ok(())
            }
            Applied::NewLayout | Applied::Sets { .. } => {
                let merged = self.replace(shard as usize);
                if merged.is_err() {
                    // What it says next would not fit either: it begins anew.
                    self.shards[shard as usize].subscriber.forget();
                }
                Ok(merged?)
            }
        }
    }

    /// Where in the whole the points of a part are, to be asked in their order.
    fn places_of(&self, part: &PointLayout) -> impl FnMut(u32) -> Option<u32> + use<> {
        let whole = self.store.layout();
        let first_of = |instance| whole.set_of_instance(instance).map(|set| set.first);
        let sets: Vec<_> = part
            .sets()
            .iter()
            .map(|set| (set.first..set.first + set.len() as u32, first_of(set.instance)))
            .collect();
        let mut at = 0;
        move |point| {
            while point >= sets[at].0.end {
                at += 1;
            }
            sets[at].1.map(|first| first + point - sets[at].0.start)
        }
    }

    /// Puts a part's sets in the place of those that it had.
    fn replace(&mut self, shard: usize) -> Result<(), LayoutError> {
        let part = &self.shards[shard];
        let of_part = part.subscriber.store().expect("it has just come");
        let whole = if self.store.layout().sets().is_empty() {
            of_part.clone()
        } else {
            self.store.with_sets(&part.instances, of_part)?
        };
        let cuts = part.subscriber.cuts().cloned().unwrap_or_default();
        self.cuts = self.cuts.with_sets(&part.instances, &cuts);
        self.store = whole;
        self.shards[shard].instances = self.shards[shard]
            .subscriber
            .store()
            .map_or_else(Vec::new, |store| store.layout().sets().iter().map(|set| set.instance).collect());
        self.is_new = true;
        Ok(())
    }

    /// Another stream of the same light, as [`crate::Server::add_stream`].
    pub fn add_stream(&mut self, bits_per_s: Option<u64>) {
        let publisher = self.streams[0].publisher.clone();
        self.streams.push(Stream { publisher, budget: bits_per_s.map(Budget::new) });
    }

    /// Whether the next frames bring or take points: all streams must be published then.
    pub fn is_new(&self) -> bool {
        self.is_new
    }

    /// Publishes what has come in all streams that `wants`; nothing for the others.
    pub fn publish(&mut self, sent_s: f64, wants: &dyn Fn(usize) -> bool) -> Vec<Option<Frame>> {
        let is_new = std::mem::take(&mut self.is_new);
        let (store, cuts) = (&self.store, &self.cuts);
        let has_points = !store.layout().sets().is_empty();
        let publish = |(number, stream): (usize, &mut Stream)| {
            if !has_points || !(is_new || wants(number)) {
                return None;
            }
            if is_new {
                stream.publisher.set_cuts(store.layout().clone(), cuts.clone());
            }
            stream.publish(store, &[], sent_s)
        };
        self.streams.iter_mut().enumerate().map(publish).collect()
    }

    /// The snapshot that brings a subscriber of a stream up to date; nothing before any light came.
    pub fn join_stream(&self, stream: usize) -> Option<Frame> {
        self.streams[stream].publisher.join()
    }

    /// Everything that has come.
    pub fn store(&self) -> &PointStore {
        &self.store
    }
}

impl Stream {
    /// Publishes a state of the light, by what it matters where (none for alike everywhere).
    pub(crate) fn publish(&mut self, store: &PointStore, coarseness: &[f32], sent_s: f64) -> Option<Frame> {
        let Stream { publisher, budget } = self;
        let Some(budget) = budget else { return publisher.publish(store) };
        let spending = Spending { most_bytes: Some(budget.allowance(sent_s)), coarseness };
        let frame = publisher.publish_within(store, &spending);
        let sent = frame.as_ref().filter(|frame| frame.kind == FrameKind::Delta);
        budget.spend(sent.map_or(0, |frame| frame.bytes.len()));
        frame
    }
}
