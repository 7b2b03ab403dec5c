//! Cones that follow lights, against closed forms.

use std::f32::consts::PI;

use dapple_scene::glam::{Affine3A, Vec3};
use dapple_scene::{EmitterShape, PosedInstance};
use dapple_store::cones::GRAZING_COSINE;

use super::tests::{Rig, assert_near, mean, over};
use super::*;
use crate::test_support::{quad, sphere};

#[test]
fn cones_follow_a_light_that_moves() {
    let lamp = (sphere(Vec3::ZERO, 0.3, 12, 16), EmitterShape::Sphere, 10.0, over(2.0));
    let rig = Rig::new(vec![lamp]);
    let params = SlcParams::default();
    let mut cache = rig.settled(20, &params);
    let settled: Vec<u32> = cache.ids().map(|id| cache.entry(id).unwrap().taken()).collect();
    let mut before = rig.pose.clone();
    for step in 1..=30 {
        let mut now = rig.pose.clone();
        let at = Vec3::new(0.1 * step as f32, 2.0, 0.0);
        now.instances[1].world_from_mesh = Affine3A::from_translation(at);
        let counts = rig.step(&mut cache, &before, &now, &params);
        // It is seen whole: half of the entries take samples, those that do not follow it without.
        assert!((counts.updated * 2).abs_diff(counts.changed) <= counts.changed / 8, "{counts:?}");
        let (d2, cos) = (at.length_squared(), 2.0 / at.length());
        assert_near(mean(&cache), 10.0 * PI * 0.09 / d2 * cos, 0.03);
        for id in cache.ids() {
            let sum = cache.entry(id).unwrap().cones().iter().fold(Vec3::ZERO, |sum, cone| sum + cone.moment);
            assert!(sum.normalize().dot(at.normalize()) > 0.99, "step {step}: {sum}");
        }
        before = now;
    }
    // Every other of 30 steps was every entry's turn.
    for (id, settled) in cache.ids().zip(settled) {
        assert_eq!(cache.entry(id).unwrap().taken() - settled, 15 * params.changed_samples);
    }
}

/// Two lamps at once in the one cone that each entry has. Nothing is sampled: all that arrives is what it was, followed.
#[test]
fn a_cone_of_several_lights_follows_them_together() {
    let lamp = (sphere(Vec3::ZERO, 0.3, 12, 16), EmitterShape::Sphere, 10.0, over(2.0));
    let rig = Rig::new(vec![lamp.clone(), lamp]);
    let at = |x: f32| [Vec3::new(x - 1.0, 2.0, 0.2), Vec3::new(2.0 * x + 1.0, 2.0 + x, -0.2)];
    let posed = |x: f32| {
        let mut pose = rig.pose.clone();
        for (i, at) in at(x).into_iter().enumerate() {
            pose.instances[i + 1].world_from_mesh = Affine3A::from_translation(at);
        }
        pose
    };
    let irradiance = |at: Vec3| 10.0 * PI * 0.09 / at.length_squared() * at.y / at.length();
    let moment = MomentParams { cones: 1, ..MomentParams::default() };
    let params = SlcParams { moment, changed_samples: 0, ..SlcParams::default() };
    let follows = |params: &SlcParams, check: &mut dyn FnMut(f32, &ConeCache<MomentEntry>)| {
        let mut before = posed(0.0);
        let mut cache = rig.cache();
        for _ in 0..40 {
            rig.step(&mut cache, &before, &before, params);
        }
        for step in 1..=20 {
            let x = 0.1 * step as f32;
            let now = posed(x);
            rig.step(&mut cache, &before, &now, params);
            check(x, &cache);
            before = now;
        }
        // The second goes out.
        let mut without = before.clone();
        without.instances[2] = PosedInstance::REMOVED;
        rig.step(&mut cache, &before, &without, params);
        mean(&cache)
    };
    let left = follows(&params, &mut |x, cache| {
        let [a, b] = at(x);
        assert_near(mean(cache), irradiance(a) + irradiance(b), 0.05);
        // By fluence, about.
        let (a, b) = (a.normalize() / a.length_squared(), b.normalize() / b.length_squared());
        for id in cache.ids() {
            let entry = cache.entry(id).unwrap();
            let [cone] = entry.cones() else { panic!("one cone") };
            assert!(cone.lights.single().is_none());
            assert!(cone.direction().dot((a + b).normalize()) > 0.97, "at {x}: {cone:?}");
        }
    });
    assert_near(left, irradiance(at(2.0)[0]), 0.05);
    // Without, it keeps what it had.
    let kept = SlcParams { re_aim: false, ..params };
    let had = at(0.0).map(irradiance).iter().sum();
    let left = follows(&kept, &mut |_, cache| assert_near(mean(cache), had, 0.02));
    assert_near(left, had, 0.02);
}

/// A small lamp goes up over a horizon that bumps lean away from: as long as it grazes them, its light counts as it did, and then by its cosine. Nothing is sampled.
/// Under the floor nothing of it is left.
#[test]
fn a_lamp_that_rises_over_leaning_bumps_is_followed() {
    let lamp = (sphere(Vec3::ZERO, 0.02, 12, 16), EmitterShape::Sphere, 1e4, over(2.0));
    let mut rig = Rig::new(vec![lamp]);
    // Leaning towards +X, by 53°, away from the lamp.
    rig.lean([0.8, 0.0]);
    let posed = |degrees: f32| {
        let mut pose = rig.pose.clone();
        let at = Vec3::new(-degrees.to_radians().cos(), degrees.to_radians().sin(), 0.0) * 2.0;
        pose.instances[1].world_from_mesh = Affine3A::from_translation(at);
        pose
    };
    let params = SlcParams { changed_samples: 0, ..SlcParams::default() };
    let mut cache = rig.cache();
    let mut before = posed(20.0);
    for _ in 0..40 {
        rig.step(&mut cache, &before, &before, &params);
    }
    let whole = 1e4 * PI * 1e-4;
    assert_near(mean(&cache), whole * GRAZING_COSINE, 0.02);
    for degrees in [40.0f32, 52.5, 54.0, 55.0, 56.0, 60.0, 75.0, 90.0, 57.0, 30.0] {
        let now = posed(degrees);
        rig.step(&mut cache, &before, &now, &params);
        // The horizon of what leans is at 53.13°.
        let cosine = (degrees - 53.1301).to_radians().sin().max(GRAZING_COSINE);
        assert_near(mean(&cache), whole * cosine, 0.05);
        before = now;
    }
    rig.step(&mut cache, &before, &posed(-20.0), &params);
    assert_eq!(mean(&cache), 0.0);
}

/// What moves before lights that stay may hide them, but turns no cone: not by a bit.
#[test]
fn cones_of_lights_that_stay_are_left_alone() {
    let lamp = |x: f32| {
        let at = Affine3A::from_translation(Vec3::new(x, 2.0, 0.0));
        (sphere(Vec3::ZERO, 0.3, 12, 16), EmitterShape::Sphere, 10.0, at)
    };
    let at = |x: f32, z: f32| Vec3::new(x, 0.0, z);
    let shutter = quad(at(-0.5, 0.5), at(0.5, 0.5), at(0.5, -0.5), at(-0.5, -0.5));
    let rig = Rig::new(vec![lamp(-1.0), lamp(1.0), (shutter, EmitterShape::Triangles, 0.0, over(1.0))]);
    for cones in [1, 3] {
        let moment = MomentParams { cones, ..MomentParams::default() };
        let params = SlcParams { moment, changed_samples: 0, ..SlcParams::default() };
        let mut cache = rig.settled(20, &params);
        let cones_of = |cache: &ConeCache<MomentEntry>| {
            cache.ids().map(|id| cache.entry(id).unwrap().cones().to_vec()).collect::<Vec<_>>()
        };
        let had = cones_of(&cache);
        assert!(had.iter().flatten().any(|cone| cone.lights.single().is_none() == (cones == 1)));
        let mut moved = rig.pose.clone();
        moved.instances[3].world_from_mesh = over(1.1);
        let counts = rig.step(&mut cache, &rig.pose, &moved, &params);
        assert!(counts.changed > 100, "{counts:?}");
        assert_eq!(cones_of(&cache), had);
    }
}
