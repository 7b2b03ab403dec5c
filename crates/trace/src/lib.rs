//! The server's rays: what blocks what, and the visibility that follows from it.
//!
//! [`Tracer`] answers occlusion and closest-hit queries on a posed scene, [`sampling`] chooses directions that
//! depend on nothing but a seed and a site, and [`rtao`] joins the two into ray-traced visibility, the truth
//! that every other method is compared with. [`direct`] does the same for the light of lights that have an area.
//!
//! Nothing here owns a thread pool, a clock or a random state: parallel loops run in the caller's rayon pool and
//! give the same bits on any number of threads.

pub mod bvh;
pub mod direct;
pub mod inside;
pub mod psao;
pub mod rtao;
pub mod sampling;
pub mod slc;

#[cfg(test)]
mod test_support;

pub use bvh::{
    BackFaces, BlockedMask, Blockers, Hit, MAX_DIRECTIONS, Ray, Tracer, Vectors, count_blocked, offset_origin,
};
