//! Where the pages of every instance lie in the atlas.

use dapple_gpu::{Gpu, wgpu};
use dapple_store::charts::Placement;

use super::super::uniforms::PAGE_TABLE_WIDTH;

/// The page table of `vertex.wgsl`.
#[derive(Debug)]
pub(crate) struct PageTable {
    texture: wgpu::Texture,
    pub(crate) view: wgpu::TextureView,
    /// Layer, x, y, whether there is a place.
    entries: Vec<[u16; 4]>,
    /// First entry and number of entries of each instance.
    ranges: Vec<(u32, u32)>,
}

impl PageTable {
    pub(super) fn new(gpu: &Gpu, instances: usize) -> PageTable {
        let (texture, view) = make(gpu, 1);
        PageTable { texture, view, entries: Vec::new(), ranges: vec![(0, 0); instances] }
    }

    /// First entry of an instance.
    pub(crate) fn first(&self, instance: usize) -> u32 {
        self.ranges[instance].0
    }

    /// Places the pages of an instance (those without a place are shown open). Returns whether the texture is
    /// another one now.
    pub(super) fn set(&mut self, gpu: &Gpu, instance: usize, places: &[Placement]) -> bool {
        if self.ranges[instance].1 < places.len() as u32 {
            // Pages of an instance seldom change in number: what it had is left behind.
            self.ranges[instance] = (self.entries.len() as u32, places.len() as u32);
            self.entries.resize(self.entries.len() + places.len(), [0; 4]);
        }
        let (first, count) = self.ranges[instance];
        for i in 0..count {
            let place = places.get(i as usize);
            self.entries[(first + i) as usize] = place.map_or([0; 4], |p| [p.layer, p.x, p.y, 1]);
        }
        let rows = (self.entries.len() as u32).div_ceil(PAGE_TABLE_WIDTH).max(1);
        let grows = rows > self.texture.height();
        if grows {
            (self.texture, self.view) = make(gpu, rows * 2);
        }
        self.write(gpu, rows);
        grows
    }

    fn write(&mut self, gpu: &Gpu, rows: u32) {
        let len = self.entries.len();
        self.entries.resize(rows as usize * PAGE_TABLE_WIDTH as usize, [0; 4]);
        gpu.queue.write_texture(
            self.texture.as_image_copy(),
            bytemuck::cast_slice(&self.entries),
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(8 * PAGE_TABLE_WIDTH),
                rows_per_image: None,
            },
            wgpu::Extent3d { width: PAGE_TABLE_WIDTH, height: rows, depth_or_array_layers: 1 },
        );
        self.entries.truncate(len);
    }
}

fn make(gpu: &Gpu, rows: u32) -> (wgpu::Texture, wgpu::TextureView) {
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("page table"),
        size: wgpu::Extent3d { width: PAGE_TABLE_WIDTH, height: rows, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba16Uint,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
    (texture, view)
}
