//! Shaders without a device, and pictures of the card beside the twins'.

mod second_camera;

use std::mem::offset_of;
use std::sync::Arc;

use dapple_gpu::testing::{
    block_on, check_struct, gpu_for_tests, naga::ShaderStage, translate_to_webgl2, validate,
};
use dapple_gpu::{Gpu, read_texture, wgpu};
use dapple_scene::{Pose, PosedCamera, Projection};
use glam::Vec3;

use super::plan::Shader;
use super::uniforms::*;
use super::{Layered, ScreenKind, ScreenMethod, ScreenPasses, ScreenView, StochasticParams};
use crate::forward::{Forward, GpuScene, GpuSceneOptions, LookupId};
use crate::gbuffer::GuardBand;
use crate::gbuffer::rasterize;
use crate::hbao::HbaoParams;
use crate::sao::{MipFilter, SaoParams};
use crate::sdao::{Looks, MapParams, Picks, SideParams, StochasticMap};
use crate::testing::Stage;
use crate::testing::screen::{look, still_life};
use crate::upsample::at_half_resolution;

#[test]
fn every_pass_is_valid_and_within_webgl2() {
    for shader in Shader::ALL {
        let (wgsl, entry) = shader.module();
        let module = validate(&wgsl).unwrap_or_else(|e| panic!("{shader:?}: {e}"));
        // Browsers take derivatives only where all of a quad come, and `&&` is a branch.
        let branched = |line: &str| line.contains("dpd") && (line.contains("&&") || line.contains("||"));
        assert!(!wgsl.lines().any(branched), "{shader:?}");
        // Samples of depths are what WebGL2 cannot read.
        if shader == Shader::Resolve {
            continue;
        }
        for (stage, entry) in [(ShaderStage::Vertex, "screen_vertex"), (ShaderStage::Fragment, entry)] {
            translate_to_webgl2(&module, stage, entry).unwrap_or_else(|e| panic!("{shader:?}: {e}"));
        }
    }
}

/// Name and offset of fields.
macro_rules! members {
    ($ty:ty: $($field:ident)*) => {
        [$((stringify!($field), offset_of!($ty, $field))),*]
    };
}

#[test]
fn uniforms_are_laid_out_as_in_the_shaders() {
    let check = |shader: Shader, name, size, members: &[(&str, usize)]| {
        let module = validate(&shader.module().0).unwrap();
        check_struct(&module, name, size, members).unwrap();
    };
    let members = members!(ScreenUniform: view_from_world_x view_from_world_y view_from_world_z half_extent size
        span is_parallel is_half depth samples_per_metre pad);
    check(Shader::Distance, "Screen", size_of::<ScreenUniform>(), &members);
    check(Shader::HbaoBeside, "Screen", size_of::<ScreenUniform>(), &members);
    let members = members!(SideUniform: main side_from_main_x side_from_main_y side_from_main_z);
    check(Shader::HbaoBeside, "SideParams", size_of::<SideUniform>(), &members);
    check(Shader::SsaoBeside, "SideParams", size_of::<SideUniform>(), &members);
    let members = members!(BilateralUniform: axis taps stride tolerance_m inverse_sigma pad);
    check(Shader::Bilateral, "BilateralParams", size_of::<BilateralUniform>(), &members);
    let members = members!(ObscuranceUniform: radius_m sigma_m bias_m beta exponent samples turns switch_log2
        top_level farthest_m pad);
    check(Shader::Alchemy, "ObscuranceParams", size_of::<ObscuranceUniform>(), &members);
    let members = members!(MinifyUniform: size filtering pad);
    check(Shader::Minify, "MinifyParams", size_of::<MinifyUniform>(), &members);
    let members = members!(ReconstructUniform: axis taps stride sharpness pad_a pad_b);
    check(Shader::Reconstruct, "ReconstructParams", size_of::<ReconstructUniform>(), &members);
    let members = members!(HbaoUniform: radius_m directions steps bias strength is_mean
        hidden_layers looks compensation pad_a pad_b);
    check(Shader::Hbao, "HbaoParams", size_of::<HbaoUniform>(), &members);
    let members = members!(GtaoUniform: radius_m slices steps thickness_m bias pad_a pad_b);
    check(Shader::Gtao, "GtaoParams", size_of::<GtaoUniform>(), &members);
    let members = members!(SsaoUniform: radius_m samples height_m hidden_layers compensation pad_a pad_b
        offsets turns);
    check(Shader::Ssao, "SsaoParams", size_of::<SsaoUniform>(), &members);
    let members = members!(BlurUniform: axis half_width inverse_sigma middle pad_a pad_b);
    check(Shader::SsaoBlur, "BlurParams", size_of::<BlurUniform>(), &members);
    let members = members!(ResolveUniform: full_size is_half pad);
    check(Shader::Resolve, "ResolveParams", size_of::<ResolveUniform>(), &members);
    let members = members!(HalveUniform: full_size pad);
    check(Shader::Halve, "HalveParams", size_of::<HalveUniform>(), &members);
    let members = members!(PlaceUniform: guard is_half pad);
    check(Shader::Place, "PlaceParams", size_of::<PlaceUniform>(), &members);
}

struct Bench {
    gpu: Gpu,
    pose: Pose,
    scene: GpuScene,
    forward: Forward,
    passes: ScreenPasses,
}

impl Bench {
    fn new(stage: &Stage) -> Option<Bench> {
        let gpu = gpu_for_tests()?;
        let gpu_scene =
            GpuScene::new(&gpu, Arc::new(stage.scene.clone()), &GpuSceneOptions { mips: false }).unwrap();
        let lookups = [ScreenPasses::lookup(&gpu)];
        let forward = Forward::new(&gpu, wgpu::TextureFormat::Rgba8Unorm, 1, &lookups).unwrap();
        let passes = ScreenPasses::new(&gpu, LookupId::added(0)).unwrap();
        Some(Bench { gpu, pose: stage.pose.clone(), scene: gpu_scene, forward, passes })
    }

    /// Visibility and distance of each pixel.
    fn run(&mut self, view: &ScreenView) -> Vec<[f32; 2]> {
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        let Bench { gpu, pose, scene, forward, passes } = self;
        passes.draw(gpu, &mut encoder, forward, scene, pose, view).unwrap();
        gpu.queue.submit([encoder.finish()]);
        self.read(self.passes.picture().unwrap())
    }

    /// The same of a picture that is drawn already.
    fn read(&self, picture: &wgpu::Texture) -> Vec<[f32; 2]> {
        let bytes = block_on(read_texture(&self.gpu, picture, 0)).unwrap();
        let half = |bytes: &[u8]| half_to_f32(u16::from_le_bytes([bytes[0], bytes[1]]));
        bytes.chunks_exact(4).map(|texel| [half(&texel[..2]), half(&texel[2..])]).collect()
    }
}

impl Bench {
    /// The stochastic map that the last picture was made with, if one was.
    fn map(&self, view: &ScreenView) -> Option<StochasticMap> {
        self.map_of(view, 0)
    }

    /// The first camera's, or the second's.
    fn map_of(&self, view: &ScreenView, camera: usize) -> Option<StochasticMap> {
        let ScreenMethod::Stochastic(_, StochasticParams { map, .. }) = view.method else { return None };
        let texture = &self.passes.hidden().unwrap()[camera];
        let (columns, pixels) = (texture.width(), (texture.width() * texture.height()) as usize);
        let mut distances_m = vec![f32::INFINITY; pixels * map.samples as usize];
        for layer in 0..map.samples.div_ceil(4) {
            let bytes = block_on(read_texture(&self.gpu, texture, layer)).unwrap();
            for (pixel, texel) in bytes.chunks_exact(16).enumerate() {
                for i in 0..4u32.min(map.samples - 4 * layer) {
                    let at = 4 * i as usize;
                    let distance = f32::from_le_bytes([0, 1, 2, 3].map(|byte| texel[at + byte]));
                    let place = pixel * map.samples as usize + (4 * layer + i) as usize;
                    distances_m[place] = if distance < 1e29 { distance } else { f32::INFINITY };
                }
            }
        }
        Some(StochasticMap::of_distances(columns, map.samples, distances_m).unwrap())
    }
}

/// The same by the twins, and the distances of the picture; with the maps that the card has drawn.
fn twin(stage: &Stage, view: &ScreenView, bench: &Bench) -> (Vec<f32>, Vec<f32>) {
    let (map, side) = (bench.map(view), second_camera::side_view(stage, view, bench));
    let (map, side) = (map.as_ref(), side.as_ref());
    let size = [view.size.0, view.size.1];
    let wide = view.guard.rasterize(&stage.scene, &stage.pose, &view.camera, size, 1).unwrap();
    let camera = view.guard.camera(&view.camera, size[1]);
    let screen = wide.screen(&stage.scene, &stage.pose, &camera).unwrap();
    let values = if view.half_resolution {
        at_half_resolution(&screen, &mut |_| (), |half, _| view.method.estimate_visibility(half, map, side))
            .unwrap()
    } else {
        view.method.estimate_visibility(&screen, map, side).unwrap()
    };
    let crop = |values: &[f32]| view.guard.crop(values, size, 1).unwrap();
    (crop(&values), crop(screen.distances_m()))
}

fn half_to_f32(bits: u16) -> f32 {
    let (sign, exponent, mantissa) = (bits >> 15, (bits >> 10) & 31, f32::from(bits & 1023));
    let value = match exponent {
        0 => mantissa * 2f32.powi(-24),
        31 => f32::INFINITY,
        e => (1.0 + mantissa / 1024.0) * 2f32.powi(i32::from(e) - 15),
    };
    if sign == 1 { -value } else { value }
}

fn cameras() -> [PosedCamera; 2] {
    [
        Projection::Perspective { yfov: 0.8, near: 0.02 },
        Projection::Orthographic { half_height: 2.0, near: -3.0, far: 20.0 },
    ]
    .map(|projection| PosedCamera { projection, ..look(Vec3::new(1.5, 2.0, 3.0), Vec3::ZERO) })
}

/// All methods, and what their defaults leave out.
fn methods() -> Vec<ScreenMethod> {
    let filters = MipFilter::ALL.map(|filter| {
        ScreenMethod::Sao(SaoParams {
            filter,
            radius_m: 2.0,
            levels: 9,
            switch_log2: 1,
            ..SaoParams::default()
        })
    });
    ScreenKind::ALL.map(ScreenKind::method).into_iter().chain(filters).chain(stochastic()).collect()
}

/// Maps that take several drawings, or less than one, and all ways to look.
fn stochastic() -> Vec<ScreenMethod> {
    let hbao = Layered::Hbao(HbaoParams::hbao());
    let plus = Layered::Hbao(HbaoParams::hbao_plus());
    let usual = StochasticParams::default();
    let with = |samples| StochasticParams { map: MapParams::with_samples(samples), ..usual };
    let paper = StochasticParams {
        map: MapParams::paper(8),
        looks: Looks::WhereFirstIsFar,
        compensation: 2.0,
        ..usual
    };
    let alone = MapParams { picks: Picks::Independent, ..MapParams::with_samples(4) };
    let everywhere = StochasticParams { map: alone, looks: Looks::Everywhere, ..usual };
    [(plus, with(16)), (hbao, with(1)), (plus, paper), (hbao, paper), (plus, everywhere), (hbao, everywhere)]
        .map(|(layered, params)| ScreenMethod::Stochastic(layered, params))
        .to_vec()
}

#[test]
fn card_and_twin_agree() {
    let stage = still_life();
    let Some(mut bench) = Bench::new(&stage) else { return };
    for camera in cameras() {
        for (size, guard, half_resolution) in cases() {
            for method in methods() {
                let view = ScreenView { camera, size, method, guard, half_resolution };
                check_agreement(&stage, &mut bench, &view);
            }
        }
    }
}

/// Sizes, guard bands and resolutions.
fn cases() -> [((u32, u32), GuardBand, bool); 4] {
    let guards = [GuardBand::default(), GuardBand::of_height(0.2, 37).unwrap()];
    [
        ((160, 120), guards[0], false),
        ((61, 37), guards[1], false),
        ((61, 37), guards[0], true),
        ((160, 120), guards[1], true),
    ]
}

/// Draws a picture on the card and by the twin; returns the card's visibility.
fn check_agreement(stage: &Stage, bench: &mut Bench, view: &ScreenView) -> Vec<f32> {
    let ScreenView { camera, size, method, guard, half_resolution } = *view;
    let card = bench.run(view);
    let (twin, distances_m) = twin(stage, view, bench);
    let (mut seen, mut within, mut sum) = (0, 0, 0.0);
    for ((twin, card), distance) in twin.iter().zip(&card).zip(&distances_m) {
        // An edge may fall to the other side.
        if distance.is_finite() != (card[1] < 59_000.0) {
            continue;
        }
        let off = f64::from((twin - card[0]).abs());
        seen += 1;
        within += usize::from(off <= 3.0 / 255.0);
        sum += off;
        if !distance.is_finite() {
            assert_eq!(card[0], 1.0, "{method:?}: the background is open");
        }
    }
    let (part, mean) = (within as f64 / f64::from(seen), sum / f64::from(seen));
    let name = method.kind().name();
    let case = format!("{name} {size:?} {guard:?} half {half_resolution} {:?}", camera.projection);
    eprintln!("{case}: {part:.4} within, mean {mean:.5}");
    assert!(seen > size.0 * size.1 * 99 / 100, "{method:?}: {seen}");
    assert!(part > 0.993 && mean < 0.001, "{case}, {method:?}: {part}, {mean}");
    card.iter().map(|[visibility, _]| *visibility).collect()
}

/// Samples that hold the same surface, of those that hold any: a card has other last bits of depths, and other silhouettes.
#[test]
fn maps_hold_what_the_twins_do() {
    let stage = still_life();
    let Some(mut bench) = Bench::new(&stage) else { return };
    for camera in cameras() {
        for samples in [1, 2, 4, 8, 16] {
            for map_params in [MapParams::with_samples(samples), MapParams::paper(samples)] {
                let stochastic = StochasticParams { map: map_params, ..StochasticParams::default() };
                let method = ScreenMethod::Stochastic(Layered::Hbao(HbaoParams::hbao_plus()), stochastic);
                let (size, guard) = ((160, 120), GuardBand::default());
                let view = ScreenView { camera, size, method, guard, half_resolution: false };
                bench.run(&view);
                let card = bench.map(&view).unwrap();
                let gbuffer = rasterize(&stage.scene, &stage.pose, &camera, size.0, size.1, 1).unwrap();
                let twin =
                    StochasticMap::draw(&stage.scene, &stage.pose, &camera, &gbuffer, &map_params).unwrap();
                let (mut held, mut same, mut counts) = (0, 0, [0, 0]);
                for i in 0..(size.0 * size.1) as usize {
                    for (a, b) in card.distances_m(i).iter().zip(twin.distances_m(i)) {
                        counts[0] += usize::from(a.is_finite());
                        counts[1] += usize::from(b.is_finite());
                        held += usize::from(a.is_finite() || b.is_finite());
                        same += usize::from((a - b).abs() < 1e-3 * b.abs());
                    }
                }
                let part = same as f64 / held as f64;
                eprintln!("{samples} {:?}: {counts:?}, {part:.3} alike", map_params.is_first_left_out);
                assert!(held > 1000, "{held}");
                assert!(counts[0].abs_diff(counts[1]) * 50 < counts[1], "{counts:?}");
                assert!(part > 0.9, "{samples}: {part}");
            }
        }
    }
}

#[test]
fn tiny_pictures_and_guard_bands_are_drawn() {
    let stage = still_life();
    let Some(mut bench) = Bench::new(&stage) else { return };
    for camera in cameras() {
        for method in methods().into_iter().chain(second_camera::methods()) {
            for size in [(1, 1), (2, 1), (1, 3), (5, 7)] {
                for (part, half_resolution) in [(0.0, false), (0.2, true), (0.5, false), (0.0, true)] {
                    let guard = GuardBand::of_height(part, size.1).unwrap();
                    let card = bench.run(&ScreenView { camera, size, method, guard, half_resolution });
                    assert_eq!(card.len() as u32, size.0 * size.1);
                    assert!(
                        card.iter().all(|[v, _]| (0.0..=1.0).contains(v)),
                        "{method:?} {size:?}: {card:?}"
                    );
                }
            }
        }
    }
}

/// Milliseconds of each pass on the adapter at hand, medians of runs in turn: `cargo test --release -p dapple-render --all-features
/// screen_space::tests::times -- --ignored --nocapture`. Each pass is waited for, since a software adapter's own clock is wrong.
#[test]
#[ignore = "a measurement"]
fn times() {
    let glb = dapple_scene::builtin::glb("atrium", 0.5).unwrap();
    let scene = dapple_scene::load("atrium.glb", &glb, &dapple_scene::NoFiles).unwrap();
    let pose = scene.pose_undeformed(3.0);
    let camera = scene.camera_paths()[0].camera(&scene, &pose);
    let stage = Stage { scene, pose };
    let Some(mut bench) = Bench::new(&stage) else { return };
    eprintln!("{}", bench.gpu.adapter.get_info().name);
    let kinds = ScreenKind::ALL.map(|kind| (kind.name().to_owned(), kind.method()));
    table(&mut bench, &camera, (960, 540), &kinds);
    let two = [1, 2].map(|coarseness| {
        let side = SideParams { coarseness, ..SideParams::default() };
        let method = ScreenKind::SdHbaoPlus.method().with_second_camera(Some(side));
        (format!("sd-hbao-plus, two cameras, 1/{coarseness}"), method)
    });
    table(&mut bench, &camera, (960, 540), &two);
    for radius_m in [0.1, 0.5, 1.0, 3.0] {
        let pair = [ScreenKind::Alchemy, ScreenKind::Sao]
            .map(|kind| (format!("{} r = {radius_m}", kind.name()), kind.method().with_radius(radius_m)));
        table(&mut bench, &camera, (1920, 1080), &pair);
    }
}

fn table(bench: &mut Bench, camera: &PosedCamera, size: (u32, u32), methods: &[(String, ScreenMethod)]) {
    const RUNS: usize = 5;
    let guard = GuardBand::of_height(0.1, size.1).unwrap();
    let mut all: Vec<Vec<(&'static str, Vec<f64>)>> = vec![Vec::new(); methods.len()];
    for _ in 0..RUNS {
        for ((_, method), times) in methods.iter().zip(&mut all) {
            let view = ScreenView { camera: *camera, size, method: *method, guard, half_resolution: false };
            let Bench { gpu, pose, scene, forward, passes } = &mut *bench;
            let timed = |record: &mut dyn FnMut(&mut wgpu::CommandEncoder)| {
                let mut encoder = gpu.device.create_command_encoder(&Default::default());
                record(&mut encoder);
                let start = std::time::Instant::now();
                gpu.queue.submit([encoder.finish()]);
                gpu.device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
                start.elapsed().as_secs_f64() * 1e3
            };
            let drawing = timed(&mut |encoder| {
                passes.draw_geometry(gpu, encoder, forward, scene, pose, &view).unwrap();
            });
            let labels: Vec<&'static str> = passes.steps().collect();
            let mut sums: Vec<(&'static str, f64)> = vec![("geometry", drawing)];
            for (index, label) in labels.into_iter().enumerate() {
                let ms = timed(&mut |encoder| passes.record_step(encoder, index));
                match sums.iter_mut().find(|(known, _)| *known == label) {
                    Some((_, sum)) => *sum += ms,
                    None => sums.push((label, ms)),
                }
            }
            times.resize_with(sums.len(), || ("", Vec::new()));
            for ((label, list), (name, ms)) in times.iter_mut().zip(sums) {
                *label = name;
                list.push(ms);
            }
        }
    }
    for ((name, _), times) in methods.iter().zip(&mut all) {
        let mut total = 0.0;
        let passes: Vec<String> = times
            .iter_mut()
            .map(|(label, list)| {
                list.sort_by(f64::total_cmp);
                total += list[RUNS / 2];
                format!("{label} {:.1}", list[RUNS / 2])
            })
            .collect();
        eprintln!("{name} {size:?}: {} = {total:.1}", passes.join(", "));
    }
}
