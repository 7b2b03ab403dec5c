//! glTF 2.0 with its punctual-light, unlit, emissive-strength, texture-transform and quantization extensions.
//!
//! The `gltf` crate reads the container and the JSON into typed structures. What those leave open is checked here:
//! references, ranges of numbers, sizes, and that no more is read or allocated than is there.

mod accessor;
mod animation;
mod document;
mod material;
mod mesh;
mod node;
mod parse;

use gltf::json::Root;

use super::context::Context;
use super::{LoadError, Origins, finish};
use crate::Scene;
use document::Document;

/// Extensions a file may require.
const SUPPORTED: [&str; 5] = [
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_unlit",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
];

/// Reads a binary glTF file.
pub(super) fn load_glb(context: &Context<'_>, bytes: &[u8]) -> Result<(Scene, Origins), LoadError> {
    let glb = parse::container(context, bytes)?;
    load_json(context, &glb.json, glb.bin.as_deref())
}

/// Reads glTF JSON with the binary chunk of a GLB container, if any.
pub(super) fn load_json(
    context: &Context<'_>,
    json: &[u8],
    bin: Option<&[u8]>,
) -> Result<(Scene, Origins), LoadError> {
    let root = parse::root(context, json)?;
    check_extensions(context, &root)?;
    let document = Document::new(context, &root, bin)?;

    let mut draft = finish::Draft::default();
    material::read(&document, &mut draft.scene)?;
    let meshes = mesh::read(&document, &mut draft.scene)?;
    node::read(&document, &mut draft)?;
    animation::read(&document, &mut draft)?;
    document.warn_of_unused_flaws();
    let (scene, nodes) = finish::finish(context, draft)?;
    Ok((scene, Origins { nodes, meshes }))
}

fn check_extensions(context: &Context<'_>, root: &Root) -> Result<(), LoadError> {
    for extension in root.extensions_required.iter().map(String::as_str) {
        if SUPPORTED.contains(&extension) {
            continue;
        }
        if extension.starts_with("KHR_materials_") {
            context.warn(format!(
                "required extension {extension} changes only the look of materials and is ignored"
            ));
            continue;
        }
        let remedy = match extension {
            "KHR_draco_mesh_compression" | "EXT_meshopt_compression" | "KHR_meshopt_compression" => {
                "export the scene again without mesh compression"
            }
            "KHR_texture_basisu" | "EXT_texture_webp" | "EXT_texture_avif" => {
                "export the scene again with PNG or JPEG textures"
            }
            _ => "export the scene again without it",
        };
        let extension = extension.chars().take(100).collect();
        return Err(LoadError::RequiredExtension { file: context.file(), extension, remedy });
    }
    for extension in root.extensions_used.iter().map(String::as_str) {
        if !SUPPORTED.contains(&extension) {
            let name: String = extension.chars().take(100).collect();
            context.warn(format!("extension {name} is not supported; what it adds is left out"));
        }
    }
    Ok(())
}
