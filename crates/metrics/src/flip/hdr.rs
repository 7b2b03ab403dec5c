//! HDR-FLIP ([Andersson2021]): pictures of any brightness, as they look at all exposures that matter.

use super::color::Space;
use super::ldr::Flipper;
use super::{Flip, check_pixels_per_degree, mean};
use crate::error::{MetricError, check_finite, check_size};

/// The tone mapping curve of [Narkowicz2015] as a fraction of two polynomials in 0.6 x, of degree 2, 1, 0.
const NUMERATOR: [f64; 3] = [2.51, 0.03, 0.0];
const DENOMINATOR: [f64; 3] = [2.43, 0.59, 0.14];
const INPUT_SCALE: f64 = 0.6;

/// Tone mapped value that the brightest pixel has at the first exposure, and the median one at the last.
const BRIGHT: f64 = 0.85;

/// Least luminance that counts, 2⁻²³, so that pictures that are black for the most part end at some exposure.
const DARKEST: f32 = f32::EPSILON;

/// Most exposures that [`Exposures::count`] may ask for.
const MAX_COUNT: u32 = 1024;
/// Largest exposure in stops: factors stay far from the limits of double precision.
const MAX_STOPS: f32 = 200.0;

/// The exposures at which pictures are compared: factors of 2^`start` … 2^`stop`, evenly spaced in stops.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exposures {
    /// First exposure in stops, −200 … 200.
    pub start: f32,
    /// Last exposure in stops, at least `start` and at most 200.
    pub stop: f32,
    /// How many, 1 … 1024; a single one is `start`.
    pub count: u32,
}

/// The outcome of [`flip_hdr()`].
#[derive(Debug, Clone, PartialEq)]
pub struct HdrFlip {
    /// Mean error over all pixels, 0 (equal) … 1.
    pub mean: f64,
    /// Error of every pixel, 0 … 1, in rows from the top: the largest over the exposures.
    pub error_map: Vec<f32>,
    /// The exposures: those given, or those the reference asked for.
    pub exposures: Exposures,
}

impl Exposures {
    /// The exposures that a picture asks for ([Andersson2021] sec. 4): from the one that shows its brightest pixel at
    /// 85 % to the one that shows the pixel of median luminance there, one for each stop between, and at least two.
    /// Negative values count as 0.
    ///
    /// # Errors
    /// No pixel, a number of values that is no multiple of 3, a value that is not finite, a picture without any light.
    pub fn of(linear_rgb: &[f32]) -> Result<Exposures, MetricError> {
        let (pixels, rest) = linear_rgb.as_chunks::<3>();
        if !rest.is_empty() {
            let (width, found) = (pixels.len() as u32 + 1, linear_rgb.len());
            let expected = 3 * (pixels.len() as u64 + 1);
            return Err(MetricError::WrongLength { width, height: 1, channels: 3, expected, found });
        }
        if pixels.is_empty() {
            return Err(MetricError::Empty { width: 0, height: 0 });
        }
        check_finite("reference", linear_rgb)?;
        let space = Space::srgb();
        // Finite in sum: luminances are weighted means of finite channels.
        let luminance = |rgb: &[f32; 3]| space.luminance(rgb.map(|v| v.max(0.0)));
        let mut luminances: Vec<f32> = pixels.iter().map(luminance).collect();
        let middle = luminances.len() / 2;
        let (_, median, brighter) = luminances.select_nth_unstable_by(middle, f32::total_cmp);
        let (median, brightest) = (*median, brighter.iter().copied().fold(*median, f32::max));
        if brightest <= 0.0 {
            return Err(MetricError::Black);
        }
        let bright = inverse_tone_map(BRIGHT);
        let exposure = |luminance: f32| libm::log2(bright / f64::from(luminance.max(DARKEST))) as f32;
        let (start, stop) = (exposure(brightest), exposure(median));
        Ok(Exposures { start, stop, count: ((stop - start).ceil() as u32).max(2) })
    }

    fn check(self) -> Result<Exposures, MetricError> {
        let wrong = |name, value, range| Err(MetricError::Parameter { name, value, range });
        if !(-MAX_STOPS..=MAX_STOPS).contains(&self.start) {
            return wrong("the first exposure", self.start, "-200 ... 200 stops");
        }
        if !(self.start..=MAX_STOPS).contains(&self.stop) {
            return wrong("the last exposure", self.stop, "the first exposure ... 200 stops");
        }
        if !(1..=MAX_COUNT).contains(&self.count) {
            return wrong("the number of exposures", self.count as f32, "1 ... 1024");
        }
        Ok(self)
    }

    /// Factors on linear light.
    fn factors(self) -> impl Iterator<Item = f64> {
        let (start, stop) = (f64::from(self.start), f64::from(self.stop));
        let step = (stop - start) / f64::from((self.count - 1).max(1));
        (0..self.count).map(move |i| libm::exp2(start + step * f64::from(i)))
    }
}

/// HDR-FLIP of `test` against `reference`.
///
/// Both are linear sRGB of any brightness, 3 values a pixel, in rows from the top; negative values count as 0.
/// `pixels_per_degree` is that of [`flip()`](super::flip()). Without `exposures` they are [`Exposures::of`] the
/// reference; give them to compare several pictures under the same.
///
/// # Errors
/// Sizes that do not fit, a value that is not finite, `pixels_per_degree` or `exposures` out of range, a reference
/// without any light if no exposures are given.
pub fn flip_hdr(
    width: u32,
    height: u32,
    reference_linear: &[f32],
    test_linear: &[f32],
    pixels_per_degree: f32,
    exposures: Option<Exposures>,
) -> Result<HdrFlip, MetricError> {
    check_size(width, height, 3, reference_linear, test_linear)?;
    check_pixels_per_degree(pixels_per_degree)?;
    check_finite("reference", reference_linear)?;
    check_finite("test", test_linear)?;
    let exposures = match exposures {
        Some(exposures) => exposures.check()?,
        None => Exposures::of(reference_linear)?,
    };

    let (width, height) = (width as usize, height as usize);
    let flipper = Flipper::new(pixels_per_degree);
    let mut error_map = vec![0.0f32; width * height];
    for factor in exposures.factors() {
        let row = |picture: &[f32], y: usize, out: &mut [[f32; 3]]| {
            let pixels = picture[y * width * 3..(y + 1) * width * 3].as_chunks::<3>().0;
            for (out, pixel) in out.iter_mut().zip(pixels) {
                *out = pixel.map(|v| tone_map(f64::from(v) * factor) as f32);
            }
        };
        let rows: [&super::ldr::Rows<'_>; 2] =
            [&|y, out| row(reference_linear, y, out), &|y, out| row(test_linear, y, out)];
        let errors = flipper.error_map(width, height, rows);
        error_map.iter_mut().zip(errors).for_each(|(most, error)| *most = most.max(error));
    }
    let Flip { mean, error_map } = mean(error_map);
    Ok(HdrFlip { mean, error_map, exposures })
}

/// 0 … 1 for any number; what is negative counts as 0.
fn tone_map(x: f64) -> f64 {
    let x = INPUT_SCALE * x.max(0.0);
    let polynomial = |c: [f64; 3]| (c[0] * x + c[1]) * x + c[2];
    (polynomial(NUMERATOR) / polynomial(DENOMINATOR)).min(1.0)
}

/// The number that is tone mapped to `y`, 0 < y < 1: the larger root of numerator − y · denominator.
fn inverse_tone_map(y: f64) -> f64 {
    let [a, b, c] = std::array::from_fn(|i| NUMERATOR[i] - y * DENOMINATOR[i]);
    (-b + (b * b - 4.0 * a * c).sqrt()) / (2.0 * a) / INPUT_SCALE
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_images::{assert_same_on_every_thread_count, hdr_pair};

    #[test]
    fn tone_mapping_has_its_inverse() {
        for y in [0.01, 0.5, 0.85, 0.99] {
            assert!((tone_map(inverse_tone_map(y)) - y).abs() < 1e-12);
        }
        assert_eq!((tone_map(0.0), tone_map(-3.0), tone_map(1e30)), (0.0, 0.0, 1.0));
    }

    #[test]
    fn exposures_show_what_there_is() {
        // Luminances 1, 2, 4, 8, 16: the brightest is 16, the median 4.
        let steps: Vec<f32> = (0..5).flat_map(|i| [(1 << i) as f32; 3]).collect();
        let bright = inverse_tone_map(0.85) as f32;
        let found = Exposures::of(&steps).unwrap();
        assert!((found.start - (bright / 16.0).log2()).abs() < 1e-5, "{found:?}");
        assert!((found.stop - found.start - 2.0).abs() < 1e-5, "{found:?}");
        // One gray, and the median of an even number is the brighter one of the two in the middle.
        let gray = Exposures::of(&[0.5; 12]).unwrap();
        assert_eq!((gray.start, gray.count), (gray.stop, 2));
        let two = Exposures::of(&[1.0, 1.0, 1.0, 8.0, 8.0, 8.0]).unwrap();
        assert_eq!(two.start, two.stop);
        assert_eq!(Exposures::of(&[0.0; 6]), Err(MetricError::Black));
        assert_eq!(Exposures::of(&[-1.0; 6]), Err(MetricError::Black));
        assert!(matches!(Exposures::of(&[1.0; 4]), Err(MetricError::WrongLength { expected: 6, .. })));
        assert!(matches!(Exposures::of(&[]), Err(MetricError::Empty { .. })));
        // Black for the most part: 2⁻²³ is the least that counts.
        let night = Exposures::of(&[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0]).unwrap();
        assert!((night.stop - night.start - 23.0).abs() < 1e-5 && night.count == 23, "{night:?}");
    }

    /// What `flip-evaluator` 1.7 gives for the pictures of `hdr_pair` (height × width × 3 floats `r`, `t`):
    ///
    /// ```text
    /// flip_evaluator.evaluate(r, t, "HDR", applyMagma=False, parameters={"ppd": ppd})
    /// ```
    ///
    /// Mean; first and last exposure and their number; the error of the first, the middle and the last pixel.
    #[test]
    fn agrees_with_flip_evaluator() {
        for (width, height, ppd, mean, (start, stop, count), pixels) in AGREED {
            let (reference, test) = hdr_pair(width, height);
            let found = flip_hdr(width, height, &reference, &test, ppd, None).unwrap();
            assert!((found.mean - mean).abs() < 1e-5, "{width} x {height}: {}", found.mean);
            let Exposures { start: found_start, stop: found_stop, count: found_count } = found.exposures;
            assert!((found_start - start).abs() < 1e-4 && (found_stop - stop).abs() < 1e-4);
            assert_eq!(found_count, count);
            let middle = (height / 2 * width + width / 2) as usize;
            for (index, expected) in [0, middle, found.error_map.len() - 1].into_iter().zip(pixels) {
                let error: f32 = found.error_map[index];
                assert!((error - expected).abs() < 1e-4, "{width} x {height} at {index}: {error}");
            }
        }
    }
    type Agreed = (u32, u32, f32, f64, (f32, f32, u32), [f32; 3]);
    const AGREED: [Agreed; 3] = [
        (96, 64, 67.0, 0.201_263_73, (-3.308_183, 2.559_489, 6), [0.091_255_19, 0.440_131_8, 0.438_369_87]),
        (41, 150, 67.0, 0.201_933_52, (-3.621_532, 2.815_664, 7), [0.111_729_14, 0.087_103_71, 0.108_576_73]),
        (37, 29, 20.0, 0.167_066_28, (0.247_615_7, 4.929_049, 5), [0.343_913_1, 0.099_854_3, 0.890_492_1]),
    ];

    #[test]
    fn only_light_matters_and_not_its_unit() {
        let (reference, test) = hdr_pair(40, 30);
        let found = flip_hdr(40, 30, &reference, &test, 67.0, None).unwrap();
        let times = |picture: &[f32]| picture.iter().map(|v| v * 1024.0).collect::<Vec<f32>>();
        let brighter = flip_hdr(40, 30, &times(&reference), &times(&test), 67.0, None).unwrap();
        assert_eq!(found.exposures.count, brighter.exposures.count);
        assert!((found.mean - brighter.mean).abs() < 1e-5, "{} {}", found.mean, brighter.mean);
        let same = flip_hdr(40, 30, &reference, &reference, 67.0, None).unwrap();
        assert_eq!((same.mean, same.error_map), (0.0, vec![0.0; 1200]));
    }

    #[test]
    fn the_map_is_the_largest_over_the_exposures() {
        let (reference, test) = hdr_pair(30, 20);
        let at = |start, stop, count| {
            let exposures = Exposures { start, stop, count };
            flip_hdr(30, 20, &reference, &test, 67.0, Some(exposures)).unwrap().error_map
        };
        let all = at(-4.0, 2.0, 3);
        let singles = [at(-4.0, -4.0, 1), at(-1.0, -1.0, 1), at(2.0, 2.0, 1)];
        let most = |i: usize| singles.iter().map(|map| map[i]).fold(0.0, f32::max);
        assert_eq!(all, (0..600).map(most).collect::<Vec<f32>>());
        assert!(singles.iter().all(|map| *map != all));
    }

    #[test]
    fn does_not_depend_on_the_thread_count() {
        let (reference, test) = hdr_pair(33, 150);
        assert_same_on_every_thread_count(|| {
            let found = flip_hdr(33, 150, &reference, &test, 67.0, None).unwrap();
            found.error_map.iter().map(|e| e.to_bits()).collect::<Vec<u32>>()
        });
    }

    #[test]
    fn the_brightest_floats_stay_numbers() {
        let reference = [f32::MAX, 0.0, 1e-30, 1e30, 1.0, 2.0];
        let test = [0.0, f32::MAX, 1.0, 0.0, 0.0, f32::MAX];
        for exposures in [None, Some(Exposures { start: -200.0, stop: 200.0, count: 5 })] {
            let found = flip_hdr(2, 1, &reference, &test, 67.0, exposures).unwrap();
            assert!(found.error_map.iter().all(|e| (0.0..=1.0).contains(e)), "{found:?}");
        }
    }

    #[test]
    fn says_what_is_wrong() {
        let picture = [0.5f32; 6];
        let with = |exposures| flip_hdr(2, 1, &picture, &picture, 67.0, Some(exposures)).unwrap_err();
        for (start, stop, count) in [
            (f32::NAN, 0.0, 2),
            (-201.0, 0.0, 2),
            (1.0, 0.0, 2),
            (0.0, f32::INFINITY, 2),
            (0.0, 1.0, 0),
            (0.0, 1.0, 1025),
        ] {
            assert!(matches!(with(Exposures { start, stop, count }), MetricError::Parameter { .. }));
        }
        let nan = [0.5, f32::NAN, 0.5, 0.5, 0.5, 0.5];
        let error = flip_hdr(2, 1, &picture, &nan, 67.0, None).unwrap_err();
        assert!(matches!(error, MetricError::NotFinite { image: "test", index: 1, .. }));
        let error = flip_hdr(2, 1, &[0.0; 6], &picture, 67.0, None).unwrap_err();
        assert_eq!(error, MetricError::Black);
        assert!(matches!(
            flip_hdr(1, 1, &picture, &picture, 67.0, None),
            Err(MetricError::WrongLength { .. })
        ));
    }
}
