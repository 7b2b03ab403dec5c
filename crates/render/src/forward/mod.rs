//! The forward pass on a graphics card: a posed scene, lit, with visibility looked up, in one go.
//!
//! Takes a [`GpuScene`] and [`FrameInputs`]; draws into a texture view what the twins ([`crate::gbuffer`],
//! [`crate::shade`], [`crate::compose`]) draw into memory. See `README.md` for how closely they agree.

mod area;
mod atlas;
mod draw;
mod error;
mod geometry;
mod hidden;
mod inputs;
pub(crate) mod layouts;
mod lookup;
mod pipelines;
mod points;
mod scene;
mod shadow;
#[cfg(test)]
mod tests;
mod uniforms;
mod view;

pub use atlas::{AtlasBand, AtlasTexture};
pub use draw::Forward;
pub use error::ForwardError;
pub use geometry::GeometryTarget;
pub(crate) use hidden::{HiddenChoice, HiddenTarget, SAMPLES as HIDDEN_SAMPLES};
pub use inputs::{Drawn, FrameInputs, Rect, Transparency, View, ViewKind};
pub use lookup::{LOOKUP_INPUT_WGSL, Lookup, LookupId};
pub use points::GpuPoints;
pub use scene::{GpuScene, GpuSceneOptions};
pub use uniforms::{MAX_FACES, MAX_LIGHTS};
