//! Stochastic depth: screen-space ambient occlusion that knows of surfaces behind the first ones.
//!
//! Draws a [`StochasticMap`] of a scene beside its G-buffer; [`ssao`](crate::ssao) and [`hbao`](crate::hbao) look into it. See `README.md`.

mod bent;
mod hidden;
mod map;
mod multi_view;
mod picks;
#[cfg(test)]
mod tests;

pub use bent::{BentNormals, bent_normals};
pub use hidden::{Hidden, Looks, Lookup};
pub use map::{MAX_DISTANCES, MapParams, StochasticMap};
pub(crate) use multi_view::check_horizon as check_horizon_of_two;
#[cfg(feature = "gpu")]
pub(crate) use multi_view::side_from_main;
pub use multi_view::{
    SideParams, SideView, estimate_ssao as estimate_ssao_of_two,
    estimate_visibility as estimate_visibility_of_two,
};
#[cfg(feature = "gpu")]
pub(crate) use picks::ChoiceTable;
pub use picks::Picks;
