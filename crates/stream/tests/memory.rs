//! A few bytes cannot make a receiver allocate more than its limits allow.

use std::sync::Arc;

use dapple_store::charts::{Cuts, SetCuts, SiteCut};
use dapple_store::points::{PackedNormal, PointLayout, PointSet, PointStore};
use dapple_stream::codec::seal;
use dapple_stream::{
    DecodeError, FrameHeader, FrameKind, Limits, Publisher, PublisherConfig, ReceiveError, Subscriber,
};
use peak_alloc::PeakAlloc;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Bytes that were allocated at the same time, beyond what was before, while a snapshot payload was received.
fn peak_bytes(limits: Limits, payload: &[u8]) -> (usize, Result<(), ReceiveError>) {
    let frame = seal(FrameKind::Snapshot, 0, 0, payload);
    let mut subscriber = Subscriber::new(None, limits);
    MEMORY.reset_peak_usage();
    let before = MEMORY.current_usage();
    let result = subscriber.receive(&frame).map(drop);
    (MEMORY.peak_usage() - before, result)
}

fn varint(out: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

/// A payload of a snapshot that claims one set of `points` points and has `coded` after its tables.
fn claim(points: u64, coded: &[u8]) -> Vec<u8> {
    let mut layout = Vec::new();
    layout.extend(0.002f32.to_le_bytes());
    layout.extend(0.064f32.to_le_bytes());
    layout.extend([0, 1, 0]);
    layout.extend([0; 12]);
    varint(&mut layout, points);
    layout.push(0);
    layout.extend(coded);
    let mut out = vec![0; 32];
    varint(&mut out, layout.len() as u64);
    out.extend(layout);
    out
}

/// The payload of a snapshot of points in one place that all have the same value, with a cut at each of some sites, with or without
/// bent normals.
fn heap(points: usize, cuts: u32, has_bent: bool) -> Vec<u8> {
    let set = PointSet {
        positions: vec![[0; 3]; points],
        normals: vec![PackedNormal([0, 0]); points],
        ..PointSet::default()
    };
    let layout = Arc::new(PointLayout::new(1.0, 1.0, vec![set]).expect("it keeps the rules"));
    let mut store = PointStore::new(layout.clone(), vec![9; points]).expect("one value a point");
    if has_bent {
        store = store.with_bent([vec![128; points], vec![4; points]]).expect("one a point");
    }
    let mut publisher = Publisher::new([0; 32], PublisherConfig::default());
    let list = (0..cuts).map(|site| SiteCut { site, mask: 1 }).collect();
    let cuts = SetCuts { instance: 0, sites: cuts, fingerprint: 9, cuts: list };
    publisher.set_cuts(layout, Cuts::new(vec![cuts]).expect("they keep the rules"));
    let frame = publisher.publish(&store).expect("the first").bytes;
    let header = FrameHeader::parse(&frame, &Limits::default()).expect("a sound frame");
    frame[header.header_bytes..][..header.payload_bytes].to_vec()
}

// One test: the allocator counts for the whole process.
#[test]
fn memory_is_bounded_whatever_the_bytes_claim() {
    const MIB: usize = 1 << 20;
    let limits = Limits { max_points: 1 << 24, ..Limits::default() };
    /// What the chances of a layout take.
    const CHANCES: usize = MIB;

    // 2²⁴ points, and next to nothing behind the claim.
    for coded in [&[][..], &[0xff; 4], &[0x55; 40]] {
        let payload = claim(1 << 24, coded);
        assert!(payload.len() < 110);
        let (peak, result) = peak_bytes(limits, &payload);
        assert!(result.is_err() && peak < CHANCES + MIB, "{peak} bytes: {result:?}");
    }

    // More than the receiver takes: refused before anything is decoded.
    let (peak, result) = peak_bytes(Limits::default(), &claim(1 << 24, &[]));
    let named = matches!(
        result,
        Err(ReceiveError::Decode(DecodeError::TooLarge {
            what: "points",
            value: 0x100_0000,
            limit: 0x40_0000
        }))
    );
    assert!(named && peak < MIB, "{peak} bytes");

    // A bomb that keeps every rule, a million points in one place: taken, within the documented bound.
    let points = 1usize << 20;
    let small = Limits { max_points: points as u32, ..Limits::default() };
    let bound = 64 * points + 256 * small.max_sets as usize + 8 * MIB;
    let payload = heap(points, 0, true);
    let (peak, result) = peak_bytes(small, &payload);
    assert!(result.is_ok() && peak <= bound, "{peak} bytes, bound {bound}: {result:?}");
    let payload = heap(points, 0, false);
    assert!(payload.len() < 6000, "{} bytes", payload.len());
    let (peak, result) = peak_bytes(small, &payload);
    assert!(result.is_ok() && peak <= bound, "{peak} bytes, bound {bound}: {result:?}");
    println!("a million points: {peak} bytes from {}", payload.len());
    // The same with as many cuts as are taken, then one more.
    for (cuts, sound) in [(small.max_cuts, true), (small.max_cuts + 1, false)] {
        let payload = heap(points, cuts, false);
        assert!(payload.len() < 20_000, "{} bytes", payload.len());
        let (peak, result) = peak_bytes(small, &payload);
        let bound = bound + 32 * small.max_cuts as usize;
        assert!(result.is_ok() == sound && peak <= bound, "{peak} bytes, bound {bound}: {result:?}");
        println!("{cuts} cuts: {peak} bytes from {}", payload.len());
    }
}
