//! Brings what a glTF file refers to (buffers, images) into the file itself.

use anyhow::{Context, Result};
use dapple_scene::{Files, read_reference};
use serde_json::json;

use super::document::{BIN, Document, List};
use super::json::Object;

/// Extensions of buffer views that name a buffer of their own.
pub(crate) const COMPRESSED_VIEWS: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

/// Moves all buffers and images that can be read into buffer 0. What cannot be read stays a reference, with a warning.
pub(crate) fn gather(document: &mut Document, name: &str, files: &dyn Files) -> Result<()> {
    gather_buffers(document, name, files)?;
    gather_images(document, name, files)
}

/// Where a buffer's bytes are now.
struct Moved {
    buffer: usize,
    offset: usize,
}

fn gather_buffers(document: &mut Document, name: &str, files: &dyn Files) -> Result<()> {
    let buffers = document.take(List::Buffers);
    let mut first = Object::default();
    let mut moved: Vec<Option<Moved>> = Vec::new();
    let mut kept = Vec::new();
    for (index, raw) in buffers.iter().enumerate() {
        let mut buffer = Object::parse(raw).with_context(|| format!("buffers[{index}]"))?;
        let at = format!("buffers[{index}]");
        let uri: Option<String> = buffer.read("uri")?;
        let bytes = match &uri {
            None if index == 0 && !document.bin.is_empty() => {
                first = buffer;
                moved.push(Some(Moved { buffer: BIN, offset: 0 }));
                continue;
            }
            // The fallback of a compressed buffer has no bytes.
            None => None,
            Some(uri) => match read_reference(name, &at, uri, files) {
                Ok(bytes) => Some(bytes),
                Err(error) => {
                    tracing::warn!("{error}; the reference is kept");
                    None
                }
            },
        };
        let Some(bytes) = bytes else {
            kept.push(raw.clone());
            moved.push(None);
            continue;
        };
        let length = buffer.whole("byteLength")?.unwrap_or(0).min(bytes.len());
        document.bin.resize(document.bin.len().next_multiple_of(16), 0);
        moved.push(Some(Moved { buffer: BIN, offset: document.bin.len() }));
        document.bin.extend_from_slice(&bytes[..length]);
        if index == 0 {
            buffer.remove("uri");
            first = buffer;
        }
    }
    if moved.iter().any(Option::is_some) {
        first.set("byteLength", &document.bin.len())?;
        document.push(List::Buffers, &first)?;
    }
    // Where nothing was brought in, buffer 0 may be one that is elsewhere: bytes that come later need their own in its place.
    if !kept.is_empty() && document.len(List::Buffers) == 0 {
        document.push_value(List::Buffers, &json!({"byteLength": 0}))?;
    }
    let mut kept = kept.into_iter();
    let mut places = Vec::with_capacity(moved.len());
    for place in moved {
        places.push(match place {
            Some(place) => place,
            None => {
                let raw = kept.next().context("a buffer that is kept")?;
                Moved { buffer: document.push(List::Buffers, &Object::parse(&raw)?)?, offset: 0 }
            }
        });
    }
    for index in 0..document.len(List::BufferViews) {
        let mut view = document.object(List::BufferViews, index)?;
        let mut changed = relocate(&mut view, &places)?;
        let mut extensions = view.object("extensions")?;
        for key in COMPRESSED_VIEWS.into_iter().filter(|key| extensions.has(key)).collect::<Vec<_>>() {
            let mut compressed = extensions.object(key)?;
            if relocate(&mut compressed, &places)? {
                extensions.set(key, &compressed)?;
                view.set("extensions", &extensions)?;
                changed = true;
            }
        }
        if changed {
            document.put(List::BufferViews, index, &view)?;
        }
    }
    Ok(())
}

/// Sets buffer and offset of a view to where its bytes are now; whether anything changed.
fn relocate(view: &mut Object, places: &[Moved]) -> Result<bool> {
    let Some(old) = view.whole("buffer")? else { return Ok(false) };
    let Some(place) = places.get(old) else { return Ok(false) };
    if place.buffer == old && place.offset == 0 {
        return Ok(false);
    }
    view.set("buffer", &place.buffer)?;
    let offset = view.whole("byteOffset")?.unwrap_or(0) + place.offset;
    view.set("byteOffset", &offset)?;
    Ok(true)
}

fn gather_images(document: &mut Document, name: &str, files: &dyn Files) -> Result<()> {
    for index in 0..document.len(List::Images) {
        let mut image = document.object(List::Images, index)?;
        let Some(uri) = image.read::<String>("uri")? else { continue };
        let at = format!("images[{index}]");
        let bytes = match read_reference(name, &at, &uri, files) {
            Ok(bytes) => bytes,
            Err(error) => {
                tracing::warn!("{error}; the reference is kept");
                continue;
            }
        };
        let Some(kind) = media_type(&bytes) else {
            tracing::warn!("{name}: {at} is no image that glTF knows; the reference is kept");
            continue;
        };
        let view = document.push_view(&bytes, None)?;
        image.remove("uri");
        image.set("bufferView", &view)?;
        image.set("mimeType", kind)?;
        let is_file = !uri.get(..5).is_some_and(|scheme| scheme.eq_ignore_ascii_case("data:"));
        if is_file && !image.has("name") {
            image.set("name", &uri)?;
        }
        document.put(List::Images, index, &image)?;
    }
    Ok(())
}

/// The media type of an image, from its first bytes.
fn media_type(bytes: &[u8]) -> Option<&'static str> {
    match bytes {
        [0x89, b'P', b'N', b'G', ..] => Some("image/png"),
        [0xff, 0xd8, 0xff, ..] => Some("image/jpeg"),
        [0xab, b'K', b'T', b'X', b' ', b'2', b'0', 0xbb, ..] => Some("image/ktx2"),
        [b'R', b'I', b'F', b'F', _, _, _, _, b'W', b'E', b'B', b'P', ..] => Some("image/webp"),
        _ => None,
    }
}
