//! The client's drawing passes as deterministic CPU code over slices.
//!
//! These twins define what a picture is: shaders must agree with them, and where there is no graphics driver they
//! are what runs. The order of a frame is
//!
//! ```text
//! gbuffer::rasterize ─► shade::render_shadow_maps ─► shade::shade ─► compose::compose ─► image::LinearImage::to_rgb8
//!        └► (visibility per sample, from a store or a screen-space method) ─────┘
//! ```
//!
//! Results do not depend on the number of threads nor on the machine: loops run in the caller's rayon pool, and all
//! transcendental functions come from `libm`.

#[allow(dead_code)]
mod bilateral;
mod cap_pattern;
mod error;
mod noise;
mod obscurance;
mod preset;
mod projection;
#[cfg(feature = "gpu")]
mod tables;
#[cfg(test)]
mod testing;

pub(crate) use dapple_scene::texture;

pub mod alchemy;
pub mod area_lights;
pub mod compose;
#[cfg(feature = "gpu")]
pub mod forward;
pub mod gbuffer;
pub mod gtao;
pub mod hbao;
pub mod image;
pub mod psao;
pub mod sao;
pub mod screen_space;
pub mod sdao;
pub mod shade;
pub mod slc;
pub mod ssao;
pub mod upsample;

pub use error::RenderError;

/// Told the name of each pass of a method when it is done, so that a caller with a clock can time them.
pub type AfterPass<'a> = &'a mut dyn FnMut(&'static str);

pub use preset::{Chosen, Preset, UnknownPreset};
