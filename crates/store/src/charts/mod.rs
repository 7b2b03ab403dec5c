//! Rest-space charts: the surfaces of an instance laid flat in texels, made once, the same on both ends.
//!
//! A *chart* is a connected piece of surface projected on a plane; a *page* is a rectangle of texels that holds
//! charts of one instance; an *atlas* is where the pages of all instances are placed. A *site* is a texel with the place
//! on the surface that it stands for.

mod atlas;
mod build;
mod cuts;
mod flatten;
mod grow;
mod kernel;
mod neighbours;
mod pack;
mod per_vertex;
mod plan;
mod raster;
mod set;
mod sides;
mod surface;
#[cfg(test)]
mod tests;
mod weights;

pub use atlas::{Atlas, AtlasError, Placement};
pub use build::ChartBuilder;
pub use cuts::{Cuts, CutsError, SetCuts, SiteCut, fingerprint};
pub use kernel::{Fit, LEAST_WEIGHT, MovingLeastSquares, RIDGE, Weighed};
pub use plan::{InstanceKey, SceneCharts};
pub use set::{
    ChartError, ChartParams, ChartSet, ChartUv, ChartVertices, MOST_TEXELS, PageSize, Site, SiteFinder,
    TEXEL_FRACTION,
};
pub use sides::add_back_sites;
pub use weights::{
    Candidate, MAX_CANDIDATES, MAX_WEIGHTS, PointNeighbours, TexelWeights, WEIGHT_SUM, Weigher, WeightParams,
};
