//! Direct light of area lights by every method that can be compared, on the same pictures, with the same rays, lights and materials.

mod card;
pub(crate) mod picture;

use anyhow::Result;
use dapple_render::area_lights::AreaLightTable;
use dapple_render::gbuffer::{GBuffer, rasterize};
use dapple_render::shade::shading_points;
use dapple_render::slc::{
    CapTable, Caps, ConeLight, Form, KeptCaps, Samples, SlcShading, pixel_places, shade_cones,
};
use dapple_scene::area_lights::{AreaLights, MAX_LIGHT_TRIANGLES, Pick};
use dapple_scene::glam::Vec3;
use dapple_scene::{Pose, PosedCamera, Projection, Scene, ShadingPoint};
use dapple_server::cones::{ConeServer, ConeStep, Now, cone_charts};
use dapple_store::cones::{
    BoundingEntry, CacheCounts, CacheParams, Charting, ConeEntry, LookUp, MomentEntry, PixelPlace, View,
};
use dapple_trace::direct::{
    DirectParams, NO_PIXEL, Restir, RestirParams, RestirView, RisParams, Sequence, trace_direct, trace_ris,
};
use dapple_trace::slc::Update;
use dapple_trace::slc::{PaperParams, SlcParams};

use self::card::Card;

/// Memory that cones may take unless somebody says otherwise, MiB: room for `slc-fine` of a picture of 1280 × 720 with four samples a pixel. It is taken as it is needed.
pub(crate) const CONES_MIB: u64 = 4096;

/// Steps a second of what remembers earlier frames.
pub(crate) const STEPS_HZ: f64 = 15.0;

/// The charts that cones lie on; what has none is told.
pub(crate) fn charts(scene: &Scene) -> Charting {
    let (charting, problems) = cone_charts(scene);
    for problem in problems {
        tracing::warn!("{problem}; it carries no cones");
    }
    charting
}

/// Tells of lights that are too much.
pub(crate) fn warn_of_lights(lights: &AreaLights<'_>) {
    if lights.left_out() > 0 {
        tracing::warn!(
            "{} emitting meshes have more than {MAX_LIGHT_TRIANGLES} triangles; they light nothing",
            lights.left_out()
        );
    }
}

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
    /// One ray a pixel, to the best of 32 candidates.
    Ris { sampler: Sampler },
    /// The same with what neighbours and the last frames chose.
    Restir { sampler: Sampler, unbiased: bool },
    /// The paper's cones.
    PaperCones { params: PaperParams, look_up: LookUp, reuse_finer: bool },
    /// Ours.
    Cones(OurCones),
}

/// Our cones: how they are kept and shaded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct OurCones {
    pub(crate) params: SlcParams,
    pub(crate) shading: SlcShading,
    /// Whether light of one light is shaded by that light's own shape.
    pub(crate) shapes: bool,
    /// Whether a graphics card shades them.
    pub(crate) on_card: bool,
}

impl Technique {
    pub(crate) fn rays(samples: u32, sampler: Sampler) -> Technique {
        Technique::Rays { samples, sampler }
    }

    pub(crate) fn paper_cones(sampler: Sampler) -> Technique {
        let (pick, sequence) = sampler.parts();
        let params = PaperParams { pick, sequence, ..PaperParams::default() };
        let look_up = LookUp { bias: 1.0, blend: false };
        Technique::PaperCones { params, look_up, reuse_finer: false }
    }

    pub(crate) fn cones() -> Technique {
        let (params, shading) = (SlcParams::default(), SlcShading::default());
        Technique::Cones(OurCones { params, shading, shapes: true, on_card: false })
    }

    /// Our cones, sampled otherwise.
    pub(crate) fn with_sampler(self, sampler: Sampler) -> Technique {
        let (pick, sequence) = sampler.parts();
        self.changed(|cones| cones.params = SlcParams { pick, sequence, ..cones.params })
    }

    /// Our cones, of a pixel's own texel alone: nothing is blended that would have other places on lights, so all may share them.
    pub(crate) fn without_blending(self) -> Technique {
        self.changed(|cones| (cones.shading.look_up.blend, cones.params.together) = (false, 1))
    }

    /// Our cones, of texels so many pixels wide.
    pub(crate) fn with_texels(self, pixels: f32) -> Technique {
        self.changed(|cones| cones.shading.look_up.bias = pixels)
    }

    /// Our cones for a quarter of the rays, half where lights move: texels two pixels wide, and entries that are young for one update.
    pub(crate) fn quick_cones() -> Technique {
        let params = SlcParams { first_updates: 1, samples: 2, ..SlcParams::default() };
        Technique::cones().with_texels(2.0).changed(|cones| cones.params = params)
    }

    /// Our cones for as little as still makes a picture: texels 1.7 pixels wide, of which a pixel takes its own alone.
    pub(crate) fn fast_cones() -> Technique {
        let few = |cones: &mut OurCones| {
            let params = SlcParams { first_updates: 1, samples: 2, changed_samples: 6, ..cones.params };
            cones.params = params;
        };
        Technique::cones().without_blending().with_texels(1.7).changed(few)
    }

    /// Our cones of texels half a pixel wide, of which a pixel takes its own alone: for what stands still.
    pub(crate) fn fine_cones() -> Technique {
        Technique::cones().without_blending().with_texels(0.5)
    }

    /// Our cones, changed.
    pub(crate) fn changed(mut self, change: impl FnOnce(&mut OurCones)) -> Technique {
        if let Technique::Cones(cones) = &mut self {
            change(cones);
        }
        self
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
        Ok(Seen::of(now, camera, rasterize(now.scene, now.pose, &camera, width, height, 1)?))
    }

    /// What is drawn already.
    pub(crate) fn of(now: &Now<'_>, camera: PosedCamera, gbuffer: GBuffer) -> Seen {
        let points = shading_points(now.scene, now.pose, &camera, &gbuffer, true);
        Seen { camera, gbuffer, points }
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

impl Cost {
    /// Tells of places that there was no memory for, and what to do.
    pub(crate) fn refused(&self, advice: &str) -> Option<String> {
        let refused = self.step.map(|step| step.refused).filter(|refused| *refused > 0)?;
        Some(format!(
            "about {refused} places have no light cones and stay dark, as the memory for them is full: {advice}"
        ))
    }
}

/// A technique at work for several viewers, frame after frame.
pub(crate) enum Lighter {
    Rays { samples: u32, sampler: Sampler, frame: u64 },
    Ris { sampler: Sampler, frame: u64 },
    Restir(Box<Reservoirs>),
    Paper(Box<PaperCones>),
    Cones(Box<Cones>),
}

impl Lighter {
    /// With so much memory for cones, MiB.
    pub(crate) fn new(technique: Technique, cones_mib: u64) -> Result<Lighter> {
        let most = CacheParams { most_bytes: cones_mib << 20, ..CacheParams::default() };
        Ok(match technique {
            Technique::Rays { samples, sampler } => Lighter::Rays { samples, sampler, frame: 0 },
            Technique::Ris { sampler } => Lighter::Ris { sampler, frame: 0 },
            Technique::Restir { sampler, unbiased } => Lighter::Restir(Box::new(Reservoirs {
                sampler,
                unbiased,
                frame: 0,
                viewers: Vec::new(),
                before: None,
            })),
            Technique::PaperCones { params, look_up, reuse_finer } => {
                let server = ConeServer::new(CacheParams { reuse_finer, ..most }, look_up)?;
                Lighter::Paper(Box::new(PaperCones { server, caps: KeptCaps::default(), params, look_up }))
            }
            Technique::Cones(how) => Lighter::Cones(Box::new(Cones {
                server: ConeServer::new(most, how.shading.look_up)?,
                caps: KeptCaps::default(),
                how,
                card: how.on_card.then(Card::new).transpose()?,
            })),
        })
    }

    /// Whether a frame is the same whatever came before.
    pub(crate) fn is_stateless(&self) -> bool {
        matches!(self, Lighter::Rays { .. } | Lighter::Ris { .. })
    }

    /// Whether it keeps cones.
    pub(crate) fn has_cones(&self) -> bool {
        matches!(self, Lighter::Paper(_) | Lighter::Cones(_))
    }

    /// Radiance of every pixel of every viewer. `pass` is called after each stage with its name. Only a graphics card fails.
    pub(crate) fn light(
        &mut self,
        now: &Now<'_>,
        lights: &AreaLights<'_>,
        seen: &[Seen],
        charting: &Charting,
        pass: &mut dyn FnMut(&'static str),
    ) -> Result<(Vec<Vec<Vec3>>, Cost)> {
        Ok(match self {
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
            Lighter::Ris { sampler, frame } => {
                let (pick, sequence) = sampler.parts();
                let mut rays = 0;
                let pictures = seen.iter().enumerate().map(|(viewer, seen)| {
                    let params = RisParams {
                        pick,
                        sequence,
                        seed: viewer as u64,
                        frame: *frame,
                        ..RisParams::default()
                    };
                    let mut out = vec![Vec3::ZERO; seen.points.len()];
                    rays += trace_ris(now.tracer, lights, &seen.points, &params, &mut out).rays;
                    out
                });
                let pictures = pictures.collect();
                pass("rays");
                *frame += 1;
                (pictures, Cost { rays, ..Cost::default() })
            }
            Lighter::Restir(reservoirs) => {
                let found = reservoirs.light(now, lights, seen);
                pass("rays");
                found
            }
            Lighter::Paper(of) => {
                let PaperCones { server, caps, params, look_up } = &mut **of;
                let shading = SlcShading {
                    look_up: *look_up,
                    form: Form::Fluence,
                    samples: Samples::Fixed(16),
                    ..SlcShading::default()
                };
                with_cones(server, now, seen, charting, params, pass, |server, pixels| {
                    Ok(shade_all(&cap_table(caps, server, None), seen, pixels, &shading))
                })?
            }
            Lighter::Cones(of) => {
                let Cones { server, caps, how: OurCones { params, shading, shapes, .. }, card } = &mut **of;
                let table = shapes.then(|| AreaLightTable::new(lights));
                with_cones(server, now, seen, charting, params, pass, |server, pixels| {
                    let caps = cap_table(caps, server, table.as_ref());
                    match card {
                        Some(card) => card.shade_all(&caps, seen, pixels, shading),
                        None => Ok(shade_all(&caps, seen, pixels, shading)),
                    }
                })?
            }
        })
    }
}

/// The paper's cones at work.
pub(crate) struct PaperCones {
    server: ConeServer<BoundingEntry>,
    caps: KeptCaps,
    params: PaperParams,
    look_up: LookUp,
}

/// Our cones at work.
pub(crate) struct Cones {
    server: ConeServer<MomentEntry>,
    caps: KeptCaps,
    how: OurCones,
    card: Option<Card>,
}

/// What ReSTIR remembers of all viewers.
pub(crate) struct Reservoirs {
    sampler: Sampler,
    unbiased: bool,
    frame: u64,
    viewers: Vec<Restir>,
    before: Option<(Pose, Vec<PosedCamera>)>,
}

impl Reservoirs {
    fn light(&mut self, now: &Now<'_>, lights: &AreaLights<'_>, seen: &[Seen]) -> (Vec<Vec<Vec3>>, Cost) {
        let (pick, sequence) = self.sampler.parts();
        let defaults = if self.unbiased { RestirParams::unbiased() } else { RestirParams::default() };
        self.viewers.resize_with(seen.len(), Restir::new);
        let mut rays = 0;
        let mut pictures = Vec::new();
        for (viewer, (seen, restir)) in seen.iter().zip(&mut self.viewers).enumerate() {
            let params = RestirParams { pick, sequence, seed: viewer as u64, frame: self.frame, ..defaults };
            let previous = self.before.as_ref().and_then(|(pose, cameras)| {
                Some(previous_pixels(now, pose, cameras.get(viewer)?, &seen.gbuffer))
            });
            let view = RestirView {
                points: &seen.points,
                size: [seen.gbuffer.width_samples(), seen.gbuffer.height_samples()].map(|side| side as usize),
                eye_world: seen.camera.eye_world(),
                previous_pixels: previous.as_deref(),
                past: None,
            };
            let mut out = vec![Vec3::ZERO; seen.points.len()];
            rays += restir.trace(now.tracer, lights, &view, &params, &mut out).rays;
            pictures.push(out);
        }
        self.frame += 1;
        self.before = Some((now.pose.clone(), seen.iter().map(|seen| seen.camera).collect()));
        (pictures, Cost { rays, ..Cost::default() })
    }
}

/// The sample that showed each sample's place in the last picture.
fn previous_pixels(now: &Now<'_>, pose: &Pose, camera: &PosedCamera, gbuffer: &GBuffer) -> Vec<u32> {
    let view_from_world = camera.view_from_world();
    let (width, height) = (gbuffer.width_samples() as f32, gbuffer.height_samples() as f32);
    gbuffer.map_surfaces(now.scene, pose, |_, surface| {
        let Some(surface) = surface else { return NO_PIXEL };
        let at = view_from_world.transform_point3(surface.position_world);
        let half = match camera.projection {
            Projection::Perspective { yfov, .. } => libm::tanf(0.5 * yfov) * -at.z,
            Projection::Orthographic { half_height, .. } => half_height,
        };
        let x = (0.5 + 0.5 * at.x / (half * width / height)) * width;
        let y = (0.5 - 0.5 * at.y / half) * height;
        let inside = half > 0.0 && (0.0..width).contains(&x) && (0.0..height).contains(&y);
        if inside { y as u32 * gbuffer.width_samples() + x as u32 } else { NO_PIXEL }
    })
}

/// Where the pixels of each viewer lie in the charts.
type Places = [Vec<Option<PixelPlace>>];

/// Brings the cones that viewers see up to date, and has them shaded.
fn with_cones<E: Update>(
    server: &mut ConeServer<E>,
    now: &Now<'_>,
    seen: &[Seen],
    charting: &Charting,
    params: &E::Params,
    pass: &mut dyn FnMut(&'static str),
    shade: impl FnOnce(&ConeServer<E>, &Places) -> Result<Vec<Vec<Vec3>>>,
) -> Result<(Vec<Vec<Vec3>>, Cost)> {
    let pixels: Vec<_> = seen
        .iter()
        .map(|seen| pixel_places(now.scene, now.pose, &seen.camera, &seen.gbuffer, &seen.points, charting))
        .collect();
    pass("texels");
    let views: Vec<View<'_>> = seen
        .iter()
        .zip(&pixels)
        .map(|(seen, pixels)| View { width: seen.gbuffer.width_samples() as usize, pixels })
        .collect();
    let step = server.step(now, &views, params, pass);
    let pictures = shade(server, &pixels)?;
    pass("shading");
    Ok((pictures, Cost { rays: step.counts.rays, step: Some(step), memory: Some(server.cache().counts()) }))
}

fn cap_table<'a, E: Update + Caps>(
    caps: &mut KeptCaps,
    server: &'a ConeServer<E>,
    lights: Option<&'a AreaLightTable>,
) -> CapTable<'a, E> {
    let light = ConeLight { cache: server.cache(), place_of: |id| server.place_of(id), lights };
    caps.table(&light, |block| server.changed_at(block))
}

fn shade_all<E: ConeEntry + Caps>(
    table: &CapTable<'_, E>,
    seen: &[Seen],
    pixels: &Places,
    shading: &SlcShading,
) -> Vec<Vec<Vec3>> {
    let views = seen.iter().zip(pixels);
    views.map(|(seen, pixels)| shade_cones(table, &seen.points, pixels, shading)).collect()
}

/// The truth: so many samples a pixel.
pub(crate) fn truth(now: &Now<'_>, lights: &AreaLights<'_>, seen: &Seen, samples: u32) -> Vec<Vec3> {
    let params = DirectParams { samples, seed: 0x7275_7468, ..DirectParams::default() };
    let mut out = vec![Vec3::ZERO; seen.points.len()];
    trace_direct(now.tracer, lights, &seen.points, &params, &mut out);
    out
}
