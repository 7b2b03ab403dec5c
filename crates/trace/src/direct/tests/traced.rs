//! Samples and rays alone.

use std::f32::consts::{PI, TAU};
use std::sync::Mutex;

use dapple_scene::EmitterShape::{Disc, Rectangle, Triangles};
use dapple_scene::area_lights::{AreaLights, Environment, Pick};
use dapple_scene::glam::{Mat3, Vec2, Vec3};
use dapple_scene::{Reflectance, ShadingPoint};

use super::stage::{Stage, picture, point};
use crate::direct::{
    DirectCost, DirectParams, MAX_SAMPLES, Sequence, trace_direct, trace_direct_with_progress,
};
use crate::test_support::quad;

pub(super) const PICKS: [Pick; 3] = [Pick::Uniform, Pick::Power, Pick::Fluence];
const SEQUENCES: [Sequence; 2] = [Sequence::Random, Sequence::Lattice];

/// Lights over the origin, the normal of a white point there, and its irradiance.
pub(super) fn closed_forms() -> Vec<(&'static str, Stage, Vec3, f32)> {
    let ball = |normal: Vec3| {
        let mut stage = Stage::default();
        stage.ball(2.0 * Vec3::Y, 0.5, 10.0);
        // π L r² / d² × cosine.
        (stage, normal, 10.0 * PI * 0.25 / 4.0 * normal.y)
    };
    let (sin, cos) = 75f32.to_radians().sin_cos();
    let (overhead, up, overhead_exact) = ball(Vec3::Y);
    let (low, tilted, low_exact) = ball(Vec3::new(sin, cos, 0.0));
    let (mut disc, mut rectangle, mut triangles) = (Stage::default(), Stage::default(), Stage::default());
    disc.flat(Disc, Vec3::Y, Vec2::ONE, 10.0);
    rectangle.flat(Rectangle, Vec3::Y, Vec2::new(2.5, 1.0), 10.0);
    triangles.flat(Triangles, Vec3::Y, Vec2::new(2.5, 1.0), 10.0);
    // Four corners' form factors.
    let (a, b) = (2.5f32, 1.0f32);
    let (p, q) = ((1.0 + a * a).sqrt(), (1.0 + b * b).sqrt());
    let rectangle_exact = 10.0 * PI * 4.0 * (a / p * (b / p).atan() + b / q * (a / q).atan()) / TAU;
    vec![
        ("ball overhead", overhead, up, overhead_exact),
        ("ball at 75°", low, tilted, low_exact),
        ("disc", disc, Vec3::Y, 10.0 * PI * 0.5),
        ("rectangle", rectangle, Vec3::Y, rectangle_exact),
        ("triangles", triangles, Vec3::Y, rectangle_exact),
    ]
}

#[track_caller]
pub(super) fn assert_near(found: f32, exact: f32, tolerance: f32, what: &str) {
    let error = found / exact - 1.0;
    assert!(error.abs() <= tolerance, "{what}: {found} instead of {exact}, {:+.2} %", 100.0 * error);
}

/// Mean of the first channel.
pub(super) fn mean(picture: &[Vec3]) -> f32 {
    (picture.iter().map(|v| f64::from(v.x)).sum::<f64>() / picture.len() as f64) as f32
}

fn trace(
    stage: &Stage,
    lights: &AreaLights<'_>,
    points: &[Option<ShadingPoint>],
    params: &DirectParams,
) -> (Vec<Vec3>, DirectCost) {
    let mut out = vec![Vec3::NAN; points.len()];
    let cost = trace_direct(&stage.tracer(), lights, points, params, &mut out);
    (out, cost)
}

#[test]
fn every_shape_gives_its_closed_form_by_every_pick_and_sequence() {
    for (what, stage, normal, exact) in closed_forms() {
        let lights = AreaLights::new(&stage.scene, &stage.pose);
        for pick in PICKS {
            for sequence in SEQUENCES {
                let (samples, tolerance) = match sequence {
                    Sequence::Random => (16_384, 0.01),
                    Sequence::Lattice => (2048, 0.004),
                };
                let params = DirectParams { samples, pick, sequence, ..DirectParams::default() };
                let (out, cost) = trace(&stage, &lights, &[Some(point(normal)); 8], &params);
                // White: irradiance / π.
                assert_near(mean(&out) * PI, exact, tolerance, what);
                assert!(cost.rays <= 8 * u64::from(samples) && cost.samples == 8 * u64::from(samples));
                for v in &out {
                    assert_near(v.x * PI, exact, 3.0 * tolerance, what);
                }
            }
        }
    }
}

#[test]
fn a_wall_hides_half_a_light() {
    // Edge on: a wall over the origin's plane x > 0 hides the half of the disc that lies there.
    let mut stage = Stage::default();
    stage.flat(Disc, Vec3::Y, Vec2::ONE, 10.0).wall(quad(
        Vec3::new(0.0, 0.5, -9.0),
        Vec3::new(0.0, 0.5, 9.0),
        Vec3::new(9.0, 0.5, 9.0),
        Vec3::new(9.0, 0.5, -9.0),
    ));
    let lights = AreaLights::new(&stage.scene, &stage.pose);
    for sequence in SEQUENCES {
        let params = DirectParams { samples: 8192, sequence, ..DirectParams::default() };
        let (out, cost) = trace(&stage, &lights, &[Some(point(Vec3::Y)); 8], &params);
        assert_near(mean(&out) * PI, 10.0 * PI * 0.25, 0.01, "half");
        assert_eq!(cost.rays, 8 * 8192);
    }
    // Wholly behind it nothing arrives.
    let dark = ShadingPoint { position_world: Vec3::new(6.0, 0.0, 0.0), ..point(Vec3::Y) };
    assert_eq!(trace(&stage, &lights, &[Some(dark)], &DirectParams::default()).0, [Vec3::ZERO]);
}

#[test]
fn samples_that_bring_nothing_cost_no_ray() {
    let mut stage = Stage::default();
    stage.ball(2.0 * Vec3::Y, 0.5, 10.0);
    let lights = AreaLights::new(&stage.scene, &stage.pose);
    for pick in PICKS {
        let params = DirectParams { pick, ..DirectParams::default() };
        // Below the surface; in front of the smooth normal but behind the face; black.
        let smooth = ShadingPoint { normal_shading_world: Vec3::Y, ..point(-Vec3::Y) };
        let mut black = point(Vec3::Y);
        black.reflectance.diffuse = Vec3::ZERO;
        let (out, cost) =
            trace(&stage, &lights, &[Some(point(-Vec3::Y)), Some(smooth), Some(black), None], &params);
        assert_eq!((out, cost.rays, cost.samples), (vec![Vec3::ZERO; 4], 0, 48));
    }
    let nothing = Stage::default();
    let lit = ShadingPoint { emitted: Vec3::new(1.0, 2.0, 3.0), ..point(Vec3::Y) };
    let none = AreaLights::new(&nothing.scene, &nothing.pose);
    let (out, cost) = trace(&nothing, &none, &[Some(lit)], &DirectParams::default());
    assert_eq!((out, cost.rays), (vec![lit.emitted], 0));
}

#[test]
fn an_environment_arrives_from_where_it_is_open() {
    let mut stage = Stage::default();
    stage.wall(quad(
        Vec3::new(0.0, -1.0, -9e3),
        Vec3::new(0.0, -1.0, 9e3),
        Vec3::new(0.0, 9e3, 9e3),
        Vec3::new(0.0, 9e3, -9e3),
    ));
    let sky = Environment::new(16, 8, vec![Vec3::ONE; 128], Mat3::IDENTITY).unwrap();
    let lights = AreaLights::new(&stage.scene, &stage.pose).with_environment(&sky, &stage.pose);
    // At its foot half of the sky is hidden: π L / 2.
    let foot = ShadingPoint { position_world: Vec3::new(-0.01, 0.0, 0.0), ..point(Vec3::Y) };
    for sequence in SEQUENCES {
        let params = DirectParams { samples: 16_384, sequence, ..DirectParams::default() };
        let (out, _) = trace(&stage, &lights, &[Some(foot); 4], &params);
        assert_near(mean(&out), 0.5, 0.012, "half a sky");
    }
}

/// A room with lights of all shapes and a few bodies.
pub(super) fn room() -> Stage {
    let mut stage = Stage::default();
    let floor = |y: f32, s: f32| {
        quad(Vec3::new(-s, y, s), Vec3::new(s, y, s), Vec3::new(s, y, -s), Vec3::new(-s, y, -s))
    };
    stage
        .wall(floor(0.0, 6.0))
        .wall(quad(
            Vec3::new(-6.0, 0.0, -3.0),
            Vec3::new(6.0, 0.0, -3.0),
            Vec3::new(6.0, 5.0, -3.0),
            Vec3::new(-6.0, 5.0, -3.0),
        ))
        .wall(crate::test_support::sphere(Vec3::new(0.5, 0.6, -0.5), 0.6, 12, 24))
        .wall(crate::test_support::sphere(Vec3::new(-1.6, 0.5, 0.3), 0.5, 12, 24))
        .ball(Vec3::new(-2.0, 2.0, 0.0), 0.2, 60.0)
        .ball(Vec3::new(2.0, 1.2, 0.6), 0.15, 40.0)
        .flat(Disc, Vec3::new(1.0, 3.0, -1.0), Vec2::splat(0.4), 30.0)
        .flat(Rectangle, Vec3::new(0.0, 3.5, 1.0), Vec2::new(1.5, 0.3), 8.0)
        .flat(Triangles, Vec3::new(-1.0, 3.0, -2.0), Vec2::new(0.3, 0.5), 15.0);
    stage
}

pub(super) const EYE: Vec3 = Vec3::new(0.0, 1.6, 4.5);

pub(super) fn room_points(
    stage: &Stage,
    size: [usize; 2],
    reflectance: Reflectance,
) -> Vec<Option<ShadingPoint>> {
    picture(stage, &stage.tracer(), [EYE, Vec3::new(0.0, 0.8, -1.0)], size, reflectance)
}

#[test]
fn picks_and_sequences_differ_in_noise_alone() {
    let stage = room();
    let lights = AreaLights::new(&stage.scene, &stage.pose);
    let glossy = Reflectance { diffuse: Vec3::splat(0.6), f0: Vec3::splat(0.04), alpha: 0.2, specular: true };
    let points = room_points(&stage, [32, 20], glossy);
    assert!(points.iter().any(Option::is_none) && points.iter().flatten().count() > 400);
    let truth = DirectParams { samples: 2048, seed: 9, ..DirectParams::default() };
    let (truth, _) = trace(&stage, &lights, &points, &truth);
    for pick in PICKS {
        for sequence in SEQUENCES {
            let params = DirectParams { samples: 512, pick, sequence, ..DirectParams::default() };
            assert_near(mean(&trace(&stage, &lights, &points, &params).0), mean(&truth), 0.01, "room");
        }
    }
    let error = |samples: u32, pick: Pick, sequence: Sequence| {
        let params = DirectParams { samples, pick, sequence, ..DirectParams::default() };
        let (out, _) = trace(&stage, &lights, &points, &params);
        out.iter().zip(&truth).map(|(a, b)| f64::from(a.distance_squared(*b))).sum::<f64>()
    };
    // What the best sampler is for: a quarter of the squared error at the least.
    assert!(
        4.0 * error(16, Pick::Fluence, Sequence::Lattice) < error(16, Pick::Power, Sequence::Random),
        "{} {}",
        error(16, Pick::Fluence, Sequence::Lattice),
        error(16, Pick::Power, Sequence::Random)
    );
}

#[test]
fn frames_go_on_where_the_last_stopped() {
    let stage = room();
    let lights = AreaLights::new(&stage.scene, &stage.pose);
    let points = room_points(&stage, [16, 10], super::stage::white());
    let at = |samples: u32, frame: u64, sequence: Sequence| {
        let params = DirectParams { samples, frame, sequence, ..DirectParams::default() };
        trace(&stage, &lights, &points, &params).0
    };
    let [first, second] = [0, 1].map(|frame| at(8, frame, Sequence::Lattice));
    for ((a, b), whole) in first.iter().zip(&second).zip(at(16, 0, Sequence::Lattice)) {
        assert!(((*a + *b) * 0.5).abs_diff_eq(whole, 1e-5 * (1.0 + whole.max_element())), "{a} {b} {whole}");
    }
    assert_ne!(at(8, 0, Sequence::Random), at(8, 1, Sequence::Random));
}

#[test]
fn threads_and_neighbours_change_nothing() {
    let stage = room();
    let tracer = stage.tracer();
    let lights = AreaLights::new(&stage.scene, &stage.pose);
    let points = room_points(&stage, [48, 30], super::stage::white());
    let trace_on = |threads: usize, length: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let seen = Mutex::new(Vec::new());
        let mut out = vec![Vec3::NAN; length];
        let cost = pool.install(|| {
            let progress = |n| seen.lock().unwrap().push(n);
            let params = DirectParams { samples: 5, ..DirectParams::default() };
            trace_direct_with_progress(&tracer, &lights, &points[..length], &params, &mut out, &progress)
        });
        assert_eq!(seen.into_inner().unwrap().into_iter().max(), Some(length as u64));
        (out, cost)
    };
    let (one, cost) = trace_on(1, points.len());
    assert_eq!((&one, cost), (&trace_on(3, points.len()).0, trace_on(3, points.len()).1));
    assert_eq!(one[..300], trace_on(2, 300).0);
}

/// Points and lights that strain numbers.
pub(super) fn hostile() -> (Vec<Stage>, Vec<Option<ShadingPoint>>) {
    let mut stages = Vec::new();
    for (radiance, size) in [(1e30, 1.0), (1.0, 0.0), (1.0, 1e-30), (1.0, 1e15), (f32::MIN_POSITIVE, 1.0)] {
        let mut stage = Stage::default();
        for emitter in [Disc, Rectangle, Triangles] {
            stage.flat(emitter, Vec3::Y, Vec2::splat(size), radiance);
        }
        stage.ball(Vec3::new(0.0, 2.0, 1.0), size, radiance);
        stage.ball(Vec3::new(0.0, -2.0, 1.0), size, 0.0);
        stages.push(stage);
    }
    let mut points = vec![None];
    for alpha in [0.0, 2e-3, 1.0] {
        for normal in [Vec3::Y, Vec3::X, Vec3::ZERO, Vec3::NAN] {
            for viewer in [Vec3::Y, Vec3::new(1.0, 1e-7, 0.0).normalize(), -Vec3::Y, Vec3::ZERO] {
                for position in [Vec3::ZERO, Vec3::Y, Vec3::splat(1e12), Vec3::NAN] {
                    let f0 = Vec3::splat(0.9);
                    points.push(Some(ShadingPoint {
                        position_world: position,
                        to_viewer_world: viewer,
                        reflectance: Reflectance { diffuse: Vec3::ONE, f0, alpha, specular: true },
                        ..point(normal)
                    }));
                }
            }
        }
    }
    (stages, points)
}

#[test]
fn no_light_or_surface_gives_anything_but_numbers() {
    let (stages, points) = hostile();
    for stage in stages {
        let lights = AreaLights::new(&stage.scene, &stage.pose);
        for pick in PICKS {
            let params = DirectParams { samples: 64, pick, ..DirectParams::default() };
            let (out, _) = trace(&stage, &lights, &points, &params);
            assert!(out.iter().all(|v| v.is_finite() && v.min_element() >= 0.0), "{pick:?}");
        }
    }
}

#[test]
fn numbers_of_samples_out_of_range_are_brought_into_it() {
    let mut stage = Stage::default();
    stage.ball(2.0 * Vec3::Y, 0.5, 10.0);
    let lights = AreaLights::new(&stage.scene, &stage.pose);
    for (samples, drawn) in [(0, 1), (u32::MAX, MAX_SAMPLES)] {
        let params = DirectParams { samples, ..DirectParams::default() };
        let (_, cost) = trace(&stage, &lights, &[Some(point(Vec3::Y))], &params);
        assert_eq!(cost.samples, u64::from(drawn));
    }
}
