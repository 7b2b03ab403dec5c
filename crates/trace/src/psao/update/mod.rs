//! Server update ([Neff2023] sec. 3.3): traces the points that a mover can affect, and reports what changed.
//!
//! Takes the scene's pose and a tracer brought up to it; returns the [`Change`](dapple_store::points::Change)s.
//! A step has two halves: [`Updater::select`] finds and ranks, [`Updater::trace_selected`] traces.

mod bent;
mod clusters;
mod interest;
mod motion;
mod patterns;
mod report;
mod select;
mod spawn;
mod trace;

#[cfg(test)]
mod tests;

use std::sync::Arc;

use dapple_scene::{Aabb, Pose, Scene};
use dapple_store::points::{PointLayout, PointStore};
use glam::Vec3;
use rayon::prelude::*;

use super::generate::{Anchor, GeneratedPoints};
use crate::Tracer;
use clusters::Cluster;
pub use interest::ConvexVolume;
use motion::Motion;
use patterns::Patterns;
pub use report::{StepCounts, StepInput, UpdateReport};
use spawn::Spawn;
use trace::{Context, PointLight, Scratch, Traced};

/// Most rays of a point at rest.
const MAX_RAYS_STILL: u32 = 1024;

/// How visibility is traced.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UpdateParams {
    /// Rays a point, 1 … 256, always in the same directions relative to the point's surface. Default 64.
    pub rays: u32,
    /// Rays that a point gets in time when no mover is near, `rays` … 1024; 0 (default): no more than `rays`. Steps double
    /// its rays one point at a time, with what their budget leaves over; without a budget all points at once, which takes
    /// as long as the start.
    pub rays_still: u32,
    /// Occlusion distance in metres, > 0. Default 0.6 ([Neff2023] sec. 4).
    pub radius_m: f32,
    /// Whether points get bent normals, from the same `rays` rays: the mean direction of those that are open. Default false.
    pub bent_normals: bool,
}

impl Default for UpdateParams {
    fn default() -> Self {
        UpdateParams { rays: 64, rays_still: 0, radius_m: 0.6, bent_normals: false }
    }
}

impl UpdateParams {
    /// Finds whether the parameters lie in their ranges.
    ///
    /// # Errors
    /// The first one that does not.
    pub fn check(&self) -> Result<(), UpdateError> {
        let UpdateParams { rays, rays_still, radius_m, .. } = *self;
        if !(1..=256).contains(&rays) {
            return Err(UpdateError::BadRays(rays));
        }
        if rays_still != 0 && !(rays..=MAX_RAYS_STILL).contains(&rays_still) {
            return Err(UpdateError::BadRaysStill { rays_still, rays });
        }
        if !(radius_m.is_finite() && radius_m > 0.0) {
            return Err(UpdateError::BadRadius(radius_m));
        }
        Ok(())
    }

    /// Whether points at rest get more rays.
    fn refines(&self) -> bool {
        self.rays_still > self.rays
    }

    fn mask_words(&self) -> usize {
        self.rays.div_ceil(64) as usize
    }
}

/// The server's memory of all points: anchors, the visibility that was last traced, and what still instances block.
#[derive(Clone, Debug)]
pub struct Updater {
    params: UpdateParams,
    anchors: Vec<Anchor>,
    store: PointStore,
    patterns: Patterns,
    clusters: Vec<Cluster>,
    /// Points that have been laid and are not all traced yet; what was laid first comes first.
    spawns: Vec<Spawn>,
    motion: Motion,
    /// Number of the last step; wraps.
    step: u32,
    /// There is work even if nothing moves.
    restless: bool,
    /// Of the step that was selected.
    counts: StepCounts,
}

/// Why an updater could not be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum UpdateError {
    /// Number of rays out of range.
    #[error("rays a point is {0}, must be 1 to 256")]
    BadRays(u32),
    /// Number of rays at rest out of range.
    #[error(
        "rays of a point at rest is {rays_still}, must be 0 (no more than others) or {rays} to {MAX_RAYS_STILL}"
    )]
    BadRaysStill {
        /// What it was.
        rays_still: u32,
        /// Rays of any point.
        rays: u32,
    },
    /// Radius out of range.
    #[error("occlusion radius is {0} m, must be positive and finite")]
    BadRadius(f32),
}

impl Updater {
    /// Traces every point at `pose`. `tracer` must be up to date with it. `progress` is called with points done.
    pub fn new(
        scene: &Scene,
        pose: &Pose,
        tracer: &Tracer,
        points: GeneratedPoints,
        params: UpdateParams,
        progress: &(dyn Fn(usize) + Sync),
    ) -> Result<Updater, UpdateError> {
        params.check()?;
        let GeneratedPoints { layout, mut anchors, .. } = points;
        anchors.shrink_to_fit();
        let mut clusters = Cluster::all(&layout);
        clusters.par_iter_mut().for_each(|c| c.settle_down(scene, pose, &anchors));
        let mut updater = Updater {
            params,
            store: PointStore::new(layout, vec![0; anchors.len()]).expect("there is a value for each point"),
            anchors,
            patterns: Patterns::new(params.rays),
            clusters,
            spawns: Vec::new(),
            motion: Motion::new(scene, pose, params.radius_m),
            step: 0,
            restless: params.refines(),
            counts: StepCounts::default(),
        };
        let light = updater.trace_all(scene, pose, tracer, params.rays, progress);
        updater.store = store_of(updater.store.layout().clone(), &light, params.bent_normals);
        Ok(updater)
    }

    /// What was last traced of each point.
    pub fn store(&self) -> &PointStore {
        &self.store
    }

    /// Where each point sits on its mesh, in the order of the store.
    pub fn anchors(&self) -> &[Anchor] {
        &self.anchors
    }

    /// The world boxes of all instances, as of the last step.
    pub fn bounds_world(&self) -> &[Aabb] {
        self.motion.bounds_world()
    }

    /// Where every point is in the world at `pose` (`None` where its triangle has collapsed), in the order of the store.
    pub fn positions_world(&self, scene: &Scene, pose: &Pose) -> Vec<Option<Vec3>> {
        let sets = self.store.layout().sets().iter();
        sets.flat_map(|set| (set.first..set.first + set.len() as u32).map(|point| (point, set.instance)))
            .map(|(point, instance)| {
                self.anchors[point as usize].pose(scene, pose, instance as usize).map(|posed| posed.position)
            })
            .collect()
    }

    /// Bytes held now for each point, by capacity and with everything: layout, anchors, values, what is remembered of still
    /// instances, and the points' share of the tables that all of them use. It grows as movers come near more points.
    pub fn bytes_per_point(&self) -> f64 {
        let layout = layout_bytes(self.store.layout());
        let bytes = size_of::<Updater>()
            + layout
            + self.store.value_bytes()
            + self.anchors.capacity() * size_of::<Anchor>()
            + self.clusters.iter().map(Cluster::bytes).sum::<usize>()
            + (self.clusters.capacity() - self.clusters.len()) * size_of::<Cluster>()
            + self.patterns.bytes()
            + self.motion.bytes()
            + self.spawns.iter().map(Spawn::bytes).sum::<usize>();
        bytes as f64 / self.anchors.len().max(1) as f64
    }

    /// Traces what may have changed between the last step's pose and this one, within the budget; what does not fit waits.
    /// `tracer` must be up to date with `pose`; it is told which instances count as movers.
    ///
    /// Without a budget the result is that of tracing everything ([`Updater::step_all`]), to the bit, as long as points at
    /// rest get no more rays than others.
    pub fn step(
        &mut self,
        scene: &Scene,
        pose: &Pose,
        tracer: &mut Tracer,
        input: &StepInput<'_>,
    ) -> UpdateReport {
        self.select(scene, pose, tracer, input);
        self.trace_selected(scene, pose, tracer)
    }

    /// The second half of [`Updater::step`], with the same pose and tracer as [`Updater::select`].
    pub fn trace_selected(&mut self, scene: &Scene, pose: &Pose, tracer: &Tracer) -> UpdateReport {
        let context = Context {
            scene,
            pose,
            tracer,
            anchors: &self.anchors,
            patterns: &self.patterns,
            params: &self.params,
            movers: self.motion.casting_movers(scene),
            known: &self.store,
        };
        let traced: Vec<Traced> = self
            .clusters
            .par_iter_mut()
            .filter(|cluster| cluster.selected | cluster.refining != 0)
            .map(|cluster| cluster.trace(&context))
            .collect();
        let mut report = UpdateReport { changes: Vec::new(), counts: std::mem::take(&mut self.counts) };
        let mut bent_changes = Vec::new();
        for traced in traced {
            report.counts.add(&traced.counts);
            report.changes.extend(traced.changes);
            bent_changes.extend(traced.bent_changes);
        }
        self.store.apply_bent(&bent_changes).expect("bent normals are traced of points that have some");
        self.store.apply(&report.changes).expect("every traced point is a point of the store");
        self.trace_spawned(scene, pose, tracer, &mut report.counts);
        report
    }

    /// Traces all points anew, whether or not anything moved, each with the rays that it has at rest: what steps must come
    /// to once nothing moves, and what a step without a budget must agree with if rest adds no rays.
    pub fn step_all(&mut self, scene: &Scene, pose: &Pose, tracer: &Tracer) -> UpdateReport {
        let observed = self.observe(scene, pose);
        self.mark(scene, pose, &observed);
        for cluster in &mut self.clusters {
            (cluster.dirty, cluster.waiting) = (0, 0);
        }
        self.restless = self.params.refines();
        let rays = self.params.rays.max(self.params.rays_still);
        let light = self.trace_all(scene, pose, tracer, rays, &|_| ());
        let store = store_of(self.store.layout().clone(), &light, self.params.bent_normals);
        let known = self.store.visibility().iter().zip(store.visibility().iter().copied());
        let changed = (0..).zip(known).filter(|(_, (a, b))| *a != b);
        let changes: Vec<_> = changed
            .map(|(point, (_, visibility))| dapple_store::points::Change { point, visibility })
            .collect();
        self.store = store;
        let points = self.anchors.len() as u32;
        let counts = StepCounts {
            selected: points,
            traced_full: points,
            rays_full: u64::from(points) * u64::from(rays),
            ..StepCounts::default()
        };
        UpdateReport { changes, counts }
    }

    /// The light of every point, nothing remembered.
    fn trace_all(
        &self,
        scene: &Scene,
        pose: &Pose,
        tracer: &Tracer,
        rays: u32,
        progress: &(dyn Fn(usize) + Sync),
    ) -> Vec<PointLight> {
        let (anchors, params, known) = (&self.anchors[..], &self.params, &self.store);
        let (patterns, movers) = (&self.patterns, Vec::new());
        let context = Context { scene, pose, tracer, anchors, patterns, params, movers, known };
        let done = std::sync::atomic::AtomicUsize::new(0);
        self.clusters
            .par_chunks(16)
            .flat_map_iter(|chunk| {
                let mut scratch = Scratch::default();
                let mut values = Vec::new();
                for cluster in chunk {
                    let anchors = &anchors[cluster.range()];
                    let normals = context.normals(cluster.instance, cluster.first);
                    let traced = anchors.iter().zip(normals).map(|(anchor, normal)| {
                        context.light(anchor, (cluster.instance, *normal), rays, &mut scratch)
                    });
                    values.extend(traced);
                }
                let before = done.fetch_add(values.len(), std::sync::atomic::Ordering::Relaxed);
                progress(before + values.len());
                values
            })
            .collect()
    }
}

/// A store of what was traced.
fn store_of(layout: Arc<PointLayout>, light: &[PointLight], has_bent: bool) -> PointStore {
    let visibility = light.iter().map(|light| light.visibility).collect();
    let store = PointStore::new(layout, visibility).expect("one value was traced for each point");
    if !has_bent {
        return store;
    }
    let plane = |k: usize| light.iter().map(|light| light.bent.0[k]).collect();
    store.with_bent([plane(0), plane(1)]).expect("one bent normal was traced for each point")
}

/// Bytes of a layout's points, by capacity.
fn layout_bytes(layout: &PointLayout) -> usize {
    let of_set = |set: &dapple_store::points::PointSet| {
        size_of_val(set)
            + set.positions.capacity() * size_of::<[u32; 3]>()
            + set.normals.capacity() * size_of::<[u8; 2]>()
    };
    layout.sets().iter().map(of_set).sum()
}
