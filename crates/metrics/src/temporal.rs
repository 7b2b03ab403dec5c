//! What changes from picture to picture: flicker of what stands still.
//!
//! **Flicker** is the warping error over still points: the root mean square of `after(place of p) − before(p)` over all
//! pixels p of all pairs of successive pictures whose surface stands still in the world and is seen in both. 0 is
//! steady; the unit is that of the values. Where the camera moves, `after` is resampled bilinearly, which has an
//! error of its own wherever values are not linear in space: compare with what the truth's pictures give, or pass
//! differences to the truth as values, so that only the flicker of the error is left.

use rayon::prelude::*;

use crate::error::{MetricError, check_size};

/// Sums the flicker of still points over pairs of pictures.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Flicker {
    sum_of_squares: f64,
    count: u64,
}

impl Flicker {
    /// Nothing compared yet.
    pub fn new() -> Flicker {
        Flicker::default()
    }

    /// Adds one pair of pictures of one value a pixel, rows from the top.
    ///
    /// `places` says for every pixel of `before` where its surface lies in `after`, in pixels from the left and from the
    /// top; the centre of the first pixel is (0.5, 0.5). NaN is for what moved or is not seen in both. A place outside of
    /// the centres of the outermost pixels is not compared; neither is a NaN value, nor a place that touches one.
    ///
    /// # Errors
    /// Sizes that do not fit, an infinite value. Then nothing is added.
    pub fn add(
        &mut self,
        width: u32,
        height: u32,
        before: &[f32],
        after: &[f32],
        places: &[[f32; 2]],
    ) -> Result<(), MetricError> {
        check_size(width, height, 1, before, after)?;
        if places.len() != before.len() {
            return Err(MetricError::MaskLength { mask: places.len(), values: before.len() });
        }
        check_no_infinity("reference", before)?;
        check_no_infinity("test", after)?;
        let (width, height) = (width as usize, height as usize);
        let row_sums: Vec<(f64, u64)> = before
            .par_chunks(width)
            .zip(places.par_chunks(width))
            .map(|(before, places)| {
                let (mut sum, mut count) = (0.0, 0);
                for (before, place) in before.iter().zip(places) {
                    let Some(after) = sample(after, width, height, *place) else { continue };
                    let difference = after - f64::from(*before);
                    if !difference.is_nan() {
                        sum += difference * difference;
                        count += 1;
                    }
                }
                (sum, count)
            })
            .collect();
        for (sum, count) in row_sums {
            self.sum_of_squares += sum;
            self.count += count;
        }
        Ok(())
    }

    /// Root mean square of all differences, in the values' unit; `None` if none were compared.
    pub fn rms(&self) -> Option<f64> {
        (self.count > 0).then(|| (self.sum_of_squares / self.count as f64).sqrt())
    }

    /// Differences compared.
    pub fn count(&self) -> u64 {
        self.count
    }
}

/// The value at a place between pixels, NaN if one that counts is; `None` outside of the pixels' centres.
fn sample(values: &[f32], width: usize, height: usize, [x, y]: [f32; 2]) -> Option<f64> {
    let split = |at: f32, side: usize| {
        let at = f64::from(at) - 0.5;
        let inside = at >= 0.0 && at <= (side - 1) as f64;
        inside.then(|| (at as usize, at - at.floor()))
    };
    let ((x, tx), (y, ty)) = (split(x, width)?, split(y, height)?);
    // A neighbour of no weight may lie outside, or be NaN.
    let mix = |a: f64, t: f64, b: &dyn Fn() -> f64| if t == 0.0 { a } else { a + (b() - a) * t };
    let value = |x: usize, y: usize| f64::from(values[y * width + x]);
    let row = |y: usize| mix(value(x, y), tx, &|| value(x + 1, y));
    Some(mix(row(y), ty, &|| row(y + 1)))
}

fn check_no_infinity(image: &'static str, values: &[f32]) -> Result<(), MetricError> {
    match values.iter().position(|v| v.is_infinite()) {
        Some(index) => Err(MetricError::NotFinite { image, index, value: values[index] }),
        None => Ok(()),
    }
}

/// Flicker under a still camera: each value beside the one in its place in the picture before.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct StillFlicker {
    last: Vec<f32>,
    sums_of_squares: Vec<f64>,
    pairs: u64,
}

impl StillFlicker {
    /// No picture yet.
    pub fn new() -> StillFlicker {
        StillFlicker::default()
    }

    /// Adds the next picture of a sequence, any number of values a pixel.
    ///
    /// # Errors
    /// A picture of another length than the first, no values, a value that is not finite. Then nothing is added.
    pub fn add(&mut self, picture: &[f32]) -> Result<(), MetricError> {
        if picture.is_empty() {
            return Err(MetricError::Empty { width: 0, height: 0 });
        }
        crate::error::check_finite("test", picture)?;
        if self.last.is_empty() {
            self.sums_of_squares = vec![0.0; picture.len()];
        } else if self.last.len() != picture.len() {
            return Err(MetricError::LengthsDiffer { reference: self.last.len(), test: picture.len() });
        } else {
            for ((sum, last), value) in self.sums_of_squares.iter_mut().zip(&self.last).zip(picture) {
                let difference = f64::from(*value) - f64::from(*last);
                *sum += difference * difference;
            }
            self.pairs += 1;
        }
        self.last.clear();
        self.last.extend_from_slice(picture);
        Ok(())
    }

    /// Root mean square over all values of all pairs; `None` before there is a pair.
    pub fn rms(&self) -> Option<f64> {
        let count = self.pairs as f64 * self.sums_of_squares.len() as f64;
        (self.pairs > 0).then(|| (self.sums_of_squares.iter().sum::<f64>() / count).sqrt())
    }

    /// Root mean square over all pairs for each value; `None` before there is a pair.
    pub fn map(&self) -> Option<Vec<f32>> {
        let rms = |sum: &f64| (sum / self.pairs as f64).sqrt() as f32;
        (self.pairs > 0).then(|| self.sums_of_squares.iter().map(rms).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_images::{assert_same_on_every_thread_count, noisy_pair};

    /// Every pixel stays where it is, but for a shift.
    fn shifted(width: u32, height: u32, [dx, dy]: [f32; 2]) -> Vec<[f32; 2]> {
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        pixels.map(|(x, y)| [x as f32 + 0.5 + dx, y as f32 + 0.5 + dy]).collect()
    }

    fn plane(width: u32, height: u32, value: impl Fn(f32, f32) -> f32) -> Vec<f32> {
        shifted(width, height, [0.0; 2]).into_iter().map(|[x, y]| value(x, y)).collect()
    }

    #[test]
    fn a_sinusoid_has_its_root_mean_square() {
        // a sin(w t + phase): successive differences are 2 a sin(w / 2) cos(…), of RMS √2 a sin(w / 2) over whole periods.
        let (amplitude, steps) = (0.3f64, 16u32);
        let w = std::f64::consts::TAU / f64::from(steps);
        let expected = 2f64.sqrt() * amplitude * (w / 2.0).sin();
        let frame = |t: u32| {
            plane(12, 7, |x, y| (amplitude * (w * f64::from(t) + f64::from(x * 3.0 + y)).sin()) as f32)
        };
        let places = shifted(12, 7, [0.0; 2]);
        let (mut moving, mut still) = (Flicker::new(), StillFlicker::new());
        for t in 0..=steps {
            still.add(&frame(t)).unwrap();
            if t > 0 {
                moving.add(12, 7, &frame(t - 1), &frame(t), &places).unwrap();
            }
        }
        assert!((moving.rms().unwrap() - expected).abs() < 1e-7, "{moving:?} {expected}");
        assert!((still.rms().unwrap() - expected).abs() < 1e-7, "{expected}");
        assert!(still.map().unwrap().iter().all(|v| (f64::from(*v) - expected).abs() < 1e-6));
        assert_eq!(moving.count(), 16 * 84);
    }

    #[test]
    fn a_ramp_that_moves_along_does_not_flicker() {
        let (dx, dy) = (2.375f32, -1.625);
        let ramp = |x: f32, y: f32| 0.25 * x - 0.5 * y + 3.0;
        let before = plane(20, 15, ramp);
        let after = plane(20, 15, |x, y| ramp(x - dx, y - dy));
        let mut flicker = Flicker::new();
        flicker.add(20, 15, &before, &after, &shifted(20, 15, [dx, dy])).unwrap();
        assert_eq!(flicker.rms(), Some(0.0));
        // Columns 0 … 16 stay inside to the right, rows 2 … 14 to the top.
        assert_eq!(flicker.count(), 17 * 13);
        // With the wrong motion it does: by the ramp's slope times the way.
        let mut wrong = Flicker::new();
        wrong.add(20, 15, &before, &after, &shifted(20, 15, [dx - 1.0, dy])).unwrap();
        assert!((wrong.rms().unwrap() - 0.25).abs() < 1e-6);
    }

    #[test]
    fn what_is_masked_or_outside_is_not_compared() {
        let before = [1.0, 2.0, f32::NAN, 4.0];
        let after = [1.5, f32::NAN, 3.0, 4.0];
        let add = |places: [[f32; 2]; 4]| {
            let mut flicker = Flicker::new();
            flicker.add(4, 1, &before, &after, &places).unwrap();
            (flicker.count(), flicker.rms())
        };
        let nowhere = [f32::NAN, 0.5];
        // In place: the second touches a NaN, the third is one.
        assert_eq!(add([[0.5, 0.5], [1.5, 0.5], [2.5, 0.5], [3.5, 0.5]]), (2, Some((0.25f64 / 2.0).sqrt())));
        assert_eq!(add([nowhere, nowhere, nowhere, [3.5, 0.5]]), (1, Some(0.0)));
        // Between two, of which one is NaN; off to the left, the right, above and below.
        assert_eq!(add([[1.0, 0.5], [0.49, 0.5], [0.5, 0.5], [3.51, 0.5]]), (0, None));
        assert_eq!(add([[0.5, 0.4], [0.5, 0.6], [f32::INFINITY, 0.5], [2.5, f32::NEG_INFINITY]]), (0, None));
        // The last pixel has no neighbour and needs none.
        assert_eq!(add([nowhere, nowhere, nowhere, [3.0, 0.5]]), (1, Some(0.5)));
    }

    #[test]
    fn pairs_add_up_and_threads_do_not_matter() {
        let (a, b) = noisy_pair(50, 40);
        let places = shifted(50, 40, [0.3, -0.7]);
        let run = || {
            let mut flicker = Flicker::new();
            flicker.add(50, 40, &a, &b, &places).unwrap();
            flicker.add(50, 40, &b, &a, &places).unwrap();
            (flicker.rms().unwrap().to_bits(), flicker.count())
        };
        assert_same_on_every_thread_count(run);
        assert_eq!(run().1, 2 * 49 * 39);
    }

    #[test]
    fn pictures_that_do_not_fit_are_refused() {
        let mut flicker = Flicker::new();
        let places = [[0.5; 2]; 2];
        let one = [0.5f32; 2];
        assert!(matches!(flicker.add(2, 2, &one, &one, &places), Err(MetricError::WrongLength { .. })));
        assert!(matches!(flicker.add(2, 1, &one, &one, &places[1..]), Err(MetricError::MaskLength { .. })));
        let infinite = [0.5, f32::INFINITY];
        let error = flicker.add(2, 1, &one, &infinite, &places).unwrap_err();
        assert!(matches!(error, MetricError::NotFinite { image: "test", index: 1, .. }));
        assert_eq!((flicker.rms(), flicker.count()), (None, 0));

        let mut still = StillFlicker::new();
        assert!(matches!(still.add(&[]), Err(MetricError::Empty { .. })));
        still.add(&one).unwrap();
        assert_eq!((still.rms(), still.map()), (None, None));
        assert!(matches!(still.add(&one[1..]), Err(MetricError::LengthsDiffer { reference: 2, test: 1 })));
        assert!(matches!(still.add(&infinite), Err(MetricError::NotFinite { .. })));
        still.add(&[1.0, 0.5]).unwrap();
        assert_eq!(still.map(), Some(vec![0.5, 0.0]));
    }
}
