//! Queries of movers alone and of still instances alone against queries of everything.

use dapple_scene::glam::{Affine3A, Quat, Vec3};
use dapple_scene::{Pose, Scene};
use proptest::prelude::*;

use super::{BlockedMask, Blockers, Ray, Tracer};
use crate::test_support::{Random, deform, scene, soup};

/// Soups strewn about, of which any may move.
fn strewn(random: &mut Random, instances: usize) -> (Scene, Pose) {
    let meshes = (0..3).map(|_| soup(random, 40, 0.5)).collect();
    let placed: Vec<_> = (0..instances).map(|i| (i as u32 % 3, placement(random))).collect();
    scene(meshes, &placed)
}

fn placement(random: &mut Random) -> Affine3A {
    let turn = Quat::from_axis_angle(random.direction(), 6.0 * random.next());
    Affine3A::from_rotation_translation(turn, 3.0 * random.vector())
}

fn check(tracer: &Tracer, random: &mut Random) {
    let origin = 3.0 * random.vector();
    let directions: Vec<Vec3> = (0..150).map(|_| random.direction()).collect();
    let t_max = 0.2 + 2.5 * random.next();
    let all = tracer.occlusion(origin, &directions, t_max);
    for (i, d) in directions.iter().enumerate() {
        let ray = Ray { origin_world: origin, direction_world: *d, t_max };
        assert_eq!(all[i / 64] >> (i % 64) & 1 == 1, tracer.occluded(&ray), "ray {i}");
    }
    let mut word = || (0..64).fold(0, |word, _| word << 1 | u64::from(random.next() < 0.6));
    let open: BlockedMask = [word(), u64::MAX, word(), word()];
    let by = |blockers, open: &BlockedMask| tracer.occlusion_by(blockers, origin, &directions, t_max, open);
    let still = by(Blockers::Still, &open);
    let movers = by(Blockers::Movers, &open);
    for i in 0..4 {
        assert_eq!(still[i] | movers[i], all[i] & open[i]);
    }
    assert_eq!(by(Blockers::All, &open), std::array::from_fn(|i| all[i] & open[i]));
    assert_eq!(by(Blockers::All, &[0; 4]), [0; 4]);
    let apart =
        |movers: bool| tracer.only(|i| tracer.movers()[i] == movers).occlusion(origin, &directions, t_max);
    let (still_alone, movers_alone) = (apart(false), apart(true));
    for i in 0..4 {
        assert_eq!((still[i], movers[i]), (still_alone[i] & open[i], movers_alone[i] & open[i]));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn movers_and_still_instances_make_up_everything(seed in any::<u32>(), instances in 0..24_usize) {
        let mut random = Random(seed);
        let (scene, mut pose) = strewn(&mut random, instances);
        let mut tracer = Tracer::new(&scene, &pose);
        prop_assert!(tracer.movers().iter().all(|moves| !moves));
        let movers: Vec<bool> = (0..instances).map(|_| random.next() < 0.4).collect();
        tracer.set_movers(&movers);
        prop_assert_eq!(tracer.movers(), &movers[..]);
        for step in 0..3 {
            for (i, moves) in movers.iter().enumerate() {
                // In the last step still ones move too: answers may not go stale.
                if (*moves || step == 2) && random.next() < 0.7 {
                    pose.instances[i].world_from_mesh = placement(&mut random);
                    if random.next() < 0.3 {
                        let mesh = &scene.meshes[scene.instances[i].mesh as usize];
                        let bent = mesh.positions.iter().map(|p| *p * (0.6 + 0.8 * random.next())).collect();
                        deform(&mut pose, i, bent);
                    }
                }
            }
            tracer.update(&scene, &pose);
            prop_assert_eq!(tracer.movers(), &movers[..]);
            let fresh = Tracer::new(&scene, &pose);
            for _ in 0..4 {
                check(&tracer, &mut random);
                let (origin, direction) = (3.0 * random.vector(), random.direction());
                let ray = Ray { origin_world: origin, direction_world: direction, t_max: 4.0 };
                prop_assert_eq!(tracer.closest_hit(&ray), fresh.closest_hit(&ray));
            }
        }
    }
}

#[test]
fn a_list_of_movers_of_any_length_is_taken() {
    let (scene, pose) = strewn(&mut Random(1), 3);
    let mut tracer = Tracer::new(&scene, &pose);
    tracer.set_movers(&[true]);
    assert_eq!(tracer.movers(), [true, false, false]);
    tracer.set_movers(&[false, true, true, true, true]);
    assert_eq!(tracer.movers(), [false, true, true]);
}
