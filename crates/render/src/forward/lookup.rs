//! How a fragment finds its visibility: a WGSL file that the forward pass is joined with.

use dapple_gpu::wgpu;

/// A way to find visibility. Its WGSL defines `fn lookup_visibility(s: LookupInput) -> f32`; what it may read of the
/// fragment stands in `lookup/input.wgsl`. Names of its own should carry a prefix, since all files share one module.
#[derive(Clone, Debug)]
pub struct Lookup {
    /// For messages.
    pub label: &'static str,
    /// Files that define `lookup_visibility` and what it needs. They may use the declarations of `frame.wgsl`,
    /// `math.wgsl` and `vertex.wgsl` (group 2: the atlas), and bind their own resources in group 3.
    pub wgsl: Vec<&'static str>,
    /// Whether it reads `position_rest` and `normal_rest`.
    pub needs_rest: bool,
    /// Layout of group 3, if it binds anything; the group itself is given by [`super::Forward::bind_lookup`].
    pub layout: Option<wgpu::BindGroupLayout>,
}

/// One of the look-ups of a [`super::Forward`]: the place in the list it was made with, after the two that are always
/// there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct LookupId(pub(super) usize);

impl LookupId {
    /// Everything is open.
    pub const NONE: LookupId = LookupId(0);
    /// The visibility atlas.
    pub const ATLAS: LookupId = LookupId(1);

    /// The `index`-th of the list that the forward pass was made with.
    pub const fn added(index: usize) -> LookupId {
        LookupId(2 + index)
    }
}

/// What every look-up gets.
pub const LOOKUP_INPUT_WGSL: &str = include_str!("lookup/input.wgsl");

pub(super) fn built_in() -> Vec<Lookup> {
    let make = |label, wgsl| Lookup { label, wgsl: vec![wgsl], needs_rest: false, layout: None };
    vec![make("none", include_str!("lookup/none.wgsl")), make("atlas", include_str!("lookup/atlas.wgsl"))]
}
