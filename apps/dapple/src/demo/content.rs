//! The demo's scene and its recording, made once.

use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, Result};
use dapple_scene::{NoFiles, Scene, builtin};
use dapple_stream::{Limits, Recording, codec};

use crate::args::DemoArgs;
use crate::light::{Take, record};
use crate::page::{FILE_NAME, ViewerJson};
use crate::picture::write_file;
use crate::progress::Bar;
use crate::source::{Loaded, resolve_radius};

const SCENE: &str = "scene.glb";
const STREAM: &str = "scene.dapple";
/// Says what the other two were made from.
const MADE: &str = "made.txt";

/// Makes scene, recording and viewer.json in the folder, unless they are there already.
pub(super) fn make(args: &DemoArgs) -> Result<()> {
    let wheel = Bar::spinner(&format!("making {}", args.builtin));
    let glb = builtin::glb(&args.builtin, args.detail)?;
    let scene = dapple_scene::load(SCENE, &glb, &NoFiles).context("the demo's scene does not load")?;
    drop(wheel);
    let key = key(args, &scene);
    if !args.fresh && is_made(&args.out, &key, &scene) {
        say!("scene and light in {} are up to date", args.out.display());
        return Ok(());
    }
    let title = format!("built-in {}, detail {}", args.builtin, args.detail);
    let loaded = Loaded { scene: Arc::new(scene), title };
    let take = Take {
        loaded: &loaded,
        light: &args.light,
        seconds: args.seconds,
        snapshot_every_s: 5.0,
        name: args.builtin.clone(),
    };
    let taken = record(&take)?;
    // What says that all is made comes last.
    let _ = std::fs::remove_file(args.out.join(MADE));
    write_file(&args.out.join(SCENE), &glb)?;
    write_file(&args.out.join(STREAM), &taken.bytes)?;
    let (radius_m, _) = resolve_radius(&loaded.scene, &args.light.visibility)?;
    let json = ViewerJson {
        scene: SCENE.to_owned(),
        stream: Some(STREAM.to_owned()),
        radius: Some(radius_m),
        ..ViewerJson::default()
    };
    write_file(&args.out.join(FILE_NAME), &serde_json::to_vec_pretty(&json)?)?;
    write_file(&args.out.join(MADE), key.as_bytes())?;
    say!(
        "made {}: scene {:.1} MB, light {:.1} MB for {:.1} s on {} points",
        args.out.display(),
        glb.len() as f64 / 1e6,
        taken.bytes.len() as f64 / 1e6,
        taken.seconds,
        taken.points
    );
    Ok(())
}

/// Everything that the content depends on.
fn key(args: &DemoArgs, scene: &Scene) -> String {
    format!(
        "dapple {}, wire {}, scene {}\n{:?}, seconds {:?}\n",
        env!("CARGO_PKG_VERSION"),
        codec::VERSION,
        scene.hash(),
        args.light,
        args.seconds
    )
}

/// Whether the folder holds what the key stands for, whole.
fn is_made(folder: &Path, key: &str, scene: &Scene) -> bool {
    let read = |name: &str| std::fs::read(folder.join(name)).ok();
    let same_key = read(MADE).is_some_and(|made| made == key.as_bytes());
    let same_scene = || {
        let loaded = dapple_scene::load(SCENE, &read(SCENE)?, &NoFiles).ok()?;
        Some(loaded.hash() == scene.hash())
    };
    let whole = || Recording::parse(read(STREAM)?, &Limits::default()).ok()?.header().map(|h| h.scene_hash);
    same_key
        && folder.join(FILE_NAME).is_file()
        && same_scene() == Some(true)
        && whole() == Some(scene.hash().0)
}
