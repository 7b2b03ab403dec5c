//! Pictures from files: sRGB-encoded ones (PNG, JPEG) and linear ones (OpenEXR, Radiance HDR).

use std::io::Cursor;
use std::path::Path;

use anyhow::{Context, Result, bail};
use image::{DynamicImage, ImageReader, Limits};

use crate::exr_file::{Gray, read_gray};
use crate::source::read_limited;

/// Endings of files that can be read.
pub(super) const ENDINGS: [&str; 5] = ["png", "jpg", "jpeg", "exr", "hdr"];

/// The largest file that is read, and what decoding it may take.
const MAX_FILE_BYTES: u64 = 1 << 30;
const MAX_DECODED_BYTES: u64 = 2 << 30;
const MAX_SIDE: u32 = 16384;

/// A picture; interleaved R, G, B in rows from the top.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Picture {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) values: Values,
    /// Whether any pixel was not opaque. Then it lies over black.
    pub(super) transparent: bool,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) enum Values {
    /// sRGB-encoded, 0 … 1 with all bits of the file.
    Encoded(Vec<f32>),
    /// Linear light of any range.
    Linear(Vec<f32>),
}

impl Picture {
    pub(super) fn read(path: &Path) -> Result<Picture> {
        let context = || format!("cannot read the picture {}", path.display());
        if path.is_dir() {
            bail!("{} is a folder: compare folders with `dapple eval compare`", path.display());
        }
        let bytes = read_limited(path, MAX_FILE_BYTES).with_context(context)?;
        Picture::decode(bytes)
            .with_context(|| format!("{} (files that can be read: {})", context(), ENDINGS.join(", ")))
    }

    fn decode(bytes: Vec<u8>) -> Result<Picture> {
        // Linear pictures of one number, such as visibility, which `image` does not read.
        if let Some(Gray { width, height, values, transparent }) = read_gray(&bytes, MAX_SIDE)? {
            check_size(width, height)?;
            let values = values.into_iter().flat_map(|v| [v; 3]).collect();
            return Ok(Picture { width, height, values: Values::Linear(values), transparent });
        }
        let mut reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format()?;
        let mut limits = Limits::default();
        limits.max_image_width = Some(MAX_SIDE);
        limits.max_image_height = Some(MAX_SIDE);
        limits.max_alloc = Some(MAX_DECODED_BYTES);
        reader.limits(limits);
        let decoded = reader.decode()?;
        let (width, height) = (decoded.width(), decoded.height());
        check_size(width, height)?;
        let is_linear = matches!(decoded, DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_));
        let has_alpha = decoded.color().has_alpha();
        let (values, transparent) = if is_linear {
            // OpenEXR's colours are multiplied by alpha: they lie over black as they are.
            let transparent = has_alpha && decoded.to_rgba32f().pixels().any(|p| p.0[3] != 1.0);
            (Values::Linear(decoded.into_rgb32f().into_raw()), transparent)
        } else if has_alpha {
            let over_black = decoded.into_rgba16();
            let unit = |v: u16| f32::from(v) / 65535.0;
            let values = over_black.pixels().flat_map(|p| [0, 1, 2].map(|c| unit(p.0[c]) * unit(p.0[3])));
            let values = Values::Encoded(values.collect());
            (values, over_black.pixels().any(|p| p.0[3] != u16::MAX))
        } else {
            let values = decoded.into_rgb16().into_raw().into_iter().map(|v| f32::from(v) / 65535.0);
            (Values::Encoded(values.collect()), false)
        };
        Ok(Picture { width, height, values, transparent })
    }

    /// Values, encoded or linear.
    pub(super) fn values(&self) -> &[f32] {
        match &self.values {
            Values::Encoded(values) | Values::Linear(values) => values,
        }
    }

    /// Rec. 709 luma of encoded values, luminance of linear ones.
    pub(super) fn luma(&self) -> Vec<f32> {
        let weigh = |p: &[f32; 3]| 0.2126 * p[0] + 0.7152 * p[1] + 0.0722 * p[2];
        self.values().as_chunks::<3>().0.iter().map(weigh).collect()
    }
}

fn check_size(width: u32, height: u32) -> Result<()> {
    if width == 0 || height == 0 {
        bail!("it has no pixels ({width} x {height})");
    }
    Ok(())
}

/// Encoded values as bytes; those of 8 bits are what they were.
pub(super) fn bytes(encoded: &[f32]) -> Vec<u8> {
    encoded.iter().map(|v| (v * 255.0).round() as u8).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_what_they_were() {
        let pixels: Vec<u8> = (0..=255).flat_map(|b| [b, 255 - b, b / 2]).collect();
        let mut png = Cursor::new(Vec::new());
        let picture = image::RgbImage::from_raw(16, 16, pixels.clone()).unwrap();
        picture.write_to(&mut png, image::ImageFormat::Png).unwrap();
        let read = Picture::decode(png.into_inner()).unwrap();
        let Values::Encoded(values) = &read.values else { panic!("a PNG is encoded") };
        assert_eq!(bytes(values), pixels);
        assert_eq!((read.width, read.height, read.transparent), (16, 16, false));
        // As exact as division by 255.
        assert!(values.iter().zip(&pixels).all(|(v, b)| *v == f32::from(*b) / 255.0));
    }

    #[test]
    fn transparent_pixels_lie_over_black() {
        let picture = image::RgbaImage::from_raw(2, 1, vec![200, 100, 50, 128, 10, 20, 30, 255]).unwrap();
        let mut png = Cursor::new(Vec::new());
        picture.write_to(&mut png, image::ImageFormat::Png).unwrap();
        let read = Picture::decode(png.into_inner()).unwrap();
        assert_eq!(bytes(read.values()), [100, 50, 25, 10, 20, 30]);
        assert!(read.transparent);
    }

    #[test]
    fn sixteen_bits_and_linear_light_are_kept() {
        let deep: image::ImageBuffer<image::Rgb<u16>, Vec<u16>> =
            image::ImageBuffer::from_raw(1, 1, vec![1, 32768, 65535]).unwrap();
        let mut png = Cursor::new(Vec::new());
        deep.write_to(&mut png, image::ImageFormat::Png).unwrap();
        let read = Picture::decode(png.into_inner()).unwrap();
        assert_eq!(read.values, Values::Encoded(vec![1.0 / 65535.0, 32768.0 / 65535.0, 1.0]));

        let bright = image::Rgb32FImage::from_raw(1, 1, vec![0.5, 1000.0, 0.001]).unwrap();
        let mut exr = Cursor::new(Vec::new());
        bright.write_to(&mut exr, image::ImageFormat::OpenExr).unwrap();
        let read = Picture::decode(exr.into_inner()).unwrap();
        assert_eq!(read.values, Values::Linear(vec![0.5, 1000.0, 0.001]));
        assert!((read.luma()[0] - (0.1063 + 715.2 + 0.0000722)).abs() < 1e-3);
    }

    #[test]
    fn pictures_of_one_number_are_gray() {
        let folder = tempfile::TempDir::new().unwrap();
        let file = folder.path().join("gray.exr");
        crate::exr_file::write_gray(&file, 3, 2, &[0.0, 0.25, 0.5, 0.75, 1.0, 7.5]).unwrap();
        let bytes = std::fs::read(&file).unwrap();
        let read = Picture::decode(bytes.clone()).unwrap();
        assert_eq!((read.width, read.height, read.transparent), (3, 2, false));
        let expected = [0.0, 0.25, 0.5, 0.75, 1.0, 7.5].into_iter().flat_map(|v| [v; 3]).collect();
        assert_eq!(read.values, Values::Linear(expected));
        for cut in [5, 60, bytes.len() - 4] {
            assert!(Picture::decode(bytes[..cut].to_vec()).is_err(), "cut at {cut}");
        }
        assert!(read_gray(&bytes, 2).is_err(), "too large");
    }

    #[test]
    fn what_is_no_picture_is_an_error() {
        assert!(Picture::decode(Vec::new()).is_err());
        assert!(Picture::decode(b"\x89PNG\r\n\x1a\nand then nothing".to_vec()).is_err());
        assert!(Picture::decode(b"\x76\x2f\x31\x01\x02\0\0\0broken".to_vec()).is_err());
    }
}
