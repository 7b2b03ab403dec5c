//! What the GLB writer is told: materials, nodes, lights, tracks.

use glam::{Quat, Vec3, Vec4};

use super::{CameraId, LightId, MeshId, NodeId, SkinId, TextureId};

/// A metallic-roughness material to write. The default is matt white, opaque and single-sided.
#[derive(Clone, Debug)]
pub struct MaterialSpec {
    /// Linear RGBA, multiplied with the texture.
    pub base_color: Vec4,
    /// Base colour texture (sRGB), read with the mesh's only UV set.
    pub texture: Option<TextureId>,
    /// Normal map, read with the same UV set.
    pub normal_map: Option<TextureId>,
    /// 0 dielectric … 1 metal.
    pub metallic: f32,
    /// Perceptual roughness, 0 … 1.
    pub roughness: f32,
    /// Linear emitted radiance; values above 1 are written with `KHR_materials_emissive_strength`.
    pub emissive: Vec3,
    /// Alpha below this is a hole (`MASK`); `None` is opaque.
    pub alpha_cutoff: Option<f32>,
    /// Drawn and lit from both sides.
    pub double_sided: bool,
}

impl Default for MaterialSpec {
    fn default() -> Self {
        MaterialSpec {
            base_color: Vec4::ONE,
            texture: None,
            normal_map: None,
            metallic: 0.0,
            roughness: 0.9,
            emissive: Vec3::ZERO,
            alpha_cutoff: None,
            double_sided: false,
        }
    }
}

impl MaterialSpec {
    /// A dielectric of one linear colour.
    pub fn matt(r: f32, g: f32, b: f32, roughness: f32) -> MaterialSpec {
        MaterialSpec { base_color: Vec4::new(r, g, b, 1.0), roughness, ..MaterialSpec::default() }
    }
}

/// The analytic shape that an emitting mesh stands for; the mesh is what cameras see and what casts shadows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Emitter {
    /// The sphere around the mesh's vertices, about their middle.
    Sphere,
    /// A flat disc that emits towards the mesh's front.
    Disc,
    /// A flat rectangle along two of the mesh's own axes that emits towards the mesh's front.
    Rectangle,
}

impl Emitter {
    /// Its name in `extras.light`.
    pub fn name(self) -> &'static str {
        match self {
            Emitter::Sphere => "sphere",
            Emitter::Disc => "disc",
            Emitter::Rectangle => "rectangle",
        }
    }
}

/// A node to write: where it stands and what it carries. The default is an empty node at the origin of the world.
#[derive(Clone, Debug)]
pub struct NodeSpec {
    /// Parent, or `None` for a root of the scene.
    pub parent: Option<NodeId>,
    /// Translation, metres.
    pub translation: Vec3,
    /// Unit rotation.
    pub rotation: Quat,
    /// Scale.
    pub scale: Vec3,
    /// Mesh that stands here.
    pub mesh: Option<MeshId>,
    /// Skin that deforms the mesh.
    pub skin: Option<SkinId>,
    /// Camera (looks along −Z).
    pub camera: Option<CameraId>,
    /// Light (shines along −Z).
    pub light: Option<LightId>,
    /// Whether the mesh occludes others; `false` is written as `extras.casts`.
    pub casts: bool,
    /// Whether the mesh carries computed light; `false` is written as `extras.receives`.
    pub receives: bool,
    /// What shape the mesh stands for if its material emits; written as `extras.light`. `None`: its triangles emit.
    pub emitter: Option<Emitter>,
}

impl Default for NodeSpec {
    fn default() -> Self {
        NodeSpec {
            parent: None,
            translation: Vec3::ZERO,
            rotation: Quat::IDENTITY,
            scale: Vec3::ONE,
            mesh: None,
            skin: None,
            camera: None,
            light: None,
            casts: true,
            receives: true,
            emitter: None,
        }
    }
}

impl NodeSpec {
    /// A mesh at a place, turned by an angle (radians) about the vertical.
    pub fn mesh_at(mesh: MeshId, translation: Vec3, turn: f32) -> NodeSpec {
        NodeSpec { mesh: Some(mesh), translation, rotation: rotation_y(turn), ..NodeSpec::default() }
    }
}

/// The rotation by `angle` radians about +Y; quarter turns are exact to the last bit of f32.
pub fn rotation_y(angle: f32) -> Quat {
    let half = 0.5 * f64::from(angle);
    Quat::from_xyzw(0.0, libm::sin(half) as f32, 0.0, libm::cos(half) as f32)
}

/// A punctual light to write.
#[derive(Clone, Copy, Debug)]
pub struct LightSpec {
    /// Linear RGB.
    pub color: Vec3,
    /// Candela for point and spot, lux for directional.
    pub intensity: f32,
    /// Distance at which the light has faded out, metres; `None` is unlimited.
    pub range: Option<f32>,
    /// What kind.
    pub kind: crate::LightKind,
}

/// The values of one animated property, one a key.
#[derive(Clone, Copy, Debug)]
pub enum Track<'a> {
    /// Node translation, metres.
    Translation(&'a [Vec3]),
    /// Node rotation, unit quaternions; neighbours should lie in one hemisphere.
    Rotation(&'a [Quat]),
    /// Node scale.
    Scale(&'a [Vec3]),
}

/// Joint influences of a mesh, one entry a vertex.
#[derive(Clone, Copy, Debug)]
pub struct Influences<'a> {
    /// Four indices into the skin's joints.
    pub joints: &'a [[u16; 4]],
    /// Four weights that sum to 1.
    pub weights: &'a [[f32; 4]],
}
