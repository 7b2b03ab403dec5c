//! Rest-space charts: the surfaces of an instance laid flat in texels, made once, the same on both ends.
//!
//! A *chart* is a connected piece of surface projected on a plane; a *page* is a rectangle of texels that holds
//! charts of one instance; an *atlas* is where the pages of all instances are placed. A *site* is a texel with the place
//! on the surface that it stands for.

mod kernel;
mod neighbours;
mod set;
mod weights;

pub use kernel::{Fit, MovingLeastSquares, Weighed};
pub use set::{ChartError, ChartParams, ChartSet, ChartUv, ChartVertices, PageSize, Site, TEXEL_FRACTION};
pub use weights::{
    Candidate, MAX_CANDIDATES, MAX_WEIGHTS, PointNeighbours, TexelWeights, WEIGHT_SUM, WeightParams, Weigher,
};
