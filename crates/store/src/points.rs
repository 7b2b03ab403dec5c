//! Points on surfaces that carry visibility ([Neff2023] sec. 3.2, in rest space).
//!
//! A point is anchored to a place on an instance's surface in that instance's *rest space*
//! (`dapple_scene::Instance::rest_from_mesh`): nothing about it changes when the instance moves or bends,
//! except its visibility. So a store is an immutable [`PointLayout`] and one byte a point, and if wanted two more for a bent normal; the points
//! of whole instances may come and go, which makes another layout.

mod bent;
mod grid;
mod layout;
mod morton;
mod normal;
mod sets;
mod store;

pub use bent::{BentChange, BentNormal, BentPlanes, orthonormal_basis};
pub use grid::CellGrid;
pub use layout::{LayoutError, MAX_COORDINATE, MAX_POINTS, PointLayout, PointSet};
pub use morton::{morton_code, morton_decode};
pub use normal::PackedNormal;
pub use sets::SetsChange;
pub use store::{Change, PointStore, StoreError};
