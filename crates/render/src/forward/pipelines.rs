//! Pipelines, each made once when it is first needed.

use std::collections::BTreeMap;

use dapple_gpu::{Gpu, join, shader_module, wgpu};
use dapple_scene::{AlphaMode, Scene};

use super::layouts;
use super::lookup::{LOOKUP_INPUT_WGSL, Lookup};
use super::scene::vertex_layouts;

pub(super) const MATH_WGSL: &str = include_str!("wgsl/math.wgsl");
pub(super) const FRAME_WGSL: &str = include_str!("wgsl/frame.wgsl");
pub(super) const DEFORM_WGSL: &str = include_str!("wgsl/deform.wgsl");
pub(super) const MATERIAL_WGSL: &str = include_str!("wgsl/material.wgsl");
pub(super) const RAMP_WGSL: &str = include_str!("wgsl/ramp.wgsl");
/// Of the normals of [`super::Forward::draw_geometry`].
pub(super) const NORMAL_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgb10a2Unorm;
pub(super) const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// The files of the forward pass with one look-up.
pub(super) fn forward_module(lookup: &Lookup) -> String {
    let mut files = vec![
        FRAME_WGSL,
        MATH_WGSL,
        DEFORM_WGSL,
        MATERIAL_WGSL,
        include_str!("wgsl/vertex.wgsl"),
        include_str!("wgsl/display.wgsl"),
        include_str!("wgsl/brdf.wgsl"),
        include_str!("wgsl/light.wgsl"),
        include_str!("../area_lights/arrival.wgsl"),
        include_str!("../area_lights/gloss.wgsl"),
        include_str!("../area_lights/reflect.wgsl"),
        include_str!("wgsl/fragment.wgsl"),
        include_str!("wgsl/inspect.wgsl"),
        LOOKUP_INPUT_WGSL,
    ];
    files.extend_from_slice(&lookup.wgsl);
    join(&files)
}

/// The files of the pass that screen-space methods begin with.
pub(super) fn geometry_module() -> String {
    join(&[
        FRAME_WGSL,
        MATH_WGSL,
        DEFORM_WGSL,
        MATERIAL_WGSL,
        include_str!("wgsl/vertex.wgsl"),
        include_str!("wgsl/geometry.wgsl"),
    ])
}

/// The files of the pass that draws the stochastic depth map.
pub(super) fn hidden_module() -> String {
    join(&[
        FRAME_WGSL,
        MATH_WGSL,
        DEFORM_WGSL,
        MATERIAL_WGSL,
        include_str!("wgsl/vertex.wgsl"),
        include_str!("wgsl/hidden.wgsl"),
    ])
}

/// The files of the shadow maps.
pub(super) fn caster_module() -> String {
    join(&[MATH_WGSL, DEFORM_WGSL, MATERIAL_WGSL, include_str!("wgsl/caster.wgsl")])
}

/// The file that empties a face of the shadow maps.
pub(super) const CLEAR_WGSL: &str = include_str!("wgsl/clear.wgsl");

/// The files of the points.
pub(super) fn points_module() -> String {
    join(&[FRAME_WGSL, MATH_WGSL, RAMP_WGSL, include_str!("wgsl/points.wgsl")])
}

/// The files of the error view.
pub(super) fn error_module() -> String {
    join(&[RAMP_WGSL, include_str!("wgsl/error.wgsl")])
}

/// What meshes are drawn for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Stage {
    /// A picture, its visibility by one of the look-ups.
    Picture(usize),
    /// Normals and depths ([`super::geometry`]).
    Geometry,
    /// Depths alone.
    Depths,
    /// Depths of hidden surfaces in four samples ([`super::hidden`]).
    Hidden,
}

/// What tells one pipeline of the forward pass from another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct PipelineKey {
    pub(super) stage: Stage,
    pub(super) detailed: bool,
    pub(super) mirrored: bool,
    pub(super) two_sided: bool,
    pub(super) cuts_holes: bool,
    pub(super) blends: bool,
    pub(super) inspects: bool,
    pub(super) area_lights: bool,
}

/// All pipelines that draw into the picture.
#[derive(Debug)]
pub(super) struct Pipelines {
    format: wgpu::TextureFormat,
    samples: u32,
    lookups: Vec<Lookup>,
    hidden_layout: wgpu::BindGroupLayout,
    /// Frame, material, surface.
    groups: [wgpu::BindGroupLayout; 3],
    /// Modules, each made when it is first needed: most pictures need one.
    stages: BTreeMap<Stage, StagePipelines>,
    made: BTreeMap<PipelineKey, wgpu::RenderPipeline>,
    pub(super) points: wgpu::RenderPipeline,
    pub(super) error: wgpu::RenderPipeline,
}

#[derive(Debug)]
struct StagePipelines {
    module: wgpu::ShaderModule,
    layout: wgpu::PipelineLayout,
    needs_rest: bool,
}

impl Pipelines {
    pub(super) fn new(gpu: &Gpu, format: wgpu::TextureFormat, samples: u32, lookups: &[Lookup]) -> Pipelines {
        let device = &gpu.device;
        let groups = [layouts::frame(device), layouts::material(device), layouts::surface(device)];
        Pipelines {
            format,
            samples,
            lookups: lookups.to_vec(),
            hidden_layout: layouts::hidden(device),
            stages: BTreeMap::new(),
            made: BTreeMap::new(),
            points: points(device, &groups[0], format, samples),
            error: error(device, format, samples),
            groups,
        }
    }

    fn make_stage(&self, device: &wgpu::Device, stage: Stage) -> StagePipelines {
        let (label, wgsl, needs_rest, own) = match stage {
            Stage::Picture(lookup) => {
                let lookup = &self.lookups[lookup];
                (lookup.label, forward_module(lookup), lookup.needs_rest, lookup.layout.as_ref())
            }
            Stage::Geometry | Stage::Depths => ("geometry", geometry_module(), false, None),
            Stage::Hidden => ("hidden", hidden_module(), false, Some(&self.hidden_layout)),
        };
        let layouts: Vec<_> = self.groups.iter().chain(own).map(Some).collect();
        StagePipelines {
            module: shader_module(device, label, &wgsl),
            layout: device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some(label),
                bind_group_layouts: &layouts,
                immediate_size: 0,
            }),
            needs_rest,
        }
    }

    /// Makes a pipeline unless it is there already.
    pub(super) fn prepare(&mut self, gpu: &Gpu, key: PipelineKey) {
        if !self.made.contains_key(&key) {
            if !self.stages.contains_key(&key.stage) {
                let stage = self.make_stage(&gpu.device, key.stage);
                self.stages.insert(key.stage, stage);
            }
            let pipeline = self.make(gpu, key);
            self.made.insert(key, pipeline);
        }
    }

    /// A prepared pipeline.
    pub(super) fn get(&self, key: PipelineKey) -> Option<&wgpu::RenderPipeline> {
        self.made.get(&key)
    }

    fn make(&self, gpu: &Gpu, key: PipelineKey) -> wgpu::RenderPipeline {
        let stage = &self.stages[&key.stage];
        let (format, samples) = match key.stage {
            Stage::Picture(_) => (self.format, self.samples),
            Stage::Geometry | Stage::Depths => (NORMAL_FORMAT, 1),
            Stage::Hidden => (NORMAL_FORMAT, 4),
        };
        let target = [Some(wgpu::ColorTargetState {
            format,
            blend: key.blends.then_some(wgpu::BlendState::ALPHA_BLENDING),
            write_mask: wgpu::ColorWrites::ALL,
        })];
        let flag = |on: bool| f64::from(u8::from(on));
        let rest = ("NEEDS_REST", flag(stage.needs_rest));
        let area_lights = ("AREA_LIGHTS", flag(key.area_lights));
        let mut fragment_constants = vec![("CUTS_HOLES", flag(key.cuts_holes))];
        if let Stage::Picture(_) = key.stage {
            let own = [rest, area_lights, ("BLENDS", flag(key.blends)), ("INSPECTS", flag(key.inspects))];
            fragment_constants.extend(own);
        }
        // Whose depths are all there is.
        let has_no_target = matches!(key.stage, Stage::Depths | Stage::Hidden);
        // Depths alone need no fragment stage where nothing is cut out.
        let has_fragments = key.stage != Stage::Depths || key.cuts_holes;
        let entry_point = if key.stage == Stage::Depths { "depth_fragment" } else { "fragment" };
        let options = |constants| wgpu::PipelineCompilationOptions { constants, ..Default::default() };
        gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("forward"),
            layout: Some(&stage.layout),
            vertex: wgpu::VertexState {
                module: &stage.module,
                entry_point: Some(if key.detailed { "vertex_detailed" } else { "vertex_plain" }),
                compilation_options: options(&[rest, area_lights]),
                buffers: &vertex_layouts(key.detailed),
            },
            primitive: wgpu::PrimitiveState {
                front_face: if key.mirrored { wgpu::FrontFace::Cw } else { wgpu::FrontFace::Ccw },
                cull_mode: (!key.two_sided).then_some(wgpu::Face::Back),
                ..Default::default()
            },
            depth_stencil: Some(depth(!key.blends)),
            multisample: multisample(samples),
            fragment: has_fragments.then(|| wgpu::FragmentState {
                module: &stage.module,
                entry_point: Some(entry_point),
                compilation_options: options(&fragment_constants),
                targets: if has_no_target { &[] } else { &target },
            }),
            multiview_mask: None,
            cache: None,
        })
    }
}

fn depth(writes: bool) -> wgpu::DepthStencilState {
    wgpu::DepthStencilState {
        format: DEPTH_FORMAT,
        depth_write_enabled: Some(writes),
        // Reverse z.
        depth_compare: Some(wgpu::CompareFunction::Greater),
        stencil: wgpu::StencilState::default(),
        bias: wgpu::DepthBiasState::default(),
    }
}

fn multisample(count: u32) -> wgpu::MultisampleState {
    wgpu::MultisampleState { count, ..Default::default() }
}

/// Vertex buffer of points: place and value.
const POINT: [wgpu::VertexAttribute; 2] = wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32];

fn points(
    device: &wgpu::Device,
    frame: &wgpu::BindGroupLayout,
    format: wgpu::TextureFormat,
    samples: u32,
) -> wgpu::RenderPipeline {
    let buffers = [Some(wgpu::VertexBufferLayout {
        array_stride: 16,
        step_mode: wgpu::VertexStepMode::Instance,
        attributes: &POINT,
    })];
    let module = shader_module(device, "points", &points_module());
    plain(
        device,
        Plain {
            label: "points",
            layout: frame,
            module: &module,
            entry_points: ["point_vertex", "point_fragment"],
            buffers: &buffers,
            topology: wgpu::PrimitiveTopology::TriangleStrip,
            depth: depth(true),
            format,
            samples,
        },
    )
}

fn error(device: &wgpu::Device, format: wgpu::TextureFormat, samples: u32) -> wgpu::RenderPipeline {
    let module = shader_module(device, "error", &error_module());
    plain(
        device,
        Plain {
            label: "error",
            layout: &layouts::error(device),
            module: &module,
            entry_points: ["error_vertex", "error_fragment"],
            buffers: &[],
            topology: wgpu::PrimitiveTopology::TriangleList,
            depth: wgpu::DepthStencilState {
                depth_compare: Some(wgpu::CompareFunction::Always),
                ..depth(false)
            },
            format,
            samples,
        },
    )
}

struct Plain<'a> {
    label: &'a str,
    layout: &'a wgpu::BindGroupLayout,
    module: &'a wgpu::ShaderModule,
    entry_points: [&'a str; 2],
    buffers: &'a [Option<wgpu::VertexBufferLayout<'a>>],
    topology: wgpu::PrimitiveTopology,
    depth: wgpu::DepthStencilState,
    format: wgpu::TextureFormat,
    samples: u32,
}

/// A pipeline with one group and without options.
fn plain(device: &wgpu::Device, p: Plain<'_>) -> wgpu::RenderPipeline {
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(p.label),
        bind_group_layouts: &[Some(p.layout)],
        immediate_size: 0,
    });
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(p.label),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: p.module,
            entry_point: Some(p.entry_points[0]),
            compilation_options: Default::default(),
            buffers: p.buffers,
        },
        primitive: wgpu::PrimitiveState { topology: p.topology, ..Default::default() },
        depth_stencil: Some(p.depth),
        multisample: multisample(p.samples),
        fragment: Some(wgpu::FragmentState {
            module: p.module,
            entry_point: Some(p.entry_points[1]),
            compilation_options: Default::default(),
            targets: &[Some(p.format.into())],
        }),
        multiview_mask: None,
        cache: None,
    })
}

/// The pipelines of shadow maps.
#[derive(Debug)]
pub(super) struct CasterPipelines {
    pub(super) solid: wgpu::RenderPipeline,
    pub(super) masked: wgpu::RenderPipeline,
    /// Empties the viewport.
    pub(super) clear: wgpu::RenderPipeline,
}

impl CasterPipelines {
    pub(super) fn new(gpu: &Gpu) -> CasterPipelines {
        let device = &gpu.device;
        let module = shader_module(device, "casters", &caster_module());
        let groups = [layouts::face(device), layouts::material(device), layouts::surface(device)];
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("casters"),
            bind_group_layouts: &groups.each_ref().map(Some),
            immediate_size: 0,
        });
        let make = |masked: bool| {
            device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some("casters"),
                layout: Some(&layout),
                vertex: wgpu::VertexState {
                    module: &module,
                    entry_point: Some(if masked { "caster_masked" } else { "caster_solid" }),
                    compilation_options: Default::default(),
                    buffers: &vertex_layouts(masked),
                },
                // Both sides cast.
                primitive: wgpu::PrimitiveState::default(),
                depth_stencil: Some(depth(true)),
                multisample: multisample(1),
                fragment: masked.then(|| wgpu::FragmentState {
                    module: &module,
                    entry_point: Some("caster_holes"),
                    compilation_options: Default::default(),
                    targets: &[],
                }),
                multiview_mask: None,
                cache: None,
            })
        };
        CasterPipelines { solid: make(false), masked: make(true), clear: clear(device) }
    }

    /// Whether a material whose alpha is the same everywhere is one hole.
    pub(super) fn is_hole(&self, scene: &Scene, material: u32) -> bool {
        let material = &scene.materials[material as usize];
        let cutoff = match material.alpha_mode {
            AlphaMode::Opaque => return false,
            AlphaMode::Mask { cutoff } => cutoff,
            AlphaMode::Blend => 0.5,
        };
        // Texture coordinates are zero where there are none.
        let uv = [glam::Vec2::ZERO; 2];
        crate::texture::base_color(scene, material, &uv, glam::Vec4::ONE).w < cutoff
    }
}

fn clear(device: &wgpu::Device) -> wgpu::RenderPipeline {
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("clear"),
        bind_group_layouts: &[],
        immediate_size: 0,
    });
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("clear"),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: &shader_module(device, "clear", CLEAR_WGSL),
            entry_point: Some("clear_vertex"),
            compilation_options: Default::default(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: Some(wgpu::DepthStencilState {
            depth_compare: Some(wgpu::CompareFunction::Always),
            ..depth(true)
        }),
        multisample: multisample(1),
        fragment: None,
        multiview_mask: None,
        cache: None,
    })
}
