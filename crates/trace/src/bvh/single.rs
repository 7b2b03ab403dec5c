//! Single rays through one tree.

use fearless_simd::Simd;

use super::alpha::AlphaMaterials;
use super::filter::Block;
use super::mesh::MeshBvh;
use super::stack::Stack;
use super::traverse::Boxes;
use super::tree::{CONSERVATIVE, Child, WIDTH};
use super::triangle::{MeshRay, TriangleHit};

impl MeshBvh {
    /// Whether anything blocks the ray.
    #[inline(always)]
    pub(crate) fn any_hit<S: Simd>(&self, simd: S, ray: &MeshRay, alpha: &AlphaMaterials) -> bool {
        let mut blocked = false;
        let t_far = self.t_far(ray);
        self.visit_leaves(simd, ray, t_far, |simd, range, t_far| {
            let block = self.block(simd, ray, &range, t_far);
            let (mut maybe, sure) = block.test(simd, ray.direction);
            blocked = sure & !self.special_lanes(&range) != 0;
            while maybe != 0 && !blocked {
                let lane = maybe.trailing_zeros() as usize;
                maybe &= maybe - 1;
                blocked = self.exact_hit(ray, &range, lane, alpha).is_some();
            }
            if blocked { None } else { Some(t_far) }
        });
        blocked
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
        let mut best: Option<(u32, TriangleHit)> = None;
        let mut ray = *ray;
        ray.t_max = ray.t_max.min(t_best);
        let t_far = self.t_far(&ray);
        self.visit_leaves(simd, &ray, t_far, |simd, range, t_far| {
            let (mut maybe, _) = self.block(simd, &ray, &range, t_far).test(simd, ray.direction);
            let mut t_far = t_far;
            while maybe != 0 {
                let lane = maybe.trailing_zeros() as usize;
                maybe &= maybe - 1;
                if let Some((id, hit)) = self.exact_hit(&ray, &range, lane, alpha)
                    && best.as_ref().is_none_or(|(i, b)| hit.t < b.t || (hit.t == b.t && id < *i))
                {
                    t_far = t_far.min(hit.t);
                    best = Some((id, hit));
                }
            }
            Some(t_far)
        });
        best
    }

    /// Calls `found` with everything that the ray meets, in no order.
    #[inline(always)]
    pub(crate) fn all_hits<S: Simd>(
        &self,
        simd: S,
        ray: &MeshRay,
        alpha: &AlphaMaterials,
        found: &mut impl FnMut(u32, TriangleHit),
    ) {
        let t_far = self.t_far(ray);
        self.visit_leaves(simd, ray, t_far, |simd, range, t_far| {
            let (mut maybe, _) = self.block(simd, ray, &range, t_far).test(simd, ray.direction);
            while maybe != 0 {
                let lane = maybe.trailing_zeros() as usize;
                maybe &= maybe - 1;
                if let Some((id, hit)) = self.exact_hit(ray, &range, lane, alpha) {
                    found(id, hit);
                }
            }
            Some(t_far)
        });
    }

    /// How far the ray needs to go to pass all of the tree: finite, at most its own length.
    #[inline(always)]
    fn t_far(&self, ray: &MeshRay) -> f32 {
        let mut extent = 0.0_f32;
        for axis in 0..3 {
            let (lo, hi) = (self.bounds.min[axis] - ray.origin[axis], self.bounds.max[axis] - ray.origin[axis]);
            extent = extent.max(lo.abs()).max(hi.abs());
        }
        ray.t_max.min(8.0 * extent * ray.shear[2].abs()).min(f32::MAX)
    }

    #[inline(always)]
    fn block<S: Simd>(&self, simd: S, ray: &MeshRay, range: &std::ops::Range<usize>, t_far: f32) -> Block<S> {
        let rows = self.triangles.load(simd, range);
        let direction_max = ray.direction[ray.axes[2]].abs();
        Block::new(simd, &rows, range.len(), &ray.origin, t_far, direction_max)
    }

    /// Calls `visit` with leaves whose box the ray may touch, near ones mostly first; it returns how far the ray still
    /// goes, or `None` to end.
    #[inline(always)]
    fn visit_leaves<S: Simd>(
        &self,
        simd: S,
        ray: &MeshRay,
        mut t_far: f32,
        mut visit: impl FnMut(S, std::ops::Range<usize>, f32) -> Option<f32>,
    ) {
        if self.tree.nodes.is_empty() {
            return;
        }
        let mut stack: Stack<(f32, u32)> = Stack::new((0.0, 0));
        while let Some((enter, index)) = stack.pop() {
            if enter > t_far * CONSERVATIVE {
                continue;
            }
            let node = &self.tree.nodes[index as usize];
            let (mut slots, enter) = Boxes::new(simd, node, &ray.origin).through(simd, ray.inverse, t_far);
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
                    Child::Leaf(range) => match visit(simd, range, t_far) {
                        Some(t) => t_far = t,
                        None => return,
                    },
                    Child::Empty => {}
                }
            }
            for &item in &inner[..count] {
                stack.push(item);
            }
        }
    }
}
