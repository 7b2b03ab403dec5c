//! Light of one scene from several servers: which instances each lights, and what is published of them.

use std::sync::Arc;

use dapple_scene::glam::Vec3;
use dapple_scene::{Aabb, Scene};
use dapple_store::points::PointStore;
use dapple_stream::{
    Applied, Budget, Frame, FrameKind, Limits, Parts, Publisher, PublisherConfig, ReceiveError, Spending,
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

    /// Its instances, ascending: one of [`Shard::all`].
    ///
    /// # Errors
    /// The density is no number above 0.
    pub fn instances(&self, scene: &Scene, params: &GenerateParams) -> Result<Vec<u32>, GenerateError> {
        let mut all = Shard::all(self.of, scene, params)?;
        Ok(if (self.number as usize) < all.len() {
            all.swap_remove(self.number as usize)
        } else {
            Vec::new()
        })
    }

    /// The instances of so many parts, each ascending. Parts have about as many points, and lie together, so that who sees a place needs few of them. A
    /// function of scene and parameters alone, so servers need not agree on more than those.
    ///
    /// # Errors
    /// The density is no number above 0.
    pub fn all(of: u32, scene: &Scene, params: &GenerateParams) -> Result<Vec<Vec<u32>>, GenerateError> {
        let layer = PointLayer::new(scene, params)?;
        let pose = scene.pose(0.0);
        let place = |instance: usize| {
            let bounds = scene.instance_bounds_world(&pose, instance);
            // What is nowhere at first may come to be anywhere.
            let center = if bounds.is_empty() { Vec3::ZERO } else { bounds.center() };
            Placed { instance: instance as u32, center, points: layer.most_points(instance) }
        };
        let mut placed: Vec<Placed> = (0..scene.instances.len()).map(place).collect();
        let mut parts = Vec::new();
        divide(&mut placed, of.clamp(1, Shard::MOST), &mut parts);
        Ok(parts)
    }
}

/// An instance, where it is at first, and how much it has to be lit.
struct Placed {
    instance: u32,
    center: Vec3,
    points: u64,
}

/// Halves and halves again until there are so many parts.
fn divide(instances: &mut [Placed], of: u32, parts: &mut Vec<Vec<u32>>) {
    if of <= 1 {
        let mut part: Vec<u32> = instances.iter().map(|placed| placed.instance).collect();
        part.sort_unstable();
        parts.push(part);
        return;
    }
    let (first, second) = (of / 2, of - of / 2);
    let extent = Aabb::from_points(instances.iter().map(|placed| placed.center));
    let edges = if instances.is_empty() { Vec3::ZERO } else { extent.max - extent.min };
    let longest = edges.max_element().max(f32::MIN_POSITIVE);
    let mut best = (f32::INFINITY, Cut::default());
    for axis in 0..3 {
        for backward in [false, true] {
            order(instances, axis, backward);
            let (at, off) = cut(instances, first, second);
            // Across the longer side parts are more compact, which is worth a little balance.
            let cost = off + COMPACTNESS * (1.0 - edges[axis] / longest);
            if cost < best.0 {
                best = (cost, Cut { axis, backward, at });
            }
        }
    }
    let Cut { axis, backward, at } = best.1;
    order(instances, axis, backward);
    let (low, high) = instances.split_at_mut(at);
    divide(low, first, parts);
    divide(high, second, parts);
}

/// How far a cut may be off its share, as a part of all, to go across a side much longer than another.
const COMPACTNESS: f32 = 0.1;

/// A plane, and how many instances come before it.
#[derive(Clone, Copy, Default)]
struct Cut {
    axis: usize,
    backward: bool,
    at: usize,
}

fn order(instances: &mut [Placed], axis: usize, backward: bool) {
    let key = |placed: &Placed| if backward { -placed.center[axis] } else { placed.center[axis] };
    instances.sort_by(|a, b| key(a).total_cmp(&key(b)).then(a.instance.cmp(&b.instance)));
}

/// After how many instances to cut so that points are shared as `first` to `second`, and how far off that is, as a part of all.
fn cut(instances: &[Placed], first: u32, second: u32) -> (usize, f32) {
    let total: u64 = instances.iter().map(|placed| placed.points).sum();
    let wanted = total * u64::from(first) / u64::from(first + second);
    // A part without instances would have nothing to do.
    let least = (first as usize).min(instances.len());
    let most = instances.len().saturating_sub(second as usize).max(least);
    let mut best = (least, u64::MAX);
    let mut before = 0;
    for (at, placed) in (1..).zip(instances) {
        before += placed.points;
        if (least..=most).contains(&at) && before.abs_diff(wanted) < best.1 {
            best = (at, before.abs_diff(wanted));
        }
    }
    (best.0, best.1 as f32 / total.max(1) as f32)
}

/// Puts the stores of several servers together and publishes them: as one, and each by itself for those who want some parts alone.
pub struct Merger {
    light: Parts,
    nothing: PointStore,
    streams: Vec<Stream>,
    /// The points are others than those that were published.
    is_new: bool,
    /// One a part, if parts are offered.
    parts: Vec<PartStream>,
    config: PublisherConfig,
    scene_hash: [u8; 32],
}

/// A part's light, published by itself.
struct PartStream {
    publisher: Publisher,
    is_new: bool,
}

impl Merger {
    /// Of the servers of a scene; as [`crate::ServerConfig`] for the rest. It publishes nothing before the first has light.
    pub fn new(
        scene: &Arc<Scene>,
        config: PublisherConfig,
        bits_per_s: Option<u64>,
        limits: Limits,
    ) -> Merger {
        let scene_hash = scene.hash().0;
        let publisher = Publisher::new(scene_hash, config);
        Merger {
            light: Parts::new(Some(scene_hash), limits),
            nothing: PointStore::default(),
            streams: vec![Stream { publisher, budget: bits_per_s.map(Budget::new) }],
            is_new: false,
            parts: Vec::new(),
            config,
            scene_hash,
        }
    }

    /// Publishes each of so many parts by itself too: as stream number [`Merger::streams`] and those that follow.
    pub fn offer_parts(&mut self, parts: u32) {
        let (hash, config) = (self.scene_hash, self.config);
        let part = |_| PartStream { publisher: Publisher::new(hash, config), is_new: false };
        self.parts = (0..parts).map(part).collect();
    }

    /// Streams of the whole.
    pub fn streams(&self) -> usize {
        self.streams.len()
    }

    /// A server begins anew, perhaps another one in its place: its next frame is a snapshot of any group. What came before stays until then.
    pub fn begin(&mut self, shard: u32) {
        self.light.begin(shard);
    }

    /// Takes a frame of a server.
    ///
    /// # Errors
    /// It does not fit; a snapshot of that server mends it.
    pub fn receive(&mut self, shard: u32, frame: &[u8]) -> Result<(), ReceiveError> {
        match self.light.receive(shard, frame)? {
            Applied::Ignored(_) | Applied::Changes(_) => {}
            Applied::NewLayout | Applied::Sets { .. } => {
                self.is_new = true;
                if let Some(part) = self.parts.get_mut(shard as usize) {
                    part.is_new = true;
                }
            }
        }
        Ok(())
    }

    /// Another stream of the same light, as [`crate::Server::add_stream`].
    pub fn add_stream(&mut self, bits_per_s: Option<u64>) {
        let publisher = self.streams[0].publisher.clone();
        self.streams.push(Stream { publisher, budget: bits_per_s.map(Budget::new) });
    }

    /// Whether the next frames bring or take points: all streams of the whole must be published then.
    pub fn is_new(&self) -> bool {
        self.is_new
    }

    /// Publishes what has come in all streams that `wants`; nothing for the others. Those of the whole come first, then those of parts, if any.
    pub fn publish(&mut self, sent_s: f64, wants: &dyn Fn(usize) -> bool) -> Vec<Option<Frame>> {
        let is_new = std::mem::take(&mut self.is_new);
        let light = &self.light;
        let whole = |(number, stream): (usize, &mut Stream)| {
            let store = light.store()?;
            if !(is_new || wants(number)) {
                return None;
            }
            if is_new {
                stream.publisher.set_cuts(store.layout().clone(), light.cuts().clone());
            }
            stream.publish(store, (&[], &[]), sent_s)
        };
        let mut frames: Vec<Option<Frame>> = self.streams.iter_mut().enumerate().map(whole).collect();
        let streams = frames.len();
        let part = |(number, part): (usize, &mut PartStream)| {
            let light = light.part(number as u32)?;
            // What is offered waits until somebody wants it: its publisher begins with all that there is then.
            if !wants(streams + number) {
                return None;
            }
            let store = light.store()?;
            if std::mem::take(&mut part.is_new) {
                part.publisher.set_cuts(store.layout().clone(), light.cuts().cloned().unwrap_or_default());
            }
            part.publisher.publish(store)
        };
        frames.extend(self.parts.iter_mut().enumerate().map(part));
        frames
    }

    /// The snapshot that brings a subscriber of a stream up to date; nothing before any light came.
    pub fn join_stream(&self, stream: usize) -> Option<Frame> {
        match self.streams.get(stream) {
            Some(stream) => stream.publisher.join(),
            None => self.parts.get(stream - self.streams.len())?.publisher.join(),
        }
    }

    /// Everything that has come.
    pub fn store(&self) -> &PointStore {
        self.light.store().unwrap_or(&self.nothing)
    }
}

impl Stream {
    /// Publishes a state of the light, by what it matters where (none for alike everywhere), and by how much values of lights may be off.
    pub(crate) fn publish(
        &mut self,
        store: &PointStore,
        (coarseness, light_tolerances): (&[f32], &[(u32, u8)]),
        sent_s: f64,
    ) -> Option<Frame> {
        let Stream { publisher, budget } = self;
        let Some(budget) = budget else {
            let spending = Spending { light_tolerances, ..Spending::default() };
            return publisher.publish_within(store, &spending);
        };
        let spending = Spending { most_bytes: Some(budget.allowance(sent_s)), coarseness, light_tolerances };
        let frame = publisher.publish_within(store, &spending);
        let sent = frame.as_ref().filter(|frame| frame.kind == FrameKind::Delta);
        budget.spend(sent.map_or(0, |frame| frame.bytes.len()));
        frame
    }
}
