//! The charts of one instance.

use glam::{DVec3, Vec3};

use super::build::{ChartBuilder, Layout};
use super::flatten::Flat;
use super::per_vertex::vertex_sites;

mod sites;
pub use sites::SiteFinder;

/// Steps of a [`ChartUv`] coordinate in a texel.
pub const TEXEL_FRACTION: u16 = 32;

/// Most texels of one instance. A mesh that would need more gets coarser texels.
pub const MOST_TEXELS: u32 = 1 << 21;

/// How charts are made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChartParams {
    /// Edge of a texel in rest space, metres.
    pub texel_m: f32,
    /// Least cosine between the normal of a triangle and that of its chart. Default 0.8 (37°): the faces of a
    /// 45° bevel get charts of their own, whose values differ most.
    pub least_cosine: f32,
    /// Longest side of a page, texels, 16 … 2047. Default 1024.
    pub max_side: u16,
    /// Whether the map that brought the mesh to rest mirrors it: then the front of a triangle is where its corners run
    /// clockwise. Only turns the normals of sites. Default false.
    pub mirrored: bool,
}

impl ChartParams {
    /// Texels for points `spacing_m` metres apart: ¾ of the spacing where surfaces stay in place, ½ where they
    /// move, with the other parameters at their defaults.
    pub fn for_spacing(spacing_m: f32, moves: bool) -> ChartParams {
        let texel_m = spacing_m * if moves { 0.5 } else { 0.75 };
        ChartParams { texel_m, least_cosine: 0.8, max_side: 1024, mirrored: false }
    }

    pub(super) fn check(&self) -> Result<(), ChartError> {
        let rules = [
            (
                "texel_m",
                self.texel_m,
                self.texel_m.is_normal() && self.texel_m > 0.0,
                "it must be above 0 and finite",
            ),
            (
                "least_cosine",
                self.least_cosine,
                (0.1..=1.0).contains(&self.least_cosine),
                "it must be 0.1 to 1",
            ),
            (
                "max_side",
                f32::from(self.max_side),
                (16..=2047).contains(&self.max_side),
                "it must be 16 to 2047",
            ),
        ];
        match rules.into_iter().find(|(_, _, holds, _)| !holds) {
            Some((name, value, _, rule)) => Err(ChartError::BadParameter { name, value, rule }),
            None => Ok(()),
        }
    }
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
    /// A triangle names a vertex that is not there.
    #[error("charts: triangle {triangle} has vertex {vertex}, but there are {count} vertices")]
    BadVertex {
        /// Which triangle.
        triangle: usize,
        /// The vertex it names.
        vertex: u32,
        /// How many there are.
        count: usize,
    },
    /// So many loose pieces that one texel each is too much.
    #[error("charts: {charts} loose pieces of surface are more than {limit} texels can hold; split the mesh")]
    TooManyPieces {
        /// How many charts there would be.
        charts: usize,
        /// [`MOST_TEXELS`].
        limit: u32,
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

impl PageSize {
    /// Texels of the page.
    pub fn area(self) -> u32 {
        u32::from(self.width) * u32::from(self.height)
    }
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
    /// Number of the first texel of each page, and of all.
    first_texels: Vec<u32>,
    per_vertex: bool,
    mirrored: bool,
    texel_m: f32,
    /// One for each triangle of the mesh.
    corners: Vec<[ChartUv; 3]>,
    /// Chart of each triangle; empty if per vertex.
    chart_of: Vec<u32>,
    charts: Vec<Chart>,
    /// The chart of one texel that stands for triangles without area which touch no other, if there are any.
    lone: Option<u32>,
}

/// A chart in its page.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Chart {
    pub(super) flat: Flat,
    pub(super) page: u16,
    /// First texel along x and y.
    pub(super) corner: [u16; 2],
}

impl Chart {
    /// Where a place of the chart lies in its page.
    pub(super) fn uv_of(&self, place: DVec3) -> ChartUv {
        let [x, y] = self.flat.snapped_texel_of(place);
        ChartUv {
            page: self.page,
            x: self.corner[0] * TEXEL_FRACTION + x,
            y: self.corner[1] * TEXEL_FRACTION + y,
        }
    }
}

impl ChartSet {
    /// Makes the charts of a mesh whose vertices lie at `positions_rest` (metres). Runs in near-linear time; the same
    /// to the bit everywhere.
    ///
    /// Triangles without area, repeated ones and coordinates that are not finite do no harm. A triangle, or a mesh,
    /// too large for the limits gets coarser texels.
    ///
    /// # Errors
    ///
    /// A parameter out of range, a triangle that names a vertex which is not there, more than [`MOST_TEXELS`] loose
    /// pieces.
    pub fn new(
        positions_rest: &[Vec3],
        triangles: &[[u32; 3]],
        params: &ChartParams,
    ) -> Result<ChartSet, ChartError> {
        let mut builder = ChartBuilder::new(positions_rest, triangles, params)?;
        loop {
            if let (_, Some(charts)) = builder.work(usize::MAX)? {
                return Ok(charts);
            }
        }
    }

    pub(super) fn of_layout(layout: Layout, mirrored: bool) -> ChartSet {
        let Layout { pages, per_vertex, corners, chart_of, charts, lone, texel } = layout;
        let mut first_texels = vec![0u32];
        for page in &pages {
            first_texels.push(first_texels[first_texels.len() - 1] + page.area());
        }
        let texel_m = texel as f32;
        ChartSet { pages, first_texels, per_vertex, mirrored, texel_m, corners, chart_of, charts, lone }
    }

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

    /// Where the corners of one triangle lie.
    pub fn corner_uv_of(&self, triangle: usize) -> [ChartUv; 3] {
        self.corners[triangle]
    }

    /// Edge of a texel that was aimed at, metres: that of the parameters, or more where those would need more than
    /// [`MOST_TEXELS`]. 0 without triangles.
    pub fn texel_m(&self) -> f32 {
        self.texel_m
    }

    /// Texels of all pages, with those that carry nothing.
    pub fn texel_count(&self) -> u32 {
        self.first_texels.last().copied().unwrap_or(0)
    }

    /// Number of the first texel of a page; with the number of pages, [`ChartSet::texel_count`].
    pub fn first_texel_of_page(&self, page: usize) -> u32 {
        self.first_texels.get(page).copied().unwrap_or(0)
    }

    /// Page, x and y of a texel below [`ChartSet::texel_count`].
    pub fn locate(&self, texel: u32) -> (u16, u16, u16) {
        let page = self.first_texels.partition_point(|&first| first <= texel).saturating_sub(1);
        let Some(size) = self.pages.get(page) else { return (0, 0, 0) };
        let (within, width) = (texel - self.first_texels[page], u32::from(size.width));
        (page as u16, (within % width) as u16, (within / width) as u16)
    }

    /// Number of charts; 0 if per vertex.
    pub fn chart_count(&self) -> u32 {
        self.charts.len() as u32
    }

    /// The chart of a triangle, below [`ChartSet::chart_count`]; 0 if per vertex.
    pub fn chart_of_triangle(&self, triangle: usize) -> u32 {
        self.chart_of.get(triangle).copied().unwrap_or(0)
    }

    /// Page and texels (x, y, width, height) of a chart's rectangle.
    pub fn chart_rectangle(&self, chart: u32) -> (u16, [u16; 4]) {
        let Chart { flat, page, corner } = &self.charts[chart as usize];
        (*page, [corner[0], corner[1], flat.size[0], flat.size[1]])
    }

    /// Distance of a chart's texels along x and y in its plane, metres.
    pub fn chart_step_m(&self, chart: u32) -> [f32; 2] {
        let step = self.charts[chart as usize].flat.step;
        [step.x as f32, step.y as f32]
    }

    /// Where a place of a triangle lies: page, and x and y in texels (the centre of texel *i* at *i* + ½).
    /// `barycentrics` are the weights of the second and third corner.
    pub fn texel_at(&self, triangle: usize, barycentrics: [f32; 2]) -> (u16, f32, f32) {
        let [a, b, c] = self.corners[triangle];
        let [v, w] = barycentrics;
        let between = |a: u16, b: u16, c: u16| {
            let (a, b, c) = (f32::from(a), f32::from(b), f32::from(c));
            (a + v * (b - a) + w * (c - a)) / f32::from(TEXEL_FRACTION)
        };
        (a.page, between(a.x, b.x, c.x), between(a.y, b.y, c.y))
    }

    /// Every texel that a read inside a triangle can touch, ascending. The arguments are those the set was made from.
    pub fn sites(&self, positions_rest: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Site> {
        debug_assert_eq!(triangles.len(), self.corners.len());
        let mut finder = SiteFinder::new(self);
        while finder.work(self, positions_rest, triangles, usize::MAX) > 0 {}
        finder.finish()
    }

    /// Number of the texel that holds a place.
    fn texel_number(&self, uv: ChartUv) -> u32 {
        let page = usize::from(uv.page);
        let (x, y) = (u32::from(uv.x / TEXEL_FRACTION), u32::from(uv.y / TEXEL_FRACTION));
        self.first_texels[page] + y * u32::from(self.pages[page].width) + x
    }

    fn vertex_sites(&self, positions_rest: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Site> {
        let texels = self.corners.iter().map(|corners| corners.map(|uv| self.texel_number(uv)));
        vertex_sites(positions_rest, triangles, self.texel_count() as usize, texels)
            .into_iter()
            .map(|(texel, position, sum)| Site {
                texel,
                position_rest: finite(position),
                normal_rest: self.front(sum / sum.length()),
            })
            .collect()
    }

    /// Turns a normal by winding to the front; upwards if there is none.
    fn front(&self, normal: DVec3) -> Vec3 {
        let normal = if normal.is_finite() { normal } else { DVec3::Y };
        if self.mirrored { -normal.as_vec3() } else { normal.as_vec3() }
    }

    /// The mesh's vertices split where charts meet, and shared otherwise, ascending by source.
    pub fn vertices(&self, triangles: &[[u32; 3]]) -> ChartVertices {
        let corner = |i: u32| {
            let (t, k) = ((i / 3) as usize, (i % 3) as usize);
            (triangles[t][k], self.corners[t][k])
        };
        let mut order: Vec<(u32, ChartUv, u32)> = (0..3 * self.corners.len() as u32)
            .map(|i| {
                let (source, uv) = corner(i);
                (source, uv, i)
            })
            .collect();
        order.sort_unstable();
        let mut vertices =
            ChartVertices { triangles: vec![[0; 3]; self.corners.len()], ..ChartVertices::default() };
        for (source, uv, i) in order {
            if vertices.source.last() != Some(&source) || vertices.uv.last() != Some(&uv) {
                vertices.source.push(source);
                vertices.uv.push(uv);
            }
            vertices.triangles[(i / 3) as usize][(i % 3) as usize] = vertices.source.len() as u32 - 1;
        }
        vertices
    }

    /// Memory it takes, bytes.
    pub fn memory_bytes(&self) -> u64 {
        let bytes = size_of::<ChartSet>()
            + size_of_val(&self.pages[..])
            + size_of_val(&self.first_texels[..])
            + size_of_val(&self.corners[..])
            + size_of_val(&self.chart_of[..])
            + size_of_val(&self.charts[..]);
        bytes as u64
    }
}

/// The position, or the origin's coordinate for one that is not finite.
fn finite(position: Vec3) -> Vec3 {
    Vec3::from_array(position.to_array().map(|x| if x.is_finite() { x } else { 0.0 }))
}
