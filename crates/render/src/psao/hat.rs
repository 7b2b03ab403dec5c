//! The paper's kernel: a hat with two thresholds on normals ([Neff2023] eq. 2–4).

use glam::Vec3;

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
    /// Weight of a point at `to_point` (metres) from a fragment, both with unit normals; `radius_m` is r. 0 … 1.
    pub(super) fn weight(&self, to_point: Vec3, point_normal: Vec3, normal: Vec3, radius_m: f32) -> f32 {
        let distance = to_point.length();
        // [Neff2023] eq. 2
        let alpha = ((radius_m - distance) / radius_m).max(0.0);
        // [Neff2023] eq. 3; a point at the fragment itself has no direction and passes.
        let along = if distance > 0.0 { point_normal.dot(to_point) / distance } else { 0.0 };
        let counts =
            point_normal.dot(normal) > self.normal_threshold && along * along < self.direction_threshold;
        if counts { alpha } else { 0.0 }
    }

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
            let alpha = self.weight(to_point, p.normal_rest, fragment.normal_rest, r);
            sum += alpha * f32::from(visibility[p.point as usize]);
            weights += alpha;
        }
        // [Neff2023] eq. 4: open where nothing has weight.
        if weights > 0.0 { sum / weights / 255.0 } else { 1.0 }
    }
}
