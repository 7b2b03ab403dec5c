//! Resampling within a pixel.

use std::f32::consts::PI;

use dapple_scene::area_lights::{AreaLights, Pick};
use dapple_scene::glam::Vec3;
use dapple_scene::{Reflectance, ShadingPoint};

use super::stage::{point, white};
use super::traced::{PICKS, assert_near, closed_forms, hostile, mean, room, room_points};
use crate::bvh::Tracer;
use crate::direct::{DirectCost, DirectParams, MAX_SAMPLES, RisParams, Sequence, trace_direct, trace_ris};

fn trace(
    tracer: &Tracer,
    lights: &AreaLights<'_>,
    points: &[Option<ShadingPoint>],
    params: &RisParams,
) -> (Vec<Vec3>, DirectCost) {
    let mut out = vec![Vec3::NAN; points.len()];
    let cost = trace_ris(tracer, lights, points, params, &mut out);
    (out, cost)
}

#[test]
fn closed_forms_in_the_mean() {
    for (what, stage, normal, exact) in closed_forms() {
        let (lights, tracer) = (AreaLights::new(&stage.scene, &stage.pose), stage.tracer());
        for (pick, sequence, candidates) in [
            (Pick::Fluence, Sequence::Lattice, 32),
            (Pick::Power, Sequence::Random, 32),
            (Pick::Uniform, Sequence::Random, 8),
        ] {
            let params = RisParams { candidates, pick, sequence, ..RisParams::default() };
            let (out, cost) = trace(&tracer, &lights, &[Some(point(normal)); 4096], &params);
            assert_near(mean(&out) * PI, exact, 0.01, what);
            assert_eq!(cost.samples, 4096 * u64::from(candidates));
            assert!(cost.rays <= 4096);
        }
    }
}

#[test]
fn the_mean_of_many_frames_is_the_truth() {
    let stage = room();
    let (lights, tracer) = (AreaLights::new(&stage.scene, &stage.pose), stage.tracer());
    let glossy = Reflectance { diffuse: Vec3::splat(0.6), f0: Vec3::splat(0.04), alpha: 0.2, specular: true };
    let points = room_points(&stage, [32, 20], glossy);
    let mut truth = vec![Vec3::ZERO; points.len()];
    trace_direct(
        &tracer,
        &lights,
        &points,
        &DirectParams { samples: 2048, ..Default::default() },
        &mut truth,
    );
    for (pick, sequence) in [(Pick::Power, Sequence::Random), (Pick::Fluence, Sequence::Lattice)] {
        let mut sum = 0.0;
        for frame in 0..64 {
            let params = RisParams { candidates: 8, pick, sequence, frame, ..RisParams::default() };
            sum += mean(&trace(&tracer, &lights, &points, &params).0);
        }
        assert_near(sum / 64.0, mean(&truth), 0.01, "room");
    }
}

/// With many candidates what is left is the noise of visibility: where all is visible, none.
#[test]
fn more_candidates_are_less_noise() {
    let (_, stage, normal, exact) = closed_forms().swap_remove(3);
    let (lights, tracer) = (AreaLights::new(&stage.scene, &stage.pose), stage.tracer());
    let error = |candidates: u32| {
        let params = RisParams { candidates, sequence: Sequence::Random, ..RisParams::default() };
        let (out, _) = trace(&tracer, &lights, &[Some(point(normal)); 512], &params);
        out.iter().map(|v| (v.x * PI / exact - 1.0).powi(2)).sum::<f32>() / 512.0
    };
    let [few, many] = [error(4), error(64)];
    assert!(12.0 * many < few && few < 20.0 * many, "{few} {many}");
}

#[test]
fn hostile_lights_and_surfaces_give_numbers() {
    let (stages, points) = hostile();
    for stage in stages {
        let lights = AreaLights::new(&stage.scene, &stage.pose);
        for pick in PICKS {
            let params = RisParams { pick, ..RisParams::default() };
            let (out, _) = trace(&stage.tracer(), &lights, &points, &params);
            assert!(out.iter().all(|v| v.is_finite() && v.min_element() >= 0.0), "{pick:?}");
        }
    }
}

#[test]
fn threads_change_nothing_and_counts_are_brought_into_range() {
    let stage = room();
    let (lights, tracer) = (AreaLights::new(&stage.scene, &stage.pose), stage.tracer());
    let points = room_points(&stage, [48, 30], white());
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| trace(&tracer, &lights, &points, &RisParams::default()))
    };
    assert_eq!(on(1), on(3));
    for (candidates, drawn) in [(0, 1), (u32::MAX, MAX_SAMPLES)] {
        let params = RisParams { candidates, ..RisParams::default() };
        assert_eq!(
            trace(&tracer, &lights, &points[..1], &params).1.samples,
            match points[0] {
                Some(_) => u64::from(drawn),
                None => 0,
            }
        );
        assert_eq!(trace(&tracer, &lights, &[Some(point(Vec3::Y))], &params).1.samples, u64::from(drawn));
    }
}
