//! A bundle of rays through one tree.

use std::ops::Range;

use fearless_simd::{Simd, SimdBase, SimdFloat, SimdMask, f32x8, u8x64};

use super::alpha::AlphaMaterials;
use super::bundle::{BUNDLE, Bundle, CHUNKS, LANES, Reach};
use super::filter::Block;
use super::mesh::MeshBvh;
use super::stack::Stack;
use super::tree::{CONSERVATIVE, Child, Node, Tree, WIDTH};
use super::triangle::MeshRay;

/// A ray against the eight children of a node costs about as much as eight rays against one child.
const CHUNK_COST: u32 = 1;

/// The boxes of a node's children relative to the origin: smallest x, y, z, then largest.
pub(crate) struct Boxes<S: Simd> {
    pub(crate) planes: [f32x8<S>; 6],
}

impl<S: Simd> Boxes<S> {
    #[inline(always)]
    pub(crate) fn new(simd: S, node: &Node, origin: &[f32; 3]) -> Boxes<S> {
        let o = origin.map(|x| f32x8::splat(simd, x));
        Boxes {
            planes: std::array::from_fn(|row| f32x8::load_array_ref(simd, &node.bounds[row]) - o[row % 3]),
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
        let outside = |lo: f32x8<S>, hi: f32x8<S>| lo.max(-hi).max(zero);
        let (x, y, z) = (outside(x0, x1), outside(y0, y1), outside(z0, z1));
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
    pub(crate) fn through(&self, simd: S, inverse: [f32; 3], t_max: f32) -> (u32, f32x8<S>) {
        let pick = |axis: usize| {
            let i = f32x8::splat(simd, inverse[axis]);
            let (lo, hi) = (self.planes[axis] * i, self.planes[axis + 3] * i);
            (lo.min(hi), lo.max(hi))
        };
        let ((x0, x1), (y0, y1), (z0, z1)) = (pick(0), pick(1), pick(2));
        let enter = x0.max(y0).max(z0.max(0.0));
        let leave = x1.min(y1).min(z1.min(t_max));
        (enter.simd_le(leave * CONSERVATIVE).to_bitmask() as u32, enter)
    }

    #[inline(always)]
    fn spread(&self) -> [[f32; WIDTH]; 6] {
        self.planes.map(<[f32; WIDTH]>::from)
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
    let [x0, y0, z0, x1, y1, z1] = planes.map(|row| f32x8::splat(simd, row[slot]));
    let mut through = 0;
    for chunk in 0..CHUNKS {
        if rays >> (chunk * LANES) & 0xff == 0 {
            continue;
        }
        let [ix, iy, iz] = bundle.chunk(simd, &bundle.inverse, chunk);
        let (ax, bx, ay, by, az, bz) = (x0 * ix, x1 * ix, y0 * iy, y1 * iy, z0 * iz, z1 * iz);
        let enter = ax.min(bx).max(ay.min(by)).max(az.min(bz).max(0.0));
        let leave = ax.max(bx).min(ay.max(by)).min(az.max(bz).min(t_max));
        through |= enter.simd_le(leave * CONSERVATIVE).to_bitmask() << (chunk * LANES);
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
    fn blocks(&self, ray: Option<MeshRay>, range: &Range<usize>, lane: usize) -> bool {
        ray.is_some_and(|ray| self.bvh.exact_hit(&ray, range, lane, self.alpha).is_some())
    }
}

/// The rays (bits by lane) among `rays` that the mesh blocks. The bundle must be prepared.
#[inline(always)]
pub(crate) fn trace_bundle<S: Simd>(simd: S, bundle: &Bundle, blocker: Blocker<'_>, rays: u64) -> u64 {
    let rays = rays & bundle.valid;
    let tree = &blocker.bvh.tree;
    if rays == 0 || tree.nodes.is_empty() {
        return 0;
    }
    let (reach, t_far) = bundle.reach(simd, &blocker.bvh.bounds);
    traverse(simd, bundle, &reach, t_far, tree, rays, false, |range, rays| {
        trace_leaf(simd, bundle, blocker, &range, t_far, rays)
    })
}

/// Calls `visit` with leaves and the rays (of `rays`) that may touch them; it returns those that are blocked there, which
/// go no further. Returns all that are. `in_order`: leaves are visited in order of distance like nodes, not at once.
#[inline(always)]
pub(crate) fn traverse<S: Simd>(
    simd: S,
    bundle: &Bundle,
    reach: &Reach,
    t_far: f32,
    tree: &Tree,
    rays: u64,
    in_order: bool,
    mut visit: impl FnMut(Range<usize>, u64) -> u64,
) -> u64 {
    let mut open = rays;
    // A node's index and 0, or a leaf's first primitive and their number.
    let mut stack: Stack<(u32, u32, u64)> = Stack::new((0, 0, rays));
    while let Some((index, count, rays)) = stack.pop() {
        let rays = rays & open;
        if rays == 0 {
            continue;
        }
        if in_order && count > 0 {
            open &= !visit(index as usize..(index + count) as usize, rays);
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
                Child::Leaf(range) if in_order => (range.start as u32, range.len() as u32, rays),
                Child::Leaf(range) => {
                    open &= !visit(range, rays);
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
    if rays.count_ones() >= CHUNK_COST * slots.count_ones() * active_chunks(rays) {
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
        children[lane] = boxes.through(simd, inverse, t_far).0 as u8;
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
        let ray = bundle.ray(lane);
        while triangles != 0 {
            let triangle = triangles.trailing_zeros() as usize;
            triangles &= triangles - 1;
            if blocker.blocks(ray, range, triangle) {
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
