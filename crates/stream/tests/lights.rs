//! Visibility of lights on its way: what waits, what fits, and what the edge of a shadow costs.

#![allow(clippy::unwrap_used, reason = "in a test, a failed unwrap is a failure like any other")]

mod common;

use std::sync::Arc;

use dapple_store::light_visibility::{Lean, LightVisibility, OPEN, quantized};
use dapple_store::points::{PointLayout, PointStore};
use dapple_stream::{Limits, Parts, Publisher, PublisherConfig, Spending, Subscriber};
use proptest::prelude::*;

/// A floor of `side` × `side` points of one instance.
fn floor(instance: u32, side: u32) -> Arc<PointLayout> {
    let points = (0..side * side).map(|i| ([i % side * 8, 5, i / side * 8], [127, 127])).collect();
    Arc::new(PointLayout::new(1.0, 8.0, vec![common::set(instance, [0.0; 3], points)]).unwrap())
}

fn store(layout: &Arc<PointLayout>, lights: u32, values: Vec<u8>) -> PointStore {
    let store = PointStore::new(layout.clone(), vec![255; layout.len()]).unwrap();
    store.with_lights(LightVisibility::new(layout, lights, values).unwrap()).unwrap()
}

/// Both ends, in agreement.
struct Ends {
    publisher: Publisher,
    subscriber: Subscriber,
}

impl Ends {
    fn new(start: &PointStore) -> (Ends, usize) {
        let mut publisher = Publisher::new([0; 32], PublisherConfig::default());
        let mut subscriber = Subscriber::new(None, Limits::default());
        let joined = publisher.publish(start).unwrap().bytes;
        subscriber.receive(&joined).unwrap();
        (Ends { publisher, subscriber }, joined.len())
    }

    /// Bytes of the frame that was sent.
    fn publish(&mut self, store: &PointStore, spending: &Spending<'_>) -> usize {
        let frame = self.publisher.publish_within(store, spending);
        if let Some(frame) = &frame {
            self.subscriber.receive(&frame.bytes).unwrap();
        }
        assert!(common::same_bits(self.subscriber.store().unwrap(), self.publisher.store().unwrap()));
        frame.map_or(0, |frame| frame.bytes.len())
    }

    fn values(&self) -> &[u8] {
        self.subscriber.lights().unwrap().values()
    }
}

#[test]
fn small_changes_wait_until_they_are_large_in_sum() {
    let layout = floor(0, 30);
    let dimmer = |by: u8| store(&layout, 7, vec![OPEN - by; 7 * 900]);
    let (mut ends, _) = Ends::new(&dimmer(0));
    assert_eq!(ends.publish(&dimmer(0), &Spending::default()), 0);
    let light_tolerances: Vec<(u32, u8)> = (0..6300).map(|index| (index, 3)).collect();
    let spending = Spending { light_tolerances: &light_tolerances, ..Spending::default() };
    assert_eq!(ends.publish(&dimmer(2), &spending), 0);
    assert_eq!(ends.publish(&dimmer(3), &spending), 0);
    assert!(ends.publish(&dimmer(4), &spending) > 0);
    assert!(ends.values().iter().all(|value| *value == OPEN - 4));
    // Those that are not listed may not be off.
    let few = Spending { light_tolerances: &light_tolerances[10..], ..Spending::default() };
    assert!(ends.publish(&dimmer(5), &few) > 0);
    assert_eq!(ends.values()[..12], [26, 26, 26, 26, 26, 26, 26, 26, 26, 26, 27, 27]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn frames_take_no_more_than_they_may_and_all_arrives_in_time(
        mosts in prop::collection::vec(0usize..600, 1..6),
        runs in prop::collection::vec((any::<u16>(), 0usize..900, 0..=OPEN), 1..12),
        tolerance in 0u8..6,
    ) {
        let layout = floor(0, 24);
        let count = 3 * layout.len();
        let mut values = vec![OPEN; count];
        let (mut ends, _) = Ends::new(&store(&layout, 3, values.clone()));
        let tolerances: Vec<(u32, u8)> = (0..count as u32 / 2).map(|index| (index, tolerance)).collect();
        for (most, run) in mosts.iter().zip(runs.iter().cycle()) {
            let at = usize::from(run.0) % count;
            values[at..(at + run.1).min(count)].fill(run.2);
            let spending = Spending {
                most_bytes: Some(*most),
                light_tolerances: &tolerances,
                ..Spending::default()
            };
            let bytes = ends.publish(&store(&layout, 3, values.clone()), &spending);
            prop_assert!(bytes <= *most, "{bytes} of {most}");
        }
        // What stands still arrives, little by little.
        let last = store(&layout, 3, values.clone());
        let small = Spending { most_bytes: Some(90), light_tolerances: &tolerances, ..Spending::default() };
        let mut frames = 0;
        while ends.publish(&last, &small) > 0 {
            frames += 1;
            prop_assert!(frames < 2000);
        }
        for (index, (held, value)) in ends.values().iter().zip(&values).enumerate() {
            let may = if index < count / 2 { tolerance } else { 0 };
            prop_assert!(held.abs_diff(*value) <= may, "{index}: {held}, {value}");
        }
    }
}

/// A shadow's straight edge that passes over a floor: the cost of a point that it passes.
#[test]
fn an_edge_that_passes_costs_few_bits() {
    let layout = floor(0, 100);
    let at = |edge: f32| {
        let value = |position: &[u32; 3]| {
            let distance = (position[0] as f32 + 0.3 * position[2] as f32) / 8.0 - edge;
            quantized(0.5 + 0.4 * distance)
        };
        store(&layout, 1, layout.sets()[0].positions.iter().map(value).collect())
    };
    let open = PointStore::new(layout.clone(), vec![255; layout.len()]).unwrap();
    let without = Ends::new(&open).1;
    let (mut ends, joined) = Ends::new(&at(20.0));
    let joined = joined - without;
    assert!(joined < 700, "{joined} bytes for 10,000 points");
    let light_tolerances: Vec<(u32, u8)> = (0..10_000).map(|index| (index, 2)).collect();
    let spending = Spending { light_tolerances: &light_tolerances, ..Spending::default() };
    let (mut bytes, mut changes) = (0, 0);
    for step in 1..=40 {
        bytes += ends.publish(&at(20.0 + 0.9 * step as f32), &spending);
        changes += ends.subscriber.light_changes().len();
    }
    let bits = 8.0 * bytes as f64 / changes as f64;
    println!("join {joined} bytes; {changes} changes of {bits:.2} bits, envelopes counted");
    assert!(bits < 8.0, "{bits} bits a change");
}

#[test]
fn parts_put_together_have_the_lights_of_each() {
    let mut parts = Parts::new(None, Limits::default());
    let layouts = [floor(4, 5), floor(2, 3)];
    let mut publishers = [0, 1].map(|part: usize| {
        let count = 2 * layouts[part].len();
        let mut publisher = Publisher::new([0; 32], PublisherConfig::default());
        let start = store(&layouts[part], 2, vec![9 + part as u8; count]);
        parts.receive(part as u32, &publisher.publish(&start).unwrap().bytes).unwrap();
        publisher
    });
    let mut moved = vec![9; 50];
    (moved[3], moved[30]) = (1, 0);
    let frame = publishers[0].publish(&store(&layouts[0], 2, moved)).unwrap();
    parts.receive(0, &frame.bytes).unwrap();
    let whole = parts.store().unwrap().lights().unwrap().clone();
    // Instance 2 comes before 4.
    let mut expected = vec![10; 9];
    expected.extend([9, 9, 9, 1]);
    expected.resize(34, 9);
    expected.extend([10; 9]);
    expected.extend([9, 9, 9, 9, 9, 0]);
    expected.resize(68, 9);
    assert_eq!(whole.values(), expected);
    let told: Vec<(u32, u8)> =
        parts.light_changes().iter().map(|change| (change.index, change.new)).collect();
    assert_eq!(told, [(12, 1), (48, 0)]);
    // Another number of lights does not go with them; what there was stays.
    let mut other = Publisher::new([0; 32], PublisherConfig { first_group: 1, ..Default::default() });
    let three = other.publish(&store(&floor(7, 3), 3, vec![0; 27])).unwrap();
    let error = parts.receive(2, &three.bytes).unwrap_err().to_string();
    assert!(error.contains("values of 3 lights do not go with others that have 2"), "{error}");
    assert_eq!(parts.store().unwrap().lights(), Some(&whole));
}

/// One light changes everywhere in each frame, and does not fit; the shadow of another has moved once.
#[test]
fn what_goes_on_changing_does_not_keep_the_rest_waiting() {
    let layout = floor(0, 24);
    let points = layout.len();
    let mut values = vec![OPEN; 3 * points];
    let (mut ends, _) = Ends::new(&store(&layout, 3, values.clone()));
    values[2 * points..].fill(3);
    let mut frames = 0u32;
    while ends.values()[2 * points..] != values[2 * points..] {
        for (point, value) in values[..points].iter_mut().enumerate() {
            *value =
                ((point as u32).wrapping_mul(2_654_435_761).wrapping_add(frames * 7919) >> 20) as u8 & OPEN;
        }
        let spending = Spending { most_bytes: Some(200), ..Spending::default() };
        let bytes = ends.publish(&store(&layout, 3, values.clone()), &spending);
        assert!(bytes > 0 && bytes <= 200, "{bytes}");
        frames += 1;
        assert!(frames < 400, "it waits for ever");
    }
    assert!(frames > 1);
}

/// Half of what is seen leans along with a shadow's edge: exact at both ends, in a snapshot and in changes; what turns a little waits.
#[test]
fn leans_go_along_and_small_turns_wait() {
    let layout = floor(0, 40);
    let at = |edge: f32, turn: i8| {
        let positions = &layout.sets()[0].positions;
        let distance = |p: &[u32; 3]| (p[0] as f32 + 0.3 * p[2] as f32) / 8.0 - edge;
        let values: Vec<u8> = positions.iter().map(|p| quantized(0.5 + 0.1 * distance(p))).collect();
        let lean = |(p, value): (&[u32; 3], &u8)| {
            let steps = [(4.0 - distance(p).abs()).round() as i8, turn + (p[2] / 64) as i8];
            Lean(steps).of_value(*value)
        };
        let leans: Vec<Lean> = positions.iter().zip(&values).map(lean).collect();
        let lights = LightVisibility::new(&layout, 1, values).unwrap().with_leans(leans).unwrap();
        PointStore::new(layout.clone(), vec![255; layout.len()]).unwrap().with_lights(lights).unwrap()
    };
    let (mut ends, joined) = Ends::new(&at(10.0, -2));
    let without = Ends::new(&store(&layout, 1, at(10.0, -2).lights().unwrap().values().to_vec())).1;
    assert!(joined > without && joined < without + 400, "{joined}, {without} without leans");
    let leans = |ends: &Ends| ends.subscriber.lights().unwrap().leans().to_vec();
    assert_eq!(leans(&ends), at(10.0, -2).lights().unwrap().leans());
    // One step is not worth telling, two are; nothing else changes.
    assert_eq!(ends.publish(&at(10.0, -1), &Spending::default()), 0);
    let bytes = ends.publish(&at(10.0, 0), &Spending::default());
    assert!(bytes > 0);
    assert_eq!(leans(&ends), at(10.0, 0).lights().unwrap().leans());
    let changes = ends.subscriber.light_changes();
    assert!(changes.len() > 100 && changes.iter().all(|c| c.old == c.new && c.old_lean != c.new_lean));
    // What is sent of the shares has its lean with it; after all of it has been sent exactly, both ends are the same.
    for step in 1..=12 {
        ends.publish(&at(10.0 + step as f32, 0), &Spending::default());
        assert_eq!(ends.values(), at(10.0 + step as f32, 0).lights().unwrap().values());
        let off = |(held, wanted): (Lean, &Lean)| held.is_far_from(*wanted);
        assert!(!leans(&ends).into_iter().zip(at(10.0 + step as f32, 0).lights().unwrap().leans()).any(off));
    }
    // Light that does not matter need not turn, and a budget leaves turns for later.
    let all: Vec<(u32, u8)> = (0..1600).map(|index| (index, 255)).collect();
    let last = at(22.0, 3);
    assert_eq!(ends.publish(&last, &Spending { light_tolerances: &all, ..Spending::default() }), 0);
    let small = Spending { most_bytes: Some(60), ..Spending::default() };
    let mut frames = 0;
    while ends.publish(&last, &small) > 0 {
        frames += 1;
        assert!(frames < 500);
    }
    // Where turns do not fit, they are sent as soon as they do.
    assert!(ends.publish(&last, &Spending::default()) > 0 || frames > 0);
    assert_eq!(ends.publish(&last, &Spending::default()), 0);
    assert_eq!(ends.values(), last.lights().unwrap().values());
    let off = |(held, wanted): (Lean, &Lean)| held.is_far_from(*wanted);
    assert!(!leans(&ends).into_iter().zip(last.lights().unwrap().leans()).any(off));
    // Under a limit shares are still exact where they fit.
    let next = at(21.0, -4);
    let (mut twin, _) = Ends::new(&store(&layout, 1, last.lights().unwrap().values().to_vec()));
    let alone =
        twin.publish(&store(&layout, 1, next.lights().unwrap().values().to_vec()), &Spending::default());
    let room = Spending { most_bytes: Some(4 * alone + 200), ..Spending::default() };
    assert!(ends.publish(&next, &room) > 0);
    assert_eq!(ends.values(), next.lights().unwrap().values());
}
