//! What was sent, into a file while it is sent.

use std::fs::File;
use std::io::{BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use dapple_stream::recording::MAX_DURATION_US;
use dapple_stream::{Frame, FrameKind, Recorder, RecordingHeader};

/// A snapshot is recorded again after this, microseconds of scene time, so that a player can begin there.
const SNAPSHOT_EVERY_US: u64 = 5_000_000;

/// A step of scene time longer than this is a jump, microseconds.
const LONGEST_GAP_US: u64 = 30_000_000;

/// A recording that grows beside its file, which it replaces when it is whole.
pub(crate) struct LiveRecording {
    path: PathBuf,
    partial: PathBuf,
    file: BufWriter<File>,
    header: RecordingHeader,
    recorder: Recorder,
    last_us: u64,
    snapshot_us: Option<u64>,
    is_broken: bool,
}

/// The file that grows until it is whole.
fn partial(path: &Path) -> PathBuf {
    path.with_extension(format!("{}.tmp", std::process::id()))
}

/// Removes what was begun of a recording that nobody will finish.
pub(crate) fn discard(path: &Path) {
    // It may not even have been begun.
    let _ = std::fs::remove_file(partial(path));
}

impl LiveRecording {
    pub(crate) fn create(path: &Path, scene_hash: [u8; 32], name: &str) -> Result<LiveRecording> {
        let mut name = name.to_owned();
        while name.len() > dapple_stream::recording::MAX_NAME_BYTES {
            name.pop();
        }
        let header = RecordingHeader { scene_hash, name, duration_us: MAX_DURATION_US };
        let (recorder, bytes) = Recorder::new(&header).context("--record")?;
        let partial = partial(path);
        let file = File::create(&partial).with_context(|| format!("cannot write {}", partial.display()))?;
        let mut recording = LiveRecording {
            path: path.to_owned(),
            partial,
            file: BufWriter::new(file),
            header,
            recorder,
            last_us: 0,
            snapshot_us: None,
            is_broken: false,
        };
        recording.write(&bytes)?;
        Ok(recording)
    }

    /// Whether it is time for a snapshot.
    pub(crate) fn wants_snapshot(&self) -> bool {
        self.snapshot_us.is_none_or(|at_us| self.last_us.saturating_sub(at_us) >= SNAPSHOT_EVERY_US)
    }

    /// Whether scene time has jumped since the last frame: a recording cannot follow, as a player's scene does not jump along.
    pub(crate) fn has_jumped(&self, scene_us: u64) -> bool {
        self.snapshot_us.is_some() && (scene_us < self.last_us || scene_us - self.last_us > LONGEST_GAP_US)
    }

    /// Records a frame at a scene time, which must not go back.
    pub(crate) fn frame(&mut self, scene_us: u64, frame: &Frame) -> Result<()> {
        self.last_us = scene_us.min(MAX_DURATION_US);
        if frame.kind == FrameKind::Snapshot {
            self.snapshot_us = Some(self.last_us);
        }
        let bytes = self.recorder.frame(self.last_us, &frame.bytes)?;
        self.write(&bytes)
    }

    /// Ends it, and puts it in its place; gives the seconds that it covers.
    pub(crate) fn finish(mut self) -> Result<f64> {
        let recorder = std::mem::replace(&mut self.recorder, Recorder::new(&self.header)?.0);
        self.write(&recorder.finish())?;
        let header = RecordingHeader { duration_us: self.last_us, ..self.header.clone() };
        let (_, bytes) = Recorder::new(&header)?;
        let place = |recording: &mut LiveRecording| -> std::io::Result<()> {
            recording.file.seek(SeekFrom::Start(0))?;
            recording.file.write_all(&bytes)?;
            recording.file.flush()?;
            recording.file.get_ref().sync_all()?;
            std::fs::rename(&recording.partial, &recording.path)
        };
        place(&mut self).with_context(|| format!("cannot write {}", self.path.display()))?;
        Ok(self.last_us as f64 * 1e-6)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<()> {
        let written = self.file.write_all(bytes);
        // What is there can still be looked at, up to where it breaks off.
        self.is_broken |= written.is_err();
        written
            .with_context(|| format!("cannot write {}, where what came before stays", self.partial.display()))
    }
}

impl Drop for LiveRecording {
    fn drop(&mut self) {
        // Gone already where it was finished.
        if !self.is_broken {
            let _ = std::fs::remove_file(&self.partial);
        }
    }
}
