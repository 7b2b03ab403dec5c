//! What passes bind: layouts, groups, and pipelines, each made when it is first needed.

use std::collections::BTreeMap;

use dapple_gpu::{Gpu, shader_module, wgpu};

use super::plan::{Image, Shader};
use super::textures::{array_view, hidden_texture, texture};

/// What all pictures' passes have in common.
#[derive(Debug)]
pub(super) struct Kit {
    /// Group 0 of every pass.
    pub(super) screen_layout: wgpu::BindGroupLayout,
    /// Group 1: of a pass, of the one that reads the stochastic map, of the one that reads depths, and of the second camera's.
    pass_layouts: [wgpu::BindGroupLayout; 4],
    pub(super) lookup_layout: wgpu::BindGroupLayout,
    pipelines: BTreeMap<(Shader, Image), wgpu::RenderPipeline>,
    /// What passes bind that write the distances themselves: one texel, zero.
    pub(super) blank: wgpu::TextureView,
    /// What methods bind that know nothing of hidden surfaces.
    pub(super) nothing_hidden: wgpu::TextureView,
    pub(super) nearest: wgpu::Sampler,
}

impl Kit {
    pub(super) fn new(gpu: &Gpu) -> Kit {
        let device = &gpu.device;
        let looking = [(0, UNIFORM), (1, TEXTURE), (2, TEXTURES)];
        let beside = [(5, UNIFORM), (6, TEXTURE), (7, TEXTURE)];
        Kit {
            screen_layout: layout(device, "screen", &[(0, UNIFORM), (1, TEXTURE), (2, TEXTURE)]),
            pass_layouts: [
                layout(device, "screen pass", &looking),
                layout(device, "stochastic map", &[(0, UNIFORM), (3, SAMPLED_DEPTHS)]),
                layout(device, "depths", &[(0, UNIFORM), (1, TEXTURE), (4, NEAREST)]),
                layout(device, "second camera", &[&looking[..], &beside].concat()),
            ],
            lookup_layout: lookup_layout(device),
            pipelines: BTreeMap::new(),
            blank: texture(gpu, Image::Distances(0).format(), (1, 1), 1).create_view(&Default::default()),
            nothing_hidden: array_view(&hidden_texture(gpu, (1, 1), 0)),
            nearest: device.create_sampler(&wgpu::SamplerDescriptor::default()),
        }
    }

    /// Layout of a pass's own group.
    pub(super) fn pass_layout(&self, shader: Shader) -> &wgpu::BindGroupLayout {
        match shader {
            Shader::Resolve => &self.pass_layouts[1],
            Shader::Distance => &self.pass_layouts[2],
            Shader::SsaoBeside | Shader::HbaoBeside => &self.pass_layouts[3],
            _ => &self.pass_layouts[0],
        }
    }

    pub(super) fn pipeline(&mut self, gpu: &Gpu, shader: Shader, writes: Image) -> wgpu::RenderPipeline {
        // One for each format.
        let key = (
            shader,
            match writes {
                Image::Distances(_) | Image::SideDistances => Image::Distances(0),
                Image::Hidden(_) | Image::SideHidden(_) => Image::Hidden(0),
                Image::Value(_) => Image::Value(0),
                Image::Packed(_) => Image::Packed(0),
                other => other,
            },
        );
        let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("screen"),
            bind_group_layouts: &[Some(&self.screen_layout), Some(self.pass_layout(shader))],
            immediate_size: 0,
        });
        let made = self.pipelines.entry(key).or_insert_with(|| {
            let (wgsl, entry) = shader.module();
            let module = shader_module(&gpu.device, shader.label(), &wgsl);
            gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(shader.label()),
                layout: Some(&layout),
                vertex: wgpu::VertexState {
                    module: &module,
                    entry_point: Some("screen_vertex"),
                    compilation_options: Default::default(),
                    buffers: &[],
                },
                primitive: wgpu::PrimitiveState::default(),
                depth_stencil: None,
                multisample: wgpu::MultisampleState::default(),
                fragment: Some(wgpu::FragmentState {
                    module: &module,
                    entry_point: Some(entry),
                    compilation_options: wgpu::PipelineCompilationOptions {
                        constants: &shader.constants(),
                        ..Default::default()
                    },
                    targets: &[Some(key.1.format().into())],
                }),
                multiview_mask: None,
                cache: None,
            })
        });
        made.clone()
    }
}

const UNIFORM: wgpu::BindingType = wgpu::BindingType::Buffer {
    ty: wgpu::BufferBindingType::Uniform,
    has_dynamic_offset: false,
    min_binding_size: None,
};
const TEXTURE: wgpu::BindingType = wgpu::BindingType::Texture {
    sample_type: wgpu::TextureSampleType::Float { filterable: false },
    view_dimension: wgpu::TextureViewDimension::D2,
    multisampled: false,
};
const NEAREST: wgpu::BindingType = wgpu::BindingType::Sampler(wgpu::SamplerBindingType::NonFiltering);
const TEXTURES: wgpu::BindingType = wgpu::BindingType::Texture {
    sample_type: wgpu::TextureSampleType::Float { filterable: false },
    view_dimension: wgpu::TextureViewDimension::D2Array,
    multisampled: false,
};
const SAMPLED_DEPTHS: wgpu::BindingType = wgpu::BindingType::Texture {
    sample_type: wgpu::TextureSampleType::Depth,
    view_dimension: wgpu::TextureViewDimension::D2,
    multisampled: true,
};

fn layout(device: &wgpu::Device, label: &str, types: &[(u32, wgpu::BindingType)]) -> wgpu::BindGroupLayout {
    let entries: Vec<_> = types
        .iter()
        .map(|&(binding, ty)| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::FRAGMENT,
            ty,
            count: None,
        })
        .collect();
    device
        .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries })
}

/// Of the forward pass's look-up: the picture.
pub(super) fn lookup_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    layout(device, "screen space", &[(0, TEXTURE)])
}

pub(super) enum Resource<'a> {
    Uniform(&'a wgpu::Buffer),
    Sampler(&'a wgpu::Sampler),
    Texture(&'a wgpu::TextureView),
}

pub(super) fn group(
    device: &wgpu::Device,
    layout: &wgpu::BindGroupLayout,
    resources: &[(u32, Resource<'_>)],
) -> wgpu::BindGroup {
    let entries: Vec<_> = resources
        .iter()
        .map(|(binding, resource)| wgpu::BindGroupEntry {
            binding: *binding,
            resource: match resource {
                Resource::Uniform(buffer) => buffer.as_entire_binding(),
                Resource::Sampler(sampler) => wgpu::BindingResource::Sampler(sampler),
                Resource::Texture(view) => wgpu::BindingResource::TextureView(view),
            },
        })
        .collect();
    device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
}
