//! Makes the charts of a mesh: grown, laid flat, packed; or a texel for each vertex of a very fine one.

use glam::{DVec3, Vec3};

use super::flatten::Flat;
use super::grow::{GrowParams, Grown, Growth};
use super::pack::{Packed, pack};
use super::per_vertex::vertex_pages;
use super::set::{Chart, ChartError, ChartParams, ChartSet, ChartUv, MOST_TEXELS, PageSize};
use super::surface::{NONE, Surface};

/// Rows of texels that slivers may cross, together, before texels are made coarser: it bounds the time taken.
const MOST_ROWS: f64 = (1u64 << 27) as f64;

/// The mesh is fine if at least this part of its triangles is smaller than a texel.
const FINE_PART: f64 = 0.9;

/// Longest edge of a fine mesh, in texels.
const MOST_TEXELS_AN_EDGE: f64 = 4.0;

/// Tries to find a texel edge that keeps to [`MOST_TEXELS`].
const MOST_TRIES: usize = 12;

/// What a [`ChartSet`] is made of.
#[derive(Debug, Default)]
pub(super) struct Layout {
    pub(super) pages: Vec<PageSize>,
    pub(super) per_vertex: bool,
    pub(super) corners: Vec<[ChartUv; 3]>,
    pub(super) chart_of: Vec<u32>,
    pub(super) charts: Vec<Chart>,
    pub(super) lone: Option<u32>,
    pub(super) texel: f64,
}

/// Makes the charts of a mesh a piece at a time, where a thread must not be held up: the same charts as
/// [`ChartSet::new`], to the bit.
#[derive(Debug)]
pub struct ChartBuilder {
    surface: Surface,
    params: ChartParams,
    vertices: usize,
    triangles: Vec<[u32; 3]>,
    texel: f64,
    tries: usize,
    growth: Growth,
}

impl ChartBuilder {
    /// Takes in the mesh: the one step, linear in its triangles, that is not cut in pieces.
    ///
    /// # Errors
    ///
    /// A parameter out of range, a triangle that names a vertex which is not there.
    pub fn new(
        positions_rest: &[Vec3],
        triangles: &[[u32; 3]],
        params: &ChartParams,
    ) -> Result<ChartBuilder, ChartError> {
        params.check()?;
        let count = positions_rest.len();
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= count) {
                return Err(ChartError::BadVertex { triangle, vertex, count });
            }
        }
        let surface = Surface::new(positions_rest, triangles);
        let texel = first_texel(&surface, params);
        let growth = Growth::new(&surface, grow_params(params, texel));
        let (params, triangles) = (*params, triangles.to_vec());
        Ok(ChartBuilder { surface, params, vertices: count, triangles, texel, tries: 0, growth })
    }

    /// Goes on until about `budget` triangles and texels were looked at (at least one chart is grown); gives how many were,
    /// and the charts once they are done. Call it no more after that.
    ///
    /// # Errors
    ///
    /// More than [`MOST_TEXELS`] loose pieces.
    pub fn work(&mut self, budget: usize) -> Result<(usize, Option<ChartSet>), ChartError> {
        let mirrored = self.params.mirrored;
        let done = |spent, layout| Ok((spent, Some(ChartSet::of_layout(layout, mirrored))));
        if self.triangles.is_empty() {
            return done(0, Layout::default());
        }
        let mut spent = self.growth.work(&self.surface, budget);
        if !self.growth.is_complete() {
            return Ok((spent, None));
        }
        spent += self.triangles.len();
        let flat = Flattened::new(&self.surface, self.growth.take_charts(), self.texel);
        let sizes: Vec<[u16; 2]> = flat.charts.iter().map(|c| c.size).collect();
        let packed = pack(&sizes, self.params.max_side);
        let count = packed.texel_count();
        if is_fine(&self.surface, self.texel) {
            let fewer = count.saturating_sub(1).min(u64::from(MOST_TEXELS));
            let found =
                vertex_pages(&self.surface, self.vertices, &self.triangles, self.params.max_side, fewer);
            if let Some(found) = found {
                let (pages, corners, texel) = (found.pages, found.corners, self.texel);
                return done(spent, Layout { pages, corners, per_vertex: true, texel, ..Layout::default() });
            }
        }
        if count <= u64::from(MOST_TEXELS) {
            return done(spent, flat.place(&self.surface, packed, self.texel));
        }
        self.tries += 1;
        if self.tries == MOST_TRIES {
            let (charts, limit) = (flat.charts.len(), MOST_TEXELS);
            return Err(ChartError::TooManyPieces { charts, limit });
        }
        self.texel *= (count as f64 / f64::from(MOST_TEXELS)).sqrt().clamp(1.1, 64.0) * 1.02;
        self.growth = Growth::new(&self.surface, grow_params(&self.params, self.texel));
        Ok((spent, None))
    }

    /// Part of the work that is left, 0 … 1, as far as can be told.
    pub fn left(&self) -> f64 {
        let (left, all) = self.growth.seeds();
        left as f64 / all.max(1) as f64
    }
}

fn grow_params(params: &ChartParams, texel: f64) -> GrowParams {
    GrowParams { texel, least_cosine: f64::from(params.least_cosine), max_side: params.max_side }
}

/// The texel edge asked for, or a coarser one where area or slivers rule it out from the start.
fn first_texel(surface: &Surface, params: &ChartParams) -> f64 {
    let mut texel = f64::from(params.texel_m);
    let most_of_one = 0.5 * f64::from(params.max_side) * f64::from(params.max_side);
    let rows: f64 = (0..surface.corners.len()).map(|t| surface.longest_edge(t)).sum();
    texel = texel.max(rows / MOST_ROWS);
    for _ in 0..MOST_TRIES {
        let texels: f64 =
            surface.double_areas.iter().map(|a| (0.5 * a / (texel * texel)).min(most_of_one)).sum();
        if texels <= f64::from(MOST_TEXELS) {
            break;
        }
        texel *= (texels / f64::from(MOST_TEXELS)).sqrt().max(1.02);
    }
    texel
}

/// Whether nearly all triangles are smaller than a texel, and none is much larger: what lies between vertices is lost.
fn is_fine(surface: &Surface, texel: f64) -> bool {
    let solid = (0..surface.corners.len()).filter(|&t| !surface.is_degenerate(t));
    let (mut all, mut small) = (0u64, 0u64);
    for t in solid {
        let edge = surface.longest_edge(t);
        if edge > MOST_TEXELS_AN_EDGE * texel {
            return false;
        }
        all += 1;
        small += u64::from(edge <= texel);
    }
    all > 0 && small as f64 >= FINE_PART * all as f64
}

/// Charts laid flat, not packed yet.
struct Flattened {
    charts: Vec<Flat>,
    chart_of: Vec<u32>,
    /// Triangles without area, and the place whose texel they read.
    anchors: Vec<(u32, DVec3)>,
    lone: Option<u32>,
}

impl Flattened {
    fn new(surface: &Surface, grown: Vec<(Grown, Flat)>, texel: f64) -> Flattened {
        let mut charts: Vec<Flat> = grown.iter().map(|c| c.1).collect();
        let count = surface.corners.len();
        let mut chart_of = vec![NONE; count];
        for (chart, (grown, _)) in grown.iter().enumerate() {
            for &t in &grown.triangles {
                chart_of[t as usize] = chart as u32;
            }
        }
        let mut chart_at = vec![NONE; surface.places.len()];
        for t in 0..count {
            if surface.repeats[t] != NONE {
                chart_of[t] = chart_of[surface.repeats[t] as usize];
            }
            for place in surface.corners[t] {
                if chart_of[t] != NONE && chart_at[place as usize] == NONE {
                    chart_at[place as usize] = chart_of[t];
                }
            }
        }
        let mut anchors = Vec::new();
        let mut lone = None;
        for t in (0..count).filter(|&t| surface.is_degenerate(t)) {
            let at = surface.corners[t].into_iter().find(|&place| chart_at[place as usize] != NONE);
            let place = surface.places[at.unwrap_or(surface.corners[t][0]) as usize];
            chart_of[t] = match at {
                Some(at) => chart_at[at as usize],
                None => *lone.get_or_insert_with(|| {
                    charts.push(Flat::single(place, texel));
                    charts.len() as u32 - 1
                }),
            };
            anchors.push((t as u32, place));
        }
        Flattened { charts, chart_of, anchors, lone }
    }

    fn place(self, surface: &Surface, packed: Packed, texel: f64) -> Layout {
        let charts: Vec<Chart> = self
            .charts
            .iter()
            .zip(&packed.places)
            .map(|(&flat, &(page, x, y))| Chart { flat, page: page as u16, corner: [x, y] })
            .collect();
        let mut corners: Vec<[ChartUv; 3]> = (0..surface.corners.len())
            .map(|t| surface.corner_places(t).map(|place| charts[self.chart_of[t] as usize].uv_of(place)))
            .collect();
        for &(t, place) in &self.anchors {
            corners[t as usize] = [charts[self.chart_of[t as usize] as usize].uv_of(place); 3];
        }
        let (pages, chart_of, lone) = (packed.pages, self.chart_of, self.lone);
        Layout { pages, per_vertex: false, corners, chart_of, charts, lone, texel }
    }
}
