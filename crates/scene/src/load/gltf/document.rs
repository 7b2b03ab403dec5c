//! The tables of a glTF file and its buffers.

use std::cell::{Cell, RefCell};
use std::collections::HashMap;
use std::rc::Rc;

use gltf::json::{Index, Root, buffer};

use super::accessor::ANY;
use crate::load::context::{Context, is_usable};
use crate::load::{LoadError, uri};

/// A glTF file and its buffers, not yet interpreted.
pub(super) struct Document<'a> {
    pub(super) context: &'a Context<'a>,
    pub(super) root: &'a Root,
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

/// What to call an object in messages: `mesh 3 "column"`.
pub(super) fn label(kind: &str, index: usize, name: &Option<String>) -> String {
    match name {
        Some(name) => format!("{kind} {index} \"{}\"", name.chars().take(60).collect::<String>()),
        None => format!("{kind} {index}"),
    }
}

/// An object's own name, or a made-up one.
pub(super) fn name_of(kind: &str, index: usize, name: &Option<String>) -> String {
    name.clone().filter(|name| !name.is_empty()).unwrap_or_else(|| format!("{kind} {index}"))
}

impl<'a> Document<'a> {
    pub(super) fn new(
        context: &'a Context<'a>,
        root: &'a Root,
        glb_bin: Option<&'a [u8]>,
    ) -> Result<Self, LoadError> {
        Ok(Document { context, root, buffers: read_buffers(context, root, glb_bin)? })
    }

    /// The place in its list of an object that property `key` of the object `at` refers to.
    pub(super) fn resolve<T>(
        &self,
        index: Index<T>,
        what: &'static str,
        at: &str,
        key: &str,
    ) -> Result<usize, LoadError>
    where
        Root: AsRef<[T]>,
    {
        let (index, count) = (index.value(), AsRef::<[T]>::as_ref(self.root).len());
        if index < count {
            Ok(index)
        } else {
            Err(self.context.out_of_range(format!("{at}.{key}"), what, index as u64, count))
        }
    }

    /// Resolves a reference that may be absent.
    pub(super) fn resolve_optional<T>(
        &self,
        index: Option<Index<T>>,
        what: &'static str,
        at: &str,
        key: &str,
    ) -> Result<Option<usize>, LoadError>
    where
        Root: AsRef<[T]>,
    {
        index.map(|index| self.resolve(index, what, at, key)).transpose()
    }

    /// Numbers that can be computed with.
    pub(super) fn numbers<const N: usize>(
        &self,
        at: &str,
        key: &str,
        numbers: [f32; N],
    ) -> Result<[f32; N], LoadError> {
        self.check_numbers(at, key, &numbers).map(|()| numbers)
    }

    pub(super) fn number(&self, at: &str, key: &str, number: f32) -> Result<f32, LoadError> {
        self.check_numbers(at, key, &[number]).map(|()| number)
    }

    pub(super) fn check_numbers(&self, at: &str, key: &str, numbers: &[f32]) -> Result<(), LoadError> {
        let usable = numbers.iter().copied().all(is_usable);
        if usable { Ok(()) } else { Err(self.context.not_finite(format!("{at}.{key}"))) }
    }

    /// The bytes of a buffer view and its stride, if it has one.
    pub(super) fn view(
        &self,
        index: Index<buffer::View>,
        at: &str,
    ) -> Result<(&[u8], Option<usize>), LoadError> {
        let index = self.resolve(index, "buffer view", at, "bufferView")?;
        let view = &self.root.buffer_views[index];
        let at = label("buffer view", index, &view.name);
        let buffer_index = self.resolve(view.buffer, "buffer", &at, "buffer")?;
        let buffer = &self.buffers[buffer_index];
        if buffer.failed.get() {
            return Err(buffer.failure.take().unwrap_or_else(|| {
                self.context.invalid(at, format!("needs buffer {buffer_index}, which could not be read"))
            }));
        }
        let bytes = buffer.bytes.as_slice();
        let bytes = &bytes[..bytes.len().min(usize::try_from(buffer.length).unwrap_or(usize::MAX))];
        let offset = view.byte_offset.map_or(0, |offset| offset.0);
        let end = offset.saturating_add(view.byte_length.0);
        if end > bytes.len() as u64 {
            let at = format!("{at} (in buffer {buffer_index})");
            return Err(self.context.truncated(at, end, bytes.len() as u64));
        }
        // A stride over 252 is against the specification but harmless: reads are checked against the view.
        Ok((&bytes[offset as usize..end as usize], view.byte_stride.map(|stride| stride.0)))
    }

    /// Lists what never mattered for the scene but is wrong all the same.
    pub(super) fn warn_of_unused_flaws(&self) {
        for buffer in &self.buffers {
            if let Some(failure) = buffer.failure.take() {
                self.context.warn(format!("not needed by the scene, but wrong: {failure}"));
            }
        }
        for i in 0..self.root.accessors.len() as u32 {
            if let Err(flaw) = self.elements(Index::new(i), "accessors", &i.to_string(), ANY) {
                self.context.warn(format!("not needed by the scene, but wrong: {flaw}"));
            }
        }
    }
}

fn read_buffers<'a>(
    context: &Context<'_>,
    root: &Root,
    glb_bin: Option<&'a [u8]>,
) -> Result<Vec<Buffer<'a>>, LoadError> {
    let mut by_path: HashMap<String, Rc<Vec<u8>>> = HashMap::new();
    let mut buffers = Vec::new();
    for (i, buffer) in root.buffers.iter().enumerate() {
        let at = label("buffer", i, &buffer.name);
        let length = buffer.byte_length.0;
        let bytes = match (&buffer.uri, glb_bin) {
            (Some(reference), _) => read_buffer(context, &at, reference, &mut by_path),
            (None, Some(bin)) if i == 0 => Ok(Bytes::Borrowed(bin)),
            (None, _) => {
                let problem = "has no uri, and there is no binary chunk for it; export the file again";
                Err(context.invalid(at.as_str(), problem))
            }
        };
        let checked = bytes.and_then(|bytes| {
            let has = bytes.as_slice().len() as u64;
            if has < length { Err(context.truncated(at.as_str(), length, has)) } else { Ok(bytes) }
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
