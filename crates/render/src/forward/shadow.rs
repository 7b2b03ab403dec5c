//! Shadow maps on the card: faces in the layers of one depth texture, drawn again only when something moved.

use dapple_gpu::{Gpu, wgpu};
use dapple_scene::{AlphaMode, Pose};
use glam::{DMat4, Mat4};

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
    /// What the maps were drawn from.
    drawn: Vec<u8>,
}

/// A face with its place.
struct Placed {
    clip_from_world: Mat4,
    uniform: FaceUniform,
    resolution: u32,
    origin: [u32; 2],
    layer: u32,
}

/// What lights give a frame.
pub(super) struct FrameLights {
    pub(super) uniform: Box<LightsUniform>,
    pub(super) count: u32,
    /// Lights that are left out.
    pub(super) ignored: u32,
    faces: Vec<Placed>,
    /// Side and layers of the depth texture.
    side: u32,
    layers: u32,
}

impl FrameLights {
    /// The lights that shine in a pose, and the faces that they need.
    pub(super) fn new(gpu: &Gpu, scene: &mut GpuScene, pose: &Pose, params: &ShadeParams) -> FrameLights {
        let lights = active_lights(scene.scene(), pose, params);
        let limits = gpu.device.limits();
        let resolution = params.shadow_resolution.clamp(16, 8192.min(limits.max_texture_dimension_2d));
        let host = scene.scene().clone();
        let throws = lights.iter().any(|light| light.throws_shadow);
        let diagonal = if throws { scene.bounds.diagonal(&host, pose) } else { 0.0 };
        let mut frame = FrameLights {
            uniform: Box::new(bytemuck::Zeroable::zeroed()),
            count: lights.len().min(MAX_LIGHTS) as u32,
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
            let mut uniform = light_uniform(light);
            uniform.first_face = first_face as u32;
            uniform.face_count = faces.len() as u32;
            frame.uniform.lights[i] = uniform;
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
                let placed = place(face, lens, origin, frame.layers - 1);
                frame.uniform.faces[frame.faces.len()] = placed.uniform;
                frame.faces.push(placed);
            }
        }
        frame
    }
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
        ShadowAtlas { view, sampler, texture, faces, group, layout, drawn: Vec::new() }
    }

    /// Draws the maps if anything they show has moved. Returns whether the texture is another one now.
    pub(super) fn draw(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        scene: &GpuScene,
        lights: &FrameLights,
        pipelines: &CasterPipelines,
    ) -> bool {
        if lights.faces.is_empty() {
            return false;
        }
        let mut drawn: Vec<u8> = bytemuck::cast_slice(scene.raw()).to_vec();
        drawn.extend_from_slice(bytemuck::cast_slice(scene.deformation.texels()));
        let uniforms: Vec<FaceUniform> = lights.faces.iter().map(|face| face.uniform).collect();
        drawn.extend_from_slice(bytemuck::cast_slice(&uniforms));
        if drawn == self.drawn {
            return false;
        }
        self.drawn = drawn;
        let layers = layouts::array_layers(lights.layers);
        let resized = self.texture.width() != lights.side || self.texture.depth_or_array_layers() < layers;
        if resized {
            (self.texture, self.view) = make(gpu, lights.side, lights.layers);
        }
        let mut bytes = vec![0u8; FACE_STRIDE * lights.faces.len()];
        for (slot, face) in bytes.chunks_exact_mut(FACE_STRIDE).zip(&lights.faces) {
            slot[..64].copy_from_slice(bytemuck::bytes_of(&face.clip_from_world.to_cols_array()));
        }
        if self.faces.write(gpu, &bytes) {
            self.group = face_group(gpu, &self.layout, &self.faces);
        }
        for layer in 0..lights.layers {
            self.draw_layer(encoder, scene, lights, layer, pipelines);
        }
        resized
    }

    fn draw_layer(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        scene: &GpuScene,
        lights: &FrameLights,
        layer: u32,
        pipelines: &CasterPipelines,
    ) {
        let view = self.texture.create_view(&wgpu::TextureViewDescriptor {
            dimension: Some(wgpu::TextureViewDimension::D2),
            base_array_layer: layer,
            array_layer_count: Some(1),
            ..Default::default()
        });
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("shadow map"),
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &view,
                // Reverse z: 0 is farthest.
                depth_ops: Some(wgpu::Operations {
                    load: wgpu::LoadOp::Clear(0.0),
                    store: wgpu::StoreOp::Store,
                }),
                stencil_ops: None,
            }),
            ..Default::default()
        });
        pass.set_bind_group(2, &scene.group, &[]);
        for (i, face) in lights.faces.iter().enumerate().filter(|(_, face)| face.layer == layer) {
            let [x, y] = face.origin;
            pass.set_viewport(x as f32, y as f32, face.resolution as f32, face.resolution as f32, 0.0, 1.0);
            pass.set_scissor_rect(x, y, face.resolution, face.resolution);
            pass.set_bind_group(0, &self.group, &[(i * FACE_STRIDE) as u32]);
            draw_casters(&mut pass, scene, &face.clip_from_world, pipelines);
        }
    }
}

/// Draws everything that casts and that a face may see.
fn draw_casters(
    pass: &mut wgpu::RenderPass<'_>,
    scene: &GpuScene,
    clip_from_world: &Mat4,
    pipelines: &CasterPipelines,
) {
    let host = scene.scene();
    let stride = size_of::<super::uniforms::InstanceRaw>() as u64;
    for batch in &scene.batches {
        let mesh = &scene.meshes[batch.mesh];
        let seen = |slot: u32| {
            let i = scene.instance_at(slot);
            host.instances[i].casts && !is_outside(&scene.bounds.world[i], clip_from_world)
        };
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
