//! Direct light of area lights at places that a viewer sees, by rays: the truth of surface light cones, and their rivals.
//!
//! - takes: a [`Tracer`], [`AreaLights`], [`ShadingPoint`]s of one picture, [`DirectParams`]
//! - returns: the radiance that leaves each towards the viewer, emitted and reflected of lights, and how many rays that took
//!
//! `README.md` has equations, parameters, cost and failure cases.

mod reservoir;
mod restir;
mod ris;
mod sequence;
#[cfg(test)]
mod tests;

use std::ops::AddAssign;
use std::sync::atomic::{AtomicU64, Ordering};

use dapple_scene::ShadingPoint;
use dapple_scene::area_lights::{AreaLights, Chooser, LightSample, Pick};
use dapple_scene::glam::{DVec3, Vec3};
use rayon::prelude::*;

pub use restir::{NO_PIXEL, Past, Restir, RestirParams, RestirView};
pub use ris::{RisParams, trace_ris};
pub use sequence::Sequence;

use crate::bvh::{MAX_DIRECTIONS, Ray, Tracer, offset_origin};
pub(crate) use sequence::Draws;

/// Most samples a pixel.
pub const MAX_SAMPLES: u32 = 65_536;

/// Pixels traced by one task, and the steps of progress.
const CHUNK: usize = 256;

/// How to trace the direct light of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DirectParams {
    /// Samples of lights a pixel, 1 … [`MAX_SAMPLES`] (brought into that range), default 16. Each costs at most one ray.
    pub samples: u32,
    /// How lights are picked, default by fluence.
    pub pick: Pick,
    /// How samples spread, default on a lattice.
    pub sequence: Sequence,
    /// Seed of all samples, default 0.
    pub seed: u64,
    /// Number of the frame, default 0: each has samples of its own.
    pub frame: u64,
}

impl Default for DirectParams {
    fn default() -> Self {
        DirectParams { samples: 16, pick: Pick::Fluence, sequence: Sequence::Lattice, seed: 0, frame: 0 }
    }
}

/// What light took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DirectCost {
    /// Rays traced.
    pub rays: u64,
    /// Places on lights that were chosen or evaluated again.
    pub samples: u64,
}

impl AddAssign for DirectCost {
    fn add_assign(&mut self, other: DirectCost) {
        self.rays += other.rays;
        self.samples += other.samples;
    }
}

/// Writes the outgoing radiance of each point of a picture, in parallel in the caller's rayon pool; 0 where there is none.
///
/// Each value depends on the scene, its point, its index and `params` alone: not on the other points nor the number of threads. Samples that
/// bring nothing whatever stands between cost no ray; what is beyond the range of `f32` counts as nothing.
///
/// # Panics
///
/// If `points` and `out` differ in length.
pub fn trace_direct(
    tracer: &Tracer,
    lights: &AreaLights<'_>,
    points: &[Option<ShadingPoint>],
    params: &DirectParams,
    out: &mut [Vec3],
) -> DirectCost {
    trace_direct_with_progress(tracer, lights, points, params, out, &|_| {})
}

/// [`trace_direct`] that calls `progress` with the number of points done so far, every few hundred points.
///
/// Calls come from the pool's threads, and may arrive out of order; the largest number is the latest.
///
/// # Panics
///
/// If `points` and `out` differ in length.
pub fn trace_direct_with_progress(
    tracer: &Tracer,
    lights: &AreaLights<'_>,
    points: &[Option<ShadingPoint>],
    params: &DirectParams,
    out: &mut [Vec3],
    progress: &(dyn Fn(u64) + Sync),
) -> DirectCost {
    assert_eq!(points.len(), out.len(), "one radiance for each point");
    let samples = params.samples.clamp(1, MAX_SAMPLES);
    trace_each(points, out, params.pick, progress, |worker, site, point| {
        let draws = Draws::new(params.sequence, params.seed, site, params.frame, samples);
        point.emitted + worker.direct(tracer, lights, point, &draws, samples)
    })
}

/// Fills a picture from its points; those that are not there, or not finite, are left black.
fn trace_each(
    points: &[Option<ShadingPoint>],
    out: &mut [Vec3],
    pick: Pick,
    progress: &(dyn Fn(u64) + Sync),
    trace: impl Fn(&mut Worker, u64, &ShadingPoint) -> Vec3 + Sync,
) -> DirectCost {
    update(out, pick, progress, |worker, i, out| {
        *out = usable(points, i).map_or(Vec3::ZERO, |p| trace(worker, i as u64, p));
    })
}

/// Goes over a list in parallel; each task has buffers of its own.
fn update<T: Send>(
    list: &mut [T],
    pick: Pick,
    progress: &(dyn Fn(u64) + Sync),
    change: impl Fn(&mut Worker, usize, &mut T) + Sync,
) -> DirectCost {
    let done = AtomicU64::new(0);
    let tasks = list.par_chunks_mut(CHUNK).enumerate().map(|(chunk, items)| {
        let mut worker = Worker::new(pick);
        for (i, item) in items.iter_mut().enumerate() {
            change(&mut worker, chunk * CHUNK + i, item);
        }
        let before = done.fetch_add(items.len() as u64, Ordering::Relaxed);
        progress(before + items.len() as u64);
        worker.cost
    });
    tasks.reduce(DirectCost::default, |mut a, b| {
        a += b;
        a
    })
}

/// A point that is there and that rays can leave.
fn usable(points: &[Option<ShadingPoint>], index: usize) -> Option<&ShadingPoint> {
    let point = points.get(index)?.as_ref()?;
    let normal = point.normal_world;
    (point.position_world.is_finite() && normal.is_finite() && normal != Vec3::ZERO).then_some(point)
}

/// Where rays leave a point. Places on lights are chosen from there too, so that a ray ends where its sample lies.
fn origin(point: &ShadingPoint) -> Vec3 {
    offset_origin(point.position_world, point.normal_world)
}

/// What a sample brings to a viewer if nothing stands between; `None` if that is nothing, or no number.
fn contribution(point: &ShadingPoint, sample: &LightSample) -> Option<Vec3> {
    let value = point.reflected(sample.to_light_world) * sample.radiance / sample.density_per_sr;
    (value.is_finite() && value != Vec3::ZERO).then_some(value)
}

/// Whether nothing stands along a vector.
fn is_open(tracer: &Tracer, origin_world: Vec3, reach: Vec3, cost: &mut DirectCost) -> bool {
    cost.rays += 1;
    !tracer.occluded(&Ray { origin_world, direction_world: reach, t_max: 1.0 })
}

/// Buffers of one task.
struct Worker {
    chooser: Chooser,
    reaches: Vec<Vec3>,
    values: Vec<Vec3>,
    cost: DirectCost,
}

impl Worker {
    fn new(pick: Pick) -> Worker {
        let (reaches, values) = (Vec::with_capacity(MAX_DIRECTIONS), Vec::with_capacity(MAX_DIRECTIONS));
        Worker { chooser: Chooser::new(pick), reaches, values, cost: DirectCost::default() }
    }

    /// Mean of what samples bring of those lights that a point sees.
    fn direct(
        &mut self,
        tracer: &Tracer,
        lights: &AreaLights<'_>,
        point: &ShadingPoint,
        draws: &Draws,
        samples: u32,
    ) -> Vec3 {
        let origin = origin(point);
        self.chooser.aim(lights, origin, point.normal_world);
        self.cost.samples += u64::from(samples);
        // In doubles: thousands of samples of very different sizes.
        let mut sum = DVec3::ZERO;
        for index in 0..samples {
            if let Some(sample) = lights.sample(&self.chooser, origin, draws.at(index))
                && let Some(value) = contribution(point, &sample)
            {
                self.reaches.push(sample.reach());
                self.values.push(value);
            }
            if self.reaches.len() == MAX_DIRECTIONS || index + 1 == samples {
                sum += self.open(tracer, origin);
            }
        }
        let mean = sum / f64::from(samples);
        mean.min(DVec3::splat(f64::from(f32::MAX))).as_vec3()
    }

    /// Sum of the values gathered whose rays are free.
    fn open(&mut self, tracer: &Tracer, origin: Vec3) -> DVec3 {
        let mut sum = DVec3::ZERO;
        if !self.reaches.is_empty() {
            let blocked = tracer.occlusion(origin, &self.reaches, 1.0);
            for (i, value) in self.values.iter().enumerate() {
                if blocked[i / 64] >> (i % 64) & 1 == 0 {
                    sum += value.as_dvec3();
                }
            }
            self.cost.rays += self.reaches.len() as u64;
        }
        self.reaches.clear();
        self.values.clear();
        sum
    }
}
