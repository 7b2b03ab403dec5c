//! How much of each light is seen from each point of a layout, and which of it has to be found again from one moment to the next.
//!
//! A value is the share of a light's unoccluded irradiance that arrives. A point draws the same places of a light at every moment, so what
//! changes of a value is what moved, not which rays were drawn.

#[cfg(test)]
mod tests;
mod tracker;

use dapple_scene::area_lights::{AreaLights, luminance};
use dapple_scene::glam::Vec3;
use dapple_store::light_visibility::{
    Lean, LightChange, LightVisibility, LightVisibilityError, OPEN, lean_frame, quantized,
};
use dapple_store::points::PointLayout;
use rayon::prelude::*;

pub use tracker::{LightTracker, TrackerParams};

use crate::bvh::{MAX_DIRECTIONS, Tracer, offset_origin};
use crate::direct::{Draws, Sequence};
use crate::rtao::Site;
use crate::sampling::hash;

/// Draws for one ray at the most: places that are turned away or below the horizon cost a draw, and no ray.
const DRAWS_PER_RAY: u32 = 4;

/// Points of a task.
const CHUNK: usize = 256;

/// How the visibility of lights is traced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VisibilityParams {
    /// Rays from a point to a light, 1 … 256 (brought into that range), default 16.
    pub rays: u32,
    /// If so many first rays agree, the others are not sent; default 4. At least `rays`: all are always sent.
    pub first: u32,
    /// Seed of the places on lights, default 0.
    pub seed: u64,
}

impl Default for VisibilityParams {
    fn default() -> Self {
        VisibilityParams { rays: 16, first: 4, seed: 0 }
    }
}

/// What it took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct VisibilityCounts {
    /// Pairs of a point and a light that were looked at again.
    pub traced: u64,
    /// Of these, whose value is another, or leans elsewhere.
    pub changed: u64,
    /// Rays.
    pub rays: u64,
}

impl std::ops::Add for VisibilityCounts {
    type Output = VisibilityCounts;

    fn add(self, other: VisibilityCounts) -> VisibilityCounts {
        VisibilityCounts {
            traced: self.traced + other.traced,
            changed: self.changed + other.changed,
            rays: self.rays + other.rays,
        }
    }
}

/// Finds all values, in parallel in the caller's rayon pool. `sites` are the points of `layout`, in its order, as
/// [`GeneratedPoints::sites_world`](crate::psao::generate::GeneratedPoints::sites_world) has them; missing ones count as points without any.
///
/// A point that a light does not reach takes over the value of the point before it, which costs next to nothing to send. `glossy` says of which points it is
/// to be found where on a light lies what they see of it; without it no leans are held.
///
/// # Errors
/// More points and lights than fit.
pub fn trace_visibility(
    layout: &PointLayout,
    (sites, glossy): (&[Option<Site>], Option<&[bool]>),
    tracer: &Tracer,
    lights: &AreaLights<'_>,
    params: &VisibilityParams,
) -> Result<(LightVisibility, VisibilityCounts), LightVisibilityError> {
    let count = u32::try_from(lights.len()).unwrap_or(u32::MAX);
    // Refuses what is too much before anything is traced.
    let open = LightVisibility::open(layout, count)?;
    let mut values = open.values().to_vec();
    let mut leans = glossy.map(|_| vec![Lean::NONE; values.len()]);
    let mut counts = VisibilityCounts::default();
    for (light, plane) in values.chunks_mut(layout.len().max(1)).enumerate() {
        let found = trace_light((sites, glossy), (light, lights), tracer, params);
        counts = found.iter().fold(counts, |sum, chunk| sum + chunk.1);
        let mut found = found.iter().flat_map(|chunk| &chunk.0).peekable();
        let (mut last, first) = (OPEN, light * layout.len());
        for (point, value) in plane.iter_mut().enumerate() {
            if let Some((_, new, lean)) = found.next_if(|(at, ..)| *at == point) {
                last = *new;
                if let Some(leans) = &mut leans {
                    leans[first + point] = *lean;
                }
            }
            *value = last;
        }
    }
    let held = LightVisibility::new(layout, count, values)?;
    Ok((if let Some(leans) = leans { held.with_leans(leans)? } else { held }, counts))
}

/// Finds all values again, whatever changed; what a light does not reach stays. Gives the changes, which `values` has already.
pub fn retrace_visibility(
    values: &mut LightVisibility,
    (sites, glossy): (&[Option<Site>], Option<&[bool]>),
    tracer: &Tracer,
    lights: &AreaLights<'_>,
    params: &VisibilityParams,
) -> (Vec<LightChange>, VisibilityCounts) {
    let (mut changed, mut counts) = (Vec::new(), VisibilityCounts::default());
    for light in 0..lights.len().min(values.lights() as usize) {
        let found = trace_light((sites, glossy), (light, lights), tracer, params);
        let before = values.of_light(light as u32);
        let start = light * values.points();
        for (list, chunk) in &found {
            counts = counts + *chunk;
            for &(point, new, new_lean) in list {
                let (Some(&old), old_lean) = (before.get(point), values.lean(start + point)) else {
                    continue;
                };
                if old != new || old_lean != new_lean {
                    changed.push(LightChange { index: (start + point) as u32, old, new, old_lean, new_lean });
                }
            }
        }
    }
    counts.changed = changed.len() as u64;
    // All of these are there: they were compared with what is.
    let applied = values.apply(&changed);
    debug_assert!(applied.is_ok());
    (changed, counts)
}

/// What one task found: points, their values and leans, in order.
type Found = (Vec<(usize, u8, Lean)>, VisibilityCounts);

/// Values of one light at those points that it reaches.
fn trace_light(
    (sites, glossy): (&[Option<Site>], Option<&[bool]>),
    (light, lights): (usize, &AreaLights<'_>),
    tracer: &Tracer,
    params: &VisibilityParams,
) -> Vec<Found> {
    let chunk = |(chunk, sites): (usize, &[Option<Site>])| {
        let (mut list, mut counts) = (Vec::new(), VisibilityCounts::default());
        let mut worker = Worker::default();
        for (i, site) in sites.iter().enumerate() {
            let point = chunk * CHUNK + i;
            let Some(site) = site.as_ref().filter(|site| is_usable(site)) else { continue };
            if lights.arriving(light, site.position_world, site.normal_world) <= 0.0 {
                continue;
            }
            let wants_lean = glossy.is_some_and(|glossy| glossy.get(point) == Some(&true));
            let found = worker.value(tracer, (light, lights), (site, wants_lean), params, &mut counts.rays);
            if let Some((value, lean)) = found {
                counts.traced += 1;
                list.push((point, value, lean));
            }
        }
        (list, counts)
    };
    sites.par_chunks(CHUNK).enumerate().map(chunk).collect()
}

fn is_usable(site: &Site) -> bool {
    site.position_world.is_finite() && site.normal_world.is_finite() && site.normal_world != Vec3::ZERO
}

/// Buffers of one task.
#[derive(Default)]
struct Worker {
    reaches: Vec<Vec3>,
    shares: Vec<f32>,
    /// With `wants_lean`: what all rays so far say of directions and solid angles.
    directions: Directions,
}

/// Sums over samples of a light.
#[derive(Clone, Copy, Default)]
struct Directions {
    /// Of share × direction: of all, and of what is seen.
    all: Vec3,
    seen: Vec3,
    /// Of solid angle, 1 / density, and of it × direction.
    sr: f32,
    vector: Vec3,
}

impl Worker {
    /// The value of a light at a point, and if that is wanted where what is seen lies; `None` if no place of the light was found that could shine there.
    fn value(
        &mut self,
        tracer: &Tracer,
        (light, lights): (usize, &AreaLights<'_>),
        (site, wants_lean): (&Site, bool),
        params: &VisibilityParams,
        rays: &mut u64,
    ) -> Option<(u8, Lean)> {
        let most = params.rays.clamp(1, MAX_DIRECTIONS as u32);
        let origin = offset_origin(site.position_world, site.normal_world);
        let name =
            u64::from(hash(site.key, light as u64, 0)) << 32 | u64::from(hash(site.key, light as u64, 1));
        let draws = Draws::new(Sequence::Lattice, params.seed, name, 0, 1);
        let (mut all, mut seen, mut next) = (0.0f32, 0.0f32, 0);
        let mut sent = 0;
        self.directions = Directions::default();
        for goal in [params.first.clamp(1, most), most] {
            self.reaches.clear();
            self.shares.clear();
            while sent < goal && next < most * DRAWS_PER_RAY {
                let sample = lights.sample_light(light as u32, origin, draws.at(next));
                next += 1;
                let Some(sample) = sample else { continue };
                let cosine = site.normal_world.dot(sample.to_light_world);
                let share = cosine * luminance(sample.radiance) / sample.density_per_sr;
                if share > 0.0 && share.is_finite() {
                    self.reaches.push(sample.reach());
                    self.shares.push(share);
                    if wants_lean {
                        let sr = 1.0 / sample.density_per_sr;
                        self.directions.sr += sr;
                        self.directions.vector += sample.to_light_world * sr;
                    }
                    sent += 1;
                }
            }
            let blocked = tracer.occlusion(origin, &self.reaches, 1.0);
            *rays += self.reaches.len() as u64;
            for (i, share) in self.shares.iter().enumerate() {
                all += share;
                let is_seen = blocked[i / 64] >> (i % 64) & 1 == 0;
                if is_seen {
                    seen += share;
                }
                if wants_lean {
                    let part = self.reaches[i].normalize_or_zero() * *share;
                    self.directions.all += part;
                    self.directions.seen += if is_seen { part } else { Vec3::ZERO };
                }
            }
            if seen == 0.0 || seen == all {
                break;
            }
        }
        if !(all > 0.0 && all.is_finite()) {
            return None;
        }
        let value = quantized(seen / all);
        let lean = if wants_lean { self.directions.lean() } else { Lean::NONE };
        Some((value, lean.of_value(value)))
    }
}

impl Directions {
    /// How far the middle of what is seen lies from that of all, in sines of the angle of a cap whose directions are as far apart as the light's.
    fn lean(&self) -> Lean {
        let (Some(all), Some(seen)) = (self.all.try_normalize(), self.seen.try_normalize()) else {
            return Lean::NONE;
        };
        // The mean direction of a cap is (1 + cos a) / 2 long; from below, what two numbers of about one differ by is noise.
        let depth = (2.0 * (1.0 - self.vector.length() / self.sr)).max(1e-6);
        let sine = (depth * (2.0 - depth)).sqrt();
        // Of more than a hemisphere there is no side; nor of what is no number.
        if depth >= 1.0 || !sine.is_finite() {
            return Lean::NONE;
        }
        let offset = (seen - all) / sine;
        Lean::quantized(lean_frame(all).map(|across| across.dot(offset)))
    }
}
