//! Runs of up to 64 neighbouring points and what is remembered of them: one bit a point in each word.

use dapple_scene::{Aabb, Pose, Scene};
use dapple_store::points::PointLayout;
use glam::Vec3;

use super::motion::Near;
use crate::psao::generate::Anchor;

/// Points a cluster. Points are in Morton order, so a run is compact.
pub(super) const CLUSTER: u32 = 64;

/// Neighbouring points of one instance: found, chosen and traced together. Bit `i` of a word is point `first + i`.
#[derive(Clone, Debug)]
pub(super) struct Cluster {
    pub(super) instance: u32,
    pub(super) first: u32,
    pub(super) len: u8,
    /// The instance moved in the last step.
    pub(super) moving: bool,
    /// The instance moved since `bounds_world` was computed.
    stale: bool,
    /// A mover came or left in the last step.
    pub(super) touched: bool,
    /// Greatest difference from what was known, when last traced.
    pub(super) last_change: u8,
    /// The step in which `waiting` was filled.
    pub(super) since: u32,
    /// Points whose visibility may differ from what was last traced.
    pub(super) dirty: u64,
    /// Of these, the ones that have been so since `since`. What becomes dirty again after it was traced waits for the
    /// next turn, or points that change all the time would hold up their neighbours.
    pub(super) waiting: u64,
    /// Points to trace, and points to refine, in this step.
    pub(super) selected: u64,
    pub(super) refining: u64,
    bounds_world: Aabb,
    pub(super) memory: Option<Box<Memory>>,
}

/// What is kept of points that a mover can reach, as long as their own instance rests.
#[derive(Clone, Debug, Default)]
pub(super) struct Memory {
    /// Points that have a place in the world (a triangle without area gives none).
    placed: u64,
    /// Positions between the corners of the cluster's box, in 1/65535.
    places: Box<[[u16; 3]]>,
    /// Points whose mask holds.
    pub(super) valid: u64,
    /// Points that have all the rays they will get.
    pub(super) settled: u64,
    /// Directions that still instances block: some words a point. Empty until one is needed.
    pub(super) masks: Box<[u64]>,
    /// Rays against still instances, and how many of them are open; as `masks`, if points are refined at all.
    pub(super) refined: Box<[[u16; 2]]>,
}

impl Cluster {
    /// All clusters of a layout, in order of their points.
    pub(super) fn all(layout: &PointLayout) -> Vec<Cluster> {
        let mut clusters = Vec::new();
        for set in layout.sets() {
            let end = set.first + set.len() as u32;
            for first in (set.first..end).step_by(CLUSTER as usize) {
                clusters.push(Cluster {
                    instance: set.instance,
                    first,
                    len: (end - first).min(CLUSTER) as u8,
                    moving: false,
                    stale: true,
                    touched: false,
                    last_change: 0,
                    since: 0,
                    dirty: 0,
                    waiting: 0,
                    selected: 0,
                    refining: 0,
                    bounds_world: Aabb::EMPTY,
                    memory: None,
                });
            }
        }
        clusters.shrink_to_fit();
        clusters
    }

    /// Every point's bit.
    pub(super) fn everything(&self) -> u64 {
        u64::MAX >> (CLUSTER - u32::from(self.len))
    }

    /// The points' place in lists of all points.
    pub(super) fn range(&self) -> std::ops::Range<usize> {
        self.first as usize..self.first as usize + usize::from(self.len)
    }

    /// Around its points, as far as they are known; see [`Cluster::settle_down`].
    pub(super) fn bounds_world(&self) -> &Aabb {
        &self.bounds_world
    }

    pub(super) fn memory(&self) -> Option<&Memory> {
        self.memory.as_deref()
    }

    /// Marks points whose visibility may differ from now on.
    pub(super) fn mark(&mut self, points: u64, step: u32) {
        self.dirty |= points;
        if self.waiting == 0 && self.dirty != 0 {
            self.waiting = self.dirty;
            self.since = step;
        }
    }

    /// Its instance moves: nothing that was remembered holds.
    pub(super) fn set_off(&mut self) {
        self.moving = true;
        self.stale = true;
        self.memory = None;
    }

    /// Its instance rests: brings its bounds up to date if they are not.
    pub(super) fn settle_down(&mut self, scene: &Scene, pose: &Pose, anchors: &[Anchor]) {
        self.moving = false;
        if self.stale {
            let anchors = &anchors[self.range()];
            let posed = anchors.iter().filter_map(|a| a.pose(scene, pose, self.instance as usize));
            self.bounds_world = Aabb::from_points(posed.map(|p| p.position));
            self.stale = false;
        }
    }

    /// The memory of a cluster that rests, made if there is none.
    pub(super) fn remember(&mut self, scene: &Scene, pose: &Pose, anchors: &[Anchor]) -> &mut Memory {
        let (range, instance, bounds) = (self.range(), self.instance as usize, self.bounds_world);
        self.memory.get_or_insert_with(|| {
            let mut memory = Memory::default();
            let scale = 65535.0 / (bounds.max - bounds.min).max(Vec3::splat(f32::MIN_POSITIVE));
            memory.places = anchors[range]
                .iter()
                .enumerate()
                .map(|(i, anchor)| match anchor.pose(scene, pose, instance) {
                    Some(posed) => {
                        memory.placed |= 1 << i;
                        ((posed.position - bounds.min) * scale).round().to_array().map(|x| x as u16)
                    }
                    None => [0; 3],
                })
                .collect();
            Box::new(memory)
        })
    }

    /// Which points may see one of `boxes`; perhaps a few too many.
    pub(super) fn near(&mut self, scene: &Scene, pose: &Pose, anchors: &[Anchor], boxes: &[Near]) -> u64 {
        let bounds = self.bounds_world;
        let boxes: Vec<&Near> = boxes.iter().filter(|near| near.touches(&bounds)).collect();
        if boxes.is_empty() {
            return 0;
        }
        let step = (bounds.max - bounds.min) / 65535.0;
        // Of the last digit in places, and of rounding in the way there and back.
        let error_m = step.max_element() + 1e-6 * bounds.min.abs().max(bounds.max.abs()).max_element();
        let memory = self.remember(scene, pose, anchors);
        let mut points = 0;
        for (i, place) in memory.places.iter().enumerate() {
            let position = bounds.min + Vec3::from_array(place.map(f32::from)) * step;
            points |= u64::from(boxes.iter().any(|near| near.reaches(position, error_m))) << i;
        }
        points & memory.placed
    }

    /// Gives up what is remembered of some points.
    pub(super) fn forget(&mut self, points: u64) {
        if let Some(memory) = &mut self.memory {
            memory.valid &= !points;
            memory.settled &= !points;
        }
    }

    pub(super) fn bytes(&self) -> usize {
        let memory = self.memory.as_ref().map_or(0, |m| {
            size_of::<Memory>() + size_of_val(&*m.places) + size_of_val(&*m.masks) + size_of_val(&*m.refined)
        });
        size_of::<Cluster>() + memory
    }
}

impl Memory {
    /// Points that could have more rays than they have had.
    pub(super) fn unsettled(&self) -> u64 {
        self.placed & !self.settled
    }

    /// Makes room for masks of that many words, and for the refinement's counts.
    pub(super) fn make_room(&mut self, words: usize, refines: bool) {
        let points = self.places.len();
        if self.masks.is_empty() {
            self.masks = vec![0; points * words].into();
            self.refined = vec![[0; 2]; if refines { points } else { 0 }].into();
        }
    }
}

/// The indices of the bits that are set, ascending.
pub(super) fn bits(mut word: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = (word != 0).then(|| word.trailing_zeros() as usize);
        word &= word.wrapping_sub(1);
        bit
    })
}
