//! A blur that keeps to surfaces: along rows, then along columns, weighted by a bell and by how near two samples lie to the plane of each other.

use rayon::prelude::*;

use crate::gbuffer::Screen;

/// A slope is gentler than another if it is less than this part of it.
const MUCH_GENTLER: f32 = 0.9;

/// How wide, and how strictly within surfaces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bilateral {
    /// Taps on either side of a sample, 0 (no blur) … 16.
    pub(crate) taps: u32,
    /// Samples of the picture between two taps, 1 … 16.
    pub(crate) stride: u32,
    /// What distances may differ by before a neighbour counts nothing, metres, > 0. Slopes are foretold: see [`Bilateral::smooth`].
    pub(crate) tolerance_m: f32,
}

impl Bilateral {
    /// Of a method that looks so far around: what lies closer together than a fifth of that is one surface.
    pub(crate) fn within(radius_m: f32, taps: u32) -> Bilateral {
        Bilateral { taps, stride: 1, tolerance_m: 0.2 * radius_m }
    }

    /// Standard deviation of the taps' bell, in taps.
    pub(crate) fn sigma_taps(&self) -> f64 {
        0.5 * f64::from(self.taps) + 0.5
    }

    /// Smooths one value a sample. Whether a neighbour belongs to the same surface is asked of the difference between its distance and the one that the sample's
    /// own slope foretells, so that floors which are seen at a grazing angle are smoothed, too. The background stays as it is.
    pub(crate) fn smooth(&self, screen: &Screen, values: &[f32]) -> Vec<f32> {
        let (columns, rows) = (screen.columns() as usize, screen.rows() as usize);
        if self.taps == 0 {
            return values.to_vec();
        }
        let bell: Vec<f32> = (0..=self.taps)
            .map(|tap| {
                let x = f64::from(tap) / self.sigma_taps();
                libm::exp(-0.5 * x * x) as f32
            })
            .collect();
        let distances_m = screen.distances_m();
        let mut across = vec![0.0; values.len()];
        across.par_chunks_mut(columns).enumerate().for_each(|(row, out)| {
            for (column, out) in out.iter_mut().enumerate() {
                let index = |at: usize| row * columns + at;
                *out = self.at(&bell, column, columns, |at| (values[index(at)], distances_m[index(at)]));
            }
        });
        let mut both = vec![0.0; values.len()];
        both.par_chunks_mut(columns).enumerate().for_each(|(row, out)| {
            for (column, out) in out.iter_mut().enumerate() {
                let index = |at: usize| at * columns + column;
                *out = self.at(&bell, row, rows, |at| (across[index(at)], distances_m[index(at)]));
            }
        });
        both
    }

    /// The mean about `at` of `count` samples, each a value and a distance.
    fn at(&self, bell: &[f32], at: usize, count: usize, sample: impl Fn(usize) -> (f32, f32)) -> f32 {
        let (value, distance) = sample(at);
        if !distance.is_finite() {
            return value;
        }
        // The gentler of the slopes to both sides: the other may lead over an edge. Of two that are about alike the first, so that rounding decides nothing.
        let slopes = [at.checked_sub(1), Some(at + 1).filter(|next| *next < count)].map(|next| {
            let next = next?;
            Some((sample(next).1 - distance) * (next as f32 - at as f32)).filter(|slope| slope.is_finite())
        });
        let slope = slopes
            .into_iter()
            .flatten()
            .reduce(|a, b| if b.abs() < MUCH_GENTLER * a.abs() { b } else { a })
            .unwrap_or(0.0);
        let (mut sum, mut weights) = (bell[0] * value, bell[0]);
        for (tap, bell) in bell.iter().enumerate().skip(1) {
            let step = tap * self.stride as usize;
            let before = at.checked_sub(step).map(|other| (other, -(step as f32)));
            let after = Some((at + step, step as f32)).filter(|(other, _)| *other < count);
            for (other, by) in [before, after].into_iter().flatten() {
                let (value, found) = sample(other);
                if !found.is_finite() {
                    continue;
                }
                let off = (found - distance - slope * by).abs().min((found - distance).abs());
                let weight = bell * (1.0 - off / self.tolerance_m).max(0.0);
                sum += weight * value;
                weights += weight;
            }
        }
        sum / weights
    }
}
