//! What is taken away and put back.

use dapple_scene::{Aabb, PosedInstance};
use proptest::prelude::*;

use super::*;
use crate::psao::update::motion::REST_STEPS;

#[test]
fn under_what_is_gone_all_is_open_and_what_is_back_blocks_as_before() {
    let (scene, mut pose) = stage();
    pose.instances[2].world_from_mesh = Affine3A::from_translation(Vec3::new(1.0, 0.3, 1.0));
    let (mut tracer, mut updater) = start(&scene, &pose, UpdateParams::default());
    let first = updater.store().clone();
    let ball = first.layout().set_of_instance(2).unwrap();
    let ball = ball.first as usize..ball.first as usize + ball.len();
    let home = pose.clone();
    // Gone alone, then both things that stand on the floor: nothing is left to block.
    for gone in [&[2][..], &[1, 2]] {
        for &instance in gone {
            pose.instances[instance] = PosedInstance::REMOVED;
        }
        tracer.update(&scene, &pose);
        assert!(updater.step(&scene, &pose, &mut tracer, &FREE).counts.traced() > 0);
        assert_eq!(updater.bounds_world()[2], Aabb::EMPTY);
        // A place that is nowhere is open.
        assert!(updater.store().visibility()[ball.clone()].iter().all(|v| *v == 255));
        let positions = updater.positions_world(&scene, &pose);
        assert!(positions[ball.clone()].iter().all(Option::is_none));
    }
    let floor = first.layout().set_of_instance(0).unwrap();
    let floor = floor.first as usize..floor.first as usize + floor.len();
    assert!(first.visibility()[floor.clone()].iter().any(|v| *v < 200));
    assert!(updater.store().visibility()[floor].iter().all(|v| *v == 255));
    for _ in 0..=REST_STEPS {
        tracer.update(&scene, &pose);
        assert!(updater.step(&scene, &pose, &mut tracer, &FREE).changes.is_empty());
    }
    tracer.update(&scene, &home);
    updater.step(&scene, &home, &mut tracer, &FREE);
    assert_eq!(updater.store(), &first);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    #[test]
    fn a_step_equals_tracing_everything_whatever_is_gone(
        seed in 0u32..1000,
        script in prop::collection::vec(
            (prop::collection::vec(any_move(), 0..3), prop::collection::vec(1usize..8, 0..3), 0u32..2), 1..8),
        rays_still in prop_oneof![Just(0u32), Just(64)],
    ) {
        let (scene, mut there) = crowd(seed);
        let params = UpdateParams { rays: 24, rays_still, radius_m: 0.5, bent_normals: true };
        let (mut tracer, mut updater) = start_at(&scene, &there, params, 40.0);
        let mut everything = updater.clone();
        let mut gone = [false; 8];
        for (moves, toggled, rest) in script {
            for m in moves {
                m.apply(&scene, &mut there);
            }
            for instance in toggled {
                gone[instance] = !gone[instance];
            }
            let mut pose = there.clone();
            for (posed, _) in pose.instances.iter_mut().zip(gone).filter(|(_, gone)| *gone) {
                *posed = PosedInstance::REMOVED;
            }
            for _ in 0..=rest * REST_STEPS {
                tracer.update(&scene, &pose);
                updater.step(&scene, &pose, &mut tracer, &FREE);
            }
            everything.step_all(&scene, &pose, &Tracer::new(&scene, &pose));
            if rays_still == 0 {
                prop_assert_eq!(updater.store(), everything.store());
            }
        }
        if rays_still > 0 {
            let mut pose = there.clone();
            for (posed, _) in pose.instances.iter_mut().zip(gone).filter(|(_, gone)| *gone) {
                *posed = PosedInstance::REMOVED;
            }
            // Once nothing moves every point gets all its rays.
            for _ in 0..2 * REST_STEPS {
                tracer.update(&scene, &pose);
                updater.step(&scene, &pose, &mut tracer, &FREE);
            }
            prop_assert_eq!(updater.store(), everything.store());
        }
    }
}
