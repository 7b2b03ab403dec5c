//! Figures over frames, each with an interval: how much it would change with other frames of the same path.

use super::results::Figure;

/// 97.5 % quantiles of Student's t distribution for 1 … 30 degrees of freedom.
const T975: [f64; 30] = [
    12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179, 2.160, 2.145, 2.131,
    2.120, 2.110, 2.101, 2.093, 2.086, 2.080, 2.074, 2.069, 2.064, 2.060, 2.056, 2.052, 2.048, 2.045, 2.042,
];

/// The quantile for any number of degrees of freedom above 0.
fn t975(degrees: usize) -> f64 {
    // Beyond the table the first term of the expansion in 1 / degrees is exact to three digits.
    T975.get(degrees - 1).copied().unwrap_or(1.960 + 2.37 / degrees as f64)
}

/// A statistic of `count` frames and its 95 % interval by the jackknife: `of` gets the frame to leave out.
///
/// The jackknife ([Efron1982], sec. 3) also fits what is no mean of frames, as a pooled PSNR is. It takes frames as independent: neighbours
/// along a path are not quite, so that intervals are a little narrow for frames that lie close.
///
/// [Efron1982] Efron: *The Jackknife, the Bootstrap and Other Resampling Plans*, SIAM, 1982.
pub(super) fn jackknife(count: usize, of: impl Fn(Option<usize>) -> Option<f64>) -> Figure {
    let value = of(None);
    let without: Option<Vec<f64>> = (0..count).map(|left_out| of(Some(left_out))).collect();
    let ci95 = match (value, without) {
        // Two say so little that their interval would only confuse.
        (Some(_), Some(without)) if count > 2 => {
            let n = count as f64;
            let mean = without.iter().sum::<f64>() / n;
            let squares = without.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>();
            Some(t975(count - 1) * ((n - 1.0) / n * squares).sqrt())
        }
        _ => None,
    };
    Figure { value, ci95 }
}

/// The mean of one number a frame.
pub(super) fn mean(values: &[f64]) -> Figure {
    jackknife(values.len(), |left_out| {
        let kept = values.iter().enumerate().filter(|(i, _)| Some(*i) != left_out).map(|(_, v)| *v);
        let (sum, count) = kept.fold((0.0, 0.0), |(s, c), v| (s + v, c + 1.0));
        (count > 0.0).then(|| sum / count)
    })
}

/// The mean of one number a frame, where every frame has one.
pub(super) fn mean_of_all(values: &[Option<f64>]) -> Option<Figure> {
    let values: Option<Vec<f64>> = values.iter().copied().collect();
    values.filter(|v| !v.is_empty()).map(|v| mean(&v))
}

/// The root of the mean square, where any frame has a value.
pub(super) fn root_mean_square(values: &[Option<f64>]) -> Option<Figure> {
    let squares: Vec<f64> = values.iter().flatten().map(|v| v * v).collect();
    if squares.is_empty() {
        return None;
    }
    Some(jackknife(squares.len(), |left_out| mean_without(&squares, left_out).map(f64::sqrt)))
}

fn mean_without(values: &[f64], left_out: Option<usize>) -> Option<f64> {
    let kept = values.iter().enumerate().filter(|(i, _)| Some(*i) != left_out).map(|(_, v)| *v);
    let (sum, count) = kept.fold((0.0, 0.0), |(s, c), v| (s + v, c + 1.0));
    (count > 0.0).then(|| sum / count)
}

/// The mean squared error of one frame and its weight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FrameError {
    pub(super) mse: f64,
    pub(super) weight: f64,
}

impl FrameError {
    /// From a frame's PSNR (peak 1); without one the pictures are equal.
    pub(super) fn new(psnr_db: Option<f64>, weight: f64) -> FrameError {
        FrameError { mse: psnr_db.map_or(0.0, |db| libm::pow(10.0, -db / 10.0)), weight }
    }
}

/// The pooled mean squared error, without one frame; `None` without weight.
pub(super) fn pooled_mse(errors: &[FrameError], left_out: Option<usize>) -> Option<f64> {
    let kept = errors.iter().enumerate().filter(|(i, _)| Some(*i) != left_out).map(|(_, e)| e);
    let (sum, weight) = kept.fold((0.0, 0.0), |(s, w), e| (s + e.mse * e.weight, w + e.weight));
    (weight > 0.0).then(|| sum / weight)
}

/// PSNR of the pooled error, dB; no value where all frames are equal.
pub(super) fn pooled_psnr(errors: &[FrameError]) -> Figure {
    jackknife(errors.len(), |left_out| pooled_mse(errors, left_out).and_then(psnr_of))
}

/// PSNR of a mean squared error, peak 1; `None` for no error.
pub(super) fn psnr_of(mse: f64) -> Option<f64> {
    (mse > 0.0).then(|| -10.0 * libm::log10(mse))
}

/// How much two settings differ in pooled PSNR, a − b, frame by frame: what both have in common does not widen the interval.
pub(super) fn psnr_difference(a: &[FrameError], b: &[FrameError]) -> Figure {
    jackknife(a.len().min(b.len()), |left_out| {
        let of = |errors| pooled_mse(errors, left_out).and_then(psnr_of);
        Some(of(a)? - of(b)?)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_jackknife_of_a_mean_is_the_usual_interval() {
        // Mean 5, sample deviation sqrt(20 / 3), t of 3 degrees 3.182.
        let figure = mean(&[2.0, 4.0, 6.0, 8.0]);
        assert_eq!(figure.value, Some(5.0));
        let expected = 3.182 * (20.0f64 / 3.0 / 4.0).sqrt();
        assert!((figure.ci95.unwrap() - expected).abs() < 1e-12, "{figure:?}");
        assert_eq!(mean(&[3.0]), Figure { value: Some(3.0), ci95: None });
        assert_eq!(mean(&[]), Figure::default());
        assert!((t975(31) - 2.0395).abs() < 4e-3 && (t975(120) - 1.9799).abs() < 1e-3);
    }

    #[test]
    fn pooled_psnr_is_that_of_all_pixels_together() {
        let errors = [(20.0, 100.0), (40.0, 300.0), (30.0, 0.0)].map(|(db, w)| FrameError::new(Some(db), w));
        let mse = (0.01 * 100.0 + 0.0001 * 300.0) / 400.0;
        let figure = pooled_psnr(&errors);
        assert!((figure.value.unwrap() + 10.0 * f64::log10(mse)).abs() < 1e-9);
        assert!(figure.ci95.unwrap() > 10.0, "frames that differ so much say little");
        assert_eq!(pooled_psnr(&errors[..2]).ci95, None);
        // Equal pictures have no finite PSNR.
        assert_eq!(pooled_psnr(&[FrameError::new(None, 5.0)]), Figure::default());
        assert_eq!(pooled_psnr(&[]), Figure::default());
    }

    #[test]
    fn what_two_settings_share_does_not_widen_their_difference() {
        let a: Vec<FrameError> = [20.0, 30.0, 25.0].map(|db| FrameError::new(Some(db), 10.0)).to_vec();
        let b: Vec<FrameError> = [19.0, 29.0, 24.0].map(|db| FrameError::new(Some(db), 10.0)).to_vec();
        let difference = psnr_difference(&a, &b);
        assert!((difference.value.unwrap() - 1.0).abs() < 1e-9);
        assert!(difference.ci95.unwrap() < 1e-9);
        assert!(pooled_psnr(&a).ci95.unwrap() > 3.0);
    }

    #[test]
    fn roots_of_mean_squares_skip_frames_without_a_value() {
        assert_eq!(mean(&[3.0, 4.0]).ci95, None);
        let figure = root_mean_square(&[Some(3.0), None, Some(4.0)]).unwrap();
        assert!((figure.value.unwrap() - 12.5f64.sqrt()).abs() < 1e-12);
        assert_eq!(root_mean_square(&[None]), None);
        assert_eq!(mean_of_all(&[Some(1.0), None]), None);
    }
}
