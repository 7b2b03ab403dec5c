//! A budget delays work and orders it; it loses nothing, starves nobody and depends on nothing but its input.

use dapple_scene::PosedCamera;
use dapple_scene::glam::Vec4;
use proptest::prelude::*;

use super::*;
use crate::psao::update::select::MOST_HEAD_START;

/// Where x is at least `x`, and where it is less.
fn halves(x: f32) -> [ConvexVolume; 2] {
    [1.0, -1.0]
        .map(|sign| ConvexVolume { planes: vec![Vec4::new(sign, 0.0, 0.0, -sign * x)], eye_world: None })
}

fn budget(rays: u64) -> StepInput<'static> {
    StepInput { ray_budget: Some(rays), ..FREE }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    #[test]
    fn what_is_left_undone_is_done_once_motion_stops(
        seed in 0u32..1000,
        script in prop::collection::vec(prop::collection::vec(any_move(), 0..4), 1..8),
        rays in 64u64..20_000,
        rays_still in prop_oneof![2 => Just(0), 1 => Just(200)],
        x in 1f32..3.0,
    ) {
        let (scene, mut pose) = crowd(seed);
        let params = UpdateParams { rays: 40, rays_still, radius_m: 0.5, bent_normals: true };
        let (mut tracer, mut updater) = start_at(&scene, &pose, params, 40.0);
        let interest = halves(x);
        let input = StepInput { ray_budget: Some(rays), interest: &interest[..1] };
        let mut step = |pose: &Pose| {
            tracer.update(&scene, pose);
            let report = updater.step(&scene, pose, &mut tracer, &input);
            prop_assert!(report.counts.rays() <= rays, "{:?}", report.counts);
            prop_assert!(report.changes.windows(2).all(|w| w[0].point < w[1].point));
            Ok(report)
        };
        for moves in script {
            for m in moves {
                m.apply(&scene, &mut pose);
            }
            step(&pose)?;
        }
        let all = 40 * 500;
        let most = MOST_HEAD_START + 200 + 12 * (all / rays as u32);
        let mut quiet = 0;
        for _ in 0..most {
            quiet = if step(&pose)? == UpdateReport::default() { quiet + 1 } else { 0 };
        }
        prop_assert!(quiet > 0, "still at work");
        let mut everything = updater.clone();
        let missed = everything.step_all(&scene, &pose, &Tracer::new(&scene, &pose));
        prop_assert_eq!(missed.changes, []);
    }
}

#[test]
fn nothing_waits_for_ever() {
    // The ball swings through the seen half all the time, and there is far too little for that alone.
    let (scene, mut pose) = stage();
    let (mut tracer, mut updater) = start_at(&scene, &pose, UpdateParams::default(), 60.0);
    let interest = halves(2.0);
    // The wall jumps once, in the half that nobody sees.
    let wall = Vec3::new(0.5, 0.0, 2.5);
    pose.instances[1].world_from_mesh.translation = wall.into();
    let input = StepInput { ray_budget: Some(3000), interest: &interest[..1] };
    let rays_of_all = updater.store().layout().len() as u64 * 64;
    // What has waited longest comes first but for a head start; each cluster can come in between once a step until then.
    let most = MOST_HEAD_START + (2 * rays_of_all / 3000) as u32;
    let mut oldest = 0;
    for step in 0..3 * most {
        let angle = f64::from(step) * 0.3;
        let at = Vec3::new(3.0 + 0.6 * libm::cos(angle) as f32, 0.3, 2.0 + 0.6 * libm::sin(angle) as f32);
        pose.instances[2].world_from_mesh = Affine3A::from_translation(at);
        tracer.update(&scene, &pose);
        let report = updater.step(&scene, &pose, &mut tracer, &input);
        assert!(report.counts.backlog > 0 && report.counts.rays() > 0);
        oldest = oldest.max(report.counts.oldest_steps);
    }
    assert!(oldest > 10, "{oldest}");
    assert!(oldest <= most, "{oldest} steps, at most {most}");
    // Far from the ball everything has come up to date with the wall.
    let mut everything = updater.clone();
    let missed = everything.step_all(&scene, &pose, &tracer);
    let positions = updater.positions_world(&scene, &pose);
    for change in &missed.changes {
        let x = positions[change.point as usize].unwrap().x;
        assert!(x > 1.5, "point {} at x = {x} was forgotten", change.point);
    }
}

#[test]
fn what_is_seen_comes_first() {
    let (scene, mut pose) = stage();
    let params = UpdateParams::default();
    let (mut tracer, mut updater) = start_at(&scene, &pose, params, 1000.0);
    pose.instances[2].world_from_mesh = Affine3A::from_translation(Vec3::new(1.0, 0.3, 2.0));
    tracer.update(&scene, &pose);
    updater.step(&scene, &pose, &mut tracer, &FREE);
    pose.instances[2].world_from_mesh = Affine3A::from_translation(Vec3::new(1.05, 0.3, 2.0));
    tracer.update(&scene, &pose);
    let need = updater.clone().step(&scene, &pose, &mut tracer, &FREE).counts;
    for (seen, unseen) in [(0, 1), (1, 0)] {
        let mut updater = updater.clone();
        let interest = &halves(1.0)[seen..=seen];
        let input = StepInput { ray_budget: Some(need.rays() / 8), interest };
        updater.select(&scene, &pose, &mut tracer, &input);
        let chosen_unseen = |updater: &Updater, of: fn(&Cluster) -> u64| {
            let outside =
                updater.clusters.iter().filter(|c| !c.moving && !interest[0].touches(c.bounds_world()));
            outside.map(|c| of(c).count_ones()).sum::<u32>()
        };
        assert_eq!(chosen_unseen(&updater, |c| c.selected), 0, "half {unseen}");
        assert!(chosen_unseen(&updater, |c| c.dirty) > 0, "half {unseen}");
        let report = updater.trace_selected(&scene, &pose, &tracer);
        assert_eq!(report.counts.traced() + report.counts.backlog, need.selected);
        assert!(report.counts.rays() > 0 && report.counts.rays() <= need.rays() / 8);
    }
}

#[test]
fn a_small_budget_traces_a_point_and_none_traces_nothing() {
    let (scene, mut pose) = stage();
    let (mut tracer, mut updater) = start(&scene, &pose, UpdateParams::default());
    pose.instances[2].world_from_mesh = Affine3A::from_translation(Vec3::new(1.0, 0.3, 1.0));
    tracer.update(&scene, &pose);
    let nothing = updater.step(&scene, &pose, &mut tracer, &budget(0)).counts;
    assert_eq!((nothing.traced(), nothing.rays(), nothing.backlog), (0, 0, nothing.selected));
    let one = updater.step(&scene, &pose, &mut tracer, &budget(1)).counts;
    assert_eq!((one.traced(), one.backlog, one.oldest_steps), (1, nothing.backlog - 1, 1));
}

#[test]
fn the_same_on_any_number_of_threads() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let (scene, mut pose) = crowd(3);
            let params = UpdateParams { rays_still: 256, ..Default::default() };
            let (mut tracer, mut updater) = start_at(&scene, &pose, params, 100.0);
            let interest = halves(1.7);
            let mut reports = Vec::new();
            for step in 0..12 {
                let x = 1.5 + 0.1 * step as f32;
                pose.instances[2].world_from_mesh = Affine3A::from_translation(Vec3::new(x, 0.3, 1.2));
                tracer.update(&scene, &pose);
                let ray_budget = if step == 7 { None } else { Some(9_000 + 3_000 * step) };
                let input = StepInput { ray_budget, interest: &interest[..1] };
                reports.push(updater.step(&scene, &pose, &mut tracer, &input));
            }
            (reports, updater.store().clone())
        })
    };
    assert_eq!(run(1), run(3));
}

proptest! {
    #[test]
    fn a_frustum_holds_what_the_camera_sees(
        eye in prop::array::uniform3(-5f32..5.0),
        target in prop::array::uniform3(-5f32..5.0),
        place in prop::array::uniform3(-5f32..5.0),
        yfov in 0.2f32..2.5,
        aspect in 0.4f32..3.0,
    ) {
        let (eye, target, place) = (Vec3::from(eye), Vec3::from(target), Vec3::from(place));
        prop_assume!(eye.distance(target) > 0.1);
        let camera = PosedCamera::look_at(eye, target, yfov);
        let view = camera.view_from_world().transform_point3(place);
        let clip = camera.clip_from_view(aspect) * view.extend(1.0);
        // How far inside the nearest side; positive if it is seen.
        let inside = (clip.w - clip.x.abs()).min(clip.w - clip.y.abs()).min(-view.z - 0.02).min(4.0 + view.z);
        prop_assume!(inside.abs() > 1e-3);
        let at = |margin_m| {
            ConvexVolume::frustum(&camera, aspect, 4.0, margin_m).touches(&dapple_scene::Aabb { min: place, max: place })
        };
        prop_assert_eq!(at(0.0), inside > 0.0);
        prop_assert!(at(0.0) <= at(0.5));
        // A box around the point is seen if the point is.
        let around = dapple_scene::Aabb { min: place - 0.3, max: place + 0.1 };
        prop_assert!(at(0.0) <= ConvexVolume::frustum(&camera, aspect, 4.0, 0.0).touches(&around));
        prop_assert!(ConvexVolume::frustum(&camera, aspect, f32::INFINITY, 0.0).planes.len() == 5);
        prop_assert!(ConvexVolume::default().touches(&around));
    }
}

#[test]
fn errors_may_be_larger_far_away_and_larger_still_out_of_view() {
    let (scene, pose) = stage();
    let (_, updater) = start_at(&scene, &pose, UpdateParams::default(), 400.0);
    let stretch = 16;
    assert!(updater.coarseness(&[], stretch).is_empty(), "without interest everything counts alike");
    let positions = updater.positions_world(&scene, &pose);
    let eye = Vec3::new(0.2, 1.5, 2.0);
    let seen = ConvexVolume { eye_world: Some(eye), ..halves(2.0)[0].clone() };
    let coarseness = updater.coarseness(std::slice::from_ref(&seen), stretch);
    assert_eq!(coarseness.len(), positions.len().div_ceil(stretch));
    let (mut in_view, mut out_of_view, mut far) = (0, 0, 0);
    for (points, coarse) in positions.chunks(stretch).zip(&coarseness) {
        // About as for its nearest point, but for the few clusters that reach far; eight times as much where none is seen.
        let places = || points.iter().flatten();
        let nearest = places().map(|p| p.distance(eye)).fold(f32::INFINITY, f32::min);
        if places().any(|p| seen.contains(*p)) {
            in_view += 1;
            far += u32::from(*coarse > nearest.max(1.0));
        } else {
            out_of_view += u32::from(*coarse > 4.0 * nearest);
            far += u32::from(*coarse > 8.0 * nearest.max(1.0));
        }
        assert!(*coarse > 0.0);
    }
    assert!(in_view > 20 && out_of_view > 20, "{in_view} {out_of_view}");
    assert!(10 * far < coarseness.len() as u32, "{far} of {}", coarseness.len());
    // Who looks from elsewhere lowers it, and raises it nowhere.
    let other = ConvexVolume { eye_world: Some(Vec3::new(4.0, 0.5, 2.0)), ..halves(2.0)[1].clone() };
    let both = updater.coarseness(&[seen, other], stretch);
    assert!(both.iter().zip(&coarseness).all(|(both, one)| both <= one));
    assert!(both.iter().zip(&coarseness).any(|(both, one)| both < one));
    // From no place, as with parallel rays, everything is as near.
    let flat = updater.coarseness(&halves(2.0)[..1], stretch);
    assert!(flat.iter().all(|c| *c == 1.0 || *c == 8.0));
}
