//! Up to 64 rays from one point, side by side, and what all of them have in common.

use dapple_scene::Aabb;
use dapple_scene::glam::Vec3;
use fearless_simd::{Select, Simd, SimdBase, SimdMask, f32x8};

use super::placement::Placement;
use super::tree::CONSERVATIVE;
use super::triangle::{FARTHEST, LONGEST, QuickRay, SHORTEST};

/// Rays in a bundle: one bit each.
pub(crate) const BUNDLE: usize = 64;
/// Rays tested at once.
pub(crate) const LANES: usize = 8;
/// Groups of [`LANES`] rays.
pub(crate) const CHUNKS: usize = BUNDLE / LANES;

/// Coordinates of all rays: x, y, z.
type Coordinates = [[f32; BUNDLE]; 3];

/// Rays from one point in one space. Unused lanes have no direction.
pub(crate) struct Bundle {
    pub(crate) origin: [f32; 3],
    /// How far the rays go, in lengths of their directions.
    pub(crate) t_max: f32,
    /// Lanes that can hit anything: numbers finite, a direction, a length.
    pub(crate) valid: u64,
    pub(crate) directions: Coordinates,
    /// 1 / direction, finite also where the direction has no such component.
    pub(crate) inverse: Coordinates,
    /// Largest coordinate of any direction; the smallest main coordinate of any.
    pub(crate) direction_max: f32,
    main_min: f32,
    /// A direction from which no ray turns away by more than a right angle, if there is one.
    axis: [f32; 3],
}

/// Where the rays of a bundle can get, relative to their origin: a box, a ball and a half space.
pub(crate) struct Reach {
    pub(crate) min: [f32; 3],
    pub(crate) max: [f32; 3],
    /// Squared radius of the ball.
    pub(crate) radius2: f32,
    /// `axis · x ≥ floor`.
    pub(crate) axis: [f32; 3],
    pub(crate) floor: f32,
}

impl Bundle {
    pub(crate) fn new() -> Bundle {
        let zero = [[0.0; BUNDLE]; 3];
        Bundle {
            origin: [0.0; 3],
            t_max: 0.0,
            valid: 0,
            directions: zero,
            inverse: zero,
            direction_max: 0.0,
            main_min: 0.0,
            axis: [0.0; 3],
        }
    }

    /// Takes up to [`BUNDLE`] directions.
    pub(crate) fn fill(&mut self, origin: Vec3, directions: &[Vec3], t_max: f32) {
        self.origin = origin.to_array();
        self.t_max = t_max;
        let [x, y, z] = &mut self.directions;
        for (((x, y), z), d) in x.iter_mut().zip(y).zip(z).zip(directions) {
            [*x, *y, *z] = d.to_array();
        }
    }

    /// The same rays in a mesh's space, lane by lane, in groups that hold `wanted` ones.
    #[inline(always)]
    pub(crate) fn place<S: Simd>(&mut self, simd: S, world: &Bundle, placement: &Placement, wanted: u64) {
        self.origin = placement.position(Vec3::from_array(world.origin)).to_array();
        self.t_max = world.t_max;
        let [x, y, z] = placement.columns();
        for chunk in 0..CHUNKS {
            if wanted >> (chunk * LANES) & 0xff == 0 {
                continue;
            }
            let [dx, dy, dz] = world.chunk(simd, &world.directions, chunk);
            for axis in 0..3 {
                // In the order of the scalar product, without fusing, so that single rays see the same numbers.
                let sum = dx * x[axis] + dy * y[axis] + dz * z[axis];
                sum.store_slice(&mut self.directions[axis][chunk * LANES..(chunk + 1) * LANES]);
            }
        }
    }

    #[inline(always)]
    pub(crate) fn chunk<S: Simd>(&self, simd: S, of: &Coordinates, chunk: usize) -> [f32x8<S>; 3] {
        let range = chunk * LANES..(chunk + 1) * LANES;
        [
            f32x8::from_slice(simd, &of[0][range.clone()]),
            f32x8::from_slice(simd, &of[1][range.clone()]),
            f32x8::from_slice(simd, &of[2][range]),
        ]
    }

    /// Computes what follows from the directions, for the rays in `wanted`.
    #[inline(always)]
    pub(crate) fn prepare<S: Simd>(&mut self, simd: S, wanted: u64) {
        let zero = f32x8::splat(simd, 0.0);
        let (mut valid, mut main_min, mut direction_max) = (0, f32x8::splat(simd, f32::MAX), zero);
        let mut sum = [zero; 3];
        for chunk in 0..CHUNKS {
            if wanted >> (chunk * LANES) & 0xff == 0 {
                continue;
            }
            let d = self.chunk(simd, &self.directions, chunk);
            let main = d[0].abs().max(d[1].abs()).max(d[2].abs());
            // As in `MeshRay::new`; a NaN among them makes the sum NaN.
            let finite = (d[0] + d[1] + d[2]).simd_eq(d[0] + d[1] + d[2])
                & main.simd_le(LONGEST)
                & main.simd_ge(SHORTEST);
            valid |= finite.to_bitmask() << (chunk * LANES);
            main_min = main_min.min(finite.select(main, f32x8::splat(simd, f32::MAX)));
            direction_max = direction_max.max(finite.select(main, zero));
            for (axis, sum) in sum.iter_mut().enumerate() {
                *sum += finite.select(d[axis], zero);
                let inverse = (1.0 / d[axis]).min(f32::MAX).max(-f32::MAX);
                inverse.store_slice(&mut self.inverse[axis][chunk * LANES..(chunk + 1) * LANES]);
            }
        }
        self.valid = valid & wanted;
        self.main_min = main_min.reduce_min();
        self.direction_max = direction_max.reduce_max();
        let axis = Vec3::new(sum[0].reduce_sum(), sum[1].reduce_sum(), sum[2].reduce_sum());
        self.axis = (axis / axis.length()).to_array();
        let sound = self.origin.iter().all(|x| x.abs() <= FARTHEST) && self.t_max > 0.0;
        if !sound {
            self.valid = 0;
        }
    }

    /// Where the rays can get, and how far they need to go to pass all of `bounds` (finite; at most `t_max`).
    #[inline(always)]
    pub(crate) fn reach<S: Simd>(&self, simd: S, bounds: &Aabb) -> (Reach, f32) {
        let origin = Vec3::from_array(self.origin);
        let extent = (bounds.min - origin).abs().max((bounds.max - origin).abs()).max_element();
        // Whatever is met lies inside the bounds, so its coordinate along a ray's main axis does.
        let t_far = self.t_max.min(8.0 * extent / self.main_min).min(f32::MAX);
        let zero = f32x8::splat(simd, 0.0);
        let [ax, ay, az] = self.axis;
        let (mut lo, mut hi, mut length2) = ([zero; 3], [zero; 3], zero);
        let mut along = f32x8::splat(simd, f32::MAX);
        let shrink = 1.0 / self.direction_max;
        for chunk in 0..CHUNKS {
            let wanted = self.valid >> (chunk * LANES) & 0xff;
            if wanted == 0 {
                continue;
            }
            let wanted = fearless_simd::mask32x8::from_bitmask(simd, wanted);
            let [dx, dy, dz] = self.chunk(simd, &self.directions, chunk);
            let d = [wanted.select(dx, zero), wanted.select(dy, zero), wanted.select(dz, zero)];
            for k in 0..3 {
                lo[k] = lo[k].min(d[k]);
                hi[k] = hi[k].max(d[k]);
            }
            let e = [d[0] * shrink, d[1] * shrink, d[2] * shrink];
            length2 = length2.max(e[0] * e[0] + e[1] * e[1] + e[2] * e[2]);
            let a = d[0] * ax + d[1] * ay + d[2] * az;
            along = along.min(wanted.select(a, f32x8::splat(simd, f32::MAX)));
        }
        // An axis along which no ray runs is reached nowhere, however long the rays (0 times infinity is NaN).
        let scale = |x: f32| if x == 0.0 { 0.0 } else { x * t_far * CONSERVATIVE };
        // Lengths in units of the largest coordinate, so that their squares exist however short or long they are; the
        // addend covers what squares of tiny distances lose.
        let radius = length2.reduce_max().sqrt() * (self.direction_max * t_far) * CONSERVATIVE;
        let radius2 = radius * radius * CONSERVATIVE + f32::MIN_POSITIVE;
        let along = along.reduce_min() - self.direction_max * (1.0 / (1 << 20) as f32);
        // Not a number where there is no mean direction: then nothing is behind.
        let floor = if along >= 0.0 { 0.0 } else { along * t_far * CONSERVATIVE };
        let reach = Reach {
            min: [scale(lo[0].reduce_min()), scale(lo[1].reduce_min()), scale(lo[2].reduce_min())],
            max: [scale(hi[0].reduce_max()), scale(hi[1].reduce_max()), scale(hi[2].reduce_max())],
            radius2,
            axis: self.axis,
            floor,
        };
        (reach, t_far)
    }

    /// One lane's ray.
    #[inline(always)]
    pub(crate) fn ray(&self, lane: usize, t_far: f32) -> QuickRay {
        QuickRay {
            origin: self.origin,
            direction: self.direction(lane),
            inverse: [self.inverse[0][lane], self.inverse[1][lane], self.inverse[2][lane]],
            direction_max: self.direction_max,
            t_max: self.t_max,
            t_far,
        }
    }

    /// One lane's direction.
    #[inline(always)]
    pub(crate) fn direction(&self, lane: usize) -> [f32; 3] {
        [self.directions[0][lane], self.directions[1][lane], self.directions[2][lane]]
    }
}
