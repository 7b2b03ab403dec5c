//! Shades what a viewer sees with light cones of the on-surface cache ([Stadlbauer2023] sec. 3.2, in the ratio form).
//!
//! - takes: shading points ([`crate::shade::shading_points`]) and places in the charts ([`pixel_places`]) of all samples, a [`ConeCache`], where
//!   its entries are in the world, the lights' shapes; all but the first two as a [`CapTable`], for all viewers
//! - returns: outgoing radiance of each sample, emission and direct light
//!
//! No ray is traced: visibility is in the cones. Equations in `README.md`.

mod blend;
#[cfg(test)]
mod blend_tests;
mod cap;
#[cfg(feature = "gpu")]
pub mod card;
mod places;
mod table;
#[cfg(test)]
mod tests;

use dapple_scene::ShadingPoint;
use dapple_store::cones::{BoundingEntry, ConeCache, ConeEntry, LightSet, LookUp, MomentEntry, PixelPlace};
use glam::Vec3;
use rayon::prelude::*;

use crate::area_lights::AreaLightTable;
pub use cap::{Cap, Form, Samples};
pub use places::pixel_places;
pub use table::{CapTable, KeptCaps};

/// How much a cone is of a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeenPart {
    /// Index of the light.
    pub light: u32,
    /// Part that comes through the cone of all that would arrive if nothing stood in the way, above 0 and up to 1.
    pub fraction: f32,
    /// Part of it that comes through all cones.
    pub of_all: f32,
    /// How much noise of the cone's energy matters less than what a shape leaves out, 0 … 1: 1 for an entry of many samples.
    pub settled: f32,
}

/// An entry whose cones can be shaded with.
pub trait Caps {
    /// Calls with every cone of it, the lights that it is of, none where that is not known, and which part of a single one it is where that is known.
    fn each_cap(&self, cap: impl FnMut(Cap, LightSet, Option<SeenPart>));
}

/// [`SeenPart::settled`] of an entry of so many samples: from 32 to 96. A ramp, since where lights move C goes up and down by the samples of an
/// update from frame to frame.
fn settled(samples: u16) -> f32 {
    ((f32::from(samples) - 32.0) / 64.0).clamp(0.0, 1.0)
}

impl Caps for MomentEntry {
    #[inline]
    fn each_cap(&self, mut cap: impl FnMut(Cap, LightSet, Option<SeenPart>)) {
        for cone in self.cones() {
            let (direction, cos_angle) = cone.axis();
            let mean_cosine = cone.mean_cosine();
            let seen = cone.lights.single().filter(|_| cone.seen > 0.0);
            let seen = seen.map(|light| SeenPart {
                light,
                fraction: cone.seen,
                of_all: self.seen_of(cone.lights),
                settled: settled(self.samples()),
            });
            cap(Cap { direction, cos_angle, energy: cone.energy, mean_cosine }, cone.lights, seen);
        }
    }
}

impl Caps for BoundingEntry {
    #[inline]
    fn each_cap(&self, mut cap: impl FnMut(Cap, LightSet, Option<SeenPart>)) {
        for cone in self.cones() {
            let cos_angle = libm::cosf(cone.angle);
            let cone = Cap { direction: cone.direction, cos_angle, energy: cone.energy, mean_cosine: 1.0 };
            cap(cone, LightSet::NONE, None);
        }
    }
}

/// What is shaded of the entries that a sample blends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Blending {
    /// The cones of the one that most light comes from, brought to the mean irradiance of all: a quarter of the work. On smooth surfaces, which show where
    /// light comes from, the cones of each all the same.
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

/// What samples are shaded of.
#[derive(Clone, Copy, Debug)]
pub struct ConeLight<'a, E, F> {
    /// All entries.
    pub cache: &'a ConeCache<E>,
    /// Where an entry is; those that it does not know are left out.
    pub place_of: F,
    /// Lights of the moment: light that is known to be of one of them is shaded by that light's own shape, as much as is seen of it, and on smooth surfaces that of several by where these are. `None`: all by cones.
    pub lights: Option<&'a AreaLightTable>,
}

/// Outgoing radiance of every sample: what it emits and what it reflects of the light in the cones about it. Samples that see nothing
/// are 0, and those that no entry is known for only emit. In parallel in the caller's rayon pool.
///
/// # Panics
/// If the lists differ in length.
pub fn shade_cones<E: ConeEntry + Caps>(
    table: &CapTable<'_, E>,
    points: &[Option<ShadingPoint>],
    pixels: &[Option<PixelPlace>],
    shading: &SlcShading,
) -> Vec<Vec3> {
    assert_eq!(points.len(), pixels.len(), "one place a point");
    let mut radiance = vec![Vec3::ZERO; points.len()];
    let all = radiance.par_chunks_mut(CHUNK).zip(points.par_chunks(CHUNK)).zip(pixels.par_chunks(CHUNK));
    all.for_each_init(
        || blend::Blender::new(table, shading),
        |blender, ((radiance, points), pixels)| {
            vectorized(
                #[inline(always)]
                || {
                    for ((out, point), pixel) in radiance.iter_mut().zip(points).zip(pixels) {
                        let Some(point) = point else { continue };
                        *out = point.emitted;
                        if let Some(pixel) = pixel {
                            *out += blender.reflect(point, pixel);
                        }
                    }
                },
            );
        },
    );
    radiance
}

/// Runs what is inlined with the machine's wide vectors, if it has them. Numbers come out the same.
fn vectorized<R>(run: impl FnOnce() -> R) -> R {
    #[cfg(target_arch = "x86_64")]
    if let Some(simd) = fearless_simd::Level::new().as_avx2() {
        use fearless_simd::Simd;
        return simd.vectorize(run);
    }
    run()
}

/// Samples of one task.
const CHUNK: usize = 512;
