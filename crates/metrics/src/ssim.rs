//! Mean structural similarity of luma images ([Wang2004]).
//!
//! [Wang2004] Wang, Bovik, Sheikh, Simoncelli: *Image quality assessment: from error visibility to structural
//! similarity*, IEEE Transactions on Image Processing 13(4), 2004. Per window (eq. 13)
//!
//! ```text
//! SSIM = (2 μx μy + C1) (2 σxy + C2) / ((μx² + μy² + C1) (σx² + σy² + C2)),   C = (K L)²
//! ```
//!
//! with means and (co)variances weighted by an 11 × 11 Gaussian of σ = 1.5 pixels, K1 = 0.01, K2 = 0.03 and
//! L = 1, and eq. 17 for the mean over all windows.
//!
//! **Borders**: only windows that lie wholly inside the image count, so the outermost 5 pixels have no window
//! of their own, and an image under 11 pixels in either direction is refused. There is no down-sampling
//! beforehand.
//!
//! [Wang2004]: https://doi.org/10.1109/TIP.2003.819861

use rayon::prelude::*;

use crate::error::{MetricError, check_finite, check_size};

/// Least width and height that [`ssim`] takes, in pixels: the side of its window.
pub const SSIM_MIN_SIDE: u32 = WINDOW as u32;

const WINDOW: usize = 11;
const SIGMA_PIXELS: f64 = 1.5;
const C1: f64 = 0.01 * 0.01;
const C2: f64 = 0.03 * 0.03;

/// Mean SSIM of `test` against `reference`, at most 1 (equal images) and at least −1.
///
/// Both are luma of `width * height` values in rows from the top, meant for 0 … 1 (the constants assume a range
/// of 1). The image's own encoding is judged: pass what is displayed.
///
/// # Errors
/// Sizes that do not fit, a side under [`SSIM_MIN_SIDE`], a value that is not finite.
pub fn ssim(width: u32, height: u32, reference: &[f32], test: &[f32]) -> Result<f64, MetricError> {
    let row_sums: Vec<f64> = map_rows(width, height, reference, test, |similarities| similarities.sum())?;
    let windows = row_sums.len() * (width as usize - WINDOW + 1);
    Ok(row_sums.iter().sum::<f64>() / windows as f64)
}

/// The outcome of [`ssim_map`].
#[derive(Debug, Clone, PartialEq)]
pub struct SsimMap {
    /// What [`ssim`] gives.
    pub mean: f64,
    /// Width of the map: 10 less than that of the image.
    pub width: u32,
    /// Height of the map: 10 less than that of the image.
    pub height: u32,
    /// SSIM of every window, −1 … 1, in rows from the top: first that around the pixel (5, 5).
    pub map: Vec<f32>,
}

/// As [`ssim`], with the similarity of every window.
///
/// # Errors
/// As [`ssim`].
pub fn ssim_map(width: u32, height: u32, reference: &[f32], test: &[f32]) -> Result<SsimMap, MetricError> {
    let mean = ssim(width, height, reference, test)?;
    let rows: Vec<Vec<f32>> =
        map_rows(width, height, reference, test, |similarities| similarities.map(|s| s as f32).collect())?;
    let margin = SSIM_MIN_SIDE - 1;
    Ok(SsimMap { mean, width: width - margin, height: height - margin, map: rows.concat() })
}

/// What `found` makes of the similarities of each row of windows.
fn map_rows<T: Send>(
    width: u32,
    height: u32,
    reference: &[f32],
    test: &[f32],
    found: impl Fn(&mut dyn Iterator<Item = f64>) -> T + Sync,
) -> Result<Vec<T>, MetricError> {
    check_size(width, height, 1, reference, test)?;
    if width < SSIM_MIN_SIDE || height < SSIM_MIN_SIDE {
        return Err(MetricError::TooSmall { width, height, minimum: SSIM_MIN_SIDE });
    }
    check_finite("reference", reference)?;
    check_finite("test", test)?;

    let (width, height) = (width as usize, height as usize);
    let weights = gaussian();
    let tops = (0..height - WINDOW + 1).into_par_iter();
    let rows = tops.map(|top| {
        let rows = top * width..(top + WINDOW) * width;
        let columns = column_moments(width, &reference[rows.clone()], &test[rows], &weights);
        found(&mut columns.windows(WINDOW).map(|window| similarity(moments(window, &weights))))
    });
    Ok(rows.collect())
}

/// Weighted sums of x, y, x², y², xy down each column of a band of [`WINDOW`] rows. The weights are separable: columns
/// first, then along the row.
fn column_moments(width: usize, reference: &[f32], test: &[f32], weights: &[f64; WINDOW]) -> Vec<[f64; 5]> {
    let mut columns = vec![[0.0f64; 5]; width];
    let rows = reference.chunks_exact(width).zip(test.chunks_exact(width));
    for (weight, (reference_row, test_row)) in weights.iter().zip(rows) {
        for ((column, x), y) in columns.iter_mut().zip(reference_row).zip(test_row) {
            let (x, y) = (f64::from(*x), f64::from(*y));
            let terms = [x, y, x * x, y * y, x * y];
            for (sum, term) in column.iter_mut().zip(terms) {
                *sum += weight * term;
            }
        }
    }
    columns
}

/// The moments of a window from those of its columns.
fn moments(columns: &[[f64; 5]], weights: &[f64; WINDOW]) -> [f64; 5] {
    let mut moments = [0.0f64; 5];
    for (weight, column) in weights.iter().zip(columns) {
        for (moment, value) in moments.iter_mut().zip(column) {
            *moment += weight * value;
        }
    }
    moments
}

/// Eq. 13 from the weighted means of x, y, x², y², xy.
fn similarity([mean_x, mean_y, mean_xx, mean_yy, mean_xy]: [f64; 5]) -> f64 {
    let variance_x = mean_xx - mean_x * mean_x;
    let variance_y = mean_yy - mean_y * mean_y;
    let covariance = mean_xy - mean_x * mean_y;
    let numerator = (2.0 * mean_x * mean_y + C1) * (2.0 * covariance + C2);
    let denominator = (mean_x * mean_x + mean_y * mean_y + C1) * (variance_x + variance_y + C2);
    numerator / denominator
}

/// The 11 weights of the window's side; they sum to 1.
fn gaussian() -> [f64; WINDOW] {
    let center = (WINDOW / 2) as f64;
    let mut weights = [0.0; WINDOW];
    for (i, weight) in weights.iter_mut().enumerate() {
        let offset = i as f64 - center;
        *weight = libm::exp(-offset * offset / (2.0 * SIGMA_PIXELS * SIGMA_PIXELS));
    }
    let sum: f64 = weights.iter().sum();
    weights.map(|w| w / sum)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_images::{assert_same_on_every_thread_count, noisy_pair, smooth_pair};

    /// What scikit-image 0.26 gives for the images of `test_images`, mean over the crop of 5 pixels it takes:
    ///
    /// ```text
    /// structural_similarity(r, t, gaussian_weights=True, sigma=1.5, use_sample_covariance=False, data_range=1)
    /// ```
    #[test]
    fn agrees_with_scikit_image() {
        for (name, (width, height), pair, expected) in [
            ("noise", (64, 48), noisy_pair as fn(u32, u32) -> _, NOISE),
            ("smooth", (80, 37), smooth_pair, SMOOTH),
            ("one window", (11, 11), noisy_pair, ONE_WINDOW),
        ] {
            let (reference, test): (Vec<f32>, Vec<f32>) = pair(width, height);
            let found = ssim(width, height, &reference, &test).unwrap();
            assert!((found - expected).abs() < 1e-9, "{name}: {found} instead of {expected}");
        }
    }
    const NOISE: f64 = 0.922_988_514_887_705_7;
    const SMOOTH: f64 = 0.921_788_210_260_960_6;
    const ONE_WINDOW: f64 = 0.869_161_042_319_009_3;

    #[test]
    fn flat_images_follow_the_formula() {
        // Without variance only the luminance term stays: (2 x y + C1) / (x² + y² + C1).
        let (x, y) = (0.25f32, 0.75f32);
        let found = ssim(20, 15, &[x; 300], &[y; 300]).unwrap();
        let expected = (2.0 * 0.25 * 0.75 + C1) / (0.25 * 0.25 + 0.75 * 0.75 + C1);
        assert!((found - expected).abs() < 1e-12, "{found} instead of {expected}");
    }

    #[test]
    fn equal_images_score_one_and_it_is_symmetric() {
        let (reference, test) = noisy_pair(40, 30);
        let same = ssim(40, 30, &reference, &reference).unwrap();
        assert!((same - 1.0).abs() < 1e-12, "{same}");
        let there = ssim(40, 30, &reference, &test).unwrap();
        let back = ssim(40, 30, &test, &reference).unwrap();
        assert!((there - back).abs() < 1e-12 && there < 1.0);
    }

    #[test]
    fn the_map_holds_every_window() {
        let (reference, test) = noisy_pair(40, 25);
        let found = ssim_map(40, 25, &reference, &test).unwrap();
        assert_eq!((found.width, found.height, found.map.len()), (30, 15, 450));
        assert_eq!(found.mean, ssim(40, 25, &reference, &test).unwrap());
        // The window around (12, 9) alone, as a picture of one window.
        let cut = |image: &[f32]| {
            (4..15).flat_map(|y| image[y * 40 + 7..y * 40 + 18].to_vec()).collect::<Vec<f32>>()
        };
        let alone = ssim(11, 11, &cut(&reference), &cut(&test)).unwrap();
        assert_eq!(found.map[4 * 30 + 7], alone as f32);
    }

    #[test]
    fn does_not_depend_on_the_thread_count() {
        let (reference, test) = noisy_pair(200, 150);
        assert_same_on_every_thread_count(|| ssim(200, 150, &reference, &test).unwrap().to_bits());
    }

    #[test]
    fn says_what_is_wrong() {
        let image = [0.5f32; 144];
        assert!(matches!(ssim(0, 5, &[], &[]), Err(MetricError::Empty { width: 0, height: 5 })));
        assert!(matches!(ssim(12, 12, &image, &image[1..]), Err(MetricError::LengthsDiffer { .. })));
        assert!(matches!(
            ssim(12, 11, &image, &image),
            Err(MetricError::WrongLength { expected: 132, found: 144, .. })
        ));
        assert!(matches!(
            ssim(10, 11, &image[..110], &image[..110]),
            Err(MetricError::TooSmall { width: 10, height: 11, minimum: 11 })
        ));
        let mut bad = image;
        bad[7] = f32::NAN;
        assert!(matches!(
            ssim(12, 12, &image, &bad),
            Err(MetricError::NotFinite { image: "test", index: 7, .. })
        ));
    }
}
