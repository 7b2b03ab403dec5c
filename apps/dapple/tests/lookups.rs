//! The two look-ups that read points a fragment: shader against twin, on random points and on those of the atrium.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod common;
#[path = "common/fullscreen.rs"]
mod fullscreen;

use dapple_gpu::testing::{gpu_for_tests, validate};
use dapple_render::gbuffer::{RestSurface, rasterize};
use dapple_render::psao::cells::{self, PointCells};
use dapple_render::psao::hash::{self, PointHash};
use dapple_render::psao::{Hat, MovingLeastSquares};
use dapple_scene::glam::Vec3;
use dapple_store::points::{Change, PackedNormal, PointLayout, PointSet, PointStore, morton_code};
use fullscreen::{Bindings, FRAGMENTS_WGSL, Fragments, TARGET_FORMAT, main_wgsl, table_bindings};

/// Largest difference of a look-up's shader from its twin: half a step of a stored value.
const TOLERANCE: f32 = 0.5 / 255.0;
/// Share of fragments that may differ by more: a point at a threshold of [Neff2023] eq. 3 may fall to either side of it.
const AT_THRESHOLDS: f64 = 1e-3;

/// A number in 0 … 1 of a seed and a counter.
fn random(seed: u32, i: u32) -> f32 {
    let mut h = seed.wrapping_mul(0x9e37_79b1) ^ i.wrapping_mul(0x85eb_ca77);
    h ^= h >> 15;
    h = h.wrapping_mul(0x2c1b_3c6d);
    h ^= h >> 12;
    h = h.wrapping_mul(0x297a_2d39);
    ((h ^ h >> 15) >> 8) as f32 / (1 << 24) as f32
}

fn random_normal(seed: u32) -> Vec3 {
    let v = Vec3::from_array([0, 1, 2].map(|i| random(seed, i) - 0.5));
    v.try_normalize().unwrap_or(Vec3::Y)
}

/// Points anywhere in a box, with any normals and values, for instances 1 and 4, and fragments among and around them.
fn random_points() -> (PointStore, Vec<Option<RestSurface>>) {
    let spacing = 0.1;
    let quantum = spacing / 32.0;
    let set = |instance: u32| {
        let mut points: Vec<(u64, PackedNormal, [u32; 3])> = (0..2000)
            .map(|i| {
                let seed = instance * 10_000 + i;
                let p = [3, 4, 5].map(|axis| (random(seed, axis) * 0.6 / quantum) as u32);
                (morton_code(p), PackedNormal::pack(random_normal(seed)), p)
            })
            .collect();
        points.sort_unstable();
        PointSet {
            instance,
            first: 0,
            origin_rest: Vec3::new(-3.0, 0.25, 7.0) * instance as f32,
            positions: points.iter().map(|p| p.2).collect(),
            normals: points.iter().map(|p| p.1).collect(),
        }
    };
    let layout = PointLayout::new(quantum, spacing, vec![set(1), set(4)]).unwrap();
    let values = (0..layout.len() as u32).map(|i| (random(77, i) * 255.0) as u8).collect();
    let fragments = (0..128 * 64)
        .map(|i| {
            let instance = [0, 1, 4, 4, 9][i as usize % 5];
            let around = Vec3::from_array([6, 7, 8].map(|axis| random(i, axis) * 0.8 - 0.1));
            let origin = Vec3::new(-3.0, 0.25, 7.0) * instance as f32;
            let normal_rest = random_normal(500_000 + i);
            (i % 17 != 0).then_some(RestSurface { instance, position_rest: origin + around, normal_rest })
        })
        .collect();
    (PointStore::new(layout.into(), values).unwrap(), fragments)
}

/// Compares what the shader gave with the twin.
fn assert_agree(what: &str, shader: &[f32], twin: &[f32]) {
    let differences: Vec<f32> = twin.iter().zip(shader).map(|(a, b)| (a - b).abs()).collect();
    let beyond = differences.iter().filter(|&&d| d.is_nan() || d > TOLERANCE).count();
    let mean = differences.iter().map(|&d| f64::from(d)).sum::<f64>() / differences.len() as f64;
    let worst = differences.iter().copied().fold(0.0, f32::max);
    println!("{what}: {beyond} of {} beyond {TOLERANCE}, mean {mean:.2e}, worst {worst}", differences.len());
    assert!(
        beyond as f64 <= AT_THRESHOLDS * differences.len() as f64,
        "{what}: {beyond} differ, worst {worst}"
    );
    assert!(mean < 1e-4, "{what}: mean difference {mean}");
    // Not all open: something was looked up.
    assert!(twin.iter().filter(|v| **v < 0.99).count() * 20 > twin.len(), "{what}: nothing was found");
}

fn hash_wgsl() -> [String; 3] {
    let main = main_wgsl("hash_visibility(f.instance, f.position_rest, f.normal_rest)");
    [FRAGMENTS_WGSL.to_owned(), hash::WGSL.to_owned(), main]
}

fn cells_wgsl() -> [String; 3] {
    let main = main_wgsl("cells_visibility(f.instance, f.position_rest, f.normal_rest)");
    [FRAGMENTS_WGSL.to_owned(), cells::WGSL.to_owned(), main]
}

fn files(wgsl: &[String; 3]) -> [&str; 3] {
    wgsl.each_ref().map(String::as_str)
}

#[test]
fn shaders_are_valid() {
    for wgsl in [hash_wgsl(), cells_wgsl()] {
        if let Err(message) = validate(&dapple_gpu::join(&files(&wgsl))) {
            panic!("{message}");
        }
    }
}

/// Both shaders against both twins, before and after an update.
fn check(what: &str, store: &PointStore, fragments: &[Option<RestSurface>], width: u32) {
    let layout = store.layout();
    let mut paper = PointHash::new(layout, store.visibility(), Hat::default()).unwrap();
    let mut direct = PointCells::new(layout, store.visibility(), MovingLeastSquares::default()).unwrap();
    let Some(gpu) = gpu_for_tests() else { return };
    let frame = Fragments::new(gpu.clone(), width, fragments, &[]);

    let tables = paper.make_textures(&gpu.device).unwrap();
    paper.upload(&gpu.queue, &tables);
    let groups = [Bindings::new(), Bindings::new(), table_bindings(&tables, 0)];
    let pass = frame.pass("paper", &files(&hash_wgsl()), "main", &groups, TARGET_FORMAT);
    assert_agree(
        &format!("{what}, paper"),
        &frame.run(&pass)[..fragments.len()],
        &paper.reconstruct(fragments),
    );

    let cell_tables = direct.make_textures(&gpu.device).unwrap();
    direct.upload(&gpu.queue, &cell_tables);
    let groups = [Bindings::new(), Bindings::new(), table_bindings(&cell_tables, 3)];
    let cells_pass = frame.pass("direct", &files(&cells_wgsl()), "main", &groups, TARGET_FORMAT);
    let twin = direct.reconstruct(fragments);
    assert_agree(&format!("{what}, direct"), &frame.run(&cells_pass)[..fragments.len()], &twin);

    let changes: Vec<Change> = (0..store.layout().len() as u32)
        .filter(|p| p % 3 == 0)
        .map(|point| Change { point, visibility: 255 - store.visibility()[point as usize] })
        .collect();
    paper.apply(&changes);
    paper.upload(&gpu.queue, &tables);
    assert_agree(
        &format!("{what}, paper, updated"),
        &frame.run(&pass)[..fragments.len()],
        &paper.reconstruct(fragments),
    );
    direct.apply(&changes);
    direct.upload(&gpu.queue, &cell_tables);
    let updated = direct.reconstruct(fragments);
    assert_ne!(updated, twin);
    assert_agree(&format!("{what}, direct, updated"), &frame.run(&cells_pass)[..fragments.len()], &updated);
}

#[test]
fn shaders_agree_with_twins_on_random_points() {
    let (store, fragments) = random_points();
    check("random", &store, &fragments, 128);
}

#[test]
fn shaders_agree_with_twins_in_the_atrium() {
    let scene = common::atrium(0.1);
    let server = common::server(&scene, &common::config(128.0, 16));
    let pose = scene.pose(0.0);
    let camera = scene.camera_paths()[0].camera(&scene, &pose);
    let gbuffer = rasterize(&scene, &pose, &camera, 320, 180, 1).unwrap();
    let fragments = gbuffer.map_surfaces_rest(&scene, |_, surface| surface.copied());
    check("atrium", server.store(), &fragments, 320);
}
