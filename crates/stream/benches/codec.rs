//! Bits a point, bits a change and speed of the codec on a hall of 200,000 points: `cargo bench -p dapple-stream`.

#[path = "../tests/common/cloud.rs"]
mod cloud;

use std::time::Instant;

use dapple_stream::{FrameHeader, Limits, Publisher, PublisherConfig, Subscriber};

fn main() {
    let store = cloud::hall(1, 200_000);
    let points = store.layout().len();
    println!("{points} points in {} sets", store.layout().sets().len());

    let mut publisher = Publisher::new([0; 32], PublisherConfig::default());
    let start = Instant::now();
    let snapshot = publisher.publish(&store).expect("publishes").expect("a first frame").bytes;
    println!("snapshot: {} bytes, layout and values coded in {:?}", snapshot.len(), start.elapsed());
    for (part, bytes) in snapshot_parts(&snapshot) {
        println!("  {part:22} {bytes:8} bytes {:7.2} bits a point", bytes as f64 * 8.0 / points as f64);
    }
    let mut subscriber = Subscriber::new(None, Limits::default());
    let start = Instant::now();
    subscriber.receive(&snapshot).expect("a sound frame");
    println!("  decoded in {:?}", start.elapsed());
    let start = Instant::now();
    publisher.start_group().expect("starts").expect("a frame");
    println!("  made again with the same layout in {:?}", start.elapsed());

    println!("deltas:");
    for (epoch, share) in [0.1, 0.01, 0.001, 0.0001].into_iter().enumerate() {
        let mut publisher = Publisher::new([0; 32], PublisherConfig::default());
        publisher.publish(&store).expect("publishes");
        let moved = cloud::moved(&store, epoch as u64 + 7, share);
        let changes = moved.visibility().iter().zip(store.visibility()).filter(|(a, b)| a != b).count();
        let start = Instant::now();
        let delta = publisher.publish(&moved).expect("publishes").expect("changes").bytes;
        let encoded = start.elapsed();
        let mut base = subscriber.clone();
        let start = Instant::now();
        base.receive(&delta).expect("a sound frame");
        let decoded = start.elapsed();
        println!(
            "  {changes:7} changes {:8} bytes {:6.2} bits a change, coded in {encoded:?}, decoded in {decoded:?}",
            delta.len(),
            delta.len() as f64 * 8.0 / changes as f64
        );
    }
    let start = Instant::now();
    let none = publisher.publish(&store).expect("publishes");
    println!("  unchanged: {} bytes in {:?}", none.map_or(0, |f| f.bytes.len()), start.elapsed());
}

/// Walks over the sections of a snapshot (docs/wire.md).
fn snapshot_parts(frame: &[u8]) -> Vec<(&'static str, usize)> {
    let header = FrameHeader::parse(frame, &Limits::default()).expect("a sound frame");
    let payload = &frame[header.header_bytes..][..header.payload_bytes];
    let mut at = 32;
    let varint = |at: &mut usize| {
        let (mut value, mut shift) = (0usize, 0);
        loop {
            let byte = payload[*at];
            *at += 1;
            value |= usize::from(byte & 0x7f) << shift;
            shift += 7;
            if byte < 0x80 {
                return value;
            }
        }
    };
    varint(&mut at);
    at += 9;
    for _ in 0..varint(&mut at) {
        varint(&mut at);
        at += 12;
        varint(&mut at);
    }
    let mut parts = vec![("envelope, sets", header.header_bytes + at + 4)];
    let names = ["normals, 1st", "normals, 2nd", "cells", "along, 1st", "along, 2nd", "across", "values"];
    for name in names {
        let start = at;
        let head = varint(&mut at);
        if head & 1 == 1 {
            varint(&mut at);
        }
        at += head >> 1;
        parts.push((name, at - start));
    }
    assert_eq!(at, payload.len());
    parts
}
