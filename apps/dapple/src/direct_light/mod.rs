//! Direct light of area lights by every method that can be compared, on the same pictures, with the same rays, lights and materials.

use anyhow::Result;
use dapple_render::gbuffer::{GBuffer, rasterize};
use dapple_render::shade::shading_points;
use dapple_render::slc::{Caps, Form, Samples, SlcShading, pixel_places, shade_cones};
use dapple_scene::area_lights::{AreaLights, Pick};
use dapple_scene::glam::Vec3;
use dapple_scene::{PosedCamera, ShadingPoint};
use dapple_server::cones::{ConeServer, ConeStep, Now, Update};
use dapple_store::cones::{
    BoundingEntry, BoundingParams, CacheCounts, CacheParams, Charting, LookUp, MomentEntry, MomentParams,
    View,
};
use dapple_trace::direct::{DirectParams, Sequence, trace_direct};
use dapple_trace::slc::{PaperParams, SlcParams};

/// How lights are sampled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Sampler {
    /// Lights by power, places anywhere: the paper's.
    Power,
    /// Lights by what would arrive, places on a lattice: the best there is here.
    Best,
}

impl Sampler {
    fn parts(self) -> (Pick, Sequence) {
        match self {
            Sampler::Power => (Pick::Power, Sequence::Random),
            Sampler::Best => (Pick::Fluence, Sequence::Lattice),
        }
    }
}

/// A way to light a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Technique {
    /// So many rays a pixel.
    Rays { samples: u32, sampler: Sampler },
    /// The paper's cones.
    PaperCones { params: PaperParams, look_up: LookUp },
    /// Ours.
    Cones { params: SlcParams, look_up: LookUp, samples: Samples },
}

impl Technique {
    pub(crate) fn rays(samples: u32, sampler: Sampler) -> Technique {
        Technique::Rays { samples, sampler }
    }

    pub(crate) fn paper_cones(sampler: Sampler) -> Technique {
        let (pick, sequence) = sampler.parts();
        let params = PaperParams { pick, sequence, ..PaperParams::default() };
        Technique::PaperCones { params, look_up: LookUp { bias: 1.0, blend: false } }
    }

    pub(crate) fn cones() -> Technique {
        Technique::Cones {
            params: SlcParams::default(),
            look_up: LookUp::default(),
            samples: Samples::Adaptive,
        }
    }
}

/// What a viewer sees, before it is lit.
pub(crate) struct Seen {
    pub(crate) camera: PosedCamera,
    pub(crate) gbuffer: GBuffer,
    pub(crate) points: Vec<Option<ShadingPoint>>,
}

impl Seen {
    /// One sample a pixel.
    pub(crate) fn new(now: &Now<'_>, camera: PosedCamera, [width, height]: [u32; 2]) -> Result<Seen> {
        let gbuffer = rasterize(now.scene, now.pose, &camera, width, height, 1)?;
        let points = shading_points(now.scene, now.pose, &camera, &gbuffer, true);
        Ok(Seen { camera, gbuffer, points })
    }
}

/// What a frame of all viewers took.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Cost {
    pub(crate) rays: u64,
    /// Of cones.
    pub(crate) step: Option<ConeStep>,
    pub(crate) memory: Option<CacheCounts>,
}

/// A technique at work for several viewers, frame after frame.
pub(crate) enum Lighter {
    Rays { samples: u32, sampler: Sampler, frame: u64 },
    Paper(Box<(ConeServer<BoundingEntry>, PaperParams, LookUp)>),
    Cones(Box<(ConeServer<MomentEntry>, SlcParams, LookUp, Samples)>),
}

impl Lighter {
    pub(crate) fn new(technique: Technique) -> Result<Lighter> {
        Ok(match technique {
            Technique::Rays { samples, sampler } => Lighter::Rays { samples, sampler, frame: 0 },
            Technique::PaperCones { params, look_up } => {
                Lighter::Paper(Box::new((ConeServer::new(CacheParams::default(), look_up)?, params, look_up)))
            }
            Technique::Cones { params, look_up, samples } => Lighter::Cones(Box::new((
                ConeServer::new(CacheParams::default(), look_up)?,
                params,
                look_up,
                samples,
            ))),
        })
    }

    /// Whether a frame is the same whatever came before.
    pub(crate) fn is_stateless(&self) -> bool {
        matches!(self, Lighter::Rays { .. })
    }

    /// Radiance of every pixel of every viewer. `pass` is called after each stage with its name.
    pub(crate) fn light(
        &mut self,
        now: &Now<'_>,
        lights: &AreaLights<'_>,
        seen: &[Seen],
        charting: &Charting,
        pass: &mut dyn FnMut(&'static str),
    ) -> (Vec<Vec<Vec3>>, Cost) {
        match self {
            Lighter::Rays { samples, sampler, frame } => {
                let (pick, sequence) = sampler.parts();
                let mut rays = 0;
                let pictures = seen.iter().enumerate().map(|(viewer, seen)| {
                    let seed = viewer as u64;
                    let params = DirectParams { samples: *samples, pick, sequence, seed, frame: *frame };
                    let mut out = vec![Vec3::ZERO; seen.points.len()];
                    rays += trace_direct(now.tracer, lights, &seen.points, &params, &mut out).rays;
                    out
                });
                let pictures = pictures.collect();
                pass("rays");
                *frame += 1;
                (pictures, Cost { rays, ..Cost::default() })
            }
            Lighter::Paper(of) => {
                let (server, params, look_up) = &mut **of;
                let shading =
                    SlcShading { look_up: *look_up, form: Form::Fluence, samples: Samples::Fixed(16) };
                with_cones(server, now, seen, charting, params, &shading, pass)
            }
            Lighter::Cones(of) => {
                let (server, params, look_up, samples) = &mut **of;
                let shading = SlcShading { look_up: *look_up, form: Form::Ratio, samples: *samples };
                with_cones(server, now, seen, charting, params, &shading, pass)
            }
        }
    }
}

fn with_cones<E: Update + Caps>(
    server: &mut ConeServer<E>,
    now: &Now<'_>,
    seen: &[Seen],
    charting: &Charting,
    params: &E::Params,
    shading: &SlcShading,
    pass: &mut dyn FnMut(&'static str),
) -> (Vec<Vec<Vec3>>, Cost) {
    let pixels: Vec<_> = seen
        .iter()
        .map(|seen| pixel_places(now.scene, now.pose, &seen.camera, &seen.gbuffer, charting))
        .collect();
    pass("texels");
    let views: Vec<View<'_>> = seen
        .iter()
        .zip(&pixels)
        .map(|(seen, pixels)| View { width: seen.gbuffer.width_samples() as usize, pixels })
        .collect();
    let step = server.step(now, &views, params, pass);
    let pictures = seen
        .iter()
        .zip(&pixels)
        .map(|(seen, pixels)| {
            shade_cones(server.cache(), |id| server.place_of(id), &seen.points, pixels, shading)
        })
        .collect();
    pass("shading");
    (pictures, Cost { rays: step.counts.rays, step: Some(step), memory: Some(server.cache().counts()) })
}

/// The truth: so many samples a pixel.
pub(crate) fn truth(now: &Now<'_>, lights: &AreaLights<'_>, seen: &Seen, samples: u32) -> Vec<Vec3> {
    let params = DirectParams { samples, seed: 0x7275_7468, ..DirectParams::default() };
    let mut out = vec![Vec3::ZERO; seen.points.len()];
    trace_direct(now.tracer, lights, &seen.points, &params, &mut out);
    out
}

/// Parameters of cones that studies change.
pub(crate) fn moment_params(cones: u8) -> MomentParams {
    MomentParams { cones, ..MomentParams::default() }
}

/// The same of the paper's.
pub(crate) fn bounding_params(cones: u8, discard: bool) -> BoundingParams {
    BoundingParams { cones, discard, ..BoundingParams::default() }
}
