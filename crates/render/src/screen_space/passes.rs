//! A method's passes on the card, and what they write.

use std::collections::BTreeMap;

use dapple_gpu::{Gpu, shader_module, wgpu};
use dapple_scene::{Pose, PosedCamera};

use super::method::ScreenMethod;
use super::plan::{Image, Pass, Shader, level_size, levels, passes};
use super::uniforms::ScreenUniform;
use crate::forward::{Forward, ForwardError, GeometryTarget, GpuScene, Lookup, LookupId};

/// One screen-space method on a card: draws depths and normals of a view, runs the method over them, and lets the forward pass look the result up. Keeps what it makes
/// from frame to frame.
#[derive(Debug)]
pub struct ScreenPasses {
    lookup: LookupId,
    layouts: [wgpu::BindGroupLayout; 2],
    lookup_layout: wgpu::BindGroupLayout,
    layout: wgpu::PipelineLayout,
    pipelines: BTreeMap<(Shader, Image), wgpu::RenderPipeline>,
    /// What passes bind that write the distances themselves.
    blank: wgpu::TextureView,
    screen: wgpu::Buffer,
    plan: Option<Plan>,
}

/// All that one method needs for pictures of one size.
#[derive(Debug)]
struct Plan {
    method: ScreenMethod,
    size: (u32, u32),
    guard: u32,
    normals: wgpu::TextureView,
    depths: wgpu::TextureView,
    steps: Vec<Step>,
    picture: wgpu::Texture,
}

#[derive(Debug)]
struct Step {
    label: &'static str,
    pipeline: wgpu::RenderPipeline,
    groups: [wgpu::BindGroup; 2],
    target: wgpu::TextureView,
    /// Columns and rows that are written.
    size: (u32, u32),
}

impl ScreenPasses {
    /// How the forward pass looks up what a method has found: give it to [`Forward::new`].
    pub fn lookup(gpu: &Gpu) -> Lookup {
        Lookup {
            label: "screen space",
            wgsl: vec![include_str!("wgsl/lookup.wgsl")],
            needs_rest: false,
            layout: Some(lookup_layout(&gpu.device)),
        }
    }

    /// Prepares to serve one look-up of a forward pass, which was made with [`ScreenPasses::lookup`].
    ///
    /// # Errors
    /// A device that cannot draw into textures of floats.
    pub fn new(gpu: &Gpu, lookup: LookupId) -> Result<ScreenPasses, ForwardError> {
        let formats = [Image::Distances(0), Image::Value(0), Image::Picture].map(Image::format);
        let draws = |format: wgpu::TextureFormat| {
            let features = gpu.adapter.get_texture_format_features(format);
            features.allowed_usages.contains(wgpu::TextureUsages::RENDER_ATTACHMENT)
        };
        if !formats.into_iter().all(draws) {
            let reason = "this device cannot draw into textures of floats, which screen-space methods need";
            return Err(ForwardError::Frame { reason });
        }
        let device = &gpu.device;
        let layouts = [
            layout(device, "screen", &[UNIFORM, TEXTURE, TEXTURE]),
            layout(device, "screen pass", &[UNIFORM, TEXTURE]),
        ];
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("screen"),
            bind_group_layouts: &layouts.each_ref().map(Some),
            immediate_size: 0,
        });
        Ok(ScreenPasses {
            lookup,
            layout: pipeline_layout,
            lookup_layout: lookup_layout(device),
            pipelines: BTreeMap::new(),
            blank: texture(gpu, Image::Distances(0).format(), (1, 1), 1).create_view(&Default::default()),
            screen: device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("screen"),
                size: size_of::<ScreenUniform>() as u64,
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }),
            layouts,
            plan: None,
        })
    }

    /// Records the method's passes for a picture of `size` pixels and gives `forward` the result for its look-up. `camera`, `pose` and `size` must be those that the picture is
    /// then drawn with. The geometry is drawn anew, with `guard` pixels more on each side, in which what is just outside of the picture still blocks.
    ///
    /// # Errors
    /// A parameter out of its range, or what [`Forward::draw_geometry`] refuses. Then nothing is recorded.
    #[allow(clippy::too_many_arguments, reason = "a picture has that many sides")]
    pub fn draw(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        forward: &mut Forward,
        scene: &mut GpuScene,
        pose: &Pose,
        camera: &PosedCamera,
        size: (u32, u32),
        method: &ScreenMethod,
        guard: u32,
    ) -> Result<(), ForwardError> {
        self.draw_geometry(gpu, encoder, forward, scene, pose, camera, size, method, guard)?;
        for step in 0..self.steps().count() {
            self.record_step(encoder, step);
        }
        Ok(())
    }

    /// The first part of [`ScreenPasses::draw`]: depths and normals. After it [`ScreenPasses::record_step`] records the passes one by one.
    ///
    /// # Errors
    /// Those of [`ScreenPasses::draw`].
    #[allow(clippy::too_many_arguments, reason = "a picture has that many sides")]
    pub fn draw_geometry(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        forward: &mut Forward,
        scene: &mut GpuScene,
        pose: &Pose,
        camera: &PosedCamera,
        size: (u32, u32),
        method: &ScreenMethod,
        guard: u32,
    ) -> Result<(), ForwardError> {
        method.check()?;
        let largest = gpu.device.limits().max_texture_dimension_2d;
        // Levels halve what is made even first.
        let room = largest.saturating_sub(1 << levels(method, size));
        if [size.0, size.1].iter().any(|side| *side == 0 || side.saturating_add(2 * guard) > room) {
            let reason = "the picture has no pixels, or with its guard band more than the device allows: make it smaller";
            return Err(ForwardError::Frame { reason });
        }
        let guarded = (size.0 + 2 * guard, size.1 + 2 * guard);
        let camera = crate::projection::guarded(camera, size.1, guard);
        let is_current =
            self.plan.as_ref().is_some_and(|p| p.method == *method && p.size == size && p.guard == guard);
        if !is_current {
            self.plan = Some(self.make_plan(gpu, method, size, guard));
        }
        let Some(plan) = &self.plan else { return Ok(()) };
        let target = GeometryTarget { camera, size: guarded, normals: &plan.normals, depths: &plan.depths };
        forward.draw_geometry(gpu, encoder, scene, pose, &[target])?;
        gpu.queue.write_buffer(&self.screen, 0, bytemuck::bytes_of(&ScreenUniform::new(&camera, guarded)));
        let view = plan.picture.create_view(&Default::default());
        forward
            .bind_lookup(self.lookup, group(&gpu.device, &self.lookup_layout, &[Resource::Texture(&view)]));
        Ok(())
    }

    /// What the passes are called, in order; several may have one name. None before the first picture.
    pub fn steps(&self) -> impl Iterator<Item = &'static str> + '_ {
        self.plan.iter().flat_map(|plan| plan.steps.iter().map(|step| step.label))
    }

    /// Records one of the passes of the last [`ScreenPasses::draw_geometry`]; nothing where there is none of this number.
    pub fn record_step(&self, encoder: &mut wgpu::CommandEncoder, index: usize) {
        let Some(step) = self.plan.as_ref().and_then(|plan| plan.steps.get(index)) else { return };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some(step.label),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &step.target,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                    store: wgpu::StoreOp::Store,
                },
            })],
            ..Default::default()
        });
        pass.set_viewport(0.0, 0.0, step.size.0 as f32, step.size.1 as f32, 0.0, 1.0);
        pass.set_pipeline(&step.pipeline);
        for (index, group) in (0..).zip(&step.groups) {
            pass.set_bind_group(index, group, &[]);
        }
        pass.draw(0..3, 0..1);
    }

    /// What the last picture's method found: visibility and distance of each pixel.
    pub fn picture(&self) -> Option<&wgpu::Texture> {
        self.plan.as_ref().map(|plan| &plan.picture)
    }

    fn make_plan(&mut self, gpu: &Gpu, method: &ScreenMethod, size: (u32, u32), guard: u32) -> Plan {
        let guarded = (size.0 + 2 * guard, size.1 + 2 * guard);
        let level_count = levels(method, guarded) + 1;
        // The twin's levels are rounded up, a card's down: its first one is larger then, and passes write parts alone.
        let whole = 1 << (level_count - 1);
        let padded = (guarded.0.next_multiple_of(whole), guarded.1.next_multiple_of(whole));
        let distances = texture(gpu, Image::Distances(0).format(), padded, level_count);
        let plain = |format, size| texture(gpu, format, size, 1).create_view(&Default::default());
        let picture = texture(gpu, Image::Picture.format(), size, 1);
        let mut views: BTreeMap<Image, wgpu::TextureView> = BTreeMap::new();
        let depths = plain(GeometryTarget::DEPTH_FORMAT, guarded);
        views.insert(Image::Depths, depths.clone());
        views.insert(Image::Picture, picture.create_view(&Default::default()));
        for level in 0..level_count {
            let descriptor = wgpu::TextureViewDescriptor {
                base_mip_level: level,
                mip_level_count: Some(1),
                ..Default::default()
            };
            views.insert(Image::Distances(level), distances.create_view(&descriptor));
        }
        let all_distances = distances.create_view(&Default::default());
        let normals = plain(GeometryTarget::NORMAL_FORMAT, guarded);
        let mut steps = Vec::new();
        for Pass { shader, reads, writes, params } in passes(method, guarded, guard) {
            for image in reads.into_iter().chain([writes]) {
                views.entry(image).or_insert_with(|| plain(image.format(), guarded));
            }
            let is_pyramid = matches!(writes, Image::Distances(_));
            let distances = if is_pyramid { &self.blank } else { &all_distances };
            let uniform = gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(shader.label()),
                size: params.len() as u64,
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            });
            gpu.queue.write_buffer(&uniform, 0, &params);
            let before = reads.map_or(&self.blank, |image| &views[&image]);
            let own =
                [Resource::Uniform(&self.screen), Resource::Texture(distances), Resource::Texture(&normals)];
            let passed = [Resource::Uniform(&uniform), Resource::Texture(before)];
            let groups =
                [group(&gpu.device, &self.layouts[0], &own), group(&gpu.device, &self.layouts[1], &passed)];
            let written = match writes {
                Image::Picture => size,
                Image::Distances(level) => level_size(guarded, level),
                _ => guarded,
            };
            steps.push(Step {
                label: shader.label(),
                target: views[&writes].clone(),
                pipeline: self.pipeline(gpu, shader, writes),
                groups,
                size: written,
            });
        }
        Plan { method: *method, size, guard, normals, depths, steps, picture }
    }

    fn pipeline(&mut self, gpu: &Gpu, shader: Shader, writes: Image) -> wgpu::RenderPipeline {
        // One for each format.
        let key = (
            shader,
            match writes {
                Image::Distances(_) => Image::Distances(0),
                Image::Value(_) => Image::Value(0),
                Image::Packed(_) => Image::Packed(0),
                other => other,
            },
        );
        let made = self.pipelines.entry(key).or_insert_with(|| {
            let (wgsl, entry) = shader.module();
            let module = shader_module(&gpu.device, shader.label(), &wgsl);
            gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(shader.label()),
                layout: Some(&self.layout),
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

fn layout(device: &wgpu::Device, label: &str, types: &[wgpu::BindingType]) -> wgpu::BindGroupLayout {
    let entries: Vec<_> = (0..)
        .zip(types)
        .map(|(binding, &ty)| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::FRAGMENT,
            ty,
            count: None,
        })
        .collect();
    device
        .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries })
}

fn lookup_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    layout(device, "screen space", &[TEXTURE])
}

enum Resource<'a> {
    Uniform(&'a wgpu::Buffer),
    Texture(&'a wgpu::TextureView),
}

fn group(
    device: &wgpu::Device,
    layout: &wgpu::BindGroupLayout,
    resources: &[Resource<'_>],
) -> wgpu::BindGroup {
    let entries: Vec<_> = (0..)
        .zip(resources)
        .map(|(binding, resource)| wgpu::BindGroupEntry {
            binding,
            resource: match resource {
                Resource::Uniform(buffer) => buffer.as_entire_binding(),
                Resource::Texture(view) => wgpu::BindingResource::TextureView(view),
            },
        })
        .collect();
    device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
}

fn texture(
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
