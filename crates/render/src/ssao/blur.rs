//! A Gaussian blur along rows, then along columns. It sees values alone: what lies side by side runs together.

use rayon::prelude::*;

/// Weights of a sample and of its neighbours at distance 1, 2, … on either side; all together sum to 1.
pub(super) fn weights(width: u32, sigma: f32) -> Vec<f32> {
    let sigma = f64::from(sigma);
    let bell = |distance: u32| {
        let x = f64::from(distance) / sigma;
        libm::exp(-0.5 * x * x)
    };
    let half: Vec<f64> = (0..=width / 2).map(bell).collect();
    let sum = half[0] + 2.0 * half[1..].iter().sum::<f64>();
    half.into_iter().map(|weight| (weight / sum) as f32).collect()
}

/// Blurs rows of `columns` values with `width` (odd) taps each way. Beyond the border values repeat.
pub(super) fn blur(values: &[f32], columns: usize, width: u32, sigma: f32) -> Vec<f32> {
    let weights = weights(width, sigma);
    let rows = values.len() / columns;
    let mut across = vec![0.0; values.len()];
    across.par_chunks_mut(columns).zip(values.par_chunks(columns)).for_each(|(out, row)| {
        for (column, out) in out.iter_mut().enumerate() {
            *out = sum(&weights, column, columns, |i| row[i]);
        }
    });
    let mut both = vec![0.0; values.len()];
    both.par_chunks_mut(columns).enumerate().for_each(|(row, out)| {
        for (column, out) in out.iter_mut().enumerate() {
            *out = sum(&weights, row, rows, |i| across[i * columns + column]);
        }
    });
    both
}

/// Weighted sum about `at` of `count` values, the nearest first.
fn sum(weights: &[f32], at: usize, count: usize, value: impl Fn(usize) -> f32) -> f32 {
    let mut sum = weights[0] * value(at);
    for (distance, weight) in weights.iter().enumerate().skip(1) {
        sum += weight * (value(at.saturating_sub(distance)) + value((at + distance).min(count - 1)));
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_value_spreads_as_a_bell_and_a_constant_stays() {
        let (columns, rows) = (11, 9);
        let mut values = vec![0.0; columns * rows];
        values[4 * columns + 5] = 1.0;
        let blurred = blur(&values, columns, 5, 2.0);
        for row in 0..rows {
            for column in 0..columns {
                let (x, y) = (column as f64 - 5.0, row as f64 - 4.0);
                let inside = x.abs() <= 2.0 && y.abs() <= 2.0;
                // 1 + 2 (exp(−1/8) + exp(−1/2)) = 3.97805.
                let expected =
                    if inside { (-(x * x + y * y) / 8.0).exp() / (3.978_055 * 3.978_055) } else { 0.0 };
                let found = f64::from(blurred[row * columns + column]);
                assert!((found - expected).abs() < 1e-6, "{column}, {row}: {found}, not {expected}");
            }
        }
        for (columns, rows, width) in [(1, 1, 5), (3, 7, 63), (7, 3, 5)] {
            for value in blur(&vec![0.75; columns * rows], columns, width, 2.0) {
                assert!((value - 0.75).abs() < 1e-6, "{columns} x {rows}, {width}: {value}");
            }
        }
        assert_eq!(blur(&values, columns, 1, 2.0), values, "a width of 1 is no blur");
    }
}
