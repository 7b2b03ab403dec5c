//! What a step without a budget publishes is what tracing everything publishes, to the bit.

use proptest::prelude::*;

use super::*;
use crate::psao::update::motion::REST_STEPS;

/// What happens in one step, and for how many steps nothing happens after it.
fn any_script() -> impl Strategy<Value = Vec<(Vec<Move>, u32)>> {
    let rest = prop_oneof![4 => Just(0), 1 => Just(1), 2 => Just(REST_STEPS), 1 => Just(REST_STEPS - 1)];
    prop::collection::vec((prop::collection::vec(any_move(), 0..4), rest), 1..8)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn a_step_equals_tracing_everything(
        seed in 0u32..1000,
        script in any_script(),
        rays in prop_oneof![Just(24u32), Just(64), Just(100)],
        bent_normals: bool,
    ) {
        let (scene, mut pose) = crowd(seed);
        let params = UpdateParams { rays, radius_m: 0.5, bent_normals, ..Default::default() };
        let (mut tracer, mut updater) = start_at(&scene, &pose, params, 40.0);
        let mut everything = updater.clone();
        for (moves, rest) in script {
            for m in moves {
                m.apply(&scene, &mut pose);
            }
            tracer.update(&scene, &pose);
            let selective = updater.step(&scene, &pose, &mut tracer, &FREE);
            let full = everything.step_all(&scene, &pose, &Tracer::new(&scene, &pose));
            prop_assert_eq!(&selective.changes, &full.changes);
            prop_assert!(selective.counts.traced() <= full.counts.traced());
            prop_assert!(selective.counts.rays() <= full.counts.rays());
            prop_assert_eq!((selective.counts.backlog, selective.counts.refined), (0, 0));
            prop_assert_eq!(updater.store(), everything.store());
            for _ in 0..rest {
                tracer.update(&scene, &pose);
                let report = updater.step(&scene, &pose, &mut tracer, &FREE);
                prop_assert_eq!(report, UpdateReport::default());
            }
        }
    }
}

/// The ball rolls from x = 0.5 by 0.1 m a step.
fn roll(pose: &mut Pose, step: u32) {
    let at = Vec3::new(0.5 + 0.1 * step as f32, 0.3, 1.0);
    pose.instances[2].world_from_mesh = Affine3A::from_translation(at);
}

#[test]
fn still_surfaces_are_traced_against_movers_alone_once_they_are_known() {
    let (scene, mut pose) = stage();
    let (mut tracer, mut updater) = start(&scene, &pose, UpdateParams::default());
    let own = updater.store().layout().set_of_instance(2).unwrap().len() as u32;
    let mut reports = Vec::new();
    for step in 0..20 {
        roll(&mut pose, step);
        tracer.update(&scene, &pose);
        reports.push(updater.step(&scene, &pose, &mut tracer, &FREE).counts);
    }
    assert_eq!(tracer.movers(), [false, false, true]);
    assert_eq!(reports[0].traced_movers, 0);
    assert_eq!(reports[0].rays(), u64::from(reports[0].traced()) * 64);
    for counts in &reports[4..] {
        assert!(counts.traced_full < counts.traced() / 3 + own, "{counts:?}");
        assert!(counts.traced_full >= own, "the ball itself: {counts:?}");
        assert!(counts.rays_movers <= u64::from(counts.traced_movers) * 64);
        assert_eq!(counts.selected, counts.traced());
    }
}

#[test]
fn an_instance_that_rests_becomes_still_and_its_neighbours_learn_it() {
    let (scene, mut pose) = stage();
    let (mut tracer, mut updater) = start(&scene, &pose, UpdateParams::default());
    roll(&mut pose, 3);
    tracer.update(&scene, &pose);
    updater.step(&scene, &pose, &mut tracer, &FREE);
    for step in 1..=REST_STEPS {
        assert!(tracer.movers()[2], "after {step}");
        assert_eq!(updater.step(&scene, &pose, &mut tracer, &FREE), UpdateReport::default());
    }
    assert_eq!(tracer.movers(), [false; 3]);
    // The wall jumps away and comes back: what the ball blocks is now part of what is remembered.
    let home = pose.instances[1].world_from_mesh;
    for place in [Affine3A::from_translation(Vec3::new(1.0, 0.2, 1.2)), home] {
        pose.instances[1].world_from_mesh = place;
        tracer.update(&scene, &pose);
        let mut everything = updater.clone();
        let report = updater.step(&scene, &pose, &mut tracer, &FREE);
        let full = everything.step_all(&scene, &pose, &Tracer::new(&scene, &pose));
        assert_eq!(report.changes, full.changes);
    }
    assert_eq!(tracer.movers(), [false, true, false]);
}

#[test]
fn a_still_scene_traces_nothing_and_changes_nothing() {
    let (scene, pose) = stage();
    let (mut tracer, mut updater) = start(&scene, &pose, UpdateParams::default());
    let mut later = pose.clone();
    later.time = 5.0;
    assert_eq!(updater.step(&scene, &later, &mut tracer, &FREE), UpdateReport::default());
    // Even when everything is traced again: patterns are fixed.
    assert!(updater.step_all(&scene, &later, &tracer).changes.is_empty());
}

#[test]
fn only_points_near_the_mover_are_traced() {
    let (scene, mut pose) = stage();
    let (mut tracer, mut updater) = start(&scene, &pose, UpdateParams::default());
    pose.instances[2].world_from_mesh = Affine3A::from_translation(Vec3::new(1.1, 0.3, 1.0));
    tracer.update(&scene, &pose);
    let report = updater.step(&scene, &pose, &mut tracer, &FREE);
    let all = updater.store().layout().len() as u32;
    assert!(report.counts.traced() < all / 2, "{} of {all} traced", report.counts.traced());
    assert!(!report.changes.is_empty());
    assert!(report.changes.windows(2).all(|w| w[0].point < w[1].point));
}

#[test]
fn a_mover_that_does_not_cast_changes_only_itself() {
    let (mut scene, mut pose) = stage();
    scene.instances[2].casts = false;
    let (mut tracer, mut updater) = start(&scene, &pose, UpdateParams::default());
    pose.instances[2].world_from_mesh = Affine3A::from_translation(Vec3::new(1.0, 0.3, 1.0));
    tracer.update(&scene, &pose);
    let own = updater.store().layout().set_of_instance(2).unwrap().clone();
    let report = updater.step(&scene, &pose, &mut tracer, &FREE);
    assert_eq!(report.counts.traced(), own.len() as u32);
    assert!(report.changes.iter().all(|c| c.point >= own.first));
}

#[test]
fn halves_of_a_step_make_a_step_and_a_choice_is_not_lost() {
    let (scene, mut pose) = stage();
    let (mut tracer, mut whole) = start(&scene, &pose, UpdateParams::default());
    let mut halves = whole.clone();
    for step in 0..3 {
        roll(&mut pose, step);
        tracer.update(&scene, &pose);
        let report = whole.step(&scene, &pose, &mut tracer, &FREE);
        halves.select(&scene, &pose, &mut tracer, &FREE);
        if step == 1 {
            // Chosen twice before it is traced.
            halves.select(&scene, &pose, &mut tracer, &FREE);
        }
        assert_eq!(halves.trace_selected(&scene, &pose, &tracer).changes, report.changes);
        assert_eq!(halves.trace_selected(&scene, &pose, &tracer).changes, []);
    }
}

#[test]
fn quantized_visibility_is_exact_at_both_ends_and_rounded_between() {
    let quantize = trace::quantize;
    assert_eq!((quantize(64, 64), quantize(0, 64), quantize(32, 64), quantize(1, 256)), (255, 0, 128, 1));
    assert_eq!((quantize(1024, 1024), quantize(0, 1024)), (255, 0));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn what_a_ray_meets_lies_in_the_cone(seed in any::<u32>(), size in 0.01f32..3.0, far in 0f32..900.0) {
        let mut random = Random(seed);
        let origin = random.vector() * far;
        let min = origin + random.vector();
        let bounds = dapple_scene::Aabb { min, max: min + size * (0.5 + 0.5 * random.vector()) };
        let near = crate::psao::update::motion::Near::new(bounds, 0.6);
        let normal = random.direction();
        let cone = near.cone(origin, normal);
        for _ in 0..50 {
            let mut direction = random.direction();
            if direction.dot(normal) < 0.0 {
                direction = -direction;
            }
            let (a, b) = ((bounds.min - origin) / direction, (bounds.max - origin) / direction);
            let (enter, leave) = (a.min(b).max_element().max(0.0), a.max(b).min_element().min(0.6));
            if enter <= leave {
                let Some(cone) = cone else { panic!("a ray meets what is said to be out of reach") };
                prop_assert!(direction.dot(cone.axis) >= cone.least_cosine);
            }
        }
    }
}
