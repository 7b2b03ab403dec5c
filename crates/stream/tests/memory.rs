//! A few bytes cannot make a receiver allocate more than its limits allow.

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

/// A snapshot payload up to its sections, which claims one set of `points` points.
fn claim(points: u64, sections: &[u8]) -> Vec<u8> {
    let mut layout = Vec::new();
    layout.extend(0.002f32.to_le_bytes());
    layout.extend(0.064f32.to_le_bytes());
    layout.extend([5, 1, 0]);
    layout.extend([0; 12]);
    varint(&mut layout, points);
    layout.extend(sections);
    let mut out = vec![0; 32];
    varint(&mut out, layout.len() as u64);
    out.extend(layout);
    out
}

/// A compressed section that claims some bytes and expands to `real` zeros.
fn zeros(claimed: u64, real: usize) -> Vec<u8> {
    compressed(claimed, &vec![0; real])
}

/// A compressed section of equal bytes.
fn repeated(byte: u8, count: usize) -> Vec<u8> {
    compressed(count as u64, &vec![byte; count])
}

fn compressed(claimed: u64, raw: &[u8]) -> Vec<u8> {
    let coded = zstd::bulk::compress(raw, 19).expect("compresses");
    let mut out = Vec::new();
    varint(&mut out, (coded.len() as u64 - 4) << 1 | 1);
    varint(&mut out, claimed);
    out.extend(&coded[4..]);
    out
}

/// Coded values of a snapshot, of any number of points, that are all the same.
fn all_equal() -> Vec<u8> {
    let set = PointSet { positions: vec![[0; 3]], normals: vec![PackedNormal([0, 0])], ..PointSet::default() };
    let layout = PointLayout::new(1.0, 1.0, vec![set]).expect("it keeps the rules");
    let store = PointStore::new(layout.into(), vec![9]).expect("one value a point");
    let mut publisher = Publisher::new([0; 32], PublisherConfig::default());
    let frame = publisher.publish(&store).expect("memory suffices").expect("the first").bytes;
    let header = FrameHeader::parse(&frame, &Limits::default()).expect("a sound frame");
    let payload = &frame[header.header_bytes..][..header.payload_bytes];
    payload[33 + usize::from(payload[32])..].to_vec()
}

// One test: the allocator counts for the whole process.
#[test]
fn memory_is_bounded_whatever_the_bytes_claim() {
    const MIB: usize = 1 << 20;
    let limits = Limits { max_points: 1 << 24, ..Limits::default() };

    // 2²⁴ points, and next to nothing behind the claim.
    let payload = claim(1 << 24, &[]);
    assert!(payload.len() < 70);
    let (peak, result) = peak_bytes(limits, &payload);
    assert!(result.is_err() && peak < MIB, "{peak} bytes: {result:?}");

    // More than the receiver takes: refused before any section is looked at.
    let (peak, result) = peak_bytes(Limits::default(), &payload);
    let named = matches!(
        result,
        Err(ReceiveError::Decode(DecodeError::TooLarge {
            what: "points",
            value: 0x100_0000,
            limit: 0x40_0000
        }))
    );
    assert!(named && peak < MIB, "{peak} bytes");

    // Zeros without end in sections of a small layout: stops at the stated size.
    let bomb = zeros(1000, 256 * MIB);
    assert!(bomb.len() < 20_000);
    let (peak, result) = peak_bytes(limits, &claim(1000, &bomb));
    assert!(result.is_err() && peak < 2 * MIB, "{peak} bytes");
    // The same with an honest head, which no longer fits the number of points.
    let (peak, result) = peak_bytes(limits, &claim(1000, &zeros(256 * MIB as u64, 256 * MIB)));
    assert!(result.is_err() && peak < MIB, "{peak} bytes");
    // A window larger than the section.
    // (frame descriptor 0: no single segment, so the next byte is the window, here the largest there is;
    // then one last block that repeats a byte 100 times).
    let wide = [6 << 1 | 1, 100, 0, 0xff, 0x23, 0x03, 0x00, 0x07];
    let (peak, result) = peak_bytes(limits, &claim(100, &wide));
    assert!(result.is_err() && peak < MIB, "{peak} bytes");

    // A bomb that keeps every rule, a million points in one place: taken, within the documented bound.
    let points = 1u64 << 20;
    let mut sections = Vec::new();
    for _ in 0..6 {
        sections.extend(zeros(points, points as usize));
    }
    let small = Limits { max_points: points as u32, ..Limits::default() };
    let no_cuts = [0; 4];
    let all_equal = all_equal();
    let mut payload = claim(points, &[&sections[..], &no_cuts].concat());
    payload.extend(&all_equal);
    assert!(payload.len() < 1000, "{} bytes", payload.len());
    let (peak, result) = peak_bytes(small, &payload);
    let bound = 64 * points as usize + 256 * small.max_sets as usize + 8 * MIB;
    assert!(result.is_ok() && peak <= bound, "{peak} bytes, bound {bound}: {result:?}");
    println!("a million points: {peak} bytes from {}", payload.len());
    // The same with as many cuts as are taken, then one more.
    for (cuts, sound) in [(u64::from(small.max_cuts), true), (u64::from(small.max_cuts) + 1, false)] {
        let mut with_cuts = sections.clone();
        with_cuts.extend([1, 0]);
        varint(&mut with_cuts, cuts);
        with_cuts.extend([9; 4]);
        varint(&mut with_cuts, cuts);
        with_cuts.extend(zeros(cuts, cuts as usize));
        with_cuts.extend(repeated(1, cuts as usize));
        with_cuts.extend(zeros(cuts, cuts as usize));
        let mut payload = claim(points, &with_cuts);
        payload.extend(&all_equal);
        assert!(payload.len() < 2000, "{} bytes", payload.len());
        let (peak, result) = peak_bytes(small, &payload);
        let bound = bound + 32 * small.max_cuts as usize;
        assert!(result.is_ok() == sound && peak <= bound, "{peak} bytes, bound {bound}: {result:?}");
        println!("{cuts} cuts: {peak} bytes from {}", payload.len());
    }
    // The longest gaps that are allowed, at first sight.
    let mut sections = [zeros(points, points as usize), zeros(points, points as usize)].concat();
    sections.extend(zeros(9 * points, 9 * points as usize));
    let (peak, result) = peak_bytes(small, &claim(points, &sections));
    assert!(result.is_err() && peak <= bound, "{peak} bytes, bound {bound}");
    println!("a million longest gaps: {peak} bytes");
}
