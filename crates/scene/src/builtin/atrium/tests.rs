//! The atrium as a file: valid, closed, outward, the same twice; boulders and cameras where they should be.

use std::sync::LazyLock;

use glam::Quat;

use super::motion::{self, FRAMES, SECONDS};
use super::plan::{CEILING, ROOM, solids};
use crate::builtin::tests::document::{self, point_triangle_distance, read, still_triangles};
use crate::builtin::{glb, path, physics};

mod lamps;

const DETAIL: f32 = 0.1;

static SMALL: LazyLock<Vec<u8>> = LazyLock::new(|| glb("atrium", DETAIL).expect("the small atrium"));

/// Single layers, open on purpose.
fn is_sheet(name: &str) -> bool {
    ["room", "curtain", "banner-cloth", "lattice-screen"].contains(&name)
}

#[test]
fn bytes_layout_and_triangle_counts_are_as_promised() {
    let hash = "9061cd8174b7a2159fce26a55f6a27b88f24598cc6dff9b930318431bc1cacc8";
    document::assert_promises("atrium", DETAIL, hash, 100_000..=300_000, 3_000..=40_000);
}

#[test]
fn meshes_are_closed_and_outward() {
    for detail in [DETAIL, 1.0] {
        document::assert_closed(&read(&glb("atrium", detail).expect("atrium")), is_sheet);
    }
}

#[test]
fn vertex_normals_agree_with_faces() {
    document::assert_normals_agree(&read(&SMALL));
}

#[test]
fn one_animation_of_fifteen_seconds() {
    let doc = read(&SMALL);
    let animations: Vec<_> = doc.gltf.animations().collect();
    assert_eq!(animations.len(), 1);
    assert_eq!(animations[0].name(), Some("atrium"));
    let mut end = 0.0_f32;
    let mut animated = std::collections::BTreeSet::new();
    for channel in animations[0].channels() {
        animated.insert(channel.target().node().name().expect("named").to_string());
        let times: Vec<f32> = channel.reader(|_| Some(&doc.bin)).read_inputs().expect("times").collect();
        assert!(times.windows(2).all(|w| w[0] < w[1]) && times[0] == 0.0);
        end = end.max(times[times.len() - 1]);
    }
    assert_eq!(end, SECONDS);
    for name in ["path-walk", "path-gallery", "spot-0", "spot-2", "boulder-0", "boulder-7"] {
        assert!(animated.contains(name), "{name} does not move");
    }
    let cameras = doc.gltf.nodes().filter(|n| n.camera().is_some()).count();
    let lights: Vec<_> = doc.gltf.nodes().filter_map(|n| n.light()).map(|l| l.kind()).collect();
    use gltf::khr_lights_punctual::Kind;
    assert_eq!(cameras, 2);
    assert_eq!(lights.iter().filter(|k| matches!(k, Kind::Directional)).count(), 1);
    assert!(lights.iter().filter(|k| matches!(k, Kind::Spot { .. })).count() >= 3);
    assert!(lights.iter().filter(|k| matches!(k, Kind::Point)).count() >= 3);
}

#[test]
fn boulders_move_and_stay_inside() {
    let bodies = motion::boulders();
    assert!(bodies.len() >= 8);
    let motions = physics::simulate(&solids(), &bodies, FRAMES);
    let mut moving_seconds = 0.0;
    for (i, (body, motion)) in bodies.iter().zip(&motions).enumerate() {
        let mut way = 0.0;
        let mut still = true;
        for (k, (&position, &rotation)) in motion.positions.iter().zip(&motion.rotations).enumerate() {
            let lowest = body.hull.iter().map(|&p| (position + rotation * p).y).fold(f32::INFINITY, f32::min);
            assert!(lowest > -0.04, "boulder {i} is {lowest} m below the floor in frame {k}");
            let room = ROOM - glam::Vec2::splat(0.8 * body.radius);
            assert!(
                position.x.abs() < room.x && position.z.abs() < room.y && position.y < CEILING,
                "boulder {i} at {position} in frame {k}"
            );
            if k > 0 {
                let step = position.distance(motion.positions[k - 1]);
                assert!(step < 0.3, "boulder {i} jumps {step} m in frame {k}");
                way += step;
                if step > 0.3 / 60.0 {
                    moving_seconds += 1.0 / 60.0;
                    still = false;
                }
            }
        }
        assert!(!still && way > 2.0, "boulder {i} moves only {way} m");
    }
    let mean = moving_seconds / bodies.len() as f32;
    eprintln!("{} boulders move faster than 0.3 m/s for {mean:.1} s on average", bodies.len());
    assert!(mean > 4.0, "boulders move only {mean} s on average");
}

#[test]
fn kept_keys_reproduce_all_frames() {
    let bodies = motion::boulders();
    let motions = physics::simulate(&solids(), &bodies, FRAMES);
    for motion in &motions {
        let kept = physics::thin_positions(&motion.positions, 0.0005);
        for pair in kept.windows(2) {
            for k in pair[0]..pair[1] {
                let t = (k - pair[0]) as f32 / (pair[1] - pair[0]) as f32;
                let p = motion.positions[pair[0]].lerp(motion.positions[pair[1]], t);
                assert!(p.distance(motion.positions[k]) < 0.00051);
            }
        }
        assert!(kept.len() < motion.positions.len());
        let kept = physics::thin_rotations(&motion.rotations, 0.1_f32.to_radians());
        for pair in kept.windows(2) {
            for k in pair[0]..pair[1] {
                let t = (k - pair[0]) as f32 / (pair[1] - pair[0]) as f32;
                let q = motion.rotations[pair[0]].slerp(motion.rotations[pair[1]], t);
                // For small angles the chord is half the angle.
                assert!(2.0 * (q - motion.rotations[k]).length() < 0.101_f32.to_radians());
            }
        }
    }
}

#[test]
fn cameras_keep_clear() {
    const CLEARANCE: f32 = 0.3;
    let doc = read(&SMALL);
    let still = still_triangles(&doc, |name| !name.starts_with("boulder"));
    let boxes: Vec<crate::Aabb> = still.iter().map(|t| crate::Aabb::from_points(*t)).collect();
    let solids = solids();
    let bodies = motion::boulders();
    let motions = physics::simulate(&solids, &bodies, FRAMES);
    for (name, (eye, look)) in [("walk", motion::walk()), ("flight", motion::flight())] {
        let (positions, rotations) = path::fly(&eye, &look, FRAMES);
        assert_eq!(positions.len(), FRAMES as usize + 1);
        let (mut nearest, mut nearest_boulder, mut turn) = ((9.0_f32, 0), (9.0_f32, 0, 0), (0.0_f32, 0));
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
            for (i, (body, motion)) in bodies.iter().zip(&motions).enumerate() {
                let d = p.distance(motion.positions[frame]) - 1.1 * body.radius;
                if d < nearest_boulder.0 {
                    nearest_boulder = (d, frame, i);
                }
            }
            if frame > 0 {
                let angle = 2.0 * (rotations[frame] - rotations[frame - 1]).length();
                if angle > turn.0 {
                    turn = (angle, frame);
                }
                assert!(Quat::dot(rotations[frame - 1], rotations[frame]) > 0.0);
            }
        }
        let speed = positions.windows(2).map(|w| w[0].distance(w[1])).sum::<f32>() / SECONDS;
        eprintln!(
            "{name}: {speed:.2} m/s, {:.2} m from geometry (frame {}), {:.2} m from boulder {} (frame {}), turns {:.1}°/s (frame {})",
            nearest.0,
            nearest.1,
            nearest_boulder.0,
            nearest_boulder.2,
            nearest_boulder.1,
            turn.0.to_degrees() * 60.0,
            turn.1
        );
        assert!(nearest.0 >= CLEARANCE, "{name}: frame {} is {} m from geometry", nearest.1, nearest.0);
        assert!(nearest_boulder.0 >= CLEARANCE, "{name}: frame {} meets a boulder", nearest_boulder.1);
        assert!(turn.0.to_degrees() * 60.0 < 90.0, "{name}: turns too fast in frame {}", turn.1);
    }
}
