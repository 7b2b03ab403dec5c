//! Rust mirrors of the structures in the shaders. A test compares every offset.

use bytemuck::{Pod, Zeroable};

/// Most lights of a frame; more are left out (and counted in [`super::Drawn`]).
pub const MAX_LIGHTS: usize = 64;
/// Most faces of shadow maps: sixteen point lights.
pub const MAX_FACES: usize = 96;

/// `Frame` in `frame.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct FrameUniform {
    pub(super) clip_from_relative: [[f32; 4]; 4],
    pub(super) eye_world: [f32; 3],
    pub(super) view: u32,
    pub(super) axis_world: [f32; 3],
    pub(super) is_parallel: u32,
    pub(super) ambient_sky: [f32; 3],
    pub(super) exposure: f32,
    pub(super) ambient_ground: [f32; 3],
    pub(super) tone_curve: u32,
    pub(super) fade: f32,
    pub(super) specular: u32,
    pub(super) light_count: u32,
    pub(super) dim: f32,
    pub(super) point_half: [f32; 2],
    pub(super) point_half_m: f32,
    pub(super) area_lights: u32,
}

/// `Light` in `frame.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct LightUniform {
    pub(super) position_world: [f32; 3],
    pub(super) inverse_range_squared: f32,
    pub(super) direction_world: [f32; 3],
    pub(super) is_directional: u32,
    pub(super) intensity: [f32; 3],
    pub(super) first_face: u32,
    pub(super) cone: [f32; 2],
    pub(super) face_count: u32,
    pub(super) pad: u32,
}

/// `Face` in `frame.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct FaceUniform {
    pub(super) view_from_world: [[f32; 4]; 3],
    pub(super) extent: [f32; 2],
    pub(super) resolution: f32,
    pub(super) layer: u32,
    pub(super) origin: [f32; 2],
    pub(super) near: f32,
    pub(super) far: f32,
    pub(super) is_perspective: u32,
    pub(super) pad_a: u32,
    pub(super) pad_b: u32,
    pub(super) pad_c: u32,
}

/// `Lights` in `frame.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct LightsUniform {
    pub(super) lights: [LightUniform; MAX_LIGHTS],
    pub(super) faces: [FaceUniform; MAX_FACES],
}

/// `TextureUse` in `material.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct TextureUseUniform {
    pub(super) linear: [f32; 4],
    pub(super) offset: [f32; 2],
    pub(super) uv_set: u32,
    pub(super) pad: u32,
}

/// `Material` in `material.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct MaterialUniform {
    pub(super) base_color: [f32; 4],
    pub(super) emissive: [f32; 3],
    pub(super) metallic: f32,
    pub(super) roughness: f32,
    pub(super) normal_scale: f32,
    pub(super) cutoff: f32,
    pub(super) flags: u32,
    pub(super) base_color_use: TextureUseUniform,
    pub(super) metallic_roughness_use: TextureUseUniform,
    pub(super) normal_use: TextureUseUniform,
    pub(super) emissive_use: TextureUseUniform,
}

/// `MATERIAL_UNLIT` in `material.wgsl`.
pub(super) const MATERIAL_UNLIT: u32 = 1;
/// `MATERIAL_NORMAL_MAP` in `material.wgsl`.
pub(super) const MATERIAL_NORMAL_MAP: u32 = 2;

/// What a vertex of `vertex.wgsl` gets once an instance.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(super) struct InstanceRaw {
    /// Rows of world from mesh.
    pub(super) world: [[f32; 4]; 3],
    /// Rows of rest from mesh.
    pub(super) rest: [[f32; 4]; 3],
    /// Index in the scene, first page, header of the pose, bits.
    pub(super) ids: [u32; 4],
}

/// `INSTANCE_STORED_TANGENTS` in `vertex.wgsl`, and so on.
pub(super) const INSTANCE_STORED_TANGENTS: u32 = 1;
pub(super) const INSTANCE_MIRRORED: u32 = 2;
pub(super) const INSTANCE_REST_MIRRORED: u32 = 4;
pub(super) const INSTANCE_PER_VERTEX: u32 = 8;
pub(super) const INSTANCE_BACK_PAGES_SHIFT: u32 = 16;

/// `RIGID` in `deform.wgsl`.
pub(super) const RIGID: u32 = u32::MAX;
/// `NO_PAGE` in `vertex.wgsl`.
pub(super) const NO_PAGE: u16 = u16::MAX;
/// Texels in a row of the pose texture, of the deformation texture, and of the page table.
pub(super) const POSE_WIDTH: u32 = 1024;
pub(super) const DEFORM_WIDTH: u32 = 2048;
pub(super) const PAGE_TABLE_WIDTH: u32 = 1024;

/// Rows of an affine map.
pub(super) fn rows(map: &glam::Affine3A) -> [[f32; 4]; 3] {
    let (x, y, z, t) = (map.matrix3.x_axis, map.matrix3.y_axis, map.matrix3.z_axis, map.translation);
    [[x.x, y.x, z.x, t.x], [x.y, y.y, z.y, t.y], [x.z, y.z, z.z, t.z]]
}
