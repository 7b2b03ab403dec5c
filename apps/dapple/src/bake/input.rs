//! The scene to bake, as the loader understands it and as its file is written.

use std::path::Path;

use anyhow::{Context, Result};
use dapple_scene::{Files, NoFiles, Origins, Scene, load_with_origins};

use super::document::Document;
use super::gather::gather;
use crate::args::SceneChoice;
use crate::progress::Bar;
use crate::source::{self, Source};

/// What is baked.
pub(crate) struct Input {
    pub(crate) scene: Scene,
    /// The scene as its file gives it, where that was converted: the one that players of its points load.
    pub(crate) given: Option<Scene>,
    pub(crate) origins: Origins,
    pub(crate) document: Document,
    pub(crate) title: String,
}

/// Loads what the arguments name, with everything it refers to.
pub(crate) fn load(choice: &SceneChoice) -> Result<Input> {
    let Source { name, bytes, folder, title } = source::read(choice)?;
    let _wheel = Bar::spinner(&format!("loading {title}"));
    let files: &dyn Files = match &folder {
        Some(folder) => folder,
        None => &NoFiles,
    };
    let is_obj = Path::new(&name).extension().is_some_and(|e| e.eq_ignore_ascii_case("obj"));
    let (name, bytes, given) = if is_obj {
        let scene = dapple_scene::load(&name, &bytes, files)?;
        for warning in &scene.warnings {
            tracing::warn!("{title}: {}", warning.message);
        }
        (format!("{}.glb", scene.name), super::convert::to_glb(&scene)?, Some(scene))
    } else {
        (name, bytes, None)
    };
    let (mut scene, origins) = load_with_origins(&name, &bytes, files)?;
    source::prepare(&mut scene, choice, &title)?;
    let mut document = Document::open(&bytes).with_context(|| format!("{title} cannot be edited"))?;
    gather(&mut document, &name, files).with_context(|| format!("{title} cannot be edited"))?;
    Ok(Input { scene, given, origins, document, title })
}
