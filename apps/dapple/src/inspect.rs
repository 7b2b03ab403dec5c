//! `dapple inspect`: what is in a recording, and whether it is whole.

use std::path::Path;

use anyhow::{Context, Result, bail};
use dapple_scene::SceneHash;
use dapple_stream::{FrameKind, Limits, Recording, Subscriber};

use crate::args::{InspectArgs, SceneChoice};
use crate::source::{self, read_limited};

/// The largest recording that is read.
pub(crate) const MAX_RECORDING_BYTES: u64 = 4 << 30;

pub(crate) fn run(args: &InspectArgs) -> Result<()> {
    let recording = read(&args.file)?;
    let damage = recording.finish().err();
    let Some(header) = recording.header() else {
        // Without a header there is an error.
        bail!("{}: {}", args.file.display(), damage.map_or_else(String::new, |e| e.to_string()));
    };
    let seconds = header.duration_us as f64 * 1e-6;
    say!("name       {}", header.name);
    say!("scene      {}", SceneHash(header.scene_hash));
    say!("duration   {seconds:.3} s");

    let mut subscriber = Subscriber::new(Some(header.scene_hash), Limits::default());
    let mut refused = None;
    let (mut snapshots, mut deltas, mut sets) = (Kind::default(), Kind::default(), Kind::default());
    for (number, entry) in recording.entries().enumerate() {
        match entry.header.kind {
            FrameKind::Snapshot => snapshots.add(entry.frame.len()),
            FrameKind::Delta => deltas.add(entry.frame.len()),
            FrameKind::Sets => sets.add(entry.frame.len()),
        }
        if let Err(error) = subscriber.receive(entry.frame)
            && refused.is_none()
        {
            refused = Some((number, error));
        }
    }
    if let Some(store) = subscriber.store() {
        let layout = store.layout();
        let spacing_m = layout.spacing_m();
        say!("points     {} on {} instances, spacing {spacing_m:.4} m", layout.len(), layout.sets().len());
        if store.bent().is_some() {
            say!("           with bent normals");
        }
        if store.light_count() > 0 {
            let leans = if store.lights().is_some_and(|lights| lights.has_leans()) {
                ", and where on it"
            } else {
                ""
            };
            say!("lights     {}: how much of each the points see{leans}", store.light_count());
        }
    }
    let per_second = |bytes: u64| if seconds > 0.0 { bytes as f64 * 8e-3 / seconds } else { 0.0 };
    say!(
        "snapshots  {} in {} bytes, {:.1} kbit/s",
        snapshots.count,
        snapshots.bytes,
        per_second(snapshots.bytes)
    );
    say!("deltas     {} in {} bytes, {:.1} kbit/s", deltas.count, deltas.bytes, per_second(deltas.bytes));
    if sets.count > 0 {
        let (count, bytes) = (sets.count, sets.bytes);
        say!("sets       {count} come or go in {bytes} bytes, {:.1} kbit/s", per_second(bytes));
    }
    say!(
        "file       {} bytes, {:.1} kbit/s",
        recording.size_bytes(),
        per_second(recording.size_bytes() as u64)
    );
    let at: Vec<String> =
        recording.snapshots().iter().map(|at| format!("{:.2}", at.time_us as f64 * 1e-6)).collect();
    say!("groups     at {} s", at.join(", "));

    if let Some(error) = damage {
        bail!("{}: {error}", args.file.display());
    }
    if let Some((number, error)) = refused {
        bail!("{}: entry {number} cannot be played: {error}", args.file.display());
    }
    say!("integrity  whole; every frame can be played");
    compare_scene(args, header.scene_hash)
}

/// Frames of a kind.
#[derive(Default)]
struct Kind {
    count: u64,
    bytes: u64,
}

impl Kind {
    fn add(&mut self, bytes: usize) {
        self.count += 1;
        self.bytes += bytes as u64;
    }
}

/// A recording as far as it is sound.
fn read(path: &Path) -> Result<Recording> {
    let bytes = read_limited(path, MAX_RECORDING_BYTES)
        .with_context(|| format!("cannot read the recording {}", path.display()))?;
    let mut recording = Recording::new(&Limits::default());
    // Damage is told after what could be read.
    let _ = recording.push(&bytes);
    Ok(recording)
}

/// Whether the light belongs to the scene that was named, if one was.
fn compare_scene(args: &InspectArgs, hash: [u8; 32]) -> Result<()> {
    if args.scene.is_none() && args.builtin.is_none() {
        return Ok(());
    }
    let choice = SceneChoice {
        scene: args.scene.clone(),
        builtin: args.builtin.clone(),
        detail: args.detail,
        animation: None,
    };
    let loaded = source::load(&choice, None)?;
    if loaded.scene.hash().0 != hash {
        bail!(
            "{} holds light of another scene than {} ({}): record that one",
            args.file.display(),
            loaded.title,
            loaded.scene.hash()
        );
    }
    say!("belongs to {}", loaded.title);
    Ok(())
}
