//! What skinning and morphing in the vertex stage reads: influences and displacements, which never change, and joints and
//! weights, which change with the pose.

use dapple_gpu::{Gpu, wgpu};
use dapple_scene::{Mesh, Pose, Scene};

use super::super::ForwardError;
use super::super::uniforms::{DEFORM_WIDTH, POSE_WIDTH, RIGID, rows};
use crate::tables::{float_table, write_rows};

/// Texel numbers are handed on as floats, which are exact up to here.
const MAX_TEXELS: usize = 1 << 24;

/// The two textures of `deform.wgsl`.
#[derive(Debug)]
pub(crate) struct Deformation {
    pub(crate) pose_view: wgpu::TextureView,
    pub(crate) deform_view: wgpu::TextureView,
    pose_texture: wgpu::Texture,
    /// First texel of each instance's header; [`RIGID`] for those that do not deform.
    pub(crate) headers: Vec<u32>,
    /// Where each mesh's influences and displacements begin.
    places: Vec<MeshPlace>,
    /// The pose's texels, and those of the pose before.
    texels: Vec<[f32; 4]>,
    texels_before: Vec<[f32; 4]>,
}

#[derive(Clone, Copy, Debug, Default)]
struct MeshPlace {
    influences: usize,
    displacements: usize,
}

impl Deformation {
    pub(super) fn new(gpu: &Gpu, scene: &Scene) -> Result<Deformation, ForwardError> {
        let mut still = Vec::new();
        let mut places = Vec::with_capacity(scene.meshes.len());
        for mesh in &scene.meshes {
            places.push(MeshPlace {
                influences: push_influences(mesh, &mut still),
                displacements: push_displacements(mesh, &mut still),
            });
        }
        let mut next = 0;
        let headers: Vec<u32> = (0..scene.instances.len())
            .map(|i| {
                let size = header_texels(scene, i);
                let first = next;
                next += size;
                if size == 0 { RIGID } else { first as u32 }
            })
            .collect();
        let limit =
            (gpu.device.limits().max_texture_dimension_2d as usize * POSE_WIDTH as usize).min(MAX_TEXELS);
        for texels in [still.len(), next] {
            if texels > limit {
                return Err(ForwardError::DeformationTooLarge { texels, limit });
            }
        }
        let deform_texture = make(gpu, "deformation", DEFORM_WIDTH, still.len());
        write(gpu, &deform_texture, DEFORM_WIDTH, &mut still);
        let pose_texture = make(gpu, "pose", POSE_WIDTH, next);
        Ok(Deformation {
            pose_view: pose_texture.create_view(&wgpu::TextureViewDescriptor::default()),
            deform_view: deform_texture.create_view(&wgpu::TextureViewDescriptor::default()),
            pose_texture,
            headers,
            places,
            texels: Vec::with_capacity(next),
            texels_before: Vec::new(),
        })
    }

    /// Writes joints and weights of a pose, and tells which instances have others than before. Nothing to do in a scene
    /// where all is rigid.
    pub(super) fn write_pose(
        &mut self,
        gpu: &Gpu,
        scene: &Scene,
        pose: &Pose,
        mut has_changed: impl FnMut(usize),
    ) {
        std::mem::swap(&mut self.texels, &mut self.texels_before);
        self.texels.clear();
        let mut is_same = true;
        for (i, instance) in scene.instances.iter().enumerate() {
            if self.headers[i] == RIGID {
                continue;
            }
            let mesh = &scene.meshes[instance.mesh as usize];
            let place = self.places[instance.mesh as usize];
            let weights = pose.morph_weights.get(i).map_or(&[][..], Vec::as_slice);
            let joints = match instance.skin {
                Some(skin) if !mesh.influences.is_empty() => scene.world_from_bind(pose, skin as usize),
                _ => Vec::new(),
            };
            let first_joint = self.texels.len() + 2;
            let first_weight = first_joint + 3 * joints.len();
            let sets = if joints.is_empty() { 0 } else { mesh.influences.len() };
            let targets = weights.len().min(mesh.morph_targets.len());
            let numbers = |n: [usize; 4]| n.map(|n| n as f32);
            self.texels.push(numbers([place.influences, sets, place.displacements, targets]));
            self.texels.push(numbers([mesh.positions.len(), first_joint, first_weight, joints.len()]));
            self.texels.extend(joints.iter().flat_map(rows));
            let places = header_texels(scene, i) - 2 - 3 * joints.len();
            self.texels.extend((0..places).map(|t| [weights.get(t).copied().unwrap_or(0.0), 0.0, 0.0, 0.0]));
            let range = self.headers[i] as usize..self.texels.len();
            let before = self.texels_before.get(range.clone()).unwrap_or_default();
            if bytemuck::cast_slice::<_, u8>(before) != bytemuck::cast_slice::<_, u8>(&self.texels[range]) {
                is_same = false;
                has_changed(i);
            }
        }
        if !is_same {
            write(gpu, &self.pose_texture, POSE_WIDTH, &mut self.texels);
        }
    }
}

/// Texels of an instance in the pose texture; 0 if it does not deform.
fn header_texels(scene: &Scene, instance: usize) -> usize {
    let instance = &scene.instances[instance];
    let mesh = &scene.meshes[instance.mesh as usize];
    let joints = match instance.skin {
        Some(skin) if !mesh.influences.is_empty() => {
            let skin = &scene.skins[skin as usize];
            skin.joints.len().min(skin.inverse_bind_matrices.len())
        }
        _ => 0,
    };
    let targets = mesh.morph_targets.len();
    if joints == 0 && targets == 0 { 0 } else { 2 + 3 * joints + targets }
}

/// Joints and weights, vertex by vertex and set by set.
fn push_influences(mesh: &Mesh, texels: &mut Vec<[f32; 4]>) -> usize {
    let first = texels.len();
    if mesh.influences.is_empty() {
        return first;
    }
    for v in 0..mesh.positions.len() {
        for set in &mesh.influences {
            texels.push(set.joints.get(v).copied().unwrap_or_default().map(f32::from));
            texels.push(set.weights.get(v).copied().unwrap_or_default());
        }
    }
    first
}

/// Positions and normals, target by target and vertex by vertex.
fn push_displacements(mesh: &Mesh, texels: &mut Vec<[f32; 4]>) -> usize {
    let first = texels.len();
    for target in &mesh.morph_targets {
        for v in 0..mesh.positions.len() {
            for list in [&target.positions, &target.normals] {
                texels.push(list.get(v).copied().unwrap_or_default().extend(0.0).to_array());
            }
        }
    }
    first
}

fn make(gpu: &Gpu, label: &str, width: u32, texels: usize) -> wgpu::Texture {
    let height = (texels as u32).div_ceil(width).max(1);
    float_table(gpu, label, width, height)
}

/// Writes texels from the first on, whole rows. The list keeps its length.
fn write(gpu: &Gpu, texture: &wgpu::Texture, width: u32, texels: &mut Vec<[f32; 4]>) {
    let len = texels.len();
    let rows = (len as u32).div_ceil(width);
    if rows == 0 {
        return;
    }
    texels.resize(rows as usize * width as usize, [0.0; 4]);
    write_rows(gpu, texture, 0, texels);
    texels.truncate(len);
}
