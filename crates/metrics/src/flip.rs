//! LDR-FLIP ([Andersson2020]): what a viewer notices when two pictures alternate, by NVIDIA's own implementation.
//!
//! [Andersson2020] Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström, Fairchild: *FLIP: A Difference Evaluator
//! for Alternating Images*, Proceedings of the ACM on Computer Graphics and Interactive Techniques 3(2), 2020.
//!
//! A pixel's error depends on its neighbourhood only, and the implementation clamps at the borders. So bands of
//! rows are evaluated in parallel, each with as many rows beyond its own as the filters reach; the outcome is the
//! same, bit for bit, as that of the whole picture at once. It is C++ in single precision, so the last digits may
//! differ between processor families.
//!
//! [Andersson2020]: https://doi.org/10.1145/3406183

use rayon::prelude::*;

use crate::error::{MetricError, check_size};

/// The viewing condition that published FLIP values assume unless they say otherwise: 67 pixels a degree of visual
/// angle, a 0.7 m wide 3840 pixel display at 0.7 m.
pub const PIXELS_PER_DEGREE: f32 = nv_flip::DEFAULT_PIXELS_PER_DEGREE;

/// Rows evaluated by one task.
const BAND_ROWS: u32 = 128;
/// Sizes are C++ `int`s in the implementation; the color image has three values a pixel.
const MAX_PIXELS: u64 = i32::MAX as u64 / 3;

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
/// Sizes that do not fit, too many pixels, `pixels_per_degree` out of range.
pub fn flip(
    width: u32,
    height: u32,
    reference_srgb8: &[u8],
    test_srgb8: &[u8],
    pixels_per_degree: f32,
) -> Result<Flip, MetricError> {
    flip_in_bands(width, height, reference_srgb8, test_srgb8, pixels_per_degree, BAND_ROWS)
}

fn flip_in_bands(
    width: u32,
    height: u32,
    reference: &[u8],
    test: &[u8],
    pixels_per_degree: f32,
    band_rows: u32,
) -> Result<Flip, MetricError> {
    check_size(width, height, 3, reference, test)?;
    if u64::from(width) * u64::from(height) > MAX_PIXELS {
        return Err(MetricError::TooLarge { width, height, maximum: MAX_PIXELS });
    }
    if !(1.0..=1000.0).contains(&pixels_per_degree) {
        return Err(MetricError::Parameter {
            name: "pixels_per_degree",
            value: pixels_per_degree,
            range: "1 ... 1000",
        });
    }

    let reach = filter_radius_rows(pixels_per_degree);
    let row_bytes = width as usize * 3;
    let bands: Vec<Vec<f32>> = (0..height.div_ceil(band_rows))
        .into_par_iter()
        .map(|band| {
            let (first, end) = (band * band_rows, ((band + 1) * band_rows).min(height));
            let (halo_first, halo_end) = (first.saturating_sub(reach), (end + reach).min(height));
            let bytes = halo_first as usize * row_bytes..halo_end as usize * row_bytes;
            let image = |data| nv_flip::FlipImageRgb8::with_data(width, halo_end - halo_first, data);
            let map = nv_flip::flip(image(&reference[bytes.clone()]), image(&test[bytes]), pixels_per_degree);
            let own = (first - halo_first) as usize * width as usize;
            map.to_vec()[own..own + (end - first) as usize * width as usize].to_vec()
        })
        .collect();

    let error_map = bands.concat();
    let sum: f64 = error_map.iter().map(|e| f64::from(*e)).sum();
    Ok(Flip { mean: sum / error_map.len() as f64, error_map })
}

/// How many rows the filters reach to either side.
///
/// The widest of the paper's filters is the second Gaussian of the blue-yellow contrast sensitivity, of b = 0.04: its
/// radius is 3 √(b / 2π²) = 0.1351 degrees; feature detection reaches 3 · 0.082 / 2 = 0.123 degrees. Both are
/// rounded up to whole pixels; one more is for the rounding.
fn filter_radius_rows(pixels_per_degree: f32) -> u32 {
    (0.1351 * pixels_per_degree).ceil() as u32 + 1
}

/// Paints an error map with the magma color map, as NVIDIA's tools do: 0 is black, 1 pale yellow.
///
/// Returns 3 sRGB bytes for each value. Values are clamped to 0 … 1; NaN is painted as 0.
pub fn magma_srgb8(error_map: &[f32]) -> Vec<u8> {
    let colors = nv_flip::magma_lut().to_vec();
    error_map
        .iter()
        .flat_map(|error| {
            // The cast saturates and takes NaN to 0.
            let index = (error * 255.0).round() as u8 as usize;
            [colors[3 * index], colors[3 * index + 1], colors[3 * index + 2]]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_images::{assert_same_on_every_thread_count, color_pair};

    /// What `flip-evaluator` 1.7 gives for the images of `test_images` (height × width × 3 bytes `r`, `t`):
    ///
    /// ```text
    /// flip_evaluator.evaluate((r / 255).astype("float32"), (t / 255).astype("float32"), "LDR",
    ///                         inputsRGB=True, applyMagma=False, parameters={"ppd": ppd})
    /// ```
    ///
    /// Mean, then the error of the first, the middle (w / 2, h / 2) and the last pixel.
    #[test]
    fn agrees_with_flip_evaluator() {
        for (width, height, ppd, mean, pixels) in [
            (96, 64, 67.0, 0.204_928_65, [0.293_754_5, 0.124_716_77, 0.239_927_63]),
            (96, 64, 20.0, 0.267_210_22, [0.334_097_92, 0.165_822_07, 0.182_403_15]),
            // Taller than a band.
            (40, 300, 67.0, 0.227_695_78, [0.293_754_5, 0.268_248_23, 0.184_972_39]),
        ] {
            let (reference, test) = color_pair(width, height);
            let found = flip(width, height, &reference, &test, ppd).unwrap();
            assert!((found.mean - mean).abs() < 1e-4, "{width} x {height}: {}", found.mean);
            let count = found.error_map.len();
            assert_eq!(count, (width * height) as usize);
            let middle = (height / 2 * width + width / 2) as usize;
            for (index, expected) in [0, middle, count - 1].into_iter().zip(pixels) {
                let error: f32 = found.error_map[index];
                assert!((error - expected).abs() < 1e-4, "{width} x {height} at {index}: {error}");
            }
        }
    }

    #[test]
    fn bands_are_the_whole_picture_bit_for_bit() {
        let (reference, test) = color_pair(50, 130);
        for ppd in [5.0, 67.0, 140.0] {
            let whole = flip_in_bands(50, 130, &reference, &test, ppd, 130).unwrap();
            for rows in [1, 7, 64] {
                assert_eq!(whole, flip_in_bands(50, 130, &reference, &test, ppd, rows).unwrap());
            }
        }
    }

    #[test]
    fn equal_pictures_have_no_error_and_black_on_white_almost_all() {
        let (reference, _) = color_pair(9, 1);
        let same = flip(9, 1, &reference, &reference, PIXELS_PER_DEGREE).unwrap();
        assert_eq!((same.mean, same.error_map), (0.0, vec![0.0; 9]));
        let different = flip(1, 1, &[0; 3], &[255; 3], PIXELS_PER_DEGREE).unwrap();
        assert!((different.mean - 0.967_388_2).abs() < 1e-4, "{}", different.mean);
    }

    #[test]
    fn does_not_depend_on_the_thread_count() {
        let (reference, test) = color_pair(30, 300);
        assert_same_on_every_thread_count(|| {
            flip(30, 300, &reference, &test, PIXELS_PER_DEGREE).unwrap().mean.to_bits()
        });
    }

    #[test]
    fn magma_runs_from_black_to_pale_yellow() {
        assert_eq!(magma_srgb8(&[0.0, -3.0, f32::NAN]), [0, 0, 4].repeat(3));
        assert_eq!(magma_srgb8(&[1.0, 7.0]), [252, 253, 191].repeat(2));
        assert_eq!(magma_srgb8(&[]), Vec::<u8>::new());
        let ramp: Vec<f32> = (0..256).map(|i| i as f32 / 255.0).collect();
        let painted = magma_srgb8(&ramp);
        let darkness: Vec<u32> = painted.chunks(3).map(|c| c.iter().map(|v| u32::from(*v)).sum()).collect();
        assert!(darkness[0] < darkness[64] && darkness[64] < darkness[128] && darkness[128] < darkness[255]);
    }

    #[test]
    fn says_what_is_wrong() {
        let one = [0u8; 3];
        assert!(matches!(flip(0, 0, &[], &[], 67.0), Err(MetricError::Empty { .. })));
        assert!(matches!(flip(1, 1, &one, &one[..2], 67.0), Err(MetricError::LengthsDiffer { .. })));
        assert!(matches!(
            flip(2, 1, &one, &one, 67.0),
            Err(MetricError::WrongLength { expected: 6, found: 3, .. })
        ));
        assert!(matches!(flip(u32::MAX, u32::MAX, &one, &one, 67.0), Err(MetricError::WrongLength { .. })));
        for ppd in [0.0, -1.0, 1e9, f32::NAN] {
            assert!(matches!(
                flip(1, 1, &one, &one, ppd),
                Err(MetricError::Parameter { name: "pixels_per_degree", .. })
            ));
        }
    }
}
