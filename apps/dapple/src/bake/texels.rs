//! Measures the texels of images.

use anyhow::{Context, Result};
use dapple_scene::glam::Vec3;

use super::fill::Planes;
use super::layout::{Layout, Sheet};
use super::plan::Copy;
use super::raster::{Band, SUB, bands, rasterize};
use super::stitch::Seams;
use super::surfaces::{Place, Sum, Surfaces};

/// Texels rasterised and measured at a time.
const BAND_TEXELS: u32 = 1 << 17;

/// How well a texel is known: measured on the surface that it lies on, nearest to where it lies, or not at all.
const INSIDE: f32 = 1.0;
const OUTSIDE: f32 = 0.05;
const UNKNOWN: f32 = 0.02;

/// The images of a sheet, as PNG files.
pub(crate) struct Images {
    /// Whether they repeat ([`Sheet::repeats`]).
    pub(crate) repeats: bool,
    pub(crate) visibility: Vec<u8>,
    /// Bent normals in the space of the mesh's normals, −1 … 1 as 0 … 255.
    pub(crate) bent: Option<Vec<u8>>,
}

/// The texels of a sheet as bytes: all that is kept of it while others are measured.
struct Texels {
    visibility: Vec<u8>,
    bent: Option<Vec<[u8; 3]>>,
}

impl Texels {
    fn put(&mut self, at: usize, values: &[f32]) {
        self.visibility[at] = unorm8(values[0]);
        if let (Some(bent), &[_, x, y, z]) = (&mut self.bent, values) {
            bent[at] = (0.5 + 0.5 * Vec3::new(x, y, z).normalize_or_zero()).to_array().map(unorm8);
        }
    }
}

/// Measures all sheets of a layout and stitches their seams. `done` is told of the rows that are done.
pub(crate) fn bake_sheets(
    surfaces: &Surfaces<'_>,
    layout: &Layout,
    margin: u32,
    done: &dyn Fn(u32),
) -> Result<Vec<Images>> {
    let bent = surfaces.measures_bent();
    let channels = if bent { 4 } else { 1 };
    let mut seams = Seams::find(surfaces, &layout.copies, &layout.sheets, channels);
    let mut baked = Vec::with_capacity(layout.sheets.len());
    for (number, sheet) in layout.sheets.iter().enumerate() {
        let count = sheet.width as usize * sheet.height as usize;
        let mut planes = Planes::new(sheet.width as usize, sheet.height as usize, channels);
        let mut weights = vec![UNKNOWN; count];
        for band in bands(sheet, (BAND_TEXELS / sheet.width.max(1)).clamp(1, 256)) {
            measure_band(surfaces, &layout.copies, sheet, &band, &mut planes, &mut weights);
            done(band.rows.len() as u32);
        }
        planes.fill(margin + 2, &[1.0, 0.0, 0.0, 0.0]);
        seams.take(number, &planes, &weights);
        let mut texels = Texels { visibility: vec![0; count], bent: bent.then(|| vec![[0; 3]; count]) };
        let mut values = vec![0.0; channels];
        for at in 0..count {
            for (value, channel) in values.iter_mut().zip(&planes.channels) {
                *value = channel[at];
            }
            texels.put(at, &values);
        }
        baked.push(texels);
    }
    seams.stitch(|sheet, at, values| baked[sheet].put(at, values));
    let encode = |(sheet, texels): (&Sheet, Texels)| {
        let visibility = png(sheet, &texels.visibility, image::ExtendedColorType::L8)?;
        let bent = texels.bent.map(|rgb| png(sheet, rgb.as_flattened(), image::ExtendedColorType::Rgb8));
        Ok(Images { repeats: sheet.repeats, visibility, bent: bent.transpose()? })
    };
    layout.sheets.iter().zip(baked).map(encode).collect()
}

/// A number 0 … 1 as a code, rounded.
fn unorm8(value: f32) -> u8 {
    (value * 255.0).round().clamp(0.0, 255.0) as u8
}

fn png(sheet: &Sheet, bytes: &[u8], color: image::ExtendedColorType) -> Result<Vec<u8>> {
    use image::codecs::png::{CompressionType, FilterType, PngEncoder};
    let mut file = Vec::new();
    let encoder = PngEncoder::new_with_quality(&mut file, CompressionType::Best, FilterType::Adaptive);
    image::ImageEncoder::write_image(encoder, bytes, sheet.width, sheet.height, color)
        .context("the baked image cannot be encoded")?;
    Ok(file)
}

fn measure_band(
    surfaces: &Surfaces<'_>,
    copies: &[Copy],
    sheet: &Sheet,
    band: &Band,
    planes: &mut Planes,
    weights: &mut [f32],
) {
    if band.patches.is_empty() {
        return;
    }
    let rays = surfaces.params().rays;
    let found = rasterize(sheet, band);
    let mut sums = vec![Sum::default(); found.len()];
    // By the number of places that share the rays of a texel, and by copy where several instances are its mean.
    for count in 1..=SUB * SUB {
        let rays = rays.div_ceil(count as u32);
        let (mut texels, mut alone): (Vec<u32>, Vec<Place>) = (Vec::new(), Vec::new());
        let mut shared: Vec<(u32, u32, Place)> = Vec::new();
        for (texel, list) in (0u32..).zip(&found).filter(|(_, found)| found.places.len() == count) {
            let key = u64::from(band.rows.start) * u64::from(sheet.width) + u64::from(texel);
            for (turn, on) in (0u32..).zip(&list.places) {
                let patch = &sheet.patches[on.patch as usize];
                let members = &copies[patch.copy as usize].members;
                let (instance, triangle, weights) = (members[0], patch.triangle, on.weights);
                let place = Place { instance, triangle, weights, key, turn };
                if members.len() == 1 {
                    texels.push(texel);
                    alone.push(place);
                } else {
                    shared.push((patch.copy, texel, place));
                }
            }
        }
        for (texel, measured) in texels.iter().zip(surfaces.measure(&alone, rays)) {
            sums[*texel as usize].add(&measured);
        }
        shared.sort_by_key(|&(copy, texel, _)| (copy, texel));
        for of_copy in shared.chunk_by(|a, b| a.0 == b.0) {
            let places: Vec<Place> = of_copy.iter().map(|&(_, _, place)| place).collect();
            let members = &copies[of_copy[0].0 as usize].members;
            for (&(_, texel, _), measured) in
                of_copy.iter().zip(surfaces.measure_mean(members, &places, rays))
            {
                sums[texel as usize].add(&measured);
            }
        }
    }
    let first = band.rows.start as usize * planes.width;
    for (at, (sum, texel)) in sums.iter().zip(&found).enumerate() {
        let mean = sum.mean();
        if !mean.hidden {
            weights[first + at] = if texel.is_outside { OUTSIDE } else { INSIDE };
            planes.known[first + at] = true;
            let open = mean.open_mesh;
            for (channel, value) in planes.channels.iter_mut().zip([mean.visibility, open.x, open.y, open.z])
            {
                channel[first + at] = value;
            }
        }
    }
}
