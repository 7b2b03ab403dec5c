//! New texture coordinates, made by an atlas library: surfaces cut into charts, laid flat and packed, with vertices split at the
//! seams.

use std::collections::HashMap;

use anyhow::{Context, Result, bail};
use dapple_scene::Origins;
use dapple_scene::glam::{Vec2, Vec3};
use uvunwrap::{Density, MeshInput, Options, OutputMesh, Packing, Progress, Stage};

use super::accessor::{Attribute, Component};
use super::layout::{
    FILLED, Layout, Patch, PieceAt, Reads, Settings, Sheet, first_copy, side_for, wanted_texel_m,
};
use super::plan::{MeshPlan, Piece, Pool, triangles_of};
use super::surfaces::Surfaces;

/// Above so many triangles charts are packed by their outlines only: holes stay empty, but it is much faster.
const MANY: usize = 100_000;

/// Charts of curved surfaces have about so many triangles at most, if those are of one size: laying one flat takes more than
/// twice as long for twice as many. Seams are stitched, so that more of them do no harm.
const TRIANGLES_OF_CHART: f64 = 4000.0;

/// Widest angle between a triangle and its chart, degrees.
const CHART_ANGLE: f32 = 50.0;

/// Most images.
const MOST_IMAGES: f64 = 64.0;

/// Copies smaller than this part of the largest one of their mesh get finer texels instead.
const LEAST_SCALE: f32 = 0.25;

/// A mesh as it goes to the library.
struct Prepared {
    plan: usize,
    positions: Vec<[f32; 3]>,
    indices: Vec<u32>,
    /// Triangles that use coordinates of the file, or have no area.
    ignored: Vec<bool>,
    /// World size of each copy over that of `positions`; empty for one copy.
    scales: Vec<f32>,
    scale: f32,
}

/// Lays out pieces anew and adds their images.
pub(crate) fn unwrap(
    layout: &mut Layout,
    plans: &mut [MeshPlan],
    origins: &Origins,
    surfaces: &Surfaces<'_>,
    settings: &Settings,
    pieces: &[PieceAt],
    progress: &(dyn Fn(&str, f64) + Sync),
) -> Result<()> {
    let mut area_m2 = 0.0;
    let mut prepared = Vec::new();
    for of_plan in pieces.chunk_by(|a, b| a.plan == b.plan) {
        let (mesh, area) = prepare(plans, surfaces, of_plan);
        area_m2 += area;
        prepared.push(mesh);
    }
    let inputs: Vec<MeshInput<'_>> = prepared
        .iter()
        .map(|mesh| MeshInput {
            ignored_faces: Some(&mesh.ignored),
            instance_scales: &mesh.scales,
            scale: mesh.scale,
            ..MeshInput::new(&mesh.positions, &mesh.indices)
        })
        .collect();
    if let Some(texel_m) = settings.texel_m {
        let images = area_m2 / (FILLED * (texel_m * f64::from(settings.side)).powi(2));
        if images > MOST_IMAGES {
            bail!(
                "--texel {texel_m} would need {images:.0} images of {side}x{side}, more than {MOST_IMAGES}; try a longer one",
                side = settings.side
            );
        }
    }
    let triangles: usize = prepared.iter().map(|mesh| mesh.ignored.len()).sum();
    let density = match settings.texel_m {
        Some(texel_m) => {
            let size = settings.side.min(side_for(area_m2, texel_m, settings).saturating_mul(2));
            Density::Fixed { texels_per_unit: (1.0 / texel_m) as f32, page_size: Some(size) }
        }
        None => Density::Auto { page_size: side_for(area_m2, wanted_texel_m(area_m2, settings), settings) },
    };
    let page_size = match density {
        Density::Auto { page_size } | Density::Fixed { page_size: Some(page_size), .. } => page_size,
        _ => settings.side,
    };
    let options = Options {
        density,
        max_chart_angle: CHART_ANGLE,
        max_chart_area: (area_m2 * TRIANGLES_OF_CHART / triangles.max(1) as f64) as f32,
        padding: settings.margin,
        packing: if triangles > MANY { Packing::Fast } else { Packing::Shape },
        max_chart_size: match settings.texel_m {
            Some(_) => page_size.saturating_sub(2 * settings.margin).max(1),
            None => 0,
        },
        ..Options::default()
    };
    let atlas = uvunwrap::generate_with_progress(&inputs, &options, |step: Progress| {
        let what = if step.stage == Stage::Packing { "packing charts" } else { "laying surfaces flat" };
        progress(what, step.done as f64 / step.total.unwrap_or(0).max(1) as f64);
        true
    })
    .context(
        "texture coordinates cannot be made; try --texture-size, --texel or --margin, or --into vertex",
    )?;
    // Margins are known only now: small images hold little else.
    if f64::from(atlas.page_count) > MOST_IMAGES {
        bail!(
            "new texture coordinates with their margins would need {} images of {page_size}x{page_size}, more than \
             {MOST_IMAGES}; try a larger --texture-size, a smaller --margin, a longer --texel, or --into vertex",
            atlas.page_count
        );
    }
    layout.texel_m = Some(1.0 / f64::from(atlas.texels_per_unit));
    // A page that is half empty is cut, so that sides are powers of two.
    let (width, cropped) = (atlas.width, atlas.height);
    let height = if 2 * cropped <= width { cropped.next_power_of_two() } else { width.max(cropped) };
    let first_sheet = layout.sheets.len();
    let sheet = Sheet { width, height, repeats: false, patches: Vec::new() };
    layout.sheets.extend(std::iter::repeat_n(sheet, atlas.page_count as usize));
    for (mesh, output) in prepared.iter().zip(&atlas.meshes) {
        let first_copy = first_copy(plans, mesh.plan);
        let plan = &mut plans[mesh.plan];
        let frames = frames(output, height, cropped, plan.copies.len());
        split(layout, plan, origins, surfaces, pieces, mesh, output, &frames, first_copy, first_sheet);
    }
    Ok(())
}

/// How a copy's coordinates come from the library's.
#[derive(Clone, Copy, Debug)]
struct Frame {
    /// The page of all, where it is not the vertices' own.
    page: Option<u32>,
    offset: Vec2,
    scale: Vec2,
}

fn frames(output: &OutputMesh, height: u32, cropped: u32, copies: usize) -> Vec<Frame> {
    let shrink = Vec2::new(1.0, cropped as f32 / height as f32);
    if output.instances.is_empty() {
        return vec![Frame { page: None, offset: Vec2::ZERO, scale: shrink }; copies];
    }
    let frame = |rectangle: &uvunwrap::InstanceRect| {
        let (min, max) = (Vec2::from(rectangle.min), Vec2::from(rectangle.max));
        Frame { page: Some(rectangle.page), offset: min * shrink, scale: (max - min) * shrink }
    };
    output.instances.iter().map(frame).collect()
}

fn prepare(plans: &[MeshPlan], surfaces: &Surfaces<'_>, pieces: &[PieceAt]) -> (Prepared, f64) {
    let plan = &plans[pieces[0].plan];
    let mesh = &surfaces.scene.meshes[plan.mesh];
    let mut ignored = vec![true; mesh.triangles.len()];
    for at in pieces {
        ignored[triangles_of(mesh, plan.pools[at.pool].pieces[at.piece].part)].fill(false);
    }
    // Lengths along the mesh's axes as the first instance stretches them.
    let first = plan.copies[0].members[0] as usize;
    let map = surfaces.scene.instances[first].rest_from_mesh;
    let stretch = Vec3::new(map.x_axis.length(), map.y_axis.length(), map.z_axis.length());
    let stretch = if stretch.is_finite() && stretch.min_element() > 0.0 { stretch } else { Vec3::ONE };
    let positions: Vec<[f32; 3]> = mesh.positions.iter().map(|p| (*p * stretch).to_array()).collect();
    let own_area: f64 = (0..mesh.triangles.len())
        .filter(|&t| !ignored[t])
        .map(|t| {
            let [a, b, c] = mesh.triangles[t].map(|v| Vec3::from(positions[v as usize]).as_dvec3());
            0.5 * (b - a).cross(c - a).length()
        })
        .sum();
    let areas: Vec<f64> = plan
        .copies
        .iter()
        .map(|copy| {
            let instance = copy.members[0] as usize;
            (0..ignored.len()).filter(|&t| !ignored[t]).map(|t| surfaces.area_m2(instance, t)).sum()
        })
        .collect();
    let scale_of = |area: f64| {
        let scale = (area / own_area).sqrt() as f32;
        if scale.is_finite() && scale > 0.0 { scale } else { 1.0 }
    };
    let scales: Vec<f32> = areas.iter().map(|&area| scale_of(area)).collect();
    let largest = scales.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
    let (scale, scales) = match scales.len() {
        1 => (scales[0], Vec::new()),
        _ => (1.0, scales.iter().map(|scale| scale.max(LEAST_SCALE * largest)).collect()),
    };
    let indices = mesh.triangles.as_flattened().to_vec();
    let prepared = Prepared { plan: pieces[0].plan, positions, indices, ignored, scales, scale };
    (prepared, areas.iter().sum())
}

/// Splits the vertices of a plan where its new coordinates differ, and puts its triangles on the images.
#[expect(clippy::too_many_arguments, reason = "one step, cut out of its caller")]
fn split(
    layout: &mut Layout,
    plan: &mut MeshPlan,
    origins: &Origins,
    surfaces: &Surfaces<'_>,
    pieces: &[PieceAt],
    mesh: &Prepared,
    output: &OutputMesh,
    frames: &[Frame],
    first_copy: usize,
    first_sheet: usize,
) {
    let scene_mesh = &surfaces.scene.meshes[plan.mesh];
    let elements = &origins.meshes[plan.mesh].vertices;
    for pool_index in 0..plan.pools.len() {
        let is_new = |piece: usize| {
            pieces.binary_search(&PieceAt { plan: mesh.plan, pool: pool_index, piece }).is_ok()
        };
        let pool = &mut plan.pools[pool_index];
        let old = std::mem::take(&mut pool.pieces);
        if !(0..old.len()).any(is_new) {
            pool.pieces = old;
            continue;
        }
        let mut splitter = Splitter::new(pool);
        let set = (0..).find(|set| !pool.attributes.has(&format!("TEXCOORD_{set}"))).unwrap_or(0);
        // What pieces read so far, for those that keep it.
        let kept: Vec<Vec<Option<Reads>>> = (0..frames.len())
            .map(|copy| std::mem::take(&mut layout.reads[first_copy + copy][pool_index]))
            .collect();
        for (index, piece) in old.iter().enumerate() {
            let mut by_page: Vec<(u32, Vec<[u32; 3]>)> = Vec::new();
            for t in triangles_of(scene_mesh, piece.part) {
                let vertices = [0, 1, 2].map(|k| &output.vertices[output.indices[3 * t + k] as usize]);
                let page = if is_new(index) { vertices[0].page.unwrap_or(0) } else { 0 };
                let corners = vertices.map(|vertex| {
                    let uv = if is_new(index) { Vec2::from(vertex.uv) } else { Vec2::ZERO };
                    splitter.vertex(elements[vertex.xref as usize], is_new(index).then_some(uv))
                });
                match by_page.iter_mut().find(|(known, _)| *known == page) {
                    Some((_, triangles)) => triangles.push(corners),
                    None => by_page.push((page, vec![corners])),
                }
                if is_new(index) && !mesh.ignored[t] {
                    for (copy, frame) in frames.iter().enumerate() {
                        let sheet = &mut layout.sheets[first_sheet + frame.page.unwrap_or(page) as usize];
                        let size = Vec2::new(sheet.width as f32, sheet.height as f32);
                        let corners =
                            vertices.map(|v| (frame.offset + Vec2::from(v.uv) * frame.scale) * size);
                        let copy = (first_copy + copy) as u32;
                        sheet.patches.push(Patch { copy, triangle: t as u32, corners });
                    }
                }
            }
            for (page, triangles) in by_page {
                for (copy, frame) in frames.iter().enumerate() {
                    let sheet = first_sheet + frame.page.unwrap_or(page) as usize;
                    let reads = if is_new(index) { Some(Reads { sheet, set }) } else { kept[copy][index] };
                    layout.reads[first_copy + copy][pool_index].push(reads);
                }
                pool.pieces.push(Piece { part: piece.part, triangles, page });
            }
        }
        let uvs = splitter.finish(pool);
        for (copy, frame) in frames.iter().enumerate() {
            let bytes = uvs
                .iter()
                .flat_map(|&uv| (frame.offset + uv * frame.scale).to_array())
                .flat_map(f32::to_le_bytes)
                .collect();
            let (kind, component) = ("VEC2", Component::F32);
            let name = format!("TEXCOORD_{set}");
            layout.coordinates[first_copy + copy][pool_index] =
                Some(Attribute { name, kind, component, normalized: false, bytes });
        }
    }
}

/// Gives each pair of an element and its coordinates a vertex: the first pair of an element the element's own, others new
/// ones at the end, so that what needs no split stays as it is.
struct Splitter {
    /// Elements of the vertices; ascending up to `own`.
    sources: Vec<u32>,
    /// Vertices that are not copies.
    own: usize,
    /// Whether `sources` is simply all elements.
    is_whole: bool,
    uvs: Vec<Option<[u32; 2]>>,
    copies: HashMap<(u32, [u32; 2]), u32>,
}

impl Splitter {
    fn new(pool: &Pool) -> Splitter {
        let is_whole = pool.sources.is_none();
        let sources = pool.sources.clone().unwrap_or_else(|| (0..pool.count as u32).collect());
        let own = sources.len();
        Splitter { uvs: vec![None; own], sources, own, is_whole, copies: HashMap::new() }
    }

    /// The vertex of an element with these coordinates; without coordinates any of the element.
    fn vertex(&mut self, element: u32, uv: Option<Vec2>) -> u32 {
        let vertex = match self.is_whole {
            true => element,
            false => self.sources[..self.own].partition_point(|&known| known < element) as u32,
        };
        let Some(uv) = uv else { return vertex };
        let bits = uv.to_array().map(f32::to_bits);
        match &mut self.uvs[vertex as usize] {
            Some(known) if *known == bits => return vertex,
            Some(_) => {}
            free => {
                *free = Some(bits);
                return vertex;
            }
        }
        let next = self.sources.len() as u32;
        let copy = *self.copies.entry((vertex, bits)).or_insert(next);
        if copy == next {
            self.sources.push(element);
            self.uvs.push(Some(bits));
        }
        copy
    }

    /// Hands the vertices to the pool; gives their coordinates.
    fn finish(self, pool: &mut Pool) -> Vec<Vec2> {
        let needs_sources = self.sources.len() > self.own || !self.is_whole || pool.spans_pages();
        if needs_sources {
            pool.sources = Some(self.sources);
        } else {
            for piece in &mut pool.pieces {
                piece.triangles = Vec::new();
            }
        }
        let of =
            |bits: Option<[u32; 2]>| bits.map_or(Vec2::ZERO, |bits| Vec2::from(bits.map(f32::from_bits)));
        self.uvs.into_iter().map(of).collect()
    }
}
