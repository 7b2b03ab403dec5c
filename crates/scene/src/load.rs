//! Reads glTF 2.0 (`.glb`, `.gltf`) and Wavefront OBJ files into a [`Scene`], without touching the file system.
//!
//! Decoding is total: any bytes give a scene or a [`LoadError`]. Memory stays within a fixed multiple of the
//! bytes read (see the constants of the `context` module): what a file merely claims is never allocated.

mod accumulate;
mod context;
mod error;
mod finish;
mod gltf;
mod image;
mod normals;
mod obj;
mod origins;
mod uri;

use crate::Scene;
use context::Context;

pub use error::LoadError;
pub use origins::{MeshOrigin, Origins};

/// Gives the loader the files that a scene file names (buffers, textures, material libraries).
pub trait Files {
    /// Reads the file `uri`: a relative path with `/` between folders, already percent-decoded, without `..`,
    /// scheme or drive, relative to the folder of the scene file. Fails if it is longer than `limit_bytes`.
    fn read(&self, uri: &str, limit_bytes: u64) -> std::io::Result<Vec<u8>>;
}

/// No files at all, for self-contained scenes (`.glb`, or `.gltf` with embedded data): every read fails.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoFiles;

impl Files for NoFiles {
    fn read(&self, uri: &str, _limit_bytes: u64) -> std::io::Result<Vec<u8>> {
        let message = format!("'{uri}' cannot be read: this scene was opened without access to other files");
        Err(std::io::Error::new(std::io::ErrorKind::NotFound, message))
    }
}

/// Loads a scene from the bytes of its main file.
///
/// `name` is the file's name, for messages, for [`Scene::name`] (its stem) and to tell formats apart; files the
/// scene refers to are read through `files`. What could be mended is listed in [`Scene::warnings`].
pub fn load(name: &str, bytes: &[u8], files: &dyn Files) -> Result<Scene, LoadError> {
    load_with_origins(name, bytes, files).map(|(scene, _)| scene)
}

/// As [`load`], and tells where in its file each part of the scene stands. Of an OBJ file nothing is told.
pub fn load_with_origins(name: &str, bytes: &[u8], files: &dyn Files) -> Result<(Scene, Origins), LoadError> {
    let context = Context::new(name, bytes.len(), files);
    if bytes.is_empty() {
        return Err(LoadError::Empty { file: name.to_owned() });
    }
    let file_name = name.rsplit(['/', '\\']).next().unwrap_or(name);
    let (stem, extension) = match file_name.rsplit_once('.') {
        Some((stem, extension)) if !stem.is_empty() => (stem, extension.to_ascii_lowercase()),
        _ => (file_name, String::new()),
    };
    let first_text_byte = bytes.iter().find(|b| !b.is_ascii_whitespace());
    let (mut scene, origins) = if bytes.starts_with(b"glTF") || extension == "glb" {
        gltf::load_glb(&context, bytes)?
    } else if extension == "gltf" || (extension.is_empty() && first_text_byte == Some(&b'{')) {
        gltf::load_json(&context, bytes, None)?
    } else if extension == "obj" {
        (obj::load(&context, bytes, stem)?, Origins::default())
    } else {
        return Err(LoadError::UnknownFormat { file: name.to_owned() });
    };
    scene.name = stem.to_owned();
    scene.warnings = context.into_warnings();
    Ok((scene, origins))
}

/// The bytes that a reference of a scene file leads to, as the loader reads them: those of a `data:` URI, or of a file in
/// the scene's folder.
///
/// # Errors
///
/// A reference that cannot be decoded or leads out of the folder, a file that cannot be read. `scene` names the scene's file
/// and `at` the place of the reference, for the message.
pub fn read_reference(scene: &str, at: &str, uri: &str, files: &dyn Files) -> Result<Vec<u8>, LoadError> {
    uri::read(&Context::new(scene, 0, files), at, uri)
}
