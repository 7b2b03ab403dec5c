//! Pictures lit by light cones against rays: quality, bias and time of a step with a still camera.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::time::Instant;

use dapple_metrics::{psnr, ssim};
use dapple_render::area_lights::AreaLightTable;
use dapple_render::gbuffer::{GBuffer, rasterize};
use dapple_render::image::{LinearImage, Rgb8Image, ToneMap};
use dapple_render::shade::shading_points;
use dapple_render::slc::{Blending, CapTable, ConeLight, KeptCaps, SlcShading, pixel_places, shade_cones};
use dapple_scene::area_lights::{Environment, Pick};
use dapple_scene::glam::Vec3;
use dapple_scene::{NoFiles, PosedCamera, Scene, ShadingPoint, builtin};
use dapple_server::cones::{ConeServer, ConeStep, Now, cone_charts};
use dapple_store::cones::{CacheParams, Charting, EntryId, EntrySite, LookUp, MomentEntry, View, luminance};
use dapple_trace::Tracer;
use dapple_trace::direct::{DirectParams, Restir, RestirParams, RestirView, Sequence, trace_direct};
use dapple_trace::slc::SlcParams;

/// A picture of a built-in scene at a moment, before it is lit.
struct Stage {
    scene: Scene,
    charting: Charting,
    size: [u32; 2],
    time_s: f64,
}

struct Seen {
    camera: PosedCamera,
    gbuffer: GBuffer,
    points: Vec<Option<ShadingPoint>>,
}

impl Stage {
    fn new(name: &str, detail: f32, size: [u32; 2]) -> Stage {
        let glb = builtin::glb(name, detail).unwrap();
        let scene = dapple_scene::load(&format!("{name}.glb"), &glb, &NoFiles).unwrap();
        let (charting, problems) = cone_charts(&scene);
        assert!(problems.is_empty(), "{problems:?}");
        Stage { scene, charting, size, time_s: 6.0 }
    }

    fn see(&self, now: &Now<'_>) -> Seen {
        self.see_from(now, self.scene.camera_paths()[0].camera(&self.scene, now.pose))
    }

    fn see_from(&self, now: &Now<'_>, camera: PosedCamera) -> Seen {
        let [width, height] = self.size;
        let gbuffer = rasterize(&self.scene, now.pose, &camera, width, height, 1).unwrap();
        let points = shading_points(&self.scene, now.pose, &camera, &gbuffer, true);
        Seen { camera, gbuffer, points }
    }

    /// PSNR, dB, SSIM, and bias of the mean luminance, %.
    fn quality(&self, truth: &[Vec3], found: &[Vec3]) -> [f64; 3] {
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
        // Of lamps themselves nothing is asked, and what is found is not cut: noise would look like a lack of light.
        let (mut all, mut more) = (0.0, 0.0);
        for (truth, found) in truth.iter().zip(found).filter(|(truth, _)| truth.max_element() <= 4.0) {
            all += f64::from(luminance(*truth));
            more += f64::from(luminance(*found - *truth));
        }
        [
            psnr(&unit(&a), &unit(&b), 1.0).unwrap(),
            ssim(width, height, &luma(&a), &luma(&b)).unwrap(),
            100.0 * more / all,
        ]
    }
}

fn rays(now: &Now<'_>, points: &[Option<ShadingPoint>], params: &DirectParams) -> Vec<Vec3> {
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

/// Cones as they are kept by default, shaded in each way.
fn ways() -> Vec<Lit> {
    let near = LookUp { blend: false, ..LookUp::default() };
    let wide = LookUp { bias: 2.0, ..LookUp::default() };
    let shading = SlcShading::default();
    // Nothing is blended that would have other places on lights.
    let alone = SlcParams { together: 1, ..SlcParams::default() };
    let [half, most] = [0.5, 1.7].map(|bias| LookUp { bias, ..near });
    let few = SlcParams { first_updates: 1, samples: 2, ..SlcParams::default() };
    vec![
        Lit::new("slc by cones alone", shading, false),
        Lit::new("slc", shading, true),
        Lit::new("slc, all cones", SlcShading { blending: Blending::Cones, ..shading }, true),
        Lit::new("slc, one texel, places of every second", SlcShading { look_up: near, ..shading }, true),
        sampled("slc, one texel", near, alone),
        Lit::new("slc, bias 2", SlcShading { look_up: wide, ..shading }, true),
        sampled("slc, fast", most, SlcParams { changed_samples: 6, together: 1, ..few }),
        sampled("slc, quick", wide, few),
        sampled("slc, fine", half, alone),
    ]
}

/// Cones that are sampled otherwise.
fn sampled(name: &'static str, look_up: LookUp, params: SlcParams) -> Lit {
    Lit { params, ..Lit::new(name, SlcShading { look_up, ..SlcShading::default() }, true) }
}

/// What rays find where nothing has moved yet.
fn still_truth(stage: &Stage, samples: u32) -> Vec<Vec3> {
    let pose = stage.scene.pose(stage.time_s);
    let tracer = Tracer::new(&stage.scene, &pose);
    let now = Now { scene: &stage.scene, pose: &pose, tracer: &tracer, environment: None };
    let params = DirectParams { samples, seed: 7, ..DirectParams::default() };
    rays(&now, &stage.see(&now).points, &params)
}

/// Quality of each way after so many steps, and a table if asked.
fn measure(
    stage: &Stage,
    truth: &[Vec3],
    (steps, timed): (usize, usize),
    seed: u64,
) -> Vec<(&'static str, [f64; 3])> {
    let pose = stage.scene.pose(stage.time_s);
    let tracer = Tracer::new(&stage.scene, &pose);
    let now = Now { scene: &stage.scene, pose: &pose, tracer: &tracer, environment: None };
    let seen = stage.see(&now);
    let mut ways = ways();
    ways.iter_mut().for_each(|lit| lit.params.seed = seed);
    for _ in 0..steps {
        ways.iter_mut().for_each(|lit| lit.step(stage, &now, Some(&seen)));
    }
    for lit in &mut ways {
        let times = [&mut lit.ms, &mut lit.server_ms].into_iter().chain(&mut lit.stages);
        times.chain(&mut lit.passes).for_each(Vec::clear);
    }
    let [_, power, best, _] = Rival::all();
    let mut rivals = [power, best];
    for frame in 0..timed as u64 {
        rivals.iter_mut().for_each(|rival| rival.step(&now, stage.size, &seen, frame));
        ways.iter_mut().for_each(|lit| lit.step(stage, &now, Some(&seen)));
    }
    let rival_ms = median(&rivals[0].ms);
    let line = |name: &str, ms: &[f64], [db, ssim, bias]: [f64; 3]| {
        println!("| {name} | {:.1} | {db:.2} | {ssim:.4} | {bias:+.2} |", rival_ms / median(ms));
    };
    for rival in rivals.iter().filter(|_| timed > 0) {
        line(rival.name, &rival.ms, stage.quality(truth, &rival.picture));
    }
    let found = ways.into_iter().map(|lit| {
        let quality = stage.quality(truth, &lit.picture);
        if timed > 0 {
            line(lit.name, &lit.ms, quality);
            let [places, caps] = &lit.stages;
            let [all, places, server, caps] = [&lit.ms, places, &lit.server_ms, caps].map(|ms| median(ms));
            let shading = all - places - server - caps;
            let [requests, queue, sites, rays] = lit.passes.each_ref().map(|ms| median(ms));
            println!(
                "  {all:.1} ms: places {places:.1}, server {server:.1} (requests {requests:.1}, queue {queue:.1}, places {sites:.1}, rays {rays:.1}), caps {caps:.1}, shading {shading:.1}"
            );
        }
        (lit.name, quality)
    });
    found.collect()
}

/// Flames close to what they light, over ground whose normals lean every way: light that is lost shows. In the mean of some seeds, since entries that share
/// places on lights err alike, and a picture so small has few groups of them.
#[test]
fn the_mean_light_of_a_village_is_that_of_rays() {
    let stage = Stage::new("village", 0.1, [96, 54]);
    let truth = still_truth(&stage, 256);
    let runs = [0, 1, 2, 3, 4, 5, 6, 7].map(|seed| measure(&stage, &truth, (24, 0), seed));
    for (way, (name, _)) in runs[0].iter().enumerate() {
        let bias = runs.iter().map(|run| run[way].1[2]).sum::<f64>() / runs.len() as f64;
        let least = runs.iter().map(|run| run[way].1[0]).fold(f64::INFINITY, f64::min);
        println!("{name}: {bias:+.2} %, {least:.2} dB");
        assert!(bias.abs() < 4.0 && least > 22.0, "{name}: {bias} %, {least} dB");
        // Groups of all entries are too few here for a single run to tell.
        let is_of_all = ["slc, one texel", "slc, fast", "slc, fine"].contains(name);
        let single = runs[0][way].1[2];
        assert!(is_of_all || single.abs() < 4.0, "{name}: {single} % by itself");
    }
}

/// Lights that move, over entries that had eight frames to follow: light by the shapes of what they see needs fewer samples than their energies.
#[test]
fn lights_that_move_are_shaded_by_their_shapes() {
    let stage = Stage::new("street", 0.1, [96, 54]);
    let [cones, shapes] = [false, true].map(|shapes| {
        let mut lit = Lit::new("", SlcShading::default(), shapes);
        let mut tracer = Tracer::new(&stage.scene, &stage.scene.pose(stage.time_s));
        let mut quality = [0.0; 3];
        for step in 0..8 {
            let pose = stage.scene.pose(stage.time_s + f64::from(step) / 15.0);
            tracer.update(&stage.scene, &pose);
            let now = Now { scene: &stage.scene, pose: &pose, tracer: &tracer, environment: None };
            let seen = stage.see(&now);
            lit.step(&stage, &now, Some(&seen));
            assert!(lit.picture == lit.picture_anew(&stage, &now, &seen), "step {step}");
            if step == 7 {
                let params = DirectParams { samples: 256, seed: 7, ..DirectParams::default() };
                quality = stage.quality(&rays(&now, &seen.points, &params), &lit.picture);
            }
        }
        quality
    });
    println!("cones {cones:?}, shapes {shapes:?}");
    assert!(shapes[0] > cones[0] + 1.0 && shapes[1] > cones[1], "{shapes:?} {cones:?}");
    assert!(shapes[0] > 28.0 && shapes[2].abs() < 1.5, "{shapes:?}");
}

/// Boulders turn under still lights: what an entry knows of a light that it hardly faced says little of when it does.
#[test]
fn things_that_roll_are_no_brighter_than_by_rays() {
    let stage = Stage::new("atrium-lamps", 0.3, [240, 135]);
    let mut lit = Lit::new("", SlcShading::default(), false);
    let (end_s, steps) = (3.0, 16);
    let mut tracer = Tracer::new(&stage.scene, &stage.scene.pose(0.0));
    for step in 1..=steps {
        let pose = stage.scene.pose(end_s - f64::from(steps - step) / 15.0);
        tracer.update(&stage.scene, &pose);
        let now = Now { scene: &stage.scene, pose: &pose, tracer: &tracer, environment: None };
        let seen = stage.see(&now);
        lit.step(&stage, &now, Some(&seen));
        assert!(lit.picture == lit.picture_anew(&stage, &now, &seen), "step {step}");
        if step == steps {
            let params = DirectParams { samples: 64, seed: 7, ..DirectParams::default() };
            let [db, _, bias] = stage.quality(&rays(&now, &seen.points, &params), &lit.picture);
            println!("{db:.2} dB, {bias:+.2} %");
            assert!(bias.abs() < 1.5 && db > 26.0, "{bias} %, {db} dB");
        }
    }
}

/// A sky that is hardly seen from inside a box: few samples of young entries reach it, and what they bring is all there in the mean of several seeds.
#[test]
fn light_of_a_sky_is_all_there_while_entries_are_young() {
    let hdr = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n\x80\x80\x80\x82\x80\x80\x80\x82";
    let sky = Environment::from_hdr(hdr).unwrap();
    let stage = Stage::new("cornell", 0.2, [96, 54]);
    let pose = stage.scene.pose(1.0);
    let tracer = Tracer::new(&stage.scene, &pose);
    let now = Now { scene: &stage.scene, pose: &pose, tracer: &tracer, environment: Some(&sky) };
    let path = stage.scene.camera_paths().into_iter().find(|path| path.name == "path-box").unwrap();
    let seen_at = |time_s| stage.see_from(&now, path.camera(&stage.scene, &stage.scene.pose(time_s)));
    let params = DirectParams { samples: 2048, seed: 7, ..DirectParams::default() };
    let truth = rays(&now, &seen_at(1.0).points, &params);
    for (walks, steps) in [(0.0, 2), (0.0, 8), (1.0, 8)] {
        let bias = |seed| {
            let mut lit = Lit::new("", SlcShading::default(), false);
            lit.params.seed = seed;
            for step in (0..steps).rev() {
                lit.step(&stage, &now, Some(&seen_at(1.0 - walks * f64::from(step) / 15.0)));
            }
            stage.quality(&truth, &lit.picture)[2]
        };
        let mean = (0..10).map(bias).sum::<f64>() / 10.0;
        println!("{steps} steps, walks {walks}: {mean:+.2} %");
        assert!(mean.abs() < 1.5, "{mean} % after {steps} steps");
    }
}

/// Lights move while nobody looks, and then stand: what was settled before is learnt anew.
#[test]
fn what_changed_out_of_sight_is_learnt_when_it_comes_back() {
    let stage = Stage::new("street", 0.1, [64, 36]);
    let mut there = Lit::new("", SlcShading::default(), false);
    let mut fresh = Lit::new("", SlcShading::default(), false);
    let mut tracer = Tracer::new(&stage.scene, &stage.scene.pose(0.0));
    // Long enough to be as good as it gets, and to take no more rays.
    let moments = (0..300).map(|_| (2.0, true)).chain((1..20).map(|i| (2.0 + f64::from(i) / 5.0, false)));
    let camera = stage.scene.camera_paths()[0].camera(&stage.scene, &stage.scene.pose(2.0));
    for (i, (time_s, looks)) in moments.chain((0..12).map(|_| (5.8, true))).enumerate() {
        let pose = stage.scene.pose(time_s);
        tracer.update(&stage.scene, &pose);
        let now = Now { scene: &stage.scene, pose: &pose, tracer: &tracer, environment: None };
        let seen = looks.then(|| stage.see_from(&now, camera));
        there.step(&stage, &now, seen.as_ref());
        if let (Some(seen), true) = (&seen, i % 50 < 3 || i >= 319) {
            assert!(there.picture == there.picture_anew(&stage, &now, seen), "step {i}");
        }
        if i >= 319 {
            fresh.step(&stage, &now, seen.as_ref());
        }
        if let Some(seen) = seen.filter(|_| i == 330) {
            let params = DirectParams { samples: 256, seed: 7, ..DirectParams::default() };
            let truth = rays(&now, &seen.points, &params);
            let [there, fresh] = [&there, &fresh].map(|lit| stage.quality(&truth, &lit.picture)[0]);
            println!("{there:.2} dB, from nothing {fresh:.2} dB");
            assert!(there > fresh - 1.0 && there > 24.0, "{there} {fresh}");
            return;
        }
    }
    unreachable!("there are 331 moments");
}

/// Prints the table of `render/src/slc/README.md`: after 260 steps, no entry takes rays any more.
#[test]
#[ignore = "measures; minutes"]
fn quality_and_time() {
    for name in ["atrium-lamps", "village", "hangar"] {
        println!("{name}\n| | times as quick | PSNR | SSIM | bias, % |");
        let stage = Stage::new(name, 0.3, [320, 180]);
        measure(&stage, &still_truth(&stage, 512), (260, 5), 0);
    }
}

/// Steps of a rival, milliseconds, and its last picture.
struct Rival {
    name: &'static str,
    best: bool,
    reservoirs: Option<Restir>,
    samples: u32,
    ms: Vec<f64>,
    picture: Vec<Vec3>,
}

impl Rival {
    fn rays(name: &'static str, samples: u32) -> Rival {
        Rival { name, best: false, reservoirs: None, samples, ms: Vec::new(), picture: Vec::new() }
    }

    fn all() -> [Rival; 4] {
        let restir = Rival { reservoirs: Some(Restir::new()), ..Rival::rays("restir-di", 0) };
        let best = Rival { best: true, ..Rival::rays("rt-48, best", 48) };
        [Rival::rays("rt-16, power", 16), Rival::rays("rt-48, power", 48), best, restir]
    }

    /// The camera of reservoirs must stand still: each sample's past is that of its own pixel.
    fn step(&mut self, now: &Now<'_>, size: [u32; 2], seen: &Seen, frame: u64) {
        let start = Instant::now();
        let lights = now.lights(now.pose);
        let same: Vec<u32> = (0..size[0] * size[1]).collect();
        let (pick, sequence) =
            if self.best { (Pick::Fluence, Sequence::Lattice) } else { (Pick::Power, Sequence::Random) };
        self.picture = vec![Vec3::ZERO; seen.points.len()];
        match &mut self.reservoirs {
            Some(reservoirs) => {
                let view = RestirView {
                    points: &seen.points,
                    size: size.map(|side| side as usize),
                    eye_world: seen.camera.eye_world(),
                    previous_pixels: (frame > 0).then_some(&same),
                    past: None,
                };
                let params = RestirParams { pick, sequence, frame, ..RestirParams::default() };
                reservoirs.trace(now.tracer, &lights, &view, &params, &mut self.picture);
            }
            None => {
                let params = DirectParams { samples: self.samples, pick, sequence, seed: 0, frame };
                trace_direct(now.tracer, &lights, &seen.points, &params, &mut self.picture);
            }
        }
        self.ms.push(start.elapsed().as_secs_f64() * 1e3);
    }
}

/// Steps of cones, what of them is the server's where clients shade, milliseconds, and the last picture.
struct Lit {
    name: &'static str,
    server: ConeServer<MomentEntry>,
    caps: KeptCaps,
    params: SlcParams,
    shading: SlcShading,
    shapes: bool,
    ms: Vec<f64>,
    server_ms: Vec<f64>,
    /// Of those: finding places in the charts, and making caps of entries.
    stages: [Vec<f64>; 2],
    /// Of the server's: requests, queue, places, rays.
    passes: [Vec<f64>; 4],
    counts: ConeStep,
    picture: Vec<Vec3>,
}

impl Lit {
    fn new(name: &'static str, shading: SlcShading, shapes: bool) -> Lit {
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
    fn step(&mut self, stage: &Stage, now: &Now<'_>, seen: Option<&Seen>) {
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
    fn picture_anew(&self, stage: &Stage, now: &Now<'_>, seen: &Seen) -> Vec<Vec3> {
        let pixels =
            pixel_places(&stage.scene, now.pose, &seen.camera, &seen.gbuffer, &seen.points, &stage.charting);
        let table = AreaLightTable::new(&now.lights(now.pose));
        let light = ConeLight { lights: self.shapes.then_some(&table), ..cone_light(&self.server, &table) };
        shade_cones(&CapTable::new(&light), &seen.points, &pixels, &self.shading)
    }
}

fn median(ms: &[f64]) -> f64 {
    let mut sorted = ms.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Plays a scene to a viewer who stands or walks, methods in turn; prints what the last steps took, and how the last picture is.
fn play(stage: &Stage, walks: bool, more: Vec<Lit>, (steps, timed, samples): (u32, u32, u32)) {
    let mut rivals = Rival::all();
    let mut cones = ways();
    cones.extend(more);
    let camera = stage.scene.camera_paths()[0].camera(&stage.scene, &stage.scene.pose(stage.time_s));
    let mut tracer = Tracer::new(&stage.scene, &stage.scene.pose(stage.time_s));
    for step in 0..steps {
        let pose = stage.scene.pose(stage.time_s + f64::from(step) / 15.0);
        tracer.update(&stage.scene, &pose);
        let now = Now { scene: &stage.scene, pose: &pose, tracer: &tracer, environment: None };
        let seen = if walks { stage.see(&now) } else { stage.see_from(&now, camera) };
        let is_timed = step + timed >= steps;
        // Reservoirs here are those of a camera that stands still.
        for rival in rivals.iter_mut().filter(|rival| rival.reservoirs.is_none() || !walks) {
            if is_timed || rival.reservoirs.is_some() {
                rival.step(&now, stage.size, &seen, u64::from(step));
            }
        }
        for lit in &mut cones {
            lit.step(stage, &now, Some(&seen));
        }
        if step + 1 < steps {
            continue;
        }
        let params = DirectParams { samples, seed: 7, ..DirectParams::default() };
        let truth = rays(&now, &seen.points, &params);
        let last = |ms: &[f64]| median(&ms[ms.len().saturating_sub(timed as usize)..]);
        let line = |name: &str, ms: f64, server_ms: f64, picture: &[Vec3]| {
            let [db, ssim, bias] = stage.quality(&truth, picture);
            println!("| {name} | {ms:.1} | {server_ms:.1} | {db:.2} | {ssim:.4} | {bias:+.2} |");
        };
        for rival in rivals.iter().filter(|rival| !rival.ms.is_empty()) {
            line(rival.name, last(&rival.ms), last(&rival.ms), &rival.picture);
        }
        for lit in &cones {
            line(lit.name, last(&lit.ms), last(&lit.server_ms), &lit.picture);
            let [requests, queue, sites, rays] = lit.passes.each_ref().map(|ms| last(ms));
            let ConeStep { wanted, new, counts, .. } = lit.counts;
            println!(
                "  requests {requests:.1}, queue {queue:.1}, places {sites:.1}, rays {rays:.1} ms; {wanted} entries, {new} new, {} updated, {} rays",
                counts.updated, counts.rays
            );
        }
    }
}

/// Prints what a step takes where lights move.
#[test]
#[ignore = "measures; minutes"]
fn lights_that_move() {
    for name in ["street", "hangar"] {
        println!("{name}\n| | ms a step | server's | PSNR | SSIM | bias, % |");
        let look_up = LookUp { bias: 1.4, blend: false };
        let few = SlcParams { changed_samples: 6, together: 1, ..SlcParams::default() };
        let coarse = sampled("one texel 1.4 pixels wide, 6 samples of what changed", look_up, few);
        play(&Stage::new(name, 0.3, [320, 180]), false, vec![coarse], (40, 5, 256));
    }
}

/// Prints what a step takes while the viewer walks, with samples of young entries in so many updates and so many a frame after that.
#[test]
#[ignore = "measures; a minute"]
fn a_viewer_who_walks() {
    for name in ["atrium-lamps", "village"] {
        println!("{name}\n| | ms a step | server's | PSNR | SSIM | bias, % |");
        let more = [
            ("8 x 8, 1", 8, 8, 1),
            ("8 x 2, 1", 8, 2, 1),
            ("16 x 1, 2", 16, 1, 2),
            ("16 x 2, 2", 16, 2, 2),
            ("16 x 3, 3", 16, 3, 3),
            ("32 x 1, 2", 32, 1, 2),
        ];
        let more = more.map(|(name, first_samples, first_updates, samples)| {
            let params = SlcParams { first_samples, first_updates, samples, ..SlcParams::default() };
            sampled(name, LookUp::default(), params)
        });
        play(&Stage::new(name, 0.3, [192, 108]), true, more.into(), (24, 8, 256));
    }
}
