//! Where the pages of every instance lie in the atlas.

use std::ops::Range;

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
    /// Rows that hold something else than the card does.
    dirty: Range<u32>,
}

impl PageTable {
    pub(super) fn new(gpu: &Gpu, instances: usize) -> PageTable {
        let (texture, view) = make(gpu, 1);
        PageTable { texture, view, entries: Vec::new(), ranges: vec![(0, 0); instances], dirty: 0..0 }
    }

    /// First entry of an instance.
    pub(crate) fn first(&self, instance: usize) -> u32 {
        self.ranges[instance].0
    }

    /// Places the pages of an instance (those without a place are shown open). Returns whether the texture is
    /// another one now. What it holds is written by [`PageTable::write`].
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
            self.dirty = 0..rows;
        } else if count > 0 {
            let (start, end) = (first / PAGE_TABLE_WIDTH, (first + count).div_ceil(PAGE_TABLE_WIDTH));
            let is_clean = self.dirty.is_empty();
            self.dirty.start = if is_clean { start } else { self.dirty.start.min(start) };
            self.dirty.end = if is_clean { end } else { self.dirty.end.max(end) };
        }
        grows
    }

    /// Brings onto the card what was set since the last call: many instances at once.
    pub(super) fn write(&mut self, gpu: &Gpu) {
        let rows = std::mem::take(&mut self.dirty);
        if rows.is_empty() {
            return;
        }
        let width = PAGE_TABLE_WIDTH as usize;
        let len = self.entries.len();
        // Rows are written whole.
        self.entries.resize(len.max(rows.end as usize * width), [0; 4]);
        gpu.queue.write_texture(
            wgpu::TexelCopyTextureInfo {
                origin: wgpu::Origin3d { x: 0, y: rows.start, z: 0 },
                ..self.texture.as_image_copy()
            },
            bytemuck::cast_slice(&self.entries[rows.start as usize * width..rows.end as usize * width]),
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(8 * PAGE_TABLE_WIDTH),
                rows_per_image: None,
            },
            wgpu::Extent3d {
                width: PAGE_TABLE_WIDTH,
                height: rows.end - rows.start,
                depth_or_array_layers: 1,
            },
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
