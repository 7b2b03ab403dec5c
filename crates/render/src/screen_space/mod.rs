//! Methods that look at the picture alone, by one name each ([`ScreenMethod`]), and their passes on a graphics card
//! ([`ScreenPasses`]). See `README.md`.

#[cfg(feature = "gpu")]
mod bindings;
#[cfg(feature = "gpu")]
mod cameras;
mod method;
#[cfg(feature = "gpu")]
mod passes;
#[cfg(feature = "gpu")]
mod plan;
#[cfg(feature = "gpu")]
mod steps;
#[cfg(feature = "gpu")]
#[cfg(test)]
mod tests;
#[cfg(feature = "gpu")]
mod textures;
#[cfg(feature = "gpu")]
mod uniforms;

pub use method::{Layered, ScreenKind, ScreenMethod, StochasticParams};
#[cfg(feature = "gpu")]
pub use passes::{ScreenPasses, ScreenView};
