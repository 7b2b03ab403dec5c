//! Poses a scene at one time: transforms, skins, morph targets, lights, cameras.

use std::sync::Arc;

use glam::{Affine3A, Mat3, Mat3A, Quat, Vec3, Vec3A};

use crate::{
    Aabb, ChannelTarget, DeformedMesh, Edits, Instance, Light, LocalTransform, Mesh, Placement, Pose,
    PosedCamera, PosedInstance, PosedLight, Scene, Skin,
};

/// Default ray length as a part of the scene's diagonal.
const RADIUS_OF_DIAGONAL: f32 = 0.02;

/// What animates one node at one time.
#[derive(Clone, Default)]
pub(crate) struct Animated {
    translation: Option<Vec3>,
    rotation: Option<Quat>,
    scale: Option<Vec3>,
    morph_weights: Option<Vec<f32>>,
}

impl Scene {
    /// Everything that moves, at `time_s` seconds, of the scene as it was loaded. The active animation plays in a loop. A
    /// function of the scene and the time alone, the same on every machine.
    pub fn pose(&self, time_s: f64) -> Pose {
        self.pose_edited(time_s, &Edits::new(self))
    }

    /// As [`Scene::pose`], of a scene that viewers have changed: a function of scene, time and edits. What the edits say of
    /// things that the scene does not have is left out ([`Edits::check`]).
    pub fn pose_edited(&self, time_s: f64, edits: &Edits) -> Pose {
        self.pose_with(time_s, edits, true)
    }

    /// As [`Scene::pose`], but no vertex is visited: `deformed` is `None` throughout. For those who skin and morph
    /// by themselves, from `world_from_node` (see [`Scene::world_from_bind`]) and `morph_weights`.
    pub fn pose_undeformed(&self, time_s: f64) -> Pose {
        self.pose_undeformed_edited(time_s, &Edits::new(self))
    }

    /// As [`Scene::pose_undeformed`], of a scene that viewers have changed.
    pub fn pose_undeformed_edited(&self, time_s: f64, edits: &Edits) -> Pose {
        self.pose_with(time_s, edits, false)
    }

    /// Where a node stands at `time_s` seconds, for who wants to move it from there; `None` if there is no such node, or its
    /// transform cannot be taken apart. A matrix that shears gives the nearest thing without shear.
    pub fn placement(&self, node: u32, time_s: f64, edits: &Edits) -> Option<Placement> {
        let index = node as usize;
        self.nodes.get(index)?;
        let local = self.local_transform(index, self.animate(time_s).get(index), edits);
        let (scale, rotation, translation) = match local {
            LocalTransform::Trs { translation, rotation, scale } => (scale, rotation, translation),
            LocalTransform::Matrix(matrix) => Affine3A::from_mat4(matrix).to_scale_rotation_translation(),
        };
        (scale.is_finite() && rotation.is_finite() && translation.is_finite()).then(|| {
            let (translation, rotation, scale) = (translation.into(), rotation.into(), scale.into());
            Placement { translation, rotation, scale }.normalized()
        })
    }

    /// Where each joint of a skin brings the mesh at bind time, in the world.
    pub fn world_from_bind(&self, pose: &Pose, skin: usize) -> Vec<Affine3A> {
        bind_transforms(&self.skins[skin], &pose.world_from_node)
    }

    fn pose_with(&self, time_s: f64, edits: &Edits, deform: bool) -> Pose {
        let animated = self.animate(time_s);
        let mut world_from_node = self.node_transforms(&animated, edits);
        for world in &mut world_from_node {
            // Scales that multiply beyond all bounds: nothing sensible can be drawn, but nothing must break either.
            if !world.is_finite() {
                *world = Affine3A::from_scale(Vec3::ZERO);
            }
        }
        let morph_weights: Vec<Vec<f32>> =
            self.instances.iter().map(|instance| self.morph_weights(instance, &animated)).collect();
        let posed = (0..).zip(self.instances.iter().zip(&morph_weights));
        let instances = posed
            .map(|(i, (instance, weights))| match edits.removed.contains(&i) {
                true => PosedInstance::REMOVED,
                false => self.pose_instance(instance, &world_from_node, weights, deform),
            })
            .collect();
        let mut lights = Vec::new();
        let mut cameras = Vec::new();
        for (node, world) in self.nodes.iter().zip(&world_from_node) {
            if let Some(light) = node.light {
                let direction_world =
                    Vec3::from(world.matrix3 * Vec3A::NEG_Z).try_normalize().unwrap_or(Vec3::NEG_Z);
                let Light { color, intensity, .. } = self.lights[light as usize];
                let edited = edits.lights.get(&light).map(|e| (Vec3::from_array(e.color), e.intensity));
                let (color, intensity) = edited.unwrap_or((color, intensity));
                let position_world = world.translation.into();
                lights.push(PosedLight { light, position_world, direction_world, color, intensity });
            }
            if let Some(camera) = node.camera {
                let projection = self.cameras[camera as usize].projection;
                cameras.push((camera, PosedCamera { world_from_view: without_scale(world), projection }));
            }
        }
        Pose { time: time_s, world_from_node, instances, morph_weights, lights, cameras }
    }

    /// The vertices of an instance: posed if it deforms, else its mesh's. In the space that the pose's
    /// `world_from_mesh` of the instance starts from.
    pub fn vertex_positions<'a>(&'a self, pose: &'a Pose, instance: usize) -> &'a [Vec3] {
        match &pose.instances[instance].deformed {
            Some(deformed) => &deformed.positions,
            None => &self.meshes[self.instances[instance].mesh as usize].positions,
        }
    }

    /// The tight world box of one instance, empty if it is not there. Visits every vertex.
    pub fn instance_bounds_world(&self, pose: &Pose, instance: usize) -> Aabb {
        if !pose.instances[instance].is_there() {
            return Aabb::EMPTY;
        }
        let world_from_mesh = &pose.instances[instance].world_from_mesh;
        let positions = self.vertex_positions(pose, instance);
        Aabb::from_points(positions.iter().map(|p| world_from_mesh.transform_point3(*p)))
    }

    /// The tight world box of all instances. Visits every vertex.
    pub fn bounds_world(&self, pose: &Pose) -> Aabb {
        (0..self.instances.len())
            .fold(Aabb::EMPTY, |bounds, i| bounds.union(self.instance_bounds_world(pose, i)))
    }

    /// Triangles, each mesh counted as often as it is placed.
    pub fn triangle_count(&self) -> usize {
        self.instances.iter().map(|instance| self.meshes[instance.mesh as usize].triangles.len()).sum()
    }

    /// A sensible length of occlusion rays: 2 % of the diagonal of the world box at time 0.
    pub fn auto_radius_m(&self) -> f32 {
        RADIUS_OF_DIAGONAL * self.bounds_world(&self.pose(0.0)).diagonal()
    }

    /// The active animation's values, one a node; empty without one.
    pub(crate) fn animate(&self, time_s: f64) -> Vec<Animated> {
        let Some(animation) = self.active_animation.and_then(|i| self.animations.get(i as usize)) else {
            return Vec::new();
        };
        let duration = f64::from(animation.duration());
        let time = if time_s.is_finite() { time_s } else { 0.0 };
        let time = if duration > 0.0 { time.rem_euclid(duration) } else { time };
        let mut animated = vec![Animated::default(); self.nodes.len()];
        for channel in animation.channels.iter().filter(|channel| !channel.times.is_empty()) {
            let node = &mut animated[channel.node as usize];
            match channel.target {
                ChannelTarget::Translation => node.translation = Some(channel.vec3(time)),
                ChannelTarget::Rotation => node.rotation = Some(channel.quat(time)),
                ChannelTarget::Scale => node.scale = Some(channel.vec3(time)),
                ChannelTarget::MorphWeights => node.morph_weights = Some(channel.weights(time)),
            }
        }
        animated
    }

    /// A node's own transform: the edits', else the animation's, else the file's.
    fn local_transform(&self, index: usize, animated: Option<&Animated>, edits: &Edits) -> LocalTransform {
        if let Some(placement) = u32::try_from(index).ok().and_then(|node| edits.placed.get(&node)) {
            return placement.local();
        }
        let mut local = self.nodes[index].local;
        if let (LocalTransform::Trs { translation, rotation, scale }, Some(values)) = (&mut local, animated) {
            *translation = values.translation.unwrap_or(*translation);
            *rotation = values.rotation.unwrap_or(*rotation);
            *scale = values.scale.unwrap_or(*scale);
        }
        local
    }

    pub(crate) fn node_transforms(&self, animated: &[Animated], edits: &Edits) -> Vec<Affine3A> {
        let mut world_from_node: Vec<Affine3A> = Vec::with_capacity(self.nodes.len());
        for (i, node) in self.nodes.iter().enumerate() {
            let local = self.local_transform(i, animated.get(i), edits);
            let parent_from_node = local.parent_from_node();
            world_from_node.push(match node.parent {
                Some(parent) => world_from_node[parent as usize] * parent_from_node,
                None => parent_from_node,
            });
        }
        world_from_node
    }

    /// Whether every node's place at `time_s` can be computed without overflow; the first that cannot otherwise.
    pub(crate) fn first_unplaceable_node(&self, time_s: f64) -> Option<usize> {
        self.node_transforms(&self.animate(time_s), &Edits::new(self))
            .iter()
            .position(|world| !world.is_finite())
    }

    /// Weights of an instance's morph targets: the animation's, else the node's, else the mesh's.
    fn morph_weights(&self, instance: &Instance, animated: &[Animated]) -> Vec<f32> {
        let mesh = &self.meshes[instance.mesh as usize];
        if mesh.morph_targets.is_empty() {
            return Vec::new();
        }
        let node = &self.nodes[instance.node as usize];
        let playing = animated.get(instance.node as usize).and_then(|values| values.morph_weights.as_ref());
        let still = if node.morph_weights.is_empty() { &mesh.morph_weights } else { &node.morph_weights };
        playing.unwrap_or(still).clone()
    }

    fn pose_instance(
        &self,
        instance: &Instance,
        world_from_node: &[Affine3A],
        morph_weights: &[f32],
        deform: bool,
    ) -> PosedInstance {
        let mesh = &self.meshes[instance.mesh as usize];
        let morphed = (deform && !mesh.morph_targets.is_empty()).then(|| morph(mesh, morph_weights));
        match instance.skin {
            Some(_) if !mesh.influences.is_empty() && !deform => {
                PosedInstance { world_from_mesh: Affine3A::IDENTITY, deformed: None }
            }
            Some(skin) if !mesh.influences.is_empty() => {
                let world_from_bind = bind_transforms(&self.skins[skin as usize], world_from_node);
                let deformed = match &morphed {
                    Some(morphed) => {
                        skin_vertices(mesh, &morphed.positions, &morphed.normals, &world_from_bind)
                    }
                    None => skin_vertices(mesh, &mesh.positions, &mesh.normals, &world_from_bind),
                };
                PosedInstance { world_from_mesh: Affine3A::IDENTITY, deformed: Some(Arc::new(deformed)) }
            }
            _ => PosedInstance {
                world_from_mesh: world_from_node[instance.node as usize],
                deformed: morphed.map(Arc::new),
            },
        }
    }
}

fn bind_transforms(skin: &Skin, world_from_node: &[Affine3A]) -> Vec<Affine3A> {
    let joints = skin.joints.iter().zip(&skin.inverse_bind_matrices);
    joints.map(|(&joint, bind)| world_from_node[joint as usize] * *bind).collect()
}

/// Rotation and place of a transform, for cameras and local spaces: the view axis is kept, up as near as possible.
pub(crate) fn without_scale(world: &Affine3A) -> Affine3A {
    let z = world.matrix3.z_axis.try_normalize().unwrap_or(Vec3A::Z);
    let x = world.matrix3.y_axis.cross(z).try_normalize();
    let x = x.unwrap_or_else(|| Vec3A::from(Vec3::from(z).any_orthonormal_vector()));
    Affine3A { matrix3: Mat3A::from_cols(x, z.cross(x), z), translation: world.translation }
}

/// Base plus weighted displacements (glTF 2.0, 3.7.2.2).
fn morph(mesh: &Mesh, weights: &[f32]) -> DeformedMesh {
    let mut positions = mesh.positions.clone();
    let mut normals = mesh.normals.clone();
    for (target, &weight) in mesh.morph_targets.iter().zip(weights) {
        if weight == 0.0 {
            continue;
        }
        for (position, offset) in positions.iter_mut().zip(&target.positions) {
            *position += weight * *offset;
        }
        for (normal, offset) in normals.iter_mut().zip(&target.normals) {
            *normal += weight * *offset;
        }
    }
    clean(&mut positions, &mut normals, &mesh.normals);
    DeformedMesh { positions, normals }
}

/// Linear blend skinning into the world (glTF 2.0, 3.7.3).
fn skin_vertices(
    mesh: &Mesh,
    positions: &[Vec3],
    normals: &[Vec3],
    world_from_bind: &[Affine3A],
) -> DeformedMesh {
    let mut posed = DeformedMesh {
        positions: Vec::with_capacity(positions.len()),
        normals: Vec::with_capacity(positions.len()),
    };
    for v in 0..positions.len() {
        let mut linear = Mat3A::ZERO;
        let mut translation = Vec3A::ZERO;
        for set in &mesh.influences {
            for (joint, weight) in set.joints[v].into_iter().zip(set.weights[v]) {
                if weight != 0.0
                    && let Some(world) = world_from_bind.get(usize::from(joint))
                {
                    linear += world.matrix3 * weight;
                    translation += world.translation * weight;
                }
            }
        }
        posed.positions.push(Vec3::from(linear * Vec3A::from(positions[v]) + translation));
        posed.normals.push(transform_normal(&Mat3::from(linear), normals[v]));
    }
    clean(&mut posed.positions, &mut posed.normals, normals);
    posed
}

/// A normal under a linear map: inverse transpose up to a positive factor, which also serves singular maps.
fn transform_normal(linear: &Mat3, normal: Vec3) -> Vec3 {
    let (x, y, z) = (linear.x_axis, linear.y_axis, linear.z_axis);
    let cofactors = Mat3::from_cols(y.cross(z), z.cross(x), x.cross(y));
    let mirrored = x.dot(cofactors.x_axis) < 0.0;
    let moved = cofactors * normal;
    if mirrored { -moved } else { moved }
}

/// Unit normals and finite positions, whatever the weights and joints were.
fn clean(positions: &mut [Vec3], normals: &mut [Vec3], fallback: &[Vec3]) {
    for position in positions {
        if !position.is_finite() {
            *position = Vec3::ZERO;
        }
    }
    for (normal, fallback) in normals.iter_mut().zip(fallback) {
        *normal = normal.try_normalize().filter(|n| n.is_finite()).unwrap_or(*fallback);
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests may panic")]
mod tests;
