//! Views beside the lit one, several views of a frame, blending, several samples a pixel, look-ups of others.

use dapple_gpu::wgpu;
use dapple_scene::{AlphaMode, Material, PosedCamera};
use glam::{Affine3A, Vec3, Vec4};

use super::super::{Forward, FrameInputs, GpuPoints, Lookup, LookupId, Rect, Transparency, View, ViewKind};
use super::harness::{Bench, FORMAT, assert_agrees, compare, inputs, save, twin};
use crate::compose::{NormalSpace, compose, view_normals, view_visibility};
use crate::gbuffer::rasterize;
use crate::image::{Rgb8Image, ToneCurve, ToneMap, unorm8};
use crate::shade::{ShadeParams, render_shadow_maps, shade};
use crate::testing::{Stage, check_golden, cube, ground, matte, quad, sphere, turned};

const SIZE: (u32, u32) = (240, 160);

fn camera() -> PosedCamera {
    PosedCamera::look_at(Vec3::new(3.5, 3.0, 5.0), Vec3::new(0.0, 0.6, 0.0), 0.8)
}

fn params() -> ShadeParams {
    ShadeParams { shadow_resolution: 256, ..ShadeParams::default() }
}

fn stage() -> Stage {
    let mut stage = Stage::new();
    stage.add(ground(6.0), 0, Affine3A::IDENTITY);
    stage.add(sphere(24, 48), 0, Affine3A::from_translation(Vec3::new(-0.9, 1.0, 0.2)));
    let gold = stage.add_material(matte(Vec3::new(0.8, 0.6, 0.2)));
    stage.add(cube(), gold, turned(0.7, Vec3::new(1.6, 1.3, -0.4)));
    stage
}

/// Visibility that is a function of the place and the normal at rest.
const BY_PLACE: &str = "
fn lookup_visibility(s: LookupInput) -> f32 {
    return clamp(0.5 + 0.15 * s.position_rest.y + 0.1 * s.position_rest.x + 0.3 * s.normal_rest.y, 0.0, 1.0);
}";

fn by_place() -> Lookup {
    Lookup { label: "by place", wgsl: vec![BY_PLACE], needs_rest: true, layout: None }
}

#[test]
fn look_ups_get_the_place_at_rest() {
    let mut stage = stage();
    // Rest space and world differ, by a mirror too.
    stage.pose.instances[2].world_from_mesh =
        turned(2.0, Vec3::new(1.4, 1.2, 0.3)) * Affine3A::from_scale(Vec3::new(-0.8, 0.8, 0.8));
    stage.scene.instances[1].rest_from_mesh = glam::Mat3::from_diagonal(Vec3::new(1.0, -1.0, 2.0));
    let Some(mut bench) = Bench::new(&stage.scene, 1, &[by_place()]) else { return };
    let gbuffer = rasterize(&stage.scene, &stage.pose, &camera(), SIZE.0, SIZE.1, 1).unwrap();
    let visibility = gbuffer.map_surfaces_rest(&stage.scene, |_, s| {
        s.map_or(1.0, |s| {
            let (p, n) = (s.position_rest, s.normal_rest);
            (0.5 + 0.15 * p.y + 0.1 * p.x + 0.3 * n.y).clamp(0.0, 1.0)
        })
    });
    let params = params();
    let lookup = LookupId::added(0);
    let views = [View { kind: ViewKind::Visibility, ..View::new(camera(), lookup) }];
    let card = bench.draw(SIZE, &inputs(&stage.pose, &params, &views));
    let expected = view_visibility(&gbuffer, &visibility).unwrap();
    assert_agrees("rest-visibility", &card, &expected, &gbuffer);
    // And visibility multiplies ambient light only.
    let views = [View::new(camera(), lookup)];
    let card = bench.draw(SIZE, &inputs(&stage.pose, &params, &views));
    let maps = render_shadow_maps(&stage.scene, &stage.pose, &params);
    let shaded = shade(&stage.scene, &stage.pose, &camera(), &gbuffer, &maps, &params);
    let expected = compose(&shaded, &gbuffer, Some(&visibility)).unwrap().to_rgb8(&ToneMap::default());
    assert_agrees("rest-beauty", &card, &expected, &gbuffer);
}

#[test]
fn normals_are_shown_as_the_twin_shows_them() {
    let stage = stage();
    let Some(mut bench) = Bench::new(&stage.scene, 1, &[]) else { return };
    let gbuffer = rasterize(&stage.scene, &stage.pose, &camera(), SIZE.0, SIZE.1, 1).unwrap();
    let views = [View { kind: ViewKind::Normal, ..View::new(camera(), LookupId::NONE) }];
    let card = bench.draw(SIZE, &inputs(&stage.pose, &params(), &views));
    let expected = view_normals(&gbuffer, &stage.scene, &stage.pose, NormalSpace::World);
    assert_agrees("normals", &card, &expected, &gbuffer);
}

#[test]
fn tone_curves_and_exposure() {
    let stage = stage();
    let Some(mut bench) = Bench::new(&stage.scene, 1, &[]) else { return };
    let params = ShadeParams { max_shadowed_lights: 0, ..params() };
    let gbuffer = rasterize(&stage.scene, &stage.pose, &camera(), SIZE.0, SIZE.1, 1).unwrap();
    let maps = render_shadow_maps(&stage.scene, &stage.pose, &params);
    let shaded = shade(&stage.scene, &stage.pose, &camera(), &gbuffer, &maps, &params);
    let linear = compose(&shaded, &gbuffer, None).unwrap();
    for (name, curve) in
        [("clamp", ToneCurve::Clamp), ("reinhard", ToneCurve::Reinhard), ("filmic", ToneCurve::Filmic)]
    {
        let tone_map = ToneMap { exposure: 1.7, curve };
        let views = [View::new(camera(), LookupId::NONE)];
        let card = bench.draw(SIZE, &FrameInputs { tone_map, ..inputs(&stage.pose, &params, &views) });
        assert_agrees(name, &card, &linear.to_rgb8(&tone_map), &gbuffer);
    }
}

#[test]
fn the_golden_picture_is_the_twins_and_the_cards() {
    let stage = stage();
    let (expected, gbuffer) = twin(&stage.scene, &stage.pose, &camera(), (128, 128), &params());
    check_golden("forward", "still-life", &expected);
    let Some(mut bench) = Bench::new(&stage.scene, 1, &[]) else { return };
    let card = bench.beauty((128, 128), &stage.pose, &camera(), &params());
    assert_agrees("golden", &card, &expected, &gbuffer);
}

/// Pixels of a part of a picture.
fn crop(picture: &Rgb8Image, rect: Rect) -> Vec<[u8; 3]> {
    let rows = rect.y..rect.y + rect.height;
    rows.flat_map(|y| (rect.x..rect.x + rect.width).map(move |x| (x, y)))
        .map(|(x, y)| picture.pixels[(y * picture.width + x) as usize])
        .collect()
}

#[test]
fn views_share_a_picture() {
    let stage = stage();
    let Some(mut bench) = Bench::new(&stage.scene, 1, &[by_place()]) else { return };
    let params = params();
    let whole = |bench: &mut Bench, lookup| {
        bench.draw(SIZE, &inputs(&stage.pose, &params, &[View::new(camera(), lookup)]))
    };
    let (plain, dark) = (whole(&mut bench, LookupId::NONE), whole(&mut bench, LookupId::added(0)));
    assert_ne!(plain, dark);
    // Split: the same camera, another look-up right of a column.
    let left = Rect { x: 0, y: 0, width: 100, height: SIZE.1 };
    let right = Rect { x: 100, width: SIZE.0 - 100, ..left };
    let views = [
        View { scissor: Some(left), ..View::new(camera(), LookupId::NONE) },
        View { scissor: Some(right), ..View::new(camera(), LookupId::added(0)) },
    ];
    let split = bench.draw(SIZE, &inputs(&stage.pose, &params, &views));
    save("split", &split);
    assert_eq!(crop(&split, left), crop(&plain, left));
    assert_eq!(crop(&split, right), crop(&dark, right));
    // Stereo: two cameras side by side, each with the picture it would have alone.
    let eyes = [-0.03, 0.03].map(|x| {
        let mut eye = camera();
        eye.world_from_view *= Affine3A::from_translation(Vec3::new(x, 0.0, 0.0));
        eye
    });
    let halves = [0, SIZE.0 / 2].map(|x| Rect { x, y: 0, width: SIZE.0 / 2, height: SIZE.1 });
    let views = [0, 1].map(|i| View { viewport: Some(halves[i]), ..View::new(eyes[i], LookupId::NONE) });
    let stereo = bench.draw(SIZE, &inputs(&stage.pose, &params, &views));
    save("stereo", &stereo);
    for (eye, half) in eyes.into_iter().zip(halves) {
        let alone = bench.beauty((SIZE.0 / 2, SIZE.1), &stage.pose, &eye, &params);
        assert_eq!(crop(&stereo, half), alone.pixels);
    }
}

#[test]
fn points_are_squares_over_a_dimmed_picture() {
    let stage = stage();
    let Some(mut bench) = Bench::new(&stage.scene, 1, &[]) else { return };
    let mut points = GpuPoints::new(&bench.gpu);
    // On the floor in the open, and behind the cube.
    points.upload(&bench.gpu, [(Vec3::new(0.5, 0.0, 2.0), 1.0), (Vec3::new(0.6, 0.0, -2.6), 1.0)]);
    let params = params();
    let plain = bench.beauty(SIZE, &stage.pose, &camera(), &params);
    let views =
        [View { kind: ViewKind::Points, points: Some(&points), ..View::new(camera(), LookupId::NONE) }];
    let picture = bench.draw(SIZE, &inputs(&stage.pose, &params, &views));
    save("points", &picture);
    let yellow = picture.pixels.iter().filter(|&&p| p == [255, 233, 68]).count();
    assert_eq!(yellow, 9, "one square of three by three pixels");
    let dimmed = plain
        .pixels
        .iter()
        .zip(&picture.pixels)
        .filter(|(a, b)| (0..3).all(|c| unorm8(f32::from(a[c]) / 255.0 * 0.4).abs_diff(b[c]) <= 1));
    assert!(dimmed.count() >= plain.pixels.len() - 9);
}

#[test]
fn blended_surfaces_show_what_is_behind() {
    let mut stage = stage();
    let glass = |color: Vec3| Material {
        base_color_factor: color.extend(0.4),
        alpha_mode: AlphaMode::Blend,
        double_sided: true,
        unlit: true,
        ..Material::default()
    };
    let (red, blue) = (stage.add_material(glass(Vec3::X)), stage.add_material(glass(Vec3::Z)));
    let pane = |z: f32| {
        quad([
            Vec3::new(-1.0, 0.3, z),
            Vec3::new(1.0, 0.3, z),
            Vec3::new(1.0, 1.8, z),
            Vec3::new(-1.0, 1.8, z),
        ])
    };
    // The nearer one is first in the scene: order must come from the camera.
    stage.add(pane(2.2), red, Affine3A::IDENTITY);
    stage.add(pane(1.6), blue, Affine3A::IDENTITY);
    let Some(mut bench) = Bench::new(&stage.scene, 1, &[]) else { return };
    let clamp = ToneMap { exposure: 1.0, curve: ToneCurve::Clamp };
    let params = ShadeParams { max_shadowed_lights: 0, ..params() };
    let front = PosedCamera::look_at(Vec3::new(0.0, 1.0, 7.0), Vec3::new(0.0, 1.0, 0.0), 0.8);
    let back = PosedCamera::look_at(Vec3::new(0.0, 1.0, -7.0), Vec3::new(0.0, 1.0, 0.0), 0.8);
    let mut draw = |camera, transparency| {
        let views = [View::new(camera, LookupId::NONE)];
        let base = inputs(&stage.pose, &params, &views);
        bench.draw(SIZE, &FrameInputs { tone_map: clamp, transparency, ..base })
    };
    let blended = draw(front, Transparency::Blend);
    save("blend-front", &blended);
    save("blend-back", &draw(back, Transparency::Blend));
    let cutout = draw(front, Transparency::Cutout);
    // Alpha is below one half: as cutouts both panes are holes.
    let at = (SIZE.1 / 2 * SIZE.0 + SIZE.0 / 2) as usize;
    let under = cutout.pixels[at].map(f32::from);
    let over =
        |below: [f32; 3], color: [f32; 3]| std::array::from_fn(|c| below[c] * 0.6 + color[c] * 255.0 * 0.4);
    let expected: [f32; 3] = over(over(under, [0.0, 0.0, 1.0]), [1.0, 0.0, 0.0]);
    for c in 0..3 {
        assert!(
            (f32::from(blended.pixels[at][c]) - expected[c]).abs() < 2.0,
            "{:?} {expected:?}",
            blended.pixels[at]
        );
    }
}

#[test]
fn four_samples_a_pixel_smooth_edges() {
    let stage = stage();
    let Some(mut bench) = Bench::new(&stage.scene, 4, &[]) else { return };
    let params = params();
    let card = bench.beauty(SIZE, &stage.pose, &camera(), &params);
    save("msaa", &card);
    let (single, gbuffer) = twin(&stage.scene, &stage.pose, &camera(), SIZE, &params);
    let difference = compare(&card, &single, &gbuffer);
    assert!(difference.within > 0.985, "{difference:?}");
    // The whole picture, edges too, lies nearer to many samples than to one.
    let fine = rasterize(&stage.scene, &stage.pose, &camera(), SIZE.0, SIZE.1, 4).unwrap();
    let maps = render_shadow_maps(&stage.scene, &stage.pose, &params);
    let shaded = shade(&stage.scene, &stage.pose, &camera(), &fine, &maps, &params);
    let fine = compose(&shaded, &fine, None).unwrap().to_rgb8(&ToneMap::default());
    let error = |a: &Rgb8Image| -> f64 {
        let squares = a
            .pixels
            .iter()
            .zip(&fine.pixels)
            .flat_map(|(p, q)| (0..3).map(move |c| f64::from(p[c].abs_diff(q[c])).powi(2)));
        squares.sum()
    };
    assert!(error(&card) < 0.5 * error(&single), "{} {}", error(&card), error(&single));
}

#[test]
fn mistakes_are_errors_and_record_nothing() {
    let stage = stage();
    let with_group = |gpu: &dapple_gpu::Gpu| Lookup {
        label: "grouped",
        wgsl: vec![
            "@group(3) @binding(0) var<uniform> level: vec4<f32>;
            fn lookup_visibility(s: LookupInput) -> f32 { return level.x; }",
        ],
        needs_rest: false,
        layout: Some(gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: None,
            entries: &[wgpu::BindGroupLayoutEntry {
                binding: 0,
                visibility: wgpu::ShaderStages::FRAGMENT,
                ty: wgpu::BindingType::Buffer {
                    ty: wgpu::BufferBindingType::Uniform,
                    has_dynamic_offset: false,
                    min_binding_size: None,
                },
                count: None,
            }],
        })),
    };
    let Some(mut bench) = Bench::new(&stage.scene, 1, &[]) else { return };
    let gpu = bench.gpu.clone();
    assert!(Forward::new(&gpu, FORMAT, 3, &[]).is_err());
    assert!(Forward::new(&gpu, wgpu::TextureFormat::Rgba8UnormSrgb, 1, &[]).is_err());
    let lookup = with_group(&gpu);
    bench.forward = Forward::new(&gpu, FORMAT, 1, std::slice::from_ref(&lookup)).unwrap();
    let params = params();
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d { width: 8, height: 8, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: FORMAT,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
        view_formats: &[],
    });
    let target = texture.create_view(&Default::default());
    let attempt = |bench: &mut Bench, views: &[View<'_>], pose: &dapple_scene::Pose| {
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let inputs = inputs(pose, &params, views);
        let result = bench.forward.draw(&gpu, &mut encoder, &target, (8, 8), &mut bench.scene, &inputs);
        gpu.queue.submit([encoder.finish()]);
        result
    };
    let view = View::new(camera(), LookupId::NONE);
    let outside = Rect { x: 4, y: 0, width: 5, height: 8 };
    let mut blind = camera();
    blind.world_from_view = Affine3A::ZERO;
    let wrong: [&[View<'_>]; 6] = [
        &[],
        &[View { viewport: Some(outside), ..view }],
        &[View { scissor: Some(Rect { width: 0, ..outside }), ..view }],
        &[View { lookup: LookupId::added(0), ..view }],
        &[View { lookup: LookupId::added(7), ..view }],
        &[View { camera: blind, ..view }],
    ];
    for views in wrong {
        assert!(attempt(&mut bench, views, &stage.pose).is_err());
    }
    assert!(attempt(&mut bench, &[view], &dapple_scene::Pose::default()).is_err());
    // With its group the same look-up draws.
    let buffer = super::super::layouts::buffer(
        &gpu.device,
        "level",
        bytemuck::bytes_of(&Vec4::splat(0.25)),
        wgpu::BufferUsages::UNIFORM,
    );
    let layout = lookup.layout.as_ref().unwrap();
    let group = super::super::layouts::group(&gpu.device, layout, &[buffer.as_entire_binding()]);
    bench.forward.bind_lookup(LookupId::added(0), group);
    let views = [View { kind: ViewKind::Visibility, ..View::new(camera(), LookupId::added(0)) }];
    let gray = bench.draw(SIZE, &inputs(&stage.pose, &params, &views));
    assert!(gray.pixels.iter().all(|&p| p == [64; 3] || p == crate::compose::BACKGROUND_RGB8));
    assert!(gray.pixels.contains(&[64; 3]));
    assert_eq!(gpu.take_fault(), None);
    let empty = dapple_scene::Scene::default();
    let mut nothing = Bench::new(&empty, 1, &[]).unwrap();
    let blank = nothing.beauty((8, 8), &empty.pose(0.0), &camera(), &params);
    assert_eq!(blank.pixels, vec![blank.pixels[0]; 64]);
}
