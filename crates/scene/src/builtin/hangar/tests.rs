//! The hangar as a file: valid, closed, outward, the same twice; all of its drones fly, each with its light, and meet nothing.

use std::sync::LazyLock;

use glam::Vec3;

use super::motion;
use super::plan::*;
use crate::builtin::glb;
use crate::builtin::tests::document::{self, read};
use crate::{NoFiles, Scene};

const DETAIL: f32 = 0.1;

static SMALL: LazyLock<Vec<u8>> = LazyLock::new(|| glb("hangar", DETAIL).expect("the small hangar"));

fn loaded() -> Scene {
    crate::load("hangar.glb", &SMALL, &NoFiles).expect("loads")
}

/// The room seen from inside and flat lights: open on purpose.
fn is_sheet(name: &str) -> bool {
    name == "shell" || name.starts_with("light-rectangle") || name.starts_with("light-disc")
}

#[test]
fn bytes_layout_and_triangle_counts_are_as_promised() {
    let hash = "fca93e1fb8e055c1c17e80a910a6a9cde8c0b4d9c146d6913465b76d146530d2";
    document::assert_promises("hangar", DETAIL, hash, 200_000..=300_000, 40_000..=61_000);
}

#[test]
fn meshes_are_closed_and_outward() {
    for detail in [DETAIL, 1.0] {
        let doc = read(&glb("hangar", detail).expect("hangar"));
        document::assert_closed(&doc, is_sheet);
        document::assert_pieces_outward(&doc, is_sheet);
    }
}

#[test]
fn vertex_normals_agree_with_faces() {
    document::assert_normals_agree(&read(&SMALL));
}

#[test]
fn loads_with_its_parts_and_no_warning() {
    let scene = loaded();
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let drones: Vec<String> =
        (0..DRONES.len()).flat_map(|i| [format!("drone-{i}"), format!("light-{i}")]).collect();
    let moving: Vec<&str> =
        ["bridge", "trolley", "fan"].into_iter().chain(drones.iter().map(String::as_str)).collect();
    document::assert_motion(&scene, "hangar", &moving, &["path-aisle", "path-roof"]);
    assert!(scene.lights.is_empty(), "only areas emit");
}

#[test]
fn every_drone_carries_a_light_that_moves() {
    let scene = loaded();
    let lamps = document::lamps(&read(&SMALL), &scene);
    assert_eq!(lamps.len(), DRONES.len());
    assert!(lamps.iter().all(|lamp| lamp.moves));
    let count = |shape: Option<&str>| lamps.iter().filter(|lamp| lamp.shape.as_deref() == shape).count();
    assert_eq!([Some("sphere"), Some("rectangle"), Some("disc"), None].map(count), [12, 4, 4, 8]);
    // Lights hang under their drones, at every moment.
    let named = |name: String| {
        let node = scene.nodes.iter().position(|n| n.name == name).expect("a node") as u32;
        scene.instances.iter().position(|i| i.node == node).expect("an instance")
    };
    for step in 0..60 {
        // Half way between keys too.
        let pose = scene.pose(f64::from(step) * 0.25 + 0.05);
        for (i, drone) in DRONES.iter().enumerate() {
            let [body, light] = ["drone", "light"].map(|what| {
                Vec3::from(pose.instances[named(format!("{what}-{i}"))].world_from_mesh.translation)
            });
            let below = if drone.lamp == Lamp::Ring { 0.0 } else { BELOW };
            assert!((body.distance(light) - below).abs() < 0.01, "light {i} is off at step {step}");
            assert!(light.y <= body.y + 1e-5);
        }
    }
}

#[test]
fn stores_keep_to_their_bays() {
    let scene = loaded();
    let pose = scene.pose(0.0);
    let mut stores = 0;
    for (i, instance) in scene.instances.iter().enumerate() {
        let name = scene.nodes[instance.node as usize].name.as_str();
        if Store::ALL.iter().any(|kind| kind.name() == name) {
            stores += 1;
            let b = scene.instance_bounds_world(&pose, i);
            let at = Vec3::from(pose.instances[i].world_from_mesh.translation);
            let out = (b.max - at).max(at - b.min);
            assert!(out.x <= BAY_HALF[0] && out.z <= BAY_HALF[1], "{name} at {at} reaches {out}");
            assert!(b.min.y > -0.05 && b.min.y < 0.02, "{name} stands at {}", b.min.y);
        }
    }
    assert_eq!(stores, 12);
}

#[test]
fn drones_meet_nothing() {
    let names: Vec<String> = (0..DRONES.len()).map(|i| format!("drone-{i}")).collect();
    let balls: Vec<(&str, f32)> = names.iter().map(|name| (name.as_str(), REACH)).collect();
    let scene = loaded();
    document::assert_movers_keep_clear(&scene, &balls, 150, 0.05);
    // The ball holds body and light.
    for (i, instance) in scene.instances.iter().enumerate() {
        let name = &scene.nodes[instance.node as usize].name;
        if name.starts_with("drone") || name.starts_with("light") {
            let below = if name.starts_with("light") && scene.instances[i].node > 0 { BELOW } else { 0.0 };
            let mesh = &scene.meshes[instance.mesh as usize];
            let reach = mesh.positions.iter().map(|p| p.length()).fold(0.0, f32::max);
            let flat = reach.max(libm::sqrtf(reach * reach + below * below));
            assert!(flat < REACH, "{name} reaches {flat} m");
        }
    }
    // Nor do they meet the crane, its hook, or the fan, which move.
    for step in 0..150 {
        let pose = scene.pose(f64::from(step) * 0.1);
        let at: Vec<Vec3> = DRONES
            .iter()
            .enumerate()
            .map(|(i, _)| {
                let node =
                    scene.nodes.iter().position(|n| n.name == format!("drone-{i}")).expect("drone") as u32;
                let i = scene.instances.iter().position(|x| x.node == node).expect("drone");
                Vec3::from(pose.instances[i].world_from_mesh.translation)
            })
            .collect();
        for (i, instance) in scene.instances.iter().enumerate() {
            let name = scene.nodes[instance.node as usize].name.as_str();
            if ["bridge", "trolley", "fan"].contains(&name) {
                let bounds = scene.instance_bounds_world(&pose, i);
                // The bridge's box is nearly all of it; the trolley's has the hook's rope in it.
                let near = at.iter().map(|&p| bounds.distance_squared(p)).fold(f32::INFINITY, f32::min);
                assert!(libm::sqrtf(near) > REACH, "a drone meets the {name} at step {step}");
            }
        }
    }
}

#[test]
fn cameras_keep_clear() {
    document::assert_cameras_keep_clear(
        &loaded(),
        &[("aisle", motion::aisle()), ("roof", motion::roof())],
        0.3,
    );
}
