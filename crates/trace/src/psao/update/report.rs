//! What a step is given and what it tells.

use dapple_store::points::Change;
use glam::Vec3;

use super::ConvexVolume;

/// What a step may spend, and where first. The default spends whatever it takes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepInput<'a> {
    /// Most rays in the step; `None` (default) for as many as there is work. What is left to do waits, and nothing waits for
    /// ever: a budget above 0 traces at least one point. Enough for a running scene is
    /// [`StepCounts::rays`] of steps without a budget.
    pub ray_budget: Option<u64>,
    /// What viewers see; points elsewhere wait. Empty (default): everything is seen.
    pub interest: &'a [ConvexVolume],
    /// Where viewers look from, metres: of instances that must share a cap on points, those that look large from there come first. Empty
    /// (default): those that are large do.
    pub eyes_world: &'a [Vec3],
}

/// What a step did, in points and rays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StepCounts {
    /// Points that this step's motion may have changed.
    pub selected: u32,
    /// Points traced against everything: on movers, or without a memory of what still instances block.
    pub traced_full: u32,
    /// Points traced against movers alone, with the rays that still instances leave open.
    pub traced_movers: u32,
    /// Points at rest that got more rays.
    pub refined: u32,
    /// Points left for later steps, out of `selected` and of earlier steps.
    pub backlog: u32,
    /// Steps that the longest-waiting of these has waited.
    pub oldest_steps: u32,
    /// Rays of `traced_full`.
    pub rays_full: u64,
    /// Rays of `traced_movers`, those included that boxes alone have answered.
    pub rays_movers: u64,
    /// Rays of `refined`.
    pub rays_refined: u64,
}

impl StepCounts {
    /// Points traced because something moved.
    pub fn traced(&self) -> u32 {
        self.traced_full + self.traced_movers
    }

    /// All rays.
    pub fn rays(&self) -> u64 {
        self.rays_full + self.rays_movers + self.rays_refined
    }

    pub(super) fn add(&mut self, other: &StepCounts) {
        self.selected += other.selected;
        self.traced_full += other.traced_full;
        self.traced_movers += other.traced_movers;
        self.refined += other.refined;
        self.backlog += other.backlog;
        self.oldest_steps = self.oldest_steps.max(other.oldest_steps);
        self.rays_full += other.rays_full;
        self.rays_movers += other.rays_movers;
        self.rays_refined += other.rays_refined;
    }
}

/// What one step did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct UpdateReport {
    /// Points whose visibility changes, ascending.
    pub changes: Vec<Change>,
    /// What it cost.
    pub counts: StepCounts,
}
