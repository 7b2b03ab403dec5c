//! What viewers see: where rays and bits are spent first.

use dapple_scene::{Aabb, PosedCamera, Projection};
use glam::{Vec3, Vec4};
use rayon::prelude::*;

use super::Updater;
use super::clusters::Cluster;

/// A convex part of the world: what lies on the inner side of all planes. Without planes it is the whole world.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ConvexVolume {
    /// Inside is where `xyz · position_world + w ≥ 0`; metres if `xyz` has unit length.
    pub planes: Vec<Vec4>,
    /// From where it is seen: what is farther looks smaller. `None` (default): everything looks as large.
    pub eye_world: Option<Vec3>,
}

impl ConvexVolume {
    /// What a camera sees in a picture of that aspect ratio (width / height), up to `far_m` metres (infinity: as far as it
    /// sees). Its sides stand `margin_m` metres off, for what comes into view before the next step.
    pub fn frustum(camera: &PosedCamera, aspect: f32, far_m: f32, margin_m: f32) -> ConvexVolume {
        let clip_from_view = camera.clip_from_view(aspect);
        let (x, y, w) = (clip_from_view.row(0), clip_from_view.row(1), clip_from_view.row(3));
        let (near_m, far_m) = match camera.projection {
            Projection::Perspective { near, .. } => (near, far_m),
            Projection::Orthographic { near, far, .. } => (near, far.min(far_m)),
        };
        // The camera looks along −Z.
        let mut planes_view = vec![w + x, w - x, w + y, w - y, Vec4::new(0.0, 0.0, -1.0, -near_m)];
        if far_m.is_finite() {
            planes_view.push(Vec4::new(0.0, 0.0, 1.0, far_m));
        }
        let view_from_world = camera.view_from_world();
        let planes = planes_view.into_iter().map(|plane| {
            let plane = plane / plane.truncate().length();
            let normal =
                Vec3::from(view_from_world.matrix3.transpose() * glam::Vec3A::from(plane.truncate()));
            let offset = plane.w + plane.truncate().dot(view_from_world.translation.into());
            normal.extend(offset + margin_m)
        });
        let eye_world = match camera.projection {
            Projection::Perspective { .. } => Some(camera.world_from_view.translation.into()),
            Projection::Orthographic { .. } => None,
        };
        ConvexVolume { planes: planes.collect(), eye_world }
    }

    /// Whether a place lies inside.
    pub fn contains(&self, position_world: Vec3) -> bool {
        self.planes.iter().all(|plane| plane.truncate().dot(position_world) + plane.w >= 0.0)
    }

    /// Whether a part of the box may lie inside; perhaps yes too often, never no when it does.
    pub fn touches(&self, bounds_world: &Aabb) -> bool {
        self.planes.iter().all(|plane| {
            let normal = plane.truncate();
            let innermost = Vec3::select(normal.cmpge(Vec3::ZERO), bounds_world.max, bounds_world.min);
            let outside = normal.dot(innermost) + plane.w < 0.0;
            !outside
        })
    }
}

/// Whether anyone sees the box; everything is seen if there are no volumes.
pub(super) fn is_seen(interest: &[ConvexVolume], bounds_world: &Aabb) -> bool {
    interest.is_empty() || interest.iter().any(|volume| volume.touches(bounds_world))
}

/// What nobody sees may be off by so much more than what is seen from as far: whoever turns there sees it before it is mended.
const UNSEEN: f32 = 8.0;

impl Updater {
    /// How much an error may be, for each `stretch` of points of the store, in proportion: the distance from the nearest eye, metres, where
    /// one that does not see them counts as 8 times as far. Infinite where points are nowhere: their triangles have no area. An error of a point shows on pixels in proportion to one over
    /// the squared distance, so that errors in proportion to the distance cost every pixel alike. Empty without interest.
    pub fn coarseness(&self, interest: &[ConvexVolume], stretch: usize) -> Vec<f32> {
        if interest.is_empty() {
            return Vec::new();
        }
        let bounds_world = self.motion.bounds_world();
        let of_cluster = |cluster: &Cluster| {
            let bounds = cluster.bounds_now(bounds_world);
            let of_volume = |volume: &ConvexVolume| {
                // Nothing is nearer than it is large.
                let least = 0.5 * bounds.diagonal();
                let distance =
                    volume.eye_world.map_or(1.0, |eye| bounds.distance_squared(eye).sqrt().max(least));
                if volume.touches(bounds) { distance } else { UNSEEN * distance }
            };
            interest.iter().map(of_volume).fold(f32::INFINITY, f32::min)
        };
        let of_clusters: Vec<f32> = self.clusters.par_iter().map(of_cluster).collect();
        let mut coarseness = vec![f32::INFINITY; self.anchors.len().div_ceil(stretch)];
        for (cluster, value) in self.clusters.iter().zip(of_clusters) {
            let points = cluster.range();
            for least in &mut coarseness[points.start / stretch..points.end.div_ceil(stretch)] {
                *least = least.min(value);
            }
        }
        coarseness
    }
}
