//! Bits a point, bits a change and speed of the codec on a hall of 200,000 points: `cargo bench -p dapple-stream`.

#[path = "../tests/common/cloud.rs"]
mod cloud;

use std::time::{Duration, Instant};

use dapple_store::points::PointStore;
use dapple_stream::{Applied, FrameHeader, Limits, Precision, Publisher, PublisherConfig, Subscriber};

fn main() {
    let store = cloud::hall(1, 200_000);
    let points = store.layout().len();
    println!("{points} points in {} sets", store.layout().sets().len());

    let mut publisher = Publisher::new([0; 32], PublisherConfig::default());
    let start = Instant::now();
    let snapshot = publisher.publish(&store).expect("a first frame").bytes;
    println!("snapshot: {} bytes, layout and values coded in {:?}", snapshot.len(), start.elapsed());
    for (part, bytes) in snapshot_parts(&snapshot) {
        println!("  {part:22} {bytes:8} bytes {:7.2} bits a point", bytes as f64 * 8.0 / points as f64);
    }
    let mut subscriber = Subscriber::new(None, Limits::default());
    let start = Instant::now();
    subscriber.receive(&snapshot).expect("a sound frame");
    let elapsed = start.elapsed();
    println!("  decoded in {elapsed:?}, {} ns a point", elapsed.as_nanos() / points as u128);
    let start = Instant::now();
    publisher.start_group().expect("a frame");
    println!("  made again with the same layout in {:?}", start.elapsed());

    let precision = Precision { tolerance: 4, step: 0 };
    let config = PublisherConfig { precision, ..PublisherConfig::default() };
    println!("deltas, values off by at most 4:");
    for (epoch, share) in [0.1, 0.01, 0.001, 0.0001].into_iter().enumerate() {
        let mut publisher = Publisher::new([0; 32], config);
        publisher.publish(&store);
        let moved = cloud::moved(&store, epoch as u64 + 7, share);
        let changes = moved.visibility().iter().zip(store.visibility()).filter(|(a, b)| a != b).count();
        let start = Instant::now();
        let delta = publisher.publish(&moved).expect("changes").bytes;
        let encoded = start.elapsed();
        // The first time neighbours are looked for, afterwards they are known.
        let mut warm = subscriber.clone();
        let start = Instant::now();
        warm.receive(&delta).expect("a sound frame");
        let first = start.elapsed();
        let mut times: Vec<_> = (0..9)
            .map(|_| {
                let again = publisher.start_group().expect("something is published");
                warm.receive(&again.bytes).expect("a sound frame");
                publisher.publish(&store);
                let base = publisher.start_group().expect("something is published");
                warm.receive(&base.bytes).expect("a sound frame");
                let delta = publisher.publish(&moved).expect("changes");
                let start = Instant::now();
                warm.receive(&delta.bytes).expect("a sound frame");
                start.elapsed()
            })
            .collect();
        times.sort_unstable();
        let nanoseconds = |time: Duration| time.as_nanos() as f64 / changes as f64;
        println!(
            "  {changes:7} changes {:8} bytes {:6.2} bits a change; ns a change: coded in {:.0}, decoded in {:.0} at first, then in {:.0}",
            delta.len(),
            delta.len() as f64 * 8.0 / changes as f64,
            nanoseconds(encoded),
            nanoseconds(first),
            nanoseconds(times[times.len() / 2]),
        );
    }
    let start = Instant::now();
    let none = publisher.publish(&store);
    println!("  unchanged: {} bytes in {:?}", none.map_or(0, |f| f.bytes.len()), start.elapsed());
    println!("a stream of them, one after the other:");
    for share in [0.1, 0.01, 0.001, 0.0001] {
        stream(&store, config, share);
    }
}

/// Decodes a stream that comes back to the same few states: the first round finds neighbours, the others know them.
fn stream(store: &PointStore, config: PublisherConfig, share: f32) {
    const STATES: usize = 8;
    const ROUNDS: usize = 15;
    let states: Vec<_> = (0..STATES as u64).map(|seed| cloud::moved(store, seed + 20, share)).collect();
    let mut publisher = Publisher::new([0; 32], config);
    let mut subscriber = Subscriber::new(None, Limits::default());
    subscriber.receive(&publisher.publish(store).expect("a first frame").bytes).expect("a sound frame");
    let rounds = states.iter().cycle().take(STATES * ROUNDS);
    let frames: Vec<_> = rounds.map(|state| publisher.publish(state).expect("changes").bytes).collect();
    // By frame, which is short enough not to be interrupted: the median is of those that were not.
    let (mut times, mut changed, mut bytes) = (Vec::new(), 0, 0);
    for frame in &frames {
        let start = Instant::now();
        let applied = subscriber.receive(frame);
        let elapsed = start.elapsed().as_nanos() as f64;
        let Ok(Applied::Changes(changes)) = applied else { panic!("no delta: {applied:?}") };
        times.push(elapsed / changes.len() as f64);
        changed += changes.len();
        bytes += frame.len();
    }
    let (first, warm) = times.split_at_mut(STATES);
    let median = |times: &mut [f64]| {
        times.sort_by(f64::total_cmp);
        times[times.len() / 2]
    };
    println!(
        "  {:6} changes {:6.2} bits a change; ns a change: decoded in {:.0} at first, then in {:.0}",
        changed / frames.len(),
        bytes as f64 * 8.0 / changed as f64,
        median(first),
        median(warm),
    );
}

/// Bytes of the layout and of the values of a snapshot (docs/wire.md).
fn snapshot_parts(frame: &[u8]) -> [(&'static str, usize); 2] {
    let header = FrameHeader::parse(frame, &Limits::default()).expect("a sound frame");
    let payload = &frame[header.header_bytes..][..header.payload_bytes];
    let (mut at, mut layout) = (32, 0);
    loop {
        let byte = payload[at];
        layout |= usize::from(byte & 0x7f) << (7 * (at - 32));
        at += 1;
        if byte < 0x80 {
            return [("layout", layout), ("values", payload.len() - at - layout)];
        }
    }
}
