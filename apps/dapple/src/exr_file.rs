//! OpenEXR files: numbers as they are, without tone mapping.

use std::io::Cursor;
use std::path::Path;

use anyhow::{Context, Result, bail};
use dapple_scene::glam::Vec3;
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, ReadChannels, ReadLayers,
    ReadSpecificChannel, WritableImage,
};

use crate::file::write_file;

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

/// A picture of one number a pixel.
pub(crate) struct Gray {
    pub(crate) width: u32,
    pub(crate) height: u32,
    /// Rows from the top; multiplied by alpha where the file has one.
    pub(crate) values: Vec<f32>,
    /// Whether any pixel is not opaque.
    pub(crate) transparent: bool,
}

/// Reads the channel Y of an OpenEXR file that has no colours; `None` if the bytes are no such file.
///
/// # Errors
///
/// For broken files, and for pictures with a side above `max_side`.
pub(crate) fn read_gray(bytes: &[u8], max_side: u32) -> Result<Option<Gray>> {
    if !bytes.starts_with(&exr::meta::magic_number::BYTES) {
        return Ok(None);
    }
    let found = exr::meta::MetaData::read_from_buffered(Cursor::new(bytes), false)?;
    let has = |header: &exr::meta::header::Header, name: &str| {
        header.channels.list.iter().any(|channel| channel.name.eq(name))
    };
    // Colours may also be given as differences to Y.
    let colours = ["R", "G", "B", "RY", "BY"];
    if found.headers.iter().any(|header| colours.iter().any(|name| has(header, name))) {
        return Ok(None);
    }
    let Some(header) = found.headers.iter().find(|header| has(header, "Y")) else { return Ok(None) };
    let size = header.layer_size;
    if size.width().max(size.height()) > max_side as usize {
        bail!("it has {} x {} pixels, a side may have {max_side}", size.width(), size.height());
    }
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .specific_channels()
        .required("Y")
        .optional("A", 1.0)
        .collect_pixels(
            |size, _| (size.width(), vec![0.0; size.area()], false),
            |(width, values, transparent), at, (y, alpha): (f32, f32)| {
                values[at.y() * *width + at.x()] = y;
                *transparent |= alpha != 1.0;
            },
        )
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))?;
    let (width, values, transparent) = image.layer_data.channel_data.pixels;
    let height = values.len() / width.max(1);
    Ok(Some(Gray { width: width as u32, height: height as u32, values, transparent }))
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
