//! Selective tracing must give what full tracing gives.

use dapple_scene::glam::{Affine3A, Quat, Vec3};
use proptest::prelude::*;

use super::*;
use crate::psao::generate::{GenerateParams, generate_points};
use crate::test_support::{cube, deform, quad, scene, sphere};

fn start(scene: &Scene, pose: &Pose, params: UpdateParams) -> (Tracer, Updater) {
    let tracer = Tracer::new(scene, pose);
    let generate = GenerateParams { points_per_m2: 200.0, ..Default::default() };
    let points = generate_points(scene, pose, &tracer, &generate, &|_| ()).unwrap();
    let updater = Updater::new(scene, pose, &tracer, points, params, &|_| ()).unwrap();
    (tracer, updater)
}

/// A floor, a wall and a ball that can be put anywhere.
fn stage() -> (Scene, Pose) {
    let floor =
        quad(Vec3::ZERO, Vec3::new(0.0, 0.0, 4.0), Vec3::new(4.0, 0.0, 4.0), Vec3::new(4.0, 0.0, 0.0));
    let wall = Affine3A::from_scale_rotation_translation(
        Vec3::new(1.0, 1.5, 0.2),
        Quat::from_rotation_y(0.3),
        Vec3::new(2.0, 0.0, 2.0),
    );
    let ball = sphere(Vec3::ZERO, 0.25, 8, 16);
    scene(
        vec![floor, cube(), ball],
        &[(0, Affine3A::IDENTITY), (1, wall), (2, Affine3A::from_translation(Vec3::ONE))],
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]
    #[test]
    fn a_step_equals_tracing_everything(
        places in prop::collection::vec((prop::array::uniform3(0f32..4.0), 0f32..6.0, any::<bool>()), 1..5),
        threshold in 0u8..6,
    ) {
        let (scene, mut pose) = stage();
        let params = UpdateParams { rays: 32, radius_m: 0.5, threshold };
        let (mut tracer, mut updater) = start(&scene, &pose, params);
        let mut everything = updater.clone();
        for (place, angle, bend) in places {
            let map = Affine3A::from_rotation_translation(Quat::from_rotation_x(angle), Vec3::from(place));
            pose.instances[2].world_from_mesh = map;
            if bend {
                let positions = scene.meshes[2].positions.iter().map(|p| *p * Vec3::new(1.3, 0.7, 1.0)).collect();
                deform(&mut pose, 2, positions);
            }
            tracer.update(&scene, &pose);
            let selective = updater.step(&scene, &pose, &tracer);
            let full = everything.step_all(&scene, &pose, &tracer);
            prop_assert_eq!(&selective.changes, &full.changes);
            prop_assert!(selective.traced <= full.traced);
            prop_assert_eq!(updater.store(), everything.store());
        }
    }
}

#[test]
fn a_still_scene_traces_nothing_and_changes_nothing() {
    let (scene, pose) = stage();
    let (tracer, mut updater) = start(&scene, &pose, UpdateParams::default());
    let mut later = pose.clone();
    later.time = 5.0;
    assert_eq!(updater.step(&scene, &later, &tracer), UpdateReport::default());
    // Even when everything is traced again: patterns are fixed.
    assert!(updater.step_all(&scene, &later, &tracer).changes.is_empty());
}

#[test]
fn only_points_near_the_mover_are_traced() {
    let (scene, mut pose) = stage();
    let (mut tracer, mut updater) = start(&scene, &pose, UpdateParams::default());
    pose.instances[2].world_from_mesh = Affine3A::from_translation(Vec3::new(1.1, 0.3, 1.0));
    tracer.update(&scene, &pose);
    let report = updater.step(&scene, &pose, &tracer);
    let all = updater.store().layout().len() as u32;
    assert!(report.traced < all / 2, "{} of {all} traced", report.traced);
    assert_eq!(report.rays, u64::from(report.traced) * 64);
    assert!(!report.changes.is_empty());
    assert!(report.changes.windows(2).all(|w| w[0].point < w[1].point));
}

#[test]
fn a_mover_that_does_not_cast_changes_only_itself() {
    let (mut scene, mut pose) = stage();
    scene.instances[2].casts = false;
    let (mut tracer, mut updater) = start(&scene, &pose, UpdateParams { threshold: 0, ..Default::default() });
    pose.instances[2].world_from_mesh = Affine3A::from_translation(Vec3::new(1.0, 0.3, 1.0));
    tracer.update(&scene, &pose);
    let own = updater.store().layout().set_of_instance(2).unwrap().clone();
    let report = updater.step(&scene, &pose, &tracer);
    assert_eq!(report.traced, own.len() as u32);
    assert!(report.changes.iter().all(|c| c.point >= own.first));
}

#[test]
fn the_same_on_any_number_of_threads() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let (scene, mut pose) = stage();
            let (mut tracer, mut updater) = start(&scene, &pose, UpdateParams::default());
            pose.instances[2].world_from_mesh = Affine3A::from_translation(Vec3::new(1.5, 0.3, 1.2));
            tracer.update(&scene, &pose);
            let report = updater.step(&scene, &pose, &tracer);
            (report, updater.store().clone())
        })
    };
    assert_eq!(run(1), run(2));
}

#[test]
fn quantized_visibility_is_exact_at_both_ends_and_rounded_between() {
    assert_eq!((quantize(64, 64), quantize(0, 64), quantize(32, 64), quantize(1, 256)), (255, 0, 128, 1));
}

#[test]
fn settings_out_of_range_are_refused() {
    let (scene, pose) = stage();
    let tracer = Tracer::new(&scene, &pose);
    let points = generate_points(&scene, &pose, &tracer, &GenerateParams::default(), &|_| ()).unwrap();
    let with = |params| Updater::new(&scene, &pose, &tracer, points.clone(), params, &|_| ()).unwrap_err();
    assert_eq!(with(UpdateParams { rays: 0, ..Default::default() }), UpdateError::BadRays(0));
    assert_eq!(with(UpdateParams { rays: 257, ..Default::default() }), UpdateError::BadRays(257));
    assert_eq!(with(UpdateParams { radius_m: 0.0, ..Default::default() }), UpdateError::BadRadius(0.0));
}
