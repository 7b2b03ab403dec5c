//! The station as a file: valid, closed, outward, the same twice; rocks drift far from it, cameras keep clear.

use std::sync::LazyLock;

use glam::{Mat4, Vec3};

use super::motion;
use super::plan::{FRAMES, SECONDS, rocks};
use crate::builtin::tests::document::{self, point_triangle_distance, read, still_triangles};
use crate::builtin::{glb, path};
use crate::{Aabb, NoFiles, Scene};

const DETAIL: f32 = 0.1;

static SMALL: LazyLock<Vec<u8>> = LazyLock::new(|| glb("station", DETAIL).expect("the small station"));

fn loaded() -> Scene {
    crate::load("station.glb", &SMALL, &NoFiles).expect("loads")
}

fn is_rock(name: &str) -> bool {
    name.starts_with("rock")
}

#[test]
fn bytes_layout_and_triangle_counts_are_as_promised() {
    let hash = "6f9849ffd3fed6c48ea55f34f36e232d680b9639f964d517284ebff4d39de334";
    document::assert_promises("station", DETAIL, hash, 200_000..=300_000, 8_000..=60_000);
}

#[test]
fn meshes_are_closed_and_outward() {
    for detail in [DETAIL, 1.0] {
        document::assert_closed(&read(&glb("station", detail).expect("station")), |_| false);
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
    assert_eq!(scene.animations[0].name, "station");
    assert_eq!(scene.animations[0].duration(), SECONDS);
    let keys = |name: &str| {
        let node = scene.nodes.iter().position(|n| n.name == name).expect(name) as u32;
        let channels = scene.animations[0].channels.iter();
        channels.filter(|c| c.node == node).map(|c| c.times.len()).collect::<Vec<_>>()
    };
    for name in ["path-deck", "path-orbit"] {
        assert_eq!(keys(name), [FRAMES as usize + 1; 2]);
    }
    for name in ["airlock-0", "airlock-1", "dish"] {
        assert_eq!(keys(name), [motion::KEYS as usize + 1]);
    }
    let mapped = scene.materials.iter().filter(|m| m.normal_texture.is_some()).count();
    assert!(mapped >= 3, "{mapped} materials with normal maps");
    let pose = scene.pose_undeformed(0.0);
    assert_eq!(pose.cameras.len(), 2);
    assert!(pose.lights.len() >= 10);
}

#[test]
fn almost_nothing_moves() {
    let scene = loaded();
    let (a, b) = (scene.pose(1.0), scene.pose(6.0));
    let moving: Vec<&str> = scene
        .instances
        .iter()
        .zip(a.instances.iter().zip(&b.instances))
        .filter(|(_, (a, b))| a.world_from_mesh != b.world_from_mesh)
        .map(|(instance, _)| scene.nodes[instance.node as usize].name.as_str())
        .collect();
    assert_eq!(moving.iter().filter(|name| is_rock(name)).count(), rocks().len());
    assert_eq!(moving.len(), rocks().len() + 3, "{moving:?}");
}

/// World corners of everything but rocks, airlocks and the dish.
fn still() -> Vec<[Vec3; 3]> {
    let moves = |name: &str| is_rock(name) || name.starts_with("airlock") || name == "dish";
    still_triangles(&read(&SMALL), |name| !moves(name))
}

#[test]
fn rocks_drift_far_from_everything() {
    const FAR: f32 = 4.0;
    let station = still().iter().fold(Vec::new(), |mut all: Vec<Vec3>, t| {
        all.extend(t);
        all
    });
    let rocks = rocks();
    assert_eq!(rocks.len(), 14);
    let eyes: Vec<Vec3> = [motion::deck(), motion::orbit()]
        .iter()
        .flat_map(|(eye, look)| path::fly(eye, look, FRAMES).0)
        .collect();
    let (mut nearest, mut least_way) = (f32::INFINITY, f32::INFINITY);
    for (i, rock) in rocks.iter().enumerate() {
        let (start, end) = (rock.pose(0.0).0, rock.pose(SECONDS).0);
        least_way = least_way.min(start.distance(end));
        for step in 0..=15 {
            let place = rock.pose(step as f32).0;
            let others = rocks.iter().enumerate().filter(|(k, _)| *k != i);
            let others = others.map(|(_, o)| o.pose(step as f32).0.distance(place) - 1.15 * o.radius);
            let points = station.iter().chain(&eyes).map(|p| p.distance(place));
            let gap = points.chain(others).fold(f32::INFINITY, f32::min) - 1.15 * rock.radius;
            nearest = nearest.min(gap);
            assert!(gap > FAR, "rock {i} comes as near as {gap} m at {step} s");
        }
    }
    eprintln!("rocks stay {nearest:.1} m from everything and drift {least_way:.1} m at least");
    assert!(least_way > 1.0);
}

#[test]
fn turns_go_the_short_way() {
    // At most an eighth of a turn from key to key, so that what is between them is what is meant.
    let scene = loaded();
    for channel in scene.animations[0].channels.iter().filter(|c| c.values.len() == 4 * c.times.len()) {
        let keys: Vec<glam::Quat> = channel.values.chunks_exact(4).map(glam::Quat::from_slice).collect();
        for pair in keys.windows(2) {
            assert!(pair[0].dot(pair[1]) > 0.92, "{}", scene.nodes[channel.node as usize].name);
        }
    }
}

#[test]
fn cameras_keep_clear() {
    const CLEARANCE: f32 = 0.3;
    let doc = read(&SMALL);
    let still = still();
    let boxes: Vec<Aabb> = still.iter().map(|t| Aabb::from_points(*t)).collect();
    // What turns stays in a ball around its node.
    let balls: Vec<(Vec3, f32)> = doc
        .gltf
        .nodes()
        .filter(|n| n.name().is_some_and(|n| n.starts_with("airlock") || n == "dish"))
        .map(|n| {
            let world = Mat4::from_cols_array_2d(&n.transform().matrix());
            let (corners, _) = document::triangles(&doc, &n.mesh().expect("a mesh"));
            let radius = corners.iter().flatten().map(|p| p.length()).fold(0.0, f32::max);
            (world.transform_point3(Vec3::ZERO), radius)
        })
        .collect();
    assert_eq!(balls.len(), 3);
    for (name, (eye, look)) in [("deck", motion::deck()), ("orbit", motion::orbit())] {
        let (positions, rotations) = path::fly(&eye, &look, FRAMES);
        assert_eq!(positions.len(), FRAMES as usize + 1);
        let (mut nearest, mut turn) = ((9.0_f32, 0), (0.0_f32, 0));
        for (frame, &p) in positions.iter().enumerate() {
            for (t, b) in still.iter().zip(&boxes) {
                if b.distance_squared(p) < nearest.0 * nearest.0 {
                    let d = point_triangle_distance(p, *t);
                    if d < nearest.0 {
                        nearest = (d, frame);
                    }
                }
            }
            for (center, radius) in &balls {
                if p.distance(*center) - radius < nearest.0 {
                    nearest = (p.distance(*center) - radius, frame);
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
            "{name}: {speed:.2} m/s, {:.2} m from things (frame {}), turns {turn_degrees:.1}°/s (frame {})",
            nearest.0, nearest.1, turn.1
        );
        assert!(nearest.0 >= CLEARANCE, "{name}: frame {} is {} m from things", nearest.1, nearest.0);
        assert!(turn_degrees < 90.0, "{name}: turns too fast in frame {}", turn.1);
    }
}
