//! The watertight ray–triangle test of \[Woop2013\], which decides every answer.
//!
//! A ray is sheared so that it runs along one axis from the origin; a triangle is hit where its three 2D edge
//! functions agree in sign. Products of `f32` round monotonically, so a computed sign is never wrong, at worst
//! zero; zeros are decided in `f64`, where the products are exact. Neighbours therefore agree on their shared edge.

use dapple_scene::glam::Vec3;

/// A triangle.
#[derive(Clone, Copy)]
pub(crate) struct Triangle {
    /// Corners; NaN for a triangle that is not there (bad index, number not finite).
    pub(crate) corners: [[f32; 3]; 3],
}

/// A ray prepared for box and triangle tests in one mesh's space. The direction need not be of unit length.
#[derive(Clone, Copy)]
pub(crate) struct MeshRay {
    pub(crate) origin: [f32; 3],
    pub(crate) direction: [f32; 3],
    /// 1 / direction, finite also where the direction has no such component.
    pub(crate) inverse: [f32; 3],
    /// Axes: the two across and the one along the shear.
    pub(crate) axes: [usize; 3],
    /// Shear across, across, and scale along (\[Woop2013\] Sx, Sy, Sz).
    pub(crate) shear: [f32; 3],
    /// Farthest hit.
    pub(crate) t_max: f32,
}

/// Largest coordinate of a corner or of a ray's origin: products of two exist. Triangles and rays beyond are not there.
pub(crate) const FARTHEST: f32 = 1e18;
/// Rays whose direction's largest coordinate, in a mesh's space, lies outside of this range hit nothing there.
pub(crate) const SHORTEST: f32 = 1e-18;
pub(crate) const LONGEST: f32 = 1e18;

/// What box tests and quick triangle tests need of a valid ray.
#[derive(Clone, Copy)]
pub(crate) struct QuickRay {
    pub(crate) origin: [f32; 3],
    pub(crate) direction: [f32; 3],
    /// As in [`MeshRay`].
    pub(crate) inverse: [f32; 3],
    /// At least the largest coordinate of the direction.
    pub(crate) direction_max: f32,
    pub(crate) t_max: f32,
    /// As far as it needs to go: finite, at most `t_max`.
    pub(crate) t_far: f32,
}

impl QuickRay {
    /// The ray for the exact test.
    #[cold]
    pub(crate) fn exact(&self) -> Option<MeshRay> {
        MeshRay::new(Vec3::from_array(self.origin), Vec3::from_array(self.direction), self.t_max)
    }
}

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TriangleHit {
    pub(crate) t: f32,
    /// Weights of the three corners, sum 1.
    pub(crate) weights: [f32; 3],
    /// Seen from the side on which the corners run clockwise.
    pub(crate) back_face: bool,
}

impl MeshRay {
    /// `None` for rays that cannot hit anything: numbers not finite, no direction (see [`SHORTEST`], [`LONGEST`]), no
    /// length.
    pub(crate) fn new(origin: Vec3, direction: Vec3, t_max: f32) -> Option<MeshRay> {
        let d = direction.to_array();
        let along = main_axis(d);
        let scale = 1.0 / d[along];
        let length = d[along].abs();
        let sound = (SHORTEST..=LONGEST).contains(&length);
        if !(origin.abs().max_element() <= FARTHEST
            && origin.is_finite()
            && direction.is_finite()
            && sound
            && t_max > 0.0)
        {
            return None;
        }
        let axes = axes_around(along);
        Some(MeshRay {
            origin: origin.to_array(),
            direction: d,
            inverse: d.map(finite_inverse),
            axes,
            shear: [d[axes[0]] / d[along], d[axes[1]] / d[along], scale],
            t_max,
        })
    }
}

/// The axis of the largest component.
#[inline(always)]
pub(crate) fn main_axis(d: [f32; 3]) -> usize {
    let [x, y, z] = d.map(f32::abs);
    if x >= y && x >= z {
        0
    } else if y >= z {
        1
    } else {
        2
    }
}

/// The axes across and along, keeping their cyclic order.
#[inline(always)]
pub(crate) fn axes_around(along: usize) -> [usize; 3] {
    [(along + 1) % 3, (along + 2) % 3, along]
}

/// 1 / x, bounded so that its product with 0 is 0 and not NaN.
#[inline(always)]
pub(crate) fn finite_inverse(x: f32) -> f32 {
    (1.0 / x).clamp(-f32::MAX, f32::MAX)
}

/// Where `ray` meets `triangle` at 0 < t ≤ t_max, from either side.
///
/// A triangle seen edge-on, or without area, is not met.
#[inline]
pub(crate) fn intersect(ray: &MeshRay, triangle: &Triangle) -> Option<TriangleHit> {
    let [kx, ky, kz] = ray.axes;
    let [sx, sy, sz] = ray.shear;
    let o = &ray.origin;
    let corner = |c: &[f32; 3]| {
        let z = c[kz] - o[kz];
        (c[kx] - o[kx] - sx * z, c[ky] - o[ky] - sy * z, sz * z)
    };
    let [a, b, c] = &triangle.corners;
    let ((ax, ay, az), (bx, by, bz), (cx, cy, cz)) = (corner(a), corner(b), corner(c));
    let u = cx * by - cy * bx;
    let v = ax * cy - ay * cx;
    let w = bx * ay - by * ax;
    if ((u < 0.0) | (v < 0.0) | (w < 0.0)) & ((u > 0.0) | (v > 0.0) | (w > 0.0)) {
        return None;
    }
    let det = u + v + w;
    let weights = if (u == 0.0) | (v == 0.0) | (w == 0.0) | !det.is_finite() {
        exact_weights([ax, ay], [bx, by], [cx, cy])?
    } else {
        [u / det, v / det, w / det]
    };
    let plane = Plane::new(&triangle.corners, o);
    let (t, back_face) = plane.distance(&ray.direction, [az, bz, cz], ray.t_max)?;
    Some(TriangleHit { t, weights, back_face })
}

/// The corner weights from sheared corners, in `f64`: for rays through an edge or a corner and for huge numbers.
#[cold]
fn exact_weights(a: [f32; 2], b: [f32; 2], c: [f32; 2]) -> Option<[f32; 3]> {
    let ([ax, ay], [bx, by], [cx, cy]) = (a.map(f64::from), b.map(f64::from), c.map(f64::from));
    let u = cx * by - cy * bx;
    let v = ax * cy - ay * cx;
    let w = bx * ay - by * ax;
    if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
        return None;
    }
    let det = u + v + w;
    let sound = det.abs() > 0.0 && det.abs() < f64::INFINITY;
    sound.then(|| [u / det, v / det, w / det].map(|x| x as f32))
}

/// The plane of a triangle relative to an origin, in `f64`.
///
/// The edge functions' own t is as inexact as the triangle is long: near the foot of a wall of 10 km it can have the
/// wrong sign. Few triangles are met, so those can be measured well.
pub(crate) struct Plane {
    normal: [f64; 3],
    height: f64,
}

impl Plane {
    #[inline(always)]
    pub(crate) fn new(corners: &[[f32; 3]; 3], origin: &[f32; 3]) -> Plane {
        let [a, b, c] = corners.map(|c| [0, 1, 2].map(|k| f64::from(c[k]) - f64::from(origin[k])));
        let (e, f) = ([b[0] - a[0], b[1] - a[1], b[2] - a[2]], [c[0] - a[0], c[1] - a[1], c[2] - a[2]]);
        let normal = [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]];
        Plane { normal, height: normal[0] * a[0] + normal[1] * a[1] + normal[2] * a[2] }
    }

    /// t if the ray from the origin meets the plane at 0 < t ≤ t_max, and whether it leaves along the normal.
    ///
    /// `corner_t` are the corners' distances along the ray; what lies between them is between theirs, which keeps t
    /// sound where the plane is seen almost edge-on.
    #[inline(always)]
    pub(crate) fn distance(
        &self,
        direction: &[f32; 3],
        corner_t: [f32; 3],
        t_max: f32,
    ) -> Option<(f32, bool)> {
        let [n, d] = [self.normal, direction.map(f64::from)];
        let along = n[0] * d[0] + n[1] * d[1] + n[2] * d[2];
        let t = (self.height / along) as f32;
        let [a, b, c] = corner_t;
        let t = max(min(t, max(max(a, b), c)), min(min(a, b), c));
        (t > 0.0 && t <= t_max && along != 0.0).then_some((t, along > 0.0))
    }
}

/// One instruction, unlike [`f32::min`], which must care for NaN: `b` if either is.
#[inline(always)]
pub(crate) fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// One instruction, unlike [`f32::max`]: `b` if either is NaN.
#[inline(always)]
pub(crate) fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}
