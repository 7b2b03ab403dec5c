//! Any bytes into a subscriber, as a frame and as a payload under a right checksum.

use std::sync::LazyLock;

use dapple_store::points::{PointLayout, PointSet, PointStore};
use dapple_stream::codec::seal;
use dapple_stream::{Applied, FrameHeader, FrameKind, Limits, Parts, Subscriber};

use crate::corpus;
use crate::input::fingerprint;

/// Small, so that what a few bytes claim stays fast to make.
const LIMITS: Limits = Limits {
    max_frame_bytes: 1 << 16,
    max_points: 1 << 16,
    max_sets: 256,
    max_cuts: 1 << 16,
    max_light_values: 1 << 16,
};

/// A subscriber that holds the sample store at group 0, epoch 0.
static HOLDING: LazyLock<Subscriber> = LazyLock::new(|| {
    let mut subscriber = Subscriber::new(None, LIMITS);
    subscriber.receive(&fingerprint(&corpus::sample())).expect("a sound frame");
    subscriber
});

/// The same with bent normals.
static HOLDING_BENT: LazyLock<Subscriber> = LazyLock::new(|| {
    let mut subscriber = Subscriber::new(None, LIMITS);
    subscriber.receive(&fingerprint(&corpus::bent_sample())).expect("a sound frame");
    subscriber
});

/// Receives `data` as it is, and its bytes after the first as the payload of a snapshot, delta or change of sets (first byte modulo 3)
/// for epoch 1 of group 0. Nothing may panic; an error changes nothing; what was taken can be sent on.
pub fn decode_frame(data: &[u8]) {
    // A header is read from a prefix just as from the whole.
    if let Ok(header) = FrameHeader::parse(data, &LIMITS) {
        assert_eq!(FrameHeader::parse(&data[..header.header_bytes], &LIMITS), Ok(header));
        assert!(header.frame_bytes() <= LIMITS.max_frame_bytes);
    }
    receive(data);
    if let Some((kind, payload)) = data.split_first() {
        let kind = [FrameKind::Snapshot, FrameKind::Delta, FrameKind::Sets][usize::from(*kind) % 3];
        receive(&seal(kind, 0, 1, payload));
    }
}

/// Holds two parts: the sample store, and the same points of other instances, with bent normals; both with two lights.
static HOLDING_PARTS: LazyLock<Parts> = LazyLock::new(|| {
    let mut parts = Parts::new(None, LIMITS);
    let lights = corpus::bent_sample().lights().expect("it has some").clone();
    let first = corpus::sample().with_lights(lights.clone()).expect("of the same points");
    parts.receive(0, &fingerprint(&first)).expect("a sound frame");
    let sample = corpus::bent_sample();
    let layout = sample.layout();
    let sets = layout.sets().iter().cloned().map(|set| PointSet { instance: set.instance + 10, ..set });
    let layout =
        PointLayout::new(layout.quantum_m(), layout.spacing_m(), sets.collect()).expect("sound sets");
    let other = PointStore::new(layout.into(), sample.visibility().to_vec()).expect("a value a point");
    let other = other.with_bent(sample.bent().expect("it has some").clone()).expect("two bytes a point");
    let other = other.with_lights(lights).expect("as many points");
    parts.receive(1, &fingerprint(&other)).expect("a sound frame");
    parts
});

/// As a part of light, beside others or in the place of one.
fn receive_part(frame: &[u8]) {
    let start = &*HOLDING_PARTS;
    for part in [0, 1, 2] {
        let mut parts = start.clone();
        match parts.receive(part, frame) {
            Ok(Applied::Ignored(_)) | Err(_) => assert!(parts.store() == start.store()),
            Ok(_) => {
                // What the part has, the whole has.
                let held = parts.part(part).and_then(Subscriber::store).expect("it was applied");
                for set in held.layout().sets() {
                    let whole = parts.store().expect("it was applied");
                    let place = whole.layout().set_of_instance(set.instance).expect("it came");
                    let values = |first: u32| first as usize..first as usize + set.len();
                    assert_eq!(place.positions, set.positions);
                    assert_eq!(whole.visibility()[values(place.first)], held.visibility()[values(set.first)]);
                    if held.bent().is_some() {
                        let bent = |point: u32| {
                            (
                                whole.bent_of((place.first + point) as usize),
                                held.bent_of((set.first + point) as usize),
                            )
                        };
                        assert!((0..set.len() as u32).map(bent).all(|(whole, held)| whole == held));
                    }
                    for light in 0..held.light_count() {
                        let of = |store: &PointStore, first| {
                            store.lights().map(|l| l.of_light(light)[values(first)].to_vec())
                        };
                        assert_eq!(of(whole, place.first), of(held, set.first));
                        let leans = |store: &PointStore, first| {
                            store
                                .lights()
                                .and_then(|l| Some(l.leans_of_light(light).get(values(first))?.to_vec()))
                        };
                        let of_part = leans(held, set.first);
                        assert!(of_part.is_none() || leans(whole, place.first) == of_part);
                    }
                }
            }
        }
    }
}

fn receive(frame: &[u8]) {
    receive_part(frame);
    for start in [&Subscriber::new(None, LIMITS), &*HOLDING, &*HOLDING_BENT] {
        let mut subscriber = start.clone();
        match subscriber.receive(frame) {
            Ok(Applied::Ignored(_)) | Err(_) => {
                assert!(start.store() == subscriber.store());
                assert_eq!((start.group(), start.epoch()), (subscriber.group(), subscriber.epoch()));
            }
            Ok(Applied::NewLayout | Applied::Changes(_) | Applied::Sets { .. }) => {
                let store = subscriber.store().expect("it was applied");
                let again = fingerprint(store);
                let mut next = Subscriber::new(None, Limits { max_frame_bytes: 1 << 22, ..LIMITS });
                assert_eq!(next.receive(&again), Ok(Applied::NewLayout));
                assert_eq!(fingerprint(next.store().expect("it was applied")), again);
            }
        }
    }
}
