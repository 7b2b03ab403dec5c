//! Peak signal-to-noise ratio, over all pixels or those under a mask.
//!
//! `PSNR = 10 log10(peak² / MSE)` in dB, the mean square error taken over every channel of every pixel.

use rayon::prelude::*;

use crate::error::{MetricError, check_finite};

/// Values summed by one task. Fixed, so that the order of summation does not depend on the thread count.
const CHUNK: usize = 1 << 16;

/// PSNR in dB of `test` against `reference`; infinite where they are equal.
///
/// `peak` is the largest value a channel can take (1 for visibility and linear 0 … 1 images, 255 for bytes);
/// finite and > 0.
///
/// # Errors
/// Lengths that differ, no values at all, a value that is not finite, a `peak` out of range.
pub fn psnr(reference: &[f32], test: &[f32], peak: f32) -> Result<f64, MetricError> {
    check(reference, test, peak)?;
    let sum_of_squares = sum_in_chunks(reference.len(), |range| {
        reference[range.clone()].iter().zip(&test[range]).map(|(r, t)| squared_difference(*r, *t)).sum()
    });
    Ok(decibels(sum_of_squares, reference.len(), peak))
}

/// PSNR in dB over the pixels whose `mask` entry is true; infinite where they are equal.
///
/// The number of channels is `reference.len() / mask.len()`. Values outside the mask are ignored, so that they
/// may be anything, NaN included (pixels where there is no surface).
///
/// # Errors
/// As [`psnr`], and a mask that does not fit the images or selects nothing.
pub fn psnr_masked(reference: &[f32], test: &[f32], mask: &[bool], peak: f32) -> Result<f64, MetricError> {
    check_lengths(reference, test, peak)?;
    if mask.is_empty() || !reference.len().is_multiple_of(mask.len()) {
        return Err(MetricError::MaskLength { mask: mask.len(), values: reference.len() });
    }
    let channels = reference.len() / mask.len();
    let selected = mask.iter().filter(|m| **m).count();
    if selected == 0 {
        return Err(MetricError::MaskEmpty { mask: mask.len() });
    }
    for (image, values) in [("reference", reference), ("test", test)] {
        let bad = (0..values.len()).find(|&i| mask[i / channels] && !values[i].is_finite());
        if let Some(index) = bad {
            return Err(MetricError::NotFinite { image, index, value: values[index] });
        }
    }
    let sum_of_squares = sum_in_chunks(reference.len(), |range| {
        range.filter(|i| mask[i / channels]).map(|i| squared_difference(reference[i], test[i])).sum()
    });
    Ok(decibels(sum_of_squares, selected * channels, peak))
}

fn check_lengths(reference: &[f32], test: &[f32], peak: f32) -> Result<(), MetricError> {
    if !(peak.is_finite() && peak > 0.0) {
        return Err(MetricError::Parameter { name: "peak", value: peak, range: "0 < peak < infinity" });
    }
    if reference.len() != test.len() {
        return Err(MetricError::LengthsDiffer { reference: reference.len(), test: test.len() });
    }
    if reference.is_empty() {
        return Err(MetricError::Empty { width: 0, height: 0 });
    }
    Ok(())
}

fn check(reference: &[f32], test: &[f32], peak: f32) -> Result<(), MetricError> {
    check_lengths(reference, test, peak)?;
    check_finite("reference", reference)?;
    check_finite("test", test)
}

fn squared_difference(a: f32, b: f32) -> f64 {
    let d = f64::from(a) - f64::from(b);
    d * d
}

/// Sums `part` over fixed ranges of `0..count`, the parts in parallel and their sums in order.
fn sum_in_chunks(count: usize, part: impl Fn(std::ops::Range<usize>) -> f64 + Sync) -> f64 {
    let parts: Vec<f64> = (0..count.div_ceil(CHUNK))
        .into_par_iter()
        .map(|chunk| part(chunk * CHUNK..((chunk + 1) * CHUNK).min(count)))
        .collect();
    parts.iter().sum()
}

fn decibels(sum_of_squares: f64, count: usize, peak: f32) -> f64 {
    if sum_of_squares == 0.0 {
        return f64::INFINITY;
    }
    let peak = f64::from(peak);
    10.0 * libm::log10(peak * peak * count as f64 / sum_of_squares)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_images::{assert_same_on_every_thread_count, noisy_pair};

    #[test]
    fn a_known_error_gives_the_known_ratio() {
        // Every value is off by 1/10 of the peak: MSE = peak² / 100, so 20 dB, whatever the peak.
        for peak in [1.0f32, 255.0] {
            let reference = vec![0.5 * peak; 300];
            let test: Vec<f32> = reference.iter().map(|v| v + 0.1 * peak).collect();
            let db = psnr(&reference, &test, peak).unwrap();
            assert!((db - 20.0).abs() < 1e-5, "{db}");
        }
        // One of four values off by the whole peak: MSE = 1/4.
        let db = psnr(&[0.0, 0.0, 0.0, 0.0], &[0.0, 0.0, 1.0, 0.0], 1.0).unwrap();
        assert!((db - 6.020_599_913_279_624).abs() < 1e-12, "{db}");
    }

    #[test]
    fn equal_images_are_infinitely_good() {
        let (reference, _) = noisy_pair(17, 5);
        assert_eq!(psnr(&reference, &reference, 1.0).unwrap(), f64::INFINITY);
    }

    /// `skimage.metrics.peak_signal_noise_ratio(r, t, data_range=1)` of the images in `test_images`.
    #[test]
    fn agrees_with_scikit_image() {
        let (reference, test) = noisy_pair(64, 48);
        let db = psnr(&reference, &test, 1.0).unwrap();
        assert!((db - PSNR_SKIMAGE).abs() < 1e-9, "{db}");
    }
    const PSNR_SKIMAGE: f64 = 19.903_466_840_692_914;

    #[test]
    fn the_mask_chooses_whole_pixels() {
        // Two pixels of three channels; the second is wrong and holds a NaN, but is not looked at.
        let reference = [0.1, 0.2, 0.3, 0.4, 0.5, f32::NAN];
        let test = [0.1, 0.2, 0.4, 0.9, 0.9, 0.9];
        let masked = psnr_masked(&reference, &test, &[true, false], 1.0).unwrap();
        let alone = psnr(&reference[..3], &test[..3], 1.0).unwrap();
        assert_eq!(masked, alone);
        assert!(matches!(
            psnr_masked(&reference, &test, &[true, true], 1.0),
            Err(MetricError::NotFinite { image: "reference", index: 5, .. })
        ));
    }

    #[test]
    fn does_not_depend_on_the_thread_count() {
        let (reference, test) = noisy_pair(512, 400);
        let mask: Vec<bool> = (0..reference.len()).map(|i| i % 3 != 0).collect();
        assert_same_on_every_thread_count(|| {
            let all = psnr(&reference, &test, 1.0).unwrap();
            let some = psnr_masked(&reference, &test, &mask, 1.0).unwrap();
            (all.to_bits(), some.to_bits())
        });
    }

    #[test]
    fn says_what_is_wrong() {
        let one = [0.5f32];
        assert!(matches!(psnr(&[], &[], 1.0), Err(MetricError::Empty { .. })));
        assert!(matches!(psnr(&one, &[], 1.0), Err(MetricError::LengthsDiffer { reference: 1, test: 0 })));
        for peak in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            assert!(matches!(psnr(&one, &one, peak), Err(MetricError::Parameter { name: "peak", .. })));
        }
        assert!(matches!(
            psnr(&one, &[f32::INFINITY], 1.0),
            Err(MetricError::NotFinite { image: "test", index: 0, .. })
        ));
        assert!(matches!(psnr_masked(&one, &one, &[], 1.0), Err(MetricError::MaskLength { .. })));
        assert!(matches!(
            psnr_masked(&one, &one, &[true, true], 1.0),
            Err(MetricError::MaskLength { mask: 2, values: 1 })
        ));
        assert!(matches!(psnr_masked(&one, &one, &[false], 1.0), Err(MetricError::MaskEmpty { mask: 1 })));
    }
}
