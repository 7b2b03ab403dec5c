//! Decodes PNG and JPEG images within limits of size.

use std::io::Cursor;

use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};

use super::context::{Context, IMAGE_LIMIT_BYTES};
use crate::Image;

/// Longest side of an image, texels.
const MAX_SIDE: u32 = 16384;

/// Decodes an image. The error says why not, for a warning.
pub(super) fn decode(context: &Context<'_>, name: String, bytes: &[u8]) -> Result<Image, String> {
    let reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| e.to_string())?;
    if !matches!(reader.format(), Some(ImageFormat::Png | ImageFormat::Jpeg)) {
        return Err("it is neither PNG nor JPEG".to_owned());
    }
    let left_bytes = context.image_left_bytes();
    let mut reader = reader;
    let mut limits = Limits::default();
    limits.max_image_width = Some(MAX_SIDE);
    limits.max_image_height = Some(MAX_SIDE);
    limits.max_alloc = Some(IMAGE_LIMIT_BYTES);
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(|e| e.to_string())?;
    let (width, height) = decoder.dimensions();
    let rgba_bytes = 4 * u64::from(width) * u64::from(height);
    if width == 0 || height == 0 || width > MAX_SIDE || height > MAX_SIDE {
        return Err(format!("its size {width} x {height} is not between 1 and {MAX_SIDE}"));
    }
    if rgba_bytes.max(decoder.total_bytes()) > left_bytes {
        let limit_mib = IMAGE_LIMIT_BYTES >> 20;
        return Err(format!(
            "the images of this scene would take more than {limit_mib} MiB; make them smaller"
        ));
    }
    let pixels = DynamicImage::from_decoder(decoder).map_err(|e| e.to_string())?.into_rgba8();
    context.use_image_bytes(rgba_bytes);
    Ok(Image { name, width, height, rgba8: pixels.as_raw().as_chunks::<4>().0.to_vec() })
}
