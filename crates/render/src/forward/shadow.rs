//! Shadow maps on the card: faces in the layers of one depth texture. A face is drawn again only when something that it
//! sees has moved, and only while something that it may darken is in the picture.

use dapple_gpu::{Gpu, wgpu};
use dapple_scene::{Aabb, AlphaMode, LightKind, Pose};
use glam::{Affine3A, DMat4, Mat4, Vec3};

use super::layouts::{self, Growing};
use super::pipelines::CasterPipelines;
use super::scene::{CHARTS_SLOT, DETAIL_SLOT, GEOMETRY_SLOT, GpuScene, INSTANCE_SLOT, is_outside};
use super::uniforms::{FaceUniform, LightUniform, LightsUniform, MAX_FACES, MAX_LIGHTS, rows};
use crate::projection;
use crate::shade::{ActiveLight, Face, Lens, ShadeParams, active_lights, faces_of};

/// Bytes between the uniforms of two faces.
const FACE_STRIDE: usize = 256;

/// The maps of one frame's lights.
#[derive(Debug)]
pub(super) struct ShadowAtlas {
    pub(super) view: wgpu::TextureView,
    pub(super) sampler: wgpu::Sampler,
    texture: wgpu::Texture,
    faces: Growing,
    group: wgpu::BindGroup,
    layout: wgpu::BindGroupLayout,
    /// What the texture shows of each face; nothing where it has not been drawn in its place.
    kept: Vec<Option<Kept>>,
}

/// What a face was drawn from.
#[derive(Debug)]
struct Kept {
    uniform: FaceUniform,
    /// The scene's pose.
    pose: u64,
    /// For each instance, whether it was drawn.
    casters: Vec<bool>,
}

/// What drawing the maps came to.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct DrawnShadows {
    /// Whether there is another texture now.
    pub(super) is_another_texture: bool,
    /// Faces that were drawn.
    pub(super) faces: u32,
}

/// A face with its place.
struct Placed {
    clip_from_world: Mat4,
    uniform: FaceUniform,
    resolution: u32,
    origin: [u32; 2],
    layer: u32,
    /// Whether a view may show what it darkens.
    is_needed: bool,
    /// Beyond it a caster darkens nothing: place of the light, distance in metres.
    reach: Option<(Vec3, f32)>,
}

/// What lights give a frame.
pub(super) struct FrameLights {
    pub(super) uniform: Box<LightsUniform>,
    /// Lights that may light something in a view.
    pub(super) count: u32,
    /// Lights that are left out for want of room.
    pub(super) ignored: u32,
    faces: Vec<Placed>,
    /// Side and layers of the depth texture.
    side: u32,
    layers: u32,
}

impl FrameLights {
    /// The lights that shine in a pose and reach what the views (`clips_from_world`) show, and the faces that they need.
    pub(super) fn new(
        gpu: &Gpu,
        scene: &mut GpuScene,
        pose: &Pose,
        params: &ShadeParams,
        clips_from_world: &[Mat4],
    ) -> FrameLights {
        let lights = active_lights(scene.scene(), pose, params);
        let limits = gpu.device.limits();
        let resolution = params.shadow_resolution.clamp(16, 8192.min(limits.max_texture_dimension_2d));
        let host = scene.scene().clone();
        let throws = lights.iter().any(|light| light.throws_shadow);
        let diagonal = if throws { scene.bounds.diagonal(&host, pose) } else { 0.0 };
        let is_in_view = |bounds: Option<Aabb>| {
            bounds.is_none_or(|bounds| clips_from_world.iter().any(|clip| !is_outside(&bounds, clip)))
        };
        let mut frame = FrameLights {
            uniform: Box::new(bytemuck::Zeroable::zeroed()),
            count: 0,
            ignored: lights.len().saturating_sub(MAX_LIGHTS) as u32,
            faces: Vec::new(),
            side: resolution,
            layers: 0,
        };
        let max_layers = limits.max_texture_array_layers - 1;
        // Quarters of the last layer that small faces may still take.
        let mut quarters_left = 0;
        for (i, light) in lights.iter().take(MAX_LIGHTS).enumerate() {
            let faces = faces_of(light, resolution, diagonal, |view_from_world| {
                scene.bounds.as_seen_by(i, &host, pose, view_from_world)
            });
            let first_face = frame.faces.len();
            // A light whose faces do not fit any more shines through everything.
            let fits =
                first_face + faces.len() <= MAX_FACES && frame.layers + faces.len() as u32 <= max_layers;
            let faces = if fits { faces } else { Vec::new() };
            let is_needed = is_in_view(lit_bounds(light, &faces));
            if is_needed {
                let mut uniform = light_uniform(light);
                uniform.first_face = first_face as u32;
                uniform.face_count = faces.len() as u32;
                frame.uniform.lights[frame.count as usize] = uniform;
                frame.count += 1;
            }
            // Faces of lights that are out of view have their places too: nobody's place depends on where one looks.
            for (face, lens) in &faces {
                let is_quarter = face.resolution * 2 <= resolution;
                let origin = if is_quarter && quarters_left > 0 {
                    quarters_left -= 1;
                    let half = resolution / 2;
                    [[half, half], [0, half], [half, 0]][quarters_left]
                } else {
                    frame.layers += 1;
                    quarters_left = if is_quarter { 3 } else { 0 };
                    [0, 0]
                };
                let mut placed = place(face, lens, origin, frame.layers - 1);
                placed.is_needed = is_needed && is_in_view(face_bounds(light, face));
                placed.reach = reach(light, face);
                frame.uniform.faces[frame.faces.len()] = placed.uniform;
                frame.faces.push(placed);
            }
        }
        frame
    }
}

/// A box around all that a light may light; nothing if that has no end.
fn lit_bounds(light: &ActiveLight, faces: &[(Face, Lens)]) -> Option<Aabb> {
    if let [(face, _)] = faces {
        return face_bounds(light, face);
    }
    let range = light.range.filter(|_| light.kind != LightKind::Directional)?;
    let around = Aabb::from_points([light.position_world]).inflated(range);
    Some(around.inflated(1e-3 * range))
}

/// A box around all that a light may light through one of its faces; nothing if that has no end.
fn face_bounds(light: &ActiveLight, face: &Face) -> Option<Aabb> {
    let range = light.range.filter(|_| face.perspective)?;
    let world_from_view: Affine3A = face.view_from_world.inverse();
    let corner = |x: f32, y: f32| {
        let view = Vec3::new(x * face.extent[0], y * face.extent[1], -1.0) * range;
        world_from_view.transform_point3(view)
    };
    let corners = [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)].map(|(x, y)| corner(x, y));
    let pyramid = Aabb::from_points(corners.into_iter().chain([light.position_world]));
    Some(pyramid.inflated(1e-3 * range))
}

/// Where casters begin that darken nothing the light reaches: the filter asks for what is near the receiver's plane, up to
/// 16 texels behind it and 2 texels beside it.
fn reach(light: &ActiveLight, face: &Face) -> Option<(Vec3, f32)> {
    let range = light.range.filter(|_| face.perspective)?;
    let texel = 2.0 * face.extent[0].max(face.extent[1]) / face.resolution as f32;
    Some((light.position_world, range * (1.0 + 17.0 * texel) * (1.0 + 3.0 * texel)))
}

fn light_uniform(light: &ActiveLight) -> LightUniform {
    LightUniform {
        position_world: light.position_world.to_array(),
        inverse_range_squared: light.range.map_or(0.0, |range| 1.0 / (range * range)),
        direction_world: light.direction_world.to_array(),
        is_directional: u32::from(light.kind == dapple_scene::LightKind::Directional),
        intensity: light.intensity.to_array(),
        first_face: 0,
        cone: light.cone.into(),
        face_count: 0,
        pad: 0,
    }
}

fn place(face: &Face, lens: &Lens, origin: [u32; 2], layer: u32) -> Placed {
    let clip = lens.clip_from_view(face.extent) * DMat4::from(projection::widen(&face.view_from_world));
    let (near, far) = match *lens {
        Lens::Perspective { near } => (near, 0.0),
        Lens::Orthographic { near, far } => (near, far),
    };
    Placed {
        clip_from_world: clip.as_mat4(),
        uniform: FaceUniform {
            view_from_world: rows(&face.view_from_world),
            extent: face.extent,
            resolution: face.resolution as f32,
            layer,
            origin: origin.map(|o| o as f32),
            near,
            far,
            is_perspective: u32::from(face.perspective),
            pad_a: 0,
            pad_b: 0,
            pad_c: 0,
        },
        resolution: face.resolution,
        origin,
        layer,
        is_needed: true,
        reach: None,
    }
}

impl Placed {
    /// Whether it may show an instance, wherever that stands.
    fn shows(&self, scene: &GpuScene, instance: usize) -> bool {
        let bounds = &scene.bounds.world[instance];
        scene.scene().instances[instance].casts
            && !is_outside(bounds, &self.clip_from_world)
            && self.reach.is_none_or(|(light, reach)| {
                let distance = light.clamp(bounds.min, bounds.max).distance(light);
                // What is no number is drawn.
                distance.is_nan() || distance <= reach
            })
    }

    /// Whether the texture shows it as it is.
    fn is_kept(&self, scene: &GpuScene, kept: &Kept) -> bool {
        (0..kept.casters.len()).all(|instance| {
            scene.moved_at(instance) <= kept.pose || !(kept.casters[instance] || self.shows(scene, instance))
        })
    }
}

impl ShadowAtlas {
    pub(super) fn new(gpu: &Gpu) -> ShadowAtlas {
        let (texture, view) = make(gpu, 16, 0);
        let faces =
            Growing::new(&gpu.device, "shadow faces", FACE_STRIDE as u64, wgpu::BufferUsages::UNIFORM);
        let layout = layouts::face(&gpu.device);
        let group = face_group(gpu, &layout, &faces);
        let sampler = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("shadow"),
            // The filter is the shader's: each tap is one texel, lit or not.
            compare: Some(wgpu::CompareFunction::GreaterEqual),
            ..Default::default()
        });
        ShadowAtlas { view, sampler, texture, faces, group, layout, kept: Vec::new() }
    }

    /// Draws the faces that are needed and whose picture has changed.
    pub(super) fn draw(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        scene: &GpuScene,
        lights: &FrameLights,
        pipelines: &CasterPipelines,
    ) -> DrawnShadows {
        let mut drawn = DrawnShadows::default();
        if lights.faces.is_empty() {
            return drawn;
        }
        let layers = layouts::array_layers(lights.layers);
        if self.texture.width() != lights.side || self.texture.depth_or_array_layers() < layers {
            (self.texture, self.view) = make(gpu, lights.side, lights.layers);
            self.kept.clear();
            drawn.is_another_texture = true;
        }
        // Now every kept face is where this frame has it, and no other may be drawn over it.
        self.kept.resize_with(lights.faces.len(), || None);
        for (kept, face) in self.kept.iter_mut().zip(&lights.faces) {
            kept.take_if(|kept| bytemuck::bytes_of(&kept.uniform) != bytemuck::bytes_of(&face.uniform));
        }
        let stale = lights.faces.iter().zip(&self.kept).map(|(face, kept)| {
            face.is_needed && kept.as_ref().is_none_or(|kept| !face.is_kept(scene, kept))
        });
        let stale: Vec<bool> = stale.collect();
        if !stale.contains(&true) {
            return drawn;
        }
        let mut bytes = vec![0u8; FACE_STRIDE * lights.faces.len()];
        for (slot, face) in bytes.chunks_exact_mut(FACE_STRIDE).zip(&lights.faces) {
            slot[..64].copy_from_slice(bytemuck::bytes_of(&face.clip_from_world.to_cols_array()));
        }
        if self.faces.write(gpu, &bytes) {
            self.group = face_group(gpu, &self.layout, &self.faces);
        }
        for layer in 0..lights.layers {
            drawn.faces += self.draw_layer(encoder, scene, lights, layer, &stale, pipelines);
        }
        drawn
    }

    /// Draws the stale faces of a layer; returns how many.
    fn draw_layer(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        scene: &GpuScene,
        lights: &FrameLights,
        layer: u32,
        stale: &[bool],
        pipelines: &CasterPipelines,
    ) -> u32 {
        let here = |i: &usize| lights.faces[*i].layer == layer;
        let faces: Vec<usize> = (0..lights.faces.len()).filter(here).collect();
        let keeps = faces.iter().any(|&i| !stale[i] && self.kept[i].is_some());
        let faces: Vec<usize> = faces.into_iter().filter(|&i| stale[i]).collect();
        if faces.is_empty() {
            return 0;
        }
        let view = self.texture.create_view(&wgpu::TextureViewDescriptor {
            dimension: Some(wgpu::TextureViewDimension::D2),
            base_array_layer: layer,
            array_layer_count: Some(1),
            ..Default::default()
        });
        // Reverse z: 0 is farthest.
        let load = if keeps { wgpu::LoadOp::Load } else { wgpu::LoadOp::Clear(0.0) };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("shadow map"),
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &view,
                depth_ops: Some(wgpu::Operations { load, store: wgpu::StoreOp::Store }),
                stencil_ops: None,
            }),
            ..Default::default()
        });
        for &i in &faces {
            let face = &lights.faces[i];
            let [x, y] = face.origin;
            pass.set_viewport(x as f32, y as f32, face.resolution as f32, face.resolution as f32, 0.0, 1.0);
            pass.set_scissor_rect(x, y, face.resolution, face.resolution);
            if keeps {
                pass.set_pipeline(&pipelines.clear);
                pass.draw(0..3, 0..1);
            }
            pass.set_bind_group(0, &self.group, &[(i * FACE_STRIDE) as u32]);
            pass.set_bind_group(2, &scene.group, &[]);
            let instances = 0..scene.scene().instances.len();
            let casters: Vec<bool> = instances.map(|instance| face.shows(scene, instance)).collect();
            draw_casters(&mut pass, scene, &casters, pipelines);
            self.kept[i] = Some(Kept { uniform: face.uniform, pose: scene.now(), casters });
        }
        faces.len() as u32
    }
}

/// Draws the casters.
fn draw_casters(
    pass: &mut wgpu::RenderPass<'_>,
    scene: &GpuScene,
    casters: &[bool],
    pipelines: &CasterPipelines,
) {
    let host = scene.scene();
    let stride = size_of::<super::uniforms::InstanceRaw>() as u64;
    for batch in &scene.batches {
        let mesh = &scene.meshes[batch.mesh];
        let seen = |slot: u32| casters[scene.instance_at(slot)];
        for (first, end) in runs(batch.first, batch.count, seen) {
            pass.set_vertex_buffer(GEOMETRY_SLOT, mesh.geometry.slice(..));
            pass.set_vertex_buffer(CHARTS_SLOT, mesh.charts.slice(..));
            let instances =
                scene.instance_buffer.buffer.slice(u64::from(first) * stride..u64::from(end) * stride);
            pass.set_vertex_buffer(INSTANCE_SLOT, instances);
            pass.set_index_buffer(mesh.indices.slice(..), wgpu::IndexFormat::Uint32);
            for part in &mesh.parts {
                let material = &scene.materials[part.material as usize];
                // Without texture coordinates and colours alpha is one number, but one code path is enough.
                let holes = !matches!(material.alpha, AlphaMode::Opaque);
                match &mesh.detail {
                    Some(detail) if holes => {
                        pass.set_pipeline(&pipelines.masked);
                        pass.set_vertex_buffer(DETAIL_SLOT, detail.slice(..));
                    }
                    _ if holes && pipelines.is_hole(host, part.material) => continue,
                    _ => pass.set_pipeline(&pipelines.solid),
                }
                pass.set_bind_group(1, &material.group, &[]);
                let first_index = 3 * part.first_triangle;
                pass.draw_indexed(first_index..first_index + 3 * part.triangle_count, 0, 0..end - first);
            }
        }
    }
}

/// Longest runs of places from `first` on that are accepted, as ranges.
pub(super) fn runs(first: u32, count: u32, accepted: impl Fn(u32) -> bool) -> Vec<(u32, u32)> {
    let mut runs: Vec<(u32, u32)> = Vec::new();
    for slot in (first..first + count).filter(|&slot| accepted(slot)) {
        match runs.last_mut() {
            Some(run) if run.1 == slot => run.1 += 1,
            _ => runs.push((slot, slot + 1)),
        }
    }
    runs
}

fn face_group(gpu: &Gpu, layout: &wgpu::BindGroupLayout, faces: &Growing) -> wgpu::BindGroup {
    let binding = wgpu::BufferBinding {
        buffer: &faces.buffer,
        offset: 0,
        size: std::num::NonZeroU64::new(FACE_STRIDE as u64),
    };
    layouts::group(&gpu.device, layout, &[wgpu::BindingResource::Buffer(binding)])
}

fn make(gpu: &Gpu, side: u32, layers: u32) -> (wgpu::Texture, wgpu::TextureView) {
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("shadow maps"),
        size: wgpu::Extent3d {
            width: side,
            height: side,
            depth_or_array_layers: layouts::array_layers(layers),
        },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Depth32Float,
        usage: wgpu::TextureUsages::TEXTURE_BINDING
            | wgpu::TextureUsages::RENDER_ATTACHMENT
            | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    });
    let view = texture.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(wgpu::TextureViewDimension::D2Array),
        ..Default::default()
    });
    (texture, view)
}

#[cfg(test)]
mod tests {
    #[test]
    fn runs_are_the_longest() {
        let odd_one_out = |slot: u32| slot != 5;
        assert_eq!(super::runs(3, 5, odd_one_out), [(3, 5), (6, 8)]);
        assert_eq!(super::runs(0, 0, odd_one_out), []);
        assert_eq!(super::runs(5, 1, odd_one_out), []);
    }
}
