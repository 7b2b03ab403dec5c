//! Points at rest get more rays, settle, and keep what they have when movers come and go.

use super::*;
use crate::psao::update::trace::estimate;

fn refined() -> UpdateParams {
    UpdateParams { rays: 64, rays_still: 256, radius_m: 0.5, ..Default::default() }
}

fn put(scene: &Scene, pose: &mut Pose, tracer: &mut Tracer, place: Vec3) {
    pose.instances[2].world_from_mesh = Affine3A::from_translation(place);
    tracer.update(scene, pose);
}

#[test]
fn a_still_scene_settles_and_then_sends_nothing() {
    let (scene, pose) = stage();
    for budget in [None, Some(20_000), Some(4_321), Some(130)] {
        let (mut tracer, mut updater) = start_at(&scene, &pose, refined(), 40.0);
        let mut reported = vec![0; updater.store().layout().len()];
        let input = StepInput { ray_budget: budget, ..FREE };
        let work = reported.len() as u64 * 256;
        // A budget below a stage of one point leaves something over each step.
        let steps = budget.map_or(2, |rays| work / rays.saturating_sub(128).clamp(64, work) + 3);
        for _ in 0..steps {
            let report = updater.step(&scene, &pose, &mut tracer, &input);
            assert!(budget.is_none_or(|rays| report.counts.rays() <= rays));
            assert_eq!(report.counts.rays(), report.counts.rays_refined);
            report.changes.iter().for_each(|c| reported[c.point as usize] += 1);
        }
        for _ in 0..200 {
            assert_eq!(updater.step(&scene, &pose, &mut tracer, &input), UpdateReport::default());
        }
        // 64 to 128 to 256.
        assert!(reported.iter().all(|times| *times <= 2));
        assert!(reported.contains(&1));
        let missed = updater.step_all(&scene, &pose, &tracer).changes;
        assert!(missed.is_empty(), "{} points are not at rest", missed.len());
    }
}

#[test]
fn more_rays_are_nearer_the_truth() {
    let (scene, pose) = stage();
    let values = |rays_still, steps| {
        let params = UpdateParams { rays_still, ..refined() };
        let (mut tracer, mut updater) = start_at(&scene, &pose, params, 40.0);
        for _ in 0..steps {
            updater.step(&scene, &pose, &mut tracer, &FREE);
        }
        updater.store().visibility().to_vec()
    };
    // Half the points see nothing, and are exact with one ray: the sum counts.
    let truth = values(1024, 4);
    let error = |values: Vec<u8>| -> u32 {
        values.iter().zip(&truth).map(|(a, b)| u32::from(a.abs_diff(*b)).pow(2)).sum()
    };
    let (few, more) = (error(values(0, 2)), error(values(256, 2)));
    assert!(more * 3 < few, "squared errors {few} and {more}");
}

#[test]
fn a_mover_that_came_and_left_leaves_no_trace() {
    let (scene, mut pose) = stage();
    let (mut tracer, mut updater) = start(&scene, &pose, refined());
    let floor = updater.store().layout().set_of_instance(0).unwrap().len();
    let away = Vec3::new(1.0, 9.0, 1.0);
    put(&scene, &mut pose, &mut tracer, away);
    for _ in 0..3 {
        updater.step(&scene, &pose, &mut tracer, &FREE);
    }
    let settled = updater.store().visibility()[..floor].to_vec();
    // As if the ball had never been there, and with 64 rays with and without it: what it truly reaches.
    let template = updater.clone();
    let few = |tracer: &Tracer, pose: &Pose| {
        let mut updater = template.clone();
        updater.params.rays_still = 0;
        updater.step_all(&scene, pose, tracer);
        updater.store().visibility()[..floor].to_vec()
    };
    let few_before = few(&tracer, &pose);
    let (mut reached, mut darker) = (0, 0);
    for x in [1.0, 1.1, 1.2, 1.3] {
        put(&scene, &mut pose, &mut tracer, Vec3::new(x, 0.26, 1.0));
        let report = updater.step(&scene, &pose, &mut tracer, &FREE);
        assert!(report.counts.traced_movers > 0);
        assert_eq!(report.counts.refined, 0, "the ball's own points do not rest");
        let few_now = few(&tracer, &pose);
        for (i, &now) in updater.store().visibility()[..floor].iter().enumerate() {
            let before = f32::from(settled[i]);
            if few_now[i] == few_before[i] {
                assert_eq!(now, settled[i], "point {i}: the ball blocks none of its rays");
            } else {
                reached += 1;
                darker += u32::from(now < settled[i]);
                let share = f32::from(few_now[i]) / f32::from(few_before[i]);
                assert!((f32::from(now) - before * share).abs() < 4.0, "point {i}: {now} of {before}");
            }
        }
    }
    assert!(reached > 50 && darker == reached, "{darker} of {reached}");
    put(&scene, &mut pose, &mut tracer, away);
    updater.step(&scene, &pose, &mut tracer, &FREE);
    assert_eq!(updater.store().visibility()[..floor], settled);
    // Nor does it later: nothing has to be learnt anew.
    let floor_changes =
        |report: UpdateReport| report.changes.iter().filter(|c| c.point < floor as u32).count();
    for _ in 0..100 {
        assert_eq!(floor_changes(updater.step(&scene, &pose, &mut tracer, &FREE)), 0);
    }
}

#[test]
fn where_a_mover_comes_to_rest_points_settle_again() {
    let (scene, mut pose) = stage();
    let (mut tracer, mut updater) = start(&scene, &pose, refined());
    for place in [Vec3::new(1.0, 0.26, 1.0), Vec3::new(2.5, 0.3, 2.0)] {
        put(&scene, &mut pose, &mut tracer, place);
        let mut last = 0;
        for step in 0..100 {
            if updater.step(&scene, &pose, &mut tracer, &FREE) != UpdateReport::default() {
                last = step;
            }
        }
        assert!(last < 70, "at work in step {last}");
        assert_eq!(updater.clone().step_all(&scene, &pose, &tracer).changes, []);
    }
}

#[test]
fn points_on_what_casts_nothing_settle_again_too() {
    let (mut scene, mut pose) = stage();
    scene.instances[2].casts = false;
    let (mut tracer, mut updater) = start(&scene, &pose, refined());
    put(&scene, &mut pose, &mut tracer, Vec3::new(1.0, 0.26, 1.0));
    for _ in 0..100 {
        updater.step(&scene, &pose, &mut tracer, &FREE);
    }
    assert_eq!(updater.clone().step_all(&scene, &pose, &tracer).changes, []);
    assert_eq!(updater.step(&scene, &pose, &mut tracer, &FREE), UpdateReport::default());
}

#[test]
fn a_budget_below_one_refinement_still_refines() {
    let (scene, pose) = stage();
    let (mut tracer, mut updater) = start(&scene, &pose, refined());
    let input = StepInput { ray_budget: Some(1), ..FREE };
    for step in 0..50 {
        let report = updater.step(&scene, &pose, &mut tracer, &input);
        assert_eq!(report.counts.refined, 1, "step {step}");
    }
}

#[test]
fn refinement_goes_on_after_a_backlog_longer_than_rest() {
    let (scene, mut pose) = stage();
    let (mut tracer, mut updater) = start(&scene, &pose, refined());
    put(&scene, &mut pose, &mut tracer, Vec3::new(1.0, 0.26, 1.0));
    let mut most = 0;
    for _ in 0..400 {
        let input = StepInput { ray_budget: Some(64), ..FREE };
        let report = updater.step(&scene, &pose, &mut tracer, &input);
        most = most.max(report.counts.oldest_steps);
    }
    assert!(most > 60, "the backlog lasted {most} steps only");
    for _ in 0..100 {
        updater.step(&scene, &pose, &mut tracer, &FREE);
    }
    assert_eq!(updater.clone().step_all(&scene, &pose, &tracer).changes, []);
}

#[test]
fn the_estimate_is_exact_where_it_can_be() {
    for open in 0..=64 {
        for left in 0..=open {
            // With the same rays for both it is plain counting, and with no mover what is still alone.
            if open > 0 {
                assert_eq!(estimate(open, 64, left, open), trace::quantize(left, 64));
            }
            assert_eq!(estimate(700, 1024, open, open), trace::quantize(700, 1024));
        }
    }
    // Nothing is known of movers where the first rays are all blocked: they count as absent.
    assert_eq!(estimate(3, 1024, 0, 0), trace::quantize(3, 1024));
    assert_eq!(estimate(1024, 1024, 64, 64), 255);
    assert_eq!(estimate(1024, 1024, 0, 64), 0);
}
