//! `dapple bake`: visibility into the file of a scene, or into one of points. Files are written at the end and whole, so an
//! interrupted run leaves what was there.

mod accessor;
mod convert;
mod document;
mod edit;
pub(crate) mod fill;
mod fit;
mod gather;
mod given;
mod input;
mod into;
mod json;
mod layout;
mod materials;
mod plan;
mod points;
mod raster;
mod stitch;
mod surfaces;
mod sweep;
mod texels;
mod unwrap;
mod vertices;

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use dapple_trace::rtao::{MAX_RAYS, RtaoParams};

use crate::args::{BakeArgs, Radius, SceneChoice};
use crate::file::{check_writable, write_file, write_parts};
use crate::progress::Bar;
use crate::source;
use input::Input;
use points::Points;
use surfaces::Surfaces;

/// A radius below this part of the scene's diagonal is likely to be one in other units than the file's.
const SMALL_RADIUS: f32 = 1.0 / 2000.0;

/// Edges of texels that can be asked for: from a hair's breadth to a mountain's, so that scenes in any unit are served.
const TEXELS_M: std::ops::RangeInclusive<f64> = 1e-6..=1e4;

/// What a file holds, by its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Glb,
    Gltf,
    Ply,
    Dapple,
}

/// A scene with everything that it refers to as one GLB.
pub(crate) fn pack(choice: &SceneChoice) -> Result<Vec<u8>> {
    let input = input::load(choice)?;
    Ok(input.document.to_glb(&input.title)?.concat())
}

/// Bakes what the arguments ask for and writes it.
pub(crate) fn run(args: &BakeArgs) -> Result<()> {
    check(args)?;
    let outputs = args.output.iter().map(|path| Ok((path, format_of(path)?))).collect::<Result<Vec<_>>>()?;
    for (path, _) in &outputs {
        check_writable(path)?;
    }
    check_recordings(args, &outputs)?;
    let mut input = input::load(&args.scene)?;
    let (radius_m, density_factor) = source::radius_of(&input.scene, args.radius)?;
    if let Radius::Metres(_) = args.radius {
        warn_of_small_radius(&input, radius_m);
    }
    let params = RtaoParams { rays: args.rays, radius_m, seed: u64::from(args.seed) };
    let (points, scenes): (Vec<_>, Vec<_>) =
        outputs.into_iter().partition(|(_, format)| matches!(format, Format::Ply | Format::Dapple));
    if !points.is_empty() {
        let points_per_m2 = args.points * density_factor;
        bake_points(&points, &input, args, points_per_m2, &params)?;
    }
    if !scenes.is_empty() {
        let pose = into::pose(&mut input.scene, args.time);
        let Input { scene, origins, document, title, .. } = input;
        let wheel = Bar::spinner("building");
        let surfaces = Surfaces::new(&scene, &pose, params, args.bent_normals);
        drop(wheel);
        let target = into::Target { document, origins: &origins, title: &title, density_factor };
        let (document, report) = into::bake(args, &surfaces, target)?;
        for (path, format) in &scenes {
            let name = path.display().to_string();
            let parts = match format {
                Format::Gltf => vec![document.to_gltf()?],
                _ => document.to_glb(&name)?,
            };
            let parts: Vec<&[u8]> = parts.iter().map(Vec::as_slice).collect();
            write_parts(path, &parts)?;
            let bytes: usize = parts.iter().map(|part| part.len()).sum();
            say!("wrote {name} ({:.2} MB): {report}", bytes as f64 / 1e6);
        }
    }
    Ok(())
}

fn bake_points(
    outputs: &[(&PathBuf, Format)],
    input: &Input,
    args: &BakeArgs,
    points_per_m2: f32,
    params: &RtaoParams,
) -> Result<()> {
    let scene = input.given.as_ref().unwrap_or(&input.scene);
    let points = Points::bake(scene, args.time.unwrap_or(0.0), points_per_m2, params)?;
    for (path, format) in outputs {
        let bytes = match format {
            Format::Dapple => points.to_recording(&scene.name)?,
            _ => points.to_ply(),
        };
        write_file(path, &bytes)?;
        let (name, megabytes, count) = (path.display(), bytes.len() as f64 / 1e6, points.len());
        say!("wrote {name} ({megabytes:.2} MB): {count} points of {}", input.title);
    }
    Ok(())
}

fn warn_of_small_radius(input: &Input, radius_m: f32) {
    let diagonal = input.scene.bounds_world(&input.scene.pose(0.0)).diagonal();
    if radius_m < SMALL_RADIUS * diagonal {
        tracing::warn!(
            "{}: --radius {radius_m} is short for a scene {diagonal:.0} m across; if the file is not in metres, try --radius auto",
            input.title
        );
    }
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
    if let Some(texel_m) = args.texel.filter(|texel| !TEXELS_M.contains(texel)) {
        bail!("--texel is {texel_m}, must be {} to {} m", TEXELS_M.start(), TEXELS_M.end());
    }
    if !(1..=64).contains(&args.margin) || 8 * args.margin > args.texture_size {
        bail!("--margin is {}, must be 1 to 64 and at most an eighth of --texture-size", args.margin);
    }
    Ok(())
}

/// A recording belongs to the scene as its file is now: that must not be replaced by a baked one.
fn check_recordings(args: &BakeArgs, outputs: &[(&PathBuf, Format)]) -> Result<()> {
    let whole = |path: &Path| std::fs::canonicalize(path).ok();
    let Some(scene) = args.scene.scene.as_deref().and_then(whole) else { return Ok(()) };
    let recording = outputs.iter().find(|(_, format)| *format == Format::Dapple);
    let replaced = outputs.iter().find(|(path, _)| whole(path).is_some_and(|path| path == scene));
    if let (Some((recording, _)), Some((replaced, _))) = (recording, replaced) {
        bail!(
            "{} would be a recording of {} as it is, which players could not load any more: write the baked scene to \
             another file, or bake it first and then its points",
            recording.display(),
            replaced.display()
        );
    }
    Ok(())
}

fn format_of(output: &Path) -> Result<Format> {
    let extension = output.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    Ok(match extension.as_str() {
        "glb" => Format::Glb,
        "gltf" => Format::Gltf,
        "ply" => Format::Ply,
        "dapple" => Format::Dapple,
        _ => bail!("{}: name it .glb or .gltf (a scene), .ply or .dapple (points)", output.display()),
    })
}
