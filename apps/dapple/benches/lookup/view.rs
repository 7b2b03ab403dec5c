//! What the bench looks at: the atrium through its first camera, as fragments and as triangles.

use dapple_gpu::wgpu;
use dapple_gpu::{Gpu, shader_module};
use dapple_render::gbuffer::{GBuffer, RestSurface, rasterize};
use dapple_render::psao::atlas::VisibilityAtlas;
use dapple_scene::glam::{Mat4, Vec3};
use dapple_scene::{NoFiles, Pose, PosedCamera, Scene, builtin};

use crate::fullscreen::{Fragments, render_texture, texture, view, write};

/// One picture's worth of surfaces.
pub(crate) struct View {
    pub(crate) scene: Scene,
    pub(crate) pose: Pose,
    pub(crate) camera: PosedCamera,
    pub(crate) gbuffer: GBuffer,
    pub(crate) fragments: Vec<Option<RestSurface>>,
}

impl View {
    pub(crate) fn new(detail: f32, width: u32, height: u32) -> View {
        let glb = builtin::glb("atrium", detail).expect("the atrium is made");
        let scene = dapple_scene::load("atrium.glb", &glb, &NoFiles).expect("the atrium loads");
        let pose = scene.pose(2.0);
        let camera = scene.camera_paths()[0].camera(&scene, &pose);
        let gbuffer = rasterize(&scene, &pose, &camera, width, height, 1).expect("the atrium is drawn");
        let fragments = gbuffer.map_surfaces_rest(&scene, |_, surface| surface.copied());
        View { scene, pose, camera, gbuffer, fragments }
    }

    fn clip_from_view(&self) -> Mat4 {
        self.camera.clip_from_view(self.gbuffer.width as f32 / self.gbuffer.height as f32)
    }

    /// What x and y of a view position are multiplied with, before they are divided by the distance.
    pub(crate) fn focal(&self) -> [f32; 2] {
        let clip = self.clip_from_view();
        [clip.x_axis.x, clip.y_axis.y]
    }

    /// Distance along the view axis (0 for the background) and normal of each fragment as seen from the camera.
    pub(crate) fn depth_and_normal(&self, gpu: &Gpu) -> (wgpu::Texture, wgpu::Texture) {
        let view_from_world = self.camera.world_from_view.inverse();
        let seen: Vec<(f32, Vec3)> = self.gbuffer.map_surfaces(&self.scene, &self.pose, |_, surface| {
            surface.map_or((0.0, Vec3::ZERO), |s| {
                let position = view_from_world.transform_point3(s.position_world);
                (-position.z, view_from_world.transform_vector3(s.normal_world))
            })
        });
        let usage = wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST;
        let (width, height) = (self.gbuffer.width, self.gbuffer.height);
        let depth = texture(gpu, width, height, wgpu::TextureFormat::R32Float, usage);
        let bytes: Vec<u8> = seen.iter().flat_map(|s| s.0.to_le_bytes()).collect();
        write(gpu, &depth, &bytes, width * 4);
        let normal = texture(gpu, width, height, wgpu::TextureFormat::Rgba8Unorm, usage);
        let byte = |v: f32| ((v * 0.5 + 0.5) * 255.0).round() as u8;
        let bytes: Vec<u8> = seen.iter().flat_map(|(_, n)| [byte(n.x), byte(n.y), byte(n.z), 255]).collect();
        write(gpu, &normal, &bytes, width * 4);
        (depth, normal)
    }

    /// Where each fragment lies in an atlas: x, y in texels, layer, and a fade that is over. Layer −1 is open, layer −2
    /// means that x is the value itself.
    pub(crate) fn charts(&self, atlas: &VisibilityAtlas) -> Vec<[f32; 4]> {
        let of = |(i, sample): (usize, &dapple_render::gbuffer::Sample)| {
            let open = [0.0, 0.0, -1.0, 1.0];
            let Some(fragment) = self.fragments[i].filter(|_| sample.is_covered()) else { return open };
            let Some(charts) = atlas.charts(fragment.instance) else { return open };
            let back = sample.is_back_face();
            if charts.is_per_vertex() {
                let value =
                    atlas.visibility(fragment.instance, sample.triangle, sample.barycentrics, back, 1.0);
                return [value, value, -2.0, 1.0];
            }
            let (page, x, y) = charts.texel_at(sample.triangle as usize, sample.barycentrics);
            let places = atlas.placements(fragment.instance);
            // Those of the back, if it has its own, follow.
            let first = if back && places.len() > charts.pages().len() { charts.pages().len() } else { 0 };
            match places.get(first + usize::from(page)) {
                Some(at) => [f32::from(at.x) + x, f32::from(at.y) + y, f32::from(at.layer), 1.0],
                None => open,
            }
        };
        self.gbuffer.samples().iter().enumerate().map(of).collect()
    }
}

/// Draws every triangle of the view into rest positions, normals and depth.
pub(crate) struct GeometryPass {
    pipeline: wgpu::RenderPipeline,
    vertices: wgpu::Buffer,
    count: u32,
    targets: [wgpu::TextureView; 2],
    depth: wgpu::TextureView,
}

const GEOMETRY_WGSL: &str = "
struct Out { @builtin(position) at: vec4f, @location(0) place: vec4f, @location(1) normal: vec3f }
struct Pixel { @location(0) place: vec4f, @location(1) normal: vec4f }
@vertex fn vertex(@location(0) world: vec3f, @location(1) place: vec4f, @location(2) normal: vec3f) -> Out {
    return Out(CLIP_FROM_WORLD * vec4f(world, 1.0), place, normal);
}
@fragment fn fragment(v: Out) -> Pixel { return Pixel(v.place, vec4f(normalize(v.normal), 1.0)); }
";

impl GeometryPass {
    pub(crate) fn new(view_of: &View, frame: &Fragments) -> GeometryPass {
        let gpu = &frame.gpu;
        let (scene, pose) = (&view_of.scene, &view_of.pose);
        let mut bytes: Vec<u8> = Vec::new();
        let mut count = 0;
        for (i, instance) in scene.instances.iter().enumerate() {
            let mesh = &scene.meshes[instance.mesh as usize];
            let world = pose.instances[i].world_from_mesh;
            let positions = scene.vertex_positions(pose, i);
            for &v in mesh.triangles.iter().flatten() {
                let v = v as usize;
                let rest = instance.rest_from_mesh * mesh.positions[v];
                let numbers = [
                    world.transform_point3(positions[v]).to_array().as_slice(),
                    rest.to_array().as_slice(),
                    &[i as f32],
                    (instance.rest_from_mesh * mesh.normals[v]).to_array().as_slice(),
                ]
                .concat();
                bytes.extend(numbers.iter().flat_map(|n| n.to_le_bytes()));
                count += 1;
            }
        }
        let vertices = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("triangles"),
            size: bytes.len() as u64,
            usage: wgpu::BufferUsages::VERTEX | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        gpu.queue.write_buffer(&vertices, 0, &bytes);
        let clip_from_world = view_of.clip_from_view() * Mat4::from(view_of.camera.world_from_view.inverse());
        let clip = clip_from_world.to_cols_array().map(|n| format!("{n:?}")).join(", ");
        let module = shader_module(
            &gpu.device,
            "geometry",
            &format!("const CLIP_FROM_WORLD = mat4x4f({clip});\n{GEOMETRY_WGSL}"),
        );
        let attributes = wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x4, 2 => Float32x3];
        let format = wgpu::TextureFormat::Rgba16Float;
        let pipeline = gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("geometry"),
            layout: None,
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("vertex"),
                compilation_options: Default::default(),
                buffers: &[Some(wgpu::VertexBufferLayout {
                    array_stride: 40,
                    step_mode: wgpu::VertexStepMode::Vertex,
                    attributes: &attributes,
                })],
            },
            primitive: wgpu::PrimitiveState { cull_mode: Some(wgpu::Face::Back), ..Default::default() },
            depth_stencil: Some(wgpu::DepthStencilState {
                format: wgpu::TextureFormat::Depth32Float,
                depth_write_enabled: Some(true),
                depth_compare: Some(wgpu::CompareFunction::Greater),
                stencil: Default::default(),
                bias: Default::default(),
            }),
            multisample: Default::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some("fragment"),
                compilation_options: Default::default(),
                targets: &[Some(format.into()), Some(format.into())],
            }),
            multiview_mask: None,
            cache: None,
        });
        let make = |format| view(&render_texture(gpu, frame.width, frame.height, format));
        let depth = make(wgpu::TextureFormat::Depth32Float);
        GeometryPass { pipeline, vertices, count, targets: [make(format), make(format)], depth }
    }

    pub(crate) fn record(&self, encoder: &mut wgpu::CommandEncoder) {
        let attach = |view| {
            Some(wgpu::RenderPassColorAttachment {
                view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations::default(),
            })
        };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            color_attachments: &[attach(&self.targets[0]), attach(&self.targets[1])],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &self.depth,
                depth_ops: Some(wgpu::Operations {
                    load: wgpu::LoadOp::Clear(0.0),
                    store: wgpu::StoreOp::Store,
                }),
                stencil_ops: None,
            }),
            ..Default::default()
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_vertex_buffer(0, self.vertices.slice(..));
        pass.draw(0..self.count, 0..1);
    }
}
