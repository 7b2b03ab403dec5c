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
    for p in &near.points {
        let d = (p.position_rest - fragment.position_rest) / r;
        let weight = kernel.weight(d, n, p.normal_rest);
        if weight > 0.0 {
            let value = f32::from(visibility[p.point as usize]);
            near.weighed.push((Weighed { weight, tangent: [d.dot(tangent), d.dot(bitangent)] }, value));
        }
    }
    let value = fitted(&near.weighed).unwrap_or_else(|| {
        index.nearest(fragment, near).map_or(255.0, |point| f32::from(visibility[point as usize]))
    });
    (value / 255.0).clamp(0.0, 1.0)
}

/// The value of the plane through weighed values where the fragment is; `None` if they fix none.
pub(super) fn fitted(weighed: &[(Weighed, f32)]) -> Option<f32> {
    let fit = Fit::new(weighed.iter().map(|&(p, _)| p))?;
    let value: f32 = weighed.iter().map(|&(p, value)| fit.coefficient(p) * value).sum();
    // Kept within the range of the values that were fitted: one-sided neighbourhoods must not overshoot.
    let least = weighed.iter().fold(f32::INFINITY, |least, &(_, value)| least.min(value));
    let greatest = weighed.iter().fold(f32::NEG_INFINITY, |greatest, &(_, value)| greatest.max(value));
    Some(value.clamp(least, greatest))
}
