//! One frame: shadow maps, then all views of it in one pass.

use dapple_gpu::{Gpu, wgpu};
use dapple_scene::AlphaMode;

use super::ForwardError;
use super::inputs::{Drawn, FrameInputs, Transparency, View, ViewKind};
use super::layouts::{self, Growing};
use super::lookup::{Lookup, LookupId, built_in};
use super::pipelines::{CasterPipelines, DEPTH_FORMAT, PipelineKey, Pipelines, Stage};
use super::scene::{CHARTS_SLOT, DETAIL_SLOT, GEOMETRY_SLOT, GpuScene, INSTANCE_SLOT, is_outside};
use super::shadow::{FrameLights, ShadowAtlas, runs};
use super::uniforms::{FrameUniform, InstanceRaw, LightsUniform};
use super::view::{ViewCamera, background, frame_uniform, inspection_background};
use crate::gbuffer::check_scene;

/// Bytes between the uniforms of two views.
pub(super) const FRAME_STRIDE: usize = 256;

/// The forward pass for one format of target. Keeps what it makes from frame to frame.
#[derive(Debug)]
pub struct Forward {
    format: wgpu::TextureFormat,
    samples: u32,
    pub(super) pipelines: Pipelines,
    casters: CasterPipelines,
    lookup_groups: Vec<Option<wgpu::BindGroup>>,
    needs_group: Vec<bool>,
    pub(super) frame_layout: wgpu::BindGroupLayout,
    error_layout: wgpu::BindGroupLayout,
    frames: Growing,
    pub(super) lights: Growing,
    frame_group: wgpu::BindGroup,
    pub(super) shadows: ShadowAtlas,
    targets: Option<Targets>,
    comparison: Option<Comparison>,
}

/// What a picture of one size needs beside itself.
#[derive(Debug)]
struct Targets {
    size: (u32, u32),
    depth: wgpu::TextureView,
    /// Where there are several samples a pixel.
    color: Option<wgpu::TextureView>,
}

/// The two pictures of visibility that an error view compares.
#[derive(Debug)]
struct Comparison {
    size: (u32, u32),
    pictures: [wgpu::TextureView; 2],
    group: wgpu::BindGroup,
}

/// One draw call.
#[derive(Clone, Copy)]
pub(super) struct Draw {
    key: PipelineKey,
    mesh: usize,
    part: usize,
    first: u32,
    end: u32,
}

/// What a list of draw calls is for.
#[derive(Clone, Copy)]
pub(super) struct Wants {
    pub(super) stage: Stage,
    /// Whether materials whose alpha is blended are mixed, not cut out.
    pub(super) blends: bool,
    pub(super) inspects: bool,
}

/// A view that shows the difference of two look-ups, and what each of them draws.
struct Compared<'a> {
    view: &'a View<'a>,
    camera: &'a ViewCamera,
    lists: [Vec<Draw>; 2],
}

impl Forward {
    /// Prepares to draw into views of `format` (a plain one: colours are encoded already) with 1 or 4 `samples` a pixel. The
    /// look-ups are [`LookupId::NONE`], [`LookupId::ATLAS`], and `lookups` as [`LookupId::added`].
    ///
    /// # Errors
    /// Another number of samples, or a format that encodes by itself.
    pub fn new(
        gpu: &Gpu,
        format: wgpu::TextureFormat,
        samples: u32,
        lookups: &[Lookup],
    ) -> Result<Forward, ForwardError> {
        if samples != 1 && samples != 4 {
            return Err(ForwardError::Frame { reason: "a pixel has 1 or 4 samples" });
        }
        if format.is_srgb() {
            let reason = "the target encodes by itself: draw into its view of the plain format";
            return Err(ForwardError::Frame { reason });
        }
        let mut all = built_in();
        all.extend_from_slice(lookups);
        let uniform = wgpu::BufferUsages::UNIFORM;
        let frames = Growing::new(&gpu.device, "frames", 2 * FRAME_STRIDE as u64, uniform);
        let lights = Growing::new(&gpu.device, "lights", size_of::<LightsUniform>() as u64, uniform);
        let shadows = ShadowAtlas::new(gpu);
        let frame_layout = layouts::frame(&gpu.device);
        Ok(Forward {
            format,
            samples,
            pipelines: Pipelines::new(gpu, format, samples, &all),
            casters: CasterPipelines::new(gpu),
            lookup_groups: vec![None; all.len()],
            needs_group: all.iter().map(|lookup| lookup.layout.is_some()).collect(),
            frame_group: frame_group(gpu, &frame_layout, &frames.buffer, &lights, &shadows),
            error_layout: layouts::error(&gpu.device),
            frame_layout,
            frames,
            lights,
            shadows,
            targets: None,
            comparison: None,
        })
    }

    /// Gives a look-up its group 3.
    pub fn bind_lookup(&mut self, lookup: LookupId, group: wgpu::BindGroup) {
        if let Some(slot) = self.lookup_groups.get_mut(lookup.0) {
            *slot = Some(group);
        }
    }

    /// Format of the targets it draws to.
    pub fn format(&self) -> wgpu::TextureFormat {
        self.format
    }

    /// Records a frame into `target`, which is `size` pixels large. Colours are display codes, alpha is 1.
    ///
    /// # Errors
    /// A pose of another scene, a camera that cannot project, a look-up that is not there or has no group, no view at all,
    /// or a rectangle outside of the picture. Then nothing is recorded.
    pub fn draw(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        target: &wgpu::TextureView,
        size: (u32, u32),
        scene: &mut GpuScene,
        inputs: &FrameInputs<'_>,
    ) -> Result<Drawn, ForwardError> {
        let host = scene.scene().clone();
        check_scene(&host, inputs.pose)?;
        self.check(gpu, size, inputs.views)?;
        let cameras = inputs.views.iter().zip(0..).map(|(view, index)| ViewCamera::new(view, index, size));
        let cameras = cameras.collect::<Result<Vec<_>, _>>()?;

        scene.place(gpu, inputs.pose);
        let clips: Vec<_> = cameras.iter().map(|camera| camera.clip_from_world).collect();
        let lights = FrameLights::new(gpu, scene, inputs.pose, inputs.shade, &clips);
        let shadows = self.shadows.draw(gpu, encoder, scene, &lights, &self.casters);
        if shadows.is_another_texture {
            self.frame_group =
                frame_group(gpu, &self.frame_layout, &self.frames.buffer, &self.lights, &self.shadows);
        }
        self.lights.write(gpu, bytemuck::bytes_of(&*lights.uniform));
        self.write_frames(gpu, inputs, &cameras, (lights.count, scene.area_lights.code()));
        self.prepare_targets(gpu, size);

        let mut drawn =
            Drawn { ignored_lights: lights.ignored, shadow_faces: shadows.faces, ..Drawn::default() };
        let mut lists = Vec::with_capacity(inputs.views.len());
        let mut compared = Vec::new();
        for (view, camera) in inputs.views.iter().zip(&cameras) {
            let wants = |lookup: LookupId| Wants {
                stage: Stage::Picture(lookup.0),
                blends: inputs.transparency == Transparency::Blend && view.kind.is_lit(),
                inspects: !view.kind.is_lit(),
            };
            let list = self.list(gpu, scene, camera, wants(view.lookup));
            if let ViewKind::Error { other } = view.kind {
                let other = self.list(gpu, scene, camera, wants(other));
                compared.push(Compared { view, camera, lists: [list.clone(), other] });
            }
            lists.push(list);
        }
        self.draw_comparisons(gpu, encoder, size, scene, &compared);
        let mut pass = self.begin(encoder, target, background(inputs));
        for ((view, camera), list) in inputs.views.iter().zip(&cameras).zip(&lists) {
            camera.apply(&mut pass, view);
            if let (ViewKind::Error { .. }, Some(comparison)) = (view.kind, &self.comparison) {
                pass.set_pipeline(&self.pipelines.error);
                pass.set_bind_group(0, &comparison.group, &[]);
                pass.draw(0..3, 0..1);
                drawn.draws += 1;
                continue;
            }
            let (draws, triangles) = self.run(&mut pass, scene, &self.frame_group, camera, list);
            drawn.draws += draws;
            drawn.triangles += triangles;
            if let (ViewKind::Points, Some(points)) =
                (view.kind, view.points.filter(|points| points.count > 0))
            {
                pass.set_pipeline(&self.pipelines.points);
                pass.set_vertex_buffer(0, points.buffer.buffer.slice(..));
                pass.draw(0..4, 0..points.count);
                drawn.draws += 1;
            }
        }
        drop(pass);
        Ok(drawn)
    }

    fn check(&self, gpu: &Gpu, size: (u32, u32), views: &[View<'_>]) -> Result<(), ForwardError> {
        let largest = gpu.device.limits().max_texture_dimension_2d;
        let sides = 1..=largest;
        if !sides.contains(&size.0) || !sides.contains(&size.1) {
            return Err(ForwardError::Frame {
                reason: "the picture has no pixels, or more than the device allows",
            });
        }
        if views.is_empty() {
            return Err(ForwardError::Frame { reason: "there is no view: give at least one" });
        }
        for view in views {
            let mut lookups = vec![view.lookup];
            if let ViewKind::Error { other } = view.kind {
                lookups.push(other);
            }
            for lookup in lookups {
                match (self.needs_group.get(lookup.0), self.lookup_groups.get(lookup.0)) {
                    (Some(true), Some(None)) => {
                        let reason = "a look-up has no group yet: give it one by bind_lookup";
                        return Err(ForwardError::Frame { reason });
                    }
                    (None, _) => {
                        let reason = "there is no such look-up: give it to Forward::new";
                        return Err(ForwardError::Frame { reason });
                    }
                    _ => {}
                }
            }
            for rect in [view.viewport, view.scissor].into_iter().flatten() {
                let fits = |first: u32, extent: u32, side: u32| {
                    extent > 0 && first.checked_add(extent).is_some_and(|end| end <= side)
                };
                if !fits(rect.x, rect.width, size.0) || !fits(rect.y, rect.height, size.1) {
                    return Err(ForwardError::Frame { reason: "a viewport or scissor leaves the picture" });
                }
            }
        }
        Ok(())
    }

    fn write_frames(
        &mut self,
        gpu: &Gpu,
        inputs: &FrameInputs<'_>,
        cameras: &[ViewCamera],
        (light_count, area_lights): (u32, u32),
    ) {
        let mut bytes = vec![0u8; FRAME_STRIDE * cameras.len()];
        let views = inputs.views.iter().zip(cameras);
        for (slot, (view, camera)) in bytes.chunks_exact_mut(FRAME_STRIDE).zip(views) {
            let uniform = frame_uniform(inputs, view, camera, light_count, area_lights);
            slot[..size_of::<FrameUniform>()].copy_from_slice(bytemuck::bytes_of(&uniform));
        }
        if self.frames.write(gpu, &bytes) {
            self.frame_group =
                frame_group(gpu, &self.frame_layout, &self.frames.buffer, &self.lights, &self.shadows);
        }
    }

    fn prepare_targets(&mut self, gpu: &Gpu, size: (u32, u32)) {
        if self.targets.as_ref().is_some_and(|targets| targets.size == size) {
            return;
        }
        let attachment = |format| {
            let texture = texture(gpu, size, format, self.samples, wgpu::TextureUsages::RENDER_ATTACHMENT);
            texture.create_view(&wgpu::TextureViewDescriptor::default())
        };
        self.targets = Some(Targets {
            size,
            depth: attachment(DEPTH_FORMAT),
            color: (self.samples > 1).then(|| attachment(self.format)),
        });
    }

    fn begin<'e>(
        &self,
        encoder: &'e mut wgpu::CommandEncoder,
        target: &wgpu::TextureView,
        clear: wgpu::Color,
    ) -> wgpu::RenderPass<'e> {
        let targets = self.targets.as_ref();
        let color = targets.and_then(|targets| targets.color.as_ref());
        let color_ops = wgpu::Operations {
            load: wgpu::LoadOp::Clear(clear),
            store: if color.is_some() { wgpu::StoreOp::Discard } else { wgpu::StoreOp::Store },
        };
        let depth = targets.map(|targets| wgpu::RenderPassDepthStencilAttachment {
            view: &targets.depth,
            depth_ops: Some(wgpu::Operations {
                load: wgpu::LoadOp::Clear(0.0),
                store: wgpu::StoreOp::Discard,
            }),
            stencil_ops: None,
        });
        encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("forward"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: color.unwrap_or(target),
                depth_slice: None,
                resolve_target: color.map(|_| target),
                ops: color_ops,
            })],
            depth_stencil_attachment: depth,
            ..Default::default()
        })
    }

    /// The draw calls of one view, opaque ones first; their pipelines are made.
    pub(super) fn list(
        &mut self,
        gpu: &Gpu,
        scene: &GpuScene,
        camera: &ViewCamera,
        wants: Wants,
    ) -> Vec<Draw> {
        let draws_area_lights =
            matches!(wants.stage, Stage::Picture(_)) && !wants.inspects && scene.area_lights.is_lit();
        let mut opaque: Vec<(f32, Draw)> = Vec::new();
        let mut blended: Vec<(f32, Draw)> = Vec::new();
        for batch in &scene.batches {
            let mesh = &scene.meshes[batch.mesh];
            let seen = |slot: u32| {
                !is_outside(&scene.bounds.world[scene.instance_at(slot)], &camera.clip_from_world)
            };
            for (first, end) in runs(batch.first, batch.count, seen) {
                let distance =
                    |slot: u32| camera.distance(scene.bounds.world[scene.instance_at(slot)].center());
                let nearest = (first..end).map(distance).fold(f32::INFINITY, f32::min);
                for (part, range) in mesh.parts.iter().enumerate() {
                    let material = &scene.materials[range.material as usize];
                    let is_blended = wants.blends && material.alpha == AlphaMode::Blend;
                    let key = PipelineKey {
                        stage: wants.stage,
                        detailed: mesh.detail.is_some(),
                        mirrored: batch.mirrored,
                        two_sided: material.two_sided,
                        cuts_holes: !is_blended && material.alpha != AlphaMode::Opaque,
                        blends: is_blended,
                        inspects: wants.inspects,
                        area_lights: draws_area_lights,
                    };
                    self.pipelines.prepare(gpu, key);
                    let draw = Draw { key, mesh: batch.mesh, part, first, end };
                    if is_blended {
                        let one = |slot| (distance(slot), Draw { first: slot, end: slot + 1, ..draw });
                        blended.extend((first..end).map(one));
                    } else {
                        opaque.push((nearest, draw));
                    }
                }
            }
        }
        // What is near hides what is far, whose light then need not be worked out: that costs more than what changing
        // from one pipeline to another does.
        opaque.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.key.cmp(&b.1.key)));
        blended.sort_by(|a, b| b.0.total_cmp(&a.0));
        opaque.into_iter().chain(blended).map(|(_, draw)| draw).collect()
    }

    /// Draws a list; returns the number of calls and of triangles.
    pub(super) fn run(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        scene: &GpuScene,
        frame_group: &wgpu::BindGroup,
        camera: &ViewCamera,
        list: &[Draw],
    ) -> (u32, u64) {
        pass.set_bind_group(0, frame_group, &[camera.index * FRAME_STRIDE as u32]);
        pass.set_bind_group(2, &scene.group, &[]);
        let lookup = list.first().and_then(|draw| match draw.key.stage {
            Stage::Picture(lookup) => self.lookup_groups[lookup].as_ref(),
            Stage::Geometry | Stage::Depths | Stage::Hidden => None,
        });
        if let Some(group) = lookup {
            pass.set_bind_group(3, group, &[]);
        }
        let stride = size_of::<InstanceRaw>() as u64;
        let (mut draws, mut triangles) = (0, 0);
        let mut last: Option<Draw> = None;
        for draw in list {
            let Some(pipeline) = self.pipelines.get(draw.key) else { continue };
            if last.is_none_or(|last| last.key != draw.key) {
                pass.set_pipeline(pipeline);
            }
            let mesh = &scene.meshes[draw.mesh];
            if last.is_none_or(|last| last.mesh != draw.mesh || last.key.detailed != draw.key.detailed) {
                pass.set_vertex_buffer(GEOMETRY_SLOT, mesh.geometry.slice(..));
                pass.set_vertex_buffer(CHARTS_SLOT, mesh.charts.slice(..));
                if let Some(detail) = &mesh.detail {
                    pass.set_vertex_buffer(DETAIL_SLOT, detail.slice(..));
                }
                pass.set_index_buffer(mesh.indices.slice(..), wgpu::IndexFormat::Uint32);
            }
            // WebGL2 has no base instance: the buffer is sliced instead.
            let range = u64::from(draw.first) * stride..u64::from(draw.end) * stride;
            pass.set_vertex_buffer(INSTANCE_SLOT, scene.instance_buffer.buffer.slice(range));
            let part = &mesh.parts[draw.part];
            pass.set_bind_group(1, &scene.materials[part.material as usize].group, &[]);
            let (first, count) = (3 * part.first_triangle, 3 * part.triangle_count);
            pass.draw_indexed(first..first + count, 0, 0..draw.end - draw.first);
            draws += 1;
            triangles += u64::from(part.triangle_count) * u64::from(draw.end - draw.first);
            last = Some(*draw);
        }
        (draws, triangles)
    }

    /// Draws visibility by two look-ups into pictures of their own, which all views share: each pass clears its picture,
    /// so one pass draws all of them.
    fn draw_comparisons(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        size: (u32, u32),
        scene: &GpuScene,
        compared: &[Compared<'_>],
    ) {
        if compared.is_empty() {
            return;
        }
        if self.comparison.as_ref().is_none_or(|comparison| comparison.size != size) {
            let pictures = [(); 2].map(|()| {
                let usage = wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING;
                texture(gpu, size, self.format, 1, usage).create_view(&wgpu::TextureViewDescriptor::default())
            });
            let resources = pictures.each_ref().map(wgpu::BindingResource::TextureView);
            let group = layouts::group(&gpu.device, &self.error_layout, &resources);
            self.comparison = Some(Comparison { size, pictures, group });
        }
        let Some(comparison) = &self.comparison else { return };
        for (which, picture) in comparison.pictures.iter().enumerate() {
            let mut pass = self.begin(encoder, picture, inspection_background());
            for Compared { view, camera, lists } in compared {
                camera.apply(&mut pass, view);
                self.run(&mut pass, scene, &self.frame_group, camera, &lists[which]);
            }
        }
    }
}

fn texture(
    gpu: &Gpu,
    (width, height): (u32, u32),
    format: wgpu::TextureFormat,
    sample_count: u32,
    usage: wgpu::TextureUsages,
) -> wgpu::Texture {
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("forward"),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage,
        view_formats: &[],
    })
}

pub(super) fn frame_group(
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
    frames: &wgpu::Buffer,
    lights: &Growing,
    shadows: &ShadowAtlas,
) -> wgpu::BindGroup {
    let frame = wgpu::BufferBinding {
        buffer: frames,
        offset: 0,
        size: std::num::NonZeroU64::new(FRAME_STRIDE as u64),
    };
    let resources = [
        wgpu::BindingResource::Buffer(frame),
        lights.buffer.as_entire_binding(),
        wgpu::BindingResource::TextureView(&shadows.view),
        wgpu::BindingResource::Sampler(&shadows.sampler),
    ];
    layouts::group(&gpu.device, layout, &resources)
}
