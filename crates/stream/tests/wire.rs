//! The test vectors of `docs/wire.md`, read from the document itself: it and the code cannot drift apart.

#![allow(clippy::unwrap_used, reason = "in a test, a failed unwrap is a failure like any other")]

mod common;

use dapple_store::charts::{Cuts, SetCuts, SiteCut};
use dapple_store::light_visibility::{Lean, LightChange, LightVisibility};
use dapple_store::points::{BentChange, BentNormal, Change, PointLayout, PointStore};
use dapple_stream::{Applied, FrameHeader, Limits, Publisher, PublisherConfig, Subscriber, ValueChange};

const DOCUMENT: &str = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/wire.md"));

/// The bytes of the fenced block ```` ```hex name ````; what follows a `#` in a line is a comment.
fn vector(name: &str) -> Vec<u8> {
    let start = DOCUMENT.find(&format!("```hex {name}\n")).unwrap_or_else(|| panic!("no vector {name}"));
    DOCUMENT[start..]
        .lines()
        .skip(1)
        .take_while(|line| *line != "```")
        .flat_map(|line| line.split('#').next().unwrap_or_default().split_whitespace())
        .map(|byte| u8::from_str_radix(byte, 16).unwrap_or_else(|_| panic!("{name}: {byte} is no byte")))
        .collect()
}

/// The scene hash of the vectors: 00 01 … 1f.
fn scene_hash() -> [u8; 32] {
    std::array::from_fn(|i| i as u8)
}

/// The store that the document describes.
fn described() -> PointStore {
    let facing_z = [127, 127];
    let sets = vec![
        common::set(
            0,
            [-1.0, 0.0, 0.5],
            vec![
                ([0, 0, 0], facing_z),
                ([30, 0, 9], facing_z),
                ([3, 0, 33], facing_z),
                ([40, 1, 40], [127, 190]),
            ],
        ),
        common::set(2, [0.0, 2.0, 0.0], vec![([2_097_151, 0, 0], [0, 127])]),
    ];
    let layout = PointLayout::new(0.001953125, 0.0625, sets).unwrap();
    PointStore::new(layout.into(), vec![255, 250, 128, 0, 64]).unwrap()
}

/// The cuts that the document describes.
fn cuts() -> Cuts {
    let cuts = vec![SiteCut { site: 3, mask: 0x0005 }, SiteCut { site: 8, mask: 0x8002 }];
    Cuts::new(vec![SetCuts { instance: 0, sites: 9, fingerprint: 0x0123_4567, cuts }]).unwrap()
}

fn changes() -> [Change; 2] {
    [Change { point: 1, visibility: 240 }, Change { point: 4, visibility: 70 }]
}

/// What the document describes at epoch 8, and the cuts of it.
fn with_other_sets() -> (PointStore, Cuts) {
    let points = vec![([0, 0, 0], [127, 254]), ([31, 0, 0], [127, 254])];
    let mut sets = described().layout().sets()[..1].to_vec();
    sets.push(common::set(5, [0.0, 0.0, 3.0], points));
    let layout = PointLayout::new(0.001953125, 0.0625, sets).unwrap();
    let store = PointStore::new(layout.into(), vec![200, 240, 128, 0, 100, 90]).unwrap();
    let came =
        SetCuts { instance: 5, sites: 4, fingerprint: 0x89ab_cdef, cuts: vec![SiteCut { site: 2, mask: 1 }] };
    (store, cuts().with_sets(&[2], &Cuts::new(vec![came]).unwrap()))
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x} ")).collect()
}

#[test]
fn the_vectors_decode_to_what_is_described() {
    let mut subscriber = Subscriber::new(Some(scene_hash()), Limits::default());
    assert_eq!(subscriber.receive(&vector("snapshot")), Ok(Applied::NewLayout));
    let mut expected = described();
    assert!(common::same_bits(subscriber.store().unwrap(), &expected));
    assert_eq!(subscriber.cuts(), Some(&cuts()));
    assert_eq!((subscriber.group(), subscriber.epoch()), (Some(300), Some(5)));

    let list = vec![ValueChange { point: 1, old: 250, new: 240 }, ValueChange { point: 4, old: 64, new: 70 }];
    assert_eq!(subscriber.receive(&vector("delta")), Ok(Applied::Changes(list)));
    expected.apply(&changes()).unwrap();
    assert!(common::same_bits(subscriber.store().unwrap(), &expected));
    assert_eq!((subscriber.group(), subscriber.epoch()), (Some(300), Some(7)));

    let changes = vec![ValueChange { point: 0, old: 255, new: 200 }];
    let applied = Applied::Sets { removed: vec![2], added: vec![5], changes };
    assert_eq!(subscriber.receive(&vector("sets")), Ok(applied));
    let (expected, cuts) = with_other_sets();
    assert!(common::same_bits(subscriber.store().unwrap(), &expected));
    assert_eq!(subscriber.cuts(), Some(&cuts));
    assert_eq!((subscriber.group(), subscriber.epoch()), (Some(300), Some(8)));
}

/// The chances that a delta begins with are those of the document.
#[test]
fn chances_begin_as_written() {
    assert_eq!(hex(&vector("chances")), hex(&dapple_stream::codec::first_chances()));
}

#[test]
fn encoding_gives_the_vectors() {
    let config = PublisherConfig { first_group: 300, ..Default::default() };
    let mut publisher = Publisher::new(scene_hash(), config);
    let mut store = described();
    publisher.set_cuts(store.layout().clone(), cuts());
    // Epochs 0 to 4 show other values; a joiner at epoch 5 gets the snapshot.
    for value in 0..5 {
        publisher.publish(&PointStore::new(store.layout().clone(), vec![value; 5]).unwrap());
    }
    publisher.publish(&store);
    let snapshot = publisher.join().unwrap();
    assert_eq!(hex(&vector("snapshot")), hex(&snapshot.bytes));
    assert!(publisher.publish(&store).is_none());
    store.apply(&changes()).unwrap();
    let delta = publisher.publish(&store).unwrap();
    assert_eq!(hex(&vector("delta")), hex(&delta.bytes));
    let (other, cuts) = with_other_sets();
    publisher.set_cuts(other.layout().clone(), cuts);
    let sets = publisher.publish(&other).unwrap();
    assert_eq!(hex(&vector("sets")), hex(&sets.bytes));
}

/// Four points in a row with bent normals, of which one turns while another darkens.
#[test]
fn the_bent_vectors_are_those_of_the_encoder_and_decode() {
    let points = (0..4).map(|i| ([i, 0, 0], [127, 127])).collect();
    let layout = PointLayout::new(1.0, 1.0, vec![common::set(0, [0.0; 3], points)]).unwrap();
    let store = PointStore::new(layout.into(), vec![255, 200, 200, 255]).unwrap();
    let mut store = store.with_bent([vec![128, 170, 86, 128], vec![128; 4]]).unwrap();
    let mut publisher = Publisher::new([0; 32], PublisherConfig::default());
    let mut subscriber = Subscriber::new(None, Limits::default());
    let snapshot = publisher.publish(&store).unwrap();
    let change = BentChange { point: 1, old: BentNormal([170, 128]), new: BentNormal([170, 150]) };
    store.apply_bent(&[change]).unwrap();
    store.apply(&[Change { point: 2, visibility: 150 }]).unwrap();
    let delta = publisher.publish(&store).unwrap();
    assert_eq!(hex(&vector("bent")), hex(&snapshot.bytes));
    assert_eq!(hex(&vector("bend")), hex(&delta.bytes));
    assert_eq!(subscriber.receive(&vector("bent")), Ok(Applied::NewLayout));
    let list = vec![ValueChange { point: 2, old: 200, new: 150 }];
    assert_eq!(subscriber.receive(&vector("bend")), Ok(Applied::Changes(list)));
    assert_eq!(subscriber.bent_changes(), [change]);
    assert!(common::same_bits(subscriber.store().unwrap(), &store));
    // The surface looks along z, whose tangents are x and y.
    let direction = store.bent_of(1).unwrap().unpack(store.layout().sets()[0].normals[1]);
    let expected = glam::Vec3::new(42.0 / 127.0, 22.0 / 127.0, 0.0);
    assert!((direction.truncate() - expected.truncate()).length() < 1e-2 && direction.z > 0.9, "{direction}");
}

/// The same points with two lights: a shadow comes over three of them, of one light.
#[test]
fn the_light_vectors_are_those_of_the_encoder_and_decode() {
    let change = |index, old, new| LightChange { index, old, new, ..LightChange::default() };
    let changes = [change(1, 31, 25), change(2, 20, 0), change(6, 31, 0)];
    light_vectors(["lights", "shade"], (2, vec![31, 31, 20, 0, 31, 31, 31, 31], None), &changes);
}

/// A snapshot of four points with these lights, their values and leans, and the delta to those after the changes: as the documents have them.
fn light_vectors(
    names: [&str; 2],
    (lights, values, leans): (u32, Vec<u8>, Option<Vec<Lean>>),
    changes: &[LightChange],
) {
    let points = (0..4).map(|i| ([i, 0, 0], [127, 127])).collect();
    let layout = PointLayout::new(1.0, 1.0, vec![common::set(0, [0.0; 3], points)]).unwrap();
    let mut lights = LightVisibility::new(&layout, lights, values).unwrap();
    if let Some(leans) = leans {
        lights = lights.with_leans(leans).unwrap();
    }
    let store = PointStore::new(layout.into(), vec![255, 200, 200, 255]).unwrap();
    let mut store = store.with_lights(lights).unwrap();
    let mut publisher = Publisher::new([0; 32], PublisherConfig::default());
    let mut subscriber = Subscriber::new(None, Limits::default());
    let snapshot = publisher.publish(&store).unwrap();
    store.apply_lights(changes).unwrap();
    let delta = publisher.publish(&store).unwrap();
    let [first, second] = names.map(vector);
    assert_eq!([hex(&first), hex(&second)], [hex(&snapshot.bytes), hex(&delta.bytes)]);
    assert_eq!(subscriber.receive(&first), Ok(Applied::NewLayout));
    assert_eq!(subscriber.receive(&second), Ok(Applied::Changes(Vec::new())));
    assert_eq!(subscriber.light_changes(), changes);
    assert!(common::same_bits(subscriber.store().unwrap(), &store));
}

/// The same points with one light that two of them see half of, and where; then one of them sees another half, and the light goes up at a third.
#[test]
fn the_lean_vectors_are_those_of_the_encoder_and_decode() {
    let change = |index, [old, new]: [u8; 2], [old_lean, new_lean]: [[i8; 2]; 2]| LightChange {
        index,
        old,
        new,
        old_lean: Lean(old_lean),
        new_lean: Lean(new_lean),
    };
    let changes = [change(2, [9, 9], [[3, 0], [-2, 0]]), change(3, [0, 4], [[0, 0], [4, 0]])];
    let leans = [[0, 0], [2, -1], [3, 0], [0, 0]].map(Lean).to_vec();
    light_vectors(["lean", "turn"], (1, vec![31, 20, 9, 0], Some(leans)), &changes);
}

/// 64 points in a row, all of which go from 0 to 1.
#[test]
fn the_row_vector_decodes() {
    let points = (0..64).map(|i| ([i, 0, 0], [127, 254])).collect();
    let layout = PointLayout::new(1.0, 1.0, vec![common::set(0, [0.0; 3], points)]).unwrap();
    let mut store = PointStore::new(layout.into(), vec![0; 64]).unwrap();
    let mut publisher = Publisher::new([0; 32], PublisherConfig::default());
    let mut subscriber = Subscriber::new(None, Limits::default());
    subscriber.receive(&publisher.publish(&store).unwrap().bytes).unwrap();
    let bytes = vector("row");
    let applied = subscriber.receive(&bytes);
    store = PointStore::new(store.layout().clone(), vec![1; 64]).unwrap();
    let own = publisher.publish(&store).unwrap();
    assert!(matches!(applied, Ok(Applied::Changes(list)) if list.len() == 64), "ours: {}", hex(&own.bytes));
    assert!(common::same_bits(subscriber.store().unwrap(), &store));
    let header = FrameHeader::parse(&bytes, &Limits::default()).unwrap();
    assert!(header.payload_bytes < 10, "{} bytes", header.payload_bytes);
    assert_eq!(hex(&bytes), hex(&own.bytes));
}
