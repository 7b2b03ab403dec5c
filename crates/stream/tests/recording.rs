//! Recordings: the test vector of `docs/recording.md`, damage of every kind, and that any time can be sought.

#![allow(clippy::unwrap_used, reason = "in a test, a failed unwrap is a failure like any other")]

#[path = "common/cloud.rs"]
mod cloud;

use std::sync::LazyLock;

use dapple_store::points::PointStore;
use dapple_stream::recording::{RecordError, closing_bytes, parse_closing};
use dapple_stream::{
    DecodeError, Limits, Publisher, PublisherConfig, Recorder, Recording, RecordingError, RecordingHeader,
    Replay, Subscriber,
};
use proptest::prelude::*;

const DOCUMENT: &str = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/recording.md"));
const WIRE: &str = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/wire.md"));

/// The bytes of the fenced block ```` ```hex name ````; `#` opens a comment, `@other` is a block of wire.md.
fn vector(document: &str, name: &str) -> Vec<u8> {
    let start = document.find(&format!("```hex {name}\n")).unwrap_or_else(|| panic!("no vector {name}"));
    let lines = document[start..].lines().skip(1).take_while(|line| *line != "```");
    let words = lines.flat_map(|line| line.split('#').next().unwrap_or_default().split_whitespace());
    words
        .flat_map(|word| match word.strip_prefix('@') {
            Some(other) => vector(WIRE, other),
            None => {
                vec![u8::from_str_radix(word, 16).unwrap_or_else(|_| panic!("{name}: {word} is no byte"))]
            }
        })
        .collect()
}

fn hex(bytes: &[u8]) -> String {
    bytes.chunks(16).map(|row| row.iter().map(|b| format!("{b:02x} ")).collect::<String>() + "\n").collect()
}

fn header(duration_us: u64) -> RecordingHeader {
    RecordingHeader { scene_hash: std::array::from_fn(|i| i as u8), name: "hall".into(), duration_us }
}

/// The recording of some frames and their times.
fn record(header: &RecordingHeader, frames: &[(u64, &[u8])]) -> Vec<u8> {
    let (mut recorder, mut bytes) = Recorder::new(header).unwrap();
    for (time_us, frame) in frames {
        bytes.extend(recorder.frame(*time_us, frame).unwrap());
    }
    bytes.extend(recorder.finish());
    bytes
}

/// A short recording, its states (time from which on they hold, the store), and the file.
struct Sample {
    states: Vec<(u64, PointStore)>,
    bytes: Vec<u8>,
}

const STEP_US: u64 = 66_667;

static SAMPLE: LazyLock<Sample> = LazyLock::new(|| {
    let mut store = cloud::hall(3, 400);
    let config = PublisherConfig { first_group: 7, deltas_per_group: 5, ..Default::default() };
    let mut publisher = Publisher::new(header(0).scene_hash, config);
    let (mut recorder, mut bytes) = Recorder::new(&header(24 * STEP_US)).unwrap();
    let mut states = Vec::new();
    for step in 0..24 {
        // Now and then nothing changes.
        if step % 4 != 3 {
            store = cloud::moved(&store, step, 0.05);
        }
        let time_us = step * STEP_US;
        if let Some(frame) = publisher.publish(&store) {
            bytes.extend(recorder.frame(time_us, &frame.bytes).unwrap());
            states.push((time_us, store.clone()));
        }
    }
    bytes.extend(recorder.finish());
    Sample { states, bytes }
});

fn parse(bytes: &[u8]) -> Result<Recording, RecordingError> {
    Recording::parse(bytes.to_vec(), &Limits::default())
}

/// What a subscriber holds after the entries of a recording with these numbers.
fn store_after(recording: &Recording, numbers: std::ops::Range<usize>) -> PointStore {
    let mut subscriber = Subscriber::new(None, Limits::default());
    for number in numbers {
        subscriber.receive(recording.entry(number).unwrap().frame).unwrap();
    }
    subscriber.store().unwrap().clone()
}

#[test]
fn the_vector_is_what_is_written_and_reads_as_described() {
    let (snapshot, delta) = (vector(WIRE, "snapshot"), vector(WIRE, "delta"));
    let frames = [(0, &snapshot[..]), (500_000, &delta[..]), (1_250_000, &snapshot[..])];
    let written = record(&header(2_000_000), &frames);
    assert_eq!(hex(&vector(DOCUMENT, "recording")), hex(&written));
    let recording = parse(&written).unwrap();
    assert_eq!(recording.header(), Some(&header(2_000_000)));
    assert_eq!(recording.entries().map(|e| (e.time_us, e.frame)).collect::<Vec<_>>(), frames);
    assert_eq!(parse_closing(&written).unwrap(), recording.snapshots());
    assert_eq!(recording.snapshots().iter().map(|at| at.entry).collect::<Vec<_>>(), [0, 2]);
    for (time_us, entries) in
        [(0, 0..1), (499_999, 0..1), (500_000, 0..2), (1_250_000, 2..3), (9 << 40, 2..3)]
    {
        assert_eq!(recording.seek(time_us), entries, "{time_us} µs");
    }
}

#[test]
fn it_is_the_same_in_pieces() {
    let whole = parse(&SAMPLE.bytes).unwrap();
    for size in [1, 7, 100, 5000] {
        let mut recording = Recording::new(&Limits::default());
        let mut entries = 0;
        for piece in SAMPLE.bytes.chunks(size) {
            assert!(!recording.is_complete() && recording.finish().is_err());
            entries += recording.push(piece).unwrap();
        }
        assert!(recording.is_complete());
        recording.finish().unwrap();
        assert_eq!((entries, recording.loaded_us()), (whole.len(), 24 * STEP_US));
        assert!(recording.entries().eq(whole.entries()) && recording.header() == whole.header());
    }
}

#[test]
fn the_closing_part_leads_to_every_snapshot() {
    let recording = parse(&SAMPLE.bytes).unwrap();
    let tail = &SAMPLE.bytes[SAMPLE.bytes.len() - closing_bytes(&SAMPLE.bytes).unwrap()..];
    let list = parse_closing(tail).unwrap();
    assert!(list.len() >= 3, "several groups were meant");
    assert_eq!(list, recording.snapshots());
    for at in list {
        // The entry's head is 17 bytes; its frame follows.
        let frame = recording.entry(at.entry as usize).unwrap().frame;
        assert!(SAMPLE.bytes[at.offset as usize + 17..].starts_with(frame));
        store_after(&recording, at.entry as usize..at.entry as usize + 1);
    }
    for cut in 0..tail.len() {
        assert!(parse_closing(&tail[tail.len() - cut..]).is_err(), "the last {cut} bytes");
    }
}

#[test]
fn every_time_has_its_state() {
    let recording = parse(&SAMPLE.bytes).unwrap();
    for time_us in (0..25 * STEP_US).step_by(11_111) {
        let expected = SAMPLE.states.iter().rev().find(|(from_us, _)| *from_us <= time_us).unwrap();
        let wanted = recording.seek(time_us);
        assert!(wanted.len() <= 6, "a group is short");
        assert!(store_after(&recording, wanted.clone()) == expected.1, "sought {time_us} µs");
        assert!(store_after(&recording, 0..wanted.end) == expected.1, "from the start to {time_us} µs");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// One subscriber, led to and fro.
    #[test]
    fn a_replay_leads_to_every_time(times in prop::collection::vec(0..25 * STEP_US, 1..30)) {
        let recording = parse(&SAMPLE.bytes).unwrap();
        let mut replay = Replay::new(3);
        let mut subscriber = Subscriber::new(Some(header(0).scene_hash), Limits::default());
        for time_us in times {
            for frame in replay.frames_to(&recording, time_us) {
                subscriber.receive(&frame).unwrap();
            }
            prop_assert!(replay.frames_to(&recording, time_us).is_empty(), "it is there");
            let expected = SAMPLE.states.iter().rev().find(|(from_us, _)| *from_us <= time_us).unwrap();
            prop_assert!(subscriber.store() == Some(&expected.1));
        }
    }

    #[test]
    fn random_bytes_are_refused(bytes in prop::collection::vec(any::<u8>(), 0..300), begin: bool) {
        let mut all = if begin { SAMPLE.bytes[..58].to_vec() } else { Vec::new() };
        all.extend(bytes);
        prop_assert!(parse(&all).is_err());
        let _ = parse_closing(&all);
    }

    #[test]
    fn any_damage_is_noticed_and_what_came_before_is_sound(
        edits in prop::collection::vec((any::<prop::sample::Index>(), 1u8..), 1..4),
        piece in 1usize..3000,
    ) {
        let mut bytes = SAMPLE.bytes.clone();
        for (at, change) in &edits {
            bytes[at.index(SAMPLE.bytes.len())] ^= change;
        }
        prop_assume!(bytes != SAMPLE.bytes);
        let sound = parse(&SAMPLE.bytes).unwrap();
        let mut recording = Recording::new(&Limits::default());
        let failed = bytes.chunks(piece).any(|piece| recording.push(piece).is_err());
        let error = recording.finish().unwrap_err();
        prop_assert_eq!(recording.push(&[0]).is_err(), failed, "an error stays");
        let truncated = matches!(error, RecordingError::Truncated { .. });
        prop_assert!(failed || truncated, "{}", error);
        for (mine, theirs) in recording.entries().zip(sound.entries()) {
            prop_assert_eq!(mine, theirs);
        }
    }
}

#[test]
fn flipped_bits_are_named_as_damage() {
    for bit in 0..SAMPLE.bytes.len() * 8 {
        // Every bit of the parts around frames, some of those inside.
        if bit % 61 != 0 && !(0..58 * 8).contains(&bit) && bit < (SAMPLE.bytes.len() - 200) * 8 {
            continue;
        }
        let mut bytes = SAMPLE.bytes.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        let error = parse(&bytes).unwrap_err();
        let named = match bit / 8 {
            0..8 => matches!(error, RecordingError::BadMagic { .. }),
            8 => matches!(error, RecordingError::UnsupportedVersion { .. }),
            _ => matches!(
                error,
                RecordingError::Corrupt { .. }
                    | RecordingError::Frame { error: DecodeError::Corrupt { .. }, .. }
            ),
        };
        // The envelope of a frame names damage to its own first bytes in its own way.
        let frame = matches!(error, RecordingError::Frame { .. });
        assert!(named || frame, "bit {bit}: {error}");
    }
}

#[test]
fn every_cut_is_named_so() {
    for cut in (0..SAMPLE.bytes.len()).step_by(3) {
        let error = parse(&SAMPLE.bytes[..cut]).unwrap_err();
        assert!(
            matches!(error, RecordingError::Truncated { have, .. } if have == cut),
            "cut at {cut}: {error}"
        );
    }
    let longer = [&SAMPLE.bytes[..], &[0]].concat();
    assert_eq!(parse(&longer).unwrap_err(), RecordingError::TrailingBytes { extra: 1 });
}

/// Parts written by hand under right checksums, each of which breaks one rule.
#[test]
fn rules_of_the_format_are_enforced() {
    let seal = |part: &[u8]| [part, &crc32fast::hash(part).to_le_bytes()[..]].concat();
    let snapshot = vector(WIRE, "snapshot");
    let delta = vector(WIRE, "delta");
    let (_, start) = Recorder::new(&header(1000)).unwrap();
    let head = |tag: u8, time_us: u64, bytes: u32| {
        seal(&[&[tag][..], &time_us.to_le_bytes(), &bytes.to_le_bytes()].concat())
    };
    let entry = |time_us, frame: &[u8]| [head(1, time_us, frame.len() as u32), frame.to_vec()].concat();
    let push = |parts: &[Vec<u8>]| {
        let mut recording = Recording::new(&Limits::default());
        recording.push(&[vec![start.clone()], parts.to_vec()].concat().concat())
    };
    let reason = |parts: &[Vec<u8>]| push(parts).unwrap_err().to_string();
    assert_eq!(push(&[entry(5, &snapshot), entry(5, &delta)]), Ok(2), "the rest would prove nothing");
    assert!(reason(&[entry(5, &delta)]).contains("before any snapshot"));
    assert!(reason(&[entry(5, &snapshot), entry(4, &delta)]).contains("earlier than the entry before"));
    assert!(reason(&[entry(1001, &snapshot)]).contains("later than the duration"));
    assert!(reason(&[entry(5, &snapshot), entry(6, &delta), entry(7, &delta)]).contains("epoch"));
    assert!(reason(&[head(2, 0, 0)]).contains("unknown tag"));
    assert!(reason(&[entry(0, b"DP")]).contains("cut"));
    assert!(reason(&[entry(0, &[&snapshot[..], &[0]].concat())]).contains("after its end"));
    // A huge length is refused before anything is allocated or awaited.
    assert!(reason(&[head(1, 0, u32::MAX)]).contains("at most"));
    let small = Limits { max_frame_bytes: snapshot.len() - 1, ..Limits::default() };
    let error = Recording::parse(record(&header(9), &[(0, &snapshot)]), &small).unwrap_err();
    assert!(matches!(error, RecordingError::Frame { error: DecodeError::TooLarge { .. }, .. }), "{error}");
    // A closing part that lists something else.
    let empty = record(&header(1000), &[]);
    assert!(parse(&empty).unwrap().is_empty());
    let closing = empty[start.len()..].to_vec();
    let mut wrong = closing[..closing.len() - 4].to_vec();
    wrong[1] = 1;
    assert!(reason(&[seal(&wrong)]).contains("does not list"));
    let mut long = closing[..closing.len() - 4].to_vec();
    long[13..17].copy_from_slice(&u32::MAX.to_le_bytes());
    assert!(parse_closing(&seal(&long)).is_err());
    // The highest byte of the duration, and a letter of the name.
    for (at, says) in [(48, "2^53"), (50, "UTF-8")] {
        let mut bytes = start[..start.len() - 4].to_vec();
        bytes[at] = 0xff;
        let error = Recording::new(&Limits::default()).push(&seal(&bytes)).unwrap_err();
        assert!(error.to_string().contains(says), "{error}");
    }
}

#[test]
fn a_recorder_refuses_what_could_not_be_read() {
    let (snapshot, delta) = (vector(WIRE, "snapshot"), vector(WIRE, "delta"));
    let (mut recorder, _) = Recorder::new(&header(1000)).unwrap();
    assert!(matches!(recorder.frame(0, &delta), Err(RecordError::Order { .. })));
    assert!(matches!(recorder.frame(0, b"DP"), Err(RecordError::Frame(_))));
    assert!(matches!(recorder.frame(1001, &snapshot), Err(RecordError::Time { .. })));
    recorder.frame(500, &snapshot).unwrap();
    assert!(matches!(recorder.frame(499, &delta), Err(RecordError::Time { from_us: 500, .. })));
    recorder.frame(500, &delta).unwrap();
    assert!(matches!(recorder.frame(501, &delta), Err(RecordError::Order { .. })));
    let long = RecordingHeader { name: "n".repeat(256), ..header(0) };
    assert!(matches!(Recorder::new(&long), Err(RecordError::Header { .. })));
    assert!(matches!(Recorder::new(&header(1 << 53)), Err(RecordError::Header { .. })));
}
