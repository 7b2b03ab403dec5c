//! Checked access to numbers in buffers: every byte range is proved to exist before anything is read.

use super::document::Document;
use super::json::Object;
use crate::load::LoadError;

/// Type of one number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn from_code(code: u64) -> Option<Component> {
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

    fn size_bytes(self) -> usize {
        match self {
            Component::I8 | Component::U8 => 1,
            Component::I16 | Component::U16 => 2,
            Component::U32 | Component::F32 => 4,
        }
    }
}

/// Numbers in an element: `SCALAR` to `MAT4`.
fn width_of(name: &str) -> Option<usize> {
    Some(match name {
        "SCALAR" => 1,
        "VEC2" => 2,
        "VEC3" => 3,
        "VEC4" | "MAT2" => 4,
        "MAT3" => 9,
        "MAT4" => 16,
        _ => return None,
    })
}

/// What an attribute may be made of.
#[derive(Clone, Copy)]
pub(super) struct Allowed {
    pub(super) types: &'static [&'static str],
    pub(super) components: &'static [Component],
}

impl Allowed {
    pub(super) const fn new(types: &'static [&'static str], components: &'static [Component]) -> Self {
        Allowed { types, components }
    }
}

/// Everything that can be read at all.
pub(super) const ANY: Allowed = Allowed::new(
    &["SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"],
    &[Component::I8, Component::U8, Component::I16, Component::U16, Component::U32, Component::F32],
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
    index_component: Component,
    values: Strided<'a>,
}

impl Sparse<'_> {
    fn index(&self, i: usize) -> u32 {
        read_uint(self.index_component, self.index_bytes, i * self.index_component.size_bytes())
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
    pub(super) component: Component,
    normalized: bool,
    base: Option<Strided<'a>>,
    sparse: Option<Sparse<'a>>,
}

impl Elements<'_> {
    /// Component `c` of element `i`, converted as glTF says.
    pub(super) fn float(&self, i: usize, c: usize) -> f32 {
        let Some((bytes, offset)) = self.locate(i, c) else { return 0.0 };
        match self.component {
            Component::F32 => f32::from_bits(read_uint(Component::U32, bytes, offset)),
            Component::U32 => read_uint(Component::U32, bytes, offset) as f32,
            Component::U8 => self.scaled(read_uint(Component::U8, bytes, offset) as f32, 255.0),
            Component::U16 => self.scaled(read_uint(Component::U16, bytes, offset) as f32, 65535.0),
            Component::I8 => {
                self.scaled(f32::from(read_uint(Component::U8, bytes, offset) as u8 as i8), 127.0)
            }
            Component::I16 => {
                self.scaled(f32::from(read_uint(Component::U16, bytes, offset) as u16 as i16), 32767.0)
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
            Component::U8 if !self.normalized => 255.0,
            Component::U16 if !self.normalized => 65535.0,
            _ => 1.0,
        }
    }

    fn scaled(&self, x: f32, largest: f32) -> f32 {
        if self.normalized { (x / largest).max(-1.0) } else { x }
    }

    fn locate(&self, i: usize, c: usize) -> Option<(&[u8], usize)> {
        let within = c * self.component.size_bytes();
        if let Some(sparse) = &self.sparse
            && let Some(k) = sparse.find(i)
        {
            return Some((sparse.values.bytes, k * sparse.values.stride + within));
        }
        self.base.map(|base| (base.bytes, i * base.stride + within))
    }
}

/// Reads an unsigned integer; bytes past the end (excluded when the elements were made) read as 0.
fn read_uint(component: Component, bytes: &[u8], offset: usize) -> u32 {
    let at = |i: usize| u32::from(bytes.get(offset + i).copied().unwrap_or(0));
    match component.size_bytes() {
        1 => at(0),
        2 => at(0) | at(1) << 8,
        _ => match bytes.get(offset..).and_then(|b| b.first_chunk::<4>()) {
            Some(four) => u32::from_le_bytes(*four),
            None => 0,
        },
    }
}

impl<'a> Document<'a> {
    /// Checks accessor `index` for a use at `at` and gives access to its elements.
    pub(super) fn elements(
        &self,
        index: usize,
        at: String,
        allowed: Allowed,
    ) -> Result<Elements<'_>, LoadError> {
        let accessor = &self.accessors[index];
        let at = format!("{at} (accessor {index})");
        let count = accessor.uint("count")?.ok_or_else(|| accessor.missing("count"))?;
        let code = accessor.uint("componentType")?.ok_or_else(|| accessor.missing("componentType"))?;
        let type_name = accessor.string("type")?.ok_or_else(|| accessor.missing("type"))?;
        let component = Component::from_code(code).filter(|c| allowed.components.contains(c));
        let width = width_of(type_name).filter(|_| allowed.types.contains(&type_name));
        let (Some(component), Some(width)) = (component, width) else {
            let type_name: String = type_name.chars().take(20).collect();
            return Err(self.context.invalid(
                at,
                format!(
                    "holds {type_name} of component type {code}, but must hold {} of {:?}; export the file again",
                    allowed.types.join(" or "),
                    allowed.components
                ),
            ));
        };
        let count = usize::try_from(count).map_err(|_| self.context.truncated(at.as_str(), count, 0))?;
        let element_bytes = width * component.size_bytes();
        let base = match accessor.index("bufferView", "buffer view", self.views.len())? {
            Some(view) => Some(self.strided(view, accessor, count, element_bytes, &at)?),
            None => None,
        };
        let sparse = match accessor.object("sparse")? {
            Some(sparse) => Some(self.sparse(&sparse, count, element_bytes, &at)?),
            None => None,
        };
        let normalized = accessor.bool("normalized")?.unwrap_or(false);
        Ok(Elements { at, count, width, component, normalized, base, sparse })
    }

    fn sparse(
        &self,
        sparse: &Object<'_>,
        count: usize,
        element_bytes: usize,
        at: &str,
    ) -> Result<Sparse<'_>, LoadError> {
        let replaced = sparse.uint("count")?.ok_or_else(|| sparse.missing("count"))?;
        if replaced > count as u64 {
            let problem = format!("replaces {replaced} of {count} elements; export the file again");
            return Err(sparse.invalid(problem));
        }
        let replaced = replaced as usize;
        let indices = sparse.object("indices")?.ok_or_else(|| sparse.missing("indices"))?;
        let values = sparse.object("values")?.ok_or_else(|| sparse.missing("values"))?;
        let index_component = match indices.uint("componentType")?.and_then(Component::from_code) {
            Some(c @ (Component::U8 | Component::U16 | Component::U32)) => c,
            _ => {
                return Err(
                    indices.invalid("componentType must be 5121, 5123 or 5125; export the file again")
                );
            }
        };
        let view = |object: &Object<'_>| {
            object
                .index("bufferView", "buffer view", self.views.len())?
                .ok_or_else(|| object.missing("bufferView"))
        };
        let index_size = index_component.size_bytes();
        let found =
            self.strided(view(&indices)?, &indices, replaced, index_size, &format!("{at}.sparse.indices"))?;
        let values =
            self.strided(view(&values)?, &values, replaced, element_bytes, &format!("{at}.sparse.values"))?;
        if replaced > 0 && found.stride != index_size {
            return Err(indices.invalid("its buffer view must not be strided; export the file again"));
        }
        let sparse = Sparse { count: replaced, index_bytes: found.bytes, index_component, values };
        let mut previous = None;
        for i in 0..replaced {
            let index = sparse.index(i);
            if previous.is_some_and(|p| p >= index) {
                return Err(indices.invalid(format!("entry {i} does not increase; export the file again")));
            }
            if index as usize >= count {
                let at = format!("{at}.sparse.indices, entry {i},");
                return Err(self.context.out_of_range(at, "element", u64::from(index), count));
            }
            previous = Some(index);
        }
        Ok(sparse)
    }

    /// The bytes of `count` elements in a buffer view, from the `byteOffset` of `object`.
    fn strided(
        &self,
        view: usize,
        object: &Object<'_>,
        count: usize,
        element_bytes: usize,
        at: &str,
    ) -> Result<Strided<'_>, LoadError> {
        let (bytes, stride) = self.view(view)?;
        let offset = object.uint("byteOffset")?.unwrap_or(0);
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
