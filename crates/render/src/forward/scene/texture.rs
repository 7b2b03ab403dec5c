//! Images and samplers on the card.

use dapple_gpu::{Gpu, wgpu};
use dapple_scene::{Filter, Image, Texture, Wrap};

use crate::image::srgb8_from_linear;
use crate::texture::linear_from_srgb;

/// How the bytes of an image are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Encoding {
    Srgb,
    Linear,
}

/// Uploads an image, halved until it fits the device; with `mips` all its smaller levels too.
pub(super) fn upload(gpu: &Gpu, image: &Image, encoding: Encoding, mips: bool) -> wgpu::TextureView {
    let largest = gpu.device.limits().max_texture_dimension_2d;
    let mut levels = vec![Level { width: image.width, height: image.height, rgba8: image.rgba8.clone() }];
    while levels[0].width > largest || levels[0].height > largest {
        levels[0] = levels[0].halved(encoding);
    }
    while mips && levels[levels.len() - 1].width.max(levels[levels.len() - 1].height) > 1 {
        levels.push(levels[levels.len() - 1].halved(encoding));
    }
    let size = wgpu::Extent3d { width: levels[0].width, height: levels[0].height, depth_or_array_layers: 1 };
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some(&image.name),
        size,
        mip_level_count: levels.len() as u32,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: match encoding {
            Encoding::Srgb => wgpu::TextureFormat::Rgba8UnormSrgb,
            Encoding::Linear => wgpu::TextureFormat::Rgba8Unorm,
        },
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    for (level, mip_level) in levels.iter().zip(0..) {
        gpu.queue.write_texture(
            wgpu::TexelCopyTextureInfo { mip_level, ..texture.as_image_copy() },
            bytemuck::cast_slice(&level.rgba8),
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(4 * level.width),
                rows_per_image: None,
            },
            wgpu::Extent3d { width: level.width, height: level.height, depth_or_array_layers: 1 },
        );
    }
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}

/// One white texel.
pub(super) fn white() -> Image {
    Image { name: "white".into(), width: 1, height: 1, rgba8: vec![[255; 4]] }
}

/// One level of a mip chain.
struct Level {
    width: u32,
    height: u32,
    rgba8: Vec<[u8; 4]>,
}

impl Level {
    /// Each texel the mean, in linear light, of the texels that it covers.
    fn halved(&self, encoding: Encoding) -> Level {
        let (width, height) = ((self.width / 2).max(1), (self.height / 2).max(1));
        let decode: Vec<f32> =
            (0..256).map(|code| linear_from_srgb(f64::from(code) / 255.0) as f32).collect();
        let texel = |x: u32, y: u32| {
            let (x, y) = (x.min(self.width - 1), y.min(self.height - 1));
            self.rgba8[y as usize * self.width as usize + x as usize]
        };
        let mut rgba8 = Vec::with_capacity(width as usize * height as usize);
        for y in 0..height {
            for x in 0..width {
                let four = [
                    texel(2 * x, 2 * y),
                    texel(2 * x + 1, 2 * y),
                    texel(2 * x, 2 * y + 1),
                    texel(2 * x + 1, 2 * y + 1),
                ];
                rgba8.push(std::array::from_fn(|c| {
                    if c < 3 && encoding == Encoding::Srgb {
                        let sum: f32 = four.iter().map(|t| decode[usize::from(t[c])]).sum();
                        srgb8_from_linear(sum / 4.0)
                    } else {
                        let sum: u32 = four.iter().map(|t| u32::from(t[c])).sum();
                        ((sum + 2) / 4) as u8
                    }
                }));
            }
        }
        Level { width, height, rgba8 }
    }
}

/// How many times as long as wide a pixel's print on a texture may be before its smaller levels blur it along too: floors
/// and walls that run away from the viewer keep their joints.
const ANISOTROPY: u16 = 8;

/// The sampler that a texture asks for.
pub(super) fn sampler(gpu: &Gpu, texture: &Texture, mips: bool) -> wgpu::Sampler {
    let address = |wrap| match wrap {
        Wrap::Repeat => wgpu::AddressMode::Repeat,
        Wrap::Mirror => wgpu::AddressMode::MirrorRepeat,
        Wrap::Clamp => wgpu::AddressMode::ClampToEdge,
    };
    let filter = match texture.filter {
        Filter::Nearest => wgpu::FilterMode::Nearest,
        Filter::Linear => wgpu::FilterMode::Linear,
    };
    gpu.device.create_sampler(&wgpu::SamplerDescriptor {
        label: None,
        address_mode_u: address(texture.wrap_u),
        address_mode_v: address(texture.wrap_v),
        mag_filter: filter,
        min_filter: if mips { wgpu::FilterMode::Linear } else { filter },
        mipmap_filter: if mips { wgpu::MipmapFilterMode::Linear } else { wgpu::MipmapFilterMode::Nearest },
        // Only where everything is filtered. Devices that cannot do it take 1.
        anisotropy_clamp: if mips && texture.filter == Filter::Linear { ANISOTROPY } else { 1 },
        ..Default::default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_keep_light_and_shrink_to_one_texel() {
        let checker = |encoding| {
            let rgba8 = (0..6u32).map(|i| if i % 2 == 0 { [255, 0, 255, 255] } else { [0, 255, 255, 0] });
            let level = Level { width: 2, height: 3, rgba8: rgba8.collect() };
            let half = level.halved(encoding);
            assert_eq!((half.width, half.height), (1, 1));
            half.rgba8[0]
        };
        assert_eq!(checker(Encoding::Linear), [128, 128, 255, 128]);
        // Half the light is code 188; alpha has no curve.
        assert_eq!(checker(Encoding::Srgb), [188, 188, 255, 128]);
    }
}
