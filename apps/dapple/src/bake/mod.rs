//! `dapple bake`: visibility into the file of a scene, or into one of points. Files are written at the end and whole, so an
//! interrupted run leaves what was there.

mod accessor;
mod convert;
mod document;
mod edit;
mod fill;
mod fit;
mod gather;
mod given;
mod input;
mod into;
mod json;
mod layout;
mod materials;
mod plan;
mod raster;
mod surfaces;
mod texels;
mod unwrap;
mod vertices;

use std::path::Path;

use anyhow::{Result, bail};
use dapple_trace::rtao::{MAX_RAYS, RtaoParams};

use crate::args::BakeArgs;
use crate::picture::write_parts;
use crate::progress::Bar;
use crate::source;
use input::Input;
use surfaces::Surfaces;

/// Bakes what the arguments ask for and writes it.
pub(crate) fn run(args: &BakeArgs) -> Result<()> {
    check(args)?;
    let Input { mut scene, origins, document, title } = input::load(&args.scene)?;
    let (radius_m, density_factor) = source::resolve(&scene, args.radius)?;
    let pose = into::pose(&mut scene, args.time);
    let params = RtaoParams { rays: args.rays, radius_m, seed: u64::from(args.seed) };
    let wheel = Bar::spinner("building");
    let surfaces = Surfaces::new(&scene, &pose, params, args.bent_normals);
    drop(wheel);
    let target = into::Target { document, origins: &origins, title: &title, density_factor };
    let (document, report) = into::bake(args, &surfaces, target)?;
    let output = &args.output[0];
    let parts = document.into_file(output)?;
    let parts: Vec<&[u8]> = parts.iter().map(Vec::as_slice).collect();
    write_parts(output, &parts)?;
    let bytes: usize = parts.iter().map(|part| part.len()).sum();
    say!("wrote {} ({:.1} MB) {report:?}", output.display(), bytes as f64 / 1e6);
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
    if !(16..=16384).contains(&args.texture_size) {
        bail!("--texture-size is {}, must be 16 to 16384", args.texture_size);
    }
    if args.texel.is_some_and(|texel| !(texel.is_finite() && texel > 0.0)) {
        bail!("--texel must be a length in metres above 0");
    }
    if !(1..=64).contains(&args.margin) || 4 * args.margin > args.texture_size {
        bail!("--margin is {}, must be 1 to 64 and at most a quarter of --texture-size", args.margin);
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
