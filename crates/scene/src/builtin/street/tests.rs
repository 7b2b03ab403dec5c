//! The street as a file: valid, closed, outward, the same twice; three lights that move and meet nothing.

use std::sync::LazyLock;

use glam::Vec3;

use super::motion;
use super::plan::*;
use crate::builtin::glb;
use crate::builtin::tests::document::{self, read};
use crate::{NoFiles, Scene};

const DETAIL: f32 = 0.1;

static SMALL: LazyLock<Vec<u8>> = LazyLock::new(|| glb("street", DETAIL).expect("the small street"));

fn loaded() -> Scene {
    crate::load("street.glb", &SMALL, &NoFiles).expect("loads")
}

/// Single layers, open on purpose.
fn is_sheet(name: &str) -> bool {
    name == "awning-cloth"
}

#[test]
fn bytes_layout_and_triangle_counts_are_as_promised() {
    let hash = "b6e900a1b368e645c73dddf4eb642b92d7f8320e1b0ac3330d7d5b34ee981174";
    document::assert_promises("street", DETAIL, hash, 250_000..=400_000, 50_000..=83_000);
}

#[test]
fn meshes_are_closed_and_outward() {
    for detail in [DETAIL, 1.0] {
        let doc = read(&glb("street", detail).expect("street"));
        document::assert_closed(&doc, is_sheet);
        document::assert_pieces_outward(&doc, is_sheet);
    }
}

#[test]
fn vertex_normals_agree_with_faces() {
    document::assert_normals_agree(&read(&SMALL));
}

/// What moves besides cameras.
const MOVING: [&str; 11] = [
    "wheel-0",
    "wheel-1",
    "wheel-2",
    "carriage",
    "front-wheel-0",
    "front-wheel-1",
    "rear-wheel-0",
    "rear-wheel-1",
    "light-sphere-0",
    "light-sphere-1",
    "light-cube",
];

#[test]
fn loads_with_its_parts_and_no_warning() {
    let scene = loaded();
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    document::assert_motion(&scene, "street", &MOVING, &["path-walk", "path-crane"]);
    assert!(scene.lights.is_empty(), "only areas emit");
    let mapped = scene.materials.iter().filter(|m| m.normal_texture.is_some()).count();
    assert!(mapped >= 3, "{mapped} materials with normal maps");
}

#[test]
fn three_lights_move_and_no_other_lamp_is_on() {
    let scene = loaded();
    let lamps = document::lamps(&read(&SMALL), &scene);
    let found: Vec<(&str, Option<&str>, bool)> =
        lamps.iter().map(|lamp| (lamp.name.as_str(), lamp.shape.as_deref(), lamp.moves)).collect();
    assert_eq!(
        found,
        [
            ("light-sphere-0", Some("sphere"), true),
            ("light-sphere-1", Some("sphere"), true),
            ("light-cube", None, true)
        ]
    );
    // Each goes a long way and comes back to where it started.
    for (way, least) in motion::lights().iter().zip([30.0, 25.0, 50.0]) {
        let long: f32 = way.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
        assert!(long > least, "{long} m");
        assert_eq!(way[0], way[way.len() - 1]);
    }
}

#[test]
fn lights_meet_nothing() {
    let cube = CUBE * libm::sqrtf(3.0);
    let balls = [("light-sphere-0", SPHERES[0]), ("light-sphere-1", SPHERES[1]), ("light-cube", cube)];
    let scene = loaded();
    document::assert_movers_keep_clear(&scene, &balls, 300, 0.1);
    // Nor do they pass through what else moves: the wheels of fortune and the carriage, as boxes.
    let named = |name: &str| {
        let node = scene.nodes.iter().position(|n| n.name == name).expect(name) as u32;
        scene.instances.iter().position(|i| i.node == node).expect(name)
    };
    for step in 0..300 {
        let pose = scene.pose(f64::from(SECONDS) * f64::from(step) / 300.0);
        for (light, radius) in balls {
            let at = Vec3::from(pose.instances[named(light)].world_from_mesh.translation);
            for other in ["wheel-0", "wheel-1", "wheel-2", "carriage"] {
                let world = pose.instances[named(other)].world_from_mesh;
                let mesh = &scene.meshes[scene.instances[named(other)].mesh as usize];
                let near = mesh.positions.iter().map(|&p| world.transform_point3(p).distance(at));
                let gap = near.fold(f32::INFINITY, f32::min) - radius;
                assert!(gap > 0.1, "{light} is {gap} m from {other} at step {step}");
            }
        }
    }
}

#[test]
fn wheels_roll_without_sliding() {
    let scene = loaded();
    let named = |name: &str| {
        let node = scene.nodes.iter().position(|n| n.name == name).expect(name) as u32;
        scene.instances.iter().position(|i| i.node == node).expect(name)
    };
    let mut way = 0.0_f32;
    for step in 0..150 {
        let (before, after) = (scene.pose(f64::from(step) * 0.1), scene.pose(f64::from(step) * 0.1 + 0.02));
        for (name, radius) in ["front-wheel-0", "rear-wheel-1"].into_iter().zip(super::machines::ROLL) {
            let i = named(name);
            let [a, b] = [&before, &after].map(|pose| pose.instances[i].world_from_mesh);
            let moved = Vec3::from(b.translation - a.translation).x;
            // The material point that touches the ground stays where it is.
            let low = a.inverse().transform_point3(Vec3::from(a.translation) - Vec3::Y * radius);
            let slid = (b.transform_point3(low) - a.transform_point3(low)).x;
            assert!(slid.abs() < 0.02 * moved.abs() + 2e-3, "{name} slides {slid} of {moved} m");
            way += moved.abs();
        }
    }
    assert!(way > 4.0, "the carriage moves {way} m");
}

#[test]
fn cameras_keep_clear() {
    document::assert_cameras_keep_clear(
        &loaded(),
        &[("walk", motion::walk()), ("crane", motion::crane())],
        0.3,
    );
}
