//! LPIPS ([Zhang2018]): how different two pictures are to a network that was taught what people find different.
//!
//! Takes the weights as the bytes of a file, and pairs of sRGB pictures; returns one number a pair, and if asked for
//! a map of where it comes from. `README.md` has network, equations and limits.
//!
//! [Zhang2018]: https://doi.org/10.1109/CVPR.2018.00068

mod conv;
mod network;
#[cfg(test)]
mod tests;
mod weights;

use crate::error::{MetricError, check_size};
use network::{MIN_SIDE, Network, TapMap};
use weights::Weights;
pub use weights::WeightsError;

/// Least width and height of a picture that [`Lpips`] takes, in pixels.
pub const LPIPS_MIN_SIDE: u32 = MIN_SIDE;

/// Most pixels of a picture that [`Lpips`] takes: about 130 bytes are needed for each.
pub const LPIPS_MAX_PIXELS: u64 = 1 << 24;

/// LPIPS v0.1 over SqueezeNet 1.1, with its weights, ready to compare pictures.
pub struct Lpips {
    network: Network,
}

impl std::fmt::Debug for Lpips {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Lpips").finish_non_exhaustive()
    }
}

/// The outcome of [`Lpips::distance_map`].
#[derive(Debug, Clone, PartialEq)]
pub struct LpipsMap {
    /// What [`Lpips::distance`] gives.
    pub distance: f64,
    /// A number ≥ 0 for every pixel, rows from the top: the sum of the taps' maps, each resampled bilinearly to the
    /// picture's size. Its mean is near `distance`, not equal to it.
    pub map: Vec<f32>,
}

impl Lpips {
    /// Reads the weights: a safetensors file with torchvision's `features.*`, the `lin*` of LPIPS v0.1 and its
    /// scaling layer, all of 32-bit floats. Other tensors in it are not looked at.
    ///
    /// # Errors
    /// Bytes that are no such file, a tensor that is missing, of another type or shape, or holds what is no weight.
    pub fn from_safetensors(bytes: &[u8]) -> Result<Lpips, WeightsError> {
        Ok(Lpips { network: Network::new(&Weights::new(bytes)?)? })
    }

    /// The distance of two pictures: 0 when equal, above 1 only for pictures that have nothing in common.
    ///
    /// Both are sRGB-encoded, 3 bytes a pixel, in rows from the top.
    ///
    /// # Errors
    /// Sizes that do not fit, a side under [`LPIPS_MIN_SIDE`], more pixels than [`LPIPS_MAX_PIXELS`], weights so
    /// large that the network's numbers overflow.
    pub fn distance(
        &self,
        width: u32,
        height: u32,
        reference_srgb8: &[u8],
        test_srgb8: &[u8],
    ) -> Result<f64, MetricError> {
        sum(&self.taps_srgb8(width, height, reference_srgb8, test_srgb8)?)
    }

    /// As [`Lpips::distance`], with a map of where in the picture it comes from.
    ///
    /// # Errors
    /// As [`Lpips::distance`].
    pub fn distance_map(
        &self,
        width: u32,
        height: u32,
        reference_srgb8: &[u8],
        test_srgb8: &[u8],
    ) -> Result<LpipsMap, MetricError> {
        let taps = self.taps_srgb8(width, height, reference_srgb8, test_srgb8)?;
        let distance = sum(&taps)?;
        let mut map = vec![0.0; width as usize * height as usize];
        taps.iter().for_each(|tap| add_resampled(tap, width as usize, &mut map));
        Ok(LpipsMap { distance, map })
    }

    fn taps_srgb8(
        &self,
        width: u32,
        height: u32,
        reference: &[u8],
        test: &[u8],
    ) -> Result<Vec<TapMap>, MetricError> {
        // LPIPS maps a byte b to b / 127.5 - 1.
        self.taps(width, height, reference, test, |byte| f32::from(byte) / 127.5 - 1.0)
    }

    /// The taps' maps of pictures whose values `unit` takes to −1 … 1.
    fn taps<T: Copy + Sync>(
        &self,
        width: u32,
        height: u32,
        reference: &[T],
        test: &[T],
        unit: impl Fn(T) -> f32 + Sync,
    ) -> Result<Vec<TapMap>, MetricError> {
        check_size(width, height, 3, reference, test)?;
        if width < MIN_SIDE || height < MIN_SIDE {
            return Err(MetricError::TooSmall { width, height, minimum: MIN_SIDE });
        }
        if u64::from(width) * u64::from(height) > LPIPS_MAX_PIXELS {
            return Err(MetricError::TooLarge { width, height, maximum: LPIPS_MAX_PIXELS });
        }
        let (width, height) = (width as usize, height as usize);
        let row = |picture: &[T], y: usize, out: &mut [f32]| {
            let values = &picture[y * width * 3..(y + 1) * width * 3];
            out.iter_mut().zip(values).for_each(|(out, value)| *out = unit(*value));
        };
        Ok(self.network.taps(width, height, [&|y, out| row(reference, y, out), &|y, out| row(test, y, out)]))
    }
}

/// The distance: the sum of the taps' means.
fn sum(taps: &[TapMap]) -> Result<f64, MetricError> {
    let distance: f64 = taps.iter().map(TapMap::mean).sum();
    if distance.is_finite() { Ok(distance) } else { Err(MetricError::Overflow { metric: "LPIPS" }) }
}

/// Adds a tap's map, resampled bilinearly to pictures `width` wide: pixels are squares that both pictures divide
/// alike, and outside of the centres of the outermost ones their value holds.
fn add_resampled(tap: &TapMap, width: usize, map: &mut [f32]) {
    use rayon::prelude::*;

    let height = map.len() / width;
    // Both neighbours of a place on a side, and the weight of the second.
    let places = |to: usize, from: usize| {
        let scale = from as f64 / to as f64;
        (0..to).map(move |i| {
            let at = ((i as f64 + 0.5) * scale - 0.5).clamp(0.0, (from - 1) as f64);
            let first = at as usize;
            (first, (first + 1).min(from - 1), (at - first as f64) as f32)
        })
    };
    let columns: Vec<(usize, usize, f32)> = places(width, tap.width).collect();
    let rows: Vec<(usize, usize, f32)> = places(height, tap.height).collect();
    let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
    map.par_chunks_mut(width).zip(&rows).for_each(|(out, &(y0, y1, ty))| {
        let [upper, lower] = [y0, y1].map(|y| &tap.values[y * tap.width..(y + 1) * tap.width]);
        for (out, &(x0, x1, tx)) in out.iter_mut().zip(&columns) {
            *out += mix(mix(upper[x0], upper[x1], tx), mix(lower[x0], lower[x1], tx), ty);
        }
    });
}
