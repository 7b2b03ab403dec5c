//! The lower level: one mesh's triangles in its own space.

use std::ops::Range;
use std::sync::Arc;

use dapple_scene::glam::Vec3;
use dapple_scene::{Aabb, Mesh};
use rayon::prelude::*;

use super::alpha::{AlphaMaterials, HOLE, MeshAlpha};
use super::build::{MESH_LEAVES, build};
use super::leaf::{Triangles, corners};
use super::tree::Tree;
use super::triangle::{MeshRay, Triangle, TriangleHit, intersect};

/// Rebuild instead of refit once the expected cost of a ray has grown by this factor.
const REBUILD_COST_FACTOR: f64 = 1.5;

/// Boxes of triangles grow by this part of the triangle's size: the exact test works with corners that are off by some
/// roundings of their distance, of which the part up to the box is in [`super::tree::CONSERVATIVE`].
const SIZE_MARGIN: f32 = 1.0 / (1 << 21) as f32;

/// A tree over one set of vertex positions.
#[derive(Clone)]
pub(crate) struct MeshBvh {
    pub(crate) tree: Tree,
    /// Around everything.
    pub(crate) bounds: Aabb,
    /// In leaf order.
    pub(crate) triangles: Triangles,
    /// One bit a triangle in leaf order: has holes, or a side that rays pass. Empty if none has.
    special: Vec<u64>,
    alpha: Arc<MeshAlpha>,
    /// Cost when it was built.
    built_cost: f64,
}

/// Without margin.
fn bounds_of(corners: &[[f32; 3]; 3]) -> Aabb {
    if corners[0][0].is_nan() {
        return Aabb::EMPTY;
    }
    Aabb::from_points(corners.map(Vec3::from_array))
}

/// Grown by the margin that the largest triangle inside can need, and by at least one step, however large the
/// coordinates.
fn with_margin(b: Aabb) -> Aabb {
    if b.is_empty() {
        return b;
    }
    let margin = (b.max - b.min).max_element() * SIZE_MARGIN;
    let lower = |x: f32| (x - margin).next_down().max(-f32::MAX);
    let upper = |x: f32| (x + margin).next_up().min(f32::MAX);
    Aabb { min: b.min.map(lower), max: b.max.map(upper) }
}

impl MeshBvh {
    /// Over the mesh's triangles with the given vertices (its own, or deformed ones).
    pub(crate) fn new(mesh: &Mesh, positions: &[Vec3], alpha: Arc<MeshAlpha>) -> MeshBvh {
        let kept: Vec<u32> =
            (0..mesh.triangles.len() as u32).filter(|&i| alpha.of_triangle(i as usize) != HOLE).collect();
        let boxes: Vec<Aabb> =
            kept.par_iter().map(|&id| bounds_of(&corners(positions, mesh.triangles[id as usize]))).collect();
        let mut tree = build(&boxes, &MESH_LEAVES);
        drop(boxes);
        let ids: Vec<u32> = std::mem::take(&mut tree.order).iter().map(|&i| kept[i as usize]).collect();
        let mut special = Vec::new();
        if ids.iter().any(|&id| !alpha.is_plain(id as usize)) {
            special = vec![0_u64; ids.len().div_ceil(64) + 1];
            for (i, _) in ids.iter().enumerate().filter(|(_, id)| !alpha.is_plain(**id as usize)) {
                special[i / 64] |= 1 << (i % 64);
            }
        }
        let triangles = Triangles::new(ids);
        let mut bvh = MeshBvh { tree, bounds: Aabb::EMPTY, triangles, special, alpha, built_cost: 0.0 };
        bvh.fit(mesh, positions);
        bvh.built_cost = bvh.tree.cost();
        bvh
    }

    /// Follows moved vertices of the same topology; `true` if the tree had to be built anew.
    pub(crate) fn update(&mut self, mesh: &Mesh, positions: &[Vec3]) -> bool {
        self.fit(mesh, positions);
        // A mesh that was a point or a line when it was built has cost 0, and is due for a better tree.
        if self.tree.cost() <= REBUILD_COST_FACTOR * self.built_cost {
            return false;
        }
        *self = MeshBvh::new(mesh, positions, Arc::clone(&self.alpha));
        true
    }

    /// Sets all corners and all boxes.
    fn fit(&mut self, mesh: &Mesh, positions: &[Vec3]) {
        let triangles = &mut self.triangles;
        self.tree.refit(|range| with_margin(triangles.set_leaf(range, positions, &mesh.triangles)));
        self.bounds = self.tree.bounds();
    }

    /// Bytes held.
    pub(crate) fn bytes(&self) -> usize {
        self.tree.bytes() + self.triangles.bytes() + self.special.capacity() * size_of::<u64>()
    }

    /// Lanes of a leaf whose triangles do not simply block.
    #[inline(always)]
    pub(crate) fn special_lanes(&self, range: &Range<usize>) -> u32 {
        if self.special.is_empty() {
            return 0;
        }
        let (word, bit) = (range.start / 64, range.start % 64);
        let both = u128::from(self.special[word]) | u128::from(self.special[word + 1]) << 64;
        (both >> bit) as u32 & ((1 << range.len()) - 1)
    }

    /// Where the ray meets the triangle in a lane of a leaf, if it blocks there, and the triangle's index in the mesh.
    pub(crate) fn exact_hit(
        &self,
        ray: &MeshRay,
        range: &Range<usize>,
        lane: usize,
        alpha: &AlphaMaterials,
    ) -> Option<(u32, TriangleHit)> {
        let id = self.triangles.ids()[range.start + lane];
        let triangle = Triangle { corners: self.triangles.corners(range, lane) };
        let hit = intersect(ray, &triangle)?;
        if hit.back_face && self.alpha.passes_back(id as usize) {
            return None;
        }
        alpha.blocks(&self.alpha, self.alpha.of_triangle(id as usize), hit.weights).then_some((id, hit))
    }
}
