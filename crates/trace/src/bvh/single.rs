//! Single rays through one tree.

use std::ops::Range;

use fearless_simd::Simd;

use super::alpha::AlphaMaterials;
use super::filter::test_one;
use super::mesh::MeshBvh;
use super::stack::Stack;
use super::traverse::Boxes;
use super::tree::{CONSERVATIVE, Child, TINY, WIDTH};
use super::triangle::{MeshRay, QuickRay, TriangleHit};

/// What becomes of the triangles that a ray may meet. A trait and not a closure, as [`super::traverse::Visitor`].
trait Candidates {
    /// Some triangles of a leaf may be met (bits by lane), some of those for sure. How far the ray still goes; `None`
    /// ends it.
    fn meet(&mut self, leaf: &Range<usize>, maybe: u32, sure: u32, t_far: f32) -> Option<f32>;
}

struct AnyHit<'a> {
    bvh: &'a MeshBvh,
    ray: &'a QuickRay,
    alpha: &'a AlphaMaterials,
    blocked: bool,
}

impl AnyHit<'_> {
    #[cold]
    #[inline(never)]
    fn exact(&self, leaf: &Range<usize>, lane: usize) -> bool {
        self.ray.exact().is_some_and(|ray| self.bvh.exact_hit(&ray, leaf, lane, self.alpha).is_some())
    }
}

impl Candidates for AnyHit<'_> {
    #[inline(always)]
    fn meet(&mut self, leaf: &Range<usize>, mut maybe: u32, sure: u32, t_far: f32) -> Option<f32> {
        self.blocked = sure & !self.bvh.special_lanes(leaf) != 0;
        while maybe != 0 && !self.blocked {
            let lane = maybe.trailing_zeros() as usize;
            maybe &= maybe - 1;
            self.blocked = self.exact(leaf, lane);
        }
        if self.blocked { None } else { Some(t_far) }
    }
}

struct ClosestHit<'a> {
    bvh: &'a MeshBvh,
    ray: &'a MeshRay,
    alpha: &'a AlphaMaterials,
    best: Option<(u32, TriangleHit)>,
}

impl Candidates for ClosestHit<'_> {
    fn meet(&mut self, leaf: &Range<usize>, mut maybe: u32, _: u32, mut t_far: f32) -> Option<f32> {
        while maybe != 0 {
            let lane = maybe.trailing_zeros() as usize;
            maybe &= maybe - 1;
            if let Some((id, hit)) = self.bvh.exact_hit(self.ray, leaf, lane, self.alpha)
                && self.best.as_ref().is_none_or(|(i, b)| hit.t < b.t || (hit.t == b.t && id < *i))
            {
                t_far = t_far.min(hit.t);
                self.best = Some((id, hit));
            }
        }
        Some(t_far)
    }
}

struct AllHits<'a, F> {
    bvh: &'a MeshBvh,
    ray: &'a MeshRay,
    alpha: &'a AlphaMaterials,
    found: F,
}

impl<F: FnMut(u32, TriangleHit)> Candidates for AllHits<'_, F> {
    fn meet(&mut self, leaf: &Range<usize>, mut maybe: u32, _: u32, t_far: f32) -> Option<f32> {
        while maybe != 0 {
            let lane = maybe.trailing_zeros() as usize;
            maybe &= maybe - 1;
            if let Some((id, hit)) = self.bvh.exact_hit(self.ray, leaf, lane, self.alpha) {
                (self.found)(id, hit);
            }
        }
        Some(t_far)
    }
}

impl MeshBvh {
    /// Whether anything in the subtree of the node `root` blocks the ray.
    #[inline(always)]
    pub(crate) fn any_hit<S: Simd>(
        &self,
        simd: S,
        root: u32,
        ray: &QuickRay,
        alpha: &AlphaMaterials,
    ) -> bool {
        let mut any = AnyHit { bvh: self, ray, alpha, blocked: false };
        self.visit_leaves(simd, root, ray, &mut any);
        any.blocked
    }

    /// The nearest hit not beyond `t_best`; among equally near ones the triangle of lowest index.
    #[inline(always)]
    pub(crate) fn closest_hit<S: Simd>(
        &self,
        simd: S,
        ray: &MeshRay,
        t_best: f32,
        alpha: &AlphaMaterials,
    ) -> Option<(u32, TriangleHit)> {
        let ray = &MeshRay { t_max: ray.t_max.min(t_best), ..*ray };
        let mut closest = ClosestHit { bvh: self, ray, alpha, best: None };
        self.visit_leaves(simd, 0, &self.quick(ray), &mut closest);
        closest.best
    }

    /// Calls `found` with everything that the ray meets, in no order.
    #[inline(always)]
    pub(crate) fn all_hits<S: Simd>(
        &self,
        simd: S,
        ray: &MeshRay,
        alpha: &AlphaMaterials,
        found: impl FnMut(u32, TriangleHit),
    ) {
        let mut all = AllHits { bvh: self, ray, alpha, found };
        self.visit_leaves(simd, 0, &self.quick(ray), &mut all);
    }

    /// A ray as far as it needs to go to pass all of the tree.
    #[inline(always)]
    pub(crate) fn quick(&self, ray: &MeshRay) -> QuickRay {
        let mut extent = 0.0_f32;
        for axis in 0..3 {
            let (lo, hi) =
                (self.bounds.min[axis] - ray.origin[axis], self.bounds.max[axis] - ray.origin[axis]);
            extent = extent.max(lo.abs()).max(hi.abs());
        }
        QuickRay {
            origin: ray.origin,
            direction: ray.direction,
            inverse: ray.inverse,
            direction_max: ray.direction[ray.axes[2]].abs(),
            t_max: ray.t_max,
            t_far: ray.t_max.min(8.0 * extent * ray.shear[2].abs()).min(f32::MAX),
        }
    }

    /// Shows the leaves whose box the ray may touch to `candidates`, near ones mostly first.
    #[inline(always)]
    fn visit_leaves<S: Simd>(&self, simd: S, root: u32, ray: &QuickRay, candidates: &mut impl Candidates) {
        if self.tree.nodes.is_empty() {
            return;
        }
        let mut ray = *ray;
        let mut stack: Stack<(f32, u32), 40> = Stack::new((0.0, root));
        while let Some((enter, index)) = stack.pop() {
            if enter > ray.t_far * CONSERVATIVE + TINY {
                continue;
            }
            let node = &self.tree.nodes[index as usize];
            let (mut slots, enter) = Boxes::new(simd, node, &ray.origin).through(ray.inverse, ray.t_far);
            if slots == 0 {
                continue;
            }
            let enter = <[f32; WIDTH]>::from(enter);
            let mut inner = [(0.0_f32, 0_u32); WIDTH];
            let mut count = 0;
            while slots != 0 {
                let slot = slots.trailing_zeros() as usize;
                slots &= slots - 1;
                match node.child(slot) {
                    Child::Inner(child) => {
                        let mut at = count;
                        while at > 0 && inner[at - 1].0 < enter[slot] {
                            inner[at] = inner[at - 1];
                            at -= 1;
                        }
                        inner[at] = (enter[slot], child);
                        count += 1;
                    }
                    Child::Leaf(leaf) => {
                        let rows = self.triangles.load(simd, &leaf);
                        let (maybe, sure) = test_one(simd, &rows, (1 << leaf.len()) - 1, &ray);
                        if maybe != 0 {
                            match candidates.meet(&leaf, maybe, sure, ray.t_far) {
                                Some(t) => ray.t_far = t,
                                None => return,
                            }
                        }
                    }
                    Child::Empty => {}
                }
            }
            for &item in &inner[..count] {
                stack.push(item);
            }
        }
    }
}
