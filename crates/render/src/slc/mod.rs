//! Shades what a viewer sees with light cones of the on-surface cache ([Stadlbauer2023] sec. 3.2, in the ratio form).
//!
//! - takes: shading points ([`crate::shade::shading_points`]) and places in the charts ([`pixel_places`]) of all samples, a [`ConeCache`], where
//!   its entries are in the world
//! - returns: outgoing radiance of each sample, emission and direct light
//!
//! No ray is traced: visibility is in the cones. Equations in `README.md`.

pub(crate) mod cap;
mod places;
#[cfg(test)]
mod tests;

use dapple_scene::ShadingPoint;
use dapple_store::cones::{
    BoundingEntry, ConeCache, ConeEntry, EntryId, LookUp, MomentEntry, PixelPlace, Reader,
};
use glam::Vec3;
use rayon::prelude::*;

pub use cap::{Cap, Form, Samples};
pub use places::pixel_places;

/// An entry whose cones can be shaded with.
pub trait Caps {
    /// Calls with every cone of it.
    fn each_cap(&self, cap: impl FnMut(Cap));
}

impl Caps for MomentEntry {
    fn each_cap(&self, mut cap: impl FnMut(Cap)) {
        for cone in self.cones() {
            cap(Cap { direction: cone.direction(), cos_angle: cone.cos_angle(), energy: cone.energy });
        }
    }
}

impl Caps for BoundingEntry {
    fn each_cap(&self, mut cap: impl FnMut(Cap)) {
        for cone in self.cones() {
            cap(Cap { direction: cone.direction, cos_angle: libm::cosf(cone.angle), energy: cone.energy });
        }
    }
}

/// How cones are shaded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlcShading {
    /// Which entries a sample reads; as the requests were made with.
    pub look_up: LookUp,
    /// Whether energies are irradiance (default) or fluence.
    pub form: Form,
    /// Directions in each cone, default as many as it and the material need.
    pub samples: Samples,
}

impl Default for SlcShading {
    fn default() -> Self {
        SlcShading { look_up: LookUp::default(), form: Form::Ratio, samples: Samples::Adaptive }
    }
}

/// Outgoing radiance of every sample: what it emits and what it reflects of the light in the cones about it. Samples that see nothing
/// are 0, and those that no entry is known for only emit.
///
/// `place_of` gives the position and the unit normal, in the world, of an entry; entries that it does not know are left out.
///
/// # Panics
/// If the lists differ in length.
pub fn shade_cones<E: ConeEntry + Caps>(
    cache: &ConeCache<E>,
    place_of: impl Fn(EntryId) -> Option<(Vec3, Vec3)> + Sync,
    points: &[Option<ShadingPoint>],
    pixels: &[Option<PixelPlace>],
    shading: &SlcShading,
) -> Vec<Vec3> {
    assert_eq!(points.len(), pixels.len(), "one place a point");
    let mut radiance = vec![Vec3::ZERO; points.len()];
    let all = radiance.par_chunks_mut(CHUNK).zip(points.par_chunks(CHUNK)).zip(pixels.par_chunks(CHUNK));
    all.for_each_init(
        || Reader::new(cache, shading.look_up),
        |reader, ((radiance, points), pixels)| {
            for ((out, point), pixel) in radiance.iter_mut().zip(points).zip(pixels) {
                let Some(point) = point else { continue };
                *out = point.emitted;
                if let Some(pixel) = pixel {
                    *out += shade_one(cache, reader, &place_of, point, pixel, shading);
                }
            }
        },
    );
    radiance
}

/// Samples of one task.
const CHUNK: usize = 512;

fn shade_one<E: ConeEntry + Caps>(
    cache: &ConeCache<E>,
    reader: &mut Reader<'_, E>,
    place_of: &impl Fn(EntryId) -> Option<(Vec3, Vec3)>,
    point: &ShadingPoint,
    pixel: &PixelPlace,
    shading: &SlcShading,
) -> Vec3 {
    let reads = reader.read(pixel);
    let texel_m = (pixel.footprint_m * shading.look_up.bias).max(f32::MIN_POSITIVE);
    let mut found = [(EntryId::default(), 0.0f32, Vec3::ZERO); 4];
    let mut count = 0;
    let (mut total, mut plain) = (0.0, 0.0);
    for &(id, weight) in reads.entries() {
        let Some((position, normal)) = place_of(id) else { continue };
        // Entries on other faces, or off the plane, see other light.
        let facing = point.normal_world.dot(normal).max(0.0);
        let facing = facing * facing * facing * facing;
        let off = point.normal_world.dot(position - point.position_world) / texel_m;
        let near = weight * facing * facing / (1.0 + off * off);
        found[count] = (id, near, normal);
        total += near;
        plain += weight;
        count += 1;
    }
    if count == 0 {
        return Vec3::ZERO;
    }
    let lens = cap::Lens::of(point);
    let mut sum = Vec3::ZERO;
    for (i, &(id, near, normal)) in found[..count].iter().enumerate() {
        // Where none is like the place, any is better than darkness.
        let weight = if total > 1e-4 * plain { near / total } else { reads.entries()[i].1 / plain };
        if weight <= 1e-3 {
            continue;
        }
        let Some(entry) = cache.entry(id) else { continue };
        entry.each_cap(|cap| sum += lens.shade(&cap, normal, shading) * weight);
    }
    sum
}
