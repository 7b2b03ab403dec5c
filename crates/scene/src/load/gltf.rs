//! glTF 2.0 with its punctual-light, unlit, emissive-strength, texture-transform and quantization extensions.
//!
//! The JSON tree is read by hand instead of through a typed schema: every error can then name its place, and only
//! what a scene uses must be well-formed.

mod accessor;
mod animation;
mod document;
mod glb;
mod json;
mod material;
mod mesh;
mod node;

use serde_json::Value;

use super::context::Context;
use super::{LoadError, finish};
use crate::Scene;
use document::Document;
use json::Object;

/// Extensions a file may require.
const SUPPORTED: [&str; 5] = [
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_unlit",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
];

/// Reads a binary glTF file.
pub(super) fn load_glb(context: &Context<'_>, bytes: &[u8]) -> Result<Scene, LoadError> {
    let (json, bin) = glb::split(context, bytes)?;
    load_json(context, json, bin)
}

/// Reads glTF JSON with the binary chunk of a GLB container, if any.
pub(super) fn load_json(context: &Context<'_>, json: &[u8], bin: Option<&[u8]>) -> Result<Scene, LoadError> {
    let json = json.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(json);
    let parse_error = |problem: String| LoadError::Json { file: context.file(), problem };
    let text = std::str::from_utf8(json)
        .map_err(|e| parse_error(format!("byte {} is not UTF-8 text", e.valid_up_to())))?;
    let value: Value = serde_json::from_str(text).map_err(|e| parse_error(e.to_string()))?;
    let root =
        Object::new(context, &value, String::new()).map_err(|_| parse_error("not an object".to_owned()))?;
    check_version(context, &root)?;
    check_extensions(context, &root)?;
    root.uint("scene")?;
    let document = Document::new(context, root, bin)?;

    let mut draft = finish::Draft::default();
    material::read(&document, &mut draft.scene)?;
    mesh::read(&document, &mut draft.scene)?;
    node::read(&document, &mut draft)?;
    animation::read(&document, &mut draft)?;
    document.warn_of_unused_flaws();
    finish::finish(context, draft)
}

fn check_version(context: &Context<'_>, root: &Object<'_>) -> Result<(), LoadError> {
    let asset = root.object("asset")?.ok_or_else(|| LoadError::Missing {
        file: context.file(),
        at: "the file".to_owned(),
        property: "asset",
    })?;
    let version = asset.string("version")?.ok_or_else(|| asset.missing("version"))?;
    let minimum = asset.string("minVersion")?;
    let parse = |v: &str| {
        let (major, minor) = v.split_once('.')?;
        Some((major.parse::<u32>().ok()?, minor.parse::<u32>().ok()?))
    };
    let wrong = |v: &str| LoadError::Version { file: context.file(), found: v.chars().take(20).collect() };
    if let Some(minimum) = minimum
        && parse(minimum).is_none_or(|v| v > (2, 0))
    {
        return Err(wrong(minimum));
    }
    match parse(version) {
        Some((2, minor)) => {
            if minor > 0 {
                context.warn(format!("glTF version 2.{minor} is read as 2.0"));
            }
            Ok(())
        }
        _ => Err(wrong(version)),
    }
}

fn check_extensions(context: &Context<'_>, root: &Object<'_>) -> Result<(), LoadError> {
    let names = |key| root.array(key).map(|list| list.iter().filter_map(Value::as_str));
    for extension in names("extensionsRequired")? {
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
    for extension in names("extensionsUsed")? {
        if !SUPPORTED.contains(&extension) {
            let name: String = extension.chars().take(100).collect();
            context.warn(format!("extension {name} is not supported; what it adds is left out"));
        }
    }
    Ok(())
}
