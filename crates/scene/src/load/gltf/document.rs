//! The tables of a glTF file and its buffers.

use std::cell::{Cell, RefCell};
use std::collections::HashMap;
use std::rc::Rc;

use super::accessor::ANY;
use super::json::Object;
use crate::load::context::Context;
use crate::load::{LoadError, uri};

/// Everything a glTF file lists, not yet interpreted.
pub(super) struct Document<'a> {
    pub(super) context: &'a Context<'a>,
    pub(super) root: Object<'a>,
    pub(super) accessors: Vec<Object<'a>>,
    pub(super) views: Vec<Object<'a>>,
    pub(super) nodes: Vec<Object<'a>>,
    pub(super) meshes: Vec<Object<'a>>,
    pub(super) skins: Vec<Object<'a>>,
    pub(super) materials: Vec<Object<'a>>,
    pub(super) textures: Vec<Object<'a>>,
    pub(super) images: Vec<Object<'a>>,
    pub(super) samplers: Vec<Object<'a>>,
    pub(super) cameras: Vec<Object<'a>>,
    pub(super) animations: Vec<Object<'a>>,
    pub(super) scenes: Vec<Object<'a>>,
    buffers: Vec<Buffer<'a>>,
}

/// A buffer; one that cannot be had is an error only when something reads it.
struct Buffer<'a> {
    bytes: Bytes<'a>,
    length: u64,
    failure: RefCell<Option<LoadError>>,
    failed: Cell<bool>,
}

enum Bytes<'a> {
    Borrowed(&'a [u8]),
    Shared(Rc<Vec<u8>>),
}

impl Bytes<'_> {
    fn as_slice(&self) -> &[u8] {
        match self {
            Bytes::Borrowed(bytes) => bytes,
            Bytes::Shared(bytes) => bytes,
        }
    }
}

impl<'a> Document<'a> {
    pub(super) fn new(
        context: &'a Context<'a>,
        root: Object<'a>,
        glb_bin: Option<&'a [u8]>,
    ) -> Result<Self, LoadError> {
        let buffers = read_buffers(context, &root.entities("buffers", "buffer")?, glb_bin)?;
        Ok(Document {
            context,
            accessors: root.entities("accessors", "accessor")?,
            views: root.entities("bufferViews", "buffer view")?,
            nodes: root.entities("nodes", "node")?,
            meshes: root.entities("meshes", "mesh")?,
            skins: root.entities("skins", "skin")?,
            materials: root.entities("materials", "material")?,
            textures: root.entities("textures", "texture")?,
            images: root.entities("images", "image")?,
            samplers: root.entities("samplers", "sampler")?,
            cameras: root.entities("cameras", "camera")?,
            animations: root.entities("animations", "animation")?,
            scenes: root.entities("scenes", "scene")?,
            buffers,
            root,
        })
    }

    /// The bytes of a buffer view and its stride, if it has one.
    pub(super) fn view(&self, index: usize) -> Result<(&[u8], Option<usize>), LoadError> {
        let view = &self.views[index];
        let buffer_index =
            view.index("buffer", "buffer", self.buffers.len())?.ok_or_else(|| view.missing("buffer"))?;
        let length = view.uint("byteLength")?.ok_or_else(|| view.missing("byteLength"))?;
        let offset = view.uint("byteOffset")?.unwrap_or(0);
        let stride = view.uint("byteStride")?;
        let buffer = &self.buffers[buffer_index];
        if buffer.failed.get() {
            return Err(match buffer.failure.take() {
                Some(failure) => failure,
                None => view.invalid(format!("needs buffer {buffer_index}, which could not be read")),
            });
        }
        let bytes = buffer.bytes.as_slice();
        let bytes = &bytes[..bytes.len().min(usize::try_from(buffer.length).unwrap_or(usize::MAX))];
        let end = offset.saturating_add(length);
        if end > bytes.len() as u64 {
            let at = format!("{} (in buffer {buffer_index})", view.at);
            return Err(self.context.truncated(at, end, bytes.len() as u64));
        }
        // A stride over 252 is against the specification but harmless: reads are checked against the view.
        let stride = stride.map(|s| usize::try_from(s).unwrap_or(usize::MAX));
        Ok((&bytes[offset as usize..end as usize], stride))
    }

    /// Lists what never mattered for the scene but is wrong all the same.
    pub(super) fn warn_of_unused_flaws(&self) {
        for buffer in &self.buffers {
            if let Some(failure) = buffer.failure.take() {
                self.context.warn(format!("not needed by the scene, but wrong: {failure}"));
            }
        }
        for i in 0..self.accessors.len() {
            if let Err(flaw) = self.elements(i, "unused".to_owned(), ANY) {
                self.context.warn(format!("not needed by the scene, but wrong: {flaw}"));
            }
        }
    }
}

fn read_buffers<'a>(
    context: &Context<'_>,
    objects: &[Object<'_>],
    glb_bin: Option<&'a [u8]>,
) -> Result<Vec<Buffer<'a>>, LoadError> {
    let mut by_path: HashMap<String, Rc<Vec<u8>>> = HashMap::new();
    let mut buffers = Vec::new();
    for (i, object) in objects.iter().enumerate() {
        let length = object.uint("byteLength")?.ok_or_else(|| object.missing("byteLength"))?;
        let bytes = match (object.string("uri")?, glb_bin) {
            (Some(reference), _) => read_buffer(context, &object.at, reference, &mut by_path),
            (None, Some(bin)) if i == 0 => Ok(Bytes::Borrowed(bin)),
            (None, _) => {
                let problem = "has no uri, and there is no binary chunk for it; export the file again";
                Err(object.invalid(problem))
            }
        };
        let checked = bytes.and_then(|bytes| {
            let has = bytes.as_slice().len() as u64;
            if has < length { Err(context.truncated(object.at.as_str(), length, has)) } else { Ok(bytes) }
        });
        let (bytes, failure) = match checked {
            Ok(bytes) => (bytes, None),
            Err(failure) => (Bytes::Borrowed(&[]), Some(failure)),
        };
        let failed = Cell::new(failure.is_some());
        buffers.push(Buffer { bytes, length, failure: RefCell::new(failure), failed });
    }
    Ok(buffers)
}

fn read_buffer<'a>(
    context: &Context<'_>,
    at: &str,
    reference: &str,
    by_path: &mut HashMap<String, Rc<Vec<u8>>>,
) -> Result<Bytes<'a>, LoadError> {
    let path = match uri::resolve(context, at, reference)? {
        uri::Target::Data(bytes) => return Ok(Bytes::Shared(Rc::new(bytes))),
        uri::Target::File(path) => path,
    };
    if let Some(bytes) = by_path.get(&path) {
        return Ok(Bytes::Shared(Rc::clone(bytes)));
    }
    let bytes = Rc::new(uri::read_file(context, at, path.clone())?);
    by_path.insert(path, Rc::clone(&bytes));
    Ok(Bytes::Shared(bytes))
}
