//! Materials on the card: one group each.

use std::collections::BTreeMap;

use dapple_gpu::{Gpu, wgpu};
use dapple_scene::{AlphaMode, Material, Scene, TextureRef};

use super::super::layouts;
use super::super::uniforms::{MATERIAL_NORMAL_MAP, MATERIAL_UNLIT, MaterialUniform, TextureUseUniform};
use super::texture::{self, Encoding};

/// A material as the passes use it.
#[derive(Debug)]
pub(crate) struct GpuMaterial {
    pub(crate) group: wgpu::BindGroup,
    pub(crate) two_sided: bool,
    pub(crate) alpha: AlphaMode,
}

/// Uploads all materials of a scene, each image once for every way it is read.
pub(super) fn upload_all(gpu: &Gpu, scene: &Scene, mips: bool) -> Vec<GpuMaterial> {
    let mut makers = Makers {
        gpu,
        scene,
        mips,
        layout: layouts::material(&gpu.device),
        images: BTreeMap::new(),
        white: texture::upload(gpu, &texture::white(), Encoding::Linear, false),
        plain_sampler: gpu.device.create_sampler(&wgpu::SamplerDescriptor::default()),
    };
    scene.materials.iter().map(|material| makers.material(material)).collect()
}

struct Makers<'a> {
    gpu: &'a Gpu,
    scene: &'a Scene,
    mips: bool,
    layout: wgpu::BindGroupLayout,
    images: BTreeMap<(u32, Encoding), wgpu::TextureView>,
    white: wgpu::TextureView,
    plain_sampler: wgpu::Sampler,
}

impl Makers<'_> {
    fn material(&mut self, material: &Material) -> GpuMaterial {
        let normal = material.normal_texture.as_ref().map(|n| n.texture);
        let uses = [
            (material.base_color_texture, Encoding::Srgb),
            (material.metallic_roughness_texture, Encoding::Linear),
            (normal, Encoding::Linear),
            (material.emissive_texture, Encoding::Srgb),
        ];
        let sampled = uses.map(|(reference, encoding)| self.sampled(reference, encoding));
        let [base_color_use, metallic_roughness_use, normal_use, emissive_use] =
            uses.map(|(reference, _)| texture_use(reference.as_ref()));
        let mut flags = 0;
        if material.unlit {
            flags |= MATERIAL_UNLIT;
        }
        if normal.is_some() {
            flags |= MATERIAL_NORMAL_MAP;
        }
        let uniform = MaterialUniform {
            base_color: material.base_color_factor.to_array(),
            emissive: material.emissive_factor.to_array(),
            metallic: material.metallic_factor,
            roughness: material.roughness_factor,
            normal_scale: material.normal_texture.as_ref().map_or(1.0, |n| n.scale),
            cutoff: match material.alpha_mode {
                AlphaMode::Opaque => 0.0,
                AlphaMode::Mask { cutoff } => cutoff,
                AlphaMode::Blend => 0.5,
            },
            flags,
            base_color_use,
            metallic_roughness_use,
            normal_use,
            emissive_use,
        };
        let device = &self.gpu.device;
        let buffer =
            layouts::buffer(device, "material", bytemuck::bytes_of(&uniform), wgpu::BufferUsages::UNIFORM);
        let mut resources = vec![buffer.as_entire_binding()];
        for (view, sampler) in &sampled {
            resources.push(wgpu::BindingResource::TextureView(view));
            resources.push(wgpu::BindingResource::Sampler(sampler));
        }
        GpuMaterial {
            group: layouts::group(device, &self.layout, &resources),
            two_sided: material.double_sided,
            alpha: material.alpha_mode,
        }
    }

    /// White where there is no texture or no image.
    fn sampled(
        &mut self,
        reference: Option<TextureRef>,
        encoding: Encoding,
    ) -> (wgpu::TextureView, wgpu::Sampler) {
        let texture = reference.and_then(|r| self.scene.textures.get(r.texture as usize));
        let image = texture.and_then(|t| self.scene.images.get(t.image as usize));
        let (Some(texture), Some(image)) = (texture, image.filter(|i| i.width > 0 && i.height > 0)) else {
            return (self.white.clone(), self.plain_sampler.clone());
        };
        let view = self
            .images
            .entry((texture.image, encoding))
            .or_insert_with(|| texture::upload(self.gpu, image, encoding, self.mips));
        (view.clone(), texture::sampler(self.gpu, texture, self.mips))
    }
}

fn texture_use(reference: Option<&TextureRef>) -> TextureUseUniform {
    let map = reference.map_or(glam::Affine2::IDENTITY, |r| r.image_from_uv);
    TextureUseUniform {
        linear: [map.matrix2.x_axis.x, map.matrix2.x_axis.y, map.matrix2.y_axis.x, map.matrix2.y_axis.y],
        offset: map.translation.to_array(),
        uv_set: reference.map_or(0, |r| u32::from(r.uv_set.min(1))),
        pad: 0,
    }
}
