//! Means with 95 % intervals.

use serde::Serialize;

/// A mean and half of its 95 % interval.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub(super) struct Figure {
    /// Absent without values.
    pub(super) value: Option<f64>,
    /// Absent under three values, which say so little that an interval would only confuse.
    pub(super) ci95: Option<f64>,
}

/// 97.5 % quantiles of Student's t distribution for 1 … 30 degrees of freedom.
const T975: [f64; 30] = [
    12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179, 2.160, 2.145, 2.131,
    2.120, 2.110, 2.101, 2.093, 2.086, 2.080, 2.074, 2.069, 2.064, 2.060, 2.056, 2.052, 2.048, 2.045, 2.042,
];

/// The mean of independent values. Pictures of one sequence are not quite, so that intervals are a little narrow.
pub(super) fn mean(values: &[f64]) -> Figure {
    if values.is_empty() {
        return Figure::default();
    }
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let ci95 = (values.len() > 2).then(|| {
        let degrees = values.len() - 1;
        // Beyond the table the first term of the expansion in 1 / degrees is exact to three digits.
        let t = T975.get(degrees - 1).copied().unwrap_or(1.960 + 2.37 / degrees as f64);
        let squares: f64 = values.iter().map(|v| (v - mean) * (v - mean)).sum();
        t * (squares / (n * degrees as f64)).sqrt()
    });
    Figure { value: Some(mean), ci95 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_have_the_usual_interval() {
        // Mean 5, sample deviation √(20 / 3), t of 3 degrees 3.182.
        let figure = mean(&[2.0, 4.0, 6.0, 8.0]);
        assert_eq!(figure.value, Some(5.0));
        assert!((figure.ci95.unwrap() - 3.182 * (20.0f64 / 12.0).sqrt()).abs() < 1e-12);
        assert_eq!(mean(&[1.0, 3.0]), Figure { value: Some(2.0), ci95: None });
        assert_eq!(mean(&[]), Figure::default());
        // 100 values, half of them 0 and half 1: t of 99 degrees is 1.984.
        let halves: Vec<f64> = (0..100).map(|i| f64::from(i % 2)).collect();
        assert!((mean(&halves).ci95.unwrap() - 1.984 * (25.0f64 / 9900.0).sqrt()).abs() < 1e-4);
    }
}
