//! Reconstruction of visibility from points ([Neff2023] sec. 3.5): the paper's kernel and moving least squares.
//!
//! Takes the store's points and fragments in rest space; returns one visibility a fragment. See `README.md`.

pub mod atlas;
pub mod cells;
pub mod hash;
mod hat;
mod index;
mod mls;
pub mod paper;
mod tables;
#[cfg(test)]
mod tests;

use rayon::prelude::*;

use crate::gbuffer::RestSurface;

pub use dapple_store::charts::MovingLeastSquares;
pub use hat::Hat;
pub use index::PointIndex;
#[cfg(feature = "gpu")]
pub use tables::TableTextures;
pub use tables::{TABLE_WIDTH, TableError};

/// How values of points near a fragment become its visibility.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kernel {
    /// [Neff2023] eq. 2–4.
    Hat(Hat),
    /// First-order moving least squares with a nearest-point fallback: the default.
    MovingLeastSquares(MovingLeastSquares),
}

impl Default for Kernel {
    fn default() -> Self {
        Kernel::MovingLeastSquares(MovingLeastSquares::default())
    }
}

/// Visibility 0 … 1 of each fragment (1 for `None`), in parallel in the caller's rayon pool.
///
/// `visibility` are the store's values, in the order of the layout that `index` was made from.
///
/// # Panics
/// If `visibility` has another length than the layout.
pub fn reconstruct(
    index: &PointIndex,
    visibility: &[u8],
    kernel: &Kernel,
    fragments: &[Option<RestSurface>],
) -> Vec<f32> {
    assert_eq!(visibility.len(), index.len(), "one value a point");
    fragments
        .par_chunks(1024)
        .flat_map_iter(|chunk| {
            let mut near = index::Near::default();
            chunk.iter().map(move |fragment| match (fragment, kernel) {
                (None, _) => 1.0,
                (Some(f), Kernel::Hat(hat)) => hat.visibility(index, visibility, f, &mut near),
                (Some(f), Kernel::MovingLeastSquares(kernel)) => {
                    mls::visibility(kernel, index, visibility, f, &mut near)
                }
            })
        })
        .collect()
}
