//! FLIP ([Andersson2020], [Andersson2021]): what a viewer notices when two pictures alternate.
//!
//! Takes a pair of sRGB pictures, or of linear ones of any brightness, and how large their pixels appear; returns an
//! error for each pixel and the mean. `README.md` has the equations.
//!
//! [Andersson2020]: https://doi.org/10.1145/3406183
//! [Andersson2021]: https://doi.org/10.2312/sr.20211283

mod color;
mod filters;
mod hdr;
mod ldr;
mod magma;
#[cfg(test)]
mod tests;

use crate::error::{MetricError, check_size};
pub use hdr::{Exposures, HdrFlip, flip_hdr};
use ldr::Flipper;
pub use magma::magma_srgb8;

/// The viewing condition that published FLIP values assume unless they say otherwise: 67 pixels a degree of visual
/// angle, a 0.7 m wide 3840 pixel display at 0.7 m.
pub const PIXELS_PER_DEGREE: f32 = 67.0;

/// The outcome of [`flip()`].
#[derive(Debug, Clone, PartialEq)]
pub struct Flip {
    /// Mean error over all pixels, 0 (equal) … 1. The one number to report, as the paper recommends.
    pub mean: f64,
    /// Error of every pixel, 0 … 1, in rows from the top.
    pub error_map: Vec<f32>,
}

/// LDR-FLIP of `test` against `reference`.
///
/// Both are sRGB-encoded, 3 bytes a pixel, in rows from the top. `pixels_per_degree` says how large a pixel appears
/// to the viewer, 1 … 1000; see [`PIXELS_PER_DEGREE`] for the usual value.
///
/// # Errors
/// Sizes that do not fit, `pixels_per_degree` out of range.
pub fn flip(
    width: u32,
    height: u32,
    reference_srgb8: &[u8],
    test_srgb8: &[u8],
    pixels_per_degree: f32,
) -> Result<Flip, MetricError> {
    check_size(width, height, 3, reference_srgb8, test_srgb8)?;
    check_pixels_per_degree(pixels_per_degree)?;
    Ok(flip_by(
        &Flipper::new(pixels_per_degree),
        width as usize,
        height as usize,
        reference_srgb8,
        test_srgb8,
    ))
}

fn flip_by(flipper: &Flipper, width: usize, height: usize, reference: &[u8], test: &[u8]) -> Flip {
    let linear = color::linear_from_srgb8();
    let row = |picture: &[u8], y: usize, out: &mut [[f32; 3]]| {
        let pixels = picture[y * width * 3..(y + 1) * width * 3].as_chunks::<3>().0;
        out.iter_mut()
            .zip(pixels)
            .for_each(|(out, pixel)| *out = pixel.map(|byte| linear[usize::from(byte)]));
    };
    let rows: [&ldr::Rows<'_>; 2] = [&|y, out| row(reference, y, out), &|y, out| row(test, y, out)];
    mean(flipper.error_map(width, height, rows))
}

/// The map with its mean, summed in order.
fn mean(error_map: Vec<f32>) -> Flip {
    let sum: f64 = error_map.iter().map(|e| f64::from(*e)).sum();
    Flip { mean: sum / error_map.len() as f64, error_map }
}

fn check_pixels_per_degree(pixels_per_degree: f32) -> Result<(), MetricError> {
    if (1.0..=1000.0).contains(&pixels_per_degree) {
        return Ok(());
    }
    let (name, range) = ("pixels_per_degree", "1 ... 1000");
    Err(MetricError::Parameter { name, value: pixels_per_degree, range })
}
