//! Images to numbers: how far a picture is from the truth. Depends on no other part of Dapple, so that the
//! judge does not depend on the judged.
//!
//! Inputs are plain slices and sizes; rows run from the top, channels are interleaved. Loops run in the
//! caller's rayon pool and sum in a fixed order, so results do not depend on the thread count.
//!
//! | metric | better is | input |
//! |---|---|---|
//! | [`psnr()`], [`error_map()`] | higher, ∞ when equal | any number of channels, any range |
//! | [`mean_bias()`] | 0 when equal | linear RGB, any range |
//! | [`ssim()`], [`ssim_map()`] | higher, 1 when equal | luma, 0 … 1 |
//! | [`flip()`] | lower, 0 when equal | sRGB, 8 bits a channel |
//! | [`flip_hdr()`] | lower, 0 when equal | linear sRGB of any brightness |
//! | [`Lpips::distance`] | lower, 0 when equal | sRGB, 8 bits a channel |
//! | [`Flicker`], [`StillFlicker`] | lower, 0 when steady | pictures of a sequence, any range |

mod bias;
mod error;
mod errors;
mod flip;
mod lpips;
mod psnr;
mod ssim;
mod temporal;
#[cfg(test)]
mod test_images;

pub use bias::mean_bias;
pub use error::MetricError;
pub use errors::{PixelError, error_map};
pub use flip::{Exposures, Flip, HdrFlip, PIXELS_PER_DEGREE, flip, flip_hdr, magma_srgb8};
pub use lpips::{LPIPS_MAX_PIXELS, LPIPS_MIN_SIDE, Lpips, LpipsMap, WeightsError};
pub use psnr::{psnr, psnr_masked};
pub use ssim::{SSIM_MIN_SIDE, SsimMap, ssim, ssim_map};
pub use temporal::{Flicker, StillFlicker};
