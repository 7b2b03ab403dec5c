//! Stochastic depth: screen-space ambient occlusion that knows of surfaces behind the first ones.
//!
//! Draws a [`StochasticMap`] of a scene beside its G-buffer; [`ssao`](crate::ssao) and [`hbao`](crate::hbao) look into it. See `README.md`.

mod hidden;
mod map;
#[cfg(test)]
mod measure;
mod picks;
#[cfg(test)]
mod tests;

pub use hidden::{Hidden, Looks, Lookup};
pub use map::{MapParams, StochasticMap};
pub use picks::Picks;
