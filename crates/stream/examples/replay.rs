//! Sends the values of a recording once more, at several precisions: bits, errors and times.
//!
//! `dapple record --threshold 0 … -o true.dapple`, then `cargo run --release -p dapple-stream --features
//! publish --example replay true.dapple`.
//! The recording should be exact, for its values are what errors are measured against.

use std::time::{Duration, Instant};

use dapple_store::points::PointStore;
use dapple_stream::{Limits, Precision, Publisher, PublisherConfig, Recording, Subscriber};

/// Tolerances and steps that are tried.
const PRECISIONS: [(u8, u8); 7] = [(0, 1), (3, 6), (4, 8), (5, 8), (6, 8), (8, 8), (8, 12)];

fn main() {
    let mut arguments = std::env::args().skip(1).peekable();
    assert!(arguments.peek().is_some(), "name the recordings");
    for path in arguments {
        let bytes = std::fs::read(&path).unwrap_or_else(|error| panic!("{path}: {error}"));
        let (states, seconds) = states(&bytes).unwrap_or_else(|error| panic!("{path}: {error}"));
        println!("{path}: {} states of {} points in {seconds:.2} s", states.len(), states[0].layout().len());
        println!(
            "  precision   Mbit/s  bits/change  rms where it moves  largest   encode  decode (ns/change)"
        );
        for (tolerance, step) in PRECISIONS {
            let sent = send(&states, Precision { tolerance, step });
            println!(
                "  T {tolerance:2}  q {step:2}  {:7.4}  {:11.2}  {:18.2}  {:7}  {:7.0} {:7.0}",
                sent.bytes as f64 * 8e-6 / seconds,
                sent.bytes as f64 * 8.0 / sent.changes as f64,
                (sent.squared / sent.moving as f64).sqrt(),
                sent.largest,
                sent.encode.as_nanos() as f64 / sent.changes as f64,
                sent.decode.as_nanos() as f64 / sent.changes as f64,
            );
        }
    }
}

/// All states of a recording and its length in seconds.
fn states(bytes: &[u8]) -> Result<(Vec<PointStore>, f64), Box<dyn std::error::Error>> {
    let mut recording = Recording::new(&Limits::default());
    recording.push(bytes)?;
    let mut subscriber = Subscriber::new(None, Limits::default());
    let mut states: Vec<PointStore> = Vec::new();
    for entry in recording.entries() {
        subscriber.receive(entry.frame)?;
        let store = subscriber.store().ok_or("no snapshot")?;
        if states.last().is_none_or(|last| last != store) {
            states.push(store.clone());
        }
    }
    let seconds = recording.header().ok_or("no header")?.duration_us as f64 * 1e-6;
    if states.is_empty() { Err("no frame".into()) } else { Ok((states, seconds)) }
}

#[derive(Default)]
struct Sent {
    bytes: usize,
    changes: usize,
    /// Sum of squared errors of points whose true value is new, and how many there are.
    squared: f64,
    moving: usize,
    largest: u8,
    encode: Duration,
    decode: Duration,
}

fn send(states: &[PointStore], precision: Precision) -> Sent {
    let config = PublisherConfig { precision, ..PublisherConfig::default() };
    let mut publisher = Publisher::new([0; 32], config);
    let mut subscriber = Subscriber::new(None, Limits::default());
    let mut sent = Sent::default();
    for (index, state) in states.iter().enumerate() {
        let start = Instant::now();
        let frame = publisher.publish(state);
        let encode = start.elapsed();
        let Some(frame) = frame else { continue };
        let start = Instant::now();
        subscriber.receive(&frame.bytes).expect("a sound frame");
        let decode = start.elapsed();
        let held = subscriber.store().expect("a snapshot came");
        assert!(publisher.store() == Some(held), "both ends hold the same");
        if index == 0 {
            continue;
        }
        sent.bytes += frame.bytes.len();
        sent.changes += publisher.changed() as usize;
        sent.encode += encode;
        sent.decode += decode;
        let before = states[index - 1].visibility();
        for ((held, now), before) in held.visibility().iter().zip(state.visibility()).zip(before) {
            let error = held.abs_diff(*now);
            sent.largest = sent.largest.max(error);
            if now != before {
                sent.squared += f64::from(error).powi(2);
                sent.moving += 1;
            }
        }
    }
    sent
}
