//! Points that come and go have the values they would have had all along.

use proptest::prelude::*;

use super::*;
use crate::psao::generate::PointLayer;

/// The points of each instance alone, and how they are laid.
fn laid(scene: &Scene, pose: &Pose) -> (PointLayer, Vec<GeneratedPoints>) {
    let params = GenerateParams { points_per_m2: 200.0, ..Default::default() };
    let layer = PointLayer::new(scene, &params).unwrap();
    let tracer = Tracer::new(scene, pose);
    let one = |i| layer.lay(scene, pose, &tracer, &[i]).unwrap();
    let sets = (0..scene.instances.len() as u32).map(one).collect();
    (layer, sets)
}

#[test]
fn instances_laid_one_by_one_are_those_laid_together() {
    let (scene, pose) = crowd(5);
    let tracer = Tracer::new(&scene, &pose);
    let params = GenerateParams { points_per_m2: 200.0, ..Default::default() };
    let all = generate_points(&scene, &pose, &tracer, &params, &|_| ()).unwrap();
    let (layer, sets) = laid(&scene, &pose);
    let mut joined = PointStore::new(layer.empty().unwrap().layout, Vec::new()).unwrap();
    let mut dropped = 0;
    for (instance, one) in sets.iter().enumerate().rev() {
        assert!(one.layout.len() as u64 <= layer.most_points(instance), "{instance}");
        for set in one.layout.sets() {
            let whole = all.layout.set_of_instance(set.instance).unwrap();
            assert_eq!(&all.anchors[whole.first as usize..][..whole.len()], &one.anchors[..]);
        }
        let one_store = PointStore::new(one.layout.clone(), vec![1; one.layout.len()]).unwrap();
        joined = joined.with_sets(&[], &one_store).unwrap();
        dropped += one.dropped_inside;
    }
    assert!(dropped > 0, "the inside test was meant to matter");
    assert_eq!((&**joined.layout(), dropped), (&*all.layout, all.dropped_inside));
    let several = layer.lay(&scene, &pose, &tracer, &[0, 2, 3]).unwrap();
    assert_eq!(&*several.layout, &all.layout.only(&[0, 2, 3]));
}

#[derive(Clone, Debug)]
enum Op {
    Move(Vec<Move>),
    Spawn(u32),
    Evict(Vec<u32>),
}

fn ops() -> impl Strategy<Value = Vec<Op>> {
    let op = prop_oneof![
        3 => prop::collection::vec(any_move(), 0..3).prop_map(Op::Move),
        3 => (0u32..9).prop_map(Op::Spawn),
        1 => prop::collection::btree_set(0u32..9, 1..4).prop_map(|set| Op::Evict(set.into_iter().collect())),
    ];
    prop::collection::vec(op, 1..14)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Without a budget at once, with one once it has caught up: what is there has the values of an updater that has traced it all.
    #[test]
    fn what_is_there_is_as_if_it_had_always_been(ops in ops(), budget in prop::option::of(500u64..20_000)) {
        let (scene, mut pose) = crowd(9);
        let (layer, sets) = laid(&scene, &pose);
        let mut tracer = Tracer::new(&scene, &pose);
        let params = UpdateParams { rays: 32, bent_normals: true, ..Default::default() };
        let mut updater =
            Updater::new(&scene, &pose, &tracer, layer.empty().unwrap(), params, &|_| ()).unwrap();
        let mut wanted = std::collections::BTreeSet::new();
        let input = StepInput { ray_budget: budget, ..FREE };
        let mut step = |updater: &mut Updater, pose: &Pose| {
            tracer.update(&scene, pose);
            let report = updater.step(&scene, pose, &mut tracer, &input);
            if let Some(budget) = budget {
                prop_assert!(report.counts.rays() <= budget.max(64));
            }
            let ready = updater.take_ready();
            prop_assert!(ready.iter().all(|i| updater.store().layout().set_of_instance(*i).is_some()));
            prop_assert!(budget.is_some() || updater.spawning() == 0);
            Ok(())
        };
        for op in ops {
            match op {
                Op::Move(moves) => moves.iter().for_each(|m| m.apply(&scene, &mut pose)),
                Op::Spawn(instance) => {
                    let result = updater.spawn(sets[instance as usize % sets.len()].clone());
                    let instance = instance % sets.len() as u32;
                    prop_assert_eq!(result.is_ok(), wanted.insert(instance) || sets[instance as usize].layout.is_empty());
                }
                Op::Evict(instances) => {
                    updater.evict(&instances);
                    wanted.retain(|i| !instances.contains(i));
                }
            }
            step(&mut updater, &pose)?;
        }
        for _ in 0..400 {
            step(&mut updater, &pose)?;
        }
        prop_assert_eq!(updater.spawning(), 0);
        let there: Vec<u32> = updater.store().layout().sets().iter().map(|set| set.instance).collect();
        let expected: Vec<u32> = wanted.into_iter().filter(|i| !sets[*i as usize].layout.is_empty()).collect();
        prop_assert_eq!(there, expected);
        let before = updater.store().clone();
        let again = updater.step_all(&scene, &pose, &Tracer::new(&scene, &pose));
        prop_assert!(again.changes.is_empty(), "{} of {} points", again.changes.len(), before.layout().len());
        prop_assert_eq!(updater.store(), &before);
    }
}

#[test]
fn a_set_counts_when_all_its_points_are_traced_and_not_before() {
    let (scene, pose) = stage();
    let (layer, sets) = laid(&scene, &pose);
    let mut tracer = Tracer::new(&scene, &pose);
    let params = UpdateParams::default();
    let mut updater = Updater::new(&scene, &pose, &tracer, layer.empty().unwrap(), params, &|_| ()).unwrap();
    let points = sets[0].layout.len() as u64;
    updater.spawn(sets[0].clone()).unwrap();
    assert_eq!(
        updater.spawn(sets[0].clone()).unwrap_err().to_string(),
        "layout: instance 0 has a set already"
    );
    // A fifth of the rays a step: a quarter of the budget is kept for them, and nothing else needs the rest.
    let input = StepInput { ray_budget: Some(points * 64 / 5 + 64), ..FREE };
    for step in 0..5 {
        assert_eq!((updater.store().layout().len(), updater.spawning() as u64), (0, points), "step {step}");
        let counts = updater.step(&scene, &pose, &mut tracer, &input).counts;
        assert!(counts.rays() > 0 && counts.rays() <= input.ray_budget.unwrap());
        let ready = updater.take_ready();
        assert_eq!(ready.is_empty(), step < 4);
    }
    let (_, all) = start(&scene, &pose, params);
    let set = all.store().layout().set_of_instance(0).unwrap();
    assert_eq!(updater.store().visibility(), &all.store().visibility()[set.first as usize..][..set.len()]);
    assert!(updater.bytes_per_point() > 20.0);
}
