//! A method's passes on the card, and what they write.

use std::collections::BTreeMap;

use dapple_gpu::{Gpu, shader_module, wgpu};
use dapple_scene::{Pose, PosedCamera};

use super::method::ScreenMethod;
use super::plan::{Image, Pass, Shader, hidden_layers, level_size, levels, passes, seen_size};
use super::textures::{array_view, can_draw_maps, hidden_texture, map_view, texture};
use super::uniforms::ScreenUniform;
use crate::forward::{
    Forward, ForwardError, GeometryTarget, GpuScene, HIDDEN_SAMPLES, HiddenChoice, HiddenTarget, Lookup,
    LookupId,
};
use crate::gbuffer::GuardBand;

/// One screen-space method on a card: draws depths and normals of a view, runs the method over them, and lets the forward pass look the result up. Keeps what it makes
/// from frame to frame.
#[derive(Debug)]
pub struct ScreenPasses {
    lookup: LookupId,
    /// Of the picture, of a pass, of the one that reads the stochastic map, and of the one that reads depths.
    layouts: [wgpu::BindGroupLayout; 4],
    lookup_layout: wgpu::BindGroupLayout,
    pipelines: BTreeMap<(Shader, Image), wgpu::RenderPipeline>,
    /// What passes bind that write the distances themselves.
    blank: wgpu::TextureView,
    /// What methods bind that know nothing of hidden surfaces.
    nothing_hidden: wgpu::TextureView,
    nearest: wgpu::Sampler,
    choice: Option<HiddenChoice>,
    /// Of the whole picture, and of half its resolution.
    screens: [wgpu::Buffer; 2],
    plan: Option<Plan>,
}

/// What a method is to do for one picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScreenView {
    /// The picture's camera.
    pub camera: PosedCamera,
    /// Its columns and rows.
    pub size: (u32, u32),
    /// The method and its parameters.
    pub method: ScreenMethod,
    /// What is drawn beyond the picture, where things block, too.
    pub guard: GuardBand,
    /// Whether a quarter of the samples is estimated ([`crate::upsample`]).
    pub half_resolution: bool,
}

impl ScreenView {
    fn guarded(&self) -> [u32; 2] {
        self.guard.size([self.size.0, self.size.1])
    }
}

impl Plan {
    fn serves(&self, view: &ScreenView) -> bool {
        ScreenView { camera: self.view.camera, ..*view } == self.view
    }
}

/// All that one method needs for pictures of one size.
#[derive(Debug)]
struct Plan {
    /// What it was made for; its camera is the first's.
    view: ScreenView,
    normals: wgpu::TextureView,
    depths: wgpu::TextureView,
    /// Depths of the stochastic map, four samples each.
    maps: Vec<wgpu::TextureView>,
    steps: Vec<Step>,
    picture: wgpu::Texture,
    #[cfg(test)]
    hidden: wgpu::Texture,
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
            layout(device, "screen", &[(0, UNIFORM), (1, TEXTURE), (2, TEXTURE)]),
            layout(device, "screen pass", &[(0, UNIFORM), (1, TEXTURE), (2, TEXTURES)]),
            layout(device, "stochastic map", &[(0, UNIFORM), (3, SAMPLED_DEPTHS)]),
            layout(device, "depths", &[(0, UNIFORM), (1, TEXTURE), (4, NEAREST)]),
        ];
        Ok(ScreenPasses {
            lookup,
            lookup_layout: lookup_layout(device),
            pipelines: BTreeMap::new(),
            blank: texture(gpu, Image::Distances(0).format(), (1, 1), 1).create_view(&Default::default()),
            nothing_hidden: array_view(&hidden_texture(gpu, (1, 1), 0)),
            nearest: device.create_sampler(&wgpu::SamplerDescriptor::default()),
            choice: None,
            screens: [(); 2].map(|()| {
                device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some("screen"),
                    size: size_of::<ScreenUniform>() as u64,
                    usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                    mapped_at_creation: false,
                })
            }),
            layouts,
            plan: None,
        })
    }

    /// Lets go of the textures of the last picture.
    pub fn release(&mut self) {
        self.plan = None;
    }

    /// Whether the device can run a method at all: some cannot draw stochastic depth maps.
    ///
    /// # Errors
    /// What it lacks.
    pub fn check_device(gpu: &Gpu, method: &ScreenMethod) -> Result<(), ForwardError> {
        if hidden_layers(method) > 0 && !can_draw_maps(gpu) {
            let reason = "this device cannot read samples of depths, which stochastic depth maps need (WebGL2 \
                          never can): choose a method without sd- in its name";
            return Err(ForwardError::Frame { reason });
        }
        Ok(())
    }

    /// Records the method's passes for a picture and gives `forward` the result for its look-up. The view's camera and size, and the pose, must be those that the
    /// picture is then drawn with. The geometry is drawn anew, with the guard band. Once a submission, unless camera and size are the same: what a camera's passes read is
    /// written before any of them runs.
    ///
    /// # Errors
    /// A parameter out of its range, or what [`Forward::draw_geometry`] refuses. Then nothing is recorded.
    pub fn draw(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        forward: &mut Forward,
        scene: &mut GpuScene,
        pose: &Pose,
        view: &ScreenView,
    ) -> Result<(), ForwardError> {
        self.draw_geometry(gpu, encoder, forward, scene, pose, view)?;
        for step in 0..self.steps().count() {
            self.record_step(encoder, step);
        }
        Ok(())
    }

    /// The first part of [`ScreenPasses::draw`]: depths and normals. After it [`ScreenPasses::record_step`] records the passes one by one.
    ///
    /// # Errors
    /// Those of [`ScreenPasses::draw`].
    pub fn draw_geometry(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        forward: &mut Forward,
        scene: &mut GpuScene,
        pose: &Pose,
        view: &ScreenView,
    ) -> Result<(), ForwardError> {
        view.method.check()?;
        let mut view = *view;
        if let (ScreenMethod::Sao(params), wgpu::Backend::Gl) =
            (&mut view.method, gpu.adapter.get_info().backend)
        {
            // Of textures that are not filtered GLES 3 reads the first level alone.
            params.levels = 0;
        }
        let view = &view;
        let largest = gpu.device.limits().max_texture_dimension_2d;
        let [width, height] = view.guarded();
        let padded = padded_size(&view.method, seen_size((width, height), view.half_resolution));
        let widest = width.max(height).max(padded.0).max(padded.1);
        if view.size.0 == 0 || view.size.1 == 0 || widest > largest {
            let reason = "the picture has no pixels, or with its guard band more than the device allows: make it smaller";
            return Err(ForwardError::Frame { reason });
        }
        let map = match &view.method {
            ScreenMethod::Stochastic(_, stochastic) => Some(&stochastic.map),
            _ => None,
        };
        ScreenPasses::check_device(gpu, &view.method)?;
        if let Some(map) = map.filter(|map| self.choice.as_ref().map(HiddenChoice::params) != Some(map)) {
            self.choice = Some(HiddenChoice::new(gpu, map));
        }
        let is_current = self.plan.as_ref().is_some_and(|plan| plan.serves(view));
        if !is_current {
            self.plan = Some(self.make_plan(gpu, view));
        }
        let Some(plan) = &self.plan else { return Ok(()) };
        let camera = view.guard.camera(&view.camera, view.size.1);
        let size = (width, height);
        let target = GeometryTarget { camera, size, normals: &plan.normals, depths: &plan.depths };
        forward.draw_geometry(gpu, encoder, scene, pose, &[target])?;
        for (depths, index) in plan.maps.iter().zip(0..) {
            let Some(choice) = &self.choice else { break };
            let first_sample = index * HIDDEN_SAMPLES;
            let target = HiddenTarget { camera, size, first_depths: &plan.depths, depths, first_sample };
            forward.draw_hidden(gpu, encoder, scene, pose, choice, &target)?;
        }
        let full = ScreenUniform::new(&camera, size);
        for (buffer, uniform) in self.screens.iter().zip([full, full.half()]) {
            gpu.queue.write_buffer(buffer, 0, bytemuck::bytes_of(&uniform));
        }
        let view = plan.picture.create_view(&Default::default());
        forward.bind_lookup(
            self.lookup,
            group(&gpu.device, &self.lookup_layout, &[(0, Resource::Texture(&view))]),
        );
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

    /// Distances of the last picture's hidden surfaces, metres: four a texel and layer, 1e30 where there is none.
    #[cfg(test)]
    pub(super) fn hidden(&self) -> Option<&wgpu::Texture> {
        self.plan.as_ref().map(|plan| &plan.hidden)
    }

    fn make_plan(&mut self, gpu: &Gpu, view: &ScreenView) -> Plan {
        let [width, height] = view.guarded();
        let full = (width, height);
        let seen = seen_size(full, view.half_resolution);
        let level_count = levels(&view.method, seen) + 1;
        let padded = padded_size(&view.method, seen);
        let distances = texture(gpu, Image::Distances(0).format(), padded, level_count);
        let picture = texture(gpu, Image::Picture.format(), view.size, 1);
        let size_of = |image| match image {
            Image::Picture => view.size,
            Image::Depths | Image::Normals | Image::FullDistances => full,
            Image::Distances(level) => level_size(seen, level),
            Image::Map(_) => full,
            Image::HalfNormals | Image::Value(_) | Image::Packed(_) | Image::Hidden(_) => seen,
        };
        let passes = passes(&view.method, full, view.guard.pixels(), view.half_resolution);
        let mut views: BTreeMap<Image, wgpu::TextureView> = BTreeMap::new();
        views.insert(Image::Picture, picture.create_view(&Default::default()));
        for level in 0..level_count {
            let descriptor = wgpu::TextureViewDescriptor {
                base_mip_level: level,
                mip_level_count: Some(1),
                ..Default::default()
            };
            views.insert(Image::Distances(level), distances.create_view(&descriptor));
        }
        let layers = hidden_layers(&view.method);
        let hidden = hidden_texture(gpu, if layers > 0 { seen } else { (1, 1) }, layers);
        let all_hidden = array_view(&hidden);
        for layer in 0..layers {
            let descriptor = wgpu::TextureViewDescriptor {
                dimension: Some(wgpu::TextureViewDimension::D2),
                base_array_layer: layer,
                array_layer_count: Some(1),
                ..Default::default()
            };
            views.insert(Image::Hidden(layer), hidden.create_view(&descriptor));
            views.insert(Image::Map(layer), map_view(gpu, full));
        }
        let named = passes.iter().flat_map(|pass| pass.reads.into_iter().chain([pass.writes]));
        for image in named.chain([Image::Normals]) {
            let plain = || texture(gpu, image.format(), size_of(image), 1).create_view(&Default::default());
            views.entry(image).or_insert_with(plain);
        }
        let all_distances = distances.create_view(&Default::default());
        let mut steps = Vec::new();
        for Pass { shader, reads, writes, params } in passes {
            // The picture is placed among all samples.
            let is_half = view.half_resolution && writes != Image::Picture;
            let distances = match (shader, view.half_resolution) {
                // What they write themselves cannot be read.
                (Shader::Distance | Shader::Minify | Shader::Halve | Shader::Resolve, _) => &self.blank,
                (Shader::Place, true) => &views[&Image::FullDistances],
                _ => &all_distances,
            };
            let normals = match shader {
                Shader::Distance | Shader::Minify | Shader::Halve | Shader::Resolve => &self.blank,
                _ if is_half => &views[&Image::HalfNormals],
                _ => &views[&Image::Normals],
            };
            let is_looking = matches!(shader, Shader::Ssao | Shader::Hbao) && layers > 0;
            let uniform = gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(shader.label()),
                size: params.len() as u64,
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            });
            gpu.queue.write_buffer(&uniform, 0, &params);
            let before = reads.map_or(&self.blank, |image| &views[&image]);
            let screen = &self.screens[usize::from(is_half)];
            let own = [
                (0, Resource::Uniform(screen)),
                (1, Resource::Texture(distances)),
                (2, Resource::Texture(normals)),
            ];
            let passed = match shader {
                Shader::Resolve => vec![(0, Resource::Uniform(&uniform)), (3, Resource::Texture(before))],
                Shader::Distance => vec![
                    (0, Resource::Uniform(&uniform)),
                    (1, Resource::Texture(before)),
                    (4, Resource::Sampler(&self.nearest)),
                ],
                _ => vec![
                    (0, Resource::Uniform(&uniform)),
                    (1, Resource::Texture(before)),
                    (2, Resource::Texture(if is_looking { &all_hidden } else { &self.nothing_hidden })),
                ],
            };
            let groups = [
                group(&gpu.device, &self.layouts[0], &own),
                group(&gpu.device, self.pass_layout(shader), &passed),
            ];
            steps.push(Step {
                label: shader.label(),
                target: views[&writes].clone(),
                pipeline: self.pipeline(gpu, shader, writes),
                groups,
                size: size_of(writes),
            });
        }
        let [normals, depths] = [Image::Normals, Image::Depths].map(|image| views[&image].clone());
        let maps = (0..layers).map(|layer| views[&Image::Map(layer)].clone()).collect();
        Plan {
            view: *view,
            normals,
            depths,
            maps,
            steps,
            picture,
            #[cfg(test)]
            hidden,
        }
    }

    /// Layout of a pass's own group.
    fn pass_layout(&self, shader: Shader) -> &wgpu::BindGroupLayout {
        match shader {
            Shader::Resolve => &self.layouts[2],
            Shader::Distance => &self.layouts[3],
            _ => &self.layouts[1],
        }
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
        let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("screen"),
            bind_group_layouts: &[Some(&self.layouts[0]), Some(self.pass_layout(shader))],
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

fn lookup_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    layout(device, "screen space", &[(0, TEXTURE)])
}

enum Resource<'a> {
    Uniform(&'a wgpu::Buffer),
    Sampler(&'a wgpu::Sampler),
    Texture(&'a wgpu::TextureView),
}

fn group(
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

/// Of the texture of distances. The twin's levels are rounded up, a card's down: its first one is larger then, and passes write parts alone.
fn padded_size(method: &ScreenMethod, seen: (u32, u32)) -> (u32, u32) {
    let whole = 1u32 << levels(method, seen);
    let padded = |side: u32| side.checked_next_multiple_of(whole).unwrap_or(u32::MAX);
    (padded(seen.0), padded(seen.1))
}
