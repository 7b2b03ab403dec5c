//! The laboratory as a file: valid, closed, outward, the same twice; its cameras keep clear of things and people.

use std::sync::LazyLock;

use super::plan::{CEILING, FRAMES, SECONDS};
use super::{motion, solids};
use crate::builtin::tests::document::{self, point_triangle_distance, read, still_triangles};
use crate::builtin::{glb, path};
use crate::{Aabb, NoFiles, Scene};

mod walking;

const DETAIL: f32 = 0.1;

static SMALL: LazyLock<Vec<u8>> = LazyLock::new(|| glb("lab", DETAIL).expect("the small laboratory"));

fn loaded() -> Scene {
    crate::load("lab.glb", &SMALL, &NoFiles).expect("loads")
}

/// Nodes that animation moves, besides walkers.
fn turns(name: &str) -> bool {
    name.starts_with("rotor") || name.starts_with("robot-arm")
}

#[test]
fn bytes_layout_and_triangle_counts_are_as_promised() {
    let hash = "a32906e4ce84098edce6d5a2173ba8d2978e11933b653fa8b69640ce3b349a7b";
    document::assert_promises("lab", DETAIL, hash, 250_000..=400_000, 20_000..=100_000);
}

#[test]
fn meshes_are_closed_and_outward() {
    for detail in [DETAIL, 1.0] {
        document::assert_closed(&read(&glb("lab", detail).expect("laboratory")), |name| name == "room");
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
    assert_eq!(scene.animations.len(), 1);
    assert_eq!(scene.animations[0].name, "lab");
    assert_eq!(scene.animations[0].duration(), SECONDS);
    let keys = |name: &str| {
        let node = scene.nodes.iter().position(|n| n.name == name).expect(name) as u32;
        scene.animations[0]
            .channels
            .iter()
            .filter(|c| c.node == node)
            .map(|c| c.times.len())
            .collect::<Vec<_>>()
    };
    for name in ["path-aisle", "path-crane"] {
        assert_eq!(keys(name), [FRAMES as usize + 1; 2]);
    }
    for name in ["rotor-0", "rotor-1", "robot-arm-0", "robot-arm-1"] {
        assert_eq!(keys(name), [motion::KEYS as usize + 1]);
    }
    let mapped = scene.materials.iter().filter(|m| m.normal_texture.is_some()).count();
    assert!(mapped >= 3, "{mapped} materials with normal maps");
    let pose = scene.pose_undeformed(0.0);
    assert_eq!(pose.cameras.len(), 2);
    assert!(pose.lights.len() >= 10);
    let bounds = scene.bounds_world(&scene.pose(0.0));
    assert!(bounds.min.y > -0.05 && bounds.max.y < CEILING + 0.05, "{bounds:?}");
}

#[test]
fn things_stay_in_their_solids() {
    let scene = loaded();
    let items: Vec<_> = super::plan::ITEMS.iter().map(|item| (item.kind.name(), item.solid())).collect();
    for time in [0.0, 3.3, 8.1] {
        let pose = scene.pose(time);
        for (i, instance) in scene.instances.iter().enumerate() {
            let name = scene.nodes[instance.node as usize].name.as_str();
            if !(turns(name) || items.iter().any(|(kind, _)| *kind == name)) {
                continue;
            }
            let world = pose.instances[i].world_from_mesh;
            let points: Vec<_> =
                scene.vertex_positions(&pose, i).iter().map(|p| world.transform_point3(*p)).collect();
            let inside =
                |solid: &crate::builtin::physics::Solid| points.iter().all(|p| solid.distance(*p) < 0.005);
            let b = Aabb::from_points(points.iter().copied());
            assert!(items.iter().any(|(_, solid)| inside(solid)), "{name} at {b:?} reaches out of its solid");
        }
    }
}

#[test]
fn cameras_keep_clear() {
    const CLEARANCE: f32 = 0.3;
    let still = still_triangles(&read(&SMALL), |name| !name.starts_with("walker") && !turns(name));
    let boxes: Vec<Aabb> = still.iter().map(|t| Aabb::from_points(*t)).collect();
    let solids = solids::solids();
    let scene = loaded();
    let walkers: Vec<usize> =
        (0..scene.instances.len()).filter(|&i| scene.instances[i].skin.is_some()).collect();
    for (name, (eye, look)) in [("aisle", motion::aisle()), ("crane", motion::crane())] {
        let (positions, rotations) = path::fly(&eye, &look, FRAMES);
        assert_eq!(positions.len(), FRAMES as usize + 1);
        let (mut nearest, mut nearest_walker, mut turn) = ((9.0_f32, 0), (9.0_f32, 0), (0.0_f32, 0));
        for (frame, &p) in positions.iter().enumerate() {
            for solid in &solids {
                let d = solid.distance(p);
                assert!(d >= CLEARANCE, "{name}: frame {frame} at {p} is {d} m from {solid:?}");
            }
            for (t, b) in still.iter().zip(&boxes) {
                if b.distance_squared(p) < nearest.0 * nearest.0 {
                    let d = point_triangle_distance(p, *t);
                    if d < nearest.0 {
                        nearest = (d, frame);
                    }
                }
            }
            if frame % 6 == 0 {
                let pose = scene.pose(frame as f64 / 60.0);
                for &i in &walkers {
                    for v in scene.vertex_positions(&pose, i) {
                        if v.distance(p) < nearest_walker.0 {
                            nearest_walker = (v.distance(p), frame);
                        }
                    }
                }
            }
            if frame > 0 {
                let angle = 2.0 * (rotations[frame] - rotations[frame - 1]).length();
                if angle > turn.0 {
                    turn = (angle, frame);
                }
            }
        }
        let speed = positions.windows(2).map(|w| w[0].distance(w[1])).sum::<f32>() / SECONDS;
        let turn_degrees = turn.0.to_degrees() * 60.0;
        eprintln!(
            "{name}: {speed:.2} m/s, {:.2} m from things (frame {}), {:.2} m from walkers (frame {}), turns {turn_degrees:.1}°/s (frame {})",
            nearest.0, nearest.1, nearest_walker.0, nearest_walker.1, turn.1
        );
        assert!(nearest.0 >= CLEARANCE, "{name}: frame {} is {} m from things", nearest.1, nearest.0);
        assert!(
            nearest_walker.0 >= CLEARANCE,
            "{name}: frame {} is {} m from a walker",
            nearest_walker.1,
            nearest_walker.0
        );
        assert!(turn_degrees < 90.0, "{name}: turns too fast in frame {}", turn.1);
    }
}
