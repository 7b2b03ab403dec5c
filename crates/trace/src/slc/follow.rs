//! Cones that follow lights which moved, before they are updated by rays.

use dapple_scene::area_lights::{AreaLights, Facing};
use dapple_scene::glam::Vec3;
use dapple_store::cones::{LightSet, MOST_MOMENT_CONES, MomentEntry, ReAim};

use super::EntryPlace;
use super::changes::{Arrivals, Changes};

/// Turns the cones of lights that moved after them. `arrivals` as [`Changes::of`] left them.
pub(super) fn follow(
    entry: &mut MomentEntry,
    place: &EntryPlace,
    changes: &Changes<'_>,
    arrivals: &mut Arrivals,
) {
    let moved = !place.is_still();
    let turns = |set: LightSet| {
        moved || (0u32..).zip(&changes.lights).any(|(light, changed)| *changed && set.may_hold(light))
    };
    let (alone, several) = sets_of(entry, turns);
    for set in alone {
        let Some(light) = set.single().map(|light| light as usize) else { continue };
        let Some(then) = changes.before.bounds(light) else { continue };
        let gone = changes.now.bounds(light).is_none();
        let now = changes.now.bounds(light).unwrap_or(then);
        let (a, b) = (then.0 - place.position_before_world, now.0 - place.position_world);
        let (Some(from), Some(to)) = (a.try_normalize(), b.try_normalize()) else { continue };
        let fluence = |lights: &AreaLights<'_>, position| lights.arriving(light, position, Vec3::ZERO);
        let fluence_before = fluence(changes.before, place.position_before_world);
        let fluence_after = if gone { 0.0 } else { fluence(changes.now, place.position_world) };
        let before = fluence_before * mean_cosine(&place.facing_before(), a, then.1);
        let after = fluence_after * mean_cosine(&place.facing(), b, now.1);
        // What a cone has of fluence came from above the horizon.
        let fluence_before = fluence_before * part_above(place.normal_before_world, a, then.1);
        let fluence_after = fluence_after * part_above(place.normal_world, b, now.1);
        if before <= 0.0 || then.1 <= 0.0 {
            continue;
        }
        let size_ratio = (now.1 / b.length()) / (then.1 / a.length());
        let aim = ReAim {
            from,
            to,
            energy_ratio: after / before,
            fluence_ratio: fluence_after / fluence_before,
            most_cosine: place.facing().largest_cosine(b, now.1),
            size_ratio,
        };
        entry.re_aim(set, &aim);
    }
    follow_several(entry, several, place, changes, arrivals);
}

/// Lights that those of an entry's cones are of which `turns` says of, each set once: of one light, and of several. What is left over is of none.
fn sets_of(
    entry: &MomentEntry,
    turns: impl Fn(LightSet) -> bool,
) -> ([LightSet; MOST_MOMENT_CONES], [LightSet; MOST_MOMENT_CONES]) {
    let (mut alone, mut several) = Default::default();
    for cone in entry.cones().iter().filter(|cone| turns(cone.lights)) {
        let sets: &mut [LightSet; MOST_MOMENT_CONES] =
            if cone.lights.single().is_some() { &mut alone } else { &mut several };
        let place = sets.iter_mut().find(|set| **set == cone.lights || **set == LightSet::NONE);
        if let Some(set) = place {
            *set = cone.lights;
        }
    }
    (alone, several)
}

/// Turns and scales cones of several lights by what these would bring together if nothing were in their way: as long as few samples are, what moves takes
/// its light along.
fn follow_several(
    entry: &mut MomentEntry,
    sets: [LightSet; MOST_MOMENT_CONES],
    place: &EntryPlace,
    changes: &Changes<'_>,
    arrivals: &mut Arrivals,
) {
    let count = sets.iter().take_while(|set| **set != LightSet::NONE).count();
    if count == 0 {
        return;
    }
    // Irradiance of each set before and now, and that × direction.
    let mut sums = [[(0.0, Vec3::ZERO); 2]; MOST_MOMENT_CONES];
    for light in 0..changes.now.len() {
        if sets[..count].iter().all(|set| !set.may_hold(light as u32)) {
            continue;
        }
        let energies = arrivals.of(light, place, changes);
        let positions = [place.position_before_world, place.position_world];
        let of = [changes.before, changes.now];
        for then in 0..2 {
            if energies[then] <= 0.0 {
                continue;
            }
            // Surroundings have no direction of their own, here.
            let to_light = of[then].bounds(light).map(|ball| ball.0 - positions[then]);
            let moment = to_light.unwrap_or(Vec3::ZERO).normalize_or_zero() * energies[then];
            for (set, sum) in sets.iter().zip(&mut sums) {
                if set.may_hold(light as u32) {
                    sum[then] = (sum[then].0 + energies[then], sum[then].1 + moment);
                }
            }
        }
    }
    for (set, [(before, from), (now, to)]) in sets.into_iter().zip(sums).take(count) {
        if before <= 0.0 {
            continue;
        }
        // Some of what a set may hold it does not, and something hides some of it.
        let ratio = (now / before).min(MOST_GROWTH);
        let spread = |energy: f32, moment: Vec3| 1.0 - moment.length() / energy + LEAST_SPREAD;
        let wider = if now > 0.0 { spread(now, to) / spread(before, from) } else { 1.0 };
        let size_ratio = wider.clamp(1.0 / MOST_GROWTH, MOST_GROWTH).sqrt();
        let to = if now > 0.0 { to } else { from };
        entry.re_aim(
            set,
            &ReAim { from, to, energy_ratio: ratio, fluence_ratio: ratio, most_cosine: 1.0, size_ratio },
        );
    }
}

/// Most that a cone of several lights, and its solid angle, grow in a frame.
const MOST_GROWTH: f32 = 4.0;
/// Spread of directions that counts as none.
const LEAST_SPREAD: f32 = 1e-3;

/// Mean cosine of light from a ball at an offset: that to its centre while all of it is above the horizon, and from there on falling with what is left
/// above; no less than what grazes the place counts with.
fn mean_cosine(facing: &Facing, offset: Vec3, radius: f32) -> f32 {
    let distance = offset.length();
    if distance <= radius {
        return 1.0;
    }
    let (cosine, sine) = (facing.normal_world.dot(offset) / distance, radius / distance);
    let height = facing.ground_world.dot(offset) / radius.max(f32::MIN_POSITIVE);
    let least = facing.least_cosine * (0.5 + 0.5 * height).clamp(0.0, 1.0);
    if cosine >= sine {
        return cosine.max(least);
    }
    let above = (cosine + sine).max(0.0);
    (above * above / (4.0 * sine.max(f32::MIN_POSITIVE))).max(least)
}

/// Part of a ball at an offset that is above the horizon, by its height; what is less than a tenth counts as that, since ratios of it say nothing.
fn part_above(normal: Vec3, offset: Vec3, radius: f32) -> f32 {
    (0.5 + 0.5 * normal.dot(offset) / radius.max(f32::MIN_POSITIVE)).clamp(0.1, 1.0)
}
