//! What is shown, as a picture in memory.

use anyhow::{Context, Result, bail};
use dapple_gpu::{Gpu, read_texture, wgpu};

use super::show::Show;

/// Draws the present at a size and reads it back, as sRGB.
pub(super) fn take(
    gpu: &Gpu,
    show: &mut Show,
    (width, height): (u32, u32),
    now_s: f64,
) -> Result<Vec<[u8; 3]>> {
    let most = gpu.device.limits().max_texture_dimension_2d;
    if width == 0 || height == 0 || width > most || height > most {
        bail!("a picture of {width}x{height} cannot be drawn here: 1 to {most} pixels a side can");
    }
    let format = show.format();
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("picture"),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    });
    let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
    show.draw(gpu, &view, (width, height), now_s)?;
    let bytes =
        pollster::block_on(read_texture(gpu, &texture, 0)).context("the picture cannot be read back")?;
    let blue_first = matches!(format, wgpu::TextureFormat::Bgra8Unorm);
    let (texels, _) = bytes.as_chunks::<4>();
    Ok(texels.iter().map(|&[a, b, c, _]| if blue_first { [c, b, a] } else { [a, b, c] }).collect())
}
