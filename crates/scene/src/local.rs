//! Posed local space: an instance's own frame, in metres, in which a rigid instance never moves and only bending shows.

use glam::{Affine3A, Vec3};

use crate::posing::without_scale;
use crate::{Pose, Scene};

impl Scene {
    /// Posed local space of an instance from the space of its posed vertices ([`Scene::vertex_positions`]), where `pose` is of
    /// this scene.
    ///
    /// For rigid and morphed instances it is rest space ([`crate::Instance::rest_from_mesh`]), whatever the pose; for
    /// skinned ones, whose vertices are posed in the world, it is the node that all joints hang from, most often the root joint,
    /// without its scale: it goes where the skeleton goes, whatever node the mesh was put at (glTF 2.0, 3.7.3.3, ignores that one).
    /// The world, if the joints have no node in common.
    pub fn local_from_posed(&self, pose: &Pose, instance: usize) -> Affine3A {
        let placed = &self.instances[instance];
        if self.is_skinned(instance) {
            let root = placed.skin.and_then(|skin| self.common_node(&self.skins[skin as usize].joints));
            root.map_or(Affine3A::IDENTITY, |root| {
                without_scale(&pose.world_from_node[root as usize]).inverse()
            })
        } else {
            Affine3A::from_mat3_translation(placed.rest_from_mesh, Vec3::ZERO)
        }
    }

    /// Whether an instance can have another shape at another time: it has a skin, or morph targets.
    pub fn is_deformable(&self, instance: usize) -> bool {
        let mesh = self.instances[instance].mesh as usize;
        self.is_skinned(instance) || !self.meshes[mesh].morph_targets.is_empty()
    }

    /// The node nearest to them that all of these are or hang from.
    fn common_node(&self, nodes: &[u32]) -> Option<u32> {
        let (&first, others) = nodes.split_first()?;
        others.iter().try_fold(first, |mut common, &node| {
            let mut node = node;
            // Parents come before their children.
            while common != node {
                let deeper = if common > node { &mut common } else { &mut node };
                *deeper = self.nodes[*deeper as usize].parent?;
            }
            Some(common)
        })
    }

    fn is_skinned(&self, instance: usize) -> bool {
        let placed = &self.instances[instance];
        placed.skin.is_some() && !self.meshes[placed.mesh as usize].influences.is_empty()
    }
}

#[cfg(all(test, feature = "builtin"))]
#[allow(clippy::unwrap_used, reason = "tests may panic")]
mod tests {
    use crate::{Aabb, NoFiles, builtin, load};
    use glam::Vec3;

    #[test]
    fn rigid_instances_stay_and_local_lengths_are_those_of_the_world() {
        let scene = load("lab.glb", &builtin::glb("lab", 0.1).unwrap(), &NoFiles).unwrap();
        let poses = [scene.pose(0.0), scene.pose(1.7)];
        let mut bent = 0;
        let size = |vertices: &[Vec3]| Aabb::from_points(vertices.iter().copied()).diagonal();
        for instance in 0..scene.instances.len() {
            let local = poses.each_ref().map(|pose| {
                let map = scene.local_from_posed(pose, instance);
                let vertices = scene.vertex_positions(pose, instance).iter();
                vertices.map(|v| map.transform_point3(*v)).collect::<Vec<Vec3>>()
            });
            if scene.is_deformable(instance) {
                bent += u32::from(local[0] != local[1]);
                // A walker stays where it is while it goes some metres.
                let both = [&local[0][..], &local[1]].concat();
                assert!(size(&both) < 1.5 * size(&local[0]), "instance {instance}: {} m", size(&both));
            } else {
                assert_eq!(local[0], local[1], "instance {instance}");
            }
            let world: Vec<Vec3> = {
                let map = poses[1].instances[instance].world_from_mesh;
                scene.vertex_positions(&poses[1], instance).iter().map(|v| map.transform_point3(*v)).collect()
            };
            for (l, w) in local[1].windows(2).zip(world.windows(2)) {
                assert!((l[0].distance(l[1]) - w[0].distance(w[1])).abs() < 1e-3, "instance {instance}");
            }
        }
        assert!(bent >= 23, "walkers bend");
    }
}
