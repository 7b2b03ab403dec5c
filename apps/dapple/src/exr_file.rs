//! OpenEXR files: numbers as they are, without tone mapping.

use std::io::Cursor;
use std::path::Path;

use anyhow::{Context, Result};
use dapple_scene::glam::Vec3;
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, WritableImage,
};

use crate::picture::write_file;

/// Writes three numbers a pixel, as channels R, G and B of 32-bit floats.
pub(crate) fn write_rgb(path: &Path, width: u32, height: u32, pixels: &[Vec3]) -> Result<()> {
    let channel = |name, of: fn(&Vec3) -> f32| AnyChannel::new(name, samples(pixels.iter().map(of)));
    let channels = [channel("R", |p| p.x), channel("G", |p| p.y), channel("B", |p| p.z)];
    write(path, width, height, channels.into_iter().collect())
}

/// Writes one number a pixel, as channel Y of 32-bit floats.
pub(crate) fn write_gray(path: &Path, width: u32, height: u32, values: &[f32]) -> Result<()> {
    write(
        path,
        width,
        height,
        std::iter::once(AnyChannel::new("Y", samples(values.iter().copied()))).collect(),
    )
}

fn samples(values: impl Iterator<Item = f32>) -> FlatSamples {
    FlatSamples::F32(values.collect())
}

fn write(
    path: &Path,
    width: u32,
    height: u32,
    channels: exr::prelude::SmallVec<[AnyChannel<FlatSamples>; 4]>,
) -> Result<()> {
    let size = (width as usize, height as usize);
    // Sorted by name, as the format asks for.
    let channels = AnyChannels::sort(channels);
    let layer = Layer::new(size, LayerAttributes::default(), Encoding::SMALL_LOSSLESS, channels);
    let mut bytes = Vec::new();
    Image::from_layer(layer)
        .write()
        .non_parallel()
        .to_buffered(Cursor::new(&mut bytes))
        .with_context(|| format!("cannot encode {}", path.display()))?;
    write_file(path, &bytes)
}
