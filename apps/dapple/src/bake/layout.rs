//! Where on which image each surface lies: in texture coordinates that the file has, where they serve, and otherwise in new
//! ones.

use std::collections::BTreeMap;

use anyhow::Result;
use dapple_scene::glam::{DVec2, Vec2};
use dapple_scene::{Mesh, Origins};

use super::accessor::Attribute;
use super::given::{Given, find_given, in_unit_square};
use super::plan::{Copy, MeshPlan, triangles_of};
use super::surfaces::Surfaces;
use super::unwrap::unwrap;

/// How images are laid out.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Settings {
    /// Sets of texture coordinates of the file that may be used, best first.
    pub(crate) sets: &'static [u8],
    /// Longest side of an image, texels.
    pub(crate) side: u32,
    /// Edge of a texel, metres; `None` for one that fits.
    pub(crate) texel_m: Option<f64>,
    /// Occlusion distance, metres: detail is not finer than a part of it.
    pub(crate) radius_m: f64,
    /// Texels that stay free around each piece of surface.
    pub(crate) margin: u32,
}

/// Texels of which an edge of detail is made: the part of the occlusion distance.
const TEXELS_OF_RADIUS: f64 = 12.0;

/// What an image has at least if its longest side may be this long, or that.
const LEAST_SIDE: u32 = 1024;

/// Part of an image that surfaces fill, about.
pub(crate) const FILLED: f64 = 0.65;

/// An image to be baked.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sheet {
    pub(crate) width: u32,
    pub(crate) height: u32,
    /// Coordinates of the file may rely on it that images repeat.
    pub(crate) repeats: bool,
    pub(crate) patches: Vec<Patch>,
}

/// A triangle on an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Patch {
    /// Index into [`Layout::copies`].
    pub(crate) copy: u32,
    pub(crate) triangle: u32,
    /// Texels; the centre of the first is at ½.
    pub(crate) corners: [Vec2; 3],
}

/// What a piece reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Reads {
    /// Index into [`Layout::sheets`].
    pub(crate) sheet: usize,
    /// Set of texture coordinates.
    pub(crate) set: u32,
}

/// Where all surfaces lie.
#[derive(Debug, Default)]
pub(crate) struct Layout {
    pub(crate) sheets: Vec<Sheet>,
    /// All copies of all plans, one plan after the other.
    pub(crate) copies: Vec<Copy>,
    /// For each copy, for each pool, for each piece.
    pub(crate) reads: Vec<Vec<Vec<Option<Reads>>>>,
    /// For each copy, for each pool new texture coordinates.
    pub(crate) coordinates: Vec<Vec<Option<Attribute>>>,
    /// Edge of a texel, metres, where coordinates are new.
    pub(crate) texel_m: Option<f64>,
}

/// A piece of a plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct PieceAt {
    pub(crate) plan: usize,
    pub(crate) pool: usize,
    pub(crate) piece: usize,
}

/// Lays out all surfaces. Vertices of the plans are split where new coordinates need it.
pub(crate) fn lay_out(
    plans: &mut [MeshPlan],
    origins: &Origins,
    surfaces: &Surfaces<'_>,
    settings: &Settings,
    progress: &(dyn Fn(&str, f64) + Sync),
) -> Result<Layout> {
    let mut layout = Layout::default();
    for plan in plans.iter() {
        for copy in &plan.copies {
            layout.copies.push(copy.clone());
            layout.reads.push(plan.pools.iter().map(|pool| vec![None; pool.pieces.len()]).collect());
            layout.coordinates.push(vec![None; plan.pools.len()]);
        }
    }
    let given = find_given(plans, surfaces, settings.sets);
    for group in &given.groups {
        add_given(&mut layout, plans, surfaces, settings, group);
    }
    if !given.others.is_empty() {
        unwrap(&mut layout, plans, origins, surfaces, settings, &given.others, progress)?;
    }
    Ok(layout)
}

/// The image of pieces that lie apart in coordinates of their own.
fn add_given(
    layout: &mut Layout,
    plans: &[MeshPlan],
    surfaces: &Surfaces<'_>,
    settings: &Settings,
    group: &Given,
) {
    let (mut area_m2, mut area_uv) = (0.0, 0.0);
    for at in &group.pieces {
        let (mesh, instance) =
            (&surfaces.scene.meshes[plans[at.plan].mesh], plans[at.plan].copies[0].members[0]);
        for t in triangles_of(mesh, plans[at.plan].pools[at.pool].pieces[at.piece].part) {
            area_m2 += surfaces.area_m2(instance as usize, t);
            area_uv += uv_area(mesh, group.set, t);
        }
    }
    // The side at which texels have the wanted size in the mean.
    let texel_m = settings.texel_m.unwrap_or_else(|| wanted_texel_m(area_m2, settings));
    let side = (area_m2 / area_uv.max(1e-9)).sqrt() / texel_m;
    let side = (side.ceil().clamp(4.0, 65536.0) as u32).next_power_of_two();
    if let Some(texel_m) = settings.texel_m.filter(|_| side > settings.side) {
        tracing::warn!(
            "--texel {texel_m} would need {side}x{side} texels in the file's own coordinates: it gets {max}x{max}, as \
             --texture-size is {max}; --uv new lays surfaces out on several images",
            max = settings.side
        );
    }
    let side = side.min(settings.side);
    let mut sheet = Sheet { width: side, height: side, repeats: true, patches: Vec::new() };
    let number = layout.sheets.len();
    for at in &group.pieces {
        let copy = first_copy(plans, at.plan);
        let plan = &plans[at.plan];
        let mesh = &surfaces.scene.meshes[plan.mesh];
        let piece = &plan.pools[at.pool].pieces[at.piece];
        for t in triangles_of(mesh, piece.part) {
            let Some(corners) = in_unit_square(uv_corners(mesh, group.set, t)) else { continue };
            let corners = corners.map(|uv| uv * side as f32);
            sheet.patches.push(Patch { copy: copy as u32, triangle: t as u32, corners });
        }
        let reads = Reads { sheet: number, set: u32::from(group.set) };
        layout.reads[copy][at.pool][at.piece] = Some(reads);
    }
    layout.sheets.push(sheet);
}

/// Edge of a texel for that much surface on one image: a part of the occlusion distance, finer where there is room, and
/// coarser where there is not.
pub(crate) fn wanted_texel_m(area_m2: f64, settings: &Settings) -> f64 {
    let at_side = |side: u32| (area_m2.max(1e-12) / (FILLED * f64::from(side) * f64::from(side))).sqrt();
    let fine = (settings.radius_m / TEXELS_OF_RADIUS).min(at_side(settings.side.min(LEAST_SIDE)));
    fine.max(at_side(settings.side))
}

/// The side of a square image that holds so much surface in texels of that size, a power of two.
pub(crate) fn side_for(area_m2: f64, texel_m: f64, settings: &Settings) -> u32 {
    let side = (area_m2 / FILLED).sqrt() / texel_m;
    let power = (side.clamp(16.0, 65536.0) as u32).next_power_of_two();
    power.min(settings.side)
}

/// Number of a plan's first copy in [`Layout::copies`].
pub(crate) fn first_copy(plans: &[MeshPlan], plan: usize) -> usize {
    plans[..plan].iter().map(|plan| plan.copies.len()).sum()
}

/// Texture coordinates of a triangle's corners.
pub(crate) fn uv_corners(mesh: &Mesh, set: u8, triangle: usize) -> [Vec2; 3] {
    mesh.triangles[triangle].map(|v| mesh.uvs[usize::from(set)][v as usize])
}

/// Area of a triangle in texture coordinates.
pub(crate) fn uv_area(mesh: &Mesh, set: u8, triangle: usize) -> f64 {
    let [a, b, c] = uv_corners(mesh, set, triangle).map(|uv| DVec2::new(f64::from(uv.x), f64::from(uv.y)));
    0.5 * (b - a).perp_dot(c - a).abs()
}

/// All pieces of all plans, by material of the scene.
pub(crate) fn pieces_by_material(plans: &[MeshPlan], surfaces: &Surfaces<'_>) -> BTreeMap<u32, Vec<PieceAt>> {
    let mut by_material: BTreeMap<u32, Vec<PieceAt>> = BTreeMap::new();
    for (plan_index, plan) in plans.iter().enumerate() {
        let mesh = &surfaces.scene.meshes[plan.mesh];
        for (pool, of_pool) in plan.pools.iter().enumerate() {
            for (piece, of_piece) in of_pool.pieces.iter().enumerate() {
                let material = mesh.parts[of_piece.part].material;
                by_material.entry(material).or_default().push(PieceAt { plan: plan_index, pool, piece });
            }
        }
    }
    by_material
}
