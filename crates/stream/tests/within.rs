//! Frames that may only take so many bytes: they never take more, nothing is lost, and what matters most comes first.

#![allow(clippy::unwrap_used, reason = "in a test, a failed unwrap is a failure like any other")]

#[path = "common/cloud.rs"]
mod cloud;

use dapple_store::points::PointStore;
use dapple_stream::{Budget, Limits, Precision, Publisher, PublisherConfig, Spending, Subscriber};
use proptest::prelude::*;

const SCENE: [u8; 32] = [5; 32];
const TOLERANCE: u8 = 4;

/// Both ends, in agreement.
struct Ends {
    publisher: Publisher,
    subscriber: Subscriber,
    start: PointStore,
}

impl Ends {
    fn new(points: usize, deltas_per_group: u32) -> Ends {
        let start = cloud::hall(11, points);
        let precision = Precision { tolerance: TOLERANCE, step: 0 };
        let config = PublisherConfig { precision, deltas_per_group, ..PublisherConfig::default() };
        let mut publisher = Publisher::new(SCENE, config);
        let mut subscriber = Subscriber::new(Some(SCENE), Limits::default());
        subscriber.receive(&publisher.publish(&start).unwrap().bytes).unwrap();
        Ends { publisher, subscriber, start }
    }

    /// Bytes of the frame that was sent.
    fn publish(&mut self, store: &PointStore, spending: &Spending<'_>) -> usize {
        let frame = self.publisher.publish_within(store, spending);
        if let Some(frame) = &frame {
            self.subscriber.receive(&frame.bytes).unwrap();
        }
        assert!(self.subscriber.store() == self.publisher.store());
        frame.map_or(0, |frame| frame.bytes.len())
    }

    /// How far subscribers are from `store` in these points: greatest, and root mean square.
    fn off(&self, store: &PointStore, points: std::ops::Range<usize>) -> (u8, f64) {
        let held = &self.publisher.store().unwrap().visibility()[points.clone()];
        let off = || held.iter().zip(&store.visibility()[points.clone()]).map(|(a, b)| a.abs_diff(*b));
        let squares: f64 = off().map(|off| f64::from(off).powi(2)).sum();
        (off().max().unwrap(), (squares / held.len() as f64).sqrt())
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(10))]

    #[test]
    fn frames_take_no_more_than_they_may_and_all_arrives_in_time(
        mosts in prop::collection::vec(0usize..3000, 1..8),
        scales in prop::collection::vec(0.0f32..40.0, 3),
        deltas_per_group in prop_oneof![Just(0u32), Just(2)],
        seed: u64,
    ) {
        let mut ends = Ends::new(3000, 0);
        let mut grouped = Ends::new(3000, deltas_per_group);
        let stretches = ends.start.visibility().len().div_ceil(Spending::STRETCH);
        let coarseness: Vec<f32> = (0..stretches).map(|at| scales[at * 3 / stretches]).collect();
        let mut store = ends.start.clone();
        for (step, most) in mosts.iter().enumerate() {
            store = cloud::moved(&store, seed.wrapping_add(step as u64), 0.2);
            let spending = Spending { most_bytes: Some(*most), coarseness: &coarseness, ..Spending::default() };
            let bytes = ends.publish(&store, &spending);
            prop_assert!(bytes <= *most, "{bytes} of {most}");
            grouped.publish(&store, &spending);
            prop_assert!(
                grouped.publisher.store() == ends.publisher.store(), "groups change nothing"
            );
        }
        ends.publish(&store, &Spending::default());
        let all = 0..store.visibility().len();
        prop_assert!(ends.off(&store, all).0 <= TOLERANCE);
    }
}

/// Bent normals that move with the values.
fn bent(store: PointStore) -> PointStore {
    let plane = |turn: u8| store.visibility().iter().map(|v| (v / 2 + 64).rotate_left(turn.into())).collect();
    let planes = [plane(0), plane(1)];
    store.with_bent(planes).unwrap()
}

#[test]
fn bent_normals_are_within_the_limit_too_and_arrive_in_time() {
    let start = bent(cloud::hall(11, 3000));
    let precision = Precision { tolerance: TOLERANCE, step: 0 };
    let config = PublisherConfig { precision, bent_precision: precision, ..PublisherConfig::default() };
    let publisher = Publisher::new(SCENE, config);
    let subscriber = Subscriber::new(Some(SCENE), Limits::default());
    let mut ends = Ends { publisher, subscriber, start: start.clone() };
    ends.publish(&start, &Spending::default());
    let mut store = start;
    for (seed, most) in [900, 1500, 60, 2500].into_iter().enumerate() {
        store = bent(cloud::moved(&store, seed as u64, 0.2));
        let bytes = ends.publish(&store, &Spending { most_bytes: Some(most), ..Spending::default() });
        assert!(bytes <= most, "{bytes} of {most}");
        assert!(most < 100 || bytes > most / 3, "{bytes} of {most}");
    }
    ends.publish(&store, &Spending::default());
    let held = ends.publisher.store().unwrap().bent().unwrap();
    let off = |(a, b): (&Vec<u8>, &Vec<u8>)| a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
    assert!(held.iter().zip(store.bent().unwrap()).map(off).max().unwrap() <= TOLERANCE);
}

#[test]
fn without_want_a_limit_changes_nothing() {
    let (mut free, mut limited) = (Ends::new(20_000, 0), Ends::new(20_000, 0));
    let coarseness = vec![7.0; free.start.visibility().len().div_ceil(Spending::STRETCH)];
    let mut store = free.start.clone();
    for seed in 0..4 {
        store = cloud::moved(&store, seed, 0.02);
        let bytes = free.publish(&store, &Spending::default());
        let spending =
            Spending { most_bytes: Some(bytes + 64), coarseness: &coarseness, ..Spending::default() };
        assert_eq!(limited.publish(&store, &spending), bytes);
    }
}

#[test]
fn a_limit_that_is_missed_by_little_costs_little() {
    for share in [0.5, 0.8, 0.9, 0.97] {
        for coarseness in [1.0, 0.02, f32::INFINITY] {
            let (mut free, mut limited) = (Ends::new(20_000, 0), Ends::new(20_000, 0));
            let stretches = free.start.visibility().len().div_ceil(Spending::STRETCH);
            // One stretch matters as much or little as it likes.
            let mut scales = vec![1.0; stretches];
            scales[0] = coarseness;
            let store = cloud::moved(&free.start, 3, 0.1);
            let bytes = free.publish(&store, &Spending::default());
            let most = (f64::from(bytes as u32) * share) as usize;
            let spending = Spending { most_bytes: Some(most), coarseness: &scales, ..Spending::default() };
            let sent = limited.publish(&store, &spending);
            assert!(sent <= most && 2 * sent > most, "{sent} of {most}, {bytes} wanted, {coarseness}");
        }
    }
}

#[test]
fn a_limit_is_used_and_spent_where_it_matters() {
    let mut ends = Ends::new(20_000, 0);
    let points = ends.start.visibility().len();
    let stretches = points.div_ceil(Spending::STRETCH);
    // The first half is near, the second eight times as far.
    let coarseness: Vec<f32> = (0..stretches).map(|at| if 2 * at < stretches { 1.0 } else { 8.0 }).collect();
    let mut even = Ends::new(20_000, 0);
    let mut store = ends.start.clone();
    let (mut used, mut most_of_all) = (0, 0);
    for seed in 0..12 {
        store = cloud::moved(&store, 50 + seed, 0.15);
        let most = 1200;
        most_of_all += most;
        used += ends.publish(
            &store,
            &Spending { most_bytes: Some(most), coarseness: &coarseness, ..Spending::default() },
        );
        even.publish(&store, &Spending { most_bytes: Some(most), ..Spending::default() });
    }
    assert!(4 * used > 3 * most_of_all, "{used} of {most_of_all} bytes");
    let half = stretches / 2 * Spending::STRETCH;
    let [near, far] = [0..half, half..points].map(|part| ends.off(&store, part).1);
    let [evenly_near, evenly_far] = [0..half, half..points].map(|part| even.off(&store, part).1);
    assert!(near < 0.8 * evenly_near && far > evenly_far, "{near} {far}, evenly {evenly_near} {evenly_far}");
    // With room again, and nothing new, everything arrives.
    for _ in 0..400 {
        if ends.publish(
            &store,
            &Spending { most_bytes: Some(1200), coarseness: &coarseness, ..Spending::default() },
        ) == 0
        {
            break;
        }
    }
    assert!(ends.off(&store, 0..points).0 <= TOLERANCE);
}

#[test]
fn a_budget_holds_over_every_second_of_a_stream() {
    let mut ends = Ends::new(20_000, 0);
    let mut budget = Budget::new(80_000);
    let (mut store, mut sent) = (ends.start.clone(), Vec::new());
    for step in 0..45u32 {
        let now_s = f64::from(step) / 15.0;
        store = cloud::moved(&store, 900 + u64::from(step), 0.1);
        let most_bytes = Some(budget.allowance(now_s));
        let bytes = ends.publish(&store, &Spending { most_bytes, ..Spending::default() });
        budget.spend(bytes);
        sent.push(bytes);
    }
    let seconds: Vec<usize> = sent.windows(15).map(|second| second.iter().sum()).collect();
    assert!(seconds.iter().all(|bytes| *bytes <= 10_000), "{seconds:?}");
    assert!(seconds[20..].iter().all(|bytes| *bytes >= 6000), "{seconds:?}");
}
