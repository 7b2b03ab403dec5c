//! Resampled importance sampling: many candidates, one of them chosen by what it would bring, one ray (\[Talbot2005\]).

use dapple_scene::ShadingPoint;
use dapple_scene::area_lights::{AreaLights, Pick};
use dapple_scene::glam::Vec3;

use super::reservoir::resample;
use super::sequence::{Draws, Sequence, stream};
use super::{DirectCost, MAX_SAMPLES, is_open, origin, trace_each};
use crate::bvh::Tracer;

/// How to resample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RisParams {
    /// Candidates a pixel, 1 … [`MAX_SAMPLES`] (brought into that range), default 32; 8 is quick. They cost no rays.
    pub candidates: u32,
    /// How the lights of candidates are picked, default by fluence.
    pub pick: Pick,
    /// How candidates spread, default on a lattice.
    pub sequence: Sequence,
    /// Seed of all samples, default 0.
    pub seed: u64,
    /// Number of the frame, default 0.
    pub frame: u64,
}

impl Default for RisParams {
    fn default() -> Self {
        RisParams { candidates: 32, pick: Pick::Fluence, sequence: Sequence::Lattice, seed: 0, frame: 0 }
    }
}

/// Writes the outgoing radiance of each point of a picture with one ray each, in parallel in the caller's rayon pool; 0 where there is none.
///
/// Unbiased. Each value depends on the scene, its point, its index and `params` alone.
///
/// # Panics
///
/// If `points` and `out` differ in length.
pub fn trace_ris(
    tracer: &Tracer,
    lights: &AreaLights<'_>,
    points: &[Option<ShadingPoint>],
    params: &RisParams,
    out: &mut [Vec3],
) -> DirectCost {
    assert_eq!(points.len(), out.len(), "one radiance for each point");
    let candidates = params.candidates.clamp(1, MAX_SAMPLES);
    trace_each(points, out, params.pick, &|_| {}, |worker, site, point| {
        let origin = origin(point);
        worker.chooser.aim(lights, origin, point.normal_world);
        let draws = Draws::new(params.sequence, params.seed, site, params.frame, candidates);
        let seed = stream(params.seed, site, params.frame, CHOICE);
        worker.cost.samples += u64::from(candidates);
        let (reservoir, seen) = resample(lights, &worker.chooser, point, origin, &draws, candidates, seed);
        let lit = seen.filter(|s| is_open(tracer, origin, s.reach, &mut worker.cost));
        point.emitted + lit.map_or(Vec3::ZERO, |s| shaded(s.value, reservoir.weight))
    })
}

/// Purpose of the random numbers that choose among candidates.
pub(super) const CHOICE: u32 = 1;

/// What a choice of that weight gives; beyond the range of `f32` nothing.
pub(super) fn shaded(value: Vec3, weight: f32) -> Vec3 {
    let product = value * weight;
    if product.is_finite() { product } else { Vec3::ZERO }
}
