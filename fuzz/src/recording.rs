//! Any bytes as a recording, whole, in pieces and from its end.

use dapple_stream::recording::{closing_bytes, parse_closing};
use dapple_stream::{Limits, Recorder, Recording, Replay};

/// Small, so that what a few bytes claim stays fast to make.
const LIMITS: Limits = Limits {
    max_frame_bytes: 1 << 16,
    max_points: 1 << 16,
    max_sets: 256,
    max_cuts: 1 << 16,
    max_light_values: 1 << 16,
};

/// Bytes of a piece, where a recording is pushed in pieces.
const PIECE_BYTES: usize = 13;

/// Reads `data` as a recording. Nothing may panic; in pieces it says the same as at once; its end alone lists the same
/// snapshots; every time can be sought; and what is whole is, recorded again, the same to the byte.
pub fn read_recording(data: &[u8]) {
    let mut whole = Recording::new(&LIMITS);
    let pushed = whole.push(data);
    let mut pieces = Recording::new(&LIMITS);
    let in_pieces = data.chunks(PIECE_BYTES).try_for_each(|piece| pieces.push(piece).map(|_| ()));
    assert_eq!(pushed.is_ok(), in_pieces.is_ok());
    assert_eq!(whole.finish().is_ok(), pieces.finish().is_ok());
    assert_eq!((whole.header(), whole.is_complete()), (pieces.header(), pieces.is_complete()));
    assert_eq!(whole.snapshots(), pieces.snapshots());
    assert!(whole.entries().eq(pieces.entries()));

    let times = whole.entries().map(|entry| entry.time_us).chain([0, u64::MAX]);
    let mut replay = Replay::new(0);
    for time_us in times.take(64) {
        assert!(whole.seek(time_us).end <= whole.len());
        let _ = replay.frames_to(&whole, time_us);
    }

    // The end may be that of another file.
    if let (Ok(bytes), Ok(snapshots)) = (closing_bytes(data), parse_closing(data)) {
        assert_eq!(parse_closing(&data[data.len() - bytes..]), Ok(snapshots));
    }
    if let Ok(recording) = Recording::parse(data.to_vec(), &LIMITS) {
        assert_eq!(parse_closing(data).as_deref(), Ok(recording.snapshots()));
        assert!(record(&recording) == data, "recorded again it differs");
    }
}

/// The bytes of a recording that is whole.
fn record(recording: &Recording) -> Vec<u8> {
    let header = recording.header().expect("it is whole");
    let (mut recorder, mut bytes) = Recorder::new(header).expect("it was read");
    for entry in recording.entries() {
        bytes.extend(recorder.frame(entry.time_us, entry.frame).expect("it was read"));
    }
    bytes.extend(recorder.finish());
    bytes
}
