//! The paper's frames: what is sent arrives, nothing else does, and any bytes do no harm.

#![allow(clippy::unwrap_used, reason = "in a test, a failed unwrap is a failure like any other")]

use std::sync::Arc;

use dapple_store::cells::{
    BucketEntry, CellChanges, CellData, CellTable, HashBucket, InstanceGrid, PackedPoint, TableLayout,
    VirtualGrid,
};
use dapple_stream::cells::{CellCodec, CellError, CellLimits, CellPublisher, CellSubscriber};
use dapple_stream::codec::seal;
use dapple_stream::{DecodeError, FrameHeader, FrameKind, Limits, Subscriber};
use proptest::prelude::*;

const BUCKETS: u32 = 12;
const HASH: [u8; 32] = [7; 32];

fn empty() -> CellTable {
    let grid = |count| VirtualGrid { dims: [4, 5, 6], count, ..VirtualGrid::default() };
    let grids = vec![
        InstanceGrid { instance: 1, grid: grid(5) },
        InstanceGrid { instance: 9, grid: grid(BUCKETS - 5) },
    ];
    CellTable::new(Arc::new(TableLayout::new(0.1, 0.2, grids).unwrap()))
}

/// Changes a table at a few places; every cell that a bucket names is written.
fn change(table: &mut CellTable, at: &[(u32, u32, u32)]) -> CellChanges {
    let mut changes = CellChanges::default();
    for &(bucket, cell, word) in at {
        let (bucket, cell) = (bucket % BUCKETS, cell % (8 * BUCKETS));
        let mut entries = [BucketEntry::FREE; 8];
        entries[0] = BucketEntry { key: word % 120, cell: cell + 1 };
        *table.bucket_mut(bucket) = HashBucket(entries);
        let mut points = CellData::default();
        points.0[0] = PackedPoint(word | 1 << 31);
        points.0[1] = PackedPoint(word.rotate_left(7) | 1 << 31);
        *table.cell_mut(cell) = points;
        changes.buckets.push(bucket);
        changes.cells.push(cell);
    }
    for list in [&mut changes.buckets, &mut changes.cells] {
        list.sort_unstable();
        list.dedup();
    }
    changes
}

fn new_subscriber() -> CellSubscriber {
    CellSubscriber::new(Some(HASH), CellLimits::default())
}

proptest! {
    #[test]
    fn a_subscriber_holds_what_was_published(
        steps in prop::collection::vec(
            prop::collection::vec((any::<u32>(), any::<u32>(), any::<u32>()), 0..9), 1..12),
        joins in 0usize..12,
        lz4: bool,
    ) {
        let codec = if lz4 { CellCodec::Lz4 } else { CellCodec::Zstd };
        let mut table = empty();
        let mut publisher = CellPublisher::new(HASH, codec, 0.0);
        let mut first = new_subscriber();
        first.receive(&publisher.join(&table).unwrap().bytes).unwrap();
        let mut late = None;
        for (i, step) in steps.iter().enumerate() {
            let changes = change(&mut table, step);
            let frame = publisher.publish(&table, &changes, i as f64 + 0.5).unwrap();
            prop_assert_eq!(frame.is_some(), !step.is_empty(), "nothing changed, nothing is sent");
            if let Some(frame) = frame {
                let header = FrameHeader::parse(&frame.bytes, &Limits::default()).unwrap();
                prop_assert_eq!((header.kind, header.epoch), (FrameKind::Delta, frame.epoch));
                prop_assert_eq!(first.receive(&frame.bytes).unwrap(), changes);
                prop_assert_eq!(first.time_s(), Some(i as f64 + 0.5));
                if let Some(late) = &mut late {
                    CellSubscriber::receive(late, &frame.bytes).unwrap();
                }
            }
            if i == joins {
                let mut joiner = new_subscriber();
                joiner.receive(&publisher.join(&table).unwrap().bytes).unwrap();
                late = Some(joiner);
            }
            prop_assert!(first.table().unwrap().holds_same(&table));
            if let Some(late) = &late {
                prop_assert!(late.table().unwrap().holds_same(&table));
                prop_assert_eq!((late.epoch(), late.time_s()), (first.epoch(), first.time_s()));
            }
        }
    }

    #[test]
    fn any_payload_is_taken_or_refused_and_a_refused_one_changes_nothing(
        mut payload in prop::collection::vec(any::<u8>(), 0..200), is_delta: bool, lz4: bool, sound_head: bool,
        raw_bytes in 0u8..127,
    ) {
        if sound_head {
            let head = [&b"CELL"[..], &[1 + u8::from(lz4)], &[0; 8], &[raw_bytes]].concat();
            payload.splice(0..0, head);
        }
        let (mut subscriber, _) = holding();
        let before = subscriber.clone();
        let kind = if is_delta { FrameKind::Delta } else { FrameKind::Snapshot };
        if subscriber.receive(&seal(kind, 0, 1, &payload)).is_err() {
            prop_assert!(subscriber.table().unwrap().holds_same(before.table().unwrap()));
            prop_assert_eq!((subscriber.epoch(), subscriber.time_s()), (before.epoch(), before.time_s()));
        }
    }

    #[test]
    fn a_damaged_body_is_taken_or_refused(at: prop::sample::Index, bit in 0u8..8, lz4: bool) {
        let codec = if lz4 { CellCodec::Lz4 } else { CellCodec::Zstd };
        let mut table = empty();
        change(&mut table, &[(1, 2, 3), (4, 5, 6), (9, 80, 7)]);
        let bytes = CellPublisher::new(HASH, codec, 0.0).join(&table).unwrap().bytes;
        let header = FrameHeader::parse(&bytes, &Limits::default()).unwrap();
        let mut payload = bytes[header.header_bytes..][..header.payload_bytes].to_vec();
        let at = at.index(payload.len());
        payload[at] ^= 1 << bit;
        let mut subscriber = new_subscriber();
        if subscriber.receive(&seal(FrameKind::Snapshot, 0, 0, &payload)).is_ok() {
            // What is held can be looked up and sent on.
            let held = subscriber.table().unwrap();
            let again = CellPublisher::new(HASH, codec, 0.0).join(held).unwrap();
            let mut next = new_subscriber();
            next.receive(&again.bytes).unwrap();
            prop_assert!(next.table().unwrap().holds_same(held));
        } else {
            prop_assert!(subscriber.table().is_none());
        }
    }
}

/// A subscriber at epoch 0, and the delta to epoch 1.
fn holding() -> (CellSubscriber, Vec<u8>) {
    let mut table = empty();
    change(&mut table, &[(1, 2, 3), (4, 5, 6)]);
    let mut publisher = CellPublisher::new(HASH, CellCodec::Zstd, 0.0);
    let mut subscriber = new_subscriber();
    subscriber.receive(&publisher.join(&table).unwrap().bytes).unwrap();
    let changes = change(&mut table, &[(2, 11, 99)]);
    (subscriber, publisher.publish(&table, &changes, 1.0).unwrap().unwrap().bytes)
}

#[test]
fn frames_out_of_order_of_other_scenes_and_of_other_kinds_are_refused() {
    let (mut subscriber, delta) = holding();
    assert_eq!(new_subscriber().receive(&delta), Err(CellError::Gap { found: 1, held: None }));
    subscriber.receive(&delta).unwrap();
    assert_eq!(subscriber.receive(&delta), Err(CellError::Gap { found: 1, held: Some(1) }));
    let join = CellPublisher::new([8; 32], CellCodec::Zstd, 0.0).join(&empty()).unwrap();
    assert_eq!(subscriber.receive(&join.bytes), Err(CellError::OtherScene));
    assert!(Subscriber::new(None, Limits::default()).receive(&join.bytes).is_err(), "not a store");
    let mut damaged = delta.clone();
    damaged[20] ^= 1;
    let refused = subscriber.receive(&damaged);
    assert!(matches!(refused, Err(CellError::Decode(DecodeError::Corrupt { .. }))), "{refused:?}");
}

#[test]
fn what_exceeds_the_limits_is_refused() {
    let join = CellPublisher::new(HASH, CellCodec::Zstd, 0.0).join(&empty()).unwrap();
    let with = |limits| CellSubscriber::new(None, limits).receive(&join.bytes);
    let default = CellLimits::default();
    assert!(with(default).is_ok());
    assert!(with(CellLimits { max_buckets: BUCKETS, max_grids: 2, ..default }).is_ok());
    for limits in [
        CellLimits { max_buckets: BUCKETS - 1, ..default },
        CellLimits { max_grids: 1, ..default },
        CellLimits { max_frame_bytes: join.bytes.len() - 1, ..default },
    ] {
        let refused = with(limits);
        assert!(matches!(refused, Err(CellError::Decode(DecodeError::TooLarge { .. }))), "{refused:?}");
    }
}

#[test]
fn the_body_is_compressed_as_the_paper_says() {
    // 60 cells that are much alike: zstd finds what LZ4 finds and codes it better.
    let bytes = |codec| {
        let mut table = empty();
        let at: Vec<(u32, u32, u32)> = (0..60).map(|i| (i, i, 0x0101_0100 * (i % 4) + i)).collect();
        change(&mut table, &at);
        CellPublisher::new(HASH, codec, 0.0).join(&table).unwrap()
    };
    let (zstd, lz4) = (bytes(CellCodec::Zstd), bytes(CellCodec::Lz4));
    assert!(zstd.cells <= 60 && zstd.buckets == BUCKETS);
    let raw = 12 * 64 + zstd.cells as usize * 28;
    assert!(
        zstd.bytes.len() < lz4.bytes.len() && lz4.bytes.len() < raw,
        "{} {} {raw}",
        zstd.bytes.len(),
        lz4.bytes.len()
    );
}
