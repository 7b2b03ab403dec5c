//! Tables that shaders read as textures, four floats or four words a texel.

use bytemuck::Pod;
use dapple_gpu::{Gpu, wgpu};

/// A table of floats, of so many texels a row and so many rows, each at least 1; zero until it is written.
pub(crate) fn float_table(gpu: &Gpu, label: &str, width: u32, height: u32) -> wgpu::Texture {
    table(gpu, label, wgpu::TextureFormat::Rgba32Float, (width, height, 1))
}

/// A table of unsigned words, in layers.
pub(crate) fn word_table(gpu: &Gpu, label: &str, size: (u32, u32, u32)) -> wgpu::Texture {
    table(gpu, label, wgpu::TextureFormat::Rgba32Uint, size)
}

fn table(
    gpu: &Gpu,
    label: &str,
    format: wgpu::TextureFormat,
    (width, height, depth_or_array_layers): (u32, u32, u32),
) -> wgpu::Texture {
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some(label),
        size: wgpu::Extent3d { width, height, depth_or_array_layers },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    })
}

/// Writes whole rows of the first layer, from one on.
pub(crate) fn write_rows<T: Pod>(gpu: &Gpu, table: &wgpu::Texture, first_row: u32, texels: &[[T; 4]]) {
    write_layer(gpu, table, 0, first_row, texels);
}

/// Writes whole rows of a layer, from one on.
pub(crate) fn write_layer<T: Pod>(
    gpu: &Gpu,
    table: &wgpu::Texture,
    layer: u32,
    first_row: u32,
    texels: &[[T; 4]],
) {
    let width = table.width();
    debug_assert!(texels.len().is_multiple_of(width as usize), "whole rows");
    gpu.queue.write_texture(
        wgpu::TexelCopyTextureInfo {
            origin: wgpu::Origin3d { x: 0, y: first_row, z: layer },
            ..table.as_image_copy()
        },
        bytemuck::cast_slice(texels),
        wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(size_of::<[T; 4]>() as u32 * width),
            rows_per_image: None,
        },
        wgpu::Extent3d { width, height: texels.len() as u32 / width, depth_or_array_layers: 1 },
    );
}
