//! The space of the grids: boxes of instances in their local space, whatever the animation does.

use dapple_scene::{Aabb, Pose, Scene};
use dapple_store::cells::{InstanceGrid, TableLayout, TableLayoutError, VirtualGrid, buckets_for};
use dapple_store::points::PointLayout;
use glam::Vec3;

use crate::psao::generate::{Anchor, PosedPoint};

/// Times at which the shape of what bends is looked at for its box.
const BOX_SAMPLES: u32 = 64;
/// The box of what bends is made larger by this part of its diagonal on every side, for what happens between these times.
const BOX_MARGIN: f32 = 0.02;

impl Anchor {
    /// The anchor in its instance's local space ([`Scene::local_from_posed`]), or `None` where the posed triangle has no normal.
    pub(super) fn pose_local(&self, scene: &Scene, pose: &Pose, instance: usize) -> Option<PosedPoint> {
        let local_from_posed = scene.local_from_posed(pose, instance);
        let vertices = scene.vertex_positions(pose, instance);
        let mesh = &scene.meshes[scene.instances[instance].mesh as usize];
        let corners = mesh.triangles[self.triangle() as usize]
            .map(|v| local_from_posed.transform_point3(vertices[v as usize]));
        super::super::generate::pose_anchor(self, corners, local_from_posed.matrix3.determinant() < 0.0)
    }
}

/// Grids of all instances with points, with cells of `edge_spacings` spacings.
///
/// # Errors
/// An instance's box has too many cells, or there are too many buckets.
pub(super) fn table_layout(
    scene: &Scene,
    pose: &Pose,
    layout: &PointLayout,
    anchors: &[Anchor],
    edge_spacings: f32,
) -> Result<TableLayout, TableLayoutError> {
    let edge_m = edge_spacings * layout.spacing_m();
    let bending = bending_boxes(scene, pose, layout);
    let mut grids = Vec::with_capacity(layout.sets().len());
    for (set, bending) in layout.sets().iter().zip(bending) {
        let instance = set.instance;
        let points = || {
            let anchors = &anchors[set.first as usize..][..set.len()];
            anchors.iter().filter_map(|a| a.pose_local(scene, pose, instance as usize)).map(|p| p.position)
        };
        let bounds = bending.unwrap_or_else(|| Aabb::from_points(points()));
        let bounds = if bounds.is_empty() { Aabb { min: Vec3::ZERO, max: Vec3::ZERO } } else { bounds };
        let grid = VirtualGrid::spanning(bounds.min, (bounds.max - bounds.min) / edge_m)
            .map_err(|source| TableLayoutError::Grid { instance, source })?;
        let count = buckets_for(set.len(), f64::from(edge_spacings));
        grids.push(InstanceGrid { instance, grid: VirtualGrid { count, ..grid } });
    }
    TableLayout::new(layout.spacing_m(), edge_m, grids)
}

/// For each set whose instance can bend, the box of its vertices over the whole animation.
fn bending_boxes(scene: &Scene, pose: &Pose, layout: &PointLayout) -> Vec<Option<Aabb>> {
    let mut boxes: Vec<Option<Aabb>> = layout
        .sets()
        .iter()
        .map(|set| scene.is_deformable(set.instance as usize).then_some(Aabb::EMPTY))
        .collect();
    if boxes.iter().all(Option::is_none) {
        return boxes;
    }
    let mut add = |pose: &Pose| {
        for (set, bounds) in layout.sets().iter().zip(&mut boxes) {
            if let Some(bounds) = bounds {
                let instance = set.instance as usize;
                let local_from_posed = scene.local_from_posed(pose, instance);
                let vertices = scene.vertex_positions(pose, instance).iter();
                let around = Aabb::from_points(vertices.map(|v| local_from_posed.transform_point3(*v)));
                *bounds = bounds.union(around);
            }
        }
    };
    add(pose);
    if let Some(animation) = scene.active_animation.map(|i| &scene.animations[i as usize]) {
        let duration_s = f64::from(animation.duration());
        (0..BOX_SAMPLES).for_each(|i| {
            add(&scene.pose(duration_s * f64::from(i) / f64::from(BOX_SAMPLES)));
        });
    }
    boxes.into_iter().map(|b| b.map(|b| b.inflated(BOX_MARGIN * b.diagonal()))).collect()
}
