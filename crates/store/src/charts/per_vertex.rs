//! Texels for the vertices of a mesh that is finer than texels would be.

use glam::{DVec3, Vec3};

use super::set::{ChartUv, PageSize, TEXEL_FRACTION};
use super::surface::{NONE, Surface};

/// The pages of a mesh whose vertices have a texel each.
#[derive(Clone, Debug, Default)]
pub(super) struct VertexPages {
    pub(super) pages: Vec<PageSize>,
    pub(super) corners: Vec<[ChartUv; 3]>,
}

/// A vertex as one side of the surface sees it.
struct Slot {
    page: u32,
    index: u32,
    /// Normal of the first triangle that used it, or zero.
    normal: DVec3,
    /// The vertex's next slot, or [`NONE`].
    next: u32,
}

/// Gives every used vertex a texel, in the order of the triangles; two if triangles that face away from each other share
/// it. All corners of a triangle lie in one page. `None` if more than `limit` texels would be needed.
pub(super) fn vertex_pages(
    surface: &Surface,
    vertex_count: usize,
    triangles: &[[u32; 3]],
    max_side: u16,
    limit: u64,
) -> Option<VertexPages> {
    let page_capacity = u32::from(max_side) * u32::from(max_side);
    let mut slots: Vec<Slot> = Vec::new();
    let mut newest = vec![NONE; vertex_count];
    let mut counts = vec![0u32];
    let mut chosen = Vec::with_capacity(triangles.len());
    for (t, triangle) in triangles.iter().enumerate() {
        if page_capacity - counts[counts.len() - 1] < 3 {
            counts.push(0);
        }
        let page = counts.len() as u32 - 1;
        let normal = surface.normals[t];
        chosen.push(triangle.map(|vertex| {
            let head = newest[vertex as usize];
            let mut at = head;
            // Slots of earlier pages lie behind those of this one. Few directions face away from each other, so the
            // chain is short.
            while at != NONE && slots[at as usize].page == page {
                if slots[at as usize].normal.dot(normal) >= 0.0 {
                    return at;
                }
                at = slots[at as usize].next;
            }
            let index = counts[page as usize];
            counts[page as usize] += 1;
            slots.push(Slot { page, index, normal, next: head });
            newest[vertex as usize] = slots.len() as u32 - 1;
            slots.len() as u32 - 1
        }));
        if slots.len() as u64 > limit {
            return None;
        }
    }
    let pages: Vec<PageSize> = counts
        .iter()
        .filter(|&&count| count > 0)
        .map(|&count| {
            let width = f64::from(count).sqrt().ceil() as u32;
            PageSize { width: width as u16, height: count.div_ceil(width) as u16 }
        })
        .collect();
    let uv = |slot: u32| {
        let slot = &slots[slot as usize];
        let width = u32::from(pages[slot.page as usize].width);
        let centre = |i: u32| i as u16 * TEXEL_FRACTION + TEXEL_FRACTION / 2;
        ChartUv { page: slot.page as u16, x: centre(slot.index % width), y: centre(slot.index / width) }
    };
    let corners = chosen.iter().map(|t| t.map(uv)).collect();
    Some(VertexPages { pages, corners })
}

/// Sums the area vectors of the triangles about each texel: (texel, vertex's place, sum), ascending by texel.
pub(super) fn vertex_sites(
    positions: &[Vec3],
    triangles: &[[u32; 3]],
    texel_count: usize,
    texels: impl Iterator<Item = [u32; 3]>,
) -> Vec<(u32, Vec3, DVec3)> {
    let mut vertex_of = vec![NONE; texel_count];
    let mut sums = vec![DVec3::ZERO; texel_count];
    for (triangle, texels) in triangles.iter().zip(texels) {
        let [a, b, c] = triangle.map(|v| positions[v as usize].as_dvec3());
        let area_vector = (b - a).cross(c - a);
        for k in 0..3 {
            vertex_of[texels[k] as usize] = triangle[k];
            if area_vector.is_finite() {
                sums[texels[k] as usize] += area_vector;
            }
        }
    }
    let used = (0..texel_count).filter(|&t| vertex_of[t] != NONE);
    used.map(|t| (t as u32, positions[vertex_of[t] as usize], sums[t])).collect()
}
