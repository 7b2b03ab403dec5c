//! A bundle of rays through one tree.

use std::ops::Range;

use fearless_simd::{Simd, SimdBase, SimdFloat, SimdMask, f32x8, u8x64};

use super::alpha::AlphaMaterials;
use super::bundle::{BUNDLE, Bundle, CHUNKS, LANES, Reach};
use super::filter::Block;
use super::mesh::MeshBvh;
use super::stack::Stack;
use super::tree::{CONSERVATIVE, Child, Node, TINY, Tree, WIDTH};
use super::triangle::QuickRay;

/// The boxes of a node's children relative to the origin: smallest x, y, z, then largest.
pub(crate) struct Boxes<S: Simd> {
    pub(crate) planes: [f32x8<S>; 6],
}

impl<S: Simd> Boxes<S> {
    #[inline(always)]
    pub(crate) fn new(simd: S, node: &Node, origin: &[f32; 3]) -> Boxes<S> {
        let b = &node.bounds;
        Boxes {
            planes: [
                f32x8::load_array_ref(simd, &b[0]) - origin[0],
                f32x8::load_array_ref(simd, &b[1]) - origin[1],
                f32x8::load_array_ref(simd, &b[2]) - origin[2],
                f32x8::load_array_ref(simd, &b[3]) - origin[0],
                f32x8::load_array_ref(simd, &b[4]) - origin[1],
                f32x8::load_array_ref(simd, &b[5]) - origin[2],
            ],
        }
    }

    /// The children that rays within `reach` may touch, and the squared distance to each.
    #[inline(always)]
    pub(crate) fn within(&self, simd: S, reach: &Reach) -> (u32, f32x8<S>) {
        let [x0, y0, z0, x1, y1, z1] = self.planes;
        let (lo, hi) = (&reach.min, &reach.max);
        let apart = x0.simd_gt(hi[0]) | y0.simd_gt(hi[1]) | z0.simd_gt(hi[2]);
        let apart = apart | x1.simd_lt(lo[0]) | y1.simd_lt(lo[1]) | z1.simd_lt(lo[2]);
        let zero = f32x8::splat(simd, 0.0);
        let (x, y, z) = (x0.max(-x1).max(zero), y0.max(-y1).max(zero), z0.max(-z1).max(zero));
        let distance2 = x.mul_add(x, y.mul_add(y, z * z));
        // The corner farthest along the axis, with a margin for rounding.
        let (mut height, mut margin) = (zero, zero);
        for k in 0..3 {
            let a = reach.axis[k];
            let far = if a < 0.0 { self.planes[k] } else { self.planes[k + 3] };
            height = far.mul_add(a, height);
            margin = far.abs().mul_add(a.abs(), margin);
        }
        let behind = margin.mul_add(CONSERVATIVE - 1.0, height).simd_lt(reach.floor);
        let out = apart | behind | distance2.simd_gt(reach.radius2);
        (!(out.to_bitmask() as u32) & 0xff, distance2)
    }

    /// The children that one ray may touch within `t_max`, and where it enters each.
    #[inline(always)]
    pub(crate) fn through(&self, inverse: [f32; 3], t_max: f32) -> (u32, f32x8<S>) {
        let [x0, y0, z0, x1, y1, z1] = self.planes;
        let [ix, iy, iz] = inverse;
        let (ax, bx, ay, by, az, bz) = (x0 * ix, x1 * ix, y0 * iy, y1 * iy, z0 * iz, z1 * iz);
        let enter = ax.min(bx).max(ay.min(by)).max(az.min(bz).max(0.0));
        let leave = ax.max(bx).min(ay.max(by)).min(az.max(bz).min(t_max));
        (enter.simd_le(leave.mul_add(CONSERVATIVE, TINY)).to_bitmask() as u32, enter)
    }

    #[inline(always)]
    fn spread(&self) -> [[f32; WIDTH]; 6] {
        let mut planes = [[0.0; WIDTH]; 6];
        for (out, row) in planes.iter_mut().zip(&self.planes) {
            row.store_slice(out);
        }
        planes
    }
}

/// Those of `rays` that may touch the box in a slot.
#[inline(always)]
fn rays_through<S: Simd>(
    simd: S,
    bundle: &Bundle,
    planes: &[[f32; WIDTH]; 6],
    slot: usize,
    t_max: f32,
    rays: u64,
) -> u64 {
    let (x0, y0, z0) = (planes[0][slot], planes[1][slot], planes[2][slot]);
    let (x1, y1, z1) = (planes[3][slot], planes[4][slot], planes[5][slot]);
    let mut through = 0;
    for chunk in 0..CHUNKS {
        if rays >> (chunk * LANES) & 0xff == 0 {
            continue;
        }
        let [ix, iy, iz] = bundle.chunk(simd, &bundle.inverse, chunk);
        let (ax, bx, ay, by, az, bz) = (ix * x0, ix * x1, iy * y0, iy * y1, iz * z0, iz * z1);
        let enter = ax.min(bx).max(ay.min(by)).max(az.min(bz).max(0.0));
        let leave = ax.max(bx).min(ay.max(by)).min(az.max(bz).min(t_max));
        through |= enter.simd_le(leave.mul_add(CONSERVATIVE, TINY)).to_bitmask() << (chunk * LANES);
    }
    through & rays
}

/// What a traversal reads besides the rays.
#[derive(Clone, Copy)]
pub(crate) struct Blocker<'a> {
    pub(crate) bvh: &'a MeshBvh,
    pub(crate) alpha: &'a AlphaMaterials,
}

impl Blocker<'_> {
    /// The exact test of the triangle in a lane of a leaf.
    #[cold]
    #[inline(never)]
    fn blocks(&self, ray: &QuickRay, range: &Range<usize>, lane: usize) -> bool {
        ray.exact().is_some_and(|ray| self.bvh.exact_hit(&ray, range, lane, self.alpha).is_some())
    }
}

/// What a traversal does at leaves. A trait and not a closure, because closures are not compiled for the vectors of their
/// caller unless they happen to be inlined.
pub(crate) trait Visitor<S: Simd> {
    /// Leaves are visited in order of distance like nodes, not as soon as they are met.
    const IN_ORDER: bool;
    /// Which of `rays` are blocked in a leaf.
    fn visit(&mut self, simd: S, range: Range<usize>, rays: u64) -> u64;
    /// Which of few `rays` are blocked in a node, found one by one; `None` if they are to go on together.
    #[inline(always)]
    fn few(&mut self, _: S, _node: u32, _rays: u64) -> Option<u64> {
        None
    }
}

/// This few rays go on alone, each to what is nearest to it.
const FEW: u32 = 3;

struct Leaves<'a> {
    bundle: &'a Bundle,
    blocker: Blocker<'a>,
    t_far: f32,
}

impl<S: Simd> Visitor<S> for Leaves<'_> {
    const IN_ORDER: bool = false;
    #[inline(always)]
    fn visit(&mut self, simd: S, range: Range<usize>, rays: u64) -> u64 {
        trace_leaf(simd, self.bundle, self.blocker, &range, self.t_far, rays)
    }

    #[inline(always)]
    fn few(&mut self, simd: S, node: u32, mut rays: u64) -> Option<u64> {
        if rays.count_ones() > FEW {
            return None;
        }
        let mut blocked = 0;
        while rays != 0 {
            let lane = rays.trailing_zeros() as usize;
            rays &= rays - 1;
            let ray = self.bundle.ray(lane, self.t_far);
            if self.blocker.bvh.any_hit(simd, node, &ray, self.blocker.alpha) {
                blocked |= 1 << lane;
            }
        }
        Some(blocked)
    }
}

/// The rays (bits by lane) among `rays` that the mesh blocks. The bundle must be prepared.
#[inline(always)]
pub(crate) fn trace_bundle<S: Simd>(
    simd: S,
    bundle: &Bundle,
    reach: &Reach,
    t_far: f32,
    blocker: Blocker<'_>,
    rays: u64,
) -> u64 {
    let rays = rays & bundle.valid;
    let tree = &blocker.bvh.tree;
    if rays == 0 || tree.nodes.is_empty() {
        return 0;
    }
    traverse(simd, bundle, reach, t_far, tree, rays, &mut Leaves { bundle, blocker, t_far })
}

/// Calls `visitor` with leaves and the rays (of `rays`) that may touch them; those that are blocked there go no further.
/// Returns all that are.
#[inline(always)]
pub(crate) fn traverse<S: Simd, V: Visitor<S>>(
    simd: S,
    bundle: &Bundle,
    reach: &Reach,
    t_far: f32,
    tree: &Tree,
    rays: u64,
    visitor: &mut V,
) -> u64 {
    let mut open = rays;
    // A node's index and 0, or a leaf's first primitive and their number.
    let mut stack: Stack<(u32, u32, u64), 48> = Stack::new((0, 0, rays));
    while let Some((index, count, rays)) = stack.pop() {
        let rays = rays & open;
        if rays == 0 {
            continue;
        }
        if V::IN_ORDER && count > 0 {
            open &= !visitor.visit(simd, index as usize..(index + count) as usize, rays);
            continue;
        }
        if let Some(blocked) = visitor.few(simd, index, rays) {
            open &= !blocked;
            continue;
        }
        let node = &tree.nodes[index as usize];
        let boxes = Boxes::new(simd, node, &bundle.origin);
        let (mut slots, distance2) = boxes.within(simd, reach);
        if slots == 0 {
            continue;
        }
        let mut through = [0_u64; WIDTH];
        rays_by_child(simd, bundle, &boxes, t_far, rays, slots, &mut through);
        let distance2 = <[f32; WIDTH]>::from(distance2);

        let mut later = [(0.0_f32, (0_u32, 0_u32, 0_u64)); WIDTH];
        let mut pushed = 0;
        while slots != 0 {
            let slot = slots.trailing_zeros() as usize;
            slots &= slots - 1;
            let rays = through[slot] & open;
            if rays == 0 {
                continue;
            }
            let entry = match node.child(slot) {
                Child::Inner(child) => (child, 0, rays),
                Child::Leaf(range) if V::IN_ORDER => (range.start as u32, range.len() as u32, rays),
                Child::Leaf(range) => {
                    open &= !visitor.visit(simd, range, rays);
                    continue;
                }
                Child::Empty => continue,
            };
            // Nearest on top; the order does not decide the result, only the time.
            let mut at = pushed;
            while at > 0 && later[at - 1].0 < distance2[slot] {
                later[at] = later[at - 1];
                at -= 1;
            }
            later[at] = (distance2[slot], entry);
            pushed += 1;
        }
        for &(_, entry) in &later[..pushed] {
            stack.push(entry);
        }
    }
    rays & !open
}

/// Which of `rays` may touch which of the children in `slots`.
#[inline(always)]
fn rays_by_child<S: Simd>(
    simd: S,
    bundle: &Bundle,
    boxes: &Boxes<S>,
    t_far: f32,
    rays: u64,
    mut slots: u32,
    through: &mut [u64; WIDTH],
) {
    // A ray against eight children costs about as much as eight rays against one child.
    if rays.count_ones() >= slots.count_ones() * active_chunks(rays) {
        let planes = boxes.spread();
        while slots != 0 {
            let slot = slots.trailing_zeros() as usize;
            slots &= slots - 1;
            through[slot] = rays_through(simd, bundle, &planes, slot, t_far, rays);
        }
        return;
    }
    let mut children = [0_u8; BUNDLE];
    let mut rest = rays;
    while rest != 0 {
        let lane = rest.trailing_zeros() as usize;
        rest &= rest - 1;
        let inverse = [0, 1, 2].map(|axis| bundle.inverse[axis][lane]);
        children[lane] = boxes.through(inverse, t_far).0 as u8;
    }
    let children = u8x64::load_array(simd, children);
    while slots != 0 {
        let slot = slots.trailing_zeros() as usize;
        slots &= slots - 1;
        through[slot] = (children & (1_u8 << slot)).simd_gt(0).to_bitmask();
    }
}

/// Those of `rays` that the leaf's triangles block.
#[inline(always)]
fn trace_leaf<S: Simd>(
    simd: S,
    bundle: &Bundle,
    blocker: Blocker<'_>,
    range: &Range<usize>,
    t_far: f32,
    rays: u64,
) -> u64 {
    let n = range.len();
    let rows = blocker.bvh.triangles.load(simd, range);
    let block = Block::new(simd, &rows, n, &bundle.origin, t_far, bundle.direction_max);
    let special = blocker.bvh.special_lanes(range);
    let exact = |lane: usize, mut triangles: u32| {
        let ray = bundle.ray(lane, t_far);
        while triangles != 0 {
            let triangle = triangles.trailing_zeros() as usize;
            triangles &= triangles - 1;
            if blocker.blocks(&ray, range, triangle) {
                return true;
            }
        }
        false
    };
    let mut blocked = 0;
    if rays.count_ones() <= n as u32 * active_chunks(rays) {
        let mut rest = rays;
        while rest != 0 {
            let lane = rest.trailing_zeros() as usize;
            rest &= rest - 1;
            let (maybe, sure) = block.test(simd, bundle.direction(lane));
            if maybe != 0 && (sure & !special != 0 || exact(lane, maybe)) {
                blocked |= 1 << lane;
            }
        }
        return blocked;
    }
    let spread = block.spread();
    for triangle in 0..n {
        let lane_of_block = spread.lane(simd, triangle);
        let opaque = special >> triangle & 1 == 0;
        for chunk in 0..CHUNKS {
            let open = (rays & !blocked) >> (chunk * LANES) & 0xff;
            if open == 0 {
                continue;
            }
            let (maybe, sure) = lane_of_block.test(&bundle.chunk(simd, &bundle.directions, chunk));
            if maybe == 0 {
                continue;
            }
            let sure = if opaque { u64::from(sure) & open } else { 0 };
            blocked |= sure << (chunk * LANES);
            let mut rest = u64::from(maybe) & open & !sure;
            while rest != 0 {
                let lane = chunk * LANES + rest.trailing_zeros() as usize;
                rest &= rest - 1;
                if exact(lane, 1 << triangle) {
                    blocked |= 1 << lane;
                }
            }
        }
    }
    blocked
}

/// Groups of [`LANES`] rays in which there is one.
#[inline(always)]
pub(crate) fn active_chunks(rays: u64) -> u32 {
    let any = rays | rays >> 4;
    let any = any | any >> 2;
    ((any | any >> 1) & 0x0101_0101_0101_0101).count_ones()
}
