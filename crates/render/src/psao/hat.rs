//! The paper's kernel: a hat with two thresholds on normals ([Neff2023] eq. 2–4).

use super::PointIndex;
use super::index::Near;
use crate::gbuffer::RestSurface;

/// Parameters of [Neff2023] eq. 2 and 3.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hat {
    /// Radius r of eq. 2 in units of the layout's spacing r0. Default 1: twice the Poisson disk radius.
    pub radius: f32,
    /// T_n of eq. 3: least cosine between the normals of point and fragment. Default 0.1.
    pub normal_threshold: f32,
    /// T_d of eq. 3: greatest squared cosine between a point's normal and the direction to it. Default 0.7.
    pub direction_threshold: f32,
}

impl Default for Hat {
    fn default() -> Self {
        Hat { radius: 1.0, normal_threshold: 0.1, direction_threshold: 0.7 }
    }
}

impl Hat {
    pub(super) fn visibility(
        &self,
        index: &PointIndex,
        visibility: &[u8],
        fragment: &RestSurface,
        near: &mut Near,
    ) -> f32 {
        let r = self.radius * index.spacing_m();
        index.candidates(fragment, r, near);
        let (mut sum, mut weights) = (0.0f32, 0.0f32);
        for p in &near.points {
            let to_point = p.position_rest - fragment.position_rest;
            let distance = to_point.length();
            // [Neff2023] eq. 2
            let mut alpha = ((r - distance) / r).max(0.0);
            // [Neff2023] eq. 3; a point at the fragment itself has no direction and passes.
            let along = if distance > 0.0 { p.normal_rest.dot(to_point) / distance } else { 0.0 };
            if p.normal_rest.dot(fragment.normal_rest) <= self.normal_threshold
                || along * along >= self.direction_threshold
            {
                alpha = 0.0;
            }
            sum += alpha * f32::from(visibility[p.point as usize]);
            weights += alpha;
        }
        // [Neff2023] eq. 4: open where nothing has weight.
        if weights > 0.0 { sum / weights / 255.0 } else { 1.0 }
    }
}
