//! Tables of 16-byte texels: what a look-up reads, in Rust as a slice and in a fragment shader as textures.

use dapple_store::cells::{GridTooLarge, VirtualGrid};
use dapple_store::points::{PointLayout, PointSet};
use glam::Vec3;

/// Texels in a row of a table's texture: the least that WebGL2 promises. WGSL carries the same number.
pub const TABLE_WIDTH: usize = 2048;

/// Why no table could be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TableError {
    /// The cells of an instance cannot be numbered in 32 bits.
    #[error(
        "look-up: instance {instance} spans {cells:.0} cells of {edge_m} m, at most {} can be numbered; \
         lay fewer points (a wider spacing) or split the mesh",
        u32::MAX
    )]
    GridTooLarge {
        /// Index into the scene's instances.
        instance: u32,
        /// How many cells its box holds.
        cells: f64,
        /// Edge of a cell.
        edge_m: f32,
    },
    /// The values do not belong to the layout.
    #[error("look-up: {values} values for {points} points")]
    WrongCount {
        /// Values given.
        values: usize,
        /// Points of the layout.
        points: usize,
    },
    /// A texture would have more rows than the device allows.
    #[error("look-up: a table of {rows} rows of 2048 texels, the device allows {limit}; lay fewer points")]
    TextureTooLarge {
        /// Rows it would have.
        rows: u32,
        /// Rows a texture may have.
        limit: u32,
    },
}

/// 16-byte texels, and which of their rows changed since they were last uploaded.
#[derive(Clone, Debug, Default)]
pub(super) struct Texels {
    data: Vec<[u32; 4]>,
    /// First changed row, and the one after the last.
    dirty: Option<(usize, usize)>,
}

impl Texels {
    pub(super) fn new(data: Vec<[u32; 4]>) -> Texels {
        let rows = data.len().div_ceil(TABLE_WIDTH);
        Texels { data, dirty: (rows > 0).then_some((0, rows)) }
    }

    /// A texel; zeros beyond the end, as a shader reads.
    pub(super) fn get(&self, index: usize) -> [u32; 4] {
        self.data.get(index).copied().unwrap_or_default()
    }

    /// For changing; marks the texel's row.
    pub(super) fn get_mut(&mut self, index: usize) -> &mut [u32; 4] {
        let row = index / TABLE_WIDTH;
        let (first, end) = self.dirty.unwrap_or((row, row + 1));
        self.dirty = Some((first.min(row), end.max(row + 1)));
        &mut self.data[index]
    }

    pub(super) fn bytes(&self) -> u64 {
        size_of_val(self.data.as_slice()) as u64
    }
}

/// The three tables that both look-ups are made of.
///
/// Grids: texel 0 holds the kernel's four parameters, texel 1 the number of instances, then two an instance:
/// (origin, first slot) and (cells along each axis, number of slots).
#[derive(Clone, Debug, Default)]
pub(super) struct Tables {
    pub(super) grids: Texels,
    pub(super) slots: Texels,
    pub(super) points: Texels,
}

impl Tables {
    pub(super) fn bytes(&self) -> u64 {
        self.grids.bytes() + self.slots.bytes() + self.points.bytes()
    }
}

/// Around a set's points, with cells of `edge_m`; without slots yet.
pub(super) fn grid_around(
    set: &PointSet,
    layout: &PointLayout,
    edge_m: f32,
) -> Result<VirtualGrid, TableError> {
    let grid = VirtualGrid { origin: set.origin_rest, ..VirtualGrid::default() };
    // The origin is the least corner of the layout's integers, so nothing lies below it.
    let most = (0..set.len())
        .map(|i| grid.position_cells(set.position_rest(i, layout.quantum_m()), edge_m))
        .fold(Vec3::ZERO, Vec3::max);
    VirtualGrid::spanning(set.origin_rest, most).map_err(|GridTooLarge { cells }| TableError::GridTooLarge {
        instance: set.instance,
        cells,
        edge_m,
    })
}

fn grid_words(grid: &VirtualGrid) -> [[u32; 4]; 2] {
    let [x, y, z] = grid.origin.to_array().map(f32::to_bits);
    let [a, b, c] = grid.dims;
    [[x, y, z, grid.first], [a, b, c, grid.count]]
}

/// The table of grids: one an instance up to the last that has points; those without have no slots.
pub(super) fn grid_texels(params: [f32; 4], grids: &[VirtualGrid]) -> Vec<[u32; 4]> {
    let mut texels = vec![params.map(f32::to_bits), [grids.len() as u32, 0, 0, 0]];
    texels.extend(grids.iter().flat_map(grid_words));
    texels
}

/// One entry an instance, up to the last with points.
pub(super) fn empty_grids(layout: &PointLayout) -> Vec<VirtualGrid> {
    let instances = layout.sets().last().map_or(0, |set| set.instance as usize + 1);
    vec![VirtualGrid::default(); instances]
}

pub(super) fn check_count(layout: &PointLayout, visibility: &[u8]) -> Result<(), TableError> {
    if visibility.len() != layout.len() {
        return Err(TableError::WrongCount { values: visibility.len(), points: layout.len() });
    }
    Ok(())
}

#[cfg(feature = "gpu")]
pub use gpu::TableTextures;

#[cfg(feature = "gpu")]
mod gpu {
    use dapple_gpu::wgpu;

    use super::{TABLE_WIDTH, TableError, Tables, Texels};

    /// The three tables of a look-up on a graphics card, as textures: no storage buffer is needed.
    #[derive(Debug)]
    pub struct TableTextures {
        textures: [wgpu::Texture; 3],
        views: [wgpu::TextureView; 3],
    }

    impl TableTextures {
        pub(in crate::psao) fn new(
            device: &wgpu::Device,
            tables: &Tables,
        ) -> Result<TableTextures, TableError> {
            let limit = device.limits().max_texture_dimension_2d;
            let make = |texels: &Texels, label| {
                let rows = texels.data.len().div_ceil(TABLE_WIDTH).max(1) as u32;
                if rows > limit {
                    return Err(TableError::TextureTooLarge { rows, limit });
                }
                Ok(device.create_texture(&wgpu::TextureDescriptor {
                    label: Some(label),
                    size: wgpu::Extent3d {
                        width: TABLE_WIDTH as u32,
                        height: rows,
                        depth_or_array_layers: 1,
                    },
                    mip_level_count: 1,
                    sample_count: 1,
                    dimension: wgpu::TextureDimension::D2,
                    format: wgpu::TextureFormat::Rgba32Uint,
                    usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
                    view_formats: &[],
                }))
            };
            let textures = [
                make(&tables.grids, "look-up: grids")?,
                make(&tables.slots, "look-up: slots")?,
                make(&tables.points, "look-up: points")?,
            ];
            let views = textures.each_ref().map(|t| t.create_view(&wgpu::TextureViewDescriptor::default()));
            Ok(TableTextures { textures, views })
        }

        /// Writes the rows that changed since the last call.
        pub(in crate::psao) fn upload(&self, queue: &wgpu::Queue, tables: &mut Tables) {
            let [grids, slots, points] = &self.textures;
            for (texture, texels) in
                [(grids, &mut tables.grids), (slots, &mut tables.slots), (points, &mut tables.points)]
            {
                upload(queue, texture, texels);
            }
        }

        /// The views of grids, slots and points, in the order of the shader's bindings.
        pub fn views(&self) -> [&wgpu::TextureView; 3] {
            self.views.each_ref()
        }

        /// How the three are bound, at `first_binding` and the two after it.
        pub fn layout_entries(first_binding: u32) -> [wgpu::BindGroupLayoutEntry; 3] {
            std::array::from_fn(|i| wgpu::BindGroupLayoutEntry {
                binding: first_binding + i as u32,
                visibility: wgpu::ShaderStages::FRAGMENT,
                ty: wgpu::BindingType::Texture {
                    sample_type: wgpu::TextureSampleType::Uint,
                    view_dimension: wgpu::TextureViewDimension::D2,
                    multisampled: false,
                },
                count: None,
            })
        }
    }

    fn upload(queue: &wgpu::Queue, texture: &wgpu::Texture, texels: &mut Texels) {
        let Some((first, end)) = texels.dirty.take() else { return };
        let full = texels.data.len() / TABLE_WIDTH;
        let last_width = texels.data.len() % TABLE_WIDTH;
        let write = |rows: std::ops::Range<usize>, width: usize| {
            if rows.is_empty() || width == 0 {
                return;
            }
            let start = rows.start * TABLE_WIDTH;
            let data = &texels.data[start..start + (rows.len() - 1) * TABLE_WIDTH + width];
            queue.write_texture(
                wgpu::TexelCopyTextureInfo {
                    texture,
                    mip_level: 0,
                    origin: wgpu::Origin3d { x: 0, y: rows.start as u32, z: 0 },
                    aspect: wgpu::TextureAspect::All,
                },
                bytemuck::cast_slice(data),
                wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(TABLE_WIDTH as u32 * 16),
                    rows_per_image: None,
                },
                wgpu::Extent3d { width: width as u32, height: rows.len() as u32, depth_or_array_layers: 1 },
            );
        };
        write(first..end.min(full), TABLE_WIDTH);
        // The last row may be shorter than the texture.
        if end > full {
            write(full..full + 1, last_width);
        }
    }
}
