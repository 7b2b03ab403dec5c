//! Everything that moves, at one time.

use std::sync::Arc;

use glam::{Affine3A, Mat3A, Vec3};

use crate::{PosedCamera, PosedLight};

/// The scene at one time. Lists run parallel to the scene's.
#[derive(Clone, Debug, Default)]
pub struct Pose {
    /// Seconds.
    pub time: f64,
    /// World transform of every node.
    pub world_from_node: Vec<Affine3A>,
    /// One for each of [`crate::Scene::instances`].
    pub instances: Vec<PosedInstance>,
    /// One list for each of [`crate::Scene::instances`]: weights of its mesh's morph targets, empty where it has none.
    pub morph_weights: Vec<Vec<f32>>,
    /// Every placed light, in node order.
    pub lights: Vec<PosedLight>,
    /// Every placed camera, in node order, with its index into [`crate::Scene::cameras`].
    pub cameras: Vec<(u32, PosedCamera)>,
}

/// An instance at one time.
#[derive(Clone, Debug)]
pub struct PosedInstance {
    /// World from mesh space; the identity for skinned instances, whose vertices are posed in the world; zero for those that
    /// are not there ([`PosedInstance::is_there`]).
    pub world_from_mesh: Affine3A,
    /// Vertices that replace the mesh's, for skinned and morphed instances; `None` for all others, and for all in a
    /// pose of [`crate::Scene::pose_undeformed`], and those that are not there.
    pub deformed: Option<Arc<DeformedMesh>>,
}

impl PosedInstance {
    /// An instance that is not there.
    pub const REMOVED: PosedInstance = PosedInstance { world_from_mesh: Affine3A::ZERO, deformed: None };

    /// Whether it is anywhere: not if it was removed, or its transform has scale 0 in all directions. What is not there has no
    /// box, is not drawn, blocks nothing, and its points are nowhere.
    pub fn is_there(&self) -> bool {
        self.world_from_mesh.matrix3 != Mat3A::ZERO
    }
}

/// Posed vertices: mesh space for morphed meshes, world space for skinned ones (then `world_from_mesh` is the identity).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DeformedMesh {
    /// One for each of the mesh's vertices.
    pub positions: Vec<Vec3>,
    /// Unit normals.
    pub normals: Vec<Vec3>,
}
