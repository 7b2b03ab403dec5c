//! First-order moving least squares: fits a plane to the values around a fragment and reads it there.

use dapple_store::charts::{Fit, MovingLeastSquares, Weighed};

use super::PointIndex;
use super::index::Near;
use crate::gbuffer::RestSurface;

pub(super) fn visibility(
    kernel: &MovingLeastSquares,
    index: &PointIndex,
    visibility: &[u8],
    fragment: &RestSurface,
    near: &mut Near,
) -> f32 {
    let r = kernel.radius * index.spacing_m();
    index.candidates(fragment, r, near);
    let n = fragment.normal_rest;
    let (tangent, bitangent) = n.any_orthonormal_pair();
    near.weighed.clear();
    let (mut least, mut greatest) = (f32::INFINITY, f32::NEG_INFINITY);
    for p in &near.points {
        let d = (p.position_rest - fragment.position_rest) / r;
        let weight = kernel.weight(d, n, p.normal_rest);
        if weight > 0.0 {
            let value = f32::from(visibility[p.point as usize]);
            (least, greatest) = (least.min(value), greatest.max(value));
            near.weighed.push((Weighed { weight, tangent: [d.dot(tangent), d.dot(bitangent)] }, value));
        }
    }
    let value = match Fit::new(near.weighed.iter().map(|&(p, _)| p)) {
        // Kept within the range of the values that were fitted: one-sided neighbourhoods must not overshoot.
        Some(fit) => {
            let value: f32 = near.weighed.iter().map(|&(p, value)| fit.coefficient(p) * value).sum();
            value.clamp(least, greatest)
        }
        None => match index.nearest(fragment, near) {
            Some(point) => f32::from(visibility[point as usize]),
            None => 255.0,
        },
    };
    (value / 255.0).clamp(0.0, 1.0)
}
