//! The scene's file, as viewers fetch it: one file, named after its content, compressed once.

use std::io::Write;
use std::sync::Arc;

use anyhow::{Context, Result, bail};
use axum::body::Bytes;
use dapple_scene::{NoFiles, Scene, Spare};
use flate2::Compression;
use flate2::write::GzEncoder;

use crate::args::{Named, SceneChoice};
use crate::bake;
use crate::source;

/// Content is compressed where that takes at least a twentieth off.
const WORTH_IT: f64 = 0.95;

/// A scene that is served.
pub(crate) struct Asset {
    /// As viewers must load it, spare instances included.
    pub(crate) scene: Arc<Scene>,
    pub(crate) title: String,
    /// Its file's name: the hash of its content, and its kind.
    pub(crate) name: String,
    pub(crate) plain: Bytes,
    pub(crate) gzip: Option<Bytes>,
    pub(crate) spares: Vec<Spare>,
}

impl Asset {
    /// Loads what the arguments name, and makes one file of it.
    pub(crate) fn load(choice: &SceneChoice, spares: &[Named<u32>]) -> Result<Asset> {
        let source::Source { name, bytes, title, .. } = source::read(choice)?;
        let is_glb = bytes.starts_with(b"glTF");
        // One that needs no other file is served as it is.
        let alone = is_glb.then(|| dapple_scene::load(&name, &bytes, &NoFiles)).and_then(Result::ok);
        let (mut scene, bytes) = match alone {
            Some(scene) => (scene, bytes),
            None => {
                let bytes = bake::pack(choice).with_context(|| format!("{title} cannot be made one file"))?;
                let scene = dapple_scene::load("scene.glb", &bytes, &NoFiles)
                    .with_context(|| format!("{title} made one file does not load"))?;
                (scene, bytes)
            }
        };
        source::prepare(&mut scene, choice, &title)?;
        let spares = find_spares(&scene, spares)?;
        scene.add_spares(&spares)?;
        let hash = blake3::hash(&bytes).to_hex();
        let mut encoder = GzEncoder::new(Vec::new(), Compression::new(6));
        encoder.write_all(&bytes).context("cannot compress the scene")?;
        let packed = encoder.finish().context("cannot compress the scene")?;
        let gzip = ((packed.len() as f64) < WORTH_IT * bytes.len() as f64).then(|| packed.into());
        Ok(Asset {
            scene: Arc::new(scene),
            title,
            name: format!("{}.glb", &hash[..32]),
            plain: bytes.into(),
            gzip,
            spares,
        })
    }
}

/// The instances that the names stand for.
fn find_spares(scene: &Scene, named: &[Named<u32>]) -> Result<Vec<Spare>> {
    let mut spares = Vec::new();
    for Named { name, value } in named {
        let of_name = |instance: &&dapple_scene::Instance| {
            scene.nodes[instance.node as usize].name == *name
                || scene.meshes[instance.mesh as usize].name == *name
        };
        let Some(instance) = scene.instances.iter().position(|instance| of_name(&instance)) else {
            let mut names: Vec<&str> = scene
                .instances
                .iter()
                .map(|instance| scene.nodes[instance.node as usize].name.as_str())
                .collect();
            names.sort_unstable();
            names.dedup();
            names.truncate(20);
            bail!("--spare {name}: the scene has no such object; some that it has: {}", names.join(", "));
        };
        spares.push(Spare { instance: instance as u32, count: *value });
    }
    Ok(spares)
}
