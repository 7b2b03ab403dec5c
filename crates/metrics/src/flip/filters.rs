//! The eye's filters as weights along one axis: contrast sensitivities, and detectors of edges and points.

/// Contrast sensitivities as sums of Gaussians a √(π/b) e^(−π² d² / b), d in degrees ([Andersson2020] tab. 1).
const ACHROMATIC_B: f64 = 0.0047;
const RED_GREEN_B: f64 = 0.0053;
const BLUE_YELLOW: [(f64, f64); 2] = [(34.1, 0.04), (13.5, 0.025)];

/// Width in degrees of what is seen as an edge or a point ([Andersson2020] sec. 5.2).
const FEATURE_DEGREES: f64 = 0.082;

/// Weights along one axis, an odd number; the middle one belongs to the pixel itself.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Kernel(Vec<f32>);

impl Kernel {
    /// Pixels to either side.
    pub(super) fn radius(&self) -> usize {
        self.0.len() / 2
    }

    /// Adds to `sums` the weighted numbers of `sources`: one slice for each weight, as long as `sums`.
    pub(super) fn add(&self, sums: &mut [f32], sources: &[&[f32]]) {
        // Sums of a few pixels side by side stay in registers. Every sum is in the order of the weights.
        const LANES: usize = 16;
        let (groups, rest) = sums.as_chunks_mut::<LANES>();
        let done = groups.len() * LANES;
        for (group, sums) in groups.iter_mut().enumerate() {
            let mut kept = *sums;
            for (weight, source) in self.0.iter().zip(sources) {
                let values = &source[group * LANES..(group + 1) * LANES];
                kept.iter_mut().zip(values).for_each(|(sum, value)| *sum += weight * value);
            }
            *sums = kept;
        }
        for (weight, source) in self.0.iter().zip(sources) {
            rest.iter_mut().zip(&source[done..]).for_each(|(sum, value)| *sum += weight * value);
        }
    }

    fn from(values: impl Iterator<Item = f64>) -> Kernel {
        Kernel(values.map(|v| v as f32).collect())
    }
}

/// All filters for one viewing condition. Those in two dimensions are products of two of these, or sums of products.
#[derive(Debug, Clone)]
pub(super) struct Filters {
    pub(super) achromatic: Kernel,
    pub(super) red_green: Kernel,
    /// Two Gaussians, for rows.
    pub(super) blue_yellow: [Kernel; 2],
    /// The same for columns, times the share of each in the sum.
    pub(super) blue_yellow_shares: [Kernel; 2],
    /// A Gaussian, its first derivative and its second, of the width of features.
    pub(super) smooth: Kernel,
    pub(super) edge: Kernel,
    pub(super) point: Kernel,
}

impl Filters {
    pub(super) fn new(pixels_per_degree: f32) -> Filters {
        let ppd = f64::from(pixels_per_degree);
        // Three standard deviations of the widest: b = 2 π² σ².
        let widest_b = BLUE_YELLOW[0].1;
        let pi = std::f64::consts::PI;
        let radius = (3.0 * (widest_b / (2.0 * pi * pi)).sqrt() * ppd).ceil() as i32;
        let csf = |b: f64| -> Vec<f64> {
            (-radius..=radius)
                .map(|i| {
                    let degrees = f64::from(i) / ppd;
                    libm::exp(-pi * pi * degrees * degrees / b)
                })
                .collect()
        };
        let normalized = |values: &[f64], share: f64| {
            let sum: f64 = values.iter().sum();
            Kernel::from(values.iter().map(|v| share * v / sum))
        };
        let blue_yellow = BLUE_YELLOW.map(|(_, b)| csf(b));
        let amounts: [f64; 2] = std::array::from_fn(|i| {
            let (a, b) = BLUE_YELLOW[i];
            let sum: f64 = blue_yellow[i].iter().sum();
            a * (pi / b).sqrt() * (sum * sum)
        });
        let share = |i: usize| amounts[i] / (amounts[0] + amounts[1]);

        let sigma = 0.5 * FEATURE_DEGREES * ppd;
        let radius = (3.0 * sigma).ceil() as i32;
        let places = || (-radius..=radius).map(f64::from);
        let bell = |x: f64| libm::exp(-x * x / (2.0 * sigma * sigma));
        let smooth: Vec<f64> = places().map(bell).collect();
        let edge: Vec<f64> = places().map(|x| -x * bell(x)).collect();
        let point: Vec<f64> = places().map(|x| (x * x / (sigma * sigma) - 1.0) * bell(x)).collect();
        Filters {
            achromatic: normalized(&csf(ACHROMATIC_B), 1.0),
            red_green: normalized(&csf(RED_GREEN_B), 1.0),
            blue_yellow_shares: [0, 1].map(|i| normalized(&blue_yellow[i], share(i))),
            blue_yellow: blue_yellow.map(|values| normalized(&values, 1.0)),
            smooth: normalized(&smooth, 1.0),
            edge: balanced(&edge),
            point: balanced(&point),
        }
    }

    /// Pixels to either side that the widest filter takes in.
    pub(super) fn reach(&self) -> usize {
        self.achromatic.radius().max(self.smooth.radius())
    }
}

/// Scales positive weights to a sum of 1 and negative ones to −1.
fn balanced(values: &[f64]) -> Kernel {
    let sum = |sign: f64| values.iter().map(|v| (v * sign).max(0.0)).sum::<f64>();
    let (positive, negative) = (sum(1.0), sum(-1.0));
    Kernel::from(values.iter().map(|v| if *v > 0.0 { v / positive } else { v / negative }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_sum_to_what_they_must() {
        for ppd in [1.0, 5.0, 67.0, 140.0, 1000.0] {
            let f = Filters::new(ppd);
            let sum = |kernel: &Kernel| kernel.0.iter().map(|w| f64::from(*w)).sum::<f64>();
            for kernel in [&f.achromatic, &f.red_green, &f.blue_yellow[0], &f.blue_yellow[1], &f.smooth] {
                assert!((sum(kernel) - 1.0).abs() < 1e-5);
            }
            assert!((sum(&f.blue_yellow_shares[0]) + sum(&f.blue_yellow_shares[1]) - 1.0).abs() < 1e-5);
            for kernel in [&f.edge, &f.point] {
                let positive: f32 = kernel.0.iter().filter(|w| **w > 0.0).sum();
                assert!((positive - 1.0).abs() < 1e-5 && sum(kernel).abs() < 1e-5, "{ppd}: {kernel:?}");
            }
        }
        // 3 √(0.04 / 2π²) · 67 = 9.05 and 1.5 · 0.082 · 67 = 8.2, rounded up.
        let usual = Filters::new(67.0);
        assert_eq!((usual.achromatic.radius(), usual.smooth.radius(), usual.reach()), (10, 9, 10));
    }

    #[test]
    fn sums_do_not_depend_on_where_a_pixel_lies() {
        let kernel = Kernel(vec![0.25, 0.5, -1.25]);
        for width in [1, 15, 16, 17, 40] {
            let values: Vec<f32> = (0..width + 2).map(|i| (i * i % 7) as f32).collect();
            let mut sums = vec![1.0; width];
            kernel.add(&mut sums, &[0, 1, 2].map(|i| &values[i..i + width]));
            for (x, sum) in sums.iter().enumerate() {
                assert_eq!(*sum, 1.0 + 0.25 * values[x] + 0.5 * values[x + 1] - 1.25 * values[x + 2]);
            }
        }
    }
}
