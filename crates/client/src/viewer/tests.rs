//! The viewer against the client on the processor, and what it promises about work, fades and wrong frames.

mod edits;
mod lights;
mod parts;

use std::sync::Arc;

use dapple_gpu::testing::{block_on, gpu_for_tests};
use dapple_gpu::{Gpu, read_texture, wgpu};
use dapple_render::forward::Transparency;
use dapple_scene::glam::Vec3;
use dapple_scene::{NoFiles, PosedCamera, Scene, builtin};
use dapple_server::{Server, ServerConfig};
use dapple_store::points::{MAX_COORDINATE, PackedNormal, PointLayout, PointSet, PointStore};
use dapple_stream::{Limits, Publisher, PublisherConfig};

use super::{DebugView, DrawOptions, Method, Viewer, ViewerConfig};
use crate::{Client, PictureParams, Reconstruction};

const SIZE: (u32, u32) = (160, 90);

fn atrium() -> Arc<Scene> {
    let glb = builtin::glb("atrium", 0.05).expect("the name is known");
    Arc::new(
        dapple_scene::load("atrium.glb", &glb, &NoFiles).expect("the loader reads what the builder writes"),
    )
}

fn server(scene: &Arc<Scene>, points_per_m2: f32) -> Server {
    let mut config = ServerConfig::default();
    config.generate.points_per_m2 = points_per_m2;
    config.update.rays = 16;
    Server::new(scene.clone(), &config, &|_| ()).expect("defaults are in range")
}

fn viewer(gpu: &Gpu, scene: &Arc<Scene>) -> Viewer {
    let mut config = ViewerConfig::new(wgpu::TextureFormat::Rgba8Unorm);
    (config.samples, config.mips) = (1, false);
    let mut viewer = Viewer::new(gpu, scene.clone(), config).expect("the scene fits");
    viewer.set_transparency(Transparency::Cutout);
    viewer
}

fn camera(scene: &Scene, time_s: f64) -> PosedCamera {
    scene.camera_paths()[0].camera(scene, &scene.pose(time_s))
}

fn picture(gpu: &Gpu, viewer: &mut Viewer, time_s: f64, now_s: f64, options: &DrawOptions) -> Vec<[u8; 4]> {
    let camera = camera(viewer.scene(), time_s);
    picture_from(gpu, viewer, &camera, time_s, now_s, options)
}

fn picture_from(
    gpu: &Gpu,
    viewer: &mut Viewer,
    camera: &PosedCamera,
    time_s: f64,
    now_s: f64,
    options: &DrawOptions,
) -> Vec<[u8; 4]> {
    let target = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d { width: SIZE.0, height: SIZE.1, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba8Unorm,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    });
    let view = target.create_view(&wgpu::TextureViewDescriptor::default());
    viewer.draw(gpu, &view, SIZE, camera, time_s, now_s, options).expect("it draws");
    let bytes = block_on(read_texture(gpu, &target, 0)).expect("it can be read");
    bytes.chunks_exact(4).map(|p| [p[0], p[1], p[2], p[3]]).collect()
}

fn work_to_the_end(viewer: &mut Viewer, texels: usize) -> usize {
    let mut calls = 0;
    loop {
        calls += 1;
        let progress = viewer.work(texels);
        if progress.total > 0 && progress.is_complete() {
            return calls;
        }
        assert!(calls < 1_000_000, "work never ends: {progress:?}");
    }
}

/// Mean difference of gray pictures where the twin sees geometry, in codes, and the part of pixels off by more than 6.
fn compare(shown: &[[u8; 4]], twin: &[Option<f32>]) -> (f64, f64) {
    let both = shown.iter().zip(twin).filter_map(|(p, v)| v.map(|v| f64::from(p[0]) - f64::from(v) * 255.0));
    let differences: Vec<f64> = both.map(f64::abs).collect();
    let count = differences.len() as f64;
    assert!(count > 1000.0, "the camera sees the scene");
    let off = differences.iter().filter(|d| **d > 6.0).count() as f64;
    (differences.iter().sum::<f64>() / count, off / count)
}

/// Visibility a pixel by the processor; `None` for the background.
fn twin(client: &Client, scene: &Scene, time_s: f64) -> Vec<Option<f32>> {
    twin_from(client, &camera(scene, time_s), time_s)
}

fn twin_from(client: &Client, camera: &PosedCamera, time_s: f64) -> Vec<Option<f32>> {
    let params = PictureParams { width: SIZE.0, height: SIZE.1, supersample: 1, shade: Default::default() };
    let drawn = client.draw(camera, time_s, &params).expect("it draws");
    let visibility = client.visibility(&drawn, &Reconstruction::Atlas);
    drawn.gbuffer.samples().iter().zip(visibility).map(|(s, v)| s.is_covered().then_some(v)).collect()
}

#[test]
fn it_shows_what_the_processor_shows_after_updates_too() {
    let Some(gpu) = gpu_for_tests() else { return };
    let scene = atrium();
    let mut server = server(&scene, 48.0);
    let mut viewer = viewer(&gpu, &scene);
    let mut client = Client::new(scene.clone(), Limits::default());
    let snapshot = server.join().expect("it can be encoded").expect("there is one");
    viewer.receive(&snapshot.bytes, 0.0).expect("it is sound");
    client.receive(&snapshot.bytes).expect("it is sound");
    let options = DrawOptions { view: DebugView::Visibility, fade_s: Some(0.0), ..DrawOptions::default() };

    // Nothing is ready: all is open.
    let open = picture(&gpu, &mut viewer, 0.0, 0.0, &options);
    let covered = twin(&client, &scene, 0.0);
    assert!(open.iter().zip(&covered).filter(|(_, c)| c.is_some()).all(|(p, _)| p[0] == 255));

    assert!(work_to_the_end(&mut viewer, 2000) > 10, "work is spread over calls");
    let mut frames = 0;
    for tick in 1..=6 {
        let time_s = f64::from(tick) / 5.0;
        if let Some(frame) = server.step(time_s).expect("it steps").frame {
            viewer.receive(&frame.bytes, time_s).expect("it is sound");
            client.receive(&frame.bytes).expect("it is sound");
            frames += 1;
        }
    }
    assert!(frames > 0, "walkers and boulders move");
    let shown = picture(&gpu, &mut viewer, 1.2, 1.2, &options);
    let (mean, off) = compare(&shown, &twin(&client, &scene, 1.2));
    // Edges fall on other pixels now and then; the rest is rounding.
    assert!(mean < 1.0 && off < 0.03, "mean difference {mean}, {off} of the pixels off");
    let stats = viewer.stats();
    assert_eq!(stats.frames_received, 1 + frames);
    assert!(stats.texels > 0 && stats.memory_bytes.0 > 0 && stats.last_frame_s == Some(1.2));
}

#[test]
fn surfaces_seen_from_both_sides_have_light_on_both() {
    let Some(gpu) = gpu_for_tests() else { return };
    let mut scene = (*atrium()).clone();
    for material in &mut scene.materials {
        material.double_sided = true;
    }
    let scene = Arc::new(scene);
    let mut viewer = viewer(&gpu, &scene);
    let mut client = Client::new(scene.clone(), Limits::default());
    let snapshot = server(&scene, 48.0).join().expect("it can be encoded").expect("there is one");
    viewer.receive(&snapshot.bytes, 0.0).expect("it is sound");
    client.receive(&snapshot.bytes).expect("it is sound");
    work_to_the_end(&mut viewer, usize::MAX);
    let options = DrawOptions { view: DebugView::Visibility, fade_s: Some(0.0), ..DrawOptions::default() };
    // From outside and below the hall shows little but backs.
    let bounds = scene.bounds_world(&scene.pose(0.0));
    let middle = 0.5 * (bounds.min + bounds.max);
    let mut backs = 0;
    for direction in [Vec3::X, Vec3::NEG_Z, Vec3::new(0.3, -1.0, 0.2)] {
        let camera = PosedCamera::look_at(middle + direction * 0.8 * bounds.diagonal(), middle, 0.8);
        let shown = picture_from(&gpu, &mut viewer, &camera, 0.0, 1.0, &options);
        let (mean, off) = compare(&shown, &twin_from(&client, &camera, 0.0));
        assert!(
            mean < 1.0 && off < 0.03,
            "from {direction}: mean difference {mean}, {off} of the pixels off"
        );
        let params =
            PictureParams { width: SIZE.0, height: SIZE.1, supersample: 1, shade: Default::default() };
        let drawn = client.draw(&camera, 0.0, &params).expect("it draws");
        backs += drawn.gbuffer.samples().iter().filter(|s| s.is_back_face()).count();
    }
    assert!(backs > 3000, "{backs} pixels show a back");
}

/// A server of the atrium, and a viewer that has joined it.
fn joined(gpu: &Gpu) -> (Server, Viewer) {
    let scene = atrium();
    let mut server = server(&scene, 32.0);
    let mut viewer = viewer(gpu, &scene);
    let snapshot = server.join().expect("it can be encoded").expect("there is one");
    viewer.receive(&snapshot.bytes, 0.0).expect("it is sound");
    (server, viewer)
}

/// Lets all surfaces have their light and their fades end, by 9 s; gives options to show visibility with, fading for 0.5 s.
fn at_rest(gpu: &Gpu, viewer: &mut Viewer) -> DrawOptions {
    let options = DrawOptions { view: DebugView::Visibility, fade_s: Some(0.5), ..DrawOptions::default() };
    picture(gpu, viewer, 0.0, 0.0, &options);
    work_to_the_end(viewer, usize::MAX);
    picture(gpu, viewer, 0.0, 9.0, &options);
    options
}

#[test]
fn a_fade_goes_from_the_last_update_to_this_one() {
    let Some(gpu) = gpu_for_tests() else { return };
    let (mut server, mut viewer) = joined(&gpu);
    let options = at_rest(&gpu, &mut viewer);
    // The scene's time stands still, so that only visibility changes.
    let before = picture(&gpu, &mut viewer, 0.0, 10.0, &options);
    let frame = server.step(1.0).expect("it steps").frame.expect("something moved");
    viewer.receive(&frame.bytes, 10.0).expect("it is sound");
    let start = picture(&gpu, &mut viewer, 0.0, 10.0, &options);
    let middle = picture(&gpu, &mut viewer, 0.0, 10.25, &options);
    let end = picture(&gpu, &mut viewer, 0.0, 10.5, &options);
    assert_eq!(before, start, "a fade begins with what was shown");
    let changed: Vec<_> = (0..end.len()).filter(|&i| start[i][0].abs_diff(end[i][0]) > 8).collect();
    assert!(!changed.is_empty(), "the update is seen");
    for i in changed {
        let half = (u16::from(start[i][0]) + u16::from(end[i][0])) / 2;
        assert!(
            half.abs_diff(u16::from(middle[i][0])) <= 2,
            "pixel {i}: {:?} {:?} {:?}",
            start[i],
            middle[i],
            end[i]
        );
    }
}

#[test]
fn an_update_in_the_middle_of_a_fade_goes_on_from_what_is_shown() {
    let Some(gpu) = gpu_for_tests() else { return };
    let (mut server, mut viewer) = joined(&gpu);
    let options = at_rest(&gpu, &mut viewer);
    for tick in 0..4 {
        let now_s = 10.0 + 0.2 * f64::from(tick);
        let before = picture(&gpu, &mut viewer, 0.0, now_s, &options);
        let frame = server.step(f64::from(tick + 1)).expect("it steps").frame.expect("something moved");
        viewer.receive(&frame.bytes, now_s).expect("it is sound");
        let after = picture(&gpu, &mut viewer, 0.0, now_s, &options);
        let jump = before.iter().zip(&after).map(|(a, b)| a[0].abs_diff(b[0])).max();
        // Old values are rounded to a code, and cards may filter in whole codes; without going on it would be tens.
        assert!(jump <= Some(2), "update {tick}: a pixel jumps by {jump:?}");
    }
}

#[test]
fn every_view_and_method_draws_and_a_split_shows_both() {
    let Some(gpu) = gpu_for_tests() else { return };
    let (_, mut viewer) = joined(&gpu);
    work_to_the_end(&mut viewer, usize::MAX);
    let mut pictures = Vec::new();
    use DebugView::{Age, Beauty, Error, Normal, Points, Texels, Visibility, Weights};
    for view in [Beauty, Visibility, Normal, Points, Texels, Weights, Age, Error] {
        let options = DrawOptions { view, fade_s: Some(0.0), ..DrawOptions::default() };
        let shown = picture(&gpu, &mut viewer, 0.5, 20.0, &options);
        assert!(shown.iter().any(|p| *p != shown[0]), "{view:?} shows one colour");
        assert!(pictures.iter().all(|other| *other != shown), "{view:?} looks like another view");
        pictures.push(shown);
    }
    let with = |method, split| DrawOptions {
        view: Visibility,
        method,
        split,
        fade_s: Some(0.0),
        ..DrawOptions::default()
    };
    let mut shown = |options: DrawOptions| picture(&gpu, &mut viewer, 0.5, 20.0, &options);
    let open = shown(with(Method::None, None));
    let atlas = shown(with(Method::Psao, None));
    let paper = shown(with(Method::PsaoPaper, None));
    assert!(paper != open && paper != atlas, "the paper's look-up is one of its own");
    let both = shown(with(Method::Psao, Some((0.25, Method::None))));
    let half = SIZE.0 as usize / 4;
    for (i, pixel) in both.iter().enumerate() {
        let source = if i % SIZE.0 as usize >= half { &open } else { &atlas };
        assert_eq!(*pixel, source[i], "pixel {i}");
    }
}

#[test]
fn frames_of_another_scene_and_noise_change_nothing() {
    let Some(gpu) = gpu_for_tests() else { return };
    let scene = atrium();
    let mut other = (*scene).clone();
    other.materials[0].metallic_factor = 0.123;
    let other = Arc::new(other);
    let snapshot = server(&other, 4.0).join().expect("it can be encoded").expect("there is one");
    let mut viewer = viewer(&gpu, &scene);
    assert!(viewer.receive(&snapshot.bytes, 0.0).is_err());
    assert!(viewer.receive(b"no frame at all", 0.0).is_err());
    assert_eq!(viewer.stats().frames_received, 0);
    assert!(viewer.store().is_none());
    assert_eq!(viewer.work(1000).total, 0);
}

/// Two points as far apart as a layout allows, 1 m a step, spaced `spacing_m`.
fn far_apart(spacing_m: f32) -> PointStore {
    let set = PointSet {
        positions: vec![[0; 3], [MAX_COORDINATE; 3]],
        normals: vec![PackedNormal::default(); 2],
        ..PointSet::default()
    };
    let layout = PointLayout::new(1.0, spacing_m, vec![set]).expect("points are in order");
    PointStore::new(Arc::new(layout), vec![0; 2]).expect("one value a point")
}

#[test]
fn a_look_up_that_fails_is_left_out_until_other_points_come() {
    let Some(gpu) = gpu_for_tests() else { return };
    let scene = atrium();
    let mut viewer = viewer(&gpu, &scene);
    let mut publisher = Publisher::new(scene.hash().0, PublisherConfig::default());
    let mut publish = |store: &PointStore| publisher.publish(store).expect("news");
    let with = |method| DrawOptions {
        view: DebugView::Visibility,
        method,
        fade_s: Some(0.0),
        ..DrawOptions::default()
    };
    viewer.receive(&publish(&far_apart(1.0)).bytes, 0.0).expect("it is sound");
    let open = picture(&gpu, &mut viewer, 0.0, 0.0, &with(Method::None));
    assert_eq!(viewer.problem(), None);
    // More cells than can be numbered.
    for _ in 0..2 {
        assert!(picture(&gpu, &mut viewer, 0.0, 0.0, &with(Method::PsaoPaper)) == open);
        assert!(viewer.problem().is_some_and(|problem| problem.contains("cells")), "{:?}", viewer.problem());
    }
    let error = DrawOptions { view: DebugView::Error, ..with(Method::PsaoPaper) };
    picture(&gpu, &mut viewer, 0.0, 0.0, &error);
    // Wider cells are fewer.
    viewer.receive(&publish(&far_apart(20_000.0)).bytes, 1.0).expect("it is sound");
    assert_eq!(viewer.problem(), None);
    picture(&gpu, &mut viewer, 0.0, 1.0, &with(Method::PsaoPaper));
    assert_eq!(viewer.problem(), None);
}
