//! The watertight ray–triangle test of [Woop2013], for one ray and for lanes of rays that share an origin.
//!
//! A ray is sheared so that it runs along one axis from the origin; a triangle is hit where its three 2D edge
//! functions agree in sign. Products of `f32` round monotonically, so a computed sign is never wrong, at worst
//! zero; zeros are decided in `f64`, where the products are exact. Neighbours therefore agree on their shared edge.

use dapple_scene::glam::Vec3;

/// A triangle in leaf order.
#[derive(Clone, Copy)]
pub(crate) struct Triangle {
    /// Corners; NaN for a triangle that is not there (bad index, number not finite).
    pub(crate) corners: [[f32; 3]; 3],
    /// Index into the mesh's triangles.
    pub(crate) id: u32,
    /// Index into the mesh's alpha-tested triangles, or [`super::alpha::OPAQUE`].
    pub(crate) alpha: u32,
}

/// A ray prepared for box and triangle tests in one mesh's space. The direction need not be of unit length.
#[derive(Clone, Copy)]
pub(crate) struct MeshRay {
    pub(crate) origin: [f32; 3],
    /// 1 / direction, finite also where the direction has no such component.
    pub(crate) inverse: [f32; 3],
    /// Axes: the two across and the one along the shear.
    pub(crate) axes: [usize; 3],
    /// Shear across, across, and scale along ([Woop2013] Sx, Sy, Sz).
    pub(crate) shear: [f32; 3],
    /// Farthest hit.
    pub(crate) t_max: f32,
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
    /// `None` for rays that cannot hit anything: numbers not finite, no direction, no length.
    pub(crate) fn new(origin: Vec3, direction: Vec3, t_max: f32) -> Option<MeshRay> {
        let d = direction.to_array();
        let along = main_axis(d);
        let scale = 1.0 / d[along];
        if !(origin.is_finite() && direction.is_finite() && scale.is_finite() && t_max > 0.0) {
            return None;
        }
        let axes = axes_around(along);
        Some(MeshRay {
            origin: origin.to_array(),
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
    let flip = sz < 0.0;
    if (u == 0.0) | (v == 0.0) | (w == 0.0) | !(det.abs() < f32::INFINITY) {
        return exact(ray.t_max, [ax, ay, az], [bx, by, bz], [cx, cy, cz], flip);
    }
    let t = u * az + v * bz + w * cz;
    let (t, area) = if det < 0.0 { (-t, -det) } else { (t, det) };
    if !((t > 0.0) & (t <= ray.t_max * area)) {
        return None;
    }
    let inverse = 1.0 / det;
    Some(TriangleHit {
        t: t / area,
        weights: [u * inverse, v * inverse, w * inverse],
        back_face: (det < 0.0) != flip,
    })
}

/// [`intersect`] from sheared corners, in `f64`: for rays through an edge or a corner and for huge numbers.
#[cold]
fn exact(t_max: f32, a: [f32; 3], b: [f32; 3], c: [f32; 3], flip: bool) -> Option<TriangleHit> {
    let ([ax, ay, az], [bx, by, bz], [cx, cy, cz]) = (a.map(f64::from), b.map(f64::from), c.map(f64::from));
    let u = cx * by - cy * bx;
    let v = ax * cy - ay * cx;
    let w = bx * ay - by * ax;
    if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
        return None;
    }
    let det = u + v + w;
    if !(det.abs() > 0.0 && det.abs() < f64::INFINITY) {
        return None;
    }
    let t = (u * az + v * bz + w * cz) / det;
    if !(t > 0.0 && t <= f64::from(t_max)) {
        return None;
    }
    let weights = [u / det, v / det, w / det].map(|x| x as f32);
    Some(TriangleHit { t: t as f32, weights, back_face: (det < 0.0) != flip })
}
