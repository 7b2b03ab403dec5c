//! Vertices and indices of meshes on the card.

use dapple_gpu::{Gpu, wgpu};
use dapple_scene::{Mesh, Part};
use dapple_store::charts::ChartVertices;

use super::super::layouts;
use super::super::uniforms::{InstanceRaw, NO_PAGE};

/// Vertices of a mesh as all passes read them.
#[derive(Debug)]
pub(crate) struct GpuMesh {
    /// Positions and normals.
    pub(crate) geometry: wgpu::Buffer,
    /// Places in charts, and the number of the vertex in the mesh.
    pub(crate) charts: wgpu::Buffer,
    /// Tangents, texture coordinates, colours; only where the mesh has any of them.
    pub(crate) detail: Option<wgpu::Buffer>,
    pub(crate) indices: wgpu::Buffer,
    pub(crate) parts: Vec<Part>,
}

/// Bytes of a vertex in each of the buffers.
const GEOMETRY_STRIDE: usize = 20;
const CHARTS_STRIDE: usize = 12;
const DETAIL_STRIDE: usize = 32;

/// Slots of vertex buffers.
pub(crate) const GEOMETRY_SLOT: u32 = 0;
pub(crate) const CHARTS_SLOT: u32 = 1;
pub(crate) const INSTANCE_SLOT: u32 = 2;
pub(crate) const DETAIL_SLOT: u32 = 3;

const GEOMETRY: [wgpu::VertexAttribute; 2] = wgpu::vertex_attr_array![0 => Float32x3, 1 => Snorm16x4];
const CHARTS: [wgpu::VertexAttribute; 2] = wgpu::vertex_attr_array![2 => Uint16x4, 3 => Uint32];
const INSTANCE: [wgpu::VertexAttribute; 7] = wgpu::vertex_attr_array![
    4 => Float32x4, 5 => Float32x4, 6 => Float32x4, 7 => Float32x4, 8 => Float32x4, 9 => Float32x4, 10 => Uint32x4];
const DETAIL: [wgpu::VertexAttribute; 3] =
    wgpu::vertex_attr_array![11 => Snorm16x4, 12 => Float32x4, 13 => Unorm16x4];

/// The vertex buffers of a pipeline, in the order of their slots.
pub(crate) fn vertex_layouts(detailed: bool) -> Vec<Option<wgpu::VertexBufferLayout<'static>>> {
    let layout = |stride: usize, step_mode, attributes| {
        Some(wgpu::VertexBufferLayout { array_stride: stride as u64, step_mode, attributes })
    };
    let mut layouts = vec![
        layout(GEOMETRY_STRIDE, wgpu::VertexStepMode::Vertex, &GEOMETRY[..]),
        layout(CHARTS_STRIDE, wgpu::VertexStepMode::Vertex, &CHARTS),
        layout(size_of::<InstanceRaw>(), wgpu::VertexStepMode::Instance, &INSTANCE),
    ];
    if detailed {
        layouts.push(layout(DETAIL_STRIDE, wgpu::VertexStepMode::Vertex, &DETAIL));
    }
    layouts
}

impl GpuMesh {
    /// Uploads a mesh, split as `split` says (and not at all without one).
    pub(super) fn upload(gpu: &Gpu, mesh: &Mesh, split: Option<&ChartVertices>) -> GpuMesh {
        let sources: Vec<u32> = match split {
            Some(split) => split.source.clone(),
            None => (0..mesh.positions.len() as u32).collect(),
        };
        let triangles = split.map_or(&mesh.triangles, |split| &split.triangles);
        let mut geometry = Vec::with_capacity(sources.len() * GEOMETRY_STRIDE);
        for &v in &sources {
            let v = v as usize;
            geometry.extend_from_slice(bytemuck::bytes_of(&mesh.positions[v].to_array()));
            geometry.extend_from_slice(bytemuck::bytes_of(&snorm16(mesh.normals[v].extend(0.0))));
        }
        let buffer =
            |label, bytes: &[u8]| layouts::buffer(&gpu.device, label, bytes, wgpu::BufferUsages::VERTEX);
        let has_detail = !mesh.tangents.is_empty()
            || !mesh.colors.is_empty()
            || mesh.uvs.iter().any(|uvs| !uvs.is_empty());
        let indices = bytemuck::cast_slice(triangles.as_slice());
        GpuMesh {
            geometry: buffer("geometry", &geometry),
            charts: buffer("charts", &chart_bytes(&sources, split)),
            detail: has_detail.then(|| buffer("detail", &detail_bytes(mesh, &sources))),
            indices: layouts::buffer(&gpu.device, "indices", indices, wgpu::BufferUsages::INDEX),
            parts: mesh.parts.clone(),
        }
    }

    /// Bytes on the card.
    pub(crate) fn bytes(&self) -> u64 {
        self.geometry.size()
            + self.charts.size()
            + self.indices.size()
            + self.detail.as_ref().map_or(0, wgpu::Buffer::size)
    }
}

fn detail_bytes(mesh: &Mesh, sources: &[u32]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(sources.len() * DETAIL_STRIDE);
    for &v in sources {
        let v = v as usize;
        let uv = |set: usize| mesh.uvs[set].get(v).copied().unwrap_or_default();
        let tangent = mesh.tangents.get(v).copied().unwrap_or_default();
        let color = mesh.colors.get(v).copied().unwrap_or(glam::Vec4::ONE);
        bytes.extend_from_slice(bytemuck::bytes_of(&snorm16(tangent)));
        bytes.extend_from_slice(bytemuck::bytes_of(&[uv(0).x, uv(0).y, uv(1).x, uv(1).y]));
        let unorm = color.to_array().map(|c| (c.clamp(0.0, 1.0) * 65535.0 + 0.5) as u16);
        bytes.extend_from_slice(bytemuck::bytes_of(&unorm));
    }
    bytes
}

fn chart_bytes(sources: &[u32], split: Option<&ChartVertices>) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(sources.len() * CHARTS_STRIDE);
    let numbers = split.map(chart_numbers).unwrap_or_default();
    for (i, &source) in sources.iter().enumerate() {
        let place = match split.and_then(|split| split.uv.get(i)) {
            Some(uv) => [uv.page, uv.x, uv.y, numbers[i] as u16],
            None => [NO_PAGE, 0, 0, 0],
        };
        bytes.extend_from_slice(bytemuck::bytes_of(&place));
        bytes.extend_from_slice(bytemuck::bytes_of(&source));
    }
    bytes
}

/// A number for each chart, at each of its vertices: charts are what triangles connect.
fn chart_numbers(split: &ChartVertices) -> Vec<u32> {
    let mut parent: Vec<u32> = (0..split.source.len() as u32).collect();
    fn root(parent: &mut [u32], mut v: u32) -> u32 {
        while parent[v as usize] != v {
            parent[v as usize] = parent[parent[v as usize] as usize];
            v = parent[v as usize];
        }
        v
    }
    for &[a, b, c] in &split.triangles {
        for other in [b, c] {
            let (one, two) = (root(&mut parent, a), root(&mut parent, other));
            let (low, high) = (one.min(two), one.max(two));
            parent[high as usize] = low;
        }
    }
    (0..parent.len() as u32).map(|v| root(&mut parent, v)).collect()
}

fn snorm16(v: glam::Vec4) -> [i16; 4] {
    v.to_array().map(|c| (c.clamp(-1.0, 1.0) * 32767.0).round() as i16)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn charts_are_numbered_by_what_triangles_connect() {
        let split = ChartVertices {
            source: vec![0, 1, 2, 3, 1, 2, 4],
            uv: vec![Default::default(); 7],
            triangles: vec![[0, 1, 2], [2, 1, 3], [4, 5, 6]],
        };
        assert_eq!(chart_numbers(&split), [0, 0, 0, 0, 4, 4, 4]);
    }
}
