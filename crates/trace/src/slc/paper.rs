//! The paper's update of bounding cones ([Stadlbauer2023] sec. 3.1): samples, then a probe at the rim of every cone.

use std::sync::atomic::{AtomicU64, Ordering};

use dapple_scene::area_lights::{self, AreaLights, Pick};
use dapple_scene::glam::Vec3;
use dapple_store::cones::{BoundingEntry, BoundingParams, ConeCache, Probe, UpdateQueue};

use super::{
    Changes, EntryPlaces, MAX_SAMPLES, SlcCounts, Source, Update, chooser_for, site_of, take_samples,
};
use crate::bvh::{Tracer, offset_origin};
use crate::direct::Sequence;
use crate::sampling::{hash, unit_interval};

/// How bounding cones are updated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PaperParams {
    /// How samples and probes change cones.
    pub bounding: BoundingParams,
    /// Samples of an update while an entry is young or changes, 1 … [`MAX_SAMPLES`], default 8 (sec. 4).
    pub first_samples: u32,
    /// Updates with that many, default 8 (sec. 4). An entry whose confidence falls below them, because its cones turn, gets them again.
    pub first_updates: u32,
    /// Samples of an update after that, default 1 (sec. 4).
    pub samples: u32,
    /// Whether rims are probed. Default true.
    pub probes: bool,
    /// How lights are picked, default by power (sec. 3.1).
    pub pick: Pick,
    /// Where samples lie, default anywhere.
    pub sequence: Sequence,
    /// Seed of samples and probes, default 0.
    pub seed: u64,
}

impl Default for PaperParams {
    fn default() -> Self {
        PaperParams {
            bounding: BoundingParams::default(),
            first_samples: 8,
            first_updates: 8,
            samples: 1,
            probes: true,
            pick: Pick::Power,
            sequence: Sequence::Random,
            seed: 0,
        }
    }
}

/// All of sec. 3.1, in fluence. It knows of changes only what its cones show.
impl Update for BoundingEntry {
    type Params = PaperParams;

    fn update_queue(
        cache: &mut ConeCache<Self>,
        queue: &UpdateQueue,
        places: &EntryPlaces,
        tracer: &Tracer,
        changes: &Changes<'_>,
        params: &PaperParams,
    ) -> SlcCounts {
        let rays = AtomicU64::new(0);
        let lights = changes.lights();
        let PaperParams { pick, sequence, seed, .. } = *params;
        let source = Source { pick, sequence, seed, with_cosine: false };
        let updated = cache.update(queue, |index, texel, entry| {
            let (Some(place), false) = (places.get(index), lights.is_empty()) else { return false };
            let young = u32::from(entry.samples()) < params.first_samples * params.first_updates;
            let count = if young { params.first_samples } else { params.samples }.min(MAX_SAMPLES);
            let site = site_of(texel.instance, texel.place.triangle, texel.place.barycentrics);
            let taken = entry.taken();
            let indices = (0..count).map(|i| taken.wrapping_add(i));
            let chooser = chooser_for(lights, place, &source);
            let drawn = take_samples(tracer, lights, &chooser, place, &source, site, indices);
            let mut traced = drawn.rays;
            let mut cycle = entry.update(&drawn.samples, count, &params.bounding);
            if params.probes {
                let from = offset_origin(place.position_world, place.normal_world);
                let probes: Vec<Probe> = (0..entry.cones().len())
                    .filter_map(|cone| {
                        let turn =
                            unit_interval(hash(seed ^ PROBES, site, taken.wrapping_mul(8) + cone as u32));
                        let direction = entry.probe_direction(cone, turn, &params.bounding)?;
                        let hit =
                            place.normal_world.dot(direction) > 0.0 && meets(tracer, lights, from, direction);
                        Some(Probe { cone, direction, hit })
                    })
                    .collect();
                traced += probes.len() as u64;
                entry.probe(&probes, &params.bounding, &mut cycle);
            }
            rays.fetch_add(traced, Ordering::Relaxed);
            true
        });
        SlcCounts { updated: updated.unwrap_or(0), rays: rays.into_inner(), changed: 0 }
    }
}

/// Keeps probes' random numbers apart from those of samples.
const PROBES: u64 = 0x70_726f_6265;

/// Whether a ray ends at a light.
fn meets(tracer: &Tracer, lights: &AreaLights<'_>, from: Vec3, direction: Vec3) -> bool {
    lights.hit(from, direction).is_some_and(|distance| {
        let blocked = tracer.occlusion(from, &[area_lights::reach(direction, distance)], 1.0);
        blocked[0] & 1 == 0
    })
}
