//! Where scenes come from: files and the built-in ones.

use std::io::{Error, ErrorKind, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, Result, bail};
use dapple_scene::path::MAX_PATH_BYTES;
use dapple_scene::{CameraPath, CameraSource, Files, KeyedPath, Scene, builtin};

use crate::args::{CameraText, Radius, SceneChoice, VisibilityArgs};
use crate::progress::Bar;

/// The largest scene file that is read.
pub(crate) const MAX_SCENE_BYTES: u64 = 4 << 30;

/// A loaded scene and what a user should call it.
pub(crate) struct Loaded {
    pub(crate) scene: Arc<Scene>,
    pub(crate) title: String,
}

/// A scene's file.
pub(crate) struct Source {
    /// Name of the file, without its folder.
    pub(crate) name: String,
    pub(crate) bytes: Vec<u8>,
    /// Where files beside it are; nowhere for a built-in scene.
    pub(crate) folder: Option<Folder>,
    /// What a user should call it.
    pub(crate) title: String,
}

/// Reads the file that the arguments name, or makes the built-in scene.
pub(crate) fn read(choice: &SceneChoice) -> Result<Source> {
    read_or(choice, None)
}

fn read_or(choice: &SceneChoice, fallback: Option<(&str, f32)>) -> Result<Source> {
    if choice.scene.is_some() && choice.detail.is_some() {
        bail!(
            "--detail is for built-in scenes; {} is a file",
            choice.scene.as_deref().unwrap_or(Path::new("")).display()
        );
    }
    match (&choice.scene, &choice.builtin, fallback) {
        (Some(path), _, _) => read_file(path),
        (None, Some(name), _) => make_builtin(name, choice.detail.unwrap_or(1.0)),
        (None, None, Some((name, detail))) => make_builtin(name, choice.detail.unwrap_or(detail)),
        (None, None, None) => bail!("no scene given: name a .gltf, .glb or .obj file, or --builtin atrium"),
    }
}

/// Loads what the arguments name; `fallback` is the built-in scene and detail used when they name nothing.
pub(crate) fn load(choice: &SceneChoice, fallback: Option<(&str, f32)>) -> Result<Loaded> {
    let Source { name, bytes, folder, title } = read_or(choice, fallback)?;
    let wheel = Bar::spinner(&format!("loading {title}"));
    let mut scene = match &folder {
        Some(folder) => dapple_scene::load(&name, &bytes, folder)?,
        None => dapple_scene::load(&name, &bytes, &dapple_scene::NoFiles)
            .with_context(|| format!("the {title} does not load"))?,
    };
    drop(wheel);
    prepare(&mut scene, choice, &title)?;
    Ok(Loaded { scene: Arc::new(scene), title })
}

/// Chooses the animation, tells the loader's warnings, and refuses a scene without triangles.
pub(crate) fn prepare(scene: &mut Scene, choice: &SceneChoice, title: &str) -> Result<()> {
    if let Some(animation) = &choice.animation {
        let animation = find_animation(scene, animation)?;
        scene.set_active_animation(Some(animation));
    }
    for warning in &scene.warnings {
        tracing::warn!("{}: {}", title, warning.message);
    }
    if scene.triangle_count() == 0 {
        bail!("{title} has no triangles: there is nothing to light");
    }
    Ok(())
}

fn make_builtin(name: &str, detail: f32) -> Result<Source> {
    let _wheel = Bar::spinner(&format!("making {name}"));
    let bytes = builtin::glb(name, detail)?;
    let title = format!("built-in {name}, detail {detail}");
    Ok(Source { name: format!("{name}.glb"), bytes, folder: None, title })
}

fn read_file(path: &Path) -> Result<Source> {
    let bytes = read_limited(path, MAX_SCENE_BYTES)
        .with_context(|| format!("cannot read the scene {}", path.display()))?;
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let folder = Folder(path.parent().unwrap_or(Path::new("")).to_owned());
    Ok(Source { name, bytes, folder: Some(folder), title: path.display().to_string() })
}

fn find_animation(scene: &Scene, wanted: &str) -> Result<u32> {
    let by_name = scene.animations.iter().position(|a| a.name == wanted);
    let by_index = wanted.parse::<usize>().ok().filter(|&i| i < scene.animations.len());
    match by_name.or(by_index) {
        Some(index) => Ok(index as u32),
        None if scene.animations.is_empty() => bail!("--animation {wanted}: the scene has no animations"),
        None => {
            let known: Vec<&str> = scene.animations.iter().map(|a| a.name.as_str()).collect();
            bail!("--animation {wanted}: the scene's animations are {}", known.join(", "))
        }
    }
}

/// The camera path of that name, that of a file whose name ends in `.json`, or the scene's first.
pub(crate) fn find_path(scene: &Scene, wanted: Option<&str>) -> Result<CameraPath> {
    let mut paths = scene.camera_paths();
    let Some(wanted) = wanted else { return Ok(paths.swap_remove(0)) };
    if is_path_file(wanted) {
        return read_path(Path::new(wanted));
    }
    match paths.iter().position(|p| p.name == wanted) {
        Some(index) => {
            let path = paths.swap_remove(index);
            if let Some(hint) = stands_still(scene, &path) {
                tracing::warn!("{hint}");
            }
            Ok(path)
        }
        None => {
            let known: Vec<&str> = paths.iter().map(|p| p.name.as_str()).collect();
            bail!(
                "there is no camera path {wanted}; this scene's are {} (a file of keys ends in .json)",
                known.join(", ")
            )
        }
    }
}

/// Whether a camera path's name is that of a file.
pub(crate) fn is_path_file(name: &str) -> bool {
    Path::new(name).extension().is_some_and(|extension| extension.eq_ignore_ascii_case("json"))
}

/// Reads a camera path of keys.
fn read_path(file: &Path) -> Result<CameraPath> {
    let bytes = read_limited(file, MAX_PATH_BYTES as u64)
        .with_context(|| format!("cannot read the camera path {}", file.display()))?;
    let keys = KeyedPath::parse(&bytes).with_context(|| format!("the camera path {}", file.display()))?;
    Ok(keys.into())
}

/// What to say of a camera that stands still although animations that are not active would move it.
fn stands_still(scene: &Scene, path: &CameraPath) -> Option<String> {
    if !matches!(path.source, CameraSource::Still { .. }) {
        return None;
    }
    let movers = scene.animations_of_camera(path);
    let names: Vec<&str> =
        movers.iter().filter_map(|&i| Some(scene.animations.get(i as usize)?.name.as_str())).collect();
    (!names.is_empty()).then(|| {
        format!("the camera {} stands still: it moves with --animation {}", path.name, names.join(" or "))
    })
}

/// A camera given as text, or a camera path by [`find_path`] at a time.
pub(crate) fn find_camera(
    scene: &Scene,
    text: Option<&str>,
    time_s: f64,
) -> Result<dapple_scene::PosedCamera> {
    if let Some(text) = text.filter(|text| is_camera_text(text)) {
        let camera: CameraText = text.parse().map_err(anyhow::Error::msg)?;
        let mut posed =
            dapple_scene::PosedCamera::look_at(camera.eye, camera.target, camera.fov_degrees.to_radians());
        // A scene in other units than metres may lie nearer than the usual near plane.
        if let dapple_scene::Projection::Perspective { near, .. } = &mut posed.projection {
            *near = near.min((1e-3 * scene.bounds_world(&scene.pose(time_s)).diagonal()).max(1e-6));
        }
        return Ok(posed);
    }
    let path = find_path(scene, text)
        .context("--camera takes a camera path's name, its file or eye=X,Y,Z,target=X,Y,Z,fov=DEGREES")?;
    Ok(path.camera(scene, &scene.pose(time_s)))
}

/// Whether a camera is given by its numbers.
pub(crate) fn is_camera_text(text: &str) -> bool {
    text.contains('=') && !is_path_file(text)
}

/// The occlusion distance in metres, and the factor on points per m² that goes with it.
pub(crate) fn resolve_radius(scene: &Scene, args: &VisibilityArgs) -> Result<(f32, f32)> {
    radius_of(scene, args.radius)
}

/// The same of a radius alone.
pub(crate) fn radius_of(scene: &Scene, radius: Radius) -> Result<(f32, f32)> {
    match radius {
        Radius::Metres(m) => Ok((m, 1.0)),
        Radius::Auto => {
            let radius = scene.auto_radius_m();
            let factor = (0.6 / radius) * (0.6 / radius);
            if !(factor.is_finite() && factor > 0.0) {
                bail!("--radius auto: the scene's extent gives a radius of {radius} m; give one in metres");
            }
            Ok((radius, factor))
        }
    }
}

/// Reads files beside a scene.
pub(crate) struct Folder(PathBuf);

impl Files for Folder {
    fn read(&self, uri: &str, limit_bytes: u64) -> std::io::Result<Vec<u8>> {
        read_limited(&self.0.join(uri), limit_bytes)
    }
}

/// Reads a whole file of at most so many bytes.
pub(crate) fn read_limited(path: &Path, limit_bytes: u64) -> std::io::Result<Vec<u8>> {
    let file = std::fs::File::open(path)?;
    let metadata = file.metadata()?;
    if metadata.is_dir() {
        return Err(Error::new(ErrorKind::IsADirectory, "it is a folder"));
    }
    if metadata.len() > limit_bytes {
        let message = format!("it has {} bytes, more than the limit of {limit_bytes}", metadata.len());
        return Err(Error::new(ErrorKind::FileTooLarge, message));
    }
    // Pipes and the like have no length of their own.
    let mut bytes = Vec::with_capacity(metadata.len() as usize);
    file.take(limit_bytes + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limit_bytes {
        return Err(Error::new(ErrorKind::FileTooLarge, format!("it has more than {limit_bytes} bytes")));
    }
    Ok(bytes)
}
