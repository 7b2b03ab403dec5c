//! Reuse over frames and pixels.

use std::f32::consts::PI;

use dapple_scene::EmitterShape::{Disc, Rectangle};
use dapple_scene::area_lights::{AreaLights, Pick};
use dapple_scene::glam::{Affine3A, Vec2, Vec3};
use dapple_scene::{PosedInstance, Reflectance, ShadingPoint};

use super::stage::{Stage, point, white};
use super::traced::{EYE, assert_near, closed_forms, hostile, mean, room, room_points};
use crate::direct::{
    DirectParams, NO_PIXEL, Past, Restir, RestirParams, RestirView, RisParams, Sequence, trace_direct,
    trace_ris,
};
use crate::test_support::quad;

fn view<'a>(points: &'a [Option<ShadingPoint>], width: usize) -> RestirView<'a> {
    let size = [width, points.len() / width];
    RestirView { points, size, eye_world: EYE, previous_pixels: None, past: None }
}

/// Means of a still picture over eight frames, each from the beginning on, of so many seeds: frames of one seed resemble each other.
fn frames(
    stage: &Stage,
    points: &[Option<ShadingPoint>],
    width: usize,
    params: &RestirParams,
    seeds: u64,
) -> Vec<Vec3> {
    let (lights, tracer) = (AreaLights::new(&stage.scene, &stage.pose), stage.tracer());
    let (mut sum, mut out) = (vec![Vec3::ZERO; points.len()], vec![Vec3::NAN; points.len()]);
    for seed in 0..seeds {
        let mut restir = Restir::new();
        for frame in 0..8 {
            let params = RestirParams { frame, seed, ..*params };
            restir.trace(&tracer, &lights, &view(points, width), &params, &mut out);
            for (sum, out) in sum.iter_mut().zip(&out) {
                *sum += *out / (8 * seeds) as f32;
            }
        }
    }
    sum
}

fn truth(stage: &Stage, points: &[Option<ShadingPoint>]) -> Vec<Vec3> {
    let lights = AreaLights::new(&stage.scene, &stage.pose);
    let mut out = vec![Vec3::ZERO; points.len()];
    let params = DirectParams { samples: 2048, seed: 4, ..DirectParams::default() };
    trace_direct(&stage.tracer(), &lights, points, &params, &mut out);
    out
}

/// Both, with the best sampler and with the paper's.
fn variants() -> [RestirParams; 4] {
    let paper = |p: RestirParams| RestirParams { pick: Pick::Power, sequence: Sequence::Random, ..p };
    let (biased, unbiased) = (RestirParams::default(), RestirParams::unbiased());
    [biased, paper(biased), unbiased, paper(unbiased)]
}

#[test]
fn closed_forms_in_the_mean() {
    for (what, stage, normal, exact) in closed_forms() {
        for params in variants() {
            let found = frames(&stage, &[Some(point(normal)); 1024], 32, &params, 1);
            assert_near(mean(&found) * PI, exact, 0.01, what);
        }
    }
}

fn glossy() -> Reflectance {
    Reflectance { diffuse: Vec3::splat(0.6), f0: Vec3::splat(0.04), alpha: 0.2, specular: true }
}

#[test]
fn unbiased_means_are_the_truth_and_biased_ones_are_dark() {
    let stage = room();
    let [best, by_power, unbiased, unbiased_by_power] = variants();
    for (reflectance, variants) in [(white(), [best, unbiased]), (glossy(), [by_power, unbiased_by_power])] {
        let points = room_points(&stage, [48, 30], reflectance);
        let truth = truth(&stage, &points);
        let whole = mean(&truth);
        for params in variants {
            let found = frames(&stage, &points, 48, &params, 16);
            let loss = mean(&found) / whole - 1.0;
            println!("unbiased {} {:?}: {:+.2} %", params.unbiased, params.pick, 100.0 * loss);
            if params.unbiased {
                assert!(loss.abs() < 0.01, "{params:?}: {loss}");
                // Nor is what one part gains lost by another.
                for rows in [0..480, 480..960, 960..1440] {
                    assert_near(mean(&found[rows.clone()]), mean(&truth[rows]), 0.02, "part");
                }
            } else {
                assert!((-0.06..-0.01).contains(&loss), "{params:?}: {loss}");
            }
        }
    }
}

#[test]
fn half_a_light_is_hidden() {
    let mut stage = Stage::default();
    stage.flat(Disc, Vec3::Y, Vec2::ONE, 10.0).wall(quad(
        Vec3::new(0.0, 0.5, -9.0),
        Vec3::new(0.0, 0.5, 9.0),
        Vec3::new(9.0, 0.5, 9.0),
        Vec3::new(9.0, 0.5, -9.0),
    ));
    let points = [Some(point(Vec3::Y)); 1024];
    let exact = 10.0 * PI * 0.25;
    for params in variants() {
        let found = mean(&frames(&stage, &points, 32, &params, 12)) * PI;
        println!("unbiased {} {:?}: {found} of {exact}", params.unbiased, params.pick);
        // All of these pixels see alike, so that reuse loses nothing.
        assert_near(found, exact, 0.02, "half a disc");
    }
}

/// Light that a neighbour or the past saw does not leak to where it cannot arrive.
#[test]
fn nothing_arrives_from_behind() {
    let mut stage = Stage::default();
    stage.ball(2.0 * Vec3::Y, 0.5, 10.0).wall(quad(
        Vec3::new(1.0, 0.5, -1.0),
        Vec3::new(1.0, 0.5, 1.0),
        Vec3::new(3.0, 0.5, 1.0),
        Vec3::new(3.0, 0.5, -1.0),
    ));
    // Lit, turned away, smooth but turned away, and under a roof, side by side.
    let roofed = ShadingPoint { position_world: Vec3::new(1.2, 0.49, 0.0), ..point(Vec3::Y) };
    let smooth = ShadingPoint { normal_shading_world: Vec3::Y, ..point(-Vec3::Y) };
    let four = [point(Vec3::Y), point(-Vec3::Y), smooth, roofed];
    let points: Vec<_> = (0..256).map(|i| Some(four[i % 4])).collect();
    for params in variants() {
        let params = RestirParams { normal_cosine: -1.0, depth_ratio: f32::INFINITY, ..params };
        let found = frames(&stage, &points, 16, &params, 3);
        let of = |k: usize| found.iter().skip(k).step_by(4).map(|v| v.x).sum::<f32>();
        assert!(of(0) > 0.0);
        assert_eq!([of(1), of(2), of(3)], [0.0; 3]);
        if params.unbiased {
            assert_near(of(0) / 64.0 * PI, 10.0 * PI * 0.25 / 4.0, 0.02, "the lit ones");
        }
    }
}

/// A light and a wall that move through the room, in a picture that is mirrored with every frame.
#[test]
fn unbiased_where_light_and_walls_move_and_pixels_are_elsewhere() {
    const WIDTH: usize = 40;
    let mut stage = room();
    let wall = quad(
        Vec3::new(-0.8, 0.0, 0.8),
        Vec3::new(0.8, 0.0, 0.8),
        Vec3::new(0.8, 1.4, 0.8),
        Vec3::new(-0.8, 1.4, 0.8),
    );
    stage.wall(wall).flat(Rectangle, Vec3::new(0.0, 2.5, 0.0), Vec2::new(0.6, 0.6), 40.0);
    let (mover, light) = (stage.pose.instances.len() - 2, stage.pose.instances.len() - 1);
    let rest = stage.pose.instances[light].world_from_mesh;
    let at = |frame: u64| {
        let mut pose = stage.pose.clone();
        let phase = (frame as f32 * 0.9).sin();
        pose.instances[mover] = PosedInstance {
            world_from_mesh: Affine3A::from_translation(Vec3::new(1.5 * phase, 0.0, 0.0)),
            deformed: None,
        };
        pose.instances[light].world_from_mesh = Affine3A::from_translation(Vec3::new(-2.0 * phase, 0.0, 0.0))
            * rest
            * Affine3A::from_scale(Vec3::splat(1.0 + 0.4 * phase));
        Stage { scene: stage.scene.clone(), pose }
    };
    let mirrored: Vec<u32> = (0..WIDTH as u32 * 24)
        .map(|i| i / WIDTH as u32 * WIDTH as u32 + WIDTH as u32 - 1 - i % WIDTH as u32)
        .collect();
    let stages: Vec<Stage> = (0..10).map(at).collect();
    let lights: Vec<_> = stages.iter().map(|s| AreaLights::new(&s.scene, &s.pose)).collect();
    let tracers: Vec<_> = stages.iter().map(Stage::tracer).collect();
    let pictures: Vec<Vec<_>> = (0..10)
        .map(|i| {
            let points = room_points(&stages[i], [WIDTH, 24], white());
            if i % 2 == 0 { points } else { mirrored.iter().map(|i| points[*i as usize]).collect() }
        })
        .collect();
    let exact: f32 = stages.iter().zip(&pictures).map(|(s, points)| mean(&truth(s, points))).sum();
    let found = [true, false].map(|told| {
        let mut sum = 0.0;
        for seed in 0..24 {
            let mut restir = Restir::new();
            for i in 0..10usize {
                let past = i
                    .checked_sub(1)
                    .filter(|_| told)
                    .map(|i| Past { tracer: &tracers[i], lights: &lights[i] });
                let previous_pixels = Some(&mirrored[..]);
                let view = RestirView { previous_pixels, past, ..view(&pictures[i], WIDTH) };
                let params = RestirParams { frame: i as u64, seed, ..RestirParams::unbiased() };
                let mut out = vec![Vec3::ZERO; pictures[i].len()];
                restir.trace(&tracers[i], &lights[i], &view, &params, &mut out);
                sum += mean(&out) / 24.0;
            }
        }
        sum
    });
    let [with, without] = found.map(|f| 100.0 * (f / exact - 1.0));
    println!("moving: with the past {with:+.2} %, without {without:+.2} %");
    assert_near(found[0], exact, 0.02, "moving");
    // What the past is for.
    assert!(without < -3.0);
}

#[test]
fn a_light_that_goes_is_gone_at_once() {
    let mut stage = Stage::default();
    stage.ball(2.0 * Vec3::Y, 0.5, 10.0);
    let points = [Some(point(Vec3::Y)); 64];
    let mut restir = Restir::new();
    let mut out = [Vec3::ZERO; 64];
    let mut trace = |stage: &Stage, frame: u64| {
        let lights = AreaLights::new(&stage.scene, &stage.pose);
        let params = RestirParams { frame, ..RestirParams::default() };
        restir.trace(&stage.tracer(), &lights, &view(&points, 8), &params, &mut out);
        mean(&out)
    };
    assert!(trace(&stage, 0) > 0.0);
    let there = stage.pose.instances[0].clone();
    stage.pose.instances[0] = PosedInstance::REMOVED;
    assert_eq!(trace(&stage, 1), 0.0);
    stage.pose.instances[0] = there;
    assert!(trace(&stage, 2) > 0.0);
}

/// Squared error of the sixteenth frame.
fn error(
    stage: &Stage,
    points: &[Option<ShadingPoint>],
    truth: &[Vec3],
    params: &RestirParams,
    previous: u32,
) -> f64 {
    let (lights, tracer) = (AreaLights::new(&stage.scene, &stage.pose), stage.tracer());
    let mut restir = Restir::new();
    let mut out = vec![Vec3::NAN; points.len()];
    let pixels: Vec<u32> = (0..points.len() as u32).map(|i| i | previous).collect();
    for frame in 0..16 {
        let view = RestirView { previous_pixels: Some(&pixels), ..view(points, 48) };
        restir.trace(&tracer, &lights, &view, &RestirParams { frame, ..*params }, &mut out);
    }
    out.iter().zip(truth).map(|(a, b)| f64::from(a.distance_squared(*b))).sum()
}

/// What reuse is for: many small lights, few candidates.
#[test]
fn reuse_calms_noise() {
    let mut stage = Stage::default();
    stage.wall(quad(
        Vec3::new(-9.0, 0.0, 9.0),
        Vec3::new(9.0, 0.0, 9.0),
        Vec3::new(9.0, 0.0, -9.0),
        Vec3::new(-9.0, 0.0, -9.0),
    ));
    for i in 0..100 {
        let (x, z) = ((i % 10) as f32 - 4.5, (i / 10) as f32 - 6.5);
        stage.ball(Vec3::new(x, 0.4, z), 0.05, 20.0 + (i * 7 % 11) as f32);
    }
    let points = room_points(&stage, [48, 30], white());
    let truth = truth(&stage, &points);
    let (lights, tracer) = (AreaLights::new(&stage.scene, &stage.pose), stage.tracer());
    let mut out = vec![Vec3::NAN; points.len()];
    let params =
        RisParams { candidates: 4, pick: Pick::Power, sequence: Sequence::Random, ..RisParams::default() };
    trace_ris(&tracer, &lights, &points, &params, &mut out);
    let ris: f64 = out.iter().zip(&truth).map(|(a, b)| f64::from(a.distance_squared(*b))).sum();
    for params in [RestirParams::default(), RestirParams::unbiased()] {
        let params = RestirParams { candidates: 4, pick: Pick::Power, sequence: Sequence::Random, ..params };
        let both = error(&stage, &points, &truth, &params, 0);
        let spatial = error(&stage, &points, &truth, &params, NO_PIXEL);
        let temporal = error(&stage, &points, &truth, &RestirParams { passes: 0, ..params }, 0);
        println!("ris {ris} spatial {spatial} temporal {temporal} both {both}");
        assert!(
            spatial < 0.8 * ris && temporal < 0.8 * ris && both < spatial.min(temporal),
            "{ris} {spatial} {temporal} {both}"
        );
    }
}

#[test]
fn another_size_begins_anew_and_threads_change_nothing() {
    let stage = room();
    let (lights, tracer) = (AreaLights::new(&stage.scene, &stage.pose), stage.tracer());
    let points = room_points(&stage, [48, 30], white());
    let small = room_points(&stage, [20, 10], white());
    for params in [RestirParams::default(), RestirParams::unbiased()] {
        let run = |threads: usize, first: &[Option<ShadingPoint>], width: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let mut restir = Restir::new();
                let mut cost = vec![];
                let mut out = vec![Vec3::NAN; first.len()];
                restir.trace(&tracer, &lights, &view(first, width), &params, &mut out);
                let mut out = vec![Vec3::NAN; points.len()];
                for frame in 1..4 {
                    let params = RestirParams { frame, ..params };
                    cost.push(restir.trace(&tracer, &lights, &view(&points, 48), &params, &mut out));
                }
                (out, cost)
            })
        };
        let one = run(1, &points, 48);
        assert_eq!(one, run(3, &points, 48));
        assert_ne!(one.0, run(1, &small, 20).0);
        assert_eq!(run(1, &small, 20), run(2, &[], 1));
        let pixels = points.iter().flatten().count() as f64;
        println!("unbiased {}: {:.2} rays a pixel", params.unbiased, one.1[2].rays as f64 / pixels);
        assert!(one.1[2].rays as f64 / pixels < if params.unbiased { 6.0 } else { 2.0 });
    }
}

#[test]
fn hostile_lights_surfaces_and_parameters_give_numbers() {
    let (stages, mut points) = hostile();
    points.truncate(192);
    let strange = RestirParams {
        candidates: 0,
        history: f32::NAN,
        neighbours: u32::MAX,
        passes: 3,
        radius_px: f32::INFINITY,
        normal_cosine: f32::NEG_INFINITY,
        depth_ratio: f32::INFINITY,
        ..RestirParams::unbiased()
    };
    for stage in &stages {
        let (lights, tracer) = (AreaLights::new(&stage.scene, &stage.pose), stage.tracer());
        for params in
            variants().into_iter().chain([strange, RestirParams { history: f32::INFINITY, ..strange }])
        {
            let mut restir = Restir::new();
            let mut out = vec![Vec3::NAN; points.len()];
            for frame in 0..3 {
                let params = RestirParams { frame, ..params };
                restir.trace(&tracer, &lights, &view(&points, 16), &params, &mut out);
                assert!(out.iter().all(|v| v.is_finite() && v.min_element() >= 0.0), "{params:?}");
            }
        }
    }
}
