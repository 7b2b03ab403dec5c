//! The last steps of every load: nodes parents first, instances, rest-space scale.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use glam::{Mat3, Vec3};

use super::context::{Context, is_usable};
use super::{LoadError, normals};
use crate::{Aabb, EmitterShape, Instance, Mesh, Pose, Scene};

/// A scene under construction: node indices are those of the file, in any order.
#[derive(Default)]
pub(super) struct Draft {
    pub(super) scene: Scene,
    /// Children of each node.
    pub(super) children: Vec<Vec<u32>>,
    /// What to call each node in messages.
    pub(super) labels: Vec<String>,
    pub(super) placements: Vec<Placement>,
}

/// A mesh at a node.
pub(super) struct Placement {
    pub(super) node: u32,
    pub(super) mesh: u32,
    pub(super) skin: Option<u32>,
    pub(super) casts: bool,
    pub(super) emitter: EmitterShape,
    pub(super) receives: bool,
}

/// Makes the scene consistent as its documentation promises; also gives the index in the file of each node.
pub(super) fn finish(context: &Context<'_>, draft: Draft) -> Result<(Scene, Vec<u32>), LoadError> {
    let order = parents_first(context, &draft)?;
    let Draft { mut scene, labels, mut placements, .. } = draft;
    let mut new_index = vec![0_u32; order.len()];
    for (new, &old) in order.iter().enumerate() {
        new_index[old as usize] = new as u32;
    }
    let renamed = |node: u32| new_index[node as usize];
    let mut nodes = std::mem::take(&mut scene.nodes);
    scene.nodes = order.iter().map(|&old| std::mem::take(&mut nodes[old as usize])).collect();
    for node in &mut scene.nodes {
        node.parent = node.parent.map(renamed);
    }
    for joint in scene.skins.iter_mut().flat_map(|skin| &mut skin.joints) {
        *joint = renamed(*joint);
    }
    for channel in scene.animations.iter_mut().flat_map(|animation| &mut animation.channels) {
        channel.node = renamed(channel.node);
    }
    let label_of = |node: u32| labels[order[node as usize] as usize].as_str();
    for placement in &mut placements {
        placement.node = renamed(placement.node);
    }
    placements.sort_by_key(|placement| placement.node);
    for placement in placements {
        let mesh = &scene.meshes[placement.mesh as usize];
        if mesh.triangles.is_empty() {
            continue;
        }
        if let Some(skin) = placement.skin {
            check_joints(context, label_of(placement.node), mesh, scene.skins[skin as usize].joints.len())?;
        }
        if placement.skin.is_some() || !mesh.morph_targets.is_empty() {
            // What posing will take.
            context.charge(label_of(placement.node), mesh.positions.len() as u64, 24)?;
        }
        scene.instances.push(Instance {
            node: placement.node,
            mesh: placement.mesh,
            skin: placement.skin,
            casts: placement.casts,
            emitter: placement.emitter,
            receives: placement.receives,
            rest_from_mesh: Mat3::IDENTITY,
            spare: false,
        });
    }
    set_rest_scale(context, &mut scene, &label_of)?;
    Ok((scene, order))
}

/// The nodes ordered parents first, otherwise as in the file.
fn parents_first(context: &Context<'_>, draft: &Draft) -> Result<Vec<u32>, LoadError> {
    let nodes = &draft.scene.nodes;
    let is_root = |i: &u32| nodes[*i as usize].parent.is_none();
    let mut ready: BinaryHeap<Reverse<u32>> = (0..nodes.len() as u32).filter(is_root).map(Reverse).collect();
    let mut placed = vec![false; nodes.len()];
    let mut order = Vec::with_capacity(nodes.len());
    while let Some(Reverse(node)) = ready.pop() {
        if std::mem::replace(&mut placed[node as usize], true) {
            continue;
        }
        order.push(node);
        ready.extend(draft.children[node as usize].iter().copied().map(Reverse));
    }
    // With one parent each, nodes that no root leads to are on a cycle or below one.
    match placed.iter().position(|placed| !placed) {
        None => Ok(order),
        Some(lost) => {
            let mut node = lost;
            for _ in 0..nodes.len() {
                node = nodes[node].parent.map_or(node, |parent| parent as usize);
            }
            Err(LoadError::NodeCycle { file: context.file(), node: draft.labels[node].clone() })
        }
    }
}

fn check_joints(context: &Context<'_>, node: &str, mesh: &Mesh, joints: usize) -> Result<(), LoadError> {
    for (set, influences) in mesh.influences.iter().enumerate() {
        for (v, (indices, weights)) in influences.joints.iter().zip(&influences.weights).enumerate() {
            for (joint, weight) in indices.iter().zip(weights) {
                if *weight > 0.0 && usize::from(*joint) >= joints {
                    let at = format!("{node}: mesh \"{}\", JOINTS_{set} of vertex {v}", mesh.name);
                    return Err(context.out_of_range(at, "joint", u64::from(*joint), joints));
                }
            }
        }
    }
    Ok(())
}

/// Sets `rest_from_mesh` of every instance from the pose at time 0, and checks that the pose is finite.
fn set_rest_scale<'l>(
    context: &Context<'_>,
    scene: &mut Scene,
    label_of: &impl Fn(u32) -> &'l str,
) -> Result<(), LoadError> {
    if let Some(node) = scene.first_unplaceable_node(0.0) {
        return Err(context.not_finite(format!("the place in the world of {}", label_of(node as u32))));
    }
    let pose = scene.pose(0.0);
    for (i, instance) in scene.instances.iter().enumerate() {
        // What has no size at first still has a place.
        let posed = &pose.instances[i];
        let bounds = match posed.is_there() {
            true => scene.instance_bounds_world(&pose, i),
            false => Aabb::from_points([posed.world_from_mesh.translation.into()]),
        };
        let largest = bounds.min.abs().max(bounds.max.abs()).max_element();
        if !is_usable(largest) {
            return Err(context.not_finite(format!("the place in the world of {}", label_of(instance.node))));
        }
    }
    scene.set_rest_scales(&pose);
    Ok(())
}

impl Scene {
    /// Chooses the animation that [`Scene::pose`] plays (`None`: nothing moves), and brings rest space
    /// ([`Instance::rest_from_mesh`]) to its scale. An index out of range counts as `None`.
    pub fn set_active_animation(&mut self, animation: Option<u32>) {
        self.active_animation = animation.filter(|&i| (i as usize) < self.animations.len());
        self.set_rest_scales(&self.pose(0.0));
    }

    /// Sets `rest_from_mesh` of every instance from the pose at time 0.
    fn set_rest_scales(&mut self, pose: &Pose) {
        let scale_of = |(i, instance): (usize, &Instance)| {
            if instance.skin.is_none() {
                return Mat3::from(pose.world_from_node[instance.node as usize].matrix3);
            }
            let mesh = &self.meshes[instance.mesh as usize];
            let (posed, bind) = (area(mesh, self.vertex_positions(pose, i)), area(mesh, &mesh.positions));
            let scale = (posed / bind).sqrt() as f32;
            Mat3::from_diagonal(Vec3::splat(if scale.is_finite() && scale > 0.0 { scale } else { 1.0 }))
        };
        let scales: Vec<Mat3> = self.instances.iter().enumerate().map(scale_of).collect();
        for (instance, scale) in self.instances.iter_mut().zip(scales) {
            instance.rest_from_mesh = scale;
        }
    }
}

fn area(mesh: &Mesh, positions: &[Vec3]) -> f64 {
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| positions[v as usize]);
        0.5 * normals::area_vector(a, b, c).length()
    };
    mesh.triangles.iter().map(area).sum()
}
