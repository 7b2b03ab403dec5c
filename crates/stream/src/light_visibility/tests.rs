//! What was published is what arrives, and any bytes are survived.

use dapple_store::points::{PackedNormal, PointSet, morton_code};
use proptest::prelude::*;

use super::*;

/// Cells and normals of points.
type Points = Vec<([u32; 3], [u8; 2])>;

/// Sheets of points, in Morton order.
fn layout(sets: Vec<Vec<([u32; 3], [u8; 2])>>) -> Arc<PointLayout> {
    let set = |(instance, mut points): (usize, Points)| {
        points.sort_by_key(|&(position, normal)| (morton_code(position), normal));
        PointSet {
            instance: instance as u32,
            positions: points.iter().map(|point| point.0).collect(),
            normals: points.iter().map(|point| PackedNormal(point.1)).collect(),
            ..PointSet::default()
        }
    };
    Arc::new(PointLayout::new(1.0, 8.0, sets.into_iter().enumerate().map(set).collect()).unwrap())
}

/// A floor of `side` × `side` points.
fn floor(side: u32) -> Arc<PointLayout> {
    layout(vec![(0..side * side).map(|i| ([i % side * 8, 5, i / side * 8], [127, 127])).collect()])
}

fn points() -> impl Strategy<Value = Vec<([u32; 3], [u8; 2])>> {
    let normal = prop_oneof![Just([127, 127]), Just([127, 140]), any::<[u8; 2]>()];
    prop::collection::vec((prop::array::uniform3(0u32..60), normal), 0..200)
}

/// What happens to a value: it stays, is set, goes to an end.
fn steps() -> impl Strategy<Value = Vec<(u16, u8)>> {
    prop::collection::vec((any::<u16>(), prop_oneof![0u8..32, Just(0), Just(31)]), 0..80)
}

fn changed(values: &LightVisibility, layout: &PointLayout, steps: &[(u16, u8)]) -> LightVisibility {
    let mut list = values.values().to_vec();
    for &(at, new) in steps {
        let count = list.len();
        if count > 0 {
            // Runs, as shadows make them.
            let at = usize::from(at) % count;
            list[at..(at + usize::from(new)).min(count)].fill(new);
        }
    }
    LightVisibility::new(layout, values.lights(), list).unwrap()
}

proptest! {
    #[test]
    fn snapshot_and_deltas_give_what_was_published(
        sets in prop::collection::vec(points(), 0..3),
        lights in 0u32..5,
        first in steps(),
        later in prop::collection::vec((steps(), 0u8..6), 0..5),
    ) {
        let layout = layout(sets);
        let open = LightVisibility::open(&layout, lights).unwrap();
        let mut values = changed(&open, &layout, &first);
        let mut publisher = LightPublisher::new(layout.clone(), values.clone()).unwrap();
        let join = |publisher: &LightPublisher| {
            LightSubscriber::join(layout.clone(), &publisher.snapshot(), &LightLimits::default()).unwrap()
        };
        let mut subscriber = join(&publisher);
        prop_assert_eq!(subscriber.visibility(), &values);
        for (steps, tolerance) in later {
            values = changed(&values, &layout, &steps);
            let before = subscriber.visibility().clone();
            let body = publisher.delta(&values, &vec![tolerance; values.values().len()]).unwrap();
            let changes = subscriber.apply(&body).unwrap();
            prop_assert_eq!(changes.is_empty(), body.is_empty());
            let held = subscriber.visibility();
            prop_assert_eq!(held, publisher.sent());
            prop_assert_eq!(held.hash(), publisher.sent().hash());
            for (index, (held, new)) in held.values().iter().zip(values.values()).enumerate() {
                let old = before.values()[index];
                let expected = if old.abs_diff(*new) > tolerance { *new } else { old };
                prop_assert_eq!(*held, expected);
                let told = changes.iter().find(|change| change.index as usize == index);
                prop_assert_eq!(told.map(|change| change.new), (old != *held).then_some(*held));
            }
            let late = join(&publisher);
            prop_assert_eq!(late.visibility(), held);
        }
        // Whoever asks for no error gets none.
        let body = publisher.delta(&values, &[]).unwrap();
        subscriber.apply(&body).unwrap();
        prop_assert_eq!(subscriber.visibility(), &values);
        prop_assert_eq!(publisher.delta(&values, &[]).unwrap().len(), 0);
    }

    #[test]
    fn any_bytes_are_taken_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..80), lights in 0u8..6) {
        let layout = floor(13);
        let limits = LightLimits { max_lights: 64, max_values: 1 << 14 };
        let framed = [&[lights, 3], &bytes[..]].concat();
        for body in [&bytes, &framed] {
            if let Ok(joined) = LightSubscriber::join(layout.clone(), body, &limits) {
                prop_assert!(joined.visibility().values().iter().all(|value| *value <= OPEN));
            }
        }
        let start = LightVisibility::open(&layout, 3).unwrap();
        let publisher = LightPublisher::new(layout.clone(), start.clone()).unwrap();
        let mut subscriber = LightSubscriber::join(layout.clone(), &publisher.snapshot(), &limits).unwrap();
        match subscriber.apply(&bytes) {
            Err(_) => prop_assert_eq!(subscriber.visibility(), &start),
            Ok(changes) => {
                let mut expected = start.clone();
                expected.apply(&changes).unwrap();
                prop_assert_eq!(subscriber.visibility(), &expected);
            }
        }
    }

    #[test]
    fn a_body_that_was_cut_or_lengthened_is_refused(steps in steps(), cut in 1usize..40) {
        let layout = floor(20);
        let values = changed(&LightVisibility::open(&layout, 2).unwrap(), &layout, &steps);
        let mut publisher = LightPublisher::new(layout.clone(), LightVisibility::open(&layout, 2).unwrap()).unwrap();
        let snapshot = publisher.snapshot();
        let limits = LightLimits::default();
        let mut subscriber = LightSubscriber::join(layout.clone(), &snapshot, &limits).unwrap();
        let longer = [&snapshot[..], &[0; 7]].concat();
        prop_assert!(LightSubscriber::join(layout.clone(), &longer, &limits).is_err());
        let body = publisher.delta(&values, &[]).unwrap();
        if body.len() > cut + 4 {
            // A reader may be four bytes ahead; what is cut by more is missed, or says something else.
            let short = subscriber.apply(&body[..body.len() - cut - 4]);
            prop_assert!(short.is_err() || subscriber.visibility() != &values);
        }
        let mut subscriber = LightSubscriber::join(layout, &snapshot, &limits).unwrap();
        if !body.is_empty() {
            prop_assert!(subscriber.apply(&[&body[..], &[0; 7]].concat()).is_err());
            prop_assert_eq!(subscriber.visibility(), &LightVisibility::open(&subscriber.layout, 2).unwrap());
        }
    }
}

#[test]
fn nothing_changed_is_nothing_sent() {
    let layout = floor(30);
    let values = LightVisibility::open(&layout, 7).unwrap();
    let mut publisher = LightPublisher::new(layout.clone(), values.clone()).unwrap();
    assert_eq!(publisher.delta(&values, &[]).unwrap(), []);
    // Small changes wait, until they are large in sum.
    let dimmer = |by: u8| LightVisibility::new(&layout, 7, vec![OPEN - by; 7 * 900]).unwrap();
    assert_eq!(publisher.delta(&dimmer(2), &[3; 6300]).unwrap(), []);
    assert_eq!(publisher.delta(&dimmer(3), &[3; 6300]).unwrap(), []);
    assert!(!publisher.delta(&dimmer(4), &[3; 6300]).unwrap().is_empty());
    assert_eq!(publisher.sent(), &dimmer(4));
}

#[test]
fn limits_are_kept_and_values_of_others_are_refused() {
    let layout = floor(10);
    let values = LightVisibility::open(&layout, 4).unwrap();
    let mut publisher = LightPublisher::new(layout.clone(), values.clone()).unwrap();
    let body = publisher.snapshot();
    let join = |max_lights, max_values| {
        LightSubscriber::join(layout.clone(), &body, &LightLimits { max_lights, max_values })
    };
    assert!(matches!(join(3, 400), Err(DecodeError::TooLarge { what: "lights", value: 4, limit: 3 })));
    assert!(matches!(join(4, 399), Err(DecodeError::TooLarge { value: 400, .. })));
    assert_eq!(join(4, 400).unwrap().visibility(), &values);
    let more = LightVisibility::open(&layout, 5).unwrap();
    assert!(publisher.delta(&more, &[]).is_err());
    assert!(LightPublisher::new(floor(9), values).is_err());
}

/// A shadow's straight edge that passes over a floor: the cost of a point that it passes.
#[test]
fn an_edge_that_passes_costs_few_bits() {
    let layout = floor(100);
    let at = |edge: f32| {
        let value = |position: &[u32; 3]| {
            let distance = (position[0] as f32 + 0.3 * position[2] as f32) / 8.0 - edge;
            dapple_store::light_visibility::quantized(0.5 + 0.4 * distance)
        };
        let values = layout.sets()[0].positions.iter().map(value).collect();
        LightVisibility::new(&layout, 1, values).unwrap()
    };
    let mut publisher = LightPublisher::new(layout.clone(), at(20.0)).unwrap();
    let joined = publisher.snapshot().len();
    assert!(joined < 700, "{joined} bytes for 10,000 points");
    let (mut bytes, mut changes) = (0, 0);
    let mut subscriber =
        LightSubscriber::join(layout.clone(), &publisher.snapshot(), &LightLimits::default()).unwrap();
    for step in 1..=40 {
        let body = publisher.delta(&at(20.0 + 0.9 * step as f32), &[2; 10_000]).unwrap();
        bytes += body.len();
        changes += subscriber.apply(&body).unwrap().len();
    }
    let bits = 8.0 * bytes as f64 / changes as f64;
    println!("join {joined} bytes; {changes} changes of {bits:.2} bits");
    assert!(bits < 7.0, "{bits} bits a change");
}
