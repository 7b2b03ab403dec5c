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
    BoundingCone, BoundingEntry, ConeCache, ConeEntry, EntryId, EntrySite, LookUp, MomentEntry, PixelPlace,
    Reader, luminance,
};
use glam::Vec3;
use rayon::prelude::*;

pub use cap::{Cap, Form, Samples};
pub use places::pixel_places;

/// An entry whose cones can be shaded with.
pub trait Caps {
    /// Calls with every cone of it.
    fn each_cap(&self, cap: impl FnMut(Cap));

    /// Irradiance of all its cones on a surface with this unit normal at its place, W/m², as if no cone crossed the horizon.
    fn irradiance(&self, normal_world: Vec3) -> Vec3;
}

impl Caps for MomentEntry {
    fn each_cap(&self, mut cap: impl FnMut(Cap)) {
        for cone in self.cones() {
            let (direction, cos_angle) = cone.axis();
            cap(Cap { direction, cos_angle, energy: cone.energy, mean_cosine: cone.mean_cosine() });
        }
    }

    /// By moments: n·m is what arrives by the cosine to n, and the energy's luminance that by the entry's own.
    fn irradiance(&self, normal_world: Vec3) -> Vec3 {
        self.cones().iter().fold(Vec3::ZERO, |sum, cone| {
            let own = luminance(cone.energy).max(f32::MIN_POSITIVE);
            sum + cone.energy * (normal_world.dot(cone.moment).max(0.0) / own)
        })
    }
}

impl Caps for BoundingEntry {
    fn each_cap(&self, mut cap: impl FnMut(Cap)) {
        for cone in self.cones() {
            cap(Cap {
                direction: cone.direction,
                cos_angle: libm::cosf(cone.angle),
                energy: cone.energy,
                mean_cosine: 1.0,
            });
        }
    }

    fn irradiance(&self, normal_world: Vec3) -> Vec3 {
        let of = |cone: &BoundingCone| cone.energy * normal_world.dot(cone.direction).max(0.0);
        self.cones().iter().fold(Vec3::ZERO, |sum, cone| sum + of(cone))
    }
}

/// What is shaded of the entries that a sample blends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Blending {
    /// The cones of the one that most light comes from, brought to the mean irradiance of all: a quarter of the work.
    #[default]
    Irradiance,
    /// The cones of each.
    Cones,
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
    /// How entries are blended, where [`LookUp::blend`] has several. Default by irradiance.
    pub blending: Blending,
}

impl Default for SlcShading {
    fn default() -> Self {
        SlcShading {
            look_up: LookUp::default(),
            form: Form::Ratio,
            samples: Samples::Adaptive,
            blending: Blending::default(),
        }
    }
}

/// Outgoing radiance of every sample: what it emits and what it reflects of the light in the cones about it. Samples that see nothing
/// are 0, and those that no entry is known for only emit.
///
/// `place_of` tells where an entry is; entries that it does not know are left out.
///
/// # Panics
/// If the lists differ in length.
pub fn shade_cones<E: ConeEntry + Caps>(
    cache: &ConeCache<E>,
    place_of: impl Fn(EntryId) -> Option<EntrySite> + Sync,
    points: &[Option<ShadingPoint>],
    pixels: &[Option<PixelPlace>],
    shading: &SlcShading,
) -> Vec<Vec3> {
    assert_eq!(points.len(), pixels.len(), "one place a point");
    let mut radiance = vec![Vec3::ZERO; points.len()];
    let all = radiance.par_chunks_mut(CHUNK).zip(points.par_chunks(CHUNK)).zip(pixels.par_chunks(CHUNK));
    all.for_each_init(
        || (Reader::new(cache, shading.look_up), cap::Lanes::new()),
        |(reader, lanes), ((radiance, points), pixels)| {
            for ((out, point), pixel) in radiance.iter_mut().zip(points).zip(pixels) {
                let Some(point) = point else { continue };
                *out = point.emitted;
                if let Some(pixel) = pixel {
                    *out += shade_one(cache, (reader, lanes), &place_of, point, pixel, shading);
                }
            }
        },
    );
    radiance
}

/// Samples of one task.
const CHUNK: usize = 512;

fn fourth(v: f32) -> f32 {
    let v2 = v * v;
    v2 * v2
}

fn shade_one<E: ConeEntry + Caps>(
    cache: &ConeCache<E>,
    (reader, lanes): (&mut Reader<'_, E>, &mut cap::Lanes),
    place_of: &impl Fn(EntryId) -> Option<EntrySite>,
    point: &ShadingPoint,
    pixel: &PixelPlace,
    shading: &SlcShading,
) -> Vec3 {
    let reads = reader.read(pixel);
    let texel_m = (pixel.footprint_m * shading.look_up.bias).max(f32::MIN_POSITIVE);
    let nowhere = cap::Ground { normal: Vec3::ZERO, normal_shading: Vec3::ZERO };
    let mut found = [(EntryId::default(), [0.0f32; 2], nowhere); 4];
    let mut count = 0;
    let (mut total, mut plain) = (0.0, 0.0);
    for &(id, weight) in reads.entries() {
        let Some(site) = place_of(id) else { continue };
        // Entries on other faces, or off the plane, see other light.
        let facing = fourth(point.normal_world.dot(site.normal_world).max(0.0));
        let leaning = fourth(point.normal_shading_world.dot(site.normal_shading_world).max(0.0));
        let off = point.normal_world.dot(site.position_world - point.position_world) / texel_m;
        let near = weight * (facing * facing) * leaning / (1.0 + off * off);
        let ground = cap::Ground { normal: site.normal_world, normal_shading: site.normal_shading_world };
        found[count] = (id, [near, weight], ground);
        total += near;
        plain += weight;
        count += 1;
    }
    if count == 0 {
        return Vec3::ZERO;
    }
    let mut lens = cap::Lens::of(point, shading, lanes);
    let mut mean = Vec3::ZERO;
    let mut heaviest: Option<(f32, Vec3, &E, cap::Ground)> = None;
    for &(id, [near, weight], ground) in &found[..count] {
        // Where none is like the place, any is better than darkness.
        let weight = if total > 1e-4 * plain { near / total } else { weight / plain };
        if weight <= 1e-3 {
            continue;
        }
        let Some(entry) = cache.entry(id) else { continue };
        if shading.blending == Blending::Cones || count == 1 {
            entry.each_cap(|cap| lens.add(&cap, &ground, weight));
            continue;
        }
        let irradiance = entry.irradiance(point.normal_shading_world);
        let part = weight * luminance(irradiance);
        mean += irradiance * weight;
        if part > 0.0 && heaviest.is_none_or(|(most, ..)| part > most) {
            heaviest = Some((part, irradiance, entry, ground));
        }
    }
    let Some((_, irradiance, entry, ground)) = heaviest else { return lens.radiance() };
    entry.each_cap(|cap| lens.add(&cap, &ground, 1.0));
    // Not more than four times of what the heaviest of four has, in any colour.
    lens.radiance() * (mean / irradiance.max(Vec3::splat(f32::MIN_POSITIVE))).min(Vec3::splat(4.0))
}
