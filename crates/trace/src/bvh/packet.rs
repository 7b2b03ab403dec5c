//! Many rays from one point through one mesh: what they share is computed once.
//!
//! The rays share their origin, so boxes and triangles are made relative to it once for all of them, and one box
//! around all rays culls most children when rays are short. Where few rays are left they go on alone.
//! Every ray gets the answer that [`MeshBvh::any_hit`] gives it.

use dapple_scene::Aabb;
use dapple_scene::glam::Vec3;

use super::alpha::AlphaMaterials;
use super::mesh::MeshBvh;
use super::tree::{CONSERVATIVE, Child, Tree};
use super::triangle::{
    MeshRay, Plane, Triangle, axes_around, finite_inverse, intersect, main_axis, max, min,
};

/// Rays in a packet: one bit each.
pub(crate) const PACKET: usize = 64;
/// Rays tested at once.
const LANES: usize = 8;
const CHUNKS: usize = PACKET / LANES;
/// This few rays go on alone.
pub(crate) const SINGLE: u32 = 6;

type Lanes = [[f32; LANES]; CHUNKS];

/// Up to [`PACKET`] rays from one point in one mesh's space, sorted by main axis, and the nodes they still have to
/// visit. Made once and filled again, so that queries seldom allocate.
pub(crate) struct Packet {
    origin: [f32; 3],
    t_max: f32,
    /// Around all rays.
    min: Vec3,
    max: Vec3,
    directions: [[f32; 3]; PACKET],
    /// As in [`MeshRay`], side by side.
    inverse: [Lanes; 3],
    shear: [Lanes; 3],
    /// Lanes whose rays run along each axis.
    along: [u64; 3],
    /// The caller's index of each lane's ray.
    source: [u8; PACKET],
    stack: Vec<(u32, u64)>,
}

/// The ray segments' extent from their origin along each axis, a little more than exact.
pub(crate) fn reach(directions: impl Iterator<Item = Vec3>, t_max: f32) -> (Vec3, Vec3) {
    let (lo, hi) = directions.fold((Vec3::ZERO, Vec3::ZERO), |(lo, hi), d| (lo.min(d), hi.max(d)));
    // An axis along which no ray runs is reached nowhere, however long the rays (0 times infinity is NaN).
    let scale = |x: f32| if x == 0.0 { 0.0 } else { x * t_max * CONSERVATIVE };
    (lo.map(scale), hi.map(scale))
}

impl Packet {
    pub(crate) fn new() -> Packet {
        let zero = [[0.0; LANES]; CHUNKS];
        Packet {
            origin: [0.0; 3],
            t_max: 0.0,
            min: Vec3::ZERO,
            max: Vec3::ZERO,
            directions: [[0.0; 3]; PACKET],
            inverse: [zero; 3],
            shear: [zero; 3],
            along: [0; 3],
            source: [0; PACKET],
            stack: Vec::with_capacity(64),
        }
    }

    /// Fills it with those of at most [`PACKET`] `directions` whose bit is set in `open`.
    pub(crate) fn fill(&mut self, origin: Vec3, directions: &[Vec3], open: u64, t_max: f32) {
        self.origin = origin.to_array();
        self.t_max = t_max;
        let (mut axis_of, mut valid) = ([3_u8; PACKET], 0_u64);
        for (i, d) in directions.iter().enumerate().take(PACKET).filter(|(i, _)| open >> i & 1 != 0) {
            let d = d.to_array();
            let axis = main_axis(d);
            // As MeshRay::new: what cannot hit anything is left out.
            if d.iter().all(|x| x.is_finite()) && (1.0 / d[axis]).is_finite() {
                axis_of[i] = axis as u8;
                valid |= 1 << i;
            }
        }
        if !(origin.is_finite() && t_max > 0.0) {
            valid = 0;
        }
        let mut lane = 0;
        for axis in 0..3 {
            let first = lane;
            let [kx, ky, kz] = axes_around(axis);
            let mut rest = valid;
            while rest != 0 {
                let i = rest.trailing_zeros() as usize;
                rest &= rest - 1;
                if usize::from(axis_of[i]) != axis {
                    continue;
                }
                let d = directions[i].to_array();
                let (chunk, at) = (lane / LANES, lane % LANES);
                for (row, x) in self.inverse.iter_mut().zip(d) {
                    row[chunk][at] = finite_inverse(x);
                }
                for (row, x) in self.shear.iter_mut().zip([d[kx] / d[kz], d[ky] / d[kz], 1.0 / d[kz]]) {
                    row[chunk][at] = x;
                }
                self.directions[lane] = d;
                self.source[lane] = i as u8;
                lane += 1;
            }
            self.along[axis] = low_bits(lane) & !low_bits(first);
        }
        let used = self.source[..lane].iter().map(|&i| directions[usize::from(i)]);
        let (lo, hi) = reach(used, t_max);
        (self.min, self.max) = (origin + lo, origin + hi);
    }

    /// The rays (bits by the caller's index) that the mesh blocks.
    pub(crate) fn trace(&mut self, bvh: &MeshBvh, alpha: &AlphaMaterials) -> u64 {
        let all = self.along[0] | self.along[1] | self.along[2];
        let mut open = all;
        let mut stack = std::mem::take(&mut self.stack);
        stack.clear();
        if !bvh.tree.nodes.is_empty() {
            stack.push((0, all));
        }
        while let Some((index, rays)) = stack.pop() {
            let rays = rays & open;
            if rays.count_ones() <= SINGLE {
                open &= !self.trace_singly(bvh, alpha, index, rays);
                continue;
            }
            let node = &bvh.tree.nodes[index as usize];
            let mut slots = node.touching(self.min, self.max);
            while slots != 0 {
                let slot = slots.trailing_zeros() as usize;
                slots &= slots - 1;
                let rays = self.rays_through(&node.child_bounds(slot), rays & open);
                if rays == 0 {
                    continue;
                }
                match node.child(slot) {
                    Child::Inner(child) => stack.push((child, rays)),
                    Child::Leaf(range) => {
                        let mut rays = rays;
                        for triangle in &bvh.triangles[range] {
                            rays &= !self.blocked_by(triangle, rays, bvh, alpha, &mut open);
                        }
                    }
                    Child::Empty => {}
                }
            }
        }
        self.stack = stack;
        self.sources(all & !open)
    }

    /// Bits by the caller's index from bits by lane.
    pub(crate) fn sources(&self, mut lanes: u64) -> u64 {
        let mut sources = 0;
        while lanes != 0 {
            sources |= 1 << self.source[lanes.trailing_zeros() as usize];
            lanes &= lanes - 1;
        }
        sources
    }

    /// The directions by lane.
    pub(crate) fn directions(&self) -> &[[f32; 3]; PACKET] {
        &self.directions
    }

    /// Calls `found` with the primitives of `tree` whose box some rays may touch, and those rays (bits by lane).
    pub(crate) fn primitives_through(
        &self,
        tree: &Tree,
        bounds_of: impl Fn(u32) -> Aabb,
        mut found: impl FnMut(u32, u64),
    ) {
        let mut stack = Vec::with_capacity(32);
        if !tree.nodes.is_empty() {
            stack.push((0, self.along[0] | self.along[1] | self.along[2]));
        }
        while let Some((index, rays)) = stack.pop() {
            let node = &tree.nodes[index as usize];
            let mut slots = node.touching(self.min, self.max);
            while slots != 0 {
                let slot = slots.trailing_zeros() as usize;
                slots &= slots - 1;
                let rays = self.rays_through(&node.child_bounds(slot), rays);
                if rays == 0 {
                    continue;
                }
                match node.child(slot) {
                    Child::Inner(child) => stack.push((child, rays)),
                    Child::Leaf(range) => {
                        for &primitive in &tree.order[range] {
                            let rays = self.rays_through(&bounds_of(primitive), rays);
                            if rays != 0 {
                                found(primitive, rays);
                            }
                        }
                    }
                    Child::Empty => {}
                }
            }
        }
    }

    fn ray(&self, lane: usize) -> MeshRay {
        let (chunk, at) = (lane / LANES, lane % LANES);
        let axis = (0..3).find(|&a| self.along[a] >> lane & 1 != 0).unwrap_or(2);
        MeshRay {
            origin: self.origin,
            direction: self.directions[lane],
            inverse: [0, 1, 2].map(|a| self.inverse[a][chunk][at]),
            axes: axes_around(axis),
            shear: [0, 1, 2].map(|a| self.shear[a][chunk][at]),
            t_max: self.t_max,
        }
    }

    fn trace_singly(&self, bvh: &MeshBvh, alpha: &AlphaMaterials, root: u32, mut rays: u64) -> u64 {
        let mut blocked = 0;
        while rays != 0 {
            let lane = rays.trailing_zeros() as usize;
            rays &= rays - 1;
            if bvh.any_hit(root, &self.ray(lane), alpha) {
                blocked |= 1 << lane;
            }
        }
        blocked
    }

    /// Those of `rays` that may touch a box. The answer for the empty box is of no meaning.
    #[inline(always)]
    fn rays_through(&self, bounds: &Aabb, rays: u64) -> u64 {
        let [ox, oy, oz] = self.origin;
        let (x0, y0, z0) = (bounds.min.x - ox, bounds.min.y - oy, bounds.min.z - oz);
        let (x1, y1, z1) = (bounds.max.x - ox, bounds.max.y - oy, bounds.max.z - oz);
        let t_max = self.t_max;
        let mut through = 0;
        for chunk in 0..CHUNKS {
            if rays >> (chunk * LANES) & low_bits(LANES) == 0 {
                continue;
            }
            let (ix, iy, iz) = (&self.inverse[0][chunk], &self.inverse[1][chunk], &self.inverse[2][chunk]);
            let mut mask = 0_u32;
            for i in 0..LANES {
                let (ax, bx) = (x0 * ix[i], x1 * ix[i]);
                let (ay, by) = (y0 * iy[i], y1 * iy[i]);
                let (az, bz) = (z0 * iz[i], z1 * iz[i]);
                let enter = max(max(min(ax, bx), min(ay, by)), max(min(az, bz), 0.0));
                let leave = min(min(max(ax, bx), max(ay, by)), min(max(az, bz), t_max));
                mask |= u32::from(enter <= leave * CONSERVATIVE) << i;
            }
            through |= u64::from(mask) << (chunk * LANES);
        }
        through & rays
    }

    /// Those of `rays` that `triangle` blocks; they are closed in `open` too. Same arithmetic as [`intersect`].
    #[inline(always)]
    fn blocked_by(
        &self,
        triangle: &Triangle,
        rays: u64,
        bvh: &MeshBvh,
        alpha: &AlphaMaterials,
        open: &mut u64,
    ) -> u64 {
        let (mut sure, mut unsure) = (0_u64, 0_u64);
        let mut plane = None;
        for axis in 0..3 {
            let group = rays & self.along[axis];
            if group == 0 {
                continue;
            }
            let axes = axes_around(axis);
            let corners = triangle.corners.map(|c| axes.map(|k| c[k] - self.origin[k]));
            let mut inside = 0;
            for chunk in 0..CHUNKS {
                if group >> (chunk * LANES) & low_bits(LANES) == 0 {
                    continue;
                }
                let (within, ask) = self.lanes_inside(chunk, &corners);
                inside |= u64::from(within) << (chunk * LANES) & group;
                unsure |= u64::from(ask) << (chunk * LANES) & group;
            }
            while inside != 0 {
                let lane = inside.trailing_zeros() as usize;
                inside &= inside - 1;
                let plane = plane.get_or_insert_with(|| Plane::new(&triangle.corners, &self.origin));
                let sz = self.shear[2][lane / LANES][lane % LANES];
                let corner_t = corners.map(|c| sz * c[2]);
                if plane.distance(&self.directions[lane], corner_t, self.t_max).is_some() {
                    sure |= 1 << lane;
                }
            }
        }
        if triangle.alpha != super::alpha::OPAQUE {
            (sure, unsure) = (0, sure | unsure);
        }
        while unsure != 0 {
            let lane = unsure.trailing_zeros() as usize;
            unsure &= unsure - 1;
            if let Some(hit) = intersect(&self.ray(lane), triangle)
                && alpha.blocks(&bvh.alpha, triangle.alpha, hit.weights)
            {
                sure |= 1 << lane;
            }
        }
        *open &= !sure;
        sure
    }

    /// Lanes whose line passes inside a triangle (corners relative to the origin, in the order of the lanes' axes),
    /// and lanes that need the exact test.
    #[inline(always)]
    fn lanes_inside(&self, chunk: usize, corners: &[[f32; 3]; 3]) -> (u32, u32) {
        let (sx, sy) = (&self.shear[0][chunk], &self.shear[1][chunk]);
        let [[ax0, ay0, az0], [bx0, by0, bz0], [cx0, cy0, cz0]] = *corners;
        let (mut inside, mut ask) = (0_u32, 0_u32);
        for i in 0..LANES {
            let (ax, ay) = (ax0 - sx[i] * az0, ay0 - sy[i] * az0);
            let (bx, by) = (bx0 - sx[i] * bz0, by0 - sy[i] * bz0);
            let (cx, cy) = (cx0 - sx[i] * cz0, cy0 - sy[i] * cz0);
            let u = cx * by - cy * bx;
            let v = ax * cy - ay * cx;
            let w = bx * ay - by * ax;
            let miss = ((u < 0.0) | (v < 0.0) | (w < 0.0)) & ((u > 0.0) | (v > 0.0) | (w > 0.0));
            let det = u + v + w;
            let exact = (u == 0.0) | (v == 0.0) | (w == 0.0) | !det.is_finite();
            inside |= u32::from(!miss & !exact) << i;
            ask |= u32::from(!miss & exact) << i;
        }
        (inside, ask)
    }
}

fn low_bits(n: usize) -> u64 {
    if n >= 64 { u64::MAX } else { (1 << n) - 1 }
}
