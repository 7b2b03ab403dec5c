//! One frame: shadow maps, then all views of it in one pass.

use dapple_gpu::{Gpu, wgpu};
use dapple_scene::{AlphaMode, Pose, PosedCamera, Projection};
use glam::{DMat4, DVec3, Mat4, Vec3};

use super::ForwardError;
use super::layouts::{self, Growing};
use super::lookup::{Lookup, LookupId, built_in};
use super::pipelines::{CasterPipelines, DEPTH_FORMAT, PipelineKey, Pipelines};
use super::points::GpuPoints;
use super::scene::{CHARTS_SLOT, DETAIL_SLOT, GEOMETRY_SLOT, GpuScene, INSTANCE_SLOT, is_outside};
use super::shadow::{FrameLights, ShadowAtlas, runs};
use super::uniforms::{FrameUniform, InstanceRaw, LightsUniform};
use crate::compose::{BACKGROUND_RGB8, PointsView};
use crate::gbuffer::check_scene;
use crate::image::{ToneCurve, ToneMap};
use crate::projection;
use crate::shade::{Ambient, ShadeParams};

/// Bytes between the uniforms of two views.
const FRAME_STRIDE: usize = 256;

/// What a view shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ViewKind {
    /// The lit scene.
    #[default]
    Beauty,
    /// Visibility as gray without an sRGB curve, white is open.
    Visibility,
    /// Shading normals in the world as colours.
    Normal,
    /// The points over a dimmed lit scene, in the shade of their values (see [`View::points`]).
    Points,
    /// Texels of the atlas: charts in different colours, shaded by visibility.
    Texels,
    /// Of each texel how much the heaviest point weighs (red) and how many there are (green).
    Weights,
    /// Time since the value of a texel last changed: yellow is new.
    Age,
    /// Absolute difference of this view's look-up and another's.
    Error {
        /// The other.
        other: LookupId,
    },
}

impl ViewKind {
    /// `VIEW_` constant of `frame.wgsl`.
    fn code(self) -> u32 {
        match self {
            ViewKind::Beauty | ViewKind::Points => 0,
            ViewKind::Visibility | ViewKind::Error { .. } => 1,
            ViewKind::Normal => 2,
            ViewKind::Texels => 3,
            ViewKind::Weights => 4,
            ViewKind::Age => 5,
        }
    }

    fn is_lit(self) -> bool {
        matches!(self, ViewKind::Beauty | ViewKind::Points)
    }
}

/// How materials are drawn whose alpha is blended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Transparency {
    /// Mixed with what is behind, from back to front by the instances' centres, after all else.
    #[default]
    Blend,
    /// Cut out where alpha is below one half, as the twin does.
    Cutout,
}

/// A part of the picture, pixels from the top left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rect {
    /// First column.
    pub x: u32,
    /// First row.
    pub y: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

/// One look at the scene: a picture has one, two side by side, or one over a part of another.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// From where.
    pub camera: PosedCamera,
    /// The part of the picture that the camera's picture fills; the whole by default.
    pub viewport: Option<Rect>,
    /// The part of the picture that may change; the viewport by default.
    pub scissor: Option<Rect>,
    /// What is shown.
    pub kind: ViewKind,
    /// How visibility is found.
    pub lookup: LookupId,
    /// What [`ViewKind::Points`] shows.
    pub points: Option<&'a GpuPoints>,
}

impl View<'_> {
    /// The lit scene over the whole picture.
    pub fn new(camera: PosedCamera, lookup: LookupId) -> View<'static> {
        View { camera, viewport: None, scissor: None, kind: ViewKind::Beauty, lookup, points: None }
    }
}

/// What one frame shows.
#[derive(Clone, Copy, Debug)]
pub struct FrameInputs<'a> {
    /// The scene's pose; [`dapple_scene::Scene::pose_undeformed`] suffices.
    pub pose: &'a Pose,
    /// Lights, ambient, shadow maps.
    pub shade: &'a ShadeParams,
    /// Radiance to display.
    pub tone_map: ToneMap,
    /// Of materials whose alpha is blended.
    pub transparency: Transparency,
    /// From old values of visibility (0) to new ones (1).
    pub fade: f32,
    /// In the order they are drawn, at least one. All share the background of the first.
    pub views: &'a [View<'a>],
}

/// What a frame came to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Drawn {
    /// Draw calls of the picture (not of shadow maps).
    pub draws: u32,
    /// Triangles handed to the card for the picture, before clipping.
    pub triangles: u64,
    /// Lights that were left out because there are more than [`super::MAX_LIGHTS`].
    pub ignored_lights: u32,
}

/// The forward pass for one format of target. Keeps what it makes from frame to frame.
#[derive(Debug)]
pub struct Forward {
    format: wgpu::TextureFormat,
    samples: u32,
    pipelines: Pipelines,
    casters: CasterPipelines,
    lookup_groups: Vec<Option<wgpu::BindGroup>>,
    needs_group: Vec<bool>,
    frame_layout: wgpu::BindGroupLayout,
    error_layout: wgpu::BindGroupLayout,
    frames: Growing,
    lights: Growing,
    frame_group: wgpu::BindGroup,
    shadows: ShadowAtlas,
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
struct Draw {
    key: PipelineKey,
    mesh: usize,
    part: usize,
    first: u32,
    end: u32,
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
            frame_group: frame_group(gpu, &frame_layout, &frames, &lights, &shadows),
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
        let lights = FrameLights::new(gpu, scene, inputs.pose, inputs.shade);
        if self.shadows.draw(gpu, encoder, scene, &lights, &self.casters) {
            self.frame_group =
                frame_group(gpu, &self.frame_layout, &self.frames, &self.lights, &self.shadows);
        }
        self.lights.write(gpu, bytemuck::bytes_of(&*lights.uniform));
        self.write_frames(gpu, inputs, &cameras, lights.count);
        self.prepare_targets(gpu, size);

        let mut drawn = Drawn { ignored_lights: lights.ignored, ..Drawn::default() };
        let mut lists = Vec::with_capacity(inputs.views.len());
        for (view, camera) in inputs.views.iter().zip(&cameras) {
            let list = self.list(gpu, scene, inputs, view, camera, view.lookup);
            if let ViewKind::Error { other } = view.kind {
                let other = self.list(gpu, scene, inputs, view, camera, other);
                self.draw_comparison(gpu, encoder, size, scene, view, camera, [&list, &other]);
            }
            lists.push(list);
        }
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
            let (draws, triangles) = self.run(&mut pass, scene, camera, list);
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
        light_count: u32,
    ) {
        let mut bytes = vec![0u8; FRAME_STRIDE * cameras.len()];
        let views = inputs.views.iter().zip(cameras);
        for (slot, (view, camera)) in bytes.chunks_exact_mut(FRAME_STRIDE).zip(views) {
            let uniform = frame_uniform(inputs, view, camera, light_count);
            slot[..size_of::<FrameUniform>()].copy_from_slice(bytemuck::bytes_of(&uniform));
        }
        if self.frames.write(gpu, &bytes) {
            self.frame_group =
                frame_group(gpu, &self.frame_layout, &self.frames, &self.lights, &self.shadows);
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
    fn list(
        &mut self,
        gpu: &Gpu,
        scene: &GpuScene,
        inputs: &FrameInputs<'_>,
        view: &View<'_>,
        camera: &ViewCamera,
        lookup: LookupId,
    ) -> Vec<Draw> {
        let mut opaque = Vec::new();
        let mut blended: Vec<(f32, Draw)> = Vec::new();
        let blends = inputs.transparency == Transparency::Blend && view.kind.is_lit();
        for batch in &scene.batches {
            let mesh = &scene.meshes[batch.mesh];
            let seen = |slot: u32| {
                !is_outside(&scene.bounds.world[scene.instance_at(slot)], &camera.clip_from_world)
            };
            for (first, end) in runs(batch.first, batch.count, seen) {
                for (part, range) in mesh.parts.iter().enumerate() {
                    let material = &scene.materials[range.material as usize];
                    let is_blended = blends && material.alpha == AlphaMode::Blend;
                    let key = PipelineKey {
                        lookup: lookup.0,
                        detailed: mesh.detail.is_some(),
                        mirrored: batch.mirrored,
                        two_sided: material.two_sided,
                        cuts_holes: !is_blended && material.alpha != AlphaMode::Opaque,
                        blends: is_blended,
                        inspects: !view.kind.is_lit(),
                    };
                    self.pipelines.prepare(gpu, key);
                    let draw = Draw { key, mesh: batch.mesh, part, first, end };
                    if is_blended {
                        blended.extend((first..end).map(|slot| {
                            let center = scene.bounds.world[scene.instance_at(slot)].center();
                            let distance = camera.distance(center);
                            (distance, Draw { first: slot, end: slot + 1, ..draw })
                        }));
                    } else {
                        opaque.push(draw);
                    }
                }
            }
        }
        opaque.sort_by_key(|draw| draw.key);
        blended.sort_by(|a, b| b.0.total_cmp(&a.0));
        opaque.extend(blended.into_iter().map(|(_, draw)| draw));
        opaque
    }

    /// Draws a list; returns the number of calls and of triangles.
    fn run(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        scene: &GpuScene,
        camera: &ViewCamera,
        list: &[Draw],
    ) -> (u32, u64) {
        pass.set_bind_group(0, &self.frame_group, &[camera.index * FRAME_STRIDE as u32]);
        pass.set_bind_group(2, &scene.group, &[]);
        if let Some(group) = list.first().and_then(|draw| self.lookup_groups[draw.key.lookup].as_ref()) {
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

    /// Draws visibility by two look-ups into pictures of their own.
    #[allow(clippy::too_many_arguments, reason = "two pictures of one view")]
    fn draw_comparison(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        size: (u32, u32),
        scene: &GpuScene,
        view: &View<'_>,
        camera: &ViewCamera,
        lists: [&Vec<Draw>; 2],
    ) {
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
        for (picture, list) in comparison.pictures.iter().zip(lists) {
            let mut pass = self.begin(encoder, picture, inspection_background());
            camera.apply(&mut pass, view);
            self.run(&mut pass, scene, camera, list);
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

fn frame_group(
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
    frames: &Growing,
    lights: &Growing,
    shadows: &ShadowAtlas,
) -> wgpu::BindGroup {
    let frame = wgpu::BufferBinding {
        buffer: &frames.buffer,
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

fn inspection_background() -> wgpu::Color {
    let [r, g, b] = BACKGROUND_RGB8.map(|c| f64::from(c) / 255.0);
    wgpu::Color { r, g, b, a: 1.0 }
}

/// What is seen where there is no surface, as displayed.
fn background(inputs: &FrameInputs<'_>) -> wgpu::Color {
    let kind = inputs.views.first().map_or(ViewKind::Beauty, |view| view.kind);
    if !kind.is_lit() {
        return inspection_background();
    }
    let dim = f64::from(dim(kind));
    let [r, g, b] = inputs.tone_map.map(inputs.shade.background).to_array().map(|linear| {
        let linear = f64::from(linear);
        let code =
            if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * libm::pow(linear, 1.0 / 2.4) - 0.055 };
        code * dim
    });
    wgpu::Color { r, g, b, a: 1.0 }
}

fn dim(kind: ViewKind) -> f32 {
    if kind == ViewKind::Points { PointsView::default().dim } else { 1.0 }
}

fn frame_uniform(
    inputs: &FrameInputs<'_>,
    view: &View<'_>,
    camera: &ViewCamera,
    light_count: u32,
) -> FrameUniform {
    let shade = inputs.shade;
    let (sky, ground) = match shade.ambient {
        Ambient::Constant(radiance) => (radiance, radiance),
        Ambient::Hemisphere { sky, ground } => (sky, ground),
    };
    let radius_px = PointsView::default().radius_px;
    let viewport = camera.viewport;
    FrameUniform {
        clip_from_relative: camera.clip_from_relative.to_cols_array_2d(),
        eye_world: camera.eye_world.to_array(),
        view: view.kind.code(),
        axis_world: camera.axis_world.to_array(),
        is_parallel: u32::from(camera.is_parallel),
        ambient_sky: sky.to_array(),
        exposure: inputs.tone_map.exposure,
        ambient_ground: ground.to_array(),
        tone_curve: match inputs.tone_map.curve {
            ToneCurve::Clamp => 0,
            ToneCurve::Reinhard => 1,
            ToneCurve::Filmic => 2,
        },
        fade: inputs.fade.clamp(0.0, 1.0),
        specular: u32::from(shade.specular),
        light_count,
        dim: dim(view.kind),
        point_half: [radius_px / viewport.width as f32, radius_px / viewport.height as f32],
        point_half_m: radius_px * camera.pixel_m,
        pad: 0.0,
    }
}

/// A view's camera as the pass uses it.
struct ViewCamera {
    index: u32,
    viewport: Rect,
    clip_from_world: Mat4,
    clip_from_relative: Mat4,
    eye_world: Vec3,
    axis_world: Vec3,
    is_parallel: bool,
    /// Metres a pixel at distance 1 (perspective) or anywhere (parallel).
    pixel_m: f32,
}

impl ViewCamera {
    fn new(view: &View<'_>, index: u32, size: (u32, u32)) -> Result<ViewCamera, ForwardError> {
        let viewport = view.viewport.unwrap_or(Rect { x: 0, y: 0, width: size.0, height: size.1 });
        let camera = &view.camera;
        let clip_from_world = projection::clip_from_world(camera, viewport.width, viewport.height)?;
        let eye_world = camera.eye_world();
        let eye = DVec3::new(f64::from(eye_world.x), f64::from(eye_world.y), f64::from(eye_world.z));
        let (is_parallel, half) = match camera.projection {
            Projection::Perspective { yfov, .. } => (false, libm::tanf(0.5 * yfov)),
            Projection::Orthographic { half_height, .. } => (true, half_height),
        };
        Ok(ViewCamera {
            index,
            viewport,
            clip_from_world: clip_from_world.as_mat4(),
            clip_from_relative: (clip_from_world * DMat4::from_translation(eye)).as_mat4(),
            eye_world,
            axis_world: camera.world_from_view.transform_vector3(Vec3::Z).normalize_or_zero(),
            is_parallel,
            pixel_m: 2.0 * half / viewport.height as f32,
        })
    }

    /// How far away a place is, metres.
    fn distance(&self, world: Vec3) -> f32 {
        let offset = self.eye_world - world;
        if self.is_parallel { offset.dot(self.axis_world) } else { offset.length() }
    }

    fn apply(&self, pass: &mut wgpu::RenderPass<'_>, view: &View<'_>) {
        let v = self.viewport;
        pass.set_viewport(v.x as f32, v.y as f32, v.width as f32, v.height as f32, 0.0, 1.0);
        let s = view.scissor.unwrap_or(v);
        pass.set_scissor_rect(s.x, s.y, s.width, s.height);
    }
}
