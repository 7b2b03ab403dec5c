//! Visibility and distance of a sample in three bytes, as the reconstruction reads them (end of sec. 2.3).

use rayon::prelude::*;

use crate::gbuffer::Screen;

/// Visibility in 255ths, then the distance as a part of `farthest_m`: in 256ths, and the rest of that in 255ths of one. What is farther, and
/// the background, is at `farthest_m`.
pub fn pack(screen: &Screen, visibility: &[f32], farthest_m: f32) -> Vec<[u8; 3]> {
    let packed = |(value, distance): (&f32, &f32)| {
        let key = 256.0 * (distance / farthest_m).clamp(0.0, 1.0);
        let whole = key.floor().min(255.0);
        [(value * 255.0).round() as u8, whole as u8, ((key - whole) * 255.0).round() as u8]
    };
    visibility.par_iter().zip(screen.distances_m()).with_min_len(1024).map(packed).collect()
}

/// Visibility 0 … 1, and the distance as a part of the farthest, 0 … 1, to ±1/131,000.
pub fn unpack([value, whole, rest]: [u8; 3]) -> (f32, f32) {
    (f32::from(value) / 255.0, (f32::from(whole) + f32::from(rest) / 255.0) / 256.0)
}
