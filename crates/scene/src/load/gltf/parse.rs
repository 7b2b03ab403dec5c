//! From bytes to the `gltf` crate's typed document, with errors that name the place.

use gltf::binary::Error as BinaryError;
use gltf::json::Root;
use gltf::{Error, Glb};
use serde_json::Value;

use crate::load::LoadError;
use crate::load::context::Context;

/// Opens a GLB container.
pub(super) fn container<'a>(context: &Context<'_>, bytes: &'a [u8]) -> Result<Glb<'a>, LoadError> {
    let damaged = |problem: String| LoadError::Container { file: context.file(), problem };
    if !bytes.starts_with(b"glTF") {
        return Err(damaged("it does not begin with 'glTF'".to_owned()));
    }
    let u32_at = |offset| Some(u32::from_le_bytes(*bytes.get(offset..)?.first_chunk()?));
    let (Some(version), Some(length)) = (u32_at(4), u32_at(8)) else {
        return Err(context.truncated("the GLB header", 12, bytes.len() as u64));
    };
    if version != 2 {
        let found = format!("{version} (in the GLB header)");
        return Err(LoadError::Version { file: context.file(), found });
    }
    // The library subtracts the header from this length unchecked, and reads on behind it.
    let length = length as usize;
    if length < 12 {
        return Err(damaged(format!("its header says that it is {length} bytes long, less than a header")));
    }
    let Some(whole) = bytes.get(..length) else {
        return Err(context.truncated("the GLB file", length as u64, bytes.len() as u64));
    };
    if bytes.len() > length {
        let extra = bytes.len() - length;
        context.warn(format!("{extra} bytes after the end of the GLB container are ignored"));
    }
    let glb = Glb::from_slice(whole).map_err(|error| match error {
        Error::Binary(BinaryError::ChunkLength { ty, length, length_read }) => {
            context.truncated(format!("the {ty:?} chunk"), u64::from(length), length_read as u64)
        }
        Error::Binary(BinaryError::Io(_)) => damaged("it ends within the header of a chunk".to_owned()),
        Error::Binary(BinaryError::ChunkType(_) | BinaryError::UnknownChunkType(_)) => {
            damaged("its first two chunks must be JSON and BIN, but one is of another kind".to_owned())
        }
        other => damaged(other.to_string()),
    })?;
    if length > 20 + glb.json.len() + glb.bin.as_ref().map_or(0, |bin| 8 + bin.len()) {
        context.warn("GLB chunks behind the binary chunk are ignored".to_owned());
    }
    Ok(glb)
}

/// Parses a glTF document, whose version is one that can be read.
pub(super) fn root(context: &Context<'_>, json: &[u8]) -> Result<Root, LoadError> {
    let json_error = |problem: String| LoadError::Json { file: context.file(), problem };
    let json = json.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(json);
    let text = std::str::from_utf8(json)
        .map_err(|e| json_error(format!("byte {} is not UTF-8 text", e.valid_up_to())))?;
    let mut reader = serde_json::Deserializer::from_str(text);
    let first = match serde_path_to_error::deserialize::<_, Root>(&mut reader) {
        Ok(root) => {
            reader.end().map_err(|e| json_error(e.to_string()))?;
            check_version(context, &root.asset.version, root.asset.min_version.as_deref())?;
            return Ok(root);
        }
        Err(error) if error.inner().is_data() => error,
        Err(error) => return Err(json_error(error.inner().to_string())),
    };
    // What the typed document refuses may be of another version, or be mended.
    let mut value: Value = serde_json::from_str(text).map_err(|e| json_error(e.to_string()))?;
    if let Some(version) = value.pointer("/asset/version").and_then(Value::as_str) {
        check_version(context, version, value.pointer("/asset/minVersion").and_then(Value::as_str))?;
    }
    mend(context, &mut value);
    serde_path_to_error::deserialize::<_, Root>(value).map_err(|second| {
        // The first error knows its line, but may be about what could be mended.
        let same = first.path().to_string() == second.path().to_string();
        let error = if same { first } else { second };
        let at = match error.path().to_string() {
            root if root == "." => "the file".to_owned(),
            path => path.chars().take(100).collect(),
        };
        LoadError::Schema { file: context.file(), at, problem: error.inner().to_string() }
    })
}

fn check_version(context: &Context<'_>, version: &str, minimum: Option<&str>) -> Result<(), LoadError> {
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

/// Rewrites what glTF allows, but the typed document refuses: whole numbers written as `1.0`, scenes without nodes, and
/// animation channels that extensions aim at something else than a node.
fn mend(context: &Context<'_>, root: &mut Value) {
    write_as_integers(root);
    let lists = |root: &mut Value, key| root.get_mut(key).and_then(Value::as_array_mut).map(std::mem::take);
    if let Some(mut scenes) = lists(root, "scenes") {
        for scene in scenes.iter_mut().filter_map(Value::as_object_mut) {
            scene.entry("nodes").or_insert_with(|| Value::Array(Vec::new()));
        }
        root["scenes"] = Value::Array(scenes);
    }
    if let Some(mut animations) = lists(root, "animations") {
        for (i, animation) in animations.iter_mut().enumerate() {
            let Some(channels) = animation.get_mut("channels").and_then(Value::as_array_mut) else {
                continue;
            };
            let count = channels.len();
            let aims_elsewhere = |channel: &Value| {
                channel.get("target").and_then(Value::as_object).is_some_and(|to| !to.contains_key("node"))
            };
            channels.retain(|channel| !aims_elsewhere(channel));
            if channels.len() < count {
                let n = count - channels.len();
                context.warn(format!("animation {i}: {n} channels animate no node and are left out"));
            }
        }
        root["animations"] = Value::Array(animations);
    }
}

fn write_as_integers(value: &mut Value) {
    match value {
        Value::Number(number) if number.is_f64() => {
            let whole = number.as_f64().filter(|x| (0.0..=9e15).contains(x) && x.fract() == 0.0);
            if let Some(x) = whole {
                *value = Value::from(x as u64);
            }
        }
        Value::Array(list) => list.iter_mut().for_each(write_as_integers),
        Value::Object(map) => map.values_mut().for_each(write_as_integers),
        _ => {}
    }
}
