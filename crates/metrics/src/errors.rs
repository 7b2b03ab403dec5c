//! The error of every pixel as a number: signed, absolute or squared.

use crate::error::{MetricError, check_finite, check_size};

/// Which error of a pixel [`error_map`] gives, each the mean over its channels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PixelError {
    /// test − reference: above 0 where the test is too light.
    Signed,
    /// |test − reference|.
    Absolute,
    /// (test − reference)²; the mean over all pixels is the mean square error that [`psnr()`](crate::psnr()) takes.
    Squared,
}

/// The error of `test` at every pixel, in rows from the top. Both have `channels` values a pixel, of any range and
/// encoding; errors have the values' unit, or its square.
///
/// # Errors
/// Sizes that do not fit, no channels, a value that is not finite.
pub fn error_map(
    width: u32,
    height: u32,
    channels: usize,
    reference: &[f32],
    test: &[f32],
    error: PixelError,
) -> Result<Vec<f32>, MetricError> {
    if channels == 0 {
        return Err(MetricError::Parameter { name: "channels", value: 0.0, range: "1 or more" });
    }
    check_size(width, height, channels, reference, test)?;
    check_finite("reference", reference)?;
    check_finite("test", test)?;
    let pixels = reference.chunks_exact(channels).zip(test.chunks_exact(channels));
    let errors = pixels.map(|(reference, test)| {
        let differences = reference.iter().zip(test).map(|(r, t)| f64::from(*t) - f64::from(*r));
        let sum: f64 = match error {
            PixelError::Signed => differences.sum(),
            PixelError::Absolute => differences.map(f64::abs).sum(),
            PixelError::Squared => differences.map(|d| d * d).sum(),
        };
        (sum / channels as f64) as f32
    });
    Ok(errors.collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::psnr;
    use crate::test_images::noisy_pair;

    #[test]
    fn each_kind_is_what_it_says() {
        let (reference, test) = ([0.5, 0.25, 1.0, 0.0], [0.75, 0.0, 1.0, 0.5]);
        let map = |error| error_map(2, 1, 2, &reference, &test, error).unwrap();
        assert_eq!(map(PixelError::Signed), [0.0, 0.25]);
        assert_eq!(map(PixelError::Absolute), [0.25, 0.25]);
        assert_eq!(map(PixelError::Squared), [0.0625, 0.125]);
    }

    #[test]
    fn the_mean_of_squares_is_that_of_psnr() {
        let (reference, test) = noisy_pair(60, 40);
        let squares = error_map(20, 40, 3, &reference, &test, PixelError::Squared).unwrap();
        let mean = squares.iter().map(|e| f64::from(*e)).sum::<f64>() / 800.0;
        let db = psnr(&reference, &test, 1.0).unwrap();
        assert!((-10.0 * mean.log10() - db).abs() < 1e-5, "{mean} {db}");
    }

    #[test]
    fn says_what_is_wrong() {
        let wrong = |channels, test: &[f32]| {
            error_map(1, 1, channels, &[0.5; 3], test, PixelError::Signed).unwrap_err()
        };
        assert!(matches!(wrong(0, &[0.5; 3]), MetricError::Parameter { name: "channels", .. }));
        assert!(matches!(wrong(1, &[0.5; 3]), MetricError::WrongLength { expected: 1, found: 3, .. }));
        assert!(matches!(wrong(3, &[0.5; 2]), MetricError::LengthsDiffer { .. }));
        assert!(matches!(wrong(3, &[0.5, f32::NAN, 0.5]), MetricError::NotFinite { index: 1, .. }));
    }
}
