//! The lower level: one mesh's triangles in its own space, and single rays through them.

use std::sync::Arc;

use dapple_scene::glam::Vec3;
use dapple_scene::{Aabb, Mesh};
use rayon::prelude::*;

use super::alpha::{AlphaMaterials, HOLE, MeshAlpha};
use super::build::build;
use super::tree::{CONSERVATIVE, Child, Node, Tree, WIDTH};
use super::triangle::{MeshRay, Triangle, TriangleHit, intersect, max, min};

/// Rebuild instead of refit once the expected cost of a ray has grown by this factor.
const REBUILD_COST_FACTOR: f64 = 1.5;

/// A tree over one set of vertex positions.
#[derive(Clone)]
pub(crate) struct MeshBvh {
    pub(crate) tree: Tree,
    /// In leaf order.
    pub(crate) triangles: Vec<Triangle>,
    pub(crate) alpha: Arc<MeshAlpha>,
    /// Cost when it was built.
    built_cost: f64,
}

fn corners(positions: &[Vec3], indices: [u32; 3]) -> [[f32; 3]; 3] {
    let corners = indices.map(|i| positions.get(i as usize).copied().unwrap_or(Vec3::NAN));
    if corners.iter().all(|c| c.is_finite()) { corners.map(|c| c.to_array()) } else { [[f32::NAN; 3]; 3] }
}

fn bounds_of(corners: &[[f32; 3]; 3]) -> Aabb {
    if corners[0][0].is_nan() {
        return Aabb::EMPTY;
    }
    Aabb::from_points(corners.map(Vec3::from_array))
}

impl MeshBvh {
    /// Over the mesh's triangles with the given vertices (its own, or deformed ones).
    pub(crate) fn new(mesh: &Mesh, positions: &[Vec3], alpha: Arc<MeshAlpha>) -> MeshBvh {
        let kept: Vec<Triangle> = (0..mesh.triangles.len())
            .filter(|&i| alpha.of_triangle(i) != HOLE)
            .map(|i| Triangle {
                corners: corners(positions, mesh.triangles[i]),
                id: i as u32,
                alpha: alpha.of_triangle(i),
            })
            .collect();
        let boxes: Vec<Aabb> = kept.par_iter().map(|t| bounds_of(&t.corners)).collect();
        let mut tree = build(&boxes);
        let triangles = std::mem::take(&mut tree.order).iter().map(|&i| kept[i as usize]).collect();
        let built_cost = tree.cost();
        MeshBvh { tree, triangles, alpha, built_cost }
    }

    /// Follows moved vertices of the same topology; `true` if the tree had to be built anew.
    pub(crate) fn update(&mut self, mesh: &Mesh, positions: &[Vec3]) -> bool {
        for triangle in &mut self.triangles {
            triangle.corners = corners(positions, mesh.triangles[triangle.id as usize]);
        }
        let triangles = &self.triangles;
        self.tree
            .refit(|range| triangles[range].iter().fold(Aabb::EMPTY, |b, t| b.union(bounds_of(&t.corners))));
        // A mesh that was a point or a line when it was built has cost 0, and is due for a better tree.
        if self.tree.cost() <= REBUILD_COST_FACTOR * self.built_cost {
            return false;
        }
        *self = MeshBvh::new(mesh, positions, Arc::clone(&self.alpha));
        true
    }

    /// Whether anything in the subtree of `root` blocks the ray.
    pub(crate) fn any_hit(&self, root: u32, ray: &MeshRay, alpha: &AlphaMaterials) -> bool {
        if self.tree.nodes.is_empty() {
            return false;
        }
        let planes = NearFar::new(ray);
        let mut stack = Stack::new(root);
        while let Some(index) = stack.pop() {
            let node = &self.tree.nodes[index as usize];
            let mut mask = planes.hits(node, ray, ray.t_max);
            while mask != 0 {
                let slot = mask.trailing_zeros() as usize;
                mask &= mask - 1;
                match node.child(slot) {
                    Child::Inner(child) => stack.push(child),
                    Child::Leaf(range) => {
                        for triangle in &self.triangles[range] {
                            if let Some(hit) = intersect(ray, triangle)
                                && alpha.blocks(&self.alpha, triangle.alpha, hit.weights)
                            {
                                return true;
                            }
                        }
                    }
                    Child::Empty => {}
                }
            }
        }
        false
    }

    /// The nearest hit not beyond `t_best`; among equally near ones the triangle of lowest index.
    pub(crate) fn closest_hit(
        &self,
        ray: &MeshRay,
        mut t_best: f32,
        alpha: &AlphaMaterials,
    ) -> Option<(u32, TriangleHit)> {
        if self.tree.nodes.is_empty() {
            return None;
        }
        let planes = NearFar::new(ray);
        let mut best: Option<(u32, TriangleHit)> = None;
        let mut stack = vec![(0.0_f32, 0_u32)];
        let mut inner: Vec<(f32, u32)> = Vec::with_capacity(WIDTH);
        while let Some((near, index)) = stack.pop() {
            if near > t_best * CONSERVATIVE {
                continue;
            }
            let node = &self.tree.nodes[index as usize];
            let (mut mask, near) = planes.hits_near(node, ray, t_best);
            inner.clear();
            while mask != 0 {
                let slot = mask.trailing_zeros() as usize;
                mask &= mask - 1;
                match node.child(slot) {
                    Child::Inner(child) => inner.push((near[slot], child)),
                    Child::Leaf(range) => {
                        for triangle in &self.triangles[range] {
                            let Some(hit) = intersect(ray, triangle) else { continue };
                            let nearer = match &best {
                                Some((id, b)) => hit.t < b.t || (hit.t == b.t && triangle.id < *id),
                                None => hit.t <= t_best,
                            };
                            if nearer && alpha.blocks(&self.alpha, triangle.alpha, hit.weights) {
                                t_best = hit.t;
                                best = Some((triangle.id, hit));
                            }
                        }
                    }
                    Child::Empty => {}
                }
            }
            // Nearest on top; boxes' order does not decide the result, only the time.
            inner.sort_by(|a, b| b.0.total_cmp(&a.0));
            stack.extend_from_slice(&inner);
        }
        best
    }
}

/// Which of a box's planes the ray enters and leaves by.
pub(crate) struct NearFar {
    near: [usize; 3],
    far: [usize; 3],
}

impl NearFar {
    #[inline(always)]
    pub(crate) fn new(ray: &MeshRay) -> NearFar {
        let back = ray.inverse.map(|i| i < 0.0);
        let pick = |axis: usize, max: bool| axis + if max { 3 } else { 0 };
        NearFar {
            near: [pick(0, back[0]), pick(1, back[1]), pick(2, back[2])],
            far: [pick(0, !back[0]), pick(1, !back[1]), pick(2, !back[2])],
        }
    }

    /// The children (bit i for slot i) whose box the ray may touch within `t_max`.
    #[inline(always)]
    pub(crate) fn hits(&self, node: &Node, ray: &MeshRay, t_max: f32) -> u32 {
        self.hits_near(node, ray, t_max).0
    }

    /// [`Self::hits`], and where each box is entered.
    #[inline(always)]
    fn hits_near(&self, node: &Node, ray: &MeshRay, t_max: f32) -> (u32, [f32; WIDTH]) {
        let b = &node.bounds;
        let ([ox, oy, oz], [ix, iy, iz]) = (ray.origin, ray.inverse);
        let (nx, ny, nz) = (&b[self.near[0]], &b[self.near[1]], &b[self.near[2]]);
        let (fx, fy, fz) = (&b[self.far[0]], &b[self.far[1]], &b[self.far[2]]);
        let mut near = [0.0; WIDTH];
        let mut mask = 0;
        for i in 0..WIDTH {
            let enter = max(max((nx[i] - ox) * ix, (ny[i] - oy) * iy), max((nz[i] - oz) * iz, 0.0));
            let leave = min(min((fx[i] - ox) * ix, (fy[i] - oy) * iy), min((fz[i] - oz) * iz, t_max));
            near[i] = enter;
            mask |= u32::from(enter <= leave * CONSERVATIVE) << i;
        }
        (mask, near)
    }
}

/// Nodes still to visit. Lives on the stack unless the tree is degenerate.
struct Stack {
    nodes: [u32; Stack::INLINE],
    len: usize,
    spilled: Vec<u32>,
}

impl Stack {
    const INLINE: usize = 96;

    fn new(root: u32) -> Stack {
        let mut nodes = [0; Stack::INLINE];
        nodes[0] = root;
        Stack { nodes, len: 1, spilled: Vec::new() }
    }

    #[inline(always)]
    fn push(&mut self, node: u32) {
        if self.len < Stack::INLINE {
            self.nodes[self.len] = node;
            self.len += 1;
        } else {
            self.spilled.push(node);
        }
    }

    #[inline(always)]
    fn pop(&mut self) -> Option<u32> {
        if self.len == Stack::INLINE
            && let Some(node) = self.spilled.pop()
        {
            return Some(node);
        }
        if self.len == 0 {
            return None;
        }
        self.len -= 1;
        Some(self.nodes[self.len])
    }
}
