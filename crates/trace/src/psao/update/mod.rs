//! Server update ([Neff2023] sec. 3.3): traces the points that a mover can affect, and reports what changed.
//!
//! Takes the scene's pose and a tracer brought up to it; returns the [`Change`]s above the threshold.

mod clusters;
mod patterns;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use dapple_scene::{Aabb, Pose, Scene};
use dapple_store::points::{Change, PointLayout, PointStore};
use glam::Vec3;
use rayon::prelude::*;

use super::generate::{Anchor, GeneratedPoints};
use crate::{Tracer, count_blocked, offset_origin};
use clusters::Clusters;
use patterns::Patterns;

/// How visibility is traced and when it counts as changed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UpdateParams {
    /// Rays a point, 1 … 256, always in the same directions relative to the point's surface. Default 64.
    pub rays: u32,
    /// Occlusion distance in metres, > 0. Default 0.6 ([Neff2023] sec. 4).
    pub radius_m: f32,
    /// A point is sent when its visibility (0 … 255) differs by more than this from what was last sent. Default 4.
    pub threshold: u8,
}

impl Default for UpdateParams {
    fn default() -> Self {
        UpdateParams { rays: 64, radius_m: 0.6, threshold: 4 }
    }
}

/// What one step did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct UpdateReport {
    /// Points whose published visibility changes, ascending.
    pub changes: Vec<Change>,
    /// Points traced.
    pub traced: u32,
    /// Rays traced.
    pub rays: u64,
}

/// The server's memory of all points: anchors and the visibility that was last published.
#[derive(Clone, Debug)]
pub struct Updater {
    params: UpdateParams,
    anchors: Vec<Anchor>,
    store: PointStore,
    patterns: Patterns,
    clusters: Clusters,
    /// As of the last step.
    pose: Pose,
    bounds_world: Vec<Aabb>,
}

/// Why an updater could not be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum UpdateError {
    /// Number of rays out of range.
    #[error("rays a point is {0}, must be 1 to 256")]
    BadRays(u32),
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
        if !(1..=256).contains(&params.rays) {
            return Err(UpdateError::BadRays(params.rays));
        }
        if !(params.radius_m.is_finite() && params.radius_m > 0.0) {
            return Err(UpdateError::BadRadius(params.radius_m));
        }
        let GeneratedPoints { layout, anchors, .. } = points;
        let patterns = Patterns::new(params.rays);
        let context =
            Context { scene, pose, tracer, layout: &layout, anchors: &anchors, patterns: &patterns, params };
        let done = std::sync::atomic::AtomicUsize::new(0);
        let all: Vec<u32> = (0..anchors.len() as u32).collect();
        let visibility: Vec<u8> = all
            .par_chunks(1024)
            .flat_map_iter(|chunk| {
                let values = context.trace(chunk);
                progress(chunk.len() + done.fetch_add(chunk.len(), std::sync::atomic::Ordering::Relaxed));
                values
            })
            .collect();
        let store = PointStore::new(layout, visibility).expect("one value was traced for each point");
        let mut clusters = Clusters::new(store.layout());
        clusters.refresh(scene, pose, &anchors, |_| true);
        let bounds_world = instance_bounds(scene, pose);
        Ok(Updater { params, anchors, store, patterns, clusters, pose: pose.clone(), bounds_world })
    }

    /// What has been published: the state every subscriber converges to.
    pub fn store(&self) -> &PointStore {
        &self.store
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

    /// Bytes held for each point: anchor, position, normal, value, and its share of the clusters.
    pub fn bytes_per_point(&self) -> f64 {
        let points = self.anchors.len().max(1) as f64;
        let fixed = size_of::<Anchor>() + size_of::<[u32; 3]>() + 2 + 1;
        fixed as f64 + self.clusters.bytes() as f64 / points
    }

    /// Traces what may have changed between the last step's pose and this one. `tracer` must be up to date with `pose`.
    pub fn step(&mut self, scene: &Scene, pose: &Pose, tracer: &Tracer) -> UpdateReport {
        let moved = moved_instances(&self.pose, pose);
        if !moved.contains(&true) {
            self.pose = pose.clone();
            return UpdateReport::default();
        }
        // Both ends of the motion can change a point: what arrived now occludes, what left no longer does.
        let mut swept = Vec::new();
        for (instance, _) in moved.iter().enumerate().filter(|(_, moved)| **moved) {
            let bounds_world = scene.instance_bounds_world(pose, instance);
            if scene.instances[instance].casts {
                swept.push(self.bounds_world[instance]);
                swept.push(bounds_world);
            }
            self.bounds_world[instance] = bounds_world;
        }
        self.clusters.refresh(scene, pose, &self.anchors, |i| moved[i]);
        let reach = reach_m(self.params.radius_m, &swept);
        let candidates = self.clusters.select(scene, pose, &self.anchors, &moved, &swept, reach);
        let report = self.trace_and_publish(scene, pose, tracer, &candidates);
        self.pose = pose.clone();
        report
    }

    /// Traces all points, whether or not anything moved: what [`Updater::step`] must agree with.
    pub fn step_all(&mut self, scene: &Scene, pose: &Pose, tracer: &Tracer) -> UpdateReport {
        let all: Vec<u32> = (0..self.anchors.len() as u32).collect();
        self.clusters.refresh(scene, pose, &self.anchors, |_| true);
        self.bounds_world = instance_bounds(scene, pose);
        let report = self.trace_and_publish(scene, pose, tracer, &all);
        self.pose = pose.clone();
        report
    }

    fn trace_and_publish(
        &mut self,
        scene: &Scene,
        pose: &Pose,
        tracer: &Tracer,
        points: &[u32],
    ) -> UpdateReport {
        let layout = self.store.layout().clone();
        let context = Context {
            scene,
            pose,
            tracer,
            layout: &layout,
            anchors: &self.anchors,
            patterns: &self.patterns,
            params: self.params,
        };
        let published = self.store.visibility();
        let changes: Vec<Change> = points
            .par_chunks(256)
            .flat_map_iter(|chunk| {
                let values = context.trace(chunk);
                let changed = chunk.iter().zip(values).filter(|&(&point, visibility)| {
                    visibility.abs_diff(published[point as usize]) > self.params.threshold
                });
                changed.map(|(&point, visibility)| Change { point, visibility }).collect::<Vec<_>>()
            })
            .collect();
        self.store.apply(&changes).expect("every candidate is a point of the store");
        UpdateReport {
            changes,
            traced: points.len() as u32,
            rays: points.len() as u64 * u64::from(self.params.rays),
        }
    }
}

/// What tracing a point needs to know.
struct Context<'a> {
    scene: &'a Scene,
    pose: &'a Pose,
    tracer: &'a Tracer,
    layout: &'a Arc<PointLayout>,
    anchors: &'a [Anchor],
    patterns: &'a Patterns,
    params: UpdateParams,
}

impl Context<'_> {
    /// Visibility of each of `points` (ascending), 255 = open.
    fn trace(&self, points: &[u32]) -> Vec<u8> {
        let sets = self.layout.sets();
        let mut set = 0;
        let mut directions_world = Vec::with_capacity(self.params.rays as usize);
        let mut values = Vec::with_capacity(points.len());
        for &point in points {
            while set + 1 < sets.len() && sets[set + 1].first <= point {
                set += 1;
            }
            let instance = sets[set].instance;
            let anchor = &self.anchors[point as usize];
            let Some(posed) = anchor.pose(self.scene, self.pose, instance as usize) else {
                // A triangle that collapsed while moving shows nothing; open is the neutral value.
                values.push(255);
                continue;
            };
            let bitangent = posed.normal.cross(posed.tangent);
            directions_world.clear();
            directions_world.extend(
                self.patterns
                    .of(anchor.site(instance))
                    .iter()
                    .map(|d| posed.tangent * d.x + bitangent * d.y + posed.normal * d.z),
            );
            let origin_world = offset_origin(posed.position, posed.normal);
            let blocked = self.tracer.occlusion(origin_world, &directions_world, self.params.radius_m);
            values.push(quantize(self.params.rays - count_blocked(&blocked), self.params.rays));
        }
        values
    }
}

/// The share of open rays as 0 … 255, rounded.
fn quantize(open: u32, rays: u32) -> u8 {
    ((open * 255 + rays / 2) / rays) as u8
}

fn instance_bounds(scene: &Scene, pose: &Pose) -> Vec<Aabb> {
    (0..scene.instances.len()).into_par_iter().map(|i| scene.instance_bounds_world(pose, i)).collect()
}

/// For each instance, whether it is placed or bent differently.
fn moved_instances(before: &Pose, after: &Pose) -> Vec<bool> {
    let differs = |(a, b): (&dapple_scene::PosedInstance, &dapple_scene::PosedInstance)| {
        a.world_from_mesh != b.world_from_mesh
            || match (&a.deformed, &b.deformed) {
                (None, None) => false,
                (Some(a), Some(b)) => !Arc::ptr_eq(a, b) && a.positions != b.positions,
                _ => true,
            }
    };
    before.instances.iter().zip(&after.instances).map(differs).collect()
}

/// How far from a mover's bounds a point can be and still see it: the radius and the lift of ray origins, with a margin for rounding.
fn reach_m(radius_m: f32, swept: &[Aabb]) -> f32 {
    let magnitude = swept
        .iter()
        .filter(|b| !b.is_empty())
        .map(|b| b.min.abs().max(b.max.abs()).max_element())
        .fold(0.0f32, f32::max);
    radius_m * 1.001 + 1e-3 * (1.0 + magnitude * 0.01)
}
