//! Writing files so that an interrupted run never leaves half of one.

use std::io::Write;
use std::path::Path;

use anyhow::{Context, Result};

/// Writes a whole file: into a neighbour first, then renamed over the old one.
pub(crate) fn write_file(path: &Path, bytes: &[u8]) -> Result<()> {
    if let Some(folder) = path.parent().filter(|f| !f.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).with_context(|| format!("cannot create the folder {}", folder.display()))?;
    }
    let name = path.file_name().with_context(|| format!("{} names no file", path.display()))?;
    let mut partial = name.to_owned();
    partial.push(format!(".{}.tmp", std::process::id()));
    let partial = path.with_file_name(partial);
    let written = std::fs::File::create(&partial).and_then(|mut file| {
        file.write_all(bytes)?;
        file.sync_all()
    });
    let moved = written.and_then(|()| std::fs::rename(&partial, path));
    if moved.is_err() {
        let _ = std::fs::remove_file(&partial);
    }
    moved.with_context(|| format!("cannot write {}", path.display()))
}

/// Writes 8-bit sRGB pixels as a PNG.
pub(crate) fn write_png(path: &Path, width: u32, height: u32, rgb8: &[[u8; 3]]) -> Result<()> {
    let mut bytes = Vec::new();
    let encoder = image::codecs::png::PngEncoder::new(&mut bytes);
    image::ImageEncoder::write_image(encoder, rgb8.as_flattened(), width, height, image::ExtendedColorType::Rgb8)
        .with_context(|| format!("cannot encode {}", path.display()))?;
    write_file(path, &bytes)
}
