//! Elements of accessors as bytes, to be read, or copied to where vertices are split.

use anyhow::{Context, Result, bail, ensure};
use serde_json::json;

use super::document::{ARRAY_BUFFER, BIN, Document, List};
use super::json::Object;

/// The elements of an accessor. Every range was checked.
pub(crate) struct Elements<'a> {
    pub(crate) count: usize,
    /// Numbers an element.
    pub(crate) width: usize,
    component: Component,
    /// Bytes from the first element on, and the distance of elements.
    base: Option<(&'a [u8], usize)>,
    /// Elements that replace those of the base, and their bytes.
    sparse: Option<(Vec<u32>, &'a [u8])>,
}

/// What an accessor's numbers are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn of(code: usize) -> Option<Component> {
        Some(match code {
            5120 => Component::I8,
            5121 => Component::U8,
            5122 => Component::I16,
            5123 => Component::U16,
            5125 => Component::U32,
            5126 => Component::F32,
            _ => return None,
        })
    }

    pub(crate) fn code(self) -> u32 {
        match self {
            Component::I8 => 5120,
            Component::U8 => 5121,
            Component::I16 => 5122,
            Component::U16 => 5123,
            Component::U32 => 5125,
            Component::F32 => 5126,
        }
    }

    pub(crate) fn bytes(self) -> usize {
        match self {
            Component::I8 | Component::U8 => 1,
            Component::I16 | Component::U16 => 2,
            Component::U32 | Component::F32 => 4,
        }
    }

    /// The number at the start of some bytes.
    fn number(self, bytes: &[u8]) -> f64 {
        let at = |i: usize| bytes.get(i).copied().unwrap_or(0);
        match self {
            Component::I8 => f64::from(at(0) as i8),
            Component::U8 => f64::from(at(0)),
            Component::I16 => f64::from(i16::from_le_bytes([at(0), at(1)])),
            Component::U16 => f64::from(u16::from_le_bytes([at(0), at(1)])),
            Component::U32 => f64::from(u32::from_le_bytes([at(0), at(1), at(2), at(3)])),
            Component::F32 => f64::from(f32::from_le_bytes([at(0), at(1), at(2), at(3)])),
        }
    }
}

fn width_of(kind: &str) -> Option<usize> {
    Some(match kind {
        "SCALAR" => 1,
        "VEC2" => 2,
        "VEC3" => 3,
        "VEC4" => 4,
        _ => return None,
    })
}

impl Elements<'_> {
    /// An element's bytes; `None` where they are all zero.
    pub(crate) fn bytes(&self, i: usize) -> Option<&[u8]> {
        let size = self.size();
        if let Some((replaced, values)) = &self.sparse
            && let Ok(k) = replaced.binary_search(&(i as u32))
        {
            return values.get(k * size..(k + 1) * size);
        }
        let (bytes, stride) = self.base?;
        bytes.get(i * stride..i * stride + size)
    }

    fn size(&self) -> usize {
        self.width * self.component.bytes()
    }

    pub(crate) fn component(&self) -> Component {
        self.component
    }

    /// Number `c` of element `i`, as it is stored.
    fn stored(&self, i: usize, c: usize) -> f64 {
        self.bytes(i).map_or(0.0, |bytes| self.component.number(&bytes[c * self.component.bytes()..]))
    }

    /// Number `c` of element `i`, integers as fractions of the largest: as colours are meant, flagged as normalised or not.
    pub(crate) fn fraction(&self, i: usize, c: usize) -> f32 {
        let largest = match self.component {
            Component::U8 => 255.0,
            Component::U16 => 65535.0,
            _ => 1.0,
        };
        (self.stored(i, c) / largest) as f32
    }
}

impl Document {
    /// Gives access to the elements of an accessor.
    pub(crate) fn elements(&self, index: usize) -> Result<Elements<'_>> {
        self.checked_elements(index).with_context(|| format!("accessors[{index}]"))
    }

    fn checked_elements(&self, index: usize) -> Result<Elements<'_>> {
        let accessor = self.object(List::Accessors, index)?;
        let kind: String = accessor.read("type")?.context("it has no type")?;
        let width = width_of(&kind).with_context(|| format!("{kind} cannot be an attribute of vertices"))?;
        let code = accessor.whole("componentType")?.unwrap_or(0);
        let component = Component::of(code).with_context(|| format!("there is no componentType {code}"))?;
        let count = accessor.whole("count")?.context("it has no count")?;
        let size = width * component.bytes();
        let offset = accessor.whole("byteOffset")?.unwrap_or(0);
        let base = match accessor.whole("bufferView")? {
            Some(view) => Some(self.strided(view, offset, count, size)?),
            None => None,
        };
        let sparse = accessor.object("sparse")?;
        let sparse = if sparse.is_empty() { None } else { Some(self.sparse(&sparse, count, size)?) };
        Ok(Elements { count, width, component, base, sparse })
    }

    fn sparse(&self, sparse: &Object, elements: usize, size: usize) -> Result<(Vec<u32>, &[u8])> {
        let count = sparse.whole("count")?.unwrap_or(0);
        ensure!(count <= elements, "it replaces {count} of {elements} elements");
        let (indices, values) = (sparse.object("indices")?, sparse.object("values")?);
        let place = |of: &Object| -> Result<(usize, usize)> {
            Ok((
                of.whole("bufferView")?.context("a sparse part has no bufferView")?,
                of.whole("byteOffset")?.unwrap_or(0),
            ))
        };
        let code = indices.whole("componentType")?.unwrap_or(0);
        let component = Component::of(code).context("sparse indices have no type")?;
        let (view, offset) = place(&indices)?;
        let (bytes, stride) = self.strided(view, offset, count, component.bytes())?;
        let replaced: Vec<u32> = (0..count).map(|k| component.number(&bytes[k * stride..]) as u32).collect();
        ensure!(replaced.is_sorted_by(|a, b| a < b), "its sparse indices do not increase");
        let (view, offset) = place(&values)?;
        let (bytes, stride) = self.strided(view, offset, count, size)?;
        ensure!(stride == size || count < 2, "its sparse values have gaps");
        Ok((replaced, bytes))
    }

    /// Bytes of `count` elements of a view, and their distance.
    fn strided(&self, view: usize, offset: usize, count: usize, size: usize) -> Result<(&[u8], usize)> {
        let object = self.object(List::BufferViews, view)?;
        let buffer = object.whole("buffer")?.unwrap_or(0);
        if buffer != BIN {
            bail!("its bytes are in buffer {buffer}, which cannot be read");
        }
        let stride = object.whole("byteStride")?.unwrap_or(size);
        let first = object.whole("byteOffset")?.unwrap_or(0).saturating_add(offset);
        let span = if count == 0 { 0 } else { (count - 1).saturating_mul(stride).saturating_add(size) };
        let bytes = self.bin.get(first..first.saturating_add(span));
        Ok((
            bytes.with_context(|| format!("it needs {span} bytes from {first} on, which are not there"))?,
            stride,
        ))
    }

    /// Makes an accessor with the elements of another one at `sources`, in its place or at the end of the list; gives its index.
    /// What else the accessor says is kept.
    pub(crate) fn pick(&mut self, index: usize, sources: &[u32], in_place: bool) -> Result<usize> {
        let mut accessor = self.object(List::Accessors, index)?;
        let elements = self.elements(index)?;
        if let Some(&bad) = sources.iter().find(|&&s| s as usize >= elements.count) {
            bail!("accessors[{index}] has {} elements, but a vertex needs element {bad}", elements.count);
        }
        let (size, width) = (elements.size(), elements.width);
        let stride = size.next_multiple_of(4);
        let mut bytes = vec![0u8; sources.len() * stride];
        for (to, &source) in bytes.chunks_exact_mut(stride).zip(sources) {
            if let Some(from) = elements.bytes(source as usize) {
                to[..size].copy_from_slice(from);
            }
        }
        let bounds = |pick: fn(f64, f64) -> f64| -> Vec<f64> {
            let of = |c: usize| {
                sources.iter().map(|&s| elements.stored(s as usize, c)).reduce(pick).unwrap_or(0.0)
            };
            (0..width).map(of).collect()
        };
        let is_float = elements.component == Component::F32;
        for (key, pick) in [("min", f64::min as fn(f64, f64) -> f64), ("max", f64::max)] {
            if accessor.has(key) {
                set_bounds(&mut accessor, key, &bounds(pick), is_float)?;
            }
        }
        let view = self.push_view(&bytes, Some(ARRAY_BUFFER))?;
        if stride != size {
            let mut object = self.object(List::BufferViews, view)?;
            object.set("byteStride", &stride)?;
            self.put(List::BufferViews, view, &object)?;
        }
        accessor.set("bufferView", &view)?;
        accessor.set("count", &sources.len())?;
        accessor.remove("byteOffset");
        accessor.remove("sparse");
        if in_place {
            self.put(List::Accessors, index, &accessor)?;
            return Ok(index);
        }
        self.push(List::Accessors, &accessor)
    }

    /// Appends an accessor of vertices with new bytes; gives its index.
    pub(crate) fn push_attribute(&mut self, attribute: &Attribute) -> Result<usize> {
        let Attribute { kind, component, normalized, bytes, .. } = attribute;
        let size = width_of(kind).unwrap_or(1) * component.bytes();
        let view = self.push_view(bytes, Some(ARRAY_BUFFER))?;
        let mut accessor = json!({
            "bufferView": view, "componentType": component.code(), "count": bytes.len() / size, "type": kind,
        });
        if *normalized {
            accessor["normalized"] = true.into();
        }
        self.push_value(List::Accessors, &accessor)
    }
}

/// Numbers as they are stored: floats with the digits that a float has, integers whole.
fn set_bounds(accessor: &mut Object, key: &str, bounds: &[f64], is_float: bool) -> Result<()> {
    if is_float {
        accessor.set(key, &bounds.iter().map(|&x| x as f32).collect::<Vec<_>>())
    } else {
        accessor.set(key, &bounds.iter().map(|&x| x as i64).collect::<Vec<_>>())
    }
}

/// A new attribute: its elements' size is a multiple of four bytes.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Attribute {
    pub(crate) name: String,
    pub(crate) kind: &'static str,
    pub(crate) component: Component,
    pub(crate) normalized: bool,
    pub(crate) bytes: Vec<u8>,
}
