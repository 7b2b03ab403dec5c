//! Checked access to numbers in buffers: every byte range is proved to exist before anything is read.

use gltf::json::accessor::{Accessor, ComponentType, IndexComponentType, Type, sparse};
use gltf::json::validation::Checked;
use gltf::json::{Index, buffer};

use super::document::Document;
use crate::load::LoadError;

/// What an attribute may be made of.
#[derive(Clone, Copy)]
pub(super) struct Allowed {
    pub(super) types: &'static [Type],
    pub(super) components: &'static [ComponentType],
}

impl Allowed {
    pub(super) const fn new(types: &'static [Type], components: &'static [ComponentType]) -> Self {
        Allowed { types, components }
    }
}

/// Everything that can be read at all.
pub(super) const ANY: Allowed = Allowed::new(
    &[Type::Scalar, Type::Vec2, Type::Vec3, Type::Vec4, Type::Mat2, Type::Mat3, Type::Mat4],
    &[
        ComponentType::I8,
        ComponentType::U8,
        ComponentType::I16,
        ComponentType::U16,
        ComponentType::U32,
        ComponentType::F32,
    ],
);

/// A strided run of elements inside a buffer.
#[derive(Clone, Copy)]
struct Strided<'a> {
    bytes: &'a [u8],
    stride: usize,
}

/// Elements that replace those of the base.
struct Sparse<'a> {
    count: usize,
    index_bytes: &'a [u8],
    index_component: ComponentType,
    values: Strided<'a>,
}

impl Sparse<'_> {
    fn index(&self, i: usize) -> u32 {
        read_uint(self.index_component, self.index_bytes, i * self.index_component.size())
    }

    /// Where the values hold a replacement for element `element`.
    fn find(&self, element: usize) -> Option<usize> {
        let (mut low, mut high) = (0, self.count);
        while low < high {
            let middle = (low + high) / 2;
            if (self.index(middle) as usize) < element { low = middle + 1 } else { high = middle }
        }
        (low < self.count && self.index(low) as usize == element).then_some(low)
    }
}

/// The elements of an accessor, ready to be read one by one.
pub(super) struct Elements<'a> {
    /// For messages.
    pub(super) at: String,
    pub(super) count: usize,
    pub(super) width: usize,
    pub(super) component: ComponentType,
    normalized: bool,
    base: Option<Strided<'a>>,
    sparse: Option<Sparse<'a>>,
}

impl Elements<'_> {
    /// Component `c` of element `i`, converted as glTF says.
    pub(super) fn float(&self, i: usize, c: usize) -> f32 {
        let Some((bytes, offset)) = self.locate(i, c) else { return 0.0 };
        match self.component {
            ComponentType::F32 => f32::from_bits(read_uint(ComponentType::U32, bytes, offset)),
            ComponentType::U32 => read_uint(ComponentType::U32, bytes, offset) as f32,
            ComponentType::U8 => self.scaled(read_uint(ComponentType::U8, bytes, offset) as f32, 255.0),
            ComponentType::U16 => self.scaled(read_uint(ComponentType::U16, bytes, offset) as f32, 65535.0),
            ComponentType::I8 => {
                self.scaled(f32::from(read_uint(ComponentType::U8, bytes, offset) as u8 as i8), 127.0)
            }
            ComponentType::I16 => {
                self.scaled(f32::from(read_uint(ComponentType::U16, bytes, offset) as u16 as i16), 32767.0)
            }
        }
    }

    /// The first `N` components of element `i`.
    pub(super) fn floats<const N: usize>(&self, i: usize) -> [f32; N] {
        std::array::from_fn(|c| if c < self.width { self.float(i, c) } else { 0.0 })
    }

    /// Component `c` of element `i` of an unsigned integer accessor.
    pub(super) fn uint(&self, i: usize, c: usize) -> u32 {
        self.locate(i, c).map_or(0, |(bytes, offset)| read_uint(self.component, bytes, offset))
    }

    /// What integers that lack their `normalized` flag must be divided by where only fractions make sense.
    pub(super) fn integer_scale(&self) -> f32 {
        match self.component {
            ComponentType::U8 if !self.normalized => 255.0,
            ComponentType::U16 if !self.normalized => 65535.0,
            _ => 1.0,
        }
    }

    fn scaled(&self, x: f32, largest: f32) -> f32 {
        if self.normalized { (x / largest).max(-1.0) } else { x }
    }

    fn locate(&self, i: usize, c: usize) -> Option<(&[u8], usize)> {
        let within = c * self.component.size();
        if let Some(sparse) = &self.sparse
            && let Some(k) = sparse.find(i)
        {
            return Some((sparse.values.bytes, k * sparse.values.stride + within));
        }
        self.base.map(|base| (base.bytes, i * base.stride + within))
    }
}

/// Reads an unsigned integer; bytes past the end (excluded when the elements were made) read as 0.
fn read_uint(component: ComponentType, bytes: &[u8], offset: usize) -> u32 {
    let at = |i: usize| u32::from(bytes.get(offset + i).copied().unwrap_or(0));
    match component.size() {
        1 => at(0),
        2 => at(0) | at(1) << 8,
        _ => match bytes.get(offset..).and_then(|b| b.first_chunk::<4>()) {
            Some(four) => u32::from_le_bytes(*four),
            None => 0,
        },
    }
}

impl Document<'_> {
    /// Checks an accessor that property `key` of the object `at` refers to, and gives access to its elements.
    pub(super) fn elements(
        &self,
        index: Index<Accessor>,
        at: &str,
        key: &str,
        allowed: Allowed,
    ) -> Result<Elements<'_>, LoadError> {
        let index = self.resolve(index, "accessor", at, key)?;
        let accessor = &self.root.accessors[index];
        let at = format!("{at}.{key} (accessor {index})");
        let (Checked::Valid(kind), Checked::Valid(component)) = (accessor.type_, accessor.component_type)
        else {
            let problem = "its type or componentType is none of glTF's; export the file again";
            return Err(self.context.invalid(at, problem));
        };
        let component = component.0;
        if !allowed.types.contains(&kind) || !allowed.components.contains(&component) {
            let types: Vec<String> = allowed.types.iter().map(|kind| format!("{kind:?}")).collect();
            let problem = format!(
                "holds {kind:?} of {component:?}, but must hold {} of {:?}; export the file again",
                types.join(" or "),
                allowed.components
            );
            return Err(self.context.invalid(at, problem));
        }
        let count = usize::try_from(accessor.count.0)
            .map_err(|_| self.context.truncated(at.as_str(), accessor.count.0, 0))?;
        let width = kind.multiplicity();
        let element_bytes = width * component.size();
        let offset = accessor.byte_offset.map_or(0, |offset| offset.0);
        let strided = |view| self.strided(view, offset, count, element_bytes, &at);
        let base = accessor.buffer_view.map(strided).transpose()?;
        let sparse =
            accessor.sparse.as_ref().map(|s| self.sparse(s, count, element_bytes, &at)).transpose()?;
        Ok(Elements { at, count, width, component, normalized: accessor.normalized, base, sparse })
    }

    fn sparse(
        &self,
        sparse: &sparse::Sparse,
        count: usize,
        element_bytes: usize,
        at: &str,
    ) -> Result<Sparse<'_>, LoadError> {
        let invalid = |problem: String| {
            self.context.invalid(format!("{at}.sparse"), format!("{problem}; export the file again"))
        };
        let replaced = sparse.count.0;
        if replaced > count as u64 {
            return Err(invalid(format!("replaces {replaced} of {count} elements")));
        }
        let replaced = replaced as usize;
        let (indices, values) = (&sparse.indices, &sparse.values);
        let Checked::Valid(IndexComponentType(index_component)) = indices.component_type else {
            return Err(invalid("the componentType of its indices must be 5121, 5123 or 5125".to_owned()));
        };
        let index_at = format!("{at}.sparse.indices");
        let index_size = index_component.size();
        let found =
            self.strided(indices.buffer_view, indices.byte_offset.0, replaced, index_size, &index_at)?;
        let values = self.strided(
            values.buffer_view,
            values.byte_offset.0,
            replaced,
            element_bytes,
            &format!("{at}.sparse.values"),
        )?;
        if replaced > 0 && found.stride != index_size {
            return Err(invalid("the buffer view of its indices must not be strided".to_owned()));
        }
        let sparse = Sparse { count: replaced, index_bytes: found.bytes, index_component, values };
        let mut previous = None;
        for i in 0..replaced {
            let index = sparse.index(i);
            if previous.is_some_and(|p| p >= index) {
                return Err(invalid(format!("entry {i} of its indices does not increase")));
            }
            if index as usize >= count {
                let at = format!("{index_at}, entry {i},");
                return Err(self.context.out_of_range(at, "element", u64::from(index), count));
            }
            previous = Some(index);
        }
        Ok(sparse)
    }

    /// The bytes of `count` elements in a buffer view, from an offset on.
    fn strided(
        &self,
        view: Index<buffer::View>,
        offset: u64,
        count: usize,
        element_bytes: usize,
        at: &str,
    ) -> Result<Strided<'_>, LoadError> {
        let (bytes, stride) = self.view(view, at)?;
        let stride = stride.unwrap_or(element_bytes);
        if stride < element_bytes {
            let problem = format!(
                "elements of {element_bytes} bytes overlap, as buffer view {view} has a byteStride of {stride}; \
                 export the file again"
            );
            return Err(self.context.invalid(at, problem));
        }
        if count == 0 {
            return Ok(Strided { bytes: &[], stride });
        }
        let span = (count as u64 - 1).saturating_mul(stride as u64).saturating_add(element_bytes as u64);
        let needs = offset.saturating_add(span);
        if needs > bytes.len() as u64 {
            return Err(self.context.truncated(at, needs, bytes.len() as u64));
        }
        Ok(Strided { bytes: &bytes[offset as usize..needs as usize], stride })
    }
}
