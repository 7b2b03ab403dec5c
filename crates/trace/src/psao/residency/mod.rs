//! Which instances have points when not all can: what is seen first, what looks large, what was seen lately.
//!
//! Pure: takes boxes, views and the number of the step, gives what to lay and what to give up. See the README one folder up.

#[cfg(test)]
mod tests;

use dapple_scene::Aabb;

use super::update::ConvexVolume;

/// How instances share the points that there may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ResidencyParams {
    /// Most points of all instances together, those that wait for their first rays counted.
    pub max_points: u32,
    /// Steps for which what has come stays, whatever else is wanted. Default 60: two seconds at 30 Hz.
    pub stay_steps: u32,
    /// Most points that may come in one step, by what they can be at most; one instance may always. Default 20,000: some tens of
    /// milliseconds to lay.
    pub points_a_step: u32,
}

impl ResidencyParams {
    /// The defaults with so many points.
    pub fn with_max_points(max_points: u32) -> ResidencyParams {
        ResidencyParams { max_points, stay_steps: 60, points_a_step: 20_000 }
    }
}

/// What viewers see of the scene in a step.
#[derive(Clone, Copy, Debug)]
pub struct Watch<'a> {
    /// Boxes of all instances in the world, metres.
    pub bounds_world: &'a [Aabb],
    /// What viewers see; empty: everything. Without a place of an eye in any of them, sizes count and not distances.
    pub interest: &'a [ConvexVolume],
}

/// What is to be done in a step; what goes must go first.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Turnover {
    /// Instances whose points go, ascending.
    pub evict: Vec<u32>,
    /// Instances whose points come, ascending.
    pub spawn: Vec<u32>,
}

/// Which instances have points, and since when.
#[derive(Clone, Debug)]
pub struct Residency {
    params: ResidencyParams,
    instances: Vec<Instance>,
    too_large: Vec<u32>,
    step: u32,
}

#[derive(Clone, Debug, Default)]
struct Instance {
    /// What laying can give at most.
    most_points: u64,
    /// Points and the step in which they came; `None` while it has none.
    here: Option<(u64, u32)>,
    /// The last step in which it was seen; 0: never.
    seen: u32,
}

/// Rank of an instance: a class, lower first; within it what was seen last, then what looks larger, come first.
#[derive(Clone, Copy, Debug)]
struct Rank {
    class: Class,
    seen: u32,
    size: f32,
    index: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Class {
    /// It has only just come.
    Fresh,
    Seen,
    /// It will be seen if a viewer turns a little.
    Soon,
    /// It is out of sight, but has points.
    Here,
    /// It has points, and was taken away: nowhere can it be seen.
    Gone,
}

/// What is there counts as so many times as large as it looks: two that look alike do not take turns, and what one looks at does not
/// lose its light for what looks a little larger.
const HERE_FACTOR: f32 = 8.0;

/// What is as near to a view, in parts of its distance to the eye, is soon seen: some 30° to the side.
const SOON: f32 = 0.5;

impl Residency {
    /// No instance has points. `most_points` are what each can have at most; instances with 0 never have any.
    pub fn new(params: ResidencyParams, most_points: Vec<u64>) -> Residency {
        let limit = u64::from(params.max_points);
        let too_large = (0u32..).zip(&most_points).filter(|(_, most)| **most > limit).map(|(i, _)| i);
        Residency {
            params,
            too_large: too_large.collect(),
            instances: most_points
                .into_iter()
                .map(|most_points| Instance { most_points, ..Instance::default() })
                .collect(),
            step: 0,
        }
    }

    /// Instances that have more points than all may have together: they stay open.
    pub fn too_large(&self) -> &[u32] {
        &self.too_large
    }

    /// Points that there are, as far as they are known.
    pub fn points(&self) -> u64 {
        self.instances.iter().filter_map(|instance| instance.here).map(|(points, _)| points).sum()
    }

    /// An instance has got so many points; never more than it could have.
    pub fn laid(&mut self, instance: u32, points: u64) {
        if let Some(Instance { here: Some((known, _)), most_points, .. }) =
            self.instances.get_mut(instance as usize)
        {
            *known = points.min(*most_points);
        }
    }

    /// One step further: what goes and what comes, which is taken to happen. Points never exceed [`ResidencyParams::max_points`],
    /// and nothing goes while there is room.
    pub fn step(&mut self, watch: &Watch<'_>) -> Turnover {
        self.turn_over(watch, u64::from(self.params.points_a_step))
    }

    /// As a first step, with no bound on what comes.
    pub fn fill(&mut self, watch: &Watch<'_>) -> Turnover {
        self.turn_over(watch, u64::MAX)
    }

    fn turn_over(&mut self, watch: &Watch<'_>, mut allowed: u64) -> Turnover {
        self.step = self.step.saturating_add(1);
        let ranked = self.rank(watch);
        // As many as fit, in order.
        let mut left = u64::from(self.params.max_points);
        let (mut wanted, mut unwanted) = (Vec::new(), Vec::new());
        for rank in ranked {
            let instance = &self.instances[rank.index];
            let points = instance.here.map_or(instance.most_points, |(points, _)| points);
            if points <= left {
                left -= points;
                if instance.here.is_none() {
                    wanted.push((rank.index, points));
                }
            } else if instance.here.is_some() {
                unwanted.push((rank.index, points));
            }
        }
        let mut turnover = Turnover::default();
        let mut used = self.points();
        for (index, points) in wanted {
            if points > allowed && !turnover.spawn.is_empty() {
                break;
            }
            allowed = allowed.saturating_sub(points);
            used += points;
            turnover.spawn.push(index as u32);
        }
        // No more than must, the least wanted first.
        while used > u64::from(self.params.max_points) {
            let Some((index, points)) = unwanted.pop() else { break };
            used -= points;
            self.instances[index].here = None;
            turnover.evict.push(index as u32);
        }
        for &index in &turnover.spawn {
            let instance = &mut self.instances[index as usize];
            instance.here = Some((instance.most_points, self.step));
        }
        turnover.evict.sort_unstable();
        turnover.spawn.sort_unstable();
        turnover
    }

    /// Instances that should have points, the most important first.
    fn rank(&mut self, watch: &Watch<'_>) -> Vec<Rank> {
        let mut ranked = Vec::new();
        for (index, (instance, bounds)) in self.instances.iter_mut().zip(watch.bounds_world).enumerate() {
            if instance.most_points == 0 {
                continue;
            }
            if bounds.is_empty() {
                if instance.here.is_some() {
                    ranked.push(Rank { class: Class::Gone, seen: instance.seen, size: 0.0, index });
                }
                continue;
            }
            let touches = |bounds: &Aabb| watch.interest.iter().any(|volume| volume.touches(bounds));
            let eyes = watch.interest.iter().filter_map(|volume| volume.eye_world);
            let eyes = eyes.map(|eye| bounds.distance_squared(eye));
            let nearest_squared = eyes.fold(f32::INFINITY, f32::min);
            let class = if watch.interest.is_empty() || touches(bounds) {
                instance.seen = self.step;
                Class::Seen
            } else if nearest_squared.is_finite() && touches(&bounds.inflated(SOON * nearest_squared.sqrt()))
            {
                Class::Soon
            } else {
                Class::Here
            };
            let is_fresh = instance.here.is_some_and(|(_, since)| self.step - since < self.params.stay_steps);
            if class == Class::Here && instance.here.is_none() {
                continue;
            }
            let diagonal_squared = (bounds.max - bounds.min).length_squared();
            // Nobody comes nearer than its own size, as far as that matters.
            let distance_squared =
                if nearest_squared.is_finite() { nearest_squared.max(0.01 * diagonal_squared) } else { 1.0 };
            let factor = if instance.here.is_some() { HERE_FACTOR } else { 1.0 };
            ranked.push(Rank {
                class: if is_fresh { Class::Fresh } else { class },
                // In sight all are seen alike.
                seen: if class == Class::Here { instance.seen } else { 0 },
                size: factor * diagonal_squared / distance_squared.max(f32::MIN_POSITIVE),
                index,
            });
        }
        ranked.sort_unstable_by(|a, b| {
            let order = a.class.cmp(&b.class).then(b.seen.cmp(&a.seen));
            order.then(b.size.total_cmp(&a.size)).then(a.index.cmp(&b.index))
        });
        ranked
    }
}
