//! `dapple bake`: visibility into the file of a scene, or into one of points. Files are written at the end and whole, so an
//! interrupted run leaves what was there.

mod accessor;
mod convert;
mod document;
mod edit;
mod fit;
mod gather;
mod input;
mod json;
mod plan;
mod surfaces;
mod vertices;

use std::cell::Cell;
use std::path::Path;

use anyhow::{Result, bail};
use dapple_scene::{Pose, Scene};
use dapple_trace::rtao::{MAX_RAYS, RtaoParams};

use crate::args::BakeArgs;
use crate::args::bake::{Attribute, Instances};
use crate::picture::write_parts;
use crate::progress::Bar;
use crate::source;
use edit::CopyEdit;
use input::Input;
use plan::{MeshPlan, plan, split_instances};
use surfaces::Surfaces;
use vertices::{Density, Welded, bake_vertices, place_counts, spread};

/// Bakes what the arguments ask for and writes it.
pub(crate) fn run(args: &BakeArgs) -> Result<()> {
    check(args)?;
    let mut input = input::load(&args.scene)?;
    let (radius_m, density_factor) = source::resolve(&input.scene, args.radius)?;
    let pose = pose(&mut input.scene, args.time);
    let params = RtaoParams { rays: args.rays, radius_m, seed: u64::from(args.seed) };
    let Input { scene, origins, mut document, .. } = input;
    let wheel = Bar::spinner("building");
    let surfaces = Surfaces::new(&scene, &pose, params, args.bent_normals);
    let mut plans = plan(&document, &origins, &surfaces)?;
    drop(wheel);
    if args.instances == Instances::Split {
        let shared =
            plans.iter().map(|plan| plan.copies[0].instances.len()).filter(|&n| n > 1).sum::<usize>();
        let bar = Bar::new("comparing instances", shared as u64);
        let compared = Cell::new(0);
        split_instances(&mut plans, &surfaces, &|| {
            compared.set(compared.get() + 1);
            bar.set(compared.get());
        });
    }
    let density = Density { per_m2: f64::from(args.points * density_factor), rays: args.rays.div_ceil(4) };
    let elsewhere = edit::used_elsewhere(&document, &plans, &origins, &scene)?;
    let all: u64 = plans
        .iter()
        .flat_map(|plan| &plan.copies)
        .flat_map(|copy| place_counts(&surfaces, copy, density))
        .map(u64::from)
        .sum();
    let bar = Bar::new("vertices", all);
    let measured = Cell::new(0);
    for plan in &plans {
        let edits = vertex_edits(args, &document, plan, &origins, &surfaces, density, &|places| {
            measured.set(measured.get() + places as u64);
            bar.set(measured.get());
        })?;
        let keep = elsewhere.contains(&plan.mesh);
        let indices = edit::write_mesh(&mut document, plan, &origins, &edits, keep)?;
        edit::place_copies(&mut document, plan, &origins, &scene, &indices)?;
    }
    drop(bar);
    for output in &args.output {
        let parts = document.into_file(output)?;
        let parts: Vec<&[u8]> = parts.iter().map(Vec::as_slice).collect();
        write_parts(output, &parts)?;
        let bytes: usize = parts.iter().map(|part| part.len()).sum();
        say!("wrote {} ({:.1} MB)", output.display(), bytes as f64 / 1e6);
        break;
    }
    Ok(())
}

fn check(args: &BakeArgs) -> Result<()> {
    if !(1..=MAX_RAYS).contains(&args.rays) {
        bail!("--rays is {}, must be 1 to {MAX_RAYS}", args.rays);
    }
    if !(args.points.is_finite() && args.points > 0.0) {
        bail!("--points is {}, must be above 0", args.points);
    }
    if args.time.is_some_and(|time| !time.is_finite()) {
        bail!("--time must be a finite number of seconds");
    }
    for output in &args.output {
        check_output(output)?;
    }
    Ok(())
}

fn check_output(output: &Path) -> Result<()> {
    let extension = output.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    if !["glb", "gltf", "ply", "dapple"].contains(&extension.as_str()) {
        bail!("{}: name it .glb or .gltf (a scene), .ply or .dapple (points)", output.display());
    }
    if output.is_dir() {
        bail!("cannot write {}: it is a folder", output.display());
    }
    Ok(())
}

/// How things stand: at a time of the animation, or as the file has them.
fn pose(scene: &mut Scene, time: Option<f64>) -> Pose {
    if let Some(time) = time {
        return scene.pose(time);
    }
    let active = scene.active_animation;
    scene.set_active_animation(None);
    let pose = scene.pose(0.0);
    scene.set_active_animation(active);
    pose
}

/// Bakes the vertices of all copies of a mesh.
fn vertex_edits(
    args: &BakeArgs,
    document: &document::Document,
    plan: &MeshPlan,
    origins: &dapple_scene::Origins,
    surfaces: &Surfaces<'_>,
    density: Density,
    done: &dyn Fn(usize),
) -> Result<Vec<CopyEdit>> {
    let mesh = &surfaces.scene.meshes[plan.mesh];
    let origin = &origins.meshes[plan.mesh];
    let welded = Welded::new(mesh, plan);
    let mut edits = Vec::new();
    for copy in &plan.copies {
        let values = bake_vertices(surfaces, copy, &welded, density, done);
        let mut edit = CopyEdit::default();
        for pool in &plan.pools {
            let values = spread(pool, mesh, origin, &welded, &values);
            let mut attributes = vec![match &args.attribute {
                Attribute::Own(name) => vertices::scalar_attribute(name, &values),
                Attribute::Color => {
                    let element_of =
                        |i: usize| pool.sources.as_ref().map_or(i, |sources| sources[i] as usize);
                    let given = pool.attributes.whole("COLOR_0")?;
                    let given = given.map(|accessor| document.elements(accessor)).transpose()?;
                    vertices::color_attribute(
                        &values,
                        given.as_ref().map(|g| (g, &element_of as &dyn Fn(usize) -> usize)),
                    )
                }
            }];
            if args.bent_normals {
                attributes.push(vertices::bent_attribute(&values));
            }
            edit.attributes.push(attributes);
        }
        edits.push(edit);
    }
    Ok(edits)
}
