//! A picture to light, and what is asked of its light; cones that a server keeps for it.

use std::time::Instant;

use dapple_metrics::{mean_bias, psnr, ssim};
use dapple_render::area_lights::AreaLightTable;
use dapple_render::gbuffer::{GBuffer, rasterize};
use dapple_render::image::{LinearImage, Rgb8Image, ToneMap};
use dapple_render::shade::shading_points;
use dapple_render::slc::{CapTable, ConeLight, KeptCaps, SlcShading, pixel_places, shade_cones};
use dapple_scene::glam::Vec3;
use dapple_scene::{NoFiles, PosedCamera, Scene, ShadingPoint, builtin};
use dapple_server::cones::{ConeServer, ConeStep, Now, cone_charts};
use dapple_store::cones::{CacheParams, Charting, EntryId, EntrySite, MomentEntry, View};
use dapple_trace::direct::{DirectParams, trace_direct};
use dapple_trace::slc::SlcParams;

/// A picture of a built-in scene at a moment, before it is lit.
pub(crate) struct Stage {
    pub(crate) scene: Scene,
    pub(crate) charting: Charting,
    pub(crate) size: [u32; 2],
    pub(crate) time_s: f64,
}

pub(crate) struct Seen {
    pub(crate) camera: PosedCamera,
    pub(crate) gbuffer: GBuffer,
    pub(crate) points: Vec<Option<ShadingPoint>>,
}

impl Stage {
    pub(crate) fn new(name: &str, detail: f32, size: [u32; 2]) -> Stage {
        let glb = builtin::glb(name, detail).unwrap();
        let scene = dapple_scene::load(&format!("{name}.glb"), &glb, &NoFiles).unwrap();
        let (charting, problems) = cone_charts(&scene);
        assert!(problems.is_empty(), "{problems:?}");
        Stage { scene, charting, size, time_s: 6.0 }
    }

    pub(crate) fn see(&self, now: &Now<'_>) -> Seen {
        self.see_from(now, self.scene.camera_paths()[0].camera(&self.scene, now.pose))
    }

    pub(crate) fn see_from(&self, now: &Now<'_>, camera: PosedCamera) -> Seen {
        let [width, height] = self.size;
        let gbuffer = rasterize(&self.scene, now.pose, &camera, width, height, 1).unwrap();
        let points = shading_points(&self.scene, now.pose, &camera, &gbuffer, true);
        Seen { camera, gbuffer, points }
    }

    /// PSNR, dB, SSIM, and bias of the mean luminance, %.
    pub(crate) fn quality(&self, truth: &[Vec3], found: &[Vec3]) -> [f64; 3] {
        let [width, height] = self.size;
        let [a, b] = [truth, found].map(|pixels| {
            LinearImage { width, height, pixels: pixels.to_vec() }.to_rgb8(&ToneMap::default())
        });
        let unit =
            |p: &Rgb8Image| p.pixels.as_flattened().iter().map(|c| f32::from(*c) / 255.0).collect::<Vec<_>>();
        let luma = |p: &Rgb8Image| {
            let of = |[r, g, b]: &[u8; 3]| {
                0.2126 * f32::from(*r) + 0.7152 * f32::from(*g) + 0.0722 * f32::from(*b)
            };
            p.pixels.iter().map(|p| of(p) / 255.0).collect::<Vec<f32>>()
        };
        let [truth, found] = [truth, found].map(|p| p.iter().flat_map(Vec3::to_array).collect::<Vec<_>>());
        [
            psnr(&unit(&a), &unit(&b), 1.0).unwrap(),
            ssim(width, height, &luma(&a), &luma(&b)).unwrap(),
            100.0 * mean_bias(width, height, &truth, &found).unwrap(),
        ]
    }
}

pub(crate) fn rays(now: &Now<'_>, points: &[Option<ShadingPoint>], params: &DirectParams) -> Vec<Vec3> {
    let mut out = vec![Vec3::ZERO; points.len()];
    trace_direct(now.tracer, &now.lights(now.pose), points, params, &mut out);
    out
}

fn cone_light<'a>(
    server: &'a ConeServer<MomentEntry>,
    table: &'a AreaLightTable,
) -> ConeLight<'a, MomentEntry, impl Fn(EntryId) -> Option<EntrySite> + Sync + 'a> {
    ConeLight { cache: server.cache(), place_of: |id| server.place_of(id), lights: Some(table) }
}

/// Steps of cones, what of them is the server's where clients shade, milliseconds, and the last picture.
pub(crate) struct Lit {
    pub(crate) name: &'static str,
    pub(crate) server: ConeServer<MomentEntry>,
    caps: KeptCaps,
    pub(crate) params: SlcParams,
    pub(crate) shading: SlcShading,
    shapes: bool,
    pub(crate) ms: Vec<f64>,
    pub(crate) server_ms: Vec<f64>,
    /// Of those: finding places in the charts, and making caps of entries.
    pub(crate) stages: [Vec<f64>; 2],
    /// Of the server's: requests, queue, places, rays.
    pub(crate) passes: [Vec<f64>; 4],
    pub(crate) counts: ConeStep,
    pub(crate) picture: Vec<Vec3>,
}

impl Lit {
    pub(crate) fn new(name: &'static str, shading: SlcShading, shapes: bool) -> Lit {
        let server = ConeServer::new(CacheParams::default(), shading.look_up).unwrap();
        Lit {
            name,
            server,
            caps: KeptCaps::default(),
            params: SlcParams::default(),
            shading,
            shapes,
            ms: Vec::new(),
            server_ms: Vec::new(),
            stages: Default::default(),
            passes: Default::default(),
            counts: ConeStep::default(),
            picture: Vec::new(),
        }
    }

    /// Without a viewer, the server goes on alone.
    pub(crate) fn step(&mut self, stage: &Stage, now: &Now<'_>, seen: Option<&Seen>) {
        let start = Instant::now();
        let place = |s: &Seen| {
            pixel_places(&stage.scene, now.pose, &s.camera, &s.gbuffer, &s.points, &stage.charting)
        };
        let pixels = seen.map(place);
        let width = stage.size[0] as usize;
        let views: Vec<View<'_>> = pixels.iter().map(|pixels| View { width, pixels }).collect();
        let begun = Instant::now();
        self.stages[0].push((begun - start).as_secs_f64() * 1e3);
        let mut last = begun;
        let mut passes = self.passes.iter_mut();
        self.counts = self.server.step(now, &views, &self.params, &mut |_| {
            if let Some(ms) = passes.next() {
                ms.push(last.elapsed().as_secs_f64() * 1e3);
            }
            last = Instant::now();
        });
        self.server_ms.push(begun.elapsed().as_secs_f64() * 1e3);
        let stepped = Instant::now();
        let table = AreaLightTable::new(&now.lights(now.pose));
        let light = ConeLight { lights: self.shapes.then_some(&table), ..cone_light(&self.server, &table) };
        if let (Some(seen), Some(pixels)) = (seen, pixels) {
            let caps = self.caps.table(&light, |block| self.server.changed_at(block));
            self.stages[1].push(stepped.elapsed().as_secs_f64() * 1e3);
            self.picture = shade_cones(&caps, &seen.points, &pixels, &self.shading);
        }
        self.ms.push(start.elapsed().as_secs_f64() * 1e3);
    }
}

impl Lit {
    /// The last picture, with nothing kept from steps before.
    pub(crate) fn picture_anew(&self, stage: &Stage, now: &Now<'_>, seen: &Seen) -> Vec<Vec3> {
        let pixels =
            pixel_places(&stage.scene, now.pose, &seen.camera, &seen.gbuffer, &seen.points, &stage.charting);
        let table = AreaLightTable::new(&now.lights(now.pose));
        let light = ConeLight { lights: self.shapes.then_some(&table), ..cone_light(&self.server, &table) };
        shade_cones(&CapTable::new(&light), &seen.points, &pixels, &self.shading)
    }
}
