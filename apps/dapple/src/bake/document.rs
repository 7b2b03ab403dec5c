//! A glTF file that is being edited: its JSON, of which only what is touched changes, and one binary part that grows.

use anyhow::{Context, Result, bail};
use serde_json::json;

use super::json::{Object, Raw};

/// Lists of the document that are read or added to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum List {
    Accessors,
    BufferViews,
    Buffers,
    Images,
    Materials,
    Meshes,
    Nodes,
    Samplers,
    Textures,
}

impl List {
    const ALL: [(List, &str); 9] = [
        (List::Accessors, "accessors"),
        (List::BufferViews, "bufferViews"),
        (List::Buffers, "buffers"),
        (List::Images, "images"),
        (List::Materials, "materials"),
        (List::Meshes, "meshes"),
        (List::Nodes, "nodes"),
        (List::Samplers, "samplers"),
        (List::Textures, "textures"),
    ];

    fn key(self) -> &'static str {
        List::ALL[self as usize].1
    }
}

/// Where the bytes that go with the JSON are.
pub(crate) const BIN: usize = 0;

/// `bufferView.target` of vertices.
pub(crate) const ARRAY_BUFFER: u32 = 34962;
/// `bufferView.target` of indices.
pub(crate) const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// A glTF document and its bytes.
#[derive(Debug)]
pub(crate) struct Document {
    root: Object,
    /// In the order of [`List::ALL`].
    lists: Vec<Vec<Raw>>,
    /// What buffer 0 holds, once [`super::gather`] has brought everything there.
    pub(crate) bin: Vec<u8>,
    /// Chunks of a GLB behind these, as they are.
    chunks: Vec<u8>,
}

impl Document {
    /// Opens a GLB, or glTF's JSON. Expects what the scene loader has accepted.
    pub(crate) fn open(bytes: &[u8]) -> Result<Document> {
        let (json, bin, chunks) =
            if bytes.starts_with(b"glTF") { split(bytes)? } else { (bytes, &[][..], &[][..]) };
        let json = json.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(json);
        let text = std::str::from_utf8(json).context("the JSON is not UTF-8 text")?;
        let root: Object = serde_json::from_str(text).context("the JSON cannot be read")?;
        let lists = List::ALL.iter().map(|(_, key)| root.list(key)).collect::<Result<_>>()?;
        Ok(Document { root, lists, bin: bin.to_vec(), chunks: chunks.to_vec() })
    }

    pub(crate) fn len(&self, list: List) -> usize {
        self.lists[list as usize].len()
    }

    /// One object of a list.
    pub(crate) fn object(&self, list: List, index: usize) -> Result<Object> {
        let key = list.key();
        let Some(raw) = self.lists[list as usize].get(index) else {
            bail!("{key}[{index}] is named, but there are only {}", self.len(list));
        };
        Object::parse(raw).with_context(|| format!("{key}[{index}]"))
    }

    pub(crate) fn put(&mut self, list: List, index: usize, object: &Object) -> Result<()> {
        self.lists[list as usize][index] = object.to_raw()?;
        Ok(())
    }

    /// Appends an object; gives its index.
    pub(crate) fn push(&mut self, list: List, object: &Object) -> Result<usize> {
        self.lists[list as usize].push(object.to_raw()?);
        Ok(self.len(list) - 1)
    }

    /// Appends an object made of a JSON value.
    pub(crate) fn push_value(&mut self, list: List, value: &serde_json::Value) -> Result<usize> {
        self.push(list, &serde_json::from_value(value.clone())?)
    }

    /// Puts the last object of a list in the place of another one.
    pub(crate) fn swap_remove(&mut self, list: List, index: usize) {
        self.lists[list as usize].swap_remove(index);
    }

    /// Takes all of a list's objects away, so that others take their place.
    pub(crate) fn take(&mut self, list: List) -> Vec<Raw> {
        std::mem::take(&mut self.lists[list as usize])
    }

    /// The document itself. Its lists are not to be found there.
    pub(crate) fn root(&self) -> &Object {
        &self.root
    }

    pub(crate) fn root_mut(&mut self) -> &mut Object {
        &mut self.root
    }

    /// Appends bytes as a buffer view; gives its index.
    pub(crate) fn push_view(&mut self, bytes: &[u8], target: Option<u32>) -> Result<usize> {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let mut view = json!({"buffer": BIN, "byteOffset": self.bin.len(), "byteLength": bytes.len()});
        if let Some(target) = target {
            view["target"] = target.into();
        }
        self.bin.extend_from_slice(bytes);
        if self.len(List::Buffers) == 0 {
            self.push_value(List::Buffers, &json!({"byteLength": 0}))?;
        }
        self.push_value(List::BufferViews, &view)
    }

    /// The bytes of a GLB: pieces to write one after the other. `name` is for the message if it would be too large.
    pub(crate) fn to_glb(&self, name: &str) -> Result<Vec<Vec<u8>>> {
        let mut json = serde_json::to_vec(&self.json(None)?)?;
        json.resize(json.len().next_multiple_of(4), b' ');
        let mut bin = self.bin.clone();
        bin.resize(bin.len().next_multiple_of(4), 0);
        let bin_bytes = if bin.is_empty() { 0 } else { 8 + bin.len() as u64 };
        let length = 20 + json.len() as u64 + bin_bytes + self.chunks.len() as u64;
        let Ok(length) = u32::try_from(length) else {
            bail!(
                "{name} would have {length} bytes, but a GLB is limited to 4 GiB; bake smaller or fewer textures, or parts \
                 of the scene"
            )
        };
        let mut head = Vec::with_capacity(28 + json.len());
        head.extend(b"glTF");
        head.extend(2u32.to_le_bytes());
        head.extend(length.to_le_bytes());
        head.extend((json.len() as u32).to_le_bytes());
        head.extend(b"JSON");
        head.extend(&json);
        if !bin.is_empty() {
            head.extend((bin.len() as u32).to_le_bytes());
            head.extend(b"BIN\0");
        }
        Ok(vec![head, bin, self.chunks.clone()])
    }

    /// The bytes of a .gltf file that has everything in it.
    pub(crate) fn to_gltf(&self) -> Result<Vec<u8>> {
        use base64::Engine;
        let data = base64::engine::general_purpose::STANDARD.encode(&self.bin);
        Ok(serde_json::to_vec(&self.json(Some(format!("data:application/octet-stream;base64,{data}")))?)?)
    }

    /// The document with its lists, and where the bytes are if not in a GLB.
    fn json(&self, uri: Option<String>) -> Result<Object> {
        let mut document = self.root.clone();
        for ((list, key), objects) in List::ALL.iter().zip(&self.lists) {
            if objects.is_empty() && !document.has(key) {
                continue;
            }
            if *list == List::Buffers && !self.bin.is_empty() {
                let mut buffers = objects.clone();
                let mut buffer = Object::parse(&buffers[BIN])?;
                buffer.set("byteLength", &self.bin.len())?;
                if let Some(uri) = &uri {
                    buffer.set("uri", uri)?;
                }
                buffers[BIN] = buffer.to_raw()?;
                document.set(key, &buffers)?;
            } else {
                document.set(key, objects)?;
            }
        }
        Ok(document)
    }
}

/// JSON, binary part and further chunks of a GLB.
fn split(bytes: &[u8]) -> Result<(&[u8], &[u8], &[u8])> {
    let u32_at = |offset: usize| -> Result<usize> {
        let four =
            bytes.get(offset..).and_then(|rest| rest.first_chunk::<4>()).context("the GLB is cut off")?;
        Ok(u32::from_le_bytes(*four) as usize)
    };
    let whole = bytes.get(..u32_at(8)?).context("the GLB is cut off")?;
    let chunk = |offset: usize| -> Result<(&[u8], usize)> {
        let end = (offset + 8).saturating_add(u32_at(offset)?);
        Ok((whole.get(offset + 8..end).context("a chunk of the GLB is cut off")?, end))
    };
    let (json, end) = chunk(12)?;
    if whole.get(end + 4..end + 8) != Some(&b"BIN\0"[..]) {
        return Ok((json, &[], &whole[end..]));
    }
    let (bin, end) = chunk(end)?;
    // Padding between chunks belongs to the chunk; a file that forgot it ends here.
    Ok((json, bin, whole.get(end..).unwrap_or_default()))
}
