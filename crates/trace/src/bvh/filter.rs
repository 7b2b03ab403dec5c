//! Eight triangles against rays from one origin: sure hits, sure misses, and what only the exact test can tell.
//!
//! For an origin o and corners a, b, c relative to it, a direction d meets the triangle in front of o exactly if d lies
//! on the inner side of the three planes through o and an edge: with n₀ = b × c, n₁ = c × a, n₂ = a × b, all turned by
//! the sign of the volume a · (b × c), if d · nᵢ ≥ 0 for all i. With N = (b − a) × (c − a), turned too, it is met
//! within t_max if t_max (N · d) ≥ N · a. All of that but d is the same for all rays of the origin, so a ray costs four
//! dot products.
//!
//! In `f32` each of these numbers is off by at most a bound that is known for the triangle. A number beyond its bound
//! decides; otherwise [`super::triangle::intersect`] does. The bounds count the rounding of that test too, so that every
//! answer is that test's answer, whatever the width of the vectors and whether products and sums are fused.

use fearless_simd::{Simd, SimdBase, SimdFloat, SimdMask, f32x8};

use super::leaf::{LANES, Rows};
use super::triangle::QuickRay;

/// Bounds are computed from numbers so many times too large, so that they overflow before what they bound does; an
/// infinite bound decides nothing.
const HEADROOM: f32 = 16.0;
/// Bound of the error of d · nᵢ over (largest coordinate L × largest edge coordinate e × largest direction coordinate D), in
/// units of 2⁻²⁴: a coordinate of edge × corner is at most 2 L e and off by 8 L e (corner, edge, two products, a difference), so the
/// dot product with d is off by 3 × 8 from that and 3 × 2 × 3 from its own sums: 42; and the exact test moves
/// corners by 5 L across the ray, each by 2 e: 40. For the third edge e doubles: 164 in all, of 256.
const EDGE_ERROR: f32 = 1.0 / (1 << 16) as f32 / HEADROOM;
/// Bound of the error of t_max (N · d) − N · a over e² (t_max D + L), in the same units: N is off by 8 e², so N · d by 42 e² D and
/// N · a by 48 e² L; the exact test's t by 4 roundings and by its corners' 24 e² L: 76 of 128.
const REACH_ERROR: f32 = 1.0 / (1 << 17) as f32 / HEADROOM;
/// Bound of the error of N · a over e² L: 48 of 64.
const VOLUME_ERROR: f32 = 1.0 / (1 << 18) as f32 / HEADROOM;
/// The same in `f64`.
const VOLUME_ERROR_F64: f64 = 1.0 / (1_u64 << 45) as f64;
/// More than what is lost where products are below the smallest normal number.
const UNDERFLOW: f32 = 1e-37;

/// What all rays of an origin share about eight triangles.
pub(crate) struct Block<S: Simd> {
    /// The planes through the origin and the edges, turned inwards.
    planes: [[f32x8<S>; 3]; 3],
    /// The triangles' normals, turned away from the origin.
    normal: [f32x8<S>; 3],
    t_max: f32,
    /// |N · a|.
    volume: f32x8<S>,
    edge_error: f32x8<S>,
    reach_error: f32x8<S>,
    /// Lanes that hold a triangle.
    lanes: u32,
}

#[inline(always)]
fn cross<S: Simd>(a: &[f32x8<S>; 3], b: &[f32x8<S>; 3]) -> [f32x8<S>; 3] {
    [a[1].mul_sub(b[2], a[2] * b[1]), a[2].mul_sub(b[0], a[0] * b[2]), a[0].mul_sub(b[1], a[1] * b[0])]
}

#[inline(always)]
fn dot<S: Simd>(a: &[f32x8<S>; 3], b: &[f32x8<S>; 3]) -> f32x8<S> {
    a[2].mul_add(b[2], a[1].mul_add(b[1], a[0] * b[0]))
}

#[inline(always)]
fn sub<S: Simd>(a: &[f32x8<S>; 3], b: &[f32x8<S>; 3]) -> [f32x8<S>; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
fn splat3<S: Simd>(simd: S, a: &[f32; 3]) -> [f32x8<S>; 3] {
    [f32x8::splat(simd, a[0]), f32x8::splat(simd, a[1]), f32x8::splat(simd, a[2])]
}

#[inline(always)]
fn scaled<S: Simd>(a: [f32x8<S>; 3], by: f32x8<S>) -> [f32x8<S>; 3] {
    [a[0] * by, a[1] * by, a[2] * by]
}

#[inline(always)]
fn largest<S: Simd>(a: &[f32x8<S>; 3]) -> f32x8<S> {
    a[0].abs().max(a[1].abs()).max(a[2].abs())
}

impl<S: Simd> Block<S> {
    /// Looks at `count` triangles from `origin`, for rays of `t_max` lengths of directions with coordinates up to
    /// `direction_max`.
    #[inline(always)]
    pub(crate) fn new(
        simd: S,
        rows: &Rows<S>,
        count: usize,
        origin: &[f32; 3],
        t_max: f32,
        direction_max: f32,
    ) -> Block<S> {
        let [ax, ay, az, bx, by, bz, cx, cy, cz] = *rows;
        let o = splat3(simd, origin);
        let (a, b, c) = ([ax, ay, az], [bx, by, bz], [cx, cy, cz]);
        // Edges from the corners as they are: relative to the origin these have lost digits.
        let (ab, bc, ca) = (sub(&b, &a), sub(&c, &b), sub(&a, &c));
        let (a, b, c) = (sub(&a, &o), sub(&b, &o), sub(&c, &o));
        let normal = cross(&ca, &ab);
        let volume = dot(&normal, &a);

        let edge = largest(&ab).max(largest(&ca));
        let coordinate = (largest(&a) + edge) * HEADROOM;
        let (edge2, both) = (edge * edge, coordinate * edge);
        let lanes = (1_u32 << count) - 1;
        let volume_error = (edge2 * coordinate).mul_add(VOLUME_ERROR, (coordinate + 1.0) * UNDERFLOW);
        let mut edge_error = (both * direction_max).mul_add(EDGE_ERROR, UNDERFLOW * (1.0 + direction_max));
        let reach = coordinate + t_max * direction_max * HEADROOM;
        let mut reach_error =
            (edge2 * reach).mul_add(REACH_ERROR, UNDERFLOW * (1.0 + direction_max * (1.0 + t_max)));
        // N · d may overflow where its product with a tiny t_max would not; then so does the bound of the planes, and
        // neither is to decide (∞ × 0 is no number, and compares with none).
        reach_error += edge_error * 0.0;
        let mut sign = volume;
        let unsure = !volume.abs().simd_gt(volume_error).to_bitmask() as u32 & lanes;
        if unsure != 0 {
            [sign, edge_error, reach_error] =
                resolve(simd, rows, origin, unsure, [sign, edge_error, reach_error]);
        }

        let one = f32x8::splat(simd, 1.0).copysign(sign);
        let planes = [scaled(cross(&b, &bc), one), scaled(cross(&c, &ca), one), scaled(cross(&a, &ab), one)];
        let normal = scaled(normal, one);
        Block { planes, normal, t_max, volume: volume * one, edge_error, reach_error, lanes }
    }

    /// Which lanes may be met by the ray along `d`, and which of those are met for sure.
    #[inline(always)]
    pub(crate) fn test(&self, simd: S, d: [f32; 3]) -> (u32, u32) {
        let d = splat3(simd, &d);
        let [p, q, r] = &self.planes;
        let inside = dot(p, &d).min(dot(q, &d)).min(dot(r, &d));
        let reach = dot(&self.normal, &d).mul_sub(self.t_max, self.volume);
        // Not beyond an error on the wrong side; so too where a number is none.
        let out = inside.simd_lt(-self.edge_error) | reach.simd_lt(-self.reach_error);
        let maybe = !(out.to_bitmask() as u32) & self.lanes;
        if maybe == 0 {
            return (0, 0);
        }
        let sure = (inside.simd_gt(self.edge_error) & reach.simd_gt(self.reach_error)).to_bitmask() as u32;
        (maybe, maybe & sure)
    }

    /// The planes of all lanes, for [`Lane`].
    #[inline(always)]
    pub(crate) fn spread(&self) -> Spread {
        let ([p, q, r], n) = (&self.planes, &self.normal);
        let mut rows = [[0.0; LANES]; 15];
        p[0].store_slice(&mut rows[0]);
        p[1].store_slice(&mut rows[1]);
        p[2].store_slice(&mut rows[2]);
        q[0].store_slice(&mut rows[3]);
        q[1].store_slice(&mut rows[4]);
        q[2].store_slice(&mut rows[5]);
        r[0].store_slice(&mut rows[6]);
        r[1].store_slice(&mut rows[7]);
        r[2].store_slice(&mut rows[8]);
        n[0].store_slice(&mut rows[9]);
        n[1].store_slice(&mut rows[10]);
        n[2].store_slice(&mut rows[11]);
        self.volume.store_slice(&mut rows[12]);
        self.edge_error.store_slice(&mut rows[13]);
        self.reach_error.store_slice(&mut rows[14]);
        Spread { rows, t_max: self.t_max }
    }
}

/// Which of the triangles in `lanes` one ray may meet, and which of those it does for sure.
///
/// The same decisions as [`Block`]'s, by \[Moller1997\]: u = (o − a) · (d × ac), v = d · ((o − a) × ab), with
/// N · d = u + v + w; there is nothing to share with other rays, and this is half the work. The bounds hold as well:
/// u, v and w are sums of the same products.
///
/// \[Moller1997\]: T. Möller, B. Trumbore, "Fast, Minimum Storage Ray-Triangle Intersection", JGT 2 (1), 1997.
#[inline(always)]
pub(crate) fn test_one<S: Simd>(simd: S, rows: &Rows<S>, lanes: u32, ray: &QuickRay) -> (u32, u32) {
    let [ax, ay, az, bx, by, bz, cx, cy, cz] = *rows;
    let (o, d) = (splat3(simd, &ray.origin), splat3(simd, &ray.direction));
    let a = [ax, ay, az];
    let (ab, ac, at) = (sub(&[bx, by, bz], &a), sub(&[cx, cy, cz], &a), sub(&o, &a));
    let p = cross(&d, &ac);
    let along = dot(&ab, &p);
    let q = cross(&at, &ab);
    let (u, v, t) = (dot(&at, &p), dot(&d, &q), dot(&ac, &q));
    // All of it as if the triangle were met from its front.
    let one = f32x8::splat(simd, 1.0).copysign(along);
    let (along, u, v, t) = (along * one, u * one, v * one, t * one);

    let edge = largest(&ab).max(largest(&ac));
    let coordinate = (largest(&at) + edge) * HEADROOM;
    let underflow = (coordinate + 1.0) * (UNDERFLOW * (1.0 + ray.direction_max * (1.0 + ray.t_far)));
    let edge_error = (coordinate * edge * ray.direction_max).mul_add(EDGE_ERROR, underflow);
    let reach = coordinate + ray.t_far * ray.direction_max * HEADROOM;
    let reach_error = (edge * edge * reach).mul_add(REACH_ERROR, underflow);
    let inside = u.min(v).min(along - u - v);
    let reach = (along * ray.t_far - t).min(t);
    // Seen edge-on the sign says nothing; but u + v + w is almost 0 then, so that either sign leaves one far below 0.
    let out = (inside.simd_lt(-edge_error) | reach.simd_lt(-reach_error)) & along.simd_gt(edge_error);
    let out = out | inside.simd_lt(edge_error * -6.0);
    let maybe = !(out.to_bitmask() as u32) & lanes;
    if maybe == 0 {
        return (0, 0);
    }
    let sure = (inside.simd_gt(edge_error) & reach.simd_gt(reach_error)).to_bitmask() as u32;
    (maybe, maybe & sure)
}

/// A block in memory, to take single lanes from.
pub(crate) struct Spread {
    rows: [[f32; LANES]; 15],
    t_max: f32,
}

/// One triangle of a block, against eight rays at a time.
pub(crate) struct Lane<S: Simd> {
    rows: [f32x8<S>; 15],
    t_max: f32,
}

impl Spread {
    #[inline(always)]
    pub(crate) fn lane<S: Simd>(&self, simd: S, lane: usize) -> Lane<S> {
        let mut rows = [f32x8::splat(simd, 0.0); 15];
        for (row, numbers) in rows.iter_mut().zip(&self.rows) {
            *row = f32x8::splat(simd, numbers[lane]);
        }
        Lane { rows, t_max: self.t_max }
    }
}

impl<S: Simd> Lane<S> {
    /// Which of eight rays may meet the triangle, and which of those do for sure.
    #[inline(always)]
    pub(crate) fn test(&self, d: &[f32x8<S>; 3]) -> (u32, u32) {
        let [p0, p1, p2, q0, q1, q2, r0, r1, r2, n0, n1, n2, volume, edge_error, reach_error] = self.rows;
        let inside = dot(&[p0, p1, p2], d).min(dot(&[q0, q1, q2], d)).min(dot(&[r0, r1, r2], d));
        let reach = dot(&[n0, n1, n2], d).mul_sub(self.t_max, volume);
        let out = inside.simd_lt(-edge_error) | reach.simd_lt(-reach_error);
        let maybe = !(out.to_bitmask() as u32) & 0xff;
        if maybe == 0 {
            return (0, 0);
        }
        let sure = (inside.simd_gt(edge_error) & reach.simd_gt(reach_error)).to_bitmask() as u32;
        (maybe, maybe & sure)
    }
}

/// On which side of the lanes in `unsure` the origin lies, in `f64`; where even that cannot tell, an error without
/// bound hands all rays to the exact test.
#[cold]
#[inline(never)]
fn resolve<S: Simd>(
    simd: S,
    rows: &Rows<S>,
    origin: &[f32; 3],
    mut unsure: u32,
    [sign, edge_error, reach_error]: [f32x8<S>; 3],
) -> [f32x8<S>; 3] {
    let rows = rows.map(<[f32; LANES]>::from);
    let (mut sign, mut edge_error) = (<[f32; LANES]>::from(sign), <[f32; LANES]>::from(edge_error));
    let mut reach_error = <[f32; LANES]>::from(reach_error);
    while unsure != 0 {
        let lane = unsure.trailing_zeros() as usize;
        unsure &= unsure - 1;
        let corner = |k: usize| [0, 1, 2].map(|axis| f64::from(rows[3 * k + axis][lane]));
        let (a, b, c) = (corner(0), corner(1), corner(2));
        let sub = |a: [f64; 3], b: [f64; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
        let largest = |v: [f64; 3]| v[0].abs().max(v[1].abs()).max(v[2].abs());
        let (ab, ac, at) = (sub(b, a), sub(c, a), sub(a, origin.map(f64::from)));
        let volume = at[0] * (ab[1] * ac[2] - ab[2] * ac[1])
            + at[1] * (ab[2] * ac[0] - ab[0] * ac[2])
            + at[2] * (ab[0] * ac[1] - ab[1] * ac[0]);
        let edge = largest(ab).max(largest(ac));
        if volume.abs() > VOLUME_ERROR_F64 * edge * edge * (largest(at) + edge) {
            sign[lane] = volume as f32;
            if sign[lane] == 0.0 {
                sign[lane] = 0.0_f32.copysign(if volume < 0.0 { -1.0 } else { 1.0 });
            }
        } else {
            (edge_error[lane], reach_error[lane]) = (f32::INFINITY, f32::INFINITY);
        }
    }
    [sign, edge_error, reach_error].map(|x| f32x8::load_array(simd, x))
}
