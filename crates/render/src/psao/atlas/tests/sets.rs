//! Sets that come and go, while work goes on and values change: what is there has the texels of an atlas made afresh.

use dapple_store::points::PointStore;

use super::*;

/// The texels of an instance, `[old, new]`, page by page; empty while it is not ready.
fn texels_of(atlas: &VisibilityAtlas, instance: u32) -> Vec<[u8; 2]> {
    let Some(charts) = atlas.charts(instance) else { return Vec::new() };
    let mut texels = Vec::new();
    for (place, size) in atlas.placements(instance).iter().zip(charts.pages().iter().cycle()) {
        for y in u32::from(place.y)..u32::from(place.y + size.height) {
            let start = (y * atlas.side() + u32::from(place.x)) as usize;
            texels.extend(&atlas.texels(place.layer.into())[start..start + usize::from(size.width)]);
        }
    }
    texels
}

/// How many texels show something, in all layers.
fn written(atlas: &VisibilityAtlas) -> usize {
    atlas.all_texels().iter().filter(|texel| **texel != [255, 255]).count()
}

#[derive(Clone, Debug)]
enum Op {
    /// Instances change sides: those that are there go, the others come.
    Sets(Vec<u32>),
    /// Sets go and come back otherwise.
    Replace(u32),
    Work(usize),
    Change(u32),
    Fade(f32),
    Ask,
}

fn ops() -> impl Strategy<Value = Vec<Op>> {
    let op = prop_oneof![
        3 => prop::collection::btree_set(0u32..4, 1..3).prop_map(|set| Op::Sets(set.into_iter().collect())),
        1 => (0u32..4).prop_map(Op::Replace),
        3 => prop_oneof![1usize..300, Just(100_000)].prop_map(Op::Work),
        3 => any::<u32>().prop_map(Op::Change),
        1 => (0f32..1.0).prop_map(Op::Fade),
        1 => Just(Op::Ask),
    ];
    prop::collection::vec(op, 1..20)
}

/// The sets of some instances of `all`, with values that look random.
fn part(all: &PointLayout, instances: &[u32], seed: u32) -> PointStore {
    let layout = all.only(instances);
    let values = (0..layout.len() as u32).map(|i| (noise(i, seed) >> 24) as u8).collect();
    PointStore::new(layout.into(), values).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn what_is_there_is_as_if_made_afresh(ops in ops(), start in 0u32..16) {
        let scene = stage();
        let all = lay(&scene, 0.1);
        let first: Vec<u32> = (0..4).filter(|i| start >> i & 1 == 1).collect();
        let mut store = part(&all, &first, 1);
        let mut atlas = VisibilityAtlas::new(store.layout().clone(), &scene, None, AtlasParams::default());
        // What a card would have pages of.
        let mut shown = std::collections::BTreeSet::new();
        let mut ask = |atlas: &mut VisibilityAtlas| {
            // Also such as came and went between two calls.
            for instance in atlas.take_gone() {
                shown.remove(&instance);
            }
            shown.extend(atlas.take_ready());
            let ready = (0..4).filter(|i| !atlas.placements(*i).is_empty()).collect();
            assert_eq!(shown, ready);
        };
        for (round, op) in (2u32..).zip(ops) {
            match op {
                Op::Sets(instances) => {
                    let is_there = |i: &u32| store.layout().set_of_instance(*i).is_some();
                    let (gone, come): (Vec<u32>, Vec<u32>) = instances.into_iter().partition(is_there);
                    store = store.with_sets(&gone, &part(&all, &come, round)).unwrap();
                    atlas.change_sets(&scene, store.layout().clone(), None, &gone);
                }
                Op::Replace(instance) if store.layout().set_of_instance(instance).is_some() => {
                    store = store.with_sets(&[instance], &part(&all, &[instance], round)).unwrap();
                    atlas.change_sets(&scene, store.layout().clone(), None, &[instance]);
                }
                Op::Replace(_) => {}
                Op::Work(texels) => drop(atlas.work(&scene, store.visibility(), texels)),
                Op::Change(seed) => {
                    let points = (0..store.layout().len() as u32).filter(|p| noise(*p, seed).is_multiple_of(3));
                    let values = store.visibility().to_vec();
                    let changes: Vec<PointChange> = points
                        .map(|point| PointChange { point, old: values[point as usize], new: noise(point, !seed) as u8 })
                        .collect();
                    atlas.apply(changes.iter().copied());
                    let news: Vec<_> = changes
                        .iter()
                        .map(|c| dapple_store::points::Change { point: c.point, visibility: c.new })
                        .collect();
                    store.apply(&news).unwrap();
                }
                Op::Fade(progress) => atlas.begin_update(progress),
                Op::Ask => ask(&mut atlas),
            }
        }
        while !atlas.work(&scene, store.visibility(), 1000).is_complete() {}
        prop_assert!(atlas.failed().is_empty());
        ask(&mut atlas);
        let fresh = complete(&scene, store.layout(), store.visibility());
        for instance in 0..4 {
            let news = |atlas| texels_of(atlas, instance).iter().map(|texel| texel[1]).collect::<Vec<u8>>();
            prop_assert_eq!(news(&atlas), news(&fresh), "instance {}", instance);
        }
        // All fades end, none is forgotten, and what nobody has is open.
        atlas.begin_update(1.0);
        let of_all = |atlas| (0..4).flat_map(|i| texels_of(atlas, i)).filter(|t| *t != [255, 255]).count();
        prop_assert!((0..4).flat_map(|i| texels_of(&atlas, i)).all(|texel| texel[0] == texel[1]));
        prop_assert_eq!(written(&atlas), of_all(&atlas));
    }
}

#[test]
fn places_are_used_again() {
    let scene = stage();
    let all = lay(&scene, 0.05);
    let mut store = part(&all, &[0, 1], 1);
    let mut atlas = complete(&scene, store.layout(), store.visibility());
    let (layers, texels) = (atlas.layers(), atlas.texel_count());
    for round in 0..12 {
        let (gone, come) = if round % 2 == 0 { ([0, 1], [2, 3]) } else { ([2, 3], [0, 1]) };
        store = store.with_sets(&gone, &part(&all, &come, round)).unwrap();
        atlas.change_sets(&scene, store.layout().clone(), None, &gone);
        assert_eq!((atlas.take_gone(), atlas.ready_count(), written(&atlas)), (gone.to_vec(), 0, 0));
        while !atlas.work(&scene, store.visibility(), usize::MAX).is_complete() {}
        let mut ready = atlas.take_ready();
        ready.sort_unstable();
        assert_eq!(ready, come);
        // What has come fades in from open.
        assert!(come.iter().flat_map(|i| texels_of(&atlas, *i)).all(|texel| texel[0] == 255));
    }
    assert_eq!((atlas.layers(), atlas.texel_count()), (layers, texels));
}
