//! Bakes into the document of a scene: images and materials, attributes of vertices, meshes that read them.

use std::cell::Cell;
use std::collections::BTreeMap;

use anyhow::{Result, bail};
use dapple_scene::{Origins, Scene};

use super::document::{Document, List};
use super::edit::{self, CopyEdit};
use super::json::Object;
use super::layout::{Layout, Settings, lay_out};
use super::materials::{Wardrobe, count_worn};
use super::plan::{MeshPlan, Pool, plan, split_instances};
use super::surfaces::Surfaces;
use super::sweep::{accessor_users, sweep, views_in_use};
use super::texels::{Images, bake_sheets};
use super::vertices::{self, AtVertex, Density, Welded, bake_vertices, place_counts, spread};
use crate::args::BakeArgs;
use crate::args::bake::{Attribute, Instances, Into, Uv};
use crate::progress::Bar;

/// What was baked, to be told.
#[derive(Debug, Default)]
pub(crate) struct Report {
    /// Width and height of the images.
    pub(crate) images: Vec<(u32, u32)>,
    pub(crate) texel_m: Option<f64>,
    pub(crate) vertices: usize,
    /// Meshes that were added, as instances differ.
    pub(crate) copies: usize,
}

impl std::fmt::Display for Report {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut parts = Vec::new();
        match self.images.as_slice() {
            [] => {}
            [(width, height)] => parts.push(format!("an image of {width}x{height}")),
            [(width, height), ..] if self.images.iter().all(|size| *size == self.images[0]) => {
                parts.push(format!("{} images of {width}x{height}", self.images.len()));
            }
            images => parts.push(format!("{} images", images.len())),
        }
        if let Some(texel_m) = self.texel_m {
            parts.push(format!("texels of {} in new coordinates", length(texel_m)));
        }
        if self.vertices > 0 {
            parts.push(format!("{} vertices", self.vertices));
        }
        if self.copies > 0 {
            parts.push(format!("{} meshes added, as instances differ", self.copies));
        }
        f.write_str(&parts.join(", "))
    }
}

/// A length to three digits, in a unit that suits it.
fn length(metres: f64) -> String {
    let (value, unit) = match metres {
        m if m >= 1.0 => (m, "m"),
        m if m >= 0.01 => (100.0 * m, "cm"),
        m => (1000.0 * m, "mm"),
    };
    let digits = if value >= 100.0 {
        0
    } else if value >= 10.0 {
        1
    } else {
        2
    };
    format!("{value:.digits$} {unit}")
}

/// What is baked into.
pub(crate) struct Target<'a> {
    pub(crate) document: Document,
    pub(crate) origins: &'a Origins,
    pub(crate) title: &'a str,
    /// Points a square metre for each that were asked for.
    pub(crate) density_factor: f32,
}

/// Bakes what the arguments ask for; gives the document back.
pub(crate) fn bake(
    args: &BakeArgs,
    surfaces: &Surfaces<'_>,
    target: Target<'_>,
) -> Result<(Document, Report)> {
    let Target { mut document, origins, title, density_factor } = target;
    let scene = surfaces.scene;
    let mut plans = plan(&document, origins, surfaces)?;
    if plans.is_empty() {
        bail!(
            "{title}: no mesh receives light (extras.receives is false on all nodes): there is nothing to bake"
        );
    }
    if args.instances == Instances::Split {
        let shared =
            plans.iter().map(|plan| plan.copies[0].instances.len()).filter(|&n| n > 1).sum::<usize>();
        let bar = Counter::new("comparing instances", shared);
        split_instances(&mut plans, surfaces, &|| bar.add(1));
    }
    let elsewhere = edit::used_elsewhere(&document, &plans, origins, scene)?;
    let mut report = Report::default();
    let textures = match args.into {
        Into::Vertex => None,
        Into::Texture | Into::Both => {
            let layout = lay(args, &mut plans, origins, surfaces)?;
            let images = images(args, surfaces, &layout)?;
            report.images = layout.sheets.iter().map(|sheet| (sheet.width, sheet.height)).collect();
            report.texel_m = layout.texel_m;
            let others = worn_elsewhere(&document, &plans, origins, &elsewhere)?;
            let wardrobe = Wardrobe::new(&mut document, &images, others)?;
            Some((layout, wardrobe))
        }
    };
    let mut edits = new_edits(&plans);
    if let Some((layout, mut wardrobe)) = textures {
        dress(&mut edits, &mut document, &plans, origins, layout, &mut wardrobe)?;
        wardrobe.warn(title);
    }
    if args.into != Into::Texture {
        let density =
            Density { per_m2: f64::from(args.points * density_factor), rays: args.rays.div_ceil(2) };
        report.vertices = bake_all_vertices(args, &document, &plans, origins, surfaces, density, &mut edits)?;
    }
    let (users, before) = (accessor_users(&document)?, views_in_use(&document)?);
    for (plan, edits) in plans.iter().zip(&edits) {
        let keep = elsewhere.contains(&plan.mesh);
        let indices = edit::write_mesh(&mut document, plan, origins, edits, keep, users.as_deref())?;
        report.copies += indices.len() - 1;
        edit::place_copies(&mut document, plan, origins, scene, &indices)?;
    }
    if let Some(users) = users {
        sweep(&mut document, &before, &users)?;
    }
    Ok((document, report))
}

/// A bar that counts up.
struct Counter {
    bar: Bar,
    done: Cell<u64>,
}

impl Counter {
    fn new(what: &str, all: usize) -> Counter {
        Counter { bar: Bar::new(what, all as u64), done: Cell::new(0) }
    }

    fn add(&self, more: u64) {
        self.done.set(self.done.get() + more);
        self.bar.set(self.done.get());
    }
}

fn lay(
    args: &BakeArgs,
    plans: &mut [MeshPlan],
    origins: &Origins,
    surfaces: &Surfaces<'_>,
) -> Result<Layout> {
    let settings = Settings {
        sets: match args.uv {
            Uv::Auto => &[1, 0],
            Uv::First => &[0],
            Uv::Second => &[1],
            Uv::New => &[],
        },
        side: args.texture_size,
        texel_m: args.texel,
        radius_m: f64::from(surfaces.params().radius_m),
        margin: args.margin,
    };
    let bar = Bar::new("laying surfaces flat", 1000);
    lay_out(plans, origins, surfaces, &settings, &|what, share| {
        bar.message(what);
        bar.set((share * 1000.0) as u64);
    })
}

fn images(args: &BakeArgs, surfaces: &Surfaces<'_>, layout: &Layout) -> Result<Vec<Images>> {
    let rows: usize = layout.sheets.iter().map(|sheet| sheet.height as usize).sum();
    let bar = Counter::new("texels", rows);
    bake_sheets(surfaces, layout, args.margin, &|rows| bar.add(u64::from(rows)))
}

/// How many primitives that are not baked wear each material.
fn worn_elsewhere(
    document: &Document,
    plans: &[MeshPlan],
    origins: &Origins,
    elsewhere: &std::collections::BTreeSet<usize>,
) -> Result<BTreeMap<usize, usize>> {
    let mut worn = BTreeMap::new();
    for mesh in 0..document.len(List::Meshes) {
        count_worn(&document.object(List::Meshes, mesh)?.list("primitives")?, &mut worn, 1)?;
    }
    for plan in plans.iter().filter(|plan| !elsewhere.contains(&plan.mesh)) {
        let primitives = document.object(List::Meshes, plan.mesh)?.list("primitives")?;
        let baked = &origins.meshes[plan.mesh].primitives;
        let baked: Vec<_> = baked.iter().map(|&p| primitives[p as usize].clone()).collect();
        count_worn(&baked, &mut worn, -1)?;
    }
    Ok(worn.into_iter().filter(|(_, count)| *count > 0).map(|(m, count)| (m, count as usize)).collect())
}

/// Edits of all plans, nothing in them yet.
fn new_edits(plans: &[MeshPlan]) -> Vec<Vec<CopyEdit>> {
    let empty = |plan: &MeshPlan| CopyEdit {
        attributes: vec![Vec::new(); plan.pools.len()],
        materials: plan.pools.iter().map(|pool| vec![None; pool.pieces.len()]).collect(),
    };
    plans.iter().map(|plan| vec![empty(plan); plan.copies.len()]).collect()
}

/// New texture coordinates, and materials that read the images.
fn dress(
    edits: &mut [Vec<CopyEdit>],
    document: &mut Document,
    plans: &[MeshPlan],
    origins: &Origins,
    layout: Layout,
    wardrobe: &mut Wardrobe,
) -> Result<()> {
    let of_copies = layout.reads.into_iter().zip(layout.coordinates);
    let edits =
        plans.iter().zip(edits).flat_map(|(plan, edits)| edits.iter_mut().map(move |edit| (plan, edit)));
    for ((plan, edit), (reads, coordinates)) in edits.zip(of_copies) {
        let primitives = document.object(List::Meshes, plan.mesh)?.list("primitives")?;
        for (pool_index, (pool, coordinates)) in plan.pools.iter().zip(coordinates).enumerate() {
            edit.attributes[pool_index].extend(coordinates);
            for (piece_index, piece) in pool.pieces.iter().enumerate() {
                let Some(reads) = reads[pool_index][piece_index] else { continue };
                let primitive = origins.meshes[plan.mesh].primitives[piece.part] as usize;
                let primitive = Object::parse(&primitives[primitive])?;
                let dressed = wardrobe.dress(document, &primitive, reads)?;
                edit.materials[pool_index][piece_index] = Some(dressed);
            }
        }
    }
    Ok(())
}

/// Bakes the vertices of all copies of all meshes; gives how many there are.
fn bake_all_vertices(
    args: &BakeArgs,
    document: &Document,
    plans: &[MeshPlan],
    origins: &Origins,
    surfaces: &Surfaces<'_>,
    density: Density,
    edits: &mut [Vec<CopyEdit>],
) -> Result<usize> {
    let places = |plan: &MeshPlan| -> usize {
        let of = |copy| place_counts(surfaces, copy, density).into_iter().map(|n| n as usize).sum::<usize>();
        plan.copies.iter().map(of).sum()
    };
    let bar = Counter::new("vertices", plans.iter().map(places).sum());
    let mut vertices = 0;
    for (plan, edits) in plans.iter().zip(edits) {
        let mesh = &surfaces.scene.meshes[plan.mesh];
        let origin = &origins.meshes[plan.mesh];
        let welded = Welded::new(mesh, plan);
        for (copy, edit) in plan.copies.iter().zip(edits) {
            let values = bake_vertices(surfaces, copy, &welded, density, &|places| bar.add(places as u64));
            for (pool, attributes) in plan.pools.iter().zip(&mut edit.attributes) {
                let values = spread(pool, mesh, origin, &welded, &values);
                vertices += values.len();
                attributes.extend(attributes_of(args, document, pool, &values)?);
            }
        }
    }
    Ok(vertices)
}

fn attributes_of(
    args: &BakeArgs,
    document: &Document,
    pool: &Pool,
    values: &[Option<&AtVertex>],
) -> Result<Vec<super::accessor::Attribute>> {
    let mut attributes = vec![match &args.attribute {
        Attribute::Own(name) => vertices::scalar_attribute(name, values),
        Attribute::Color => {
            let given = pool.attributes.whole("COLOR_0")?;
            let given = given.map(|accessor| document.elements(accessor)).transpose()?;
            let element_of = |i: usize| pool.sources.as_ref().map_or(i, |sources| sources[i] as usize);
            vertices::color_attribute(values, given.as_ref(), &element_of)
        }
    }];
    if args.bent_normals {
        attributes.push(vertices::bent_attribute(values));
    }
    Ok(attributes)
}

/// How things stand: at a time of the animation, or as the file has them.
pub(crate) fn pose(scene: &mut Scene, time: Option<f64>) -> dapple_scene::Pose {
    if let Some(time) = time {
        return scene.pose(time);
    }
    let active = scene.active_animation;
    scene.set_active_animation(None);
    let pose = scene.pose(0.0);
    scene.set_active_animation(active);
    pose
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_have_three_digits_and_a_unit() {
        for (metres, text) in [
            (0.000_25, "0.25 mm"),
            (0.004_567, "4.57 mm"),
            (0.05, "5.00 cm"),
            (0.3217, "32.2 cm"),
            (150.0, "150 m"),
        ] {
            assert_eq!(length(metres), text);
        }
    }
}
