//! Two passes that smooth without crossing edges: along rows, then along columns (sec. 2.4).

use rayon::prelude::*;

use super::{SaoParams, unpack};

/// Standard deviation of the taps' bell, in taps.
const SIGMA_TAPS: f64 = 2.0;

/// Visibility 0 … 1 of each sample, from packed samples of a picture with so many columns. The parameters must have passed
/// [`SaoParams::check`].
pub fn reconstruct(columns: usize, packed: &[[u8; 3]], params: &SaoParams) -> Vec<f32> {
    let bell = |tap: u32| {
        let x = f64::from(tap) / SIGMA_TAPS;
        libm::exp(-0.5 * x * x) as f32
    };
    let bell: Vec<f32> = (0..=params.blur_taps).map(bell).collect();
    let rows = packed.len() / columns;
    let stride = params.blur_stride as usize;
    let mut across = vec![[0; 3]; packed.len()];
    across.par_chunks_mut(columns).zip(packed.par_chunks(columns)).for_each(|(out, row)| {
        for (column, out) in out.iter_mut().enumerate() {
            let value = smooth(&bell, params.sharpness, column, columns, stride, |at| row[at]);
            // Eight bits between the passes, as in the paper's texture.
            *out = [(value * 255.0).round() as u8, row[column][1], row[column][2]];
        }
    });
    let mut both = vec![0.0; packed.len()];
    both.par_chunks_mut(columns).enumerate().for_each(|(row, out)| {
        for (column, out) in out.iter_mut().enumerate() {
            *out = smooth(&bell, params.sharpness, row, rows, stride, |at| across[at * columns + column]);
        }
    });
    both
}

/// The mean about `at` of `count` samples, weighted by a bell and by how near they lie to the eye.
fn smooth(
    bell: &[f32],
    sharpness: f32,
    at: usize,
    count: usize,
    stride: usize,
    packed: impl Fn(usize) -> [u8; 3],
) -> f32 {
    let (value, key) = unpack(packed(at));
    let (mut sum, mut weights) = (bell[0] * value, bell[0]);
    for (tap, bell) in bell.iter().enumerate().skip(1) {
        let before = at.checked_sub(tap * stride);
        let after = Some(at + tap * stride).filter(|after| *after < count);
        for other in [before, after].into_iter().flatten() {
            let (value, other_key) = unpack(packed(other));
            let weight = bell * (1.0 - sharpness * (other_key - key).abs()).max(0.0);
            sum += weight * value;
            weights += weight;
        }
    }
    sum / weights
}
