//! Boxes around what is drawn: around all instances to leave out what is not seen, around casters to fit shadow maps.

use std::sync::Arc;

use dapple_scene::{Aabb, DeformedMesh, Mesh, Pose, Scene};
use glam::{Affine3A, Mat4, Vec3, Vec4};

/// Boxes of every instance in the world, and of casters as seen from lights.
#[derive(Debug)]
pub(crate) struct CasterBounds {
    meshes: Vec<MeshBounds>,
    /// World boxes of the frame; they may be larger than what they hold.
    pub(crate) world: Vec<Aabb>,
    /// For each instance the tight box in the world and what it was computed for.
    tight_world: Vec<Cached>,
    /// For each light, the same as seen from it.
    tight_light: Vec<Vec<Cached>>,
}

/// A box with what it was computed for.
#[derive(Clone, Debug, Default)]
struct Cached {
    key: Option<(Affine3A, Affine3A)>,
    bounds: Option<Aabb>,
}

#[derive(Debug)]
struct MeshBounds {
    /// At rest.
    rest: Aabb,
    /// Around the vertices that each joint moves, at bind time.
    joints: Vec<Aabb>,
    /// Farthest displacement of each morph target.
    reach: Vec<f32>,
}

impl MeshBounds {
    fn new(mesh: &Mesh) -> MeshBounds {
        let mut joints = Vec::new();
        for set in &mesh.influences {
            for (&position, (ids, weights)) in mesh.positions.iter().zip(set.joints.iter().zip(&set.weights))
            {
                for (&id, &weight) in ids.iter().zip(weights) {
                    if weight != 0.0 {
                        let id = usize::from(id);
                        if joints.len() <= id {
                            joints.resize(id + 1, Aabb::EMPTY);
                        }
                        joints[id] = joints[id].with_point(position);
                    }
                }
            }
        }
        let reach = mesh
            .morph_targets
            .iter()
            .map(|target| target.positions.iter().map(|offset| offset.length()).fold(0.0, f32::max));
        MeshBounds { rest: Aabb::from_points(mesh.positions.iter().copied()), joints, reach: reach.collect() }
    }
}

impl CasterBounds {
    pub(super) fn new(scene: &Scene) -> CasterBounds {
        CasterBounds {
            meshes: scene.meshes.iter().map(MeshBounds::new).collect(),
            world: Vec::new(),
            tight_world: vec![Cached::default(); scene.instances.len()],
            tight_light: Vec::new(),
        }
    }

    /// Boxes of a pose.
    pub(super) fn place(&mut self, scene: &Scene, pose: &Pose) {
        self.world.clear();
        for i in 0..scene.instances.len() {
            self.world.push(self.loose(scene, pose, i, &Affine3A::IDENTITY));
        }
    }

    /// A box around an instance without looking at its vertices, in the space that `map` leads to from the world.
    fn loose(&self, scene: &Scene, pose: &Pose, i: usize, map: &Affine3A) -> Aabb {
        if !pose.instances[i].is_there() {
            return Aabb::EMPTY;
        }
        let instance = &scene.instances[i];
        let bounds = &self.meshes[instance.mesh as usize];
        let weights = pose.morph_weights.get(i).map_or(&[][..], Vec::as_slice);
        let reach: f32 = bounds.reach.iter().zip(weights).map(|(reach, weight)| reach * weight.abs()).sum();
        match instance.skin {
            Some(skin) if !bounds.joints.is_empty() => {
                let joints = scene.world_from_bind(pose, skin as usize);
                joints.iter().zip(&bounds.joints).filter(|(_, b)| !b.is_empty()).fold(
                    Aabb::EMPTY,
                    |sum, (world_from_bind, b)| {
                        sum.union(b.inflated(reach).transformed(&(*map * *world_from_bind)))
                    },
                )
            }
            _ if bounds.rest.is_empty() => Aabb::EMPTY,
            _ => bounds.rest.inflated(reach).transformed(&(*map * pose.instances[i].world_from_mesh)),
        }
    }

    /// Diagonal of the box around all casters in the world, metres.
    pub(crate) fn diagonal(&mut self, scene: &Scene, pose: &Pose) -> f32 {
        let mut cached = std::mem::take(&mut self.tight_world);
        let bounds = self.around(scene, pose, &Affine3A::IDENTITY, &mut cached);
        self.tight_world = cached;
        bounds.diagonal()
    }

    /// The box around all casters as the `light`-th light sees them.
    pub(crate) fn as_seen_by(
        &mut self,
        light: usize,
        scene: &Scene,
        pose: &Pose,
        view_from_world: &Affine3A,
    ) -> Aabb {
        if self.tight_light.len() <= light {
            self.tight_light.resize(light + 1, Vec::new());
        }
        let mut cached = std::mem::take(&mut self.tight_light[light]);
        cached.resize(scene.instances.len(), Cached::default());
        let bounds = self.around(scene, pose, view_from_world, &mut cached);
        self.tight_light[light] = cached;
        bounds
    }

    /// As the twin fits its maps: around the vertices themselves. What stands still is looked at once; what deforms only
    /// where the pose has its vertices.
    fn around(&self, scene: &Scene, pose: &Pose, map: &Affine3A, cached: &mut [Cached]) -> Aabb {
        let mut sum = Aabb::EMPTY;
        for (i, instance) in scene.instances.iter().enumerate().filter(|(_, instance)| instance.casts) {
            let posed = &pose.instances[i];
            if !posed.is_there() {
                continue;
            }
            let mesh = &scene.meshes[instance.mesh as usize];
            let deforms =
                !mesh.morph_targets.is_empty() || (instance.skin.is_some() && !mesh.influences.is_empty());
            let bounds = match &posed.deformed {
                Some(deformed) => tight(vertices(deformed), &posed.world_from_mesh, map),
                None if deforms => self.loose(scene, pose, i, map),
                None => {
                    let key = (posed.world_from_mesh, *map);
                    let slot = &mut cached[i];
                    match slot.bounds.filter(|_| slot.key == Some(key)) {
                        Some(bounds) => bounds,
                        None => {
                            let bounds = tight(&mesh.positions, &posed.world_from_mesh, map);
                            *slot = Cached { key: Some(key), bounds: Some(bounds) };
                            bounds
                        }
                    }
                }
            };
            sum = sum.union(bounds);
        }
        sum
    }
}

fn vertices(deformed: &Arc<DeformedMesh>) -> &[Vec3] {
    &deformed.positions
}

fn tight(positions: &[Vec3], world_from_mesh: &Affine3A, map: &Affine3A) -> Aabb {
    let world = positions.iter().map(|&p| world_from_mesh.transform_point3(p)).filter(|p| p.is_finite());
    Aabb::from_points(world.map(|p| map.transform_point3(p)))
}

/// Whether a box lies wholly outside of what a projection (reverse z) shows.
pub(crate) fn is_outside(bounds: &Aabb, clip_from_world: &Mat4) -> bool {
    if bounds.is_empty() {
        return true;
    }
    let corner = |i: u32| -> Vec4 {
        let pick = |bit: u32, low: f32, high: f32| if i & bit == 0 { low } else { high };
        *clip_from_world
            * Vec4::new(
                pick(1, bounds.min.x, bounds.max.x),
                pick(2, bounds.min.y, bounds.max.y),
                pick(4, bounds.min.z, bounds.max.z),
                1.0,
            )
    };
    let corners: [Vec4; 8] = std::array::from_fn(|i| corner(i as u32));
    let all = |outside: fn(&Vec4) -> bool| corners.iter().all(outside);
    // A hair more than the picture, for rounding.
    all(|c| c.x > c.w.abs() * 1.0001)
        || all(|c| c.x < -c.w.abs() * 1.0001)
        || all(|c| c.y > c.w.abs() * 1.0001)
        || all(|c| c.y < -c.w.abs() * 1.0001)
        || all(|c| c.z > c.w + 1e-4 * c.w.abs())
}
