//! Where a point sits on its mesh, in eight bytes.

use dapple_scene::{Pose, Scene};
use glam::Vec3;

use crate::rtao::Site;
use crate::sampling::hash;

/// A triangle, a side and a place on it. The point follows the triangle wherever it is posed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Anchor {
    /// Bit 31: on the back side.
    triangle_and_side: u32,
    /// Weights of vertices 1 and 2 in 1/65535; their sum is at most 65535.
    barycentrics: [u16; 2],
}

/// An anchor brought to some space.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PosedPoint {
    pub(crate) position: Vec3,
    /// Geometric normal of the triangle, on the anchor's side.
    pub(crate) normal: Vec3,
    /// Along the triangle's first edge: turns with the surface.
    pub(crate) tangent: Vec3,
}

const BACK: u32 = 1 << 31;

impl Anchor {
    /// An anchor at barycentrics `u`, `v` (of vertices 1 and 2, `u + v ≤ 1`) of a triangle with an index below 2³¹.
    pub fn new(triangle: u32, barycentrics: [f32; 2], back: bool) -> Anchor {
        let u = (barycentrics[0].clamp(0.0, 1.0) * 65535.0).round() as u16;
        let v = ((barycentrics[1].clamp(0.0, 1.0) * 65535.0).round() as u16).min(65535 - u);
        Anchor { triangle_and_side: triangle | if back { BACK } else { 0 }, barycentrics: [u, v] }
    }

    /// As a place to trace from, with the key that the point has for ever; `None` where the posed triangle has no normal.
    pub(crate) fn site_world(&self, scene: &Scene, pose: &Pose, instance: u32) -> Option<Site> {
        let posed = self.pose(scene, pose, instance as usize)?;
        Some(Site {
            position_world: posed.position,
            normal_world: posed.normal,
            key: u64::from(self.site(instance)),
        })
    }

    /// Index of the triangle in the mesh.
    pub fn triangle(&self) -> u32 {
        self.triangle_and_side & !BACK
    }

    /// Whether the point lies on the side from which the triangle's vertices run clockwise.
    pub fn is_back(&self) -> bool {
        self.triangle_and_side & BACK != 0
    }

    /// Weights of vertices 1 and 2.
    pub fn barycentrics(&self) -> [f32; 2] {
        self.barycentrics.map(|b| f32::from(b) / 65535.0)
    }

    /// A number that is the point's own for ever: it chooses the ray pattern.
    pub(crate) fn site(&self, instance: u32) -> u32 {
        let [u, v] = self.barycentrics.map(u64::from);
        hash(u64::from(self.triangle_and_side), u64::from(instance) << 32 | u << 16 | v, 0)
    }

    /// The anchor in the world, or `None` where the posed triangle has no normal.
    pub(crate) fn pose(&self, scene: &Scene, pose: &Pose, instance: usize) -> Option<PosedPoint> {
        let posed = &pose.instances[instance];
        let mesh = &scene.meshes[scene.instances[instance].mesh as usize];
        let positions = posed.deformed.as_ref().map_or(&mesh.positions, |d| &d.positions);
        let world_from_mesh = &posed.world_from_mesh;
        let corners = mesh.triangles[self.triangle() as usize]
            .map(|v| world_from_mesh.transform_point3(positions[v as usize]));
        pose_anchor(self, corners, world_from_mesh.matrix3.determinant() < 0.0)
    }
}

/// The anchor on a triangle with the given corners; `mirrored` if the map from mesh space that made them turns
/// counter-clockwise into clockwise.
pub(crate) fn pose_anchor(anchor: &Anchor, corners: [Vec3; 3], mirrored: bool) -> Option<PosedPoint> {
    let [a, b, c] = corners;
    let [u, v] = anchor.barycentrics();
    let (ab, ac) = (b - a, c - a);
    let face = ab.cross(ac).try_normalize()?;
    let tangent = ab.try_normalize()?;
    let normal = if mirrored != anchor.is_back() { -face } else { face };
    Some(PosedPoint { position: a + ab * u + ac * v, normal, tangent })
}

/// Where the axes that a posed anchor's frame has in the world (tangent, normal × tangent, normal) lie at rest, if the surface is
/// carried along without turning in itself; `mirrored` as for [`pose_anchor`], of the pose. `None` where the triangle at rest has no
/// normal.
pub(crate) fn rest_axes(
    anchor: &Anchor,
    scene: &Scene,
    instance: usize,
    mirrored: bool,
) -> Option<[Vec3; 3]> {
    let placed = &scene.instances[instance];
    let mesh = &scene.meshes[placed.mesh as usize];
    let corners = mesh.triangles[anchor.triangle() as usize]
        .map(|v| placed.rest_from_mesh * mesh.positions[v as usize]);
    let mirrored_at_rest = placed.rest_from_mesh.determinant() < 0.0;
    let PosedPoint { normal, tangent, .. } = pose_anchor(anchor, corners, mirrored_at_rest)?;
    // Into the triangle and to the same side of it: where one of both is mirrored, the third axis runs the other way.
    let bitangent = normal.cross(tangent);
    Some([tangent, if mirrored == mirrored_at_rest { bitangent } else { -bitangent }, normal])
}
