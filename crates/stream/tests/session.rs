//! Whatever is published, and however frames are lost, doubled or swapped: who listens ends up with the same store.

#![allow(clippy::unwrap_used, reason = "in a test, a failed unwrap is a failure like any other")]

mod common;
#[path = "common/random.rs"]
mod random;

use common::same_bits;
use dapple_store::charts::{Cuts, SetCuts, SiteCut};
use dapple_store::light_visibility::{Lean, LightChange, LightVisibility, OPEN};
use dapple_store::points::{BentChange, BentNormal, Change, PointLayout, PointStore};
use dapple_stream::{
    Applied, Frame, FrameKind, IgnoreReason, Limits, Precision, Publisher, PublisherConfig, ReceiveError,
    Subscriber,
};
use proptest::prelude::*;
use random::stores;

const SCENE: [u8; 32] = [7; 32];

fn subscriber() -> Subscriber {
    Subscriber::new(Some(SCENE), Limits::default())
}

/// What happens at an epoch.
#[derive(Clone, Debug)]
enum Step {
    /// Some values change (places and new values; perhaps to what they were).
    Change(Vec<(prop::sample::Index, u8)>),
    /// Nothing changes.
    Still,
    /// Another layout.
    Layout(PointStore),
    /// Sets of the pool at these places come, or go if they are there; and some values change.
    Sets(Vec<prop::sample::Index>, Vec<(prop::sample::Index, u8)>),
    /// The publisher is asked for a new group.
    Group,
}

fn steps() -> impl Strategy<Value = Vec<Step>> {
    let change = prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..40);
    let sets = (prop::collection::vec(any::<prop::sample::Index>(), 1..4), change.clone());
    prop::collection::vec(
        prop_oneof![
            8 => change.prop_map(Step::Change),
            2 => Just(Step::Still),
            1 => stores().prop_map(Step::Layout),
            3 => sets.prop_map(|(places, changes)| Step::Sets(places, changes)),
            1 => Just(Step::Group),
        ],
        0..25,
    )
}

/// All that a run of a publisher shows: what it says that subscribers hold after each step, its frames, and what a joiner would be given.
struct Run {
    states: Vec<PointStore>,
    frames: Vec<Vec<Frame>>,
    joins: Vec<Frame>,
    /// Frames that say which sets come and go.
    sets: usize,
}

fn change(store: &mut PointStore, changes: &[(prop::sample::Index, u8)]) {
    let points = store.visibility().len();
    let change = |(at, value): &(prop::sample::Index, u8)| Change {
        point: if points == 0 { 0 } else { at.index(points) as u32 },
        visibility: *value,
    };
    let changes: Vec<Change> = changes.iter().map(change).take(points).collect();
    store.apply(&changes).unwrap();
    let bend = |change: &Change| {
        let old = store.bent_of(change.point as usize)?;
        let new = BentNormal([old.0[0].wrapping_add(change.visibility % 3), change.visibility]);
        Some(BentChange { point: change.point, old, new })
    };
    let bent: Vec<BentChange> = changes.iter().filter_map(bend).collect();
    store.apply_bent(&bent).unwrap();
    if let Some(lights) = store.lights().filter(|lights| !lights.values().is_empty()) {
        let values = lights.values().len();
        let dim = |change: &Change| {
            let index = change.point as usize * 7 % values;
            let new = change.visibility % (OPEN + 1);
            let new_lean = Lean([(change.visibility % 9) as i8 - 4, 2]).of_value(new);
            let (old, old_lean) = (lights.values()[index], lights.lean(index));
            let new_lean = if lights.has_leans() { new_lean } else { Lean::NONE };
            LightChange { index: index as u32, old, new, old_lean, new_lean }
        };
        let dimmed: Vec<LightChange> = changes.iter().map(dim).collect();
        store.apply_lights(&dimmed).unwrap();
    }
}

/// Lets sets go that are there, and others come: of each instance always the same points, with values by their number.
fn toggle(store: &mut PointStore, places: &[prop::sample::Index]) {
    for place in places {
        let instance = 7 * place.index(9) as u32;
        let quantum = store.layout().quantum_m();
        let held = store.layout().set_of_instance(instance).is_some();
        let count = instance * 3 % 50;
        let points =
            (0..count).map(|i| ([i * i % 90, i, instance], [127, (instance + i / 9) as u8])).collect();
        let sets = vec![common::set(instance, [instance as f32, 0.0, -0.0], points)];
        let added = PointLayout::new(quantum, store.layout().spacing_m(), sets).unwrap();
        let values = (0..count).map(|i| (255 - i) as u8).collect();
        let added = PointStore::new(added.into(), values).unwrap();
        *store = match held {
            true => store.with_sets(&[instance], &PointStore::default()).unwrap(),
            false => store.with_sets(&[], &added).unwrap(),
        };
    }
}

/// Cuts of every third instance, and of none of the others.
fn cuts_of(layout: &PointLayout) -> Cuts {
    let instances = layout.sets().iter().map(|set| set.instance).filter(|i| i % 3 == 0);
    let cuts = |instance: u32| vec![SiteCut { site: instance % 5, mask: 1 + (instance % 9) as u16 }];
    let set = |instance| SetCuts { instance, sites: 5, fingerprint: !instance, cuts: cuts(instance) };
    Cuts::new(instances.map(set).collect()).unwrap()
}

fn run(start: &PointStore, steps: &[Step], config: PublisherConfig) -> Run {
    let mut publisher = Publisher::new(SCENE, config);
    assert!(publisher.join().is_none());
    let mut store = start.clone();
    let mut run = Run { states: Vec::new(), frames: Vec::new(), joins: Vec::new(), sets: 0 };
    for (index, step) in std::iter::once(&Step::Still).chain(steps).enumerate() {
        let mut frames = Vec::new();
        match step {
            Step::Change(changes) => change(&mut store, changes),
            Step::Sets(places, changes) => {
                toggle(&mut store, places);
                change(&mut store, changes);
                publisher.set_cuts(store.layout().clone(), cuts_of(store.layout()));
            }
            Step::Layout(other) => store = other.clone(),
            Step::Group => frames.extend(publisher.start_group()),
            Step::Still => {}
        }
        frames.extend(publisher.publish(&store));
        if matches!(step, Step::Still) && index > 0 {
            assert!(frames.is_empty(), "a still scene sends nothing");
        }
        let held = publisher.store().expect("something is published");
        let tolerance = config.precision.tolerance;
        assert!(held.visibility().iter().zip(store.visibility()).all(|(a, b)| a.abs_diff(*b) <= tolerance));
        let planes = held.bent().into_iter().flatten().zip(store.bent().into_iter().flatten());
        let within = |a: &[u8], b: &[u8], most| a.iter().zip(b).all(|(a, b)| a.abs_diff(*b) <= most);
        let bent_tolerance = config.bent_precision.tolerance;
        assert!(planes.into_iter().all(|(a, b)| within(a, b, bent_tolerance)));
        assert_eq!(held.light_count(), store.light_count());
        if let (Some(held), Some(traced)) = (held.lights(), store.lights()) {
            assert_eq!(held.values(), traced.values(), "without tolerances lights are exact");
            assert_eq!(held.has_leans(), traced.has_leans());
            let mut leans = held.leans().iter().zip(traced.leans());
            assert!(leans.all(|(held, traced)| !held.is_far_from(*traced)), "a step of a lean may wait");
        }
        let leans = |store: &PointStore| store.lights().is_some_and(LightVisibility::has_leans);
        assert!(tolerance > 0 || bent_tolerance > 0 || leans(held) || same_bits(held, &store));
        run.states.push(held.clone());
        run.sets += frames.iter().filter(|frame| frame.kind == FrameKind::Sets).count();
        run.frames.push(frames);
        run.joins.push(publisher.join().expect("something is published"));
    }
    run
}

fn config() -> impl Strategy<Value = PublisherConfig> {
    let precision = prop_oneof![Just((0u8, 0u8)), Just((4, 0)), (0u8..=127, any::<u8>())];
    let precision = precision.prop_map(|(tolerance, step)| Precision { tolerance, step });
    let precisions = (precision.clone(), precision);
    (prop_oneof![Just(0u64), 1u64 << 40..1 << 41], 0u32..5, precisions).prop_map(
        |(first_group, deltas_per_group, (precision, bent_precision))| PublisherConfig {
            first_group,
            deltas_per_group,
            precision,
            bent_precision,
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn whoever_joins_at_any_epoch_follows_bit_for_bit(
        start in stores(), steps in steps(), config in config(), at: prop::sample::Index,
    ) {
        let run = run(&start, &steps, config);
        let at = at.index(run.states.len());
        let mut late = subscriber();
        late.receive(&run.joins[at].bytes).unwrap();
        prop_assert!(same_bits(late.store().unwrap(), &run.states[at]));
        for (state, frames) in run.states.iter().zip(&run.frames).skip(at + 1) {
            for frame in frames {
                let before = late.store().unwrap().clone();
                let applied = late.receive(&frame.bytes).unwrap();
                prop_assert_eq!((late.group(), late.epoch()), (Some(frame.group), Some(frame.epoch)));
                let redone = match applied {
                    Applied::Sets { removed, added, changes } => {
                        // What came, with its values; what stays is redone from what was.
                        let now = late.store().unwrap();
                        let came = now.layout().only(&added);
                        let came = PointStore::default().carried(came.into(), now);
                        Some((before.with_sets(&removed, &came).unwrap(), changes))
                    }
                    Applied::Changes(changes) => Some((before, changes)),
                    _ => None,
                };
                if let Some((mut redone, changes)) = redone {
                    for change in &changes {
                        prop_assert_eq!(redone.visibility()[change.point as usize], change.old);
                        prop_assert_ne!(change.old, change.new);
                    }
                    let news: Vec<Change> =
                        changes.iter().map(|c| Change { point: c.point, visibility: c.new }).collect();
                    redone.apply(&news).unwrap();
                    for change in late.bent_changes() {
                        prop_assert_eq!(redone.bent_of(change.point as usize), Some(change.old));
                        prop_assert_ne!(change.old, change.new);
                    }
                    redone.apply_bent(late.bent_changes()).unwrap();
                    for change in late.light_changes() {
                        let (held, index) = (redone.lights().unwrap(), change.index as usize);
                        prop_assert_eq!((held.values()[index], held.lean(index)), (change.old, change.old_lean));
                        prop_assert_ne!((change.old, change.old_lean), (change.new, change.new_lean));
                    }
                    redone.apply_lights(late.light_changes()).unwrap();
                    prop_assert!(same_bits(&redone, late.store().unwrap()));
                }
            }
            prop_assert!(same_bits(late.store().unwrap(), state));
        }
        let mut joiner = subscriber();
        joiner.receive(&run.joins.last().unwrap().bytes).unwrap();
        prop_assert_eq!(late.cuts(), joiner.cuts());
        prop_assert_eq!(late.epoch(), Some(run.joins.last().unwrap().epoch));
    }

    #[test]
    fn every_group_alone_leads_to_its_last_state(
        start in stores(), steps in steps(), config in config(),
    ) {
        let run = run(&start, &steps, config);
        let mut subscriber_of_group = None;
        for (state, frames) in run.states.iter().zip(&run.frames) {
            for frame in frames {
                if frame.kind == FrameKind::Snapshot {
                    subscriber_of_group = Some((frame.group, subscriber()));
                }
                let (group, subscriber) = subscriber_of_group.as_mut().expect("the first frame is a snapshot");
                prop_assert_eq!(*group, frame.group);
                subscriber.receive(&frame.bytes).unwrap();
            }
            prop_assert!(same_bits(subscriber_of_group.as_ref().unwrap().1.store().unwrap(), state));
        }
        if config.deltas_per_group > 0 {
            let mut deltas = 0;
            for frame in run.frames.iter().flatten() {
                deltas = if frame.kind == FrameKind::Snapshot { 0 } else { deltas + 1 };
                prop_assert!(deltas <= config.deltas_per_group);
            }
        }
    }

    #[test]
    fn loss_doubling_and_swapping_converge_after_a_rejoin(
        start in stores(), steps in steps(), config in config(),
        fates in prop::collection::vec((0u8..4, any::<prop::sample::Index>()), 60),
    ) {
        let run = run(&start, &steps, config);
        let mut line: Vec<Frame> = run.frames.iter().flatten().cloned().collect();
        for (index, (fate, other)) in fates.iter().enumerate().take(line.len()) {
            let other = other.index(line.len());
            match fate {
                0 => line.swap(index, other),
                1 => line[index] = line[other].clone(),
                _ => {}
            }
        }
        let mut lossy = subscriber();
        for frame in &line {
            let before = lossy.clone();
            match lossy.receive(&frame.bytes) {
                Ok(Applied::Ignored(reason)) => {
                    let held = (before.group().unwrap(), before.epoch().unwrap());
                    let expected = if frame.group < held.0 {
                        IgnoreReason::OlderGroup
                    } else if frame.epoch < held.1 {
                        IgnoreReason::OldEpoch
                    } else {
                        IgnoreReason::Duplicate
                    };
                    prop_assert_eq!(reason, expected);
                    prop_assert!(before.store() == lossy.store());
                }
                Ok(_) => prop_assert_eq!((lossy.group(), lossy.epoch()), (Some(frame.group), Some(frame.epoch))),
                Err(error) => {
                    let gap = matches!(error, ReceiveError::NeedSnapshot { group, .. } if group == frame.group);
                    prop_assert!(gap && error.snapshot_helps(), "{}", error);
                    prop_assert!(before.store() == lossy.store() && before.epoch() == lossy.epoch());
                }
            }
            // Whatever it holds is a state that was published.
            if let Some(store) = lossy.store() {
                prop_assert!(run.states.iter().any(|state| same_bits(state, store)));
            }
        }
        lossy.receive(&run.joins.last().unwrap().bytes).unwrap();
        prop_assert!(same_bits(lossy.store().unwrap(), run.states.last().unwrap()));
        for frame in run.frames.iter().flatten() {
            let applied = lossy.receive(&frame.bytes).unwrap();
            prop_assert!(matches!(applied, Applied::Ignored(_)));
        }
    }

    #[test]
    fn sets_that_share_a_layout_are_told_by_what_differs(
        start in stores(), sets in prop::collection::vec(any::<prop::sample::Index>(), 1..4), config in config(),
    ) {
        let config = PublisherConfig { deltas_per_group: 0, ..config };
        let steps = [Step::Sets(sets, Vec::new())];
        let run = run(&start, &steps, config);
        let (old, new) = (run.states[0].layout(), run.states[1].layout());
        let stays = |set: &dapple_store::points::PointSet| {
            !set.is_empty() && old.set_of_instance(set.instance).is_some_and(|other| other.len() == set.len())
        };
        let expected = usize::from(old != new && new.sets().iter().any(stays));
        prop_assert_eq!(run.sets, expected);
    }

    #[test]
    fn the_same_history_gives_the_same_bytes(start in stores(), steps in steps(), config in config()) {
        let (a, b) = (run(&start, &steps, config), run(&start, &steps, config));
        prop_assert_eq!(a.frames, b.frames);
        prop_assert_eq!(a.joins, b.joins);
    }
}

fn small() -> PointStore {
    let layout = dapple_store::points::PointLayout::new(
        0.01,
        0.32,
        vec![common::set(3, [1.0, 2.0, 3.0], (0..100).map(|i| ([i, 0, i * i], [127, 254])).collect())],
    )
    .unwrap();
    PointStore::new(layout.into(), vec![200; 100]).unwrap()
}

#[test]
fn a_delta_of_one_change_is_tens_of_bytes() {
    let mut store = small();
    let mut publisher =
        Publisher::new(SCENE, PublisherConfig { first_group: 1_795_000_000_000, ..Default::default() });
    publisher.publish(&store);
    store.apply(&[Change { point: 42, visibility: 17 }]).unwrap();
    let frame = publisher.publish(&store).unwrap();
    assert!(frame.bytes.len() <= 26, "{} bytes", frame.bytes.len());
    assert!(publisher.publish(&store).is_none());
}

#[test]
fn a_gap_is_named_and_a_new_group_of_the_same_layout_is_only_changes() {
    let mut store = small();
    let mut publisher = Publisher::new(SCENE, PublisherConfig { first_group: 5, ..Default::default() });
    let mut receiver = subscriber();
    let first = publisher.publish(&store).unwrap();
    store.apply(&[Change { point: 0, visibility: 1 }]).unwrap();
    let second = publisher.publish(&store).unwrap();
    assert_eq!(
        receiver.receive(&second.bytes),
        Err(ReceiveError::NeedSnapshot { group: 5, base_epoch: 0, held: None })
    );
    store.apply(&[Change { point: 0, visibility: 2 }]).unwrap();
    let mut still = store.clone();
    still.apply(&[Change { point: 0, visibility: 1 }]).unwrap();
    assert!(publisher.publish(&still).is_none(), "epoch 2 is silent");
    let third = publisher.publish(&store).unwrap();
    assert_eq!(receiver.receive(&first.bytes), Ok(Applied::NewLayout));
    let error = receiver.receive(&third.bytes).unwrap_err();
    assert_eq!(error, ReceiveError::NeedSnapshot { group: 5, base_epoch: 1, held: Some((5, 0)) });
    assert!(error.to_string().contains("group 5, epoch 0"), "{error}");
    let layout = receiver.store().unwrap().layout().clone();
    let again = publisher.start_group().unwrap();
    assert_eq!((again.group, again.epoch), (6, 3));
    let changes = vec![dapple_stream::ValueChange { point: 0, old: 200, new: 2 }];
    assert_eq!(receiver.receive(&again.bytes), Ok(Applied::Changes(changes)));
    assert!(std::sync::Arc::ptr_eq(&layout, receiver.store().unwrap().layout()));
    assert_eq!(receiver.receive(&third.bytes), Ok(Applied::Ignored(IgnoreReason::OlderGroup)));
}

#[test]
fn another_scene_is_refused() {
    let store = small();
    let mut publisher = Publisher::new([9; 32], PublisherConfig::default());
    let frame = publisher.publish(&store).unwrap();
    let error = subscriber().receive(&frame.bytes).unwrap_err();
    assert_eq!(error, ReceiveError::WrongScene { expected: SCENE, found: [9; 32] });
    assert!(!error.snapshot_helps());
    let mut any = Subscriber::new(None, Limits::default());
    any.receive(&frame.bytes).unwrap();
    assert_eq!(any.scene_hash(), Some([9; 32]));
}

#[test]
fn sets_that_come_and_go_are_a_small_frame_and_what_stays_is_kept() {
    let big = |instance: u32| {
        let points = (0..3000).map(|i| ([i % 60 * 30, i / 60 * 29, instance], [127, 254])).collect();
        common::set(instance, [0.0; 3], points)
    };
    let little = || common::set(4, [1.0; 3], (0..90).map(|i| ([i * 9, 7, i], [9, 140])).collect());
    let store = |sets: Vec<_>, value| {
        let layout = PointLayout::new(0.002, 0.064, sets).unwrap();
        let values = vec![value; layout.len()];
        PointStore::new(layout.into(), values).unwrap()
    };
    let mut publisher = Publisher::new(SCENE, PublisherConfig::default());
    let mut live = subscriber();
    let first = publisher.publish(&store(vec![big(1), big(2)], 200)).unwrap();
    live.receive(&first.bytes).unwrap();
    // A set comes, another goes, and one point of the third changes.
    let mut next = store(vec![big(2), little()], 200);
    next.apply(&[Change { point: 5, visibility: 9 }]).unwrap();
    let frame = publisher.publish(&next).unwrap();
    assert_eq!((frame.kind, frame.group, frame.epoch), (FrameKind::Sets, first.group, 1));
    assert!(
        frame.bytes.len() < 600 && first.bytes.len() > 3000,
        "{}, {}",
        frame.bytes.len(),
        first.bytes.len()
    );
    assert_eq!(publisher.changed(), 91);
    let changes = vec![dapple_stream::ValueChange { point: 5, old: 200, new: 9 }];
    let expected = Applied::Sets { removed: vec![1], added: vec![4], changes };
    assert_eq!(live.receive(&frame.bytes), Ok(expected));
    assert!(same_bits(live.store().unwrap(), &next));
    // The present snapshot brings who saw nothing of it to the same store, and tells what of the old one stays.
    let mut late = subscriber();
    late.receive(&first.bytes).unwrap();
    let joined = late.receive(&publisher.join().unwrap().bytes).unwrap();
    assert!(matches!(joined, Applied::Sets { removed, added, .. } if removed == [1] && added == [4]));
    assert!(same_bits(late.store().unwrap(), &next));
    // A new group of the same layout is only changes to who followed.
    let layout = live.store().unwrap().layout().clone();
    let again = publisher.start_group().unwrap();
    assert_eq!(live.receive(&again.bytes), Ok(Applied::Changes(vec![])));
    assert!(std::sync::Arc::ptr_eq(&layout, live.store().unwrap().layout()));
    // Nothing in common: a snapshot, as ever.
    assert_eq!(publisher.publish(&store(vec![big(9)], 1)).unwrap().kind, FrameKind::Snapshot);
}

/// What a store has without its bent normals.
fn unbent(store: &PointStore) -> PointStore {
    PointStore::new(store.layout().clone(), store.visibility().to_vec()).unwrap()
}

#[test]
fn bent_normals_come_and_go_with_a_new_group_and_change_no_visibility() {
    let plain = small();
    let bent = plain.clone().with_bent([(0..100).collect(), vec![128; 100]]).unwrap();
    let mut publisher = Publisher::new(SCENE, PublisherConfig::default());
    let mut receiver = subscriber();
    for (group, store) in [&plain, &bent, &plain].into_iter().enumerate() {
        let frame = publisher.publish(store).unwrap();
        assert_eq!((frame.kind, frame.group), (FrameKind::Snapshot, group as u64));
        assert_eq!(receiver.receive(&frame.bytes), Ok(Applied::NewLayout));
        assert!(same_bits(receiver.store().unwrap(), store));
        assert!(publisher.publish(store).is_none(), "a still scene sends nothing");
    }
}

#[test]
fn a_delta_of_bent_normals_alone_changes_them_alone() {
    let mut store = small().with_bent([vec![128; 100], vec![128; 100]]).unwrap();
    let mut publisher = Publisher::new(SCENE, PublisherConfig::default());
    let mut receiver = subscriber();
    receiver.receive(&publisher.publish(&store).unwrap().bytes).unwrap();
    let change = BentChange { point: 7, old: BentNormal::UNBENT, new: BentNormal([128, 90]) };
    store.apply_bent(&[change]).unwrap();
    let frame = publisher.publish(&store).unwrap();
    assert!(frame.bytes.len() <= 26, "{} bytes", frame.bytes.len());
    assert_eq!(publisher.changed(), 0);
    assert_eq!(receiver.receive(&frame.bytes), Ok(Applied::Changes(Vec::new())));
    assert_eq!(receiver.bent_changes(), [change]);
    assert_eq!(unbent(receiver.store().unwrap()), small());
    // Heard once is enough.
    assert!(matches!(receiver.receive(&frame.bytes), Ok(Applied::Ignored(_))));
    assert_eq!(receiver.bent_changes(), []);
}

#[test]
fn bent_normals_have_a_tolerance_of_their_own() {
    let mut store = small().with_bent([vec![128; 100], vec![128; 100]]).unwrap();
    let bent_precision = Precision { tolerance: 6, step: 0 };
    let mut publisher = Publisher::new(SCENE, PublisherConfig { bent_precision, ..Default::default() });
    publisher.publish(&store).unwrap();
    let mut bend = |byte: u8| {
        let old = store.bent_of(3).unwrap();
        store.apply_bent(&[BentChange { point: 3, old, new: BentNormal([byte, 128]) }]).unwrap();
        publisher.publish(&store)
    };
    assert!(bend(134).is_none());
    assert!(bend(135).is_some());
}
