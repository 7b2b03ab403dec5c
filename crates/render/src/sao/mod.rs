//! Scalable Ambient Obscurance: visibility from the depths of a picture alone, at a cost that its radius does not change.
//!
//! Takes distances of a picture's samples ([`Screen`]); returns one visibility a sample. See `README.md`.

mod bilateral;
mod pack;
mod params;
mod pyramid;
mod sample;
#[cfg(test)]
mod tests;

use rayon::prelude::*;

pub use bilateral::reconstruct;
pub use pack::{pack, unpack};
pub use params::{MAX_LEVELS, MAX_SAMPLES, SaoParams};
pub use pyramid::{MipFilter, Pyramid};
pub use sample::{Sampler, filter_quads, sample_obscurance};

use crate::gbuffer::Screen;
use crate::{AfterPass, RenderError};

/// Visibility 0 … 1 of each sample of a picture, row-major from the top, 1 for the background: all passes one after the other. In
/// parallel in the caller's rayon pool, and the same for any number of threads.
///
/// # Errors
/// A parameter out of its range.
pub fn estimate_visibility(screen: &Screen, params: &SaoParams) -> Result<Vec<f32>, RenderError> {
    estimate_by_passes(screen, params, &mut |_| ())
}

/// As [`estimate_visibility`], and tells when each pass is done: `levels`, `samples`, `quads`, `bilateral`.
///
/// # Errors
/// As there.
pub fn estimate_by_passes(
    screen: &Screen,
    params: &SaoParams,
    after: AfterPass<'_>,
) -> Result<Vec<f32>, RenderError> {
    params.check()?;
    let pyramid = Pyramid::new(screen, params.filter, params.levels);
    after("levels");
    let mut visibility = sample_obscurance(screen, &pyramid, params);
    after("samples");
    filter_quads(screen, &mut visibility);
    after("quads");
    let packed = pack(screen, &visibility, params.farthest_m);
    let mut visibility = reconstruct(screen.columns() as usize, &packed, params);
    visibility.par_iter_mut().zip(screen.distances_m()).with_min_len(1024).for_each(|(value, distance)| {
        if !distance.is_finite() {
            *value = 1.0;
        }
    });
    after("bilateral");
    Ok(visibility)
}
