//! Where a mesh stands in the world.

use dapple_scene::glam::{Mat3, Vec3};
use dapple_scene::{Aabb, PosedInstance};

use super::Ray;
use super::mesh::MeshBvh;
use super::tree::WIDTH;
use super::triangle::MeshRay;

/// World boxes grow by this part of the numbers they were computed from, times the transform's condition: more than the
/// rounding of the transform and of the way back.
const BOX_MARGIN: f32 = 1.0 / (1 << 20) as f32;
/// Transforms that stretch one direction more than so many times as much as another cannot be inverted in `f32`.
const WORST_CONDITION: f32 = 1e6;

/// World to mesh: the difference to the translation is taken first, in the world, so that an instance far from the
/// origin loses no more digits than its positions already have.
#[derive(Clone, Copy)]
pub(crate) struct Placement {
    mesh_from_world: Mat3,
    translation_world: Vec3,
    /// The mesh's space is the world.
    pub(crate) identity: bool,
    /// Largest number of the map times that of its inverse; 1 for a turn and a scale along the axes.
    condition: f32,
}

impl Placement {
    pub(crate) fn new(posed: &PosedInstance) -> Option<Placement> {
        let world_from_mesh = Mat3::from(posed.world_from_mesh.matrix3);
        let translation_world = Vec3::from(posed.world_from_mesh.translation);
        if !(world_from_mesh.is_finite() && translation_world.is_finite()) {
            return None;
        }
        let mesh_from_world = inverse(&world_from_mesh)?;
        let largest = |m: &Mat3| m.to_cols_array().into_iter().fold(0.0_f32, |l, x| l.max(x.abs()));
        let condition = largest(&world_from_mesh) * largest(&mesh_from_world);
        if condition.is_nan() || condition > WORST_CONDITION {
            return None;
        }
        let identity = world_from_mesh == Mat3::IDENTITY && translation_world == Vec3::ZERO;
        Some(Placement { mesh_from_world, translation_world, identity, condition })
    }

    #[inline]
    pub(crate) fn position(&self, position_world: Vec3) -> Vec3 {
        self.mesh_from_world * (position_world - self.translation_world)
    }

    /// The columns of the map of directions.
    pub(crate) fn columns(&self) -> [[f32; 3]; 3] {
        self.mesh_from_world.to_cols_array_2d()
    }

    #[inline]
    fn direction(&self, direction_world: Vec3) -> Vec3 {
        self.mesh_from_world * direction_world
    }

    pub(crate) fn ray(&self, ray: &Ray) -> Option<MeshRay> {
        MeshRay::new(self.position(ray.origin_world), self.direction(ray.direction_world), ray.t_max)
    }
}

/// The inverse, computed in `f64`; `None` if there is none that `f32` can hold.
fn inverse(m: &Mat3) -> Option<Mat3> {
    let [x, y, z] = m.to_cols_array_2d().map(|column| column.map(f64::from));
    let cross = |a: [f64; 3], b: [f64; 3]| {
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    };
    let rows = [cross(y, z), cross(z, x), cross(x, y)];
    let determinant = x[0] * rows[0][0] + x[1] * rows[0][1] + x[2] * rows[0][2];
    let inverse =
        Mat3::from_cols_array_2d(&rows.map(|row| row.map(|e| (e / determinant) as f32))).transpose();
    inverse.is_finite().then_some(inverse)
}

/// Around the transformed boxes of the root's children, clamped to finite numbers. Empty if there is nothing.
pub(crate) fn bounds_world(bvh: &MeshBvh, posed: &PosedInstance, placement: &Placement) -> Aabb {
    let Some(root) = bvh.tree.nodes.first() else { return Aabb::EMPTY };
    let map = &posed.world_from_mesh;
    let linear = Mat3::from(map.matrix3);
    let absolute = Mat3::from_cols(linear.x_axis.abs(), linear.y_axis.abs(), linear.z_axis.abs());
    let mut bounds = Aabb::EMPTY;
    for slot in 0..WIDTH {
        let b = root.child_bounds(slot);
        if b.is_empty() {
            continue;
        }
        let size = absolute * b.min.abs().max(b.max.abs()) + Vec3::from(map.translation).abs();
        let b = b.transformed(map);
        let margin = size * (BOX_MARGIN * placement.condition.max(1.0));
        bounds = bounds.union(Aabb { min: b.min - margin, max: b.max + margin });
    }
    if bounds.is_empty() || bounds.min.is_nan() || bounds.max.is_nan() {
        return Aabb::EMPTY;
    }
    let limit = Vec3::splat(f32::MAX);
    Aabb { min: bounds.min.clamp(-limit, limit), max: bounds.max.clamp(-limit, limit) }
}
