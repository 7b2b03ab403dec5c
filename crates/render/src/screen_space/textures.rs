//! Textures of the passes.

use dapple_gpu::{Gpu, wgpu};

use super::plan::Image;
use crate::forward::HIDDEN_SAMPLES;

/// Distances of hidden surfaces, four a texel. Where there are none it has two layers: WebGL2 takes one for a plain texture.
pub(super) fn hidden_texture(gpu: &Gpu, (width, height): (u32, u32), layers: u32) -> wgpu::Texture {
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("hidden"),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: if layers == 0 { 2 } else { layers } },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: Image::Hidden(0).format(),
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT
            | wgpu::TextureUsages::TEXTURE_BINDING
            | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    })
}

pub(super) fn array_view(texture: &wgpu::Texture) -> wgpu::TextureView {
    texture.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(wgpu::TextureViewDimension::D2Array),
        ..Default::default()
    })
}

/// Depths in four samples a pixel.
pub(super) fn map_view(gpu: &Gpu, (width, height): (u32, u32)) -> wgpu::TextureView {
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("stochastic map"),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: HIDDEN_SAMPLES,
        dimension: wgpu::TextureDimension::D2,
        format: Image::Map(0).format(),
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    });
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}

/// Whether the device can make a stochastic map.
pub(super) fn can_draw_maps(gpu: &Gpu) -> bool {
    let features = |format| gpu.adapter.get_texture_format_features(format);
    let depths = features(Image::Map(0).format());
    let distances = features(Image::Hidden(0).format());
    let flags = gpu.adapter.get_downlevel_capabilities().flags;
    // WebGL2 claims to and cannot.
    let is_webgl = cfg!(target_arch = "wasm32") && gpu.adapter.get_info().backend == wgpu::Backend::Gl;
    !is_webgl
        && flags.contains(wgpu::DownlevelFlags::MULTISAMPLED_SHADING)
        && depths.flags.sample_count_supported(HIDDEN_SAMPLES)
        && depths.allowed_usages.contains(wgpu::TextureUsages::TEXTURE_BINDING)
        && distances.allowed_usages.contains(wgpu::TextureUsages::RENDER_ATTACHMENT)
}

pub(super) fn texture(
    gpu: &Gpu,
    format: wgpu::TextureFormat,
    (width, height): (u32, u32),
    mip_level_count: u32,
) -> wgpu::Texture {
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("screen"),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT
            | wgpu::TextureUsages::TEXTURE_BINDING
            | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    })
}
