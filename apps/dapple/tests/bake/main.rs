//! `dapple bake`: what is kept, where visibility goes, and that it is the right visibility.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

#[path = "../common/mod.rs"]
mod common;
mod options;
mod outputs;
mod readers;
mod values;

use std::path::Path;

use common::baked::Glb;
use common::command::{dapple, fail, files, partial_files, succeed};
use common::made::{Builder, folding_sheet, two_squares_under_a_lid};
use common::shared;
use dapple_scene::glam::{DVec3, Vec2, Vec3};
use dapple_scene::{Files, NoFiles, Scene, load};
use dapple_trace::Tracer;
use dapple_trace::rtao::{RtaoParams, Site, trace_visibility};
use tempfile::TempDir;

/// Rays and texels for tests that look at the file, not at the numbers.
const COARSE: [&str; 4] = ["--rays", "16", "--texture-size", "64"];

fn folder(files: &[(&str, &[u8])]) -> TempDir {
    let folder = TempDir::new().unwrap();
    for (name, bytes) in files {
        std::fs::write(folder.path().join(name), bytes).unwrap();
    }
    folder
}

fn bake(folder: &Path, arguments: &[&str]) -> Glb {
    succeed(folder, &[&["bake"], arguments].concat());
    let output = arguments[arguments.iter().position(|a| *a == "-o").unwrap() + 1];
    Glb::read(&folder.join(output))
}

fn load_glb(path: &Path) -> Scene {
    let scene = load("baked.glb", &std::fs::read(path).unwrap(), &NoFiles).unwrap();
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    scene
}

/// A flat square grid of `cells` × `cells` facing up, `edge` long, centred at the origin, without normals.
fn grid(builder: &mut Builder, edge: f32, cells: u16) -> (usize, usize) {
    let at = |i: u16| (f32::from(i) / f32::from(cells) - 0.5) * edge;
    let positions: Vec<[f32; 3]> =
        (0..=cells).flat_map(|z| (0..=cells).map(move |x| [at(x), 0.0, at(z)])).collect();
    let row = cells + 1;
    let corners = (0..cells).flat_map(|z| (0..cells).map(move |x| z * row + x));
    let indices: Vec<u16> = corners.flat_map(|v| [v, v + row, v + row + 1, v, v + row + 1, v + 1]).collect();
    (builder.floats("VEC3", &positions), builder.indices(&indices))
}

/// A disc of radius `r` at height `h`, facing down.
fn disc(builder: &mut Builder, r: f32, h: f32) -> (usize, usize) {
    const SEGMENTS: u16 = 256;
    let mut positions = vec![[0.0, h, 0.0]];
    positions.extend((0..SEGMENTS).map(|i| {
        let angle = f64::from(i) / f64::from(SEGMENTS) * std::f64::consts::TAU;
        [r * libm::cos(angle) as f32, h, r * libm::sin(angle) as f32]
    }));
    let indices: Vec<u16> = (0..SEGMENTS).flat_map(|i| [0, 1 + i, 1 + (i + 1) % SEGMENTS]).collect();
    (builder.floats("VEC3", &positions), builder.indices(&indices))
}

/// Ground under a disc.
fn ground_under_disc(edge: f32, cells: u16, r: f32, h: f32) -> Vec<u8> {
    let mut builder = Builder::default();
    let (ground, ground_indices) = grid(&mut builder, edge, cells);
    let (lid, lid_indices) = disc(&mut builder, r, h);
    builder.glb(&format!(
        r#""scenes":[{{"nodes":[0,1]}}],"nodes":[{{"mesh":0}},{{"mesh":1}}],"meshes":[
        {{"primitives":[{{"attributes":{{"POSITION":{ground}}},"indices":{ground_indices}}}]}},
        {{"primitives":[{{"attributes":{{"POSITION":{lid}}},"indices":{lid_indices}}}]}}]"#
    ))
}

/// Half of the ground by an endless wall: positions of vertices, and what was baked there.
fn vertices(glb: &Glb, mesh: usize, attribute: &str) -> Vec<(DVec3, Vec<f64>)> {
    let of = |name: &str| glb.accessor(glb.whole(&format!("/meshes/{mesh}/primitives/0/attributes/{name}")));
    let positions = of("POSITION").into_iter().map(|p| DVec3::new(p[0], p[1], p[2]));
    positions.zip(of(attribute)).collect()
}
