//! What is measured side by side: quality, bias and time of steps, ours and rivals'.

use std::time::Instant;

use dapple_render::slc::{Blending, SlcShading};
use dapple_scene::ShadingPoint;
use dapple_scene::area_lights::Pick;
use dapple_scene::glam::Vec3;
use dapple_server::cones::{ConeStep, Now};
use dapple_store::cones::{LookUp, MomentParams};
use dapple_trace::Tracer;
use dapple_trace::direct::{DirectParams, Restir, RestirParams, RestirView, Sequence, trace_direct};
use dapple_trace::slc::SlcParams;

use crate::stage::{Lit, Seen, Stage, rays};

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
    let mut lit = Lit::new(name, SlcShading { look_up, ..SlcShading::default() }, true);
    lit.params = params;
    lit
}

/// What rays find with the best sampler: means of single pictures by power are up to 0.3 % off in the village.
fn best_truth(now: &Now<'_>, seen: &Seen, samples: u32) -> Vec<Vec3> {
    let (pick, sequence) = (Pick::Fluence, Sequence::Lattice);
    rays(now, &seen.points, &DirectParams { samples, pick, sequence, seed: 7, ..DirectParams::default() })
}

/// What rays find where nothing has moved yet.
pub(crate) fn still_truth(stage: &Stage, samples: u32) -> Vec<Vec3> {
    let pose = stage.scene.pose(stage.time_s);
    let tracer = Tracer::new(&stage.scene, &pose);
    let now = Now { scene: &stage.scene, pose: &pose, tracer: &tracer, environment: None };
    let params = DirectParams { samples, seed: 7, ..DirectParams::default() };
    rays(&now, &stage.see(&now).points, &params)
}

/// Quality of each way after so many steps, and a table if asked.
pub(crate) fn measure(
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
        let four = sampled("slc, 4 cones", LookUp::default(), four_cones());
        play(&Stage::new(name, 0.3, [320, 180]), false, vec![coarse, four], (40, 9, 256));
    }
}

/// One more than the paper has.
fn four_cones() -> SlcParams {
    let moment = MomentParams { cones: 4, ..MomentParams::default() };
    SlcParams { moment, ..SlcParams::default() }
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

/// Steps after which entries of what stands are settled.
const SETTLED: u32 = 100;

/// Prints quality and bias, means of two seeds and of four moments of each of three walks, and the largest bias of any of them; and the same once all has stood
/// in three places until it is settled.
#[test]
#[ignore = "measures; minutes"]
fn quality_over_a_walk() {
    let ways = || {
        let alone = SlcParams { together: 0, ..SlcParams::default() };
        let near = LookUp { blend: false, ..LookUp::default() };
        [
            sampled("slc", LookUp::default(), SlcParams::default()),
            sampled("places of its own", LookUp::default(), alone),
            sampled("4 cones", LookUp::default(), four_cones()),
            sampled("one texel", near, SlcParams { together: 1, ..SlcParams::default() }),
        ]
    };
    println!("| scene | | PSNR | SSIM | bias, % | largest |");
    for name in ["atrium-lamps", "village", "street", "hangar"] {
        for (walks, steps) in [(true, 16), (false, SETTLED)] {
            let mut found = vec![Vec::new(); ways().len()];
            for start_s in [1.0, 6.0, 11.0] {
                let stage = Stage { time_s: start_s, ..Stage::new(name, 0.3, [192, 108]) };
                walk(&stage, (walks, steps), |_| (), ways, &mut found);
            }
            for (way, found) in ways().iter().zip(found) {
                let [db, ssim, bias] = std::array::from_fn(|k| {
                    found.iter().map(|quality: &[f64; 3]| quality[k]).sum::<f64>() / found.len() as f64
                });
                let largest = found.iter().map(|quality| quality[2].abs()).fold(0.0, f64::max);
                let does = if walks { "walks" } else { "stands" };
                println!(
                    "| {name}, {does} | {} | {db:.2} | {ssim:.4} | {bias:+.2} | {largest:.2} |",
                    way.name
                );
            }
        }
    }
}

/// Prints what bias is of: of all light, and without what surfaces mirror, with so many cones an entry; means of two seeds and of two walks, and of two
/// places where all stands.
#[test]
#[ignore = "measures; minutes"]
fn what_bias_is_of() {
    let ways = || {
        let of = |name, cones| {
            let moment = MomentParams { cones, ..MomentParams::default() };
            sampled(name, LookUp::default(), SlcParams { moment, ..SlcParams::default() })
        };
        [of("1", 1), of("3", 3), of("4", 4)]
    };
    println!("| scene | cones | bias, % | PSNR |");
    for name in ["village", "hangar"] {
        for (what, has_gloss) in [("all", true), ("without gloss", false)] {
            let alter = |point: &mut ShadingPoint| point.reflectance.specular &= has_gloss;
            for (does, walks) in [("walks", (true, 16)), ("stands", (false, SETTLED))] {
                let mut found = vec![Vec::new(); ways().len()];
                for start_s in [1.0, 6.0] {
                    let stage = Stage { time_s: start_s, ..Stage::new(name, 0.3, [192, 108]) };
                    walk(&stage, walks, alter, ways, &mut found);
                }
                for (way, found) in ways().iter().zip(found) {
                    let mean =
                        |k: usize| found.iter().map(|q: &[f64; 3]| q[k]).sum::<f64>() / found.len() as f64;
                    println!("| {name}, {what}, {does} | {} | {:+.2} | {:.2} |", way.name, mean(2), mean(0));
                }
            }
        }
    }
}

/// Quality of each way and two seeds in every fourth of so many moments of a walk, or in the last where a viewer stands, after `alter` of all that is seen.
fn walk<const N: usize>(
    stage: &Stage,
    (walks, steps): (bool, u32),
    alter: impl Fn(&mut ShadingPoint),
    ways: impl Fn() -> [Lit; N],
    found: &mut [Vec<[f64; 3]>],
) {
    let mut cones: Vec<Lit> = (0..2).flat_map(|_| ways()).collect();
    for (i, lit) in cones.iter_mut().enumerate() {
        lit.params.seed = (i / N) as u64;
    }
    let mut tracer = Tracer::new(&stage.scene, &stage.scene.pose(stage.time_s));
    for step in 1..=steps {
        let time_s = stage.time_s + if walks { f64::from(step) / 15.0 } else { 0.0 };
        let pose = stage.scene.pose(time_s);
        tracer.update(&stage.scene, &pose);
        let now = Now { scene: &stage.scene, pose: &pose, tracer: &tracer, environment: None };
        let mut seen = stage.see(&now);
        seen.points.iter_mut().flatten().for_each(&alter);
        cones.iter_mut().for_each(|lit| lit.step(stage, &now, Some(&seen)));
        if step % 4 != 0 || !walks && step < steps {
            continue;
        }
        let truth = best_truth(&now, &seen, 256);
        for (i, lit) in cones.iter().enumerate() {
            found[i % N].push(stage.quality(&truth, &lit.picture));
        }
    }
}

/// Prints quality and bias where all lights move and the viewer stands: means of eight moments at each of three places, and the largest bias of any.
#[test]
#[ignore = "measures; minutes"]
fn quality_where_all_lights_move() {
    let mut found = Vec::new();
    for start_s in [1.0, 6.0, 11.0] {
        let stage = Stage { time_s: start_s, ..Stage::new("hangar", 0.3, [192, 108]) };
        let mut lit = sampled("slc", LookUp::default(), SlcParams::default());
        let start = stage.scene.pose(start_s);
        let mut tracer = Tracer::new(&stage.scene, &start);
        let camera = stage.scene.camera_paths()[0].camera(&stage.scene, &start);
        for step in 1..=64u32 {
            let pose = stage.scene.pose(start_s + f64::from(step) / 15.0);
            tracer.update(&stage.scene, &pose);
            let now = Now { scene: &stage.scene, pose: &pose, tracer: &tracer, environment: None };
            let seen = stage.see_from(&now, camera);
            lit.step(&stage, &now, Some(&seen));
            if step % 8 == 0 {
                found.push(stage.quality(&best_truth(&now, &seen, 512), &lit.picture));
            }
        }
    }
    let [db, ssim, bias] =
        std::array::from_fn(|k| found.iter().map(|q: &[f64; 3]| q[k]).sum::<f64>() / found.len() as f64);
    let largest = found.iter().map(|quality| quality[2].abs()).fold(0.0, f64::max);
    println!("| scene | PSNR | SSIM | bias, % | largest |");
    println!("| hangar | {db:.2} | {ssim:.4} | {bias:+.2} | {largest:.2} |");
}
