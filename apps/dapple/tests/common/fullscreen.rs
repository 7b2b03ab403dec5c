//! Runs a look-up over a rectangle of fragments on a graphics card: one pass, one fragment a pixel.
#![allow(dead_code, reason = "tests and bench each use their own part")]

use std::collections::BTreeMap;

use dapple_gpu::wgpu;
use dapple_gpu::{Gpu, join, read_texture, shader_module, testing::block_on};
use dapple_render::gbuffer::RestSurface;

/// What every pass reads, and `fragment()`.
pub(crate) const FRAGMENTS_WGSL: &str = "
struct Fragment { instance: u32, position_rest: vec3f, normal_rest: vec3f, chart: vec4f, covered: bool }

@group(0) @binding(0) var fragment_place: texture_2d<f32>;
@group(0) @binding(1) var fragment_normal: texture_2d<f32>;
@group(0) @binding(2) var fragment_chart: texture_2d<f32>;

@vertex fn full_screen(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return vec4f(f32(i & 1u) * 4.0 - 1.0, f32(i >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

fn read_fragment(at: vec4f) -> Fragment {
    let pixel = vec2i(at.xy);
    let place = textureLoad(fragment_place, pixel, 0);
    let normal = textureLoad(fragment_normal, pixel, 0);
    let chart = textureLoad(fragment_chart, pixel, 0);
    return Fragment(u32(max(place.w, 0.0)), place.xyz, normal.xyz, chart, place.w >= 0.0);
}
";

/// The main pass; `visibility` is an expression of `f: Fragment` and `at: vec4f`.
pub(crate) fn main_wgsl(visibility: &str) -> String {
    format!(
        "@fragment fn main(@builtin(position) at: vec4f) -> @location(0) vec4f {{
            let f = read_fragment(at);
            var visibility = 1.0;
            if f.covered {{ visibility = {visibility}; }}
            return vec4f(visibility, abs(f.normal_rest.x) + f.chart.x * 1e-9, f.position_rest.x * 1e-3, 1.0);
        }}"
    )
}

/// Fragments in textures, and what makes passes over them.
pub(crate) struct Fragments {
    pub(crate) gpu: Gpu,
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) layout: wgpu::BindGroupLayout,
    pub(crate) group: wgpu::BindGroup,
    /// Where main passes draw to.
    pub(crate) target: wgpu::Texture,
}

/// Resources of one more bind group, by binding.
pub(crate) type Bindings<'a> = BTreeMap<u32, (wgpu::BindGroupLayoutEntry, wgpu::BindingResource<'a>)>;

/// A pipeline with its bind groups; group 0 is the fragments'.
pub(crate) struct Pass {
    pub(crate) pipeline: wgpu::RenderPipeline,
    pub(crate) groups: Vec<(u32, wgpu::BindGroup)>,
}

pub(crate) const TARGET_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Float;

impl Fragments {
    /// `charts` are four numbers a fragment for whoever needs more than the rest surface, or empty.
    pub(crate) fn new(
        gpu: Gpu,
        width: u32,
        fragments: &[Option<RestSurface>],
        charts: &[[f32; 4]],
    ) -> Fragments {
        let height = (fragments.len() as u32).div_ceil(width);
        let mut place = vec![[0.0f32, 0.0, 0.0, -1.0]; (width * height) as usize];
        let mut normal = vec![[0.0f32; 4]; (width * height) as usize];
        let mut chart = vec![[0.0f32; 4]; (width * height) as usize];
        for (i, fragment) in fragments.iter().enumerate() {
            if let Some(f) = fragment {
                place[i] = f.position_rest.extend(f.instance as f32).to_array();
                normal[i] = f.normal_rest.extend(0.0).to_array();
            }
        }
        chart[..charts.len()].copy_from_slice(charts);
        let views = [place, normal, chart].map(|data| view(&float_texture(&gpu, width, height, &data)));
        let entry = |binding| texture_entry(binding, wgpu::TextureSampleType::Float { filterable: false });
        let bindings: Bindings<'_> = views
            .iter()
            .enumerate()
            .map(|(i, v)| (i as u32, (entry(i as u32), wgpu::BindingResource::TextureView(v))))
            .collect();
        let (layout, group) = bind(&gpu, &bindings);
        let target = render_texture(&gpu, width, height, TARGET_FORMAT);
        Fragments { gpu, width, height, layout, group, target }
    }

    /// A full-screen pass over the fragments that writes `format`. `groups` are bind groups 1 and up, without gaps.
    pub(crate) fn pass(
        &self,
        label: &str,
        files: &[&str],
        entry: &str,
        groups: &[Bindings<'_>],
        format: wgpu::TextureFormat,
    ) -> Pass {
        let device = &self.gpu.device;
        let module = shader_module(device, label, &join(files));
        let bound: Vec<_> = groups.iter().map(|b| bind(&self.gpu, b)).collect();
        let layouts: Vec<_> =
            std::iter::once(&self.layout).chain(bound.iter().map(|b| &b.0)).map(Some).collect();
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(label),
            bind_group_layouts: &layouts,
            immediate_size: 0,
        });
        let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(label),
            layout: Some(&layout),
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("full_screen"),
                compilation_options: Default::default(),
                buffers: &[],
            },
            primitive: Default::default(),
            depth_stencil: None,
            multisample: Default::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some(entry),
                compilation_options: Default::default(),
                targets: &[Some(format.into())],
            }),
            multiview_mask: None,
            cache: None,
        });
        let groups = bound.into_iter().enumerate().map(|(i, b)| (i as u32 + 1, b.1)).collect();
        Pass { pipeline, groups }
    }

    pub(crate) fn record(&self, encoder: &mut wgpu::CommandEncoder, pass: &Pass, target: &wgpu::TextureView) {
        let mut render = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: target,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                    store: wgpu::StoreOp::Store,
                },
            })],
            ..Default::default()
        });
        render.set_pipeline(&pass.pipeline);
        render.set_bind_group(0, &self.group, &[]);
        for (index, group) in &pass.groups {
            render.set_bind_group(*index, group, &[]);
        }
        render.draw(0..3, 0..1);
    }

    /// Draws the pass into the target and reads the first channel back.
    pub(crate) fn run(&self, pass: &Pass) -> Vec<f32> {
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        self.record(&mut encoder, pass, &view(&self.target));
        self.gpu.queue.submit([encoder.finish()]);
        let bytes = block_on(read_texture(&self.gpu, &self.target, 0)).expect("the target is read back");
        bytes.chunks_exact(16).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
    }
}

pub(crate) fn view(texture: &wgpu::Texture) -> wgpu::TextureView {
    texture.create_view(&Default::default())
}

pub(crate) fn texture_entry(
    binding: u32,
    sample_type: wgpu::TextureSampleType,
) -> wgpu::BindGroupLayoutEntry {
    wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::FRAGMENT,
        ty: wgpu::BindingType::Texture {
            sample_type,
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        },
        count: None,
    }
}

fn bind(gpu: &Gpu, bindings: &Bindings<'_>) -> (wgpu::BindGroupLayout, wgpu::BindGroup) {
    let entries: Vec<_> = bindings.values().map(|b| b.0).collect();
    let layout = gpu
        .device
        .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: None, entries: &entries });
    let entries: Vec<_> = bindings
        .iter()
        .map(|(&binding, b)| wgpu::BindGroupEntry { binding, resource: b.1.clone() })
        .collect();
    let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &layout,
        entries: &entries,
    });
    (layout, group)
}

/// The tables of a look-up in the bindings that its WGSL declares.
pub(crate) fn table_bindings(textures: &dapple_render::psao::TableTextures, first: u32) -> Bindings<'_> {
    let entries = dapple_render::psao::TableTextures::layout_entries(first);
    let views = textures.views();
    (0..3).map(|i| (entries[i].binding, (entries[i], wgpu::BindingResource::TextureView(views[i])))).collect()
}

pub(crate) fn render_texture(
    gpu: &Gpu,
    width: u32,
    height: u32,
    format: wgpu::TextureFormat,
) -> wgpu::Texture {
    use wgpu::TextureUsages as Usage;
    texture(gpu, width, height, format, Usage::RENDER_ATTACHMENT | Usage::TEXTURE_BINDING | Usage::COPY_SRC)
}

pub(crate) fn texture(
    gpu: &Gpu,
    width: u32,
    height: u32,
    format: wgpu::TextureFormat,
    usage: wgpu::TextureUsages,
) -> wgpu::Texture {
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage,
        view_formats: &[],
    })
}

/// Four floats a texel.
pub(crate) fn float_texture(gpu: &Gpu, width: u32, height: u32, data: &[[f32; 4]]) -> wgpu::Texture {
    let usage = wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST;
    let made = texture(gpu, width, height, wgpu::TextureFormat::Rgba32Float, usage);
    let bytes: Vec<u8> = data.iter().flatten().flat_map(|f| f.to_le_bytes()).collect();
    write(gpu, &made, &bytes, width * 16);
    made
}

/// Fills the whole texture.
pub(crate) fn write(gpu: &Gpu, texture: &wgpu::Texture, bytes: &[u8], bytes_per_row: u32) {
    gpu.queue.write_texture(
        texture.as_image_copy(),
        bytes,
        wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(bytes_per_row), rows_per_image: None },
        texture.size(),
    );
}
