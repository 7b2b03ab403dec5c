//! `dapple record`: the stream of a scene into a file. It is written at the end, so an interrupted run leaves nothing.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};

use crate::args::{RecordArgs, SceneChoice};
use crate::light::{Take, record};
use crate::picture::write_file;
use crate::source;

pub(crate) fn run(args: &RecordArgs) -> Result<()> {
    let name = scene_name(&args.scene);
    let output = args.output.clone().unwrap_or_else(|| PathBuf::from(format!("{name}.dapple")));
    if !output.extension().is_some_and(|e| e.eq_ignore_ascii_case("dapple")) {
        bail!("{} would hold a recording: name it .dapple", output.display());
    }
    if output.is_dir() {
        bail!("cannot write {}: it is a folder", output.display());
    }
    let loaded = source::load(&args.scene, None)?;
    let take = Take {
        loaded: &loaded,
        light: &args.light,
        seconds: args.seconds,
        snapshot_every_s: args.snapshot_every,
        name: args.name.clone().unwrap_or(name),
    };
    let taken = record(&take)?;
    write_file(&output, &taken.bytes)?;
    say!(
        "wrote {} ({:.2} MB): {:.2} s, {} points, {} updates, {:.1} kbit/s",
        output.display(),
        taken.bytes.len() as f64 / 1e6,
        taken.seconds,
        taken.points,
        taken.updates,
        taken.frame_bytes as f64 * 8e-3 / taken.seconds
    );
    Ok(())
}

/// What to call the scene: its file's name without folder and ending.
fn scene_name(choice: &SceneChoice) -> String {
    let stem = choice.scene.as_deref().and_then(Path::file_stem).map(|s| s.to_string_lossy().into_owned());
    stem.or(choice.builtin.clone()).unwrap_or_else(|| "scene".to_owned())
}
