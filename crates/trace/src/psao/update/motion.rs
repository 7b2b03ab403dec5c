//! Which instances moved, which count as movers, and the boxes in which that can be seen.

use std::sync::Arc;

use dapple_scene::{Aabb, Pose, PosedInstance, Scene};
use glam::Vec3;
use rayon::prelude::*;

/// Steps after its last motion for which an instance stays a mover.
///
/// Becoming still costs a full trace of the points around it, and so does beginning to move again; waiting costs only
/// that passing movers are traced together with one that rests. Two seconds at 30 Hz tell a pause (a walker that turns, a
/// ball at the top of its bounce) from an end.
pub(super) const REST_STEPS: u32 = 60;

/// A box that points near it may see, and how near.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Near {
    bounds_world: Aabb,
    reach_m: f32,
    /// Part of the reach: more than rounding can move rays, and what they meet.
    margin_m: f32,
}

impl Near {
    /// The reach is the occlusion radius and the lift of ray origins, with a margin for rounding.
    pub(super) fn new(bounds_world: Aabb, radius_m: f32) -> Near {
        let b = &bounds_world;
        let magnitude = if b.is_empty() { 0.0 } else { b.min.abs().max(b.max.abs()).max_element() };
        let margin_m = radius_m * 0.001 + 1e-3 * (1.0 + magnitude * 0.01);
        Near { bounds_world, reach_m: radius_m + margin_m, margin_m }
    }

    /// Whether a point in `bounds_world` may see it.
    pub(super) fn touches(&self, bounds_world: &Aabb) -> bool {
        self.bounds_world.intersects(&bounds_world.inflated(self.reach_m))
    }

    /// Whether a point that is at most `error_m` from `position_world` along each axis may see it.
    pub(super) fn reaches(&self, position_world: Vec3, error_m: f32) -> bool {
        let reach_m = self.reach_m + 2.0 * error_m; // more than √3
        self.bounds_world.distance_squared(position_world) <= reach_m * reach_m
    }

    /// Around all directions in which rays from `origin_world` to above the surface with that normal may meet it; `None`
    /// where there are none.
    pub(super) fn cone(&self, origin_world: Vec3, normal: Vec3) -> Option<Cone> {
        let b = self.bounds_world.inflated(self.margin_m);
        let min = (b.min - origin_world).max(Vec3::splat(-self.reach_m));
        let max = (b.max - origin_world).min(Vec3::splat(self.reach_m));
        let highest = Vec3::select(normal.cmpge(Vec3::ZERO), max, min);
        if min.cmpgt(max).any() || highest.dot(normal) < -self.margin_m {
            return None;
        }
        let (center, radius_squared) = (0.5 * (min + max), 0.25 * (max - min).length_squared());
        let distance_squared = center.length_squared();
        if distance_squared <= 1.01 * radius_squared {
            return Some(Cone { axis: Vec3::ZERO, least_cosine: -1.0 });
        }
        let cosine = (1.0 - radius_squared / distance_squared).sqrt();
        Some(Cone { axis: center / distance_squared.sqrt(), least_cosine: cosine - 1e-3 })
    }
}

/// Directions around an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cone {
    /// Unit length, or zero if the cone holds all directions.
    pub(super) axis: Vec3,
    /// Directions whose cosine with the axis is less lie outside.
    pub(super) least_cosine: f32,
}

/// What the updater remembers of where instances are.
#[derive(Clone, Debug)]
pub(super) struct Motion {
    radius_m: f32,
    /// As of the last step.
    posed: Vec<PosedInstance>,
    bounds_world: Vec<Aabb>,
    movers: Vec<bool>,
    /// Step of the last motion.
    moved_at: Vec<u32>,
}

/// What happened between two steps.
#[derive(Clone, Debug, Default)]
pub(super) struct Observed {
    /// Parallel to the scene's instances.
    pub(super) moved: Vec<bool>,
    /// Both ends of each caster's motion: what arrived now occludes, what left no longer does.
    pub(super) swept: Vec<Near>,
    /// Where casters stood when they became movers, or still.
    pub(super) switched: Vec<Near>,
    /// An instance became a mover, or still, whether it casts or not.
    pub(super) any_switched: bool,
}

impl Observed {
    pub(super) fn anything(&self) -> bool {
        self.any_switched || self.moved.contains(&true)
    }
}

impl Motion {
    pub(super) fn new(scene: &Scene, pose: &Pose, radius_m: f32) -> Motion {
        let count = scene.instances.len();
        let bounds = (0..count).into_par_iter().map(|i| scene.instance_bounds_world(pose, i));
        Motion {
            radius_m,
            posed: pose.instances.clone(),
            bounds_world: bounds.collect(),
            movers: vec![false; count],
            moved_at: vec![0; count],
        }
    }

    /// Which instances count as movers: those that moved in the last [`REST_STEPS`] steps.
    pub(super) fn movers(&self) -> &[bool] {
        &self.movers
    }

    /// The world boxes of all instances, as of the last step.
    pub(super) fn bounds_world(&self) -> &[Aabb] {
        &self.bounds_world
    }

    /// Where the movers that cast are now.
    pub(super) fn casting_movers(&self, scene: &Scene) -> Vec<Near> {
        let instances = scene.instances.iter().zip(&self.movers).zip(&self.bounds_world);
        instances
            .filter(|((instance, mover), _)| **mover && instance.casts)
            .map(|(_, bounds_world)| Near::new(*bounds_world, self.radius_m))
            .collect()
    }

    /// Follows the instances to `pose` in step number `step`.
    pub(super) fn observe(&mut self, scene: &Scene, pose: &Pose, step: u32) -> Observed {
        let moved: Vec<bool> =
            self.posed.par_iter().zip(&pose.instances).map(|(a, b)| differs(a, b)).collect();
        let bounds_after: Vec<Option<Aabb>> = moved
            .par_iter()
            .enumerate()
            .map(|(i, moved)| moved.then(|| scene.instance_bounds_world(pose, i)))
            .collect();
        let mut observed = Observed::default();
        for (i, after) in bounds_after.into_iter().enumerate() {
            let casts = scene.instances[i].casts;
            let before = Near::new(self.bounds_world[i], self.radius_m);
            let mut switches = false;
            if let Some(after) = after {
                if casts {
                    observed.swept.extend([before, Near::new(after, self.radius_m)]);
                }
                self.bounds_world[i] = after;
                self.posed[i] = pose.instances[i].clone();
                self.moved_at[i] = step;
                switches = !self.movers[i];
                self.movers[i] = true;
            } else if self.movers[i] && step.wrapping_sub(self.moved_at[i]) >= REST_STEPS {
                self.movers[i] = false;
                switches = true;
            }
            observed.any_switched |= switches;
            if switches && casts {
                observed.switched.push(before);
            }
        }
        observed.moved = moved;
        observed
    }

    pub(super) fn bytes(&self) -> usize {
        // The last pose's vertices are held by nobody else once the caller poses anew.
        let deformed = self.posed.iter().filter_map(|posed| posed.deformed.as_ref());
        let vertices: usize = deformed.map(|d| d.positions.capacity() + d.normals.capacity()).sum();
        self.posed.capacity() * size_of::<PosedInstance>()
            + self.bounds_world.capacity() * size_of::<Aabb>()
            + self.movers.capacity()
            + self.moved_at.capacity() * size_of::<u32>()
            + vertices * size_of::<Vec3>()
    }
}

/// Whether an instance is placed or bent differently.
fn differs(a: &PosedInstance, b: &PosedInstance) -> bool {
    // Numbers that are none differ from themselves; such an instance is nowhere, and rests there.
    let finite = a.world_from_mesh.is_finite() || b.world_from_mesh.is_finite();
    (finite && a.world_from_mesh != b.world_from_mesh)
        || match (&a.deformed, &b.deformed) {
            (None, None) => false,
            (Some(a), Some(b)) => !Arc::ptr_eq(a, b) && a.positions != b.positions,
            _ => true,
        }
}
