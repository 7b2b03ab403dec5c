//! Where the parts of a loaded scene stand in the glTF file they came from, for tools that write into that file.

/// From the indices of a [`crate::Scene`] to those of its glTF file. Meshes and materials have the file's indices (a material
/// beyond the file's is the default one); nodes are sorted, primitives joined and vertices picked, which is undone here.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Origins {
    /// For each of [`crate::Scene::nodes`] its index in the file.
    pub nodes: Vec<u32>,
    /// One for each of [`crate::Scene::meshes`].
    pub meshes: Vec<MeshOrigin>,
}

/// Where the parts of a mesh come from.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MeshOrigin {
    /// For each of [`crate::Mesh::parts`] the index of its primitive. Primitives without triangles have no part.
    pub primitives: Vec<u32>,
    /// For each vertex its element in the accessors of its part's primitive. Several vertices may have the same one,
    /// where the file has no normals.
    pub vertices: Vec<u32>,
}
