//! Tables of floats that shaders read as textures, four floats a texel.

use dapple_gpu::{Gpu, wgpu};

/// A table of so many texels a row and so many rows, each at least 1; zero until it is written.
pub(super) fn float_table(gpu: &Gpu, label: &str, width: u32, height: u32) -> wgpu::Texture {
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some(label),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba32Float,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    })
}

/// Writes whole rows, from one on.
pub(super) fn write_rows(gpu: &Gpu, table: &wgpu::Texture, first_row: u32, texels: &[[f32; 4]]) {
    let width = table.width();
    debug_assert!(texels.len().is_multiple_of(width as usize), "whole rows");
    gpu.queue.write_texture(
        wgpu::TexelCopyTextureInfo {
            origin: wgpu::Origin3d { x: 0, y: first_row, z: 0 },
            ..table.as_image_copy()
        },
        bytemuck::cast_slice(texels),
        wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(size_of::<[f32; 4]>() as u32 * width),
            rows_per_image: None,
        },
        wgpu::Extent3d { width, height: texels.len() as u32 / width, depth_or_array_layers: 1 },
    );
}
