//! Two levels of bounding volume hierarchies and the queries on them. `README.md` tells how it works and why.
//!
//! - **Lower level**: one tree for each mesh, in mesh space, shared by its rigid instances; one of its own for each
//!   deformed instance, refitted when it moves and built anew when that no longer pays.
//! - **Upper level**: two small trees over the instances' boxes in the world: of those that move, built anew each
//!   update, and of all others.
//!
//! Every answer is that of one test of a ray and a triangle ([`Tracer::occluded`] and all others; \[Woop2013\]): rays do
//! not slip through shared edges or corners of one mesh, and the answers are the same bit for bit on all machines, widths
//! of vectors and numbers of threads, and whether rays are asked about together or alone.
//!
//! **A point's own surface**: nothing is left out of a query, so rays that leave a surface start a little above it
//! ([`offset_origin`]). A triangle is met at t > 0 only, and never along its own plane.
//!
//! \[Woop2013\]: S. Woop, C. Benthin, I. Wald, "Watertight Ray/Triangle Intersection", JCGT 2 (1), 2013.

mod alpha;
mod build;
mod bundle;
mod filter;
mod leaf;
mod mesh;
mod placement;
mod query;
mod single;
mod stack;
mod tracer;
mod traverse;
mod tree;
mod triangle;
mod vectors;

#[cfg(test)]
mod brute_force;
#[cfg(test)]
mod movers;
#[cfg(test)]
mod tests;
#[cfg(test)]
pub(crate) mod timing;

use dapple_scene::glam::Vec3;

pub use alpha::BackFaces;
pub use tracer::{Blockers, Tracer};
pub use vectors::Vectors;

/// Most directions in one [`Tracer::occlusion`] query.
pub const MAX_DIRECTIONS: usize = 256;

/// Bit `i % 64` of word `i / 64` is set if direction `i` is blocked.
pub type BlockedMask = [u64; MAX_DIRECTIONS / 64];

/// How many directions are blocked.
pub fn count_blocked(blocked: &BlockedMask) -> u32 {
    blocked.iter().map(|word| word.count_ones()).sum()
}

/// A ray that meets what lies at `0 < t ≤ t_max` lengths of its direction from its origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where it starts, each coordinate within ±10¹⁸ (in the mesh's space too). See [`offset_origin`] for rays that leave
    /// a surface.
    pub origin_world: Vec3,
    /// Where it goes; of unit length if distances are to be metres. Its largest coordinate must lie in 10⁻¹⁸ … 10¹⁸, also
    /// in the space of the mesh that it meets; otherwise it hits nothing.
    pub direction_world: Vec3,
    /// How far it goes, in lengths of `direction_world`; infinity is allowed. At 0 or below (or NaN) it hits nothing.
    pub t_max: f32,
}

/// Where a ray meets a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance in lengths of the ray's direction, `0 ≤ t ≤ t_max`.
    pub t: f32,
    /// Index into [`dapple_scene::Scene::instances`].
    pub instance: u32,
    /// Index into the mesh's triangles.
    pub triangle: u32,
    /// Weights of the triangle's three corners, each ≥ 0, sum 1.
    pub barycentrics: Vec3,
    /// The ray meets the side on which the mesh's corners run clockwise. As in glTF the front of a mirrored instance
    /// is the mirror image of the mesh's front.
    pub back_face: bool,
}

/// Lifts the start of a ray off the surface it lies on, along the side's unit normal, so that the surface does not
/// block its own rays.
///
/// The lift is 0.1 mm plus 2⁻¹⁷ (64 to 128 units in the last place) of the largest coordinate: 0.108 mm near 1 m,
/// 0.33 mm near 30 m, 7.7 mm near 1 km. It covers the rounding of a position that was interpolated in mesh space and
/// brought to the world in `f32`, and of the tracer's own way back. Surfaces nearer than the lift are missed: scenes
/// much smaller than a centimetre should be scaled up.
pub fn offset_origin(position_world: Vec3, normal_world: Vec3) -> Vec3 {
    const FLOOR_M: f32 = 1e-4;
    const RELATIVE: f32 = 1.0 / (1 << 17) as f32;
    position_world + normal_world * (FLOOR_M + RELATIVE * position_world.abs().max_element())
}
