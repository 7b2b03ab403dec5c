//! First-order moving least squares: fits a plane to the values around a fragment and reads it there.

use glam::Vec3;

use super::PointIndex;
use super::index::Near;
use crate::gbuffer::RestSurface;

/// Parameters of the fit. How the defaults were chosen stands in `docs/evaluation.md`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MovingLeastSquares {
    /// Radius of the weights in units of the layout's spacing r0. Default 2.
    pub radius: f32,
    /// Exponent of the cosine between normals, a power of two ≥ 1. Default 16.
    pub normal_power: u32,
    /// How fast the weight falls with the distance from the fragment's tangent plane: 1 / (1 + k (h/r)²)². Default 128.
    pub plane: f32,
}

impl Default for MovingLeastSquares {
    fn default() -> Self {
        MovingLeastSquares { radius: 2.0, normal_power: 16, plane: 128.0 }
    }
}

/// Below this sum of weights the fit means nothing.
const LEAST_WEIGHT: f32 = 1e-9;
/// Pulls the gradient to zero where the points do not determine it (in units of the weights' sum and the squared radius).
const RIDGE: f32 = 1e-3;

impl MovingLeastSquares {
    pub(super) fn visibility(
        &self,
        index: &PointIndex,
        visibility: &[u8],
        fragment: &RestSurface,
        near: &mut Near,
    ) -> f32 {
        let r = self.radius * index.spacing_m();
        index.candidates(fragment, r, near);
        let n = fragment.normal_rest;
        let (tangent, bitangent) = n.any_orthonormal_pair();
        let mut fit = Fit::default();
        for p in &near.points {
            let d = (p.position_rest - fragment.position_rest) / r;
            let weight = self.weight(d, n, p.normal_rest);
            if weight > 0.0 {
                fit.add(weight, d.dot(tangent), d.dot(bitangent), f32::from(visibility[p.point as usize]));
            }
        }
        let value = match fit.value_at_origin() {
            Some(value) => value,
            None => match index.nearest(fragment, near) {
                Some(point) => f32::from(visibility[point as usize]),
                None => 255.0,
            },
        };
        (value / 255.0).clamp(0.0, 1.0)
    }

    /// Weight of a point at `d` (in radii) from the fragment: (1 − |d|²)² · (n·nₚ)^power · plane factor.
    pub(super) fn weight(&self, d: Vec3, normal: Vec3, point_normal: Vec3) -> f32 {
        let inside = 1.0 - d.length_squared();
        let mut cosine = normal.dot(point_normal);
        if inside <= 0.0 || cosine <= 0.0 {
            return 0.0;
        }
        for _ in 0..self.normal_power.max(1).ilog2() {
            cosine *= cosine;
        }
        let height = normal.dot(d);
        let plane = 1.0 / (1.0 + self.plane * height * height);
        inside * inside * cosine * plane * plane
    }
}

/// Weighted normal equations of value ≈ a + b·u + c·v.
#[derive(Debug, Default)]
struct Fit {
    w: f32,
    u: f32,
    v: f32,
    uu: f32,
    uv: f32,
    vv: f32,
    y: f32,
    uy: f32,
    vy: f32,
    least: f32,
    greatest: f32,
}

impl Fit {
    fn add(&mut self, w: f32, u: f32, v: f32, y: f32) {
        if self.w == 0.0 {
            (self.least, self.greatest) = (y, y);
        }
        self.least = self.least.min(y);
        self.greatest = self.greatest.max(y);
        self.w += w;
        self.u += w * u;
        self.v += w * v;
        self.uu += w * u * u;
        self.uv += w * u * v;
        self.vv += w * v * v;
        self.y += w * y;
        self.uy += w * u * y;
        self.vy += w * v * y;
    }

    /// a, kept within the range of the values that were fitted: one-sided neighbourhoods must not overshoot.
    fn value_at_origin(&self) -> Option<f32> {
        if self.w.is_nan() || self.w < LEAST_WEIGHT {
            return None;
        }
        // Moments about the weighted centre.
        let inverse = 1.0 / self.w;
        let (u, v, y) = (self.u * inverse, self.v * inverse, self.y * inverse);
        let uu = self.uu * inverse - u * u + RIDGE;
        let vv = self.vv * inverse - v * v + RIDGE;
        let uv = self.uv * inverse - u * v;
        let uy = self.uy * inverse - u * y;
        let vy = self.vy * inverse - v * y;
        let determinant = uu * vv - uv * uv;
        if determinant.is_nan() || determinant <= 0.0 {
            return Some(y);
        }
        let b = (uy * vv - vy * uv) / determinant;
        let c = (vy * uu - uy * uv) / determinant;
        Some((y - b * u - c * v).clamp(self.least, self.greatest))
    }
}
