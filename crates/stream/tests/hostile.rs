//! Bytes that are no frames, or wrong ones under a right checksum: always a named error, never a panic or a change.

#![allow(clippy::unwrap_used, reason = "in a test, a failed unwrap is a failure like any other")]

#[path = "common/cloud.rs"]
mod cloud;

use std::sync::LazyLock;

use dapple_store::charts::{Cuts, SetCuts, SiteCut};
use dapple_store::light_visibility::{Lean, LightVisibility};
use dapple_store::points::{Change, PackedNormal, PointLayout, PointSet, PointStore};
use dapple_stream::codec::seal;
use dapple_stream::{
    Applied, DecodeError, FrameHeader, FrameKind, Limits, Publisher, PublisherConfig, ReceiveError,
    Subscriber,
};
use proptest::prelude::*;

/// A store large enough for compressed sections, its snapshot (epoch 10), and the delta to a later state (epoch 12).
static SAMPLE: LazyLock<(PointStore, Vec<u8>, Vec<u8>)> = LazyLock::new(|| {
    let store = cloud::hall(3, 3000);
    let mut publisher = Publisher::new([1; 32], PublisherConfig::default());
    publisher.set_cuts(store.layout().clone(), cuts());
    for seed in 0..10 {
        publisher.publish(&cloud::moved(&store, seed, 0.01));
    }
    publisher.publish(&store);
    let snapshot = publisher.join().unwrap();
    assert!(publisher.publish(&store).is_none());
    let delta = publisher.publish(&cloud::moved(&store, 4, 0.1)).unwrap();
    (store, snapshot.bytes.to_vec(), delta.bytes.to_vec())
});

/// A change of sets to epoch 13, after the delta of the sample: one goes and comes back otherwise, and one comes; with
/// cuts and with values that change.
static SETS: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let mut publisher = Publisher::new([1; 32], PublisherConfig::default());
    publisher.set_cuts(SAMPLE.0.layout().clone(), cuts());
    let now = cloud::moved(&SAMPLE.0, 4, 0.1);
    (0..13).for_each(|epoch| drop(publisher.publish(if epoch < 12 { &SAMPLE.0 } else { &now })));
    assert_eq!(now.layout().sets().len(), 2);
    let gone = [1];
    let mut sets = vec![now.layout().sets()[1].clone(), now.layout().sets()[1].clone()];
    sets[0].origin_rest.x += 1.0;
    sets[1].instance = 900;
    let added = PointLayout::new(now.layout().quantum_m(), now.layout().spacing_m(), sets).unwrap();
    let values = (0..added.len()).map(|i| i as u8).collect();
    let mut next = now.with_sets(&gone, &PointStore::new(added.into(), values).unwrap()).unwrap();
    let came = SetCuts { instance: 900, sites: 9, fingerprint: 4, cuts: vec![SiteCut { site: 8, mask: 3 }] };
    publisher.set_cuts(next.layout().clone(), Cuts::new(vec![came]).unwrap());
    let change = |point| Change { point, visibility: next.visibility()[point as usize] ^ 0x40 };
    let changes: Vec<Change> = (30..90).map(change).collect();
    next.apply(&changes).unwrap();
    publisher.publish(&next).unwrap().bytes.to_vec()
});

/// The sample with bent normals and two lights with leans: its snapshot (epoch 0), the delta to a later state (1), and a change of sets (2).
static BENT: LazyLock<[Vec<u8>; 3]> = LazyLock::new(|| {
    let bent = |store: PointStore| {
        let plane = |turn: u8| store.visibility().iter().map(|v| v.rotate_left(turn.into())).collect();
        let planes = [plane(1), plane(3)];
        let values = (0..2).flat_map(|light| store.visibility().iter().map(move |v| v >> (3 + light)));
        let values: Vec<u8> = values.collect();
        let leans = values.iter().map(|value| Lean([(value % 9) as i8 - 4, 1]).of_value(*value)).collect();
        let lights = LightVisibility::new(store.layout(), 2, values).unwrap().with_leans(leans).unwrap();
        store.with_bent(planes).unwrap().with_lights(lights).unwrap()
    };
    let store = cloud::hall(3, 3000);
    let mut publisher = Publisher::new([1; 32], PublisherConfig::default());
    let mut frame = |store: &PointStore| publisher.publish(store).unwrap().bytes.to_vec();
    let moved = bent(cloud::moved(&store, 4, 0.1));
    let mut set = store.layout().sets()[1].clone();
    set.instance = 900;
    let added = PointLayout::new(store.layout().quantum_m(), store.layout().spacing_m(), vec![set]).unwrap();
    let values = (0..added.len()).map(|i| i as u8).collect();
    let added = bent(PointStore::new(added.into(), values).unwrap());
    [frame(&bent(store)), frame(&moved), frame(&moved.with_sets(&[], &added).unwrap())]
});

/// Holds the sample with bent normals after so many of its frames.
fn bent(frames: usize) -> Subscriber {
    static HOLDING: LazyLock<[Subscriber; 3]> = LazyLock::new(|| {
        [0, 1, 2].map(|frames| {
            let mut subscriber = Subscriber::new(None, Limits::default());
            BENT[..frames].iter().for_each(|frame| drop(subscriber.receive(frame).unwrap()));
            subscriber
        })
    });
    HOLDING[frames].clone()
}

/// Enough cuts in two sets that their sections are compressed.
fn cuts() -> Cuts {
    let set = |instance, count: u32| {
        let cut = |i| SiteCut { site: i * 3 + i % 2, mask: 1u16 << (i % 16) | 1 };
        SetCuts { instance, sites: 3 * count + 1, fingerprint: 77, cuts: (0..count).map(cut).collect() }
    };
    Cuts::new(vec![set(0, 500), set(2, 100)]).unwrap()
}

fn payload(frame: &[u8]) -> Vec<u8> {
    let header = FrameHeader::parse(frame, &Limits::default()).unwrap();
    frame[header.header_bytes..][..header.payload_bytes].to_vec()
}

fn holding() -> Subscriber {
    let mut subscriber = Subscriber::new(None, Limits::default());
    subscriber.receive(&SAMPLE.1).unwrap();
    subscriber
}

/// Holds the sample after its delta.
fn further() -> Subscriber {
    let mut subscriber = holding();
    subscriber.receive(&SAMPLE.2).unwrap();
    subscriber
}

/// Receives; on an error nothing may have changed.
fn receive(subscriber: &mut Subscriber, bytes: &[u8]) -> Result<Applied, ReceiveError> {
    let before = subscriber.clone();
    let result = subscriber.receive(bytes);
    if !matches!(result, Ok(Applied::NewLayout | Applied::Changes(_) | Applied::Sets { .. })) {
        assert!(before.store() == subscriber.store());
        assert_eq!((before.group(), before.epoch()), (subscriber.group(), subscriber.epoch()));
    }
    result
}

/// A payload with other bytes here and there, half of them in its headers (so many bytes at the front), and cut off.
fn damaged(
    mut bytes: Vec<u8>,
    headers: usize,
    edits: &[(prop::sample::Index, u8)],
    cut: Option<prop::sample::Index>,
) -> Vec<u8> {
    for (at, value) in edits {
        let range = if value % 2 == 0 { bytes.len() } else { bytes.len().min(headers) };
        bytes[at.index(range)] = *value;
    }
    if let Some(cut) = cut {
        bytes.truncate(cut.index(bytes.len()));
    }
    bytes
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn random_bytes_are_refused(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        prop_assert!(matches!(receive(&mut holding(), &bytes), Err(ReceiveError::Decode(_))));
    }

    #[test]
    fn random_payloads_do_no_harm(bytes in prop::collection::vec(any::<u8>(), 0..200), kind in 0usize..3) {
        let kind = [FrameKind::Snapshot, FrameKind::Delta, FrameKind::Sets][kind];
        let _ = receive(&mut holding(), &seal(kind, 0, 12, &bytes));
        let _ = receive(&mut Subscriber::new(None, Limits::default()), &seal(kind, 0, 12, &bytes));
    }

    #[test]
    fn flipped_bits_are_noticed(delta: bool, at: prop::sample::Index, bit in 0u32..8) {
        let mut bytes = if delta { SAMPLE.2.clone() } else { SAMPLE.1.clone() };
        bytes[at.index(SAMPLE.2.len())] ^= 1u8 << bit;
        prop_assert!(matches!(receive(&mut holding(), &bytes), Err(ReceiveError::Decode(_))));
    }

    #[test]
    fn damage_under_a_right_checksum_does_no_harm(
        delta: bool,
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
        cut in prop::option::weighted(0.2, any::<prop::sample::Index>()),
    ) {
        let bytes = damaged(payload(if delta { &SAMPLE.2 } else { &SAMPLE.1 }), 300, &edits, cut);
        let kind = if delta { FrameKind::Delta } else { FrameKind::Snapshot };
        let frame = seal(kind, 0, 12, &bytes);
        let mut subscriber = if delta { holding() } else { Subscriber::new(None, Limits::default()) };
        let _ = receive(&mut subscriber, &frame);
    }

    #[test]
    fn damaged_bent_normals_do_no_harm(
        which in 0usize..3,
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
        cut in prop::option::weighted(0.2, any::<prop::sample::Index>()),
    ) {
        let bytes = damaged(payload(&BENT[which]), 80, &edits, cut);
        let kind = [FrameKind::Snapshot, FrameKind::Delta, FrameKind::Sets][which];
        let _ = receive(&mut bent(which), &seal(kind, 0, which as u64, &bytes));
        // To who has none they are something else.
        let _ = receive(&mut holding(), &seal(kind, 0, 11, &bytes));
    }

    #[test]
    fn damaged_changes_of_sets_do_no_harm(
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
        cut in prop::option::weighted(0.2, any::<prop::sample::Index>()),
    ) {
        let mut bytes = payload(&SETS);
        for (at, value) in &edits {
            let range = if value % 2 == 0 { bytes.len() } else { bytes.len().min(80) };
            let at = at.index(range);
            bytes[at] = *value;
        }
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        let _ = receive(&mut further(), &seal(FrameKind::Sets, 0, 13, &bytes));
    }
}

#[test]
fn every_cut_of_a_frame_is_named_so() {
    for frame in [&SAMPLE.1, &SAMPLE.2] {
        for cut in (0..frame.len()).step_by(7) {
            let error = receive(&mut holding(), &frame[..cut]).unwrap_err();
            assert!(
                matches!(error, ReceiveError::Decode(DecodeError::Truncated { .. })),
                "cut at {cut}: {error}"
            );
            assert!(error.snapshot_helps());
        }
    }
}

#[test]
fn limits_hold() {
    let points = SAMPLE.0.layout().len() as u32;
    let sets = SAMPLE.0.layout().sets().len() as u32;
    let exact = Limits {
        max_points: points,
        max_sets: sets,
        max_frame_bytes: SAMPLE.1.len(),
        max_cuts: 600,
        max_light_values: 0,
    };
    assert_eq!(Subscriber::new(None, exact).receive(&SAMPLE.1), Ok(Applied::NewLayout));
    for limits in [
        Limits { max_points: points - 1, ..exact },
        Limits { max_sets: sets - 1, ..exact },
        Limits { max_cuts: 599, ..exact },
        Limits { max_frame_bytes: SAMPLE.1.len() - 1, ..exact },
    ] {
        let error = Subscriber::new(None, limits).receive(&SAMPLE.1).unwrap_err();
        assert!(matches!(error, ReceiveError::Decode(DecodeError::TooLarge { .. })), "{error}");
    }
}

/// Payloads changed by hand so that each breaks one rule of docs/wire.md.
#[test]
fn rules_of_the_format_are_enforced() {
    // A layout of one point at (1, 2, 3): quantum 1, spacing 1, 0 local bits, one set, no cuts; then choices.
    let set =
        PointSet { positions: vec![[1, 2, 3]], normals: vec![PackedNormal([0, 0])], ..Default::default() };
    let layout = PointLayout::new(1.0, 1.0, vec![set]).unwrap();
    let store = PointStore::new(layout.into(), vec![77]).unwrap();
    let good = |cuts: Vec<SetCuts>| {
        let mut publisher = Publisher::new([0; 32], PublisherConfig::default());
        publisher.set_cuts(store.layout().clone(), Cuts::new(cuts).unwrap());
        let bytes = payload(&publisher.publish(&store).unwrap().bytes);
        let end = 33 + usize::from(bytes[32]);
        (bytes[33..end].to_vec(), bytes[end..].to_vec())
    };
    let snapshot = |layout: &[u8], values: &[u8]| {
        let mut out = vec![0; 32];
        out.push(layout.len() as u8);
        out.extend(layout);
        out.extend(values);
        Subscriber::new(None, Limits::default()).receive(&seal(FrameKind::Snapshot, 0, 0, &out))
    };
    let (layout, one) = good(Vec::new());
    let (layout, one) = (&layout[..], &one[..]);
    assert_eq!(snapshot(layout, one), Ok(Applied::NewLayout), "the rest would prove nothing");
    let reason = |result: Result<Applied, ReceiveError>| result.unwrap_err().to_string();
    let with = |layout: &[u8], at: usize, bytes: &[u8]| {
        let mut out = layout.to_vec();
        out.splice(at..at + bytes.len(), bytes.iter().copied());
        reason(snapshot(&out, one))
    };
    assert!(with(layout, 0, &f32::NAN.to_le_bytes()).contains("quantum_m is NaN"));
    assert!(with(layout, 8, &[9]).contains("local bits"));
    assert!(with(layout, 9, &[0x80, 0]).contains("shortest form"));
    assert!(with(layout, 23, &[2]).contains("layout: ends early"), "two points");
    // The first choices: a gap of nine bytes, all of which say that there are more.
    assert!(reason(snapshot(&[&layout[..25], &[0; 9]].concat(), one)).contains("cell gaps: are no numbers"));
    assert!(reason(snapshot(&[layout, &[0; 5]].concat(), one)).contains("layout: has bytes after"));
    assert!(reason(snapshot(layout, &[one, &[0; 5]].concat())).contains("values: have bytes after"));
    assert!(reason(snapshot(layout, &[0xff; 9])).contains("values: are none"));

    // One site of ten is cut.
    let cut = SiteCut { site: 9, mask: 0x8001 };
    let (layout, _) = good(vec![SetCuts { instance: 0, sites: 10, fingerprint: 7, cuts: vec![cut] }]);
    assert_eq!(snapshot(&layout, one), Ok(Applied::NewLayout));
    assert!(with(&layout, 26, &[9]).contains("does not exist"), "of nine sites");
    assert!(with(&layout, 31, &[0]).contains("a set has none"));
    assert!(
        with(&layout, 31, &[2]).contains("layout: ends early") || with(&layout, 31, &[2]).contains("cut")
    );
    let over = [0x80, 0x80, 0x80, 0x80, 0x10];
    assert!(with(&layout, 25, &over).contains("exceeds 32 bits"));
    assert!(with(&layout, 26, &over).contains("exceed 32 bits"));

    let delta = |payload: &[u8]| holding().receive(&seal(FrameKind::Delta, 0, 12, payload));
    let good = payload(&SAMPLE.2);
    assert!(matches!(delta(&good), Ok(Applied::Changes(list)) if list.len() > 100));
    let with = |at: usize, byte: u8| {
        let mut bytes = good.clone();
        bytes[at] = byte;
        reason(delta(&bytes))
    };
    assert!(with(0, 0).contains("is the frame's own"));
    assert!(with(0, 13).contains("is negative"));
    assert!(with(0, 3).contains("ask for a snapshot"));
    assert!(with(1, 0).contains("step: is 0"));
    assert!(with(2, 129).contains("share: exceeds 2"));
    assert!(reason(delta(&[2])).contains("step: ends early"));
    assert!(reason(delta(&[&good[..], &[1; 5]].concat())).contains("bytes after"));
    assert!(reason(delta(&good[..good.len() / 2])).contains("changes: end early"));
    assert!(reason(delta(&[2, 1, 58])).contains("changes: end early"));
    assert!(reason(delta(&[2, 1, 58, 0xff, 0xff, 0xff, 0xff])).contains("changes: are none"));
}

/// Changes of sets, each of which breaks one rule.
#[test]
fn rules_of_changes_of_sets_are_enforced() {
    let sets = |payload: &[u8]| further().receive(&seal(FrameKind::Sets, 0, 13, payload));
    let good = payload(&SETS);
    let applied = sets(&good).unwrap();
    assert!(
        matches!(&applied, Applied::Sets { removed, added, changes }
            if removed == &[1] && added == &[1, 900] && changes.len() > 20),
        "{applied:?}"
    );
    assert!(further().receive(&SETS).is_ok());
    let reason = |result: Result<Applied, ReceiveError>| result.unwrap_err().to_string();
    // 1 epoch back; one goes: instance 1.
    assert_eq!(good[..3], [1, 1, 1]);
    let size = usize::from(good[3] & 0x7f) | usize::from(good[4]) << 7;
    let (layout, values) = good[5..].split_at(size);
    let made = |gone: &[u8], layout: &[u8], rest: &[u8]| {
        let long = [layout.len() as u8 & 0x7f | 0x80, (layout.len() >> 7) as u8];
        let size = if layout.len() < 0x80 { vec![layout.len() as u8] } else { long.to_vec() };
        reason(sets(&[&[1], gone, &size[..], layout, rest].concat()))
    };
    let with = |at: usize, bytes: &[u8]| {
        let mut layout = layout.to_vec();
        layout.splice(at..at + bytes.len(), bytes.iter().copied());
        made(&[1, 1], &layout, values)
    };
    assert!(made(&[1, 99], layout, values).contains("sets that go: are not there"));
    assert!(made(&[127, 0], layout, values).contains("are more than there are"));
    assert!(made(&[0], layout, values).contains("sets that come: are there already"), "1 has not gone");
    assert!(with(0, &1f32.to_le_bytes()).contains("other lengths"), "quantum");
    assert!(with(4, &1f32.to_le_bytes()).contains("other lengths"), "spacing");
    assert!(with(8, &[4]).contains("other lengths") || with(8, &[4]).contains("frame: "), "local bits");
    let empty = [&layout[..9], &[0, 0]].concat();
    let says = made(&[1, 1], &empty, &[0]);
    assert!(says.contains("are none"), "{says}");
    assert!(reason(sets(&[1, 0, 0])).contains("neither come nor go"));
    assert!(matches!(sets(&[1, 1, 1, 0]), Ok(Applied::Sets { removed, .. }) if removed == [1]));
    assert!(reason(sets(&[1, 1, 1, 0, 1])).contains("share: ends early"));
    assert!(reason(sets(&[1, 1, 1, 0, 1, 58])).contains("changes: end early"));
    assert!(reason(sets(&[0, 1, 1, 0])).contains("is the frame's own"));
    assert!(reason(sets(&[2, 1, 1, 0])).contains("ask for a snapshot"));
    let error = Subscriber::new(None, Limits::default()).receive(&SETS).unwrap_err();
    assert!(matches!(error, ReceiveError::NeedSnapshot { held: None, .. }));
    // The limits are for all that is held afterwards.
    let mut held = further();
    held.receive(&SETS).unwrap();
    let (points, sets) = (held.store().unwrap().layout().len(), held.store().unwrap().layout().sets().len());
    let at_most = |limits: Limits| {
        let mut subscriber = Subscriber::new(None, limits);
        subscriber.receive(&SAMPLE.1).unwrap();
        subscriber.receive(&SAMPLE.2).unwrap();
        subscriber.receive(&SETS)
    };
    let before = further().store().unwrap().layout().len();
    let exact = Limits {
        max_points: points.max(before) as u32,
        max_sets: sets as u32,
        // Those of the sample, and one that comes.
        max_cuts: 601,
        ..Limits::default()
    };
    let applied = at_most(exact);
    assert!(applied.is_ok(), "{applied:?}");
    let fewer_cuts = at_most(Limits { max_cuts: 600, ..exact });
    assert!(matches!(fewer_cuts, Err(ReceiveError::Decode(DecodeError::TooLarge { .. }))));
    if points > before {
        let less = Limits { max_points: points as u32 - 1, ..exact };
        assert!(matches!(at_most(less), Err(ReceiveError::Decode(DecodeError::TooLarge { .. }))));
    }
}

#[test]
fn what_breaks_the_rules_of_bent_normals_is_named() {
    let malformed = |subscriber: &mut Subscriber, kind, epoch, bytes: &[u8], named: &str| {
        let error = receive(subscriber, &seal(kind, 0, epoch, bytes)).unwrap_err().to_string();
        assert!(error.contains(named), "{error}");
    };
    // After the base epoch a delta says which planes change.
    let delta = payload(&BENT[1]);
    assert_eq!(delta[..2], [1, 15]);
    for (planes, named) in [(0, "planes"), (0x10, "planes"), (0x47, "planes")] {
        let mut bytes = delta.clone();
        bytes[1] = planes;
        malformed(&mut bent(1), FrameKind::Delta, 1, &bytes, named);
    }
    for (at, value, named) in [(4, 0, "step: is 0"), (7, 129, "share: exceeds 2")] {
        let mut bytes = delta.clone();
        bytes[at] = value;
        malformed(&mut bent(1), FrameKind::Delta, 1, &bytes, named);
    }
    malformed(&mut bent(1), FrameKind::Delta, 1, &delta[..1], "");
    // A plane that is said to change and does not.
    malformed(&mut bent(1), FrameKind::Delta, 1, &[1, 2, 1, 58], "changes");
    malformed(&mut bent(1), FrameKind::Delta, 1, &[1, 8], "changes of lights' visibility");
    // Sets without bent normals beside sets with some, and the other way round.
    let mut plain = further();
    let with = payload(&BENT[2]);
    malformed(&mut plain, FrameKind::Sets, 13, &with, "bent normals");
    let mut without = with;
    // 1 epoch back, none goes, a varint of two bytes, quantum and spacing.
    assert!(without[2] >= 0x80 && without[3] < 0x80 && without[12] >= 0xc0, "{:x?}", &without[..16]);
    without[12] &= 0x7f;
    malformed(&mut bent(2), FrameKind::Sets, 2, &without, "bent normals");
    // More lights, none, or more than there can be.
    let mut lights = payload(&BENT[2]);
    assert_eq!(lights[13], 2);
    for (count, named) in [(3, "more or fewer lights"), (0, "number of lights: is 0")] {
        lights[13] = count;
        malformed(&mut bent(2), FrameKind::Sets, 2, &lights, named);
    }
    let mut snapshot = payload(&BENT[0]);
    let at = 32 + 2 + 9;
    assert_eq!(snapshot[at], 2);
    snapshot[at] = 0x7f;
    let mut few = Subscriber::new(None, Limits { max_light_values: 4000, ..Limits::default() });
    malformed(&mut few, FrameKind::Snapshot, 0, &snapshot, "values of lights 613029");
    // Bits that mean nothing.
    let mut snapshot = payload(&BENT[0]);
    let flags = 32 + 2 + 8;
    assert!(snapshot[flags] >= 0xe0 && snapshot[flags] & 0x1f <= 8, "{:x?}", &snapshot[32..50]);
    snapshot[flags] |= 0x10;
    malformed(&mut Subscriber::new(None, Limits::default()), FrameKind::Snapshot, 0, &snapshot, "local bits");
    // Leans without lights, and sets without leans beside sets with some.
    snapshot[flags] &= !0x50;
    malformed(&mut Subscriber::new(None, Limits::default()), FrameKind::Snapshot, 0, &snapshot, "local bits");
    let mut without = payload(&BENT[2]);
    without[12] &= !0x20;
    malformed(&mut bent(2), FrameKind::Sets, 2, &without, "where what is seen");
}
