//! Wavefront OBJ: polygons with materials, normals computed where the file has none.
//!
//! One mesh for each object (`o`), or for each group (`g`) in files without objects, with a part for each material.
//! Lines, points, curves and surfaces are left out. Materials are double-sided, because winding is unreliable in
//! these files. Texture coordinates are turned to have v point down.

mod build;
mod mtl;
mod parse;

use super::context::Context;
use super::{LoadError, finish};
use crate::{Material, Scene};

/// Reads an OBJ file; `stem` names its geometry where the file does not.
pub(super) fn load(context: &Context<'_>, bytes: &[u8], stem: &str) -> Result<Scene, LoadError> {
    let file = parse::parse(context, bytes, stem)?;
    if file.faces.is_empty() {
        return Err(
            context.invalid("the file", "it has no faces; check that it is an OBJ file with polygons")
        );
    }
    let mut draft = finish::Draft::default();
    let mut library = Vec::new();
    for name in &file.libraries {
        mtl::read(context, name, &mut library, &mut draft.scene);
    }
    let mut unknown = Vec::new();
    for name in &file.material_names {
        let known = library.iter().rev().find(|material: &&Material| material.name == *name);
        if known.is_none() && !name.is_empty() {
            unknown.push(name.as_str());
        }
        draft.scene.materials.push(known.cloned().unwrap_or_else(|| mtl::plain(name)));
    }
    if !unknown.is_empty() {
        let listed = unknown.iter().take(8).copied().collect::<Vec<_>>().join(", ");
        let n = unknown.len();
        context.warn(format!("{n} materials are in no material library and become plain gray: {listed}"));
    }
    build::build(context, file, &mut draft)?;
    finish::finish(context, draft)
}
