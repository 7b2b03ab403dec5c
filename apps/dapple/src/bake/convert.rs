//! Scenes that are not glTF become it.

use anyhow::{Result, bail};
use dapple_scene::Scene;

/// A scene as a GLB.
pub(crate) fn to_glb(scene: &Scene) -> Result<Vec<u8>> {
    bail!("{} is no glTF file", scene.name)
}
