//! What changed between two moments, and for how much of an entry's light: a server knows its movers.

use std::sync::Arc;

use dapple_scene::area_lights::AreaLights;
use dapple_scene::glam::Vec3;
use dapple_scene::{Pose, PosedInstance, Scene};
use rayon::prelude::*;

use super::EntryPlace;

/// A scene at one moment, with its lights.
#[derive(Clone, Copy)]
pub struct Moment<'a> {
    /// What it is of.
    pub scene: &'a Scene,
    /// When.
    pub pose: &'a Pose,
    /// [`AreaLights::new`] of both.
    pub lights: &'a AreaLights<'a>,
}

/// Two moments of a scene, compared.
pub struct Changes<'a> {
    pub(super) now: &'a AreaLights<'a>,
    pub(super) before: &'a AreaLights<'a>,
    /// A light each: moved, or shines differently.
    pub(super) lights: Vec<bool>,
    reaches: Vec<Reach>,
    /// An instance each: moved or bent.
    moved: Vec<bool>,
    /// Balls about what casts and moved, where it was and where it is, with the instance.
    movers: Vec<(Vec3, f32, u32)>,
    nothing: bool,
    /// Frames before this in which nothing changed.
    quiet: u32,
}

/// Where a light is.
struct Reach {
    /// Centre and radius of a ball that holds it and, if it changed, held it before; none of surroundings, and of what is not there.
    ball: Option<(Vec3, f32)>,
    /// None of surroundings.
    instance: Option<u32>,
}

/// Whether an instance is where it was, and not bent otherwise.
pub(super) fn is_still(then: &PosedInstance, now: &PosedInstance) -> bool {
    let as_before = match (&then.deformed, &now.deformed) {
        (None, None) => true,
        (Some(a), Some(b)) => Arc::ptr_eq(a, b) || a.positions == b.positions,
        _ => false,
    };
    as_before && then.world_from_mesh == now.world_from_mesh
}

/// What changed for one entry.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Change {
    /// Part of the light that would arrive unoccluded which is of lights that changed or may have been hidden or uncovered, 0 … 1.
    pub(super) share: f32,
    /// Whether something moved in front of a light, or the entry itself moved.
    pub(super) hidden: bool,
    /// Part of the light that was not there before, 0 … 1.
    pub(super) new: f32,
}

impl<'a> Changes<'a> {
    /// Of a scene from one moment to the next. Nothing changes if both are the same.
    pub fn between(before: &Moment<'a>, now: &Moment<'a>) -> Changes<'a> {
        let lights = now.lights.changed_since(before.lights);
        let of_instance = |i: usize| {
            let (then, posed) = (before.pose.instances.get(i)?, now.pose.instances.get(i)?);
            if is_still(then, posed) {
                return None;
            }
            let [then, now] = [before.pose, now.pose]
                .map(|pose| now.scene.instances[i].casts.then(|| ball_about(now.scene, pose, i)).flatten());
            let swept = then.zip(now).map(|(then, now)| join(then, now));
            Some((i, swept.or(then).or(now)))
        };
        let found: Vec<(usize, Option<(Vec3, f32)>)> =
            (0..now.scene.instances.len()).into_par_iter().filter_map(of_instance).collect();
        let mut moved = vec![false; now.scene.instances.len()];
        let mut movers = Vec::new();
        for (i, ball) in found {
            moved[i] = true;
            movers.extend(ball.map(|(center, radius)| (center, radius, i as u32)));
        }
        let nothing = !lights.contains(&true) && !moved.contains(&true);
        let reach = |(light, changed): (usize, &bool)| {
            let ball = now.lights.bounds(light).map(|ball| {
                let then = before.lights.bounds(light).filter(|_| *changed);
                then.map_or(ball, |then| join(ball, then))
            });
            Reach { ball, instance: now.lights.instance(light) }
        };
        let reaches = lights.iter().enumerate().map(reach).collect();
        let (now, before) = (now.lights, before.lights);
        Changes { now, before, lights, reaches, moved, movers, nothing, quiet: u32::MAX }
    }

    /// With how many frames before this one nothing had changed in; [`Changes::between`] takes it that nothing ever had. What nobody saw for
    /// longer may have missed a change.
    #[must_use]
    pub fn after_quiet(self, frames: u32) -> Changes<'a> {
        Changes { quiet: frames, ..self }
    }

    /// Frames since the first change, before this one, that an entry may have missed which nobody saw for so many frames; 0 if it missed none.
    pub(super) fn missed(&self, absent: u32) -> u32 {
        absent.saturating_sub(self.quiet)
    }

    /// The lights as they are now.
    pub fn lights(&self) -> &'a AreaLights<'a> {
        self.now
    }

    /// Whether nothing changed at all.
    pub fn is_nothing(&self) -> bool {
        self.nothing
    }

    /// Which lights moved or shine differently.
    pub fn changed_lights(&self) -> &[bool] {
        &self.lights
    }

    /// Whether an instance moved or bent.
    pub(super) fn has_moved(&self, instance: u32) -> bool {
        self.moved.get(instance as usize).is_some_and(|moved| *moved)
    }

    /// Whether another part of a light than before may be seen from a place that did not move.
    pub(super) fn may_show(&self, light: usize, position: Vec3, normal: Vec3) -> bool {
        !self.nothing
            && (self.lights.get(light).is_some_and(|changed| *changed)
                || self.covered(light, position, normal) > 0.0)
    }

    /// What was asked for is left in `arrivals`.
    pub(super) fn of(&self, place: &EntryPlace, instance: u32, arrivals: &mut Arrivals) -> Change {
        if self.nothing {
            return Change::default();
        }
        arrivals.clear(self.now.len());
        if self.has_moved(instance) {
            return Change { share: 1.0, hidden: true, new: 0.0 };
        }
        // By what entries hold light by.
        let mut arriving = |light: usize| {
            let [before, now] = arrivals.of(light, place, self);
            before.max(now)
        };
        let (mut part, mut new, mut all, mut hidden) = (0.0, 0.0, 0.0, false);
        for light in 0..self.now.len() {
            let changed = self.lights[light];
            // Of a light that changed it is only asked whether any is.
            let is_known = changed && hidden;
            let covered =
                if is_known { 0.0 } else { self.covered(light, place.position_world, place.normal_world) };
            if !changed && covered <= 0.0 {
                continue;
            }
            let energy = arriving(light);
            if energy <= 0.0 {
                continue;
            }
            if changed && self.before.power_of(light) <= 0.0 {
                new += energy;
            }
            hidden |= covered > 0.0;
            part += energy * if changed { 1.0 } else { covered };
            all += if changed { energy } else { 0.0 };
        }
        // Most entries end here, where few things move among many lights.
        if part <= 0.0 {
            return Change::default();
        }
        let unchanged = (0..self.now.len()).filter(|light| !self.lights[*light]);
        all += unchanged.map(&mut arriving).sum::<f32>();
        // Sums in another order may differ in the last bit.
        Change { share: f32::min(part / all, 1.0), hidden, new: f32::min(new / all, 1.0) }
    }

    /// How much of a light something may have moved in front of: all of it, or of the surroundings the part of the view that movers take.
    fn covered(&self, light: usize, position: Vec3, normal: Vec3) -> f32 {
        if self.movers.is_empty() {
            return 0.0;
        }
        let Some(&Reach { ball, instance: own }) = self.reaches.get(light) else { return 0.0 };
        let mut others = self.movers.iter().filter(|mover| Some(mover.2) != own);
        match ball {
            Some(ball) => f32::from(others.any(|mover| meets(position, ball, (mover.0, mover.1)))),
            None if own.is_some() => 0.0,
            None => others
                .map(|&(center, radius, _)| {
                    let offset = center - position;
                    let distance = offset.length();
                    if normal.dot(offset) <= -radius {
                        return 0.0;
                    }
                    let sine = (radius / distance.max(radius)).min(1.0);
                    1.0 - (1.0 - sine * sine).sqrt()
                })
                .sum::<f32>()
                .min(1.0),
        }
    }
}

/// Irradiance (luminance, W/m²) of each light at one entry if nothing stood between, before and now: each asked for once.
#[derive(Default)]
pub(super) struct Arrivals(Vec<[f32; 2]>);

impl Arrivals {
    /// Forgets those of another entry.
    fn clear(&mut self, lights: usize) {
        self.0.clear();
        self.0.resize(lights, [f32::NAN; 2]);
    }

    /// Before and now.
    pub(super) fn of(&mut self, light: usize, place: &EntryPlace, changes: &Changes<'_>) -> [f32; 2] {
        let Some(known) = self.0.get_mut(light) else { return [0.0; 2] };
        if known[1].is_nan() {
            let now = changes.now.arriving(light, place.position_world, place.facing());
            let stays = !changes.lights[light] && place.is_still();
            let (position, facing) = (place.position_before_world, place.facing_before());
            let before = if stays { now } else { changes.before.arriving(light, position, facing) };
            *known = [before, now];
        }
        *known
    }
}

/// A ball that holds an instance: about the middle of its box, and just large enough for its vertices, since all entries whose light it may meet take rays
/// anew. `None` where it is not there.
fn ball_about(scene: &Scene, pose: &Pose, instance: usize) -> Option<(Vec3, f32)> {
    let bounds = scene.instance_bounds_world(pose, instance);
    if bounds.is_empty() {
        return None;
    }
    let (center, map) = (bounds.center(), pose.instances[instance].world_from_mesh);
    let farthest2 = scene
        .vertex_positions(pose, instance)
        .iter()
        .map(|vertex| map.transform_point3(*vertex).distance_squared(center))
        .fold(0.0, f32::max);
    Some((center, farthest2.sqrt()))
}

/// A ball that holds both.
fn join((a, ra): (Vec3, f32), (b, rb): (Vec3, f32)) -> (Vec3, f32) {
    let center = 0.5 * (a + b);
    (center, (a.distance(center) + ra).max(b.distance(center) + rb))
}

/// Whether a ball may hide something of a light's ball from a place.
pub(super) fn meets(
    from: Vec3,
    (light, light_radius): (Vec3, f32),
    (mover, mover_radius): (Vec3, f32),
) -> bool {
    let (to_light, to_mover) = (light - from, mover - from);
    // Most movers are far from all that lies between.
    let along = (to_light.dot(to_mover) / to_light.length_squared().max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
    let reach = light_radius + mover_radius;
    if (to_mover - to_light * along).length_squared() > reach * reach {
        return false;
    }
    let (d_light, d_mover) = (to_light.length(), to_mover.length());
    if d_light <= light_radius || d_mover <= mover_radius {
        return true;
    }
    if d_mover - mover_radius > d_light + light_radius {
        return false;
    }
    let (s_light, s_mover) = (light_radius / d_light, mover_radius / d_mover);
    let cosine = |sine: f32| (1.0 - sine * sine).max(0.0).sqrt();
    to_light.dot(to_mover) >= d_light * d_mover * (cosine(s_light) * cosine(s_mover) - s_light * s_mover)
}
