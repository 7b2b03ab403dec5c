//! Meshes and skins of the document.

use std::collections::BTreeMap;

use glam::Mat4;
use gltf_json as json;
use json::accessor::{ComponentType, Type};
use json::validation::Checked::Valid;

use super::binary::{Bounds, flat3};
use super::{Geometry, GlbBuilder, Influences, MaterialId, MeshId, NodeId, SkinId, id};

impl GlbBuilder {
    /// Adds a rigid mesh: one primitive for each geometry that is not empty. Indices are 16 bits wide where they fit.
    pub fn mesh(&mut self, name: &str, parts: &[(&Geometry, MaterialId)]) -> MeshId {
        self.push_mesh(name, parts.iter().map(|&(g, m)| (g, m, None)))
    }

    /// Adds a mesh that a skin deforms: one primitive for each geometry that is not empty; influences have one entry a vertex.
    pub fn skinned_mesh(&mut self, name: &str, parts: &[(&Geometry, MaterialId, Influences<'_>)]) -> MeshId {
        self.push_mesh(name, parts.iter().map(|&(g, m, i)| (g, m, Some(i))))
    }

    /// Adds a skin: joint nodes and the matrices that bring mesh space to each joint's space in the bind pose.
    pub fn skin(&mut self, name: &str, joints: &[NodeId], inverse_bind: &[Mat4]) -> SkinId {
        let columns: Vec<f32> = inverse_bind.iter().flat_map(|m| m.to_cols_array()).collect();
        let matrices = self.push_floats(&columns, Type::Mat4, Bounds::No, None);
        let skin = json::Skin {
            inverse_bind_matrices: Some(matrices),
            joints: joints.iter().map(|j| json::Index::new(j.0)).collect(),
            name: Some(name.into()),
            skeleton: None,
            extensions: None,
            extras: None,
        };
        SkinId(id(self.root.push(skin)))
    }

    fn push_mesh<'a>(
        &mut self,
        name: &str,
        parts: impl Iterator<Item = (&'a Geometry, MaterialId, Option<Influences<'a>>)>,
    ) -> MeshId {
        let target = Some(json::buffer::Target::ArrayBuffer);
        let mut primitives = Vec::new();
        for (geometry, material, influences) in parts {
            if geometry.triangles.is_empty() {
                continue;
            }
            let mut attributes = BTreeMap::new();
            let positions = self.push_floats(flat3(&geometry.positions), Type::Vec3, Bounds::Yes, target);
            attributes.insert(Valid(json::mesh::Semantic::Positions), positions);
            let normals = self.push_floats(flat3(&geometry.normals), Type::Vec3, Bounds::No, target);
            attributes.insert(Valid(json::mesh::Semantic::Normals), normals);
            let uvs: &[f32] = bytemuck::cast_slice(&geometry.uvs);
            let uvs = self.push_floats(uvs, Type::Vec2, Bounds::No, target);
            attributes.insert(Valid(json::mesh::Semantic::TexCoords(0)), uvs);
            if let Some(Influences { joints, weights }) = influences {
                let bytes: Vec<u8> = joints.iter().flatten().flat_map(|j| j.to_le_bytes()).collect();
                let view = self.push_view(&bytes, target);
                let joints = self.push_accessor(view, joints.len(), ComponentType::U16, Type::Vec4, None);
                attributes.insert(Valid(json::mesh::Semantic::Joints(0)), joints);
                let weights: Vec<f32> = weights.iter().flatten().copied().collect();
                let weights = self.push_floats(&weights, Type::Vec4, Bounds::No, target);
                attributes.insert(Valid(json::mesh::Semantic::Weights(0)), weights);
            }
            let indices = self.push_indices(geometry);
            primitives.push(json::mesh::Primitive {
                attributes,
                extensions: None,
                extras: None,
                indices: Some(indices),
                material: Some(json::Index::new(material.0)),
                mode: Valid(json::mesh::Mode::Triangles),
                targets: None,
            });
        }
        let mesh =
            json::Mesh { name: Some(name.into()), primitives, weights: None, extensions: None, extras: None };
        MeshId(id(self.root.push(mesh)))
    }

    fn push_indices(&mut self, geometry: &Geometry) -> json::Index<json::Accessor> {
        let flat = geometry.triangles.iter().flatten().copied();
        // 65535 itself is a primitive restart, which glTF forbids.
        let (bytes, component): (Vec<u8>, _) = if geometry.positions.len() < 65536 {
            (flat.flat_map(|i| (i as u16).to_le_bytes()).collect(), ComponentType::U16)
        } else {
            (flat.flat_map(|i| i.to_le_bytes()).collect(), ComponentType::U32)
        };
        let view = self.push_view(&bytes, Some(json::buffer::Target::ElementArrayBuffer));
        self.push_accessor(view, 3 * geometry.triangles.len(), component, Type::Scalar, None)
    }
}
