//! The scene: everything that does not change with time, and how it is connected.

use glam::{Affine3A, Mat3, Mat4, Quat, Vec3};

use crate::{Animation, Camera, EmitterShape, Image, Light, Material, Mesh, Texture};

/// A loaded scene. Indices between the lists are valid; `nodes` are ordered parents first.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// File stem or built-in name.
    pub name: String,
    /// Transform hierarchy, every parent before its children.
    pub nodes: Vec<Node>,
    /// Meshes in mesh space.
    pub meshes: Vec<Mesh>,
    /// Where meshes stand: one for each node that has a mesh, in node order.
    pub instances: Vec<Instance>,
    /// Skins.
    pub skins: Vec<Skin>,
    /// Materials; at least one when there is a mesh.
    pub materials: Vec<Material>,
    /// Textures.
    pub textures: Vec<Texture>,
    /// Decoded images.
    pub images: Vec<Image>,
    /// Lights, placed by nodes.
    pub lights: Vec<Light>,
    /// Cameras, placed by nodes.
    pub cameras: Vec<Camera>,
    /// All animations of the file; `active_animation` plays.
    pub animations: Vec<Animation>,
    /// Index of the animation that [`Scene::pose`] plays (the file's first by default), if any.
    pub active_animation: Option<u32>,
    /// What the loader put right or left out, for the user to read.
    pub warnings: Vec<Warning>,
}

/// A node of the transform hierarchy.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Node {
    /// Name in the file, or a made-up one.
    pub name: String,
    /// Index of the parent, always smaller than the node's own.
    pub parent: Option<u32>,
    /// Transform to the parent's space when nothing animates it.
    pub local: LocalTransform,
    /// Index into [`Scene::cameras`].
    pub camera: Option<u32>,
    /// Index into [`Scene::lights`].
    pub light: Option<u32>,
    /// Morph weights that override the mesh's, or empty.
    pub morph_weights: Vec<f32>,
}

/// A node's own transform.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LocalTransform {
    /// Translation, rotation, scale: can be animated.
    Trs {
        /// Translation.
        translation: Vec3,
        /// Unit rotation.
        rotation: Quat,
        /// Scale.
        scale: Vec3,
    },
    /// A fixed affine matrix.
    Matrix(Mat4),
}

impl Default for LocalTransform {
    fn default() -> Self {
        LocalTransform::Trs { translation: Vec3::ZERO, rotation: Quat::IDENTITY, scale: Vec3::ONE }
    }
}

impl LocalTransform {
    /// As an affine map.
    pub fn parent_from_node(&self) -> Affine3A {
        match *self {
            LocalTransform::Trs { translation, rotation, scale } => {
                Affine3A::from_scale_rotation_translation(scale, rotation, translation)
            }
            LocalTransform::Matrix(m) => Affine3A::from_mat4(m),
        }
    }
}

/// A mesh placed by a node.
#[derive(Clone, Debug, PartialEq)]
pub struct Instance {
    /// Index into [`Scene::nodes`].
    pub node: u32,
    /// Index into [`Scene::meshes`].
    pub mesh: u32,
    /// Index into [`Scene::skins`].
    pub skin: Option<u32>,
    /// Occludes others (`extras.casts`, default true).
    pub casts: bool,
    /// Carries points (`extras.receives`, default true).
    pub receives: bool,
    /// What its emitting surface is taken for, when it lights others (`extras.light`, default its triangles).
    pub emitter: EmitterShape,
    /// Rest space from mesh space: brings the mesh to world scale, so that rest-space distances are metres.
    ///
    /// For rigid and morphed instances it is the linear part of the node's world transform at time 0; for skinned
    /// ones a uniform scale, the square root of (surface area posed at time 0 ÷ area of the bind pose). It never changes.
    pub rest_from_mesh: Mat3,
    /// Not there until somebody wants another of its kind ([`Scene::add_spares`]); files have none.
    pub spare: bool,
}

/// The joints of a skinned mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Skin {
    /// Name in the file, or a made-up one.
    pub name: String,
    /// Indices into [`Scene::nodes`].
    pub joints: Vec<u32>,
    /// `joint_from_mesh` at bind time, one a joint (identity where the file gives none).
    pub inverse_bind_matrices: Vec<Affine3A>,
}

/// A flaw that the loader worked around.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// What, where, and what was done instead.
    pub message: String,
}

/// Identifies a scene's content: geometry, materials, animation, but not names.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct SceneHash(pub [u8; 32]);

impl std::fmt::Display for SceneHash {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for byte in &self.0[..8] {
            write!(f, "{byte:02x}")?;
        }
        Ok(())
    }
}

/// An axis-aligned box. Empty when `min > max`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Smallest corner.
    pub min: Vec3,
    /// Largest corner.
    pub max: Vec3,
}

impl Default for Aabb {
    fn default() -> Self {
        Aabb::EMPTY
    }
}

impl Aabb {
    /// Contains nothing.
    pub const EMPTY: Aabb = Aabb { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// The box around points.
    pub fn from_points(points: impl IntoIterator<Item = Vec3>) -> Aabb {
        points.into_iter().fold(Aabb::EMPTY, |b, p| b.with_point(p))
    }

    /// Whether it contains nothing.
    pub fn is_empty(&self) -> bool {
        self.min.cmpgt(self.max).any()
    }

    /// Grown to contain `p`.
    pub fn with_point(self, p: Vec3) -> Aabb {
        Aabb { min: self.min.min(p), max: self.max.max(p) }
    }

    /// The box around both.
    pub fn union(self, other: Aabb) -> Aabb {
        Aabb { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Grown by `margin` on every side.
    pub fn inflated(self, margin: f32) -> Aabb {
        Aabb { min: self.min - margin, max: self.max + margin }
    }

    /// Whether the two share a point.
    pub fn intersects(&self, other: &Aabb) -> bool {
        self.min.cmple(other.max).all() && other.min.cmple(self.max).all()
    }

    /// Squared distance of `p` to the box, 0 inside, infinite for the empty box.
    pub fn distance_squared(&self, p: Vec3) -> f32 {
        if self.is_empty() {
            return f32::INFINITY;
        }
        (self.min - p).max(p - self.max).max(Vec3::ZERO).length_squared()
    }

    /// Centre.
    pub fn center(&self) -> Vec3 {
        0.5 * (self.min + self.max)
    }

    /// Length of the diagonal (0 if empty).
    pub fn diagonal(&self) -> f32 {
        if self.is_empty() { 0.0 } else { (self.max - self.min).length() }
    }

    /// The box around the transformed box.
    pub fn transformed(&self, map: &Affine3A) -> Aabb {
        if self.is_empty() {
            return *self;
        }
        let corner = |i: u32| {
            let pick = |bit: u32, lo: f32, hi: f32| if i & bit == 0 { lo } else { hi };
            map.transform_point3(Vec3::new(
                pick(1, self.min.x, self.max.x),
                pick(2, self.min.y, self.max.y),
                pick(4, self.min.z, self.max.z),
            ))
        };
        Aabb::from_points((0..8).map(corner))
    }
}
