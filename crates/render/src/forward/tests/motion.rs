//! What moves: skins and morph targets against the pose's vertices, and pictures of scenes in motion.

use std::path::PathBuf;
use std::sync::Arc;

use dapple_gpu::testing::block_on;
use dapple_gpu::{join, read_texture, shader_module, wgpu};
use dapple_scene::{
    Animation, Channel, ChannelTarget, Edit, Edits, Files, Instance, Interpolation, LocalTransform, Mesh,
    MorphTarget, NoFiles, Node, Part, Placement, PosedCamera, Scene, Skin, SkinInfluences,
};
use glam::{Affine3A, Mat3, Quat, Vec3};

use super::super::pipelines::{DEFORM_WGSL, MATH_WGSL};
use super::super::scene::{CHARTS_SLOT, GEOMETRY_SLOT, INSTANCE_SLOT, vertex_layouts};
use super::super::{GpuSceneOptions, layouts};
use super::harness::{Bench, assert_agrees, twin};
use crate::shade::ShadeParams;
use crate::testing::{ground, matte, sphere};

const SIZE: (u32, u32) = (240, 160);

/// A ball that swells to one side (two targets) and is bent by three joints in two sets of influences, on a floor; and
/// one that only swells.
pub(super) fn bent_and_swollen() -> Scene {
    let ball = |name: &str| {
        let mut mesh = Mesh { name: name.into(), ..sphere(16, 24) };
        mesh.parts =
            vec![Part { first_triangle: 0, triangle_count: mesh.triangles.len() as u32, material: 0 }];
        let swell = mesh.positions.iter().map(|p| Vec3::new(0.4 * p.x.max(0.0), 0.0, 0.0));
        let lift = mesh.positions.iter().map(|p| Vec3::new(0.0, 0.3 * p.z * p.z, 0.1 * p.x));
        let tilt = mesh.normals.iter().map(|n| Vec3::new(0.0, 0.2 * n.x, 0.1));
        mesh.morph_targets = vec![
            MorphTarget { positions: swell.collect(), normals: tilt.collect() },
            MorphTarget { positions: lift.collect(), normals: Vec::new() },
        ];
        mesh.morph_weights = vec![0.7, 0.4];
        mesh
    };
    let mut bent = ball("bent");
    let (mut first, mut second) = (SkinInfluences::default(), SkinInfluences::default());
    for p in &bent.positions {
        let up = 0.5 + 0.5 * p.y;
        first.joints.push([0, 1, 0, 0]);
        first.weights.push([0.7 * (1.0 - up), 0.7 * up, 0.0, 0.0]);
        second.joints.push([2, 0, 0, 0]);
        second.weights.push([0.3, 0.0, 0.0, 0.0]);
    }
    bent.influences = vec![first, second];
    let mut floor = ground(4.0);
    floor.parts = vec![Part { first_triangle: 0, triangle_count: 2, material: 1 }];

    let trs = |translation, rotation, scale| LocalTransform::Trs { translation, rotation, scale };
    let node = |parent, local| Node { parent, local, ..Node::default() };
    let at = |x: f32, y: f32, z: f32| trs(Vec3::new(x, y, z), Quat::IDENTITY, Vec3::ONE);
    let nodes = vec![
        node(None, at(-1.2, 1.2, 0.0)),
        node(Some(0), at(0.0, -0.6, 0.0)),
        node(Some(0), trs(Vec3::new(0.1, 0.6, 0.0), Quat::from_rotation_z(0.5), Vec3::new(1.1, 0.8, 1.0))),
        node(Some(0), at(0.2, 0.0, 0.3)),
        node(None, trs(Vec3::new(1.3, 1.0, 0.0), Quat::from_rotation_y(0.6), Vec3::new(-0.9, 0.9, 0.9))),
        node(None, at(0.0, 0.0, 0.0)),
    ];
    let instance = |node, mesh, skin| Instance {
        node,
        mesh,
        skin,
        casts: true,
        emitter: Default::default(),
        receives: true,
        rest_from_mesh: Mat3::IDENTITY,
        spare: false,
    };
    let inverse = |y: f32| Affine3A::from_translation(Vec3::new(0.0, -y, 0.0));
    let channel = |node, target, values: &[f32]| Channel {
        node,
        target,
        interpolation: Interpolation::Linear,
        times: vec![0.0, 1.0],
        values: values.to_vec(),
    };
    let turn = Quat::from_rotation_x(0.9);
    let channels = vec![
        channel(2, ChannelTarget::Rotation, &[0.0, 0.0, 0.0, 1.0, turn.x, turn.y, turn.z, turn.w]),
        channel(4, ChannelTarget::MorphWeights, &[0.0, 0.0, 1.0, -0.8]),
    ];
    Scene {
        nodes,
        meshes: vec![bent, ball("swollen"), floor],
        instances: vec![instance(0, 0, Some(0)), instance(4, 1, None), instance(5, 2, None)],
        skins: vec![Skin {
            name: "spine".into(),
            joints: vec![1, 2, 3],
            inverse_bind_matrices: vec![inverse(-0.6), inverse(0.6), inverse(0.0)],
        }],
        materials: vec![matte(Vec3::new(0.8, 0.4, 0.2)), matte(Vec3::splat(0.7))],
        animations: vec![Animation { name: "bend".into(), channels }],
        active_animation: Some(0),
        ..Scene::default()
    }
}

/// Writes what `deform` makes of each vertex into a texel: positions, then normals.
const PROBE: &str = "
struct ProbeVertex {
    @location(0) position: vec3<f32>,
    @location(1) normal: vec4<f32>,
    @location(3) source: u32,
    @location(4) world_x: vec4<f32>,
    @location(10) instance: vec4<u32>,
}
struct Probed {
    @builtin(position) clip: vec4<f32>,
    @location(0) @interpolate(flat, either) position: vec3<f32>,
    @location(1) @interpolate(flat, either) normal: vec3<f32>,
}
@vertex fn probe_vertex(v: ProbeVertex, @builtin(vertex_index) i: u32) -> Probed {
    let posed = deform(v.position, v.normal.xyz, v.source, v.instance.z);
    let at = vec2(f32(i % 64u) + 0.5, f32(i / 64u) + 0.5) / 32.0 - 1.0;
    return Probed(vec4(at.x, -at.y, 0.5, 1.0), posed.position, posed.normal);
}
struct Out { @location(0) position: vec4<f32>, @location(1) normal: vec4<f32> }
@fragment fn probe_fragment(v: Probed) -> Out {
    return Out(vec4(v.position, 1.0), vec4(v.normal, 1.0));
}";

#[test]
fn vertices_are_posed_as_the_pose_says() {
    let scene = bent_and_swollen();
    let Some(mut bench) = Bench::new(&scene, 1, &[]) else { return };
    let device = bench.gpu.device.clone();
    let surface = layouts::surface(&device);
    let module = shader_module(&device, "probe", &join(&[MATH_WGSL, DEFORM_WGSL, PROBE]));
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: None,
        bind_group_layouts: &[None, None, Some(&surface)],
        immediate_size: 0,
    });
    let format = wgpu::TextureFormat::Rgba32Float;
    let usages = bench.gpu.adapter.get_texture_format_features(format).allowed_usages;
    if !usages.contains(wgpu::TextureUsages::RENDER_ATTACHMENT) {
        eprintln!("skipped: vertices posed on the card, because it cannot draw floats");
        return;
    }
    let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: None,
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: None,
            compilation_options: Default::default(),
            buffers: &vertex_layouts(false),
        },
        primitive: wgpu::PrimitiveState {
            topology: wgpu::PrimitiveTopology::PointList,
            ..Default::default()
        },
        depth_stencil: None,
        multisample: Default::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: None,
            compilation_options: Default::default(),
            targets: &[Some(format.into()), Some(format.into())],
        }),
        multiview_mask: None,
        cache: None,
    });
    for time in [0.0, 0.35, 0.8] {
        let pose = scene.pose(time);
        bench.scene.place(&bench.gpu, &scene.pose_undeformed(time));
        for batch in bench.scene.batches.clone() {
            let i = bench.scene.instance_at(batch.first);
            let Some(deformed) = &pose.instances[i].deformed else { continue };
            let targets = [(); 2].map(|()| {
                device.create_texture(&wgpu::TextureDescriptor {
                    label: None,
                    size: wgpu::Extent3d { width: 64, height: 64, depth_or_array_layers: 1 },
                    mip_level_count: 1,
                    sample_count: 1,
                    dimension: wgpu::TextureDimension::D2,
                    format,
                    usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
                    view_formats: &[],
                })
            });
            let views = targets.each_ref().map(|t| t.create_view(&Default::default()));
            let attachments = views.each_ref().map(|view| {
                Some(wgpu::RenderPassColorAttachment {
                    view,
                    depth_slice: None,
                    resolve_target: None,
                    ops: Default::default(),
                })
            });
            let mut encoder = device.create_command_encoder(&Default::default());
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                color_attachments: &attachments,
                ..Default::default()
            });
            let mesh = &bench.scene.meshes[batch.mesh];
            let stride = size_of::<super::super::uniforms::InstanceRaw>() as u64;
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(2, &bench.scene.group, &[]);
            pass.set_vertex_buffer(GEOMETRY_SLOT, mesh.geometry.slice(..));
            pass.set_vertex_buffer(CHARTS_SLOT, mesh.charts.slice(..));
            let first = u64::from(batch.first) * stride;
            pass.set_vertex_buffer(INSTANCE_SLOT, bench.scene.instance_buffer.buffer.slice(first..));
            pass.draw(0..deformed.positions.len() as u32, 0..1);
            drop(pass);
            bench.gpu.queue.submit([encoder.finish()]);
            for (target, expected, tolerance) in
                [(&targets[0], &deformed.positions, 2e-6), (&targets[1], &deformed.normals, 6e-5)]
            {
                let bytes = block_on(read_texture(&bench.gpu, target, 0)).unwrap();
                let texels: &[[f32; 4]] = bytemuck::cast_slice(&bytes);
                for (v, (texel, expected)) in texels.iter().zip(expected).enumerate() {
                    let found = Vec3::new(texel[0], texel[1], texel[2]);
                    assert_eq!(texel[3], 1.0, "vertex {v} of instance {i} was not drawn");
                    assert!(found.abs_diff_eq(*expected, tolerance), "{i} {v} at {time}: {found} {expected}");
                }
            }
        }
    }
}

#[test]
fn deformed_scenes_look_as_the_twin_draws_them() {
    let scene = bent_and_swollen();
    let Some(mut bench) = Bench::new(&scene, 1, &[]) else { return };
    let camera = PosedCamera::look_at(Vec3::new(1.5, 3.0, 5.5), Vec3::new(0.0, 0.9, 0.0), 0.8);
    let params = ShadeParams { shadow_resolution: 512, ..ShadeParams::default() };
    for (name, time) in [("deformed-0", 0.0), ("deformed-1", 0.6)] {
        let pose = scene.pose(time);
        let card = bench.beauty(SIZE, &pose, &camera, &params);
        let (expected, gbuffer) = twin(&scene, &pose, &camera, SIZE, &params);
        assert_agrees(name, &card, &expected, &gbuffer);
        // Without the vertices shadow maps are fitted more loosely, and nothing else changes.
        let unshadowed = ShadeParams { max_shadowed_lights: 0, ..params };
        let full = bench.beauty(SIZE, &pose, &camera, &unshadowed);
        let light = bench.beauty(SIZE, &scene.pose_undeformed(time), &camera, &unshadowed);
        assert_eq!(full, light);
        let loose = bench.beauty(SIZE, &scene.pose_undeformed(time), &camera, &params);
        let close = super::harness::compare(&loose, &expected, &gbuffer);
        assert!(close.within > 0.97, "{close:?}");
    }
}

#[test]
fn edited_scenes_look_as_the_twin_draws_them() {
    let scene = bent_and_swollen();
    let Some(mut bench) = Bench::new(&scene, 1, &[]) else { return };
    let camera = PosedCamera::look_at(Vec3::new(1.5, 3.0, 5.5), Vec3::new(0.0, 0.9, 0.0), 0.8);
    let params = ShadeParams { shadow_resolution: 512, ..ShadeParams::default() };
    let placement = Placement {
        translation: [0.3, 0.8, 0.2],
        rotation: Quat::from_rotation_z(0.7).into(),
        scale: [1.0, 1.2, 1.0],
    };
    for (name, edit, gone) in [
        ("edited-joint", Edit::Place { node: 2, placement }, None),
        ("edited-skinned", Edit::Remove { instance: 0 }, Some(0)),
        ("edited-morphed", Edit::Remove { instance: 1 }, Some(1)),
    ] {
        let mut edits = Edits::new(&scene);
        edits.apply(&scene, &edit).unwrap();
        let pose = scene.pose_edited(0.6, &edits);
        let card = bench.beauty(SIZE, &pose, &camera, &params);
        let (expected, gbuffer) = twin(&scene, &pose, &camera, SIZE, &params);
        assert_agrees(name, &card, &expected, &gbuffer);
        let sees = |instance| gbuffer.samples().iter().any(|sample| sample.instance == instance);
        assert!((0..3).all(|instance| sees(instance) != (gone == Some(instance))), "{name}");
        let unshadowed = ShadeParams { max_shadowed_lights: 0, ..params };
        let full = bench.beauty(SIZE, &pose, &camera, &unshadowed);
        assert_eq!(
            full,
            bench.beauty(SIZE, &scene.pose_undeformed_edited(0.6, &edits), &camera, &unshadowed)
        );
    }
}

#[test]
fn the_atrium_looks_as_the_twin_draws_it() {
    let glb = dapple_scene::builtin::glb("atrium", 0.1).unwrap();
    let scene = dapple_scene::load("atrium.glb", &glb, &NoFiles).unwrap();
    let Some(mut bench) = Bench::new(&scene, 1, &[]) else { return };
    let params = ShadeParams { shadow_resolution: 256, ..ShadeParams::default() };
    let mut pictures = Vec::new();
    for (name, time, eye) in [
        ("atrium-2", 2.0, Vec3::new(3.0, 1.7, 4.0)),
        ("atrium-9", 9.0, Vec3::new(3.0, 1.7, 4.0)),
        ("atrium-up", 9.0, Vec3::new(-3.0, 1.0, -3.0)),
    ] {
        let pose = scene.pose(time);
        let camera = PosedCamera::look_at(eye, Vec3::new(-0.5, 1.6, -0.8), 1.0);
        let card = bench.beauty((256, 144), &pose, &camera, &params);
        let (expected, gbuffer) = twin(&scene, &pose, &camera, (256, 144), &params);
        assert_agrees(name, &card, &expected, &gbuffer);
        pictures.push(card);
    }
    assert_ne!(pictures[0], pictures[1], "boulders move");
}

/// Files beside a scene's file.
struct Beside(PathBuf);

impl Files for Beside {
    fn read(&self, uri: &str, _limit_bytes: u64) -> std::io::Result<Vec<u8>> {
        std::fs::read(self.0.join(uri))
    }
}

#[test]
fn scenes_of_others_look_as_the_twin_draws_them() {
    let folder = std::env::var_os("DAPPLE_SHARED")
        .map_or_else(|| concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared").into(), PathBuf::from)
        .join("scenes");
    if !folder.exists() {
        eprintln!("skipped: scenes of others, because {} is not there", folder.display());
        return;
    }
    for (path, time) in [
        ("anim-CesiumMan/CesiumMan.glb", 0.7),
        ("anim-Fox/Fox.glb", 0.3),
        ("anim-AnimatedMorphSphere/AnimatedMorphSphere.glb", 1.1),
        ("NormalTangentTest/NormalTangentTest.glb", 0.0),
        ("house-alphamask/house.glb", 0.0),
        ("DamagedHelmet/DamagedHelmet.glb", 0.0),
    ] {
        let path = folder.join(path);
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        let bytes = std::fs::read(&path).unwrap();
        let scene = dapple_scene::load(&name, &bytes, &Beside(path.parent().unwrap().into())).unwrap();
        let Some(mut bench) = Bench::new(&scene, 1, &[]) else { return };
        let pose = scene.pose(time);
        let bounds = scene.bounds_world(&pose);
        let eye = bounds.center() + Vec3::new(0.4, 0.3, 0.7) * bounds.diagonal();
        let camera = PosedCamera::look_at(eye, bounds.center(), 0.9);
        let params = ShadeParams { shadow_resolution: 512, ..ShadeParams::default() };
        let card = bench.beauty(SIZE, &pose, &camera, &params);
        let (expected, gbuffer) = twin(&scene, &pose, &camera, SIZE, &params);
        assert_agrees(&name, &card, &expected, &gbuffer);
    }
}

#[test]
fn what_does_not_fit_is_an_error() {
    let scene = bent_and_swollen();
    let Some(bench) = Bench::new(&scene, 1, &[]) else { return };
    let options = GpuSceneOptions::default();
    let mut broken = scene.clone();
    broken.meshes[2].triangles[1][0] = 77;
    let error = super::super::GpuScene::new(&bench.gpu, Arc::new(broken), &options).unwrap_err().to_string();
    assert!(error.contains("mesh 2"), "{error}");
    let mut broken = scene;
    broken.meshes[1].normals.pop();
    assert!(super::super::GpuScene::new(&bench.gpu, Arc::new(broken), &options).is_err());
}
