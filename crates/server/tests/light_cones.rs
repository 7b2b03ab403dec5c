//! Pictures lit by light cones against rays: quality, bias and time of a step with a still camera.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

use std::time::Instant;

use dapple_metrics::{psnr, ssim};
use dapple_render::area_lights::AreaLightTable;
use dapple_render::gbuffer::{GBuffer, rasterize};
use dapple_render::image::{LinearImage, Rgb8Image, ToneMap};
use dapple_render::shade::shading_points;
use dapple_render::slc::{Blending, ConeLight, SlcShading, pixel_places, shade_cones};
use dapple_scene::area_lights::Pick;
use dapple_scene::glam::{Affine3A, Vec3};
use dapple_scene::{NoFiles, PosedCamera, Scene, ShadingPoint, builtin};
use dapple_server::cones::{ConeServer, Now, cone_charts};
use dapple_store::cones::{CacheParams, Charting, EntryId, EntrySite, LookUp, MomentEntry, View};
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

    /// PSNR, dB, SSIM, and bias of the mean of what a display can show, %.
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
        let mean = |pixels: &[Vec3]| -> f64 {
            pixels.iter().map(|p| f64::from(p.min(Vec3::splat(4.0)).element_sum())).sum()
        };
        [
            psnr(&unit(&a), &unit(&b), 1.0).unwrap(),
            ssim(width, height, &luma(&a), &luma(&b)).unwrap(),
            100.0 * (mean(found) / mean(truth) - 1.0),
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

/// Cones of one way to shade, and what they came to.
struct Run {
    name: &'static str,
    server: ConeServer<MomentEntry>,
    shading: SlcShading,
    shapes: bool,
    picture: Vec<Vec3>,
    step_ms: Vec<f64>,
}

impl Run {
    fn new(name: &'static str, shading: SlcShading) -> Run {
        let server = ConeServer::new(CacheParams::default(), shading.look_up).unwrap();
        Run { name, server, shading, shapes: true, picture: Vec::new(), step_ms: Vec::new() }
    }

    fn step(&mut self, stage: &Stage, now: &Now<'_>, seen: &Seen) {
        let start = Instant::now();
        let Seen { camera, gbuffer, points } = seen;
        let pixels = pixel_places(&stage.scene, now.pose, camera, gbuffer, points, &stage.charting);
        let view = View { width: stage.size[0] as usize, pixels: &pixels };
        self.server.step(now, &[view], &SlcParams::default(), &mut |_| ());
        let table = AreaLightTable::new(&now.lights(now.pose));
        let light = ConeLight { lights: self.shapes.then_some(&table), ..cone_light(&self.server, &table) };
        self.picture = shade_cones(&light, points, &pixels, &self.shading);
        self.step_ms.push(start.elapsed().as_secs_f64() * 1e3);
    }
}

fn runs() -> Vec<Run> {
    let near = LookUp { blend: false, ..LookUp::default() };
    let wide = LookUp { bias: 2.0, ..LookUp::default() };
    vec![
        Run { shapes: false, ..Run::new("slc by cones alone", SlcShading::default()) },
        Run::new("slc", SlcShading::default()),
        Run::new("slc, all cones", SlcShading { blending: Blending::Cones, ..SlcShading::default() }),
        Run::new("slc, one texel", SlcShading { look_up: near, ..SlcShading::default() }),
        Run::new("slc, bias 2", SlcShading { look_up: wide, ..SlcShading::default() }),
    ]
}

/// Quality of each way after so many steps, and a table if asked.
fn measure(stage: &Stage, steps: usize, timed: usize, samples: u32) -> Vec<(&'static str, [f64; 3])> {
    let pose = stage.scene.pose(stage.time_s);
    let tracer = Tracer::new(&stage.scene, &pose);
    let now = Now { scene: &stage.scene, pose: &pose, tracer: &tracer, environment: None };
    let seen = stage.see(&now);
    let params = DirectParams { samples, seed: 7, ..DirectParams::default() };
    let truth = rays(&now, &seen.points, &params);
    let mut runs = runs();
    for _ in 0..steps {
        runs.iter_mut().for_each(|run| run.step(stage, &now, &seen));
    }
    runs.iter_mut().for_each(|run| run.step_ms.clear());
    let mut rivals = Vec::new();
    for seed in 0..timed as u64 {
        let (pick, sequence) = (Pick::Power, Sequence::Random);
        let start = Instant::now();
        let params = DirectParams { samples: 48, pick, sequence, seed, frame: 0 };
        let picture = rays(&now, &seen.points, &params);
        rivals.push((start.elapsed().as_secs_f64() * 1e3, picture));
        runs.iter_mut().for_each(|run| run.step(stage, &now, &seen));
    }
    let median = |mut ms: Vec<f64>| {
        ms.sort_by(f64::total_cmp);
        ms.get(ms.len() / 2).copied().unwrap_or(f64::NAN)
    };
    if let Some((_, picture)) = rivals.last() {
        let [db, ssim, bias] = stage.quality(&truth, picture);
        println!("| rt-48, power | 1 | {db:.2} | {ssim:.4} | {bias:+.2} |");
    }
    let rival_ms = median(rivals.iter().map(|(ms, _)| *ms).collect());
    let found = runs.into_iter().map(|run| {
        let quality = stage.quality(&truth, &run.picture);
        if timed > 0 {
            let [db, ssim, bias] = quality;
            let quicker = rival_ms / median(run.step_ms);
            println!("| {} | {quicker:.1} | {db:.2} | {ssim:.4} | {bias:+.2} |", run.name);
        }
        (run.name, quality)
    });
    found.collect()
}

/// Flames close to what they light, over ground whose normals lean every way: light that is lost shows.
#[test]
fn the_mean_light_of_a_village_is_that_of_rays() {
    let stage = Stage::new("village", 0.1, [96, 54]);
    for (name, [db, _, bias]) in measure(&stage, 24, 0, 256) {
        assert!(bias.abs() < 4.0 && db > 22.0, "{name}: {bias} %, {db} dB");
    }
}

/// Lights that move, over entries that had eight frames to follow: light by the shapes of what they see needs fewer samples than their energies.
#[test]
fn lights_that_move_are_shaded_by_their_shapes() {
    let stage = Stage::new("street", 0.1, [96, 54]);
    let [cones, shapes] = [false, true].map(|shapes| {
        let mut crowd = Crowd::new(SlcShading::default(), shapes);
        let mut tracer = Tracer::new(&stage.scene, &stage.scene.pose(stage.time_s));
        let mut quality = [0.0; 3];
        for step in 0..8 {
            let pose = stage.scene.pose(stage.time_s + f64::from(step) / 15.0);
            tracer.update(&stage.scene, &pose);
            let now = Now { scene: &stage.scene, pose: &pose, tracer: &tracer, environment: None };
            let seen = [stage.see(&now)];
            crowd.step(&stage, &now, &seen);
            if step == 7 {
                let params = DirectParams { samples: 256, seed: 7, ..DirectParams::default() };
                quality = stage.quality(&rays(&now, &seen[0].points, &params), &crowd.pictures[0]);
            }
        }
        quality
    });
    println!("cones {cones:?}, shapes {shapes:?}");
    assert!(shapes[0] > cones[0] + 1.0 && shapes[1] > cones[1], "{shapes:?} {cones:?}");
    assert!(shapes[0] > 28.0 && shapes[2].abs() < 1.5, "{shapes:?}");
}

/// Lights move while nobody looks, and then stand: what was settled before is learnt anew.
#[test]
fn what_changed_out_of_sight_is_learnt_when_it_comes_back() {
    let stage = Stage::new("street", 0.1, [64, 36]);
    let mut there = Crowd::new(SlcShading::default(), false);
    let mut fresh = Crowd::new(SlcShading::default(), false);
    let mut tracer = Tracer::new(&stage.scene, &stage.scene.pose(0.0));
    // Long enough to be as good as it gets, and to take no more rays.
    let moments = (0..300).map(|_| (2.0, true)).chain((1..20).map(|i| (2.0 + f64::from(i) / 5.0, false)));
    let camera = stage.scene.camera_paths()[0].camera(&stage.scene, &stage.scene.pose(2.0));
    for (i, (time_s, looks)) in moments.chain((0..12).map(|_| (5.8, true))).enumerate() {
        let pose = stage.scene.pose(time_s);
        tracer.update(&stage.scene, &pose);
        let now = Now { scene: &stage.scene, pose: &pose, tracer: &tracer, environment: None };
        let seen: Vec<Seen> = looks.then(|| stage.see_from(&now, camera)).into_iter().collect();
        there.step(&stage, &now, &seen);
        if i >= 319 {
            fresh.step(&stage, &now, &seen);
        }
        if i == 330 {
            let params = DirectParams { samples: 256, seed: 7, ..DirectParams::default() };
            let truth = rays(&now, &seen[0].points, &params);
            let [there, fresh] = [&there, &fresh].map(|crowd| stage.quality(&truth, &crowd.pictures[0])[0]);
            println!("{there:.2} dB, from nothing {fresh:.2} dB");
            assert!(there > fresh - 1.0 && there > 24.0, "{there} {fresh}");
            return;
        }
    }
    unreachable!("there are 331 moments");
}

/// Prints the table of `render/src/slc/README.md`: all entries are settled after 260 steps.
#[test]
#[ignore = "measures; minutes"]
fn quality_and_time() {
    for name in ["atrium-lamps", "village", "hangar"] {
        println!("{name}\n| | times as quick | PSNR | SSIM | bias, % |");
        measure(&Stage::new(name, 0.3, [320, 180]), 260, 5, 512);
    }
}

/// A step of each rival for all viewers, milliseconds, and its last pictures.
struct Rival {
    name: &'static str,
    best: bool,
    reservoirs: Option<Vec<Restir>>,
    samples: u32,
    ms: Vec<f64>,
    pictures: Vec<Vec<Vec3>>,
}

impl Rival {
    fn rays(name: &'static str, samples: u32) -> Rival {
        Rival { name, best: false, reservoirs: None, samples, ms: Vec::new(), pictures: Vec::new() }
    }

    fn all(viewers: usize) -> [Rival; 4] {
        let reservoirs = Some((0..viewers).map(|_| Restir::new()).collect());
        let restir = Rival { reservoirs, ..Rival::rays("restir-di", 0) };
        let best = Rival { best: true, ..Rival::rays("rt-48, best", 48) };
        [Rival::rays("rt-16, power", 16), Rival::rays("rt-48, power", 48), best, restir]
    }

    /// Cameras of reservoirs must stand still: each sample's past is that of its own pixel.
    fn step(&mut self, now: &Now<'_>, size: [u32; 2], seen: &[Seen], frame: u64) {
        let start = Instant::now();
        let lights = now.lights(now.pose);
        let same: Vec<u32> = (0..size[0] * size[1]).collect();
        let picture = |(viewer, seen): (usize, &Seen)| {
            let mut out = vec![Vec3::ZERO; seen.points.len()];
            let (pick, sequence) =
                if self.best { (Pick::Fluence, Sequence::Lattice) } else { (Pick::Power, Sequence::Random) };
            let seed = viewer as u64;
            match &mut self.reservoirs {
                Some(reservoirs) => {
                    let view = RestirView {
                        points: &seen.points,
                        size: size.map(|side| side as usize),
                        eye_world: seen.camera.eye_world(),
                        previous_pixels: (frame > 0).then_some(&same),
                        past: None,
                    };
                    let params = RestirParams { pick, sequence, seed, frame, ..RestirParams::default() };
                    reservoirs[viewer].trace(now.tracer, &lights, &view, &params, &mut out);
                }
                None => {
                    let params = DirectParams { samples: self.samples, pick, sequence, seed, frame };
                    trace_direct(now.tracer, &lights, &seen.points, &params, &mut out);
                }
            }
            out
        };
        self.pictures = seen.iter().enumerate().map(picture).collect();
        self.ms.push(start.elapsed().as_secs_f64() * 1e3);
    }
}

/// Cones for several viewers: all of a step, and what of it is the server's where clients shade.
struct Crowd {
    server: ConeServer<MomentEntry>,
    shading: SlcShading,
    shapes: bool,
    ms: Vec<f64>,
    server_ms: Vec<f64>,
    pictures: Vec<Vec<Vec3>>,
}

impl Crowd {
    fn new(shading: SlcShading, shapes: bool) -> Crowd {
        let server = ConeServer::new(CacheParams::default(), shading.look_up).unwrap();
        Crowd { server, shading, shapes, ms: Vec::new(), server_ms: Vec::new(), pictures: Vec::new() }
    }

    fn step(&mut self, stage: &Stage, now: &Now<'_>, seen: &[Seen]) {
        let start = Instant::now();
        let pixels: Vec<_> = seen
            .iter()
            .map(|s| pixel_places(&stage.scene, now.pose, &s.camera, &s.gbuffer, &s.points, &stage.charting))
            .collect();
        let views: Vec<View<'_>> =
            pixels.iter().map(|pixels| View { width: stage.size[0] as usize, pixels }).collect();
        let begun = Instant::now();
        self.server.step(now, &views, &SlcParams::default(), &mut |_| ());
        self.server_ms.push(begun.elapsed().as_secs_f64() * 1e3);
        let table = AreaLightTable::new(&now.lights(now.pose));
        let light = ConeLight { lights: self.shapes.then_some(&table), ..cone_light(&self.server, &table) };
        let shade =
            |(seen, pixels): (&Seen, &Vec<_>)| shade_cones(&light, &seen.points, pixels, &self.shading);
        self.pictures = seen.iter().zip(&pixels).map(shade).collect();
        self.ms.push(start.elapsed().as_secs_f64() * 1e3);
    }
}

fn median(ms: &[f64]) -> f64 {
    let mut sorted = ms.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Plays a scene to viewers whose cameras `camera` gives, methods in turn; prints what the last steps took, and how the last pictures are.
fn play(
    stage: &Stage,
    viewers: usize,
    (steps, timed, samples): (u32, u32, u32),
    camera: &dyn Fn(&Now<'_>, usize) -> PosedCamera,
) {
    let mut rivals = Rival::all(viewers);
    let near = LookUp { blend: false, ..LookUp::default() };
    let one = SlcShading { look_up: near, ..SlcShading::default() };
    let wide = LookUp { bias: 2.0, ..LookUp::default() };
    let mut crowds = [
        ("slc by cones alone", Crowd::new(SlcShading::default(), false)),
        ("slc", Crowd::new(SlcShading::default(), true)),
        ("slc, one texel", Crowd::new(one, true)),
        ("slc, bias 2", Crowd::new(SlcShading { look_up: wide, ..SlcShading::default() }, true)),
    ];
    let mut tracer = Tracer::new(&stage.scene, &stage.scene.pose(stage.time_s));
    for step in 0..steps {
        let pose = stage.scene.pose(stage.time_s + f64::from(step) / 15.0);
        tracer.update(&stage.scene, &pose);
        let now = Now { scene: &stage.scene, pose: &pose, tracer: &tracer, environment: None };
        let seen: Vec<Seen> = (0..viewers).map(|viewer| stage.see_from(&now, camera(&now, viewer))).collect();
        let is_timed = step + timed >= steps;
        for rival in &mut rivals {
            if is_timed || rival.reservoirs.is_some() {
                rival.step(&now, stage.size, &seen, u64::from(step));
            }
        }
        for (_, crowd) in &mut crowds {
            crowd.step(stage, &now, &seen);
        }
        if step + 1 < steps {
            continue;
        }
        let params = DirectParams { samples, seed: 7, ..DirectParams::default() };
        let truths: Vec<Vec<Vec3>> = seen.iter().map(|seen| rays(&now, &seen.points, &params)).collect();
        let quality = |pictures: &[Vec<Vec3>]| {
            let mut sum = [0.0; 3];
            for (truth, picture) in truths.iter().zip(pictures) {
                let [db, ssim, bias] = stage.quality(truth, picture);
                // Errors are averaged, not decibels.
                sum = [sum[0] + 10f64.powf(-0.1 * db), sum[1] + ssim, sum[2] + bias];
            }
            let [mse, ssim, bias] = sum.map(|sum| sum / truths.len() as f64);
            [-10.0 * mse.log10(), ssim, bias]
        };
        let last = |ms: &[f64]| median(&ms[ms.len() - timed as usize..]);
        let line = |name: &str, ms: f64, server_ms: f64, [db, ssim, bias]: [f64; 3]| {
            println!("| {name} | {ms:.1} | {server_ms:.1} | {db:.2} | {ssim:.4} | {bias:+.2} |");
        };
        for rival in &rivals {
            line(rival.name, last(&rival.ms), last(&rival.ms), quality(&rival.pictures));
        }
        for (name, crowd) in &crowds {
            line(name, last(&crowd.ms), last(&crowd.server_ms), quality(&crowd.pictures));
        }
    }
}

/// Prints what a step takes where lights move: a viewer who stands.
#[test]
#[ignore = "measures; minutes"]
fn lights_that_move() {
    for name in ["street", "hangar"] {
        println!("{name}\n| | ms a step | server's | PSNR | SSIM | bias, % |");
        let stage = Stage::new(name, 0.3, [320, 180]);
        let camera = stage.scene.camera_paths()[0].camera(&stage.scene, &stage.scene.pose(stage.time_s));
        play(&stage, 1, (40, 5, 256), &|_, _| camera);
    }
}

/// Prints what a step takes for many viewers: far from each other, and in one place, turned.
#[test]
#[ignore = "measures; minutes"]
fn many_viewers() {
    let stage = Stage::new("atrium-lamps", 0.3, [160, 90]);
    let path = &stage.scene.camera_paths()[0];
    let seconds = path.duration_s().max(1.0);
    let at = |time_s: f64| path.camera(&stage.scene, &stage.scene.pose(time_s));
    for viewers in [1, 4, 16] {
        println!("{viewers} apart\n| | ms a step | server's | PSNR | SSIM | bias, % |");
        let cameras: Vec<_> =
            (0..viewers).map(|i| at((stage.time_s + f64::from(i) * 0.618_034 * seconds) % seconds)).collect();
        play(&stage, viewers as usize, (30, 3, 128), &|_, viewer| cameras[viewer]);
        println!("{viewers} in one place\n| | ms a step | server's | PSNR | SSIM | bias, % |");
        let turned = |viewer: usize| {
            let mut camera = at(stage.time_s);
            let turn = Affine3A::from_rotation_y((viewer as f32).to_radians());
            camera.world_from_view.matrix3 = turn.matrix3 * camera.world_from_view.matrix3;
            camera
        };
        play(&stage, viewers as usize, (30, 3, 128), &|_, viewer| turned(viewer));
    }
}
