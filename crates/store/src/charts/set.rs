//! The charts of one instance.

use glam::Vec3;

/// Steps of a [`ChartUv`] coordinate in a texel.
pub const TEXEL_FRACTION: u16 = 32;

/// How charts are made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChartParams {
    /// Edge of a texel in rest space, metres.
    pub texel_m: f32,
    /// Least cosine between the normal of a triangle and that of its chart. Default 0.7 (45°).
    pub least_cosine: f32,
    /// Longest side of a page, texels, 16 … 2047. Default 1024.
    pub max_side: u16,
}

/// Why there are no charts.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ChartError {
    /// A parameter is out of range.
    #[error("charts: {name} is {value}; {rule}")]
    BadParameter {
        /// Which.
        name: &'static str,
        /// What it was.
        value: f32,
        /// What it must be.
        rule: &'static str,
    },
}

/// Size of a page, texels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PageSize {
    /// Along x.
    pub width: u16,
    /// Along y.
    pub height: u16,
}

/// A place in the pages of an instance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ChartUv {
    /// Index into [`ChartSet::pages`].
    pub page: u16,
    /// Along x, in steps of 1 / [`TEXEL_FRACTION`] texel; the centre of texel i lies at (i + ½) · 32.
    pub x: u16,
    /// Along y, likewise.
    pub y: u16,
}

/// A texel that carries a value, and the place on the surface that it stands for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Site {
    /// Number of the texel: pages one after the other, rows from the top within a page.
    pub texel: u32,
    /// Where it is in rest space, metres. Up to 1.5 texels outside its triangle, then in the triangle's plane.
    pub position_rest: Vec3,
    /// Unit normal of its triangle in rest space (front side).
    pub normal_rest: Vec3,
}

/// Vertices of a mesh, split where charts meet.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ChartVertices {
    /// For each vertex, the vertex of the mesh that it is a copy of.
    pub source: Vec<u32>,
    /// For each vertex, its place in the pages.
    pub uv: Vec<ChartUv>,
    /// The mesh's triangles in the mesh's order, as indices into these lists.
    pub triangles: Vec<[u32; 3]>,
}

/// The charts of one mesh at rest.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ChartSet {
    pages: Vec<PageSize>,
    per_vertex: bool,
    /// One for each triangle of the mesh.
    corners: Vec<[ChartUv; 3]>,
}

impl ChartSet {
    /// Sizes of the pages.
    pub fn pages(&self) -> &[PageSize] {
        &self.pages
    }

    /// Whether every vertex has a texel of its own, because the mesh is finer than texels would be: then a value
    /// is read at the three corners (at texel centres, unfiltered) and interpolated over the triangle. Otherwise it is
    /// read at the interpolated place, bilinearly.
    pub fn is_per_vertex(&self) -> bool {
        self.per_vertex
    }

    /// Where the corners of each triangle lie. All three in one page.
    pub fn corners(&self) -> &[[ChartUv; 3]] {
        &self.corners
    }
}
