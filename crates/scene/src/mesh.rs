//! Triangle meshes in their own (mesh) space.

use glam::{Vec2, Vec3, Vec4};

/// A triangle mesh: all primitives of one glTF mesh (or one OBJ object), joined.
///
/// Every per-vertex list is either empty or as long as `positions`, except `positions` and `normals`,
/// which are always full. The loader guarantees: indices in range, all numbers finite, normals of unit
/// length, `parts` consecutive and covering all triangles.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Name in the file, or a made-up one (`mesh 3`).
    pub name: String,
    /// Vertex positions in mesh space.
    pub positions: Vec<Vec3>,
    /// Unit vertex normals in mesh space (computed by the loader where the file has none).
    pub normals: Vec<Vec3>,
    /// Tangent and bitangent sign (w = ±1), or empty.
    pub tangents: Vec<Vec4>,
    /// Texture coordinate sets 0 and 1, each empty or full.
    pub uvs: [Vec<Vec2>; 2],
    /// Linear vertex colours, or empty.
    pub colors: Vec<Vec4>,
    /// Sets of four joint influences a vertex; empty for a mesh that is not skinned. Weights over all sets sum to 1.
    pub influences: Vec<SkinInfluences>,
    /// Morph targets; displacement lists are empty or full.
    pub morph_targets: Vec<MorphTarget>,
    /// Default morph weights, one a target.
    pub morph_weights: Vec<f32>,
    /// Vertex indices of each triangle, counter-clockwise seen from the front.
    pub triangles: Vec<[u32; 3]>,
    /// Consecutive ranges of `triangles` with one material each.
    pub parts: Vec<Part>,
}

/// A range of triangles that share one material.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// Index of the first triangle.
    pub first_triangle: u32,
    /// Number of triangles.
    pub triangle_count: u32,
    /// Index into [`crate::Scene::materials`].
    pub material: u32,
}

/// One set of four joint influences a vertex (glTF's `JOINTS_n`, `WEIGHTS_n`).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SkinInfluences {
    /// Indices into [`crate::Skin::joints`].
    pub joints: Vec<[u16; 4]>,
    /// Weights, each ≥ 0.
    pub weights: Vec<[f32; 4]>,
}

/// Displacements of one morph target.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MorphTarget {
    /// Added to positions, empty or full.
    pub positions: Vec<Vec3>,
    /// Added to normals, empty or full.
    pub normals: Vec<Vec3>,
}

impl Mesh {
    /// Whether the vertices move against each other (skin or morph targets).
    pub fn is_deformable(&self) -> bool {
        !self.influences.is_empty() || !self.morph_targets.is_empty()
    }

    /// The material of each triangle, in triangle order.
    pub fn triangle_materials(&self) -> Vec<u32> {
        let mut materials = Vec::with_capacity(self.triangles.len());
        for part in &self.parts {
            materials.extend(std::iter::repeat_n(part.material, part.triangle_count as usize));
        }
        materials
    }
}
