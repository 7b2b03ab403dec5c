//! The cap holds, nothing takes turns, and what is seen comes.

use glam::{Vec3, Vec4};
use proptest::prelude::*;

use super::*;

/// Boxes of one metre along x, one every two metres.
fn row(count: usize) -> Vec<Aabb> {
    (0..count)
        .map(|i| Aabb { min: Vec3::X * 2.0 * i as f32, max: Vec3::X * 2.0 * i as f32 + Vec3::ONE })
        .collect()
}

/// Sees the boxes whose numbers lie in `from..to`, all of them whole.
fn slab(from: usize, to: usize) -> ConvexVolume {
    let (low, high) = (2.0 * from as f32 - 0.5, 2.0 * to as f32 - 0.5);
    ConvexVolume {
        planes: vec![Vec4::new(1.0, 0.0, 0.0, -low), Vec4::new(-1.0, 0.0, 0.0, high)],
        eye_world: None,
    }
}

fn params(max_points: u32) -> ResidencyParams {
    ResidencyParams { stay_steps: 5, points_a_step: 100, ..ResidencyParams::with_max_points(max_points) }
}

#[test]
fn without_interest_the_largest_come_until_the_cap() {
    let mut bounds = row(4);
    bounds[2].max.y = 9.0;
    let mut residency = Residency::new(params(250), vec![100, 100, 100, 0]);
    let watch = Watch { bounds_world: &bounds, interest: &[] };
    assert_eq!(residency.fill(&watch), Turnover { evict: vec![], spawn: vec![0, 2] });
    residency.laid(0, 90);
    assert_eq!(residency.points(), 190);
    for _ in 0..50 {
        assert_eq!(residency.step(&watch), Turnover::default(), "nothing takes turns");
    }
    // Laying gave fewer points than it could have: now the third fits.
    residency.laid(2, 60);
    assert_eq!(residency.step(&watch), Turnover { evict: vec![], spawn: vec![1] });
}

#[test]
fn what_is_seen_comes_and_what_was_seen_longest_ago_goes() {
    let bounds = row(10);
    let mut residency = Residency::new(params(300), vec![100; 10]);
    let mut look = |from, steps: u32| {
        let interest = [slab(from, from + 2)];
        let watch = Watch { bounds_world: &bounds, interest: &interest };
        let mut all = Turnover::default();
        for _ in 0..steps {
            let turnover = residency.step(&watch);
            assert!(turnover.spawn.len() <= 1, "one instance is as much as comes in a step");
            assert!(residency.points() <= 300);
            all.evict.extend(turnover.evict);
            all.spawn.extend(turnover.spawn);
        }
        all
    };
    assert_eq!(look(0, 6), Turnover { evict: vec![], spawn: vec![0, 1] });
    assert_eq!(look(1, 6), Turnover { evict: vec![], spawn: vec![2] });
    // Only what must go goes, the one that was seen longest ago.
    assert_eq!(look(2, 6), Turnover { evict: vec![0], spawn: vec![3] });
    assert_eq!(look(0, 20), Turnover { evict: vec![3], spawn: vec![0] });
}

#[test]
fn what_has_just_come_stays_and_what_is_too_large_never_comes() {
    let bounds = row(3);
    let mut residency = Residency::new(params(100), vec![100, 100, 101]);
    assert_eq!(residency.too_large(), [2]);
    let mut step = |from| {
        let interest = [slab(from, from + 1)];
        residency.step(&Watch { bounds_world: &bounds, interest: &interest })
    };
    assert_eq!(step(0).spawn, [0]);
    for _ in 0..4 {
        assert_eq!(step(1), Turnover::default(), "it has only just come");
    }
    assert_eq!(step(1), Turnover { evict: vec![0], spawn: vec![1] });
    for _ in 0..20 {
        assert_eq!(step(2), Turnover::default());
    }
}

#[test]
fn the_near_come_before_the_far_and_what_is_almost_seen_before_what_is_not() {
    let bounds = row(6);
    // Looks along x from before the second box: the first lies behind.
    let planes = vec![Vec4::new(1.0, 0.0, 0.0, -1.6)];
    let interest = [ConvexVolume { planes, eye_world: Some(Vec3::new(1.6, 0.5, 0.5)) }];
    let watch = Watch { bounds_world: &bounds, interest: &interest };
    let mut two = Residency::new(params(200), vec![100; 6]);
    assert_eq!(two.fill(&watch).spawn, [1, 2]);
    let mut all = Residency::new(params(900), vec![100; 6]);
    assert_eq!(all.fill(&watch).spawn, [1, 2, 3, 4, 5], "what lies behind is not almost seen");
}

#[test]
fn what_was_taken_away_gives_way_and_comes_back() {
    let mut bounds = row(4);
    let mut residency = Residency::new(params(200), vec![100; 4]);
    assert_eq!(residency.fill(&Watch { bounds_world: &bounds, interest: &[] }).spawn, [0, 1]);
    let taken = std::mem::replace(&mut bounds[0], Aabb::EMPTY);
    for interest in [&[][..], &[slab(0, 4)]] {
        let mut residency = residency.clone();
        let turnover = residency.step(&Watch { bounds_world: &bounds, interest });
        assert_eq!(turnover, Turnover { evict: vec![0], spawn: vec![2] });
        assert_eq!(residency.points(), 200);
    }
    // While there is room it keeps its points.
    let mut roomy = Residency::new(params(400), vec![100; 4]);
    bounds[0] = taken;
    roomy.fill(&Watch { bounds_world: &bounds, interest: &[] });
    bounds[0] = Aabb::EMPTY;
    assert_eq!(roomy.step(&Watch { bounds_world: &bounds, interest: &[] }), Turnover::default());
}

proptest! {
    #[test]
    fn the_cap_holds_whatever_is_looked_at(
        most in prop::collection::vec(0u64..200, 1..20),
        cap in 1u32..600,
        looks in prop::collection::vec((0usize..20, 1usize..9, 1u32..8), 1..20),
    ) {
        let bounds = row(most.len());
        let mut residency = Residency::new(params(cap), most.clone());
        let mut here = std::collections::BTreeMap::new();
        let mut number = 0u32;
        for (from, width, steps) in looks {
            let eye_world = Some(Vec3::new(2.0 * from as f32, 0.0, 3.0));
            let interest = [ConvexVolume { eye_world, ..slab(from, from + width) }];
            for _ in 0..steps {
                number += 1;
                let turnover = residency.step(&Watch { bounds_world: &bounds, interest: &interest });
                for instance in &turnover.evict {
                    let since = here.remove(instance).expect("only what is there goes");
                    prop_assert!(number - since >= 5, "{} came {} steps ago", instance, number - since);
                }
                for instance in &turnover.spawn {
                    prop_assert!(here.insert(*instance, number).is_none());
                    // Laying gives fewer now and then.
                    residency.laid(*instance, most[*instance as usize] * (3 + u64::from(instance % 2)) / 4);
                }
                let points: u64 = here.keys().map(|i| most[*i as usize] * (3 + u64::from(i % 2)) / 4).sum();
                prop_assert_eq!(residency.points(), points);
                prop_assert!(points <= u64::from(cap));
            }
            // Whoever goes on looking gets all there is to see, if there is room for it.
            let seen: Vec<usize> = (from..(from + width).min(most.len())).filter(|i| most[*i] > 0).collect();
            if steps > 6 && seen.iter().map(|i| most[*i]).sum::<u64>() <= u64::from(cap) / 8 {
                let mut residency = residency.clone();
                for _ in 0..40 {
                    residency.step(&Watch { bounds_world: &bounds, interest: &interest });
                }
                prop_assert!(seen.iter().all(|i| residency.instances[*i].here.is_some()));
            }
        }
    }
}
