//! Which points a step traces: what motion may have changed, and of it what the budget allows.

use dapple_scene::{Aabb, Pose, Scene};
use rayon::prelude::*;

use super::clusters::{Cluster, bits};
use super::interest::is_seen;
use super::motion::{Near, Observed};
use super::{StepCounts, StepInput, UpdateParams, Updater};
use crate::Tracer;
use crate::psao::generate::Anchor;

/// Priorities are steps of waiting: whatever is seen comes before what has waited less than this longer out of sight.
const SEEN_STEPS: u32 = 64;
/// A mover is near now, not only in the past.
const TOUCHED_STEPS: u32 = 8;
/// For a change from open to blocked when last traced, less for lesser ones.
const CHANGED_STEPS: u32 = 24;

/// One part in so many of a budget is for points that have just been laid, while there are any.
const KEPT_FOR_SPAWNS: u64 = 4;

/// Longer than any priority lasts against waiting.
#[cfg(test)]
pub(super) const MOST_HEAD_START: u32 = SEEN_STEPS + TOUCHED_STEPS + CHANGED_STEPS;

impl Updater {
    /// The first half of [`Updater::step`]: finds what the motion since the last step may have changed, tells the tracer
    /// which instances count as movers, and chooses what is to be traced.
    pub fn select(&mut self, scene: &Scene, pose: &Pose, tracer: &mut Tracer, input: &StepInput<'_>) {
        let observed = self.observe(scene, pose);
        if tracer.movers() != self.motion.movers() {
            tracer.set_movers(self.motion.movers());
        }
        self.counts = StepCounts::default();
        if !(observed.anything() || self.restless) {
            return;
        }
        self.counts.selected = self.mark(scene, pose, &observed);
        // What comes must not wait for ever for what moves, nor the other way round.
        let kept = if self.spawns.is_empty() { 0 } else { input.ray_budget.unwrap_or(0) / KEPT_FOR_SPAWNS };
        let left = match input.ray_budget {
            None => {
                self.clusters.par_iter_mut().for_each(|c| c.selected = c.dirty);
                u64::MAX
            }
            Some(budget) => self.spend(budget - kept, input) + kept,
        };
        let left = self.choose_spawned(left, input.ray_budget != Some(0));
        let refinable = self.params.refines() && self.choose_refined(scene, pose, input, left);
        // What is traced now may be refined from the next step on.
        let traced = self.params.refines() && self.clusters.iter().any(|c| c.selected != 0);
        self.restless = refinable || traced || self.counts.backlog > 0 || !self.spawns.is_empty();
    }

    /// One step further in time.
    pub(super) fn observe(&mut self, scene: &Scene, pose: &Pose) -> Observed {
        self.step = self.step.wrapping_add(1);
        self.motion.observe(scene, pose, self.step)
    }

    /// Marks what motion may have changed. Returns the number of points.
    pub(super) fn mark(&mut self, scene: &Scene, pose: &Pose, observed: &Observed) -> u32 {
        let (anchors, step) = (&self.anchors, self.step);
        for spawn in &mut self.spawns {
            spawn.follow(scene, pose, observed, step);
        }
        self.clusters.par_iter_mut().map(|cluster| cluster.follow(scene, pose, anchors, observed, step)).sum()
    }

    /// Selects by priority until the budget is spent. Returns what is left of it.
    fn spend(&mut self, budget: u64, input: &StepInput<'_>) -> u64 {
        let step = self.step;
        let bounds_world = self.motion.bounds_world();
        // What has waited and what has only just become dirty again are ranked apart.
        let rank = |(index, cluster): (usize, &Cluster)| {
            let seen = is_seen(input.interest, cluster.bounds_now(bounds_world));
            let mut priority = CHANGED_STEPS * u32::from(cluster.last_change) / 255;
            priority += if seen { SEEN_STEPS } else { 0 };
            priority += if cluster.touched { TOUCHED_STEPS } else { 0 };
            let waited = priority.saturating_add(step.wrapping_sub(cluster.since));
            [(waited, 0, cluster.waiting), (priority, 1, cluster.dirty & !cluster.waiting)].map(
                |(priority, turn, points)| {
                    (u64::from(u32::MAX - priority) << 32 | (index as u64) << 1 | turn, points)
                },
            )
        };
        let mut ranked: Vec<(u64, u64)> = self
            .clusters
            .par_iter()
            .enumerate()
            .filter(|(_, cluster)| cluster.dirty != 0)
            .flat_map_iter(rank)
            .filter(|(_, points)| *points != 0)
            .collect();
        ranked.par_sort_unstable();
        let mut left = budget;
        let mut first = budget > 0;
        'spending: for (key, points) in ranked {
            let cluster = &mut self.clusters[(key & u64::from(u32::MAX)) as usize >> 1];
            for bit in bits(points) {
                let cost = cluster.rays_of(bit, &self.params);
                if cost > left && !first {
                    break 'spending;
                }
                first = false;
                left = left.saturating_sub(cost);
                cluster.selected |= 1 << bit;
            }
        }
        for cluster in &self.clusters {
            self.counts.backlog += (cluster.dirty & !cluster.selected).count_ones();
            if cluster.waiting & !cluster.selected != 0 {
                let waited = step.wrapping_sub(cluster.since);
                self.counts.oldest_steps = self.counts.oldest_steps.max(waited);
            }
        }
        left
    }

    /// Chooses points at rest for more rays: what is seen first, then what has the fewest. Returns whether there are any.
    fn choose_refined(&mut self, scene: &Scene, pose: &Pose, input: &StepInput<'_>, mut left: u64) -> bool {
        let movers: Vec<Near> = self.motion.casting_movers(scene);
        let (params, is_mover) = (&self.params, self.motion.movers());
        let mut ranked: Vec<(bool, u32, usize)> = self
            .clusters
            .par_iter()
            .enumerate()
            .filter(|(_, c)| c.dirty == 0 && c.unsettled() != 0 && !is_mover[c.instance as usize])
            .filter(|(_, c)| !movers.iter().any(|near| near.touches(c.bounds_world())))
            .map(|(i, c)| (!is_seen(input.interest, c.bounds_world()), c.fewest_rays(params), i))
            .collect();
        ranked.par_sort_unstable();
        let any = !ranked.is_empty();
        let mut idle = left > 0 && input.ray_budget.is_some_and(|budget| left == budget);
        'spending: for (_, rays, index) in ranked {
            let cluster = &mut self.clusters[index];
            let next = (2 * rays.max(params.rays)).min(params.rays_still);
            let cost = u64::from(next - rays);
            // One point at least in a step that has nothing else to do, however small the budget.
            let first = std::mem::take(&mut idle);
            if cost > left && !first {
                break;
            }
            left = left.max(cost);
            cluster.remember(scene, pose, &self.anchors);
            for bit in bits(cluster.unsettled()) {
                if cluster.rays_so_far(bit, params) != rays {
                    continue;
                }
                if cost > left {
                    break 'spending;
                }
                left -= cost;
                cluster.refining |= 1 << bit;
            }
        }
        any
    }
}

impl Cluster {
    /// Marks the points that motion may have changed. Returns their number.
    pub(super) fn follow(
        &mut self,
        scene: &Scene,
        pose: &Pose,
        anchors: &[Anchor],
        observed: &Observed,
        step: u32,
    ) -> u32 {
        (self.selected, self.refining) = (0, 0);
        let points = if observed.moved.get(self.instance as usize).is_some_and(|moved| *moved) {
            self.set_off();
            self.everything()
        } else {
            self.settle_down(scene, pose, anchors);
            if self.memory().is_some_and(|memory| memory.valid != 0) {
                let switched = self.near(scene, pose, anchors, &observed.switched);
                self.forget(switched);
            }
            self.near(scene, pose, anchors, &observed.swept)
        };
        self.touched = points != 0;
        self.mark(points, step);
        if self.dirty != 0 && !self.moving {
            self.remember(scene, pose, anchors);
        }
        points.count_ones()
    }

    /// Where it is: its instance's box where its own is not kept up to date.
    pub(super) fn bounds_now<'a>(&'a self, instances: &'a [Aabb]) -> &'a Aabb {
        if self.moving { &instances[self.instance as usize] } else { self.bounds_world() }
    }

    /// Most rays that tracing a point takes.
    fn rays_of(&self, bit: usize, params: &UpdateParams) -> u64 {
        let known = self.memory().filter(|memory| !self.moving && memory.valid >> bit & 1 != 0);
        let blocked = known.map_or(0, |memory| crate::count_blocked(&memory.mask(bit, params)));
        u64::from(params.rays - blocked)
    }

    fn unsettled(&self) -> u64 {
        self.memory().map_or(self.everything(), |memory| memory.unsettled())
    }

    /// Rays against still instances that count today; 0 if there are none.
    fn rays_so_far(&self, bit: usize, params: &UpdateParams) -> u32 {
        let known = self.memory().filter(|memory| memory.valid >> bit & 1 != 0);
        known.map_or(0, |memory| memory.refined.get(bit).map_or(params.rays, |r| u32::from(r[0])))
    }

    /// The least of them among points that can have more.
    fn fewest_rays(&self, params: &UpdateParams) -> u32 {
        bits(self.unsettled()).map(|bit| self.rays_so_far(bit, params)).min().unwrap_or(0)
    }
}
