//! How the walkers walk: on planted feet, clear of things and of each other, with limbs that stay whole.

use std::sync::LazyLock;

use glam::{Vec2, Vec3};

use super::loaded;
use crate::Scene;
use crate::builtin::lab::body::{HIP, JOINTS, LEG, LEGS, SKELETON};
use crate::builtin::lab::plan::{DECK, LOOPS, SECONDS};
use crate::builtin::lab::solids::solids;
use crate::builtin::lab::walkers::crew;
use crate::builtin::physics::Solid;

/// The walkers' instances.
fn walkers(scene: &Scene) -> Vec<usize> {
    let walkers: Vec<usize> =
        (0..scene.instances.len()).filter(|&i| scene.instances[i].skin.is_some()).collect();
    assert_eq!(walkers.len(), 23);
    walkers
}

static FLOORS: LazyLock<Vec<f32>> = LazyLock::new(|| crew().iter().map(|walker| walker.floor).collect());

/// The height of the floor that a walker is on.
fn floor(walker: usize) -> f32 {
    FLOORS[walker]
}

#[test]
fn everybody_has_a_skeleton_and_weights_that_sum_to_one() {
    let scene = loaded();
    assert_eq!(LOOPS.iter().map(|l| l.walkers).sum::<u32>(), 23);
    for i in walkers(&scene) {
        let instance = &scene.instances[i];
        let skin = &scene.skins[instance.skin.expect("a skin") as usize];
        assert_eq!(skin.joints.len(), JOINTS);
        for (joint, spec) in skin.joints.iter().zip(&SKELETON) {
            let node = &scene.nodes[*joint as usize];
            assert!(node.name.ends_with(spec.name), "{} is not {}", node.name, spec.name);
        }
        let mesh = &scene.meshes[instance.mesh as usize];
        assert_eq!(mesh.influences.len(), 1);
        for weights in &mesh.influences[0].weights {
            assert!((weights.iter().sum::<f32>() - 1.0).abs() < 1e-5, "{weights:?}");
        }
    }
}

#[test]
fn walkers_are_eight_to_ten_thousand_triangles() {
    let scene = crate::load("lab.glb", &crate::builtin::glb("lab", 1.0).expect("made"), &crate::NoFiles)
        .expect("loads");
    for i in walkers(&scene) {
        let triangles = scene.meshes[scene.instances[i].mesh as usize].triangles.len();
        assert!((8_000..=10_000).contains(&triangles), "{triangles}");
    }
}

/// What of a shoe bears stays where it is: a vertex that is on the floor in two frames that follow each other has not moved.
#[test]
fn feet_are_planted() {
    const SLIDE: f32 = 0.006;
    const TOUCH: f32 = 0.004;
    let scene = loaded();
    let walkers = walkers(&scene);
    let (mut worst, mut sum, mut count, mut touching) =
        ((0.0_f32, 0, 0), 0.0_f64, 0_u64, vec![0; walkers.len()]);
    let mut lowest = 0.0_f32;
    let mut before: Vec<Vec<Vec3>> = Vec::new();
    for frame in 0..=240 {
        let pose = scene.pose(f64::from(frame) / 60.0);
        let now: Vec<Vec<Vec3>> =
            walkers.iter().map(|&i| scene.vertex_positions(&pose, i).to_vec()).collect();
        for (w, vertices) in now.iter().enumerate() {
            let ground = floor(w);
            let mut stands = false;
            for (v, p) in vertices.iter().enumerate() {
                lowest = lowest.min(p.y - ground);
                let Some(q) = before.get(w).map(|b| b[v]) else { continue };
                if p.y - ground < TOUCH && q.y - ground < TOUCH {
                    stands = true;
                    let slide = Vec2::new(p.x - q.x, p.z - q.z).length();
                    sum += f64::from(slide);
                    count += 1;
                    if slide > worst.0 {
                        worst = (slide, w, frame);
                    }
                }
            }
            touching[w] += usize::from(stands);
        }
        before = now;
    }
    let mean = sum / count as f64;
    eprintln!(
        "slides {:.1} mm at most (walker {}, frame {}), {:.2} mm on average; lowest {:.1} mm",
        1000.0 * worst.0,
        worst.1,
        worst.2,
        1000.0 * mean,
        1000.0 * lowest
    );
    assert!(worst.0 < SLIDE, "a foot of walker {} slides {} m in frame {}", worst.1, worst.0, worst.2);
    assert!(mean < 0.001, "{mean}");
    assert!(lowest > -0.02, "a foot is {lowest} m in the floor");
    // Walking is not running: a foot is always on the floor.
    assert!(touching.iter().all(|&t| t == 240), "{touching:?}");
}

/// A standing foot's ball is where it was, all the time that it stands flat.
#[test]
fn standing_feet_do_not_drift() {
    let scene = loaded();
    let skins: Vec<_> = walkers(&scene).iter().map(|&i| scene.instances[i].skin.expect("a skin")).collect();
    let mut stood: Vec<Option<(Vec3, u32)>> = vec![None; 2 * skins.len()];
    let (mut drift, mut steps) = (0.0_f32, 0);
    for frame in 0..=900 {
        let pose = scene.pose_undeformed(f64::from(frame) / 60.0);
        for (w, &skin) in skins.iter().enumerate() {
            for side in 0..2 {
                let joint = scene.skins[skin as usize].joints[LEGS[side][3]] as usize;
                let ball = Vec3::from(pose.world_from_node[joint].translation);
                let slot = &mut stood[2 * w + side];
                if ball.y - floor(w) > 0.004 {
                    steps += u32::from(slot.is_some());
                    *slot = None;
                } else {
                    let (at, _) = *slot.get_or_insert((ball, frame));
                    drift = drift.max(Vec2::new(ball.x - at.x, ball.z - at.z).length());
                }
            }
        }
    }
    eprintln!("{steps} steps, {:.1} mm drift at most while the ball is on the floor", 1000.0 * drift);
    assert!(steps > 23 * 2 * 8, "{steps}");
    assert!(drift < 0.005, "{drift}");
}

#[test]
fn legs_reach_their_feet() {
    for (w, walker) in crew().iter().enumerate() {
        for frame in 0..900 {
            let pose = walker.gait.pose(f64::from(frame) / 60.0);
            for (side, sign) in [(0, 1.0), (1, -1.0)] {
                let [a, b, c, _] = LEGS[side];
                let hip = pose.pelvis + pose.turns[0] * Vec3::new(sign * HIP[0], -HIP[1], 0.0);
                let thigh = pose.turns[0] * pose.turns[a];
                let shin = thigh * pose.turns[b];
                let ankle = hip - thigh * Vec3::Y * LEG[0] - shin * Vec3::Y * LEG[1];
                let sole = shin * pose.turns[c];
                // The sole's lowest point is not above what a swinging foot is lifted by, nor in the floor.
                let lowest = [-0.055_f32, 0.12]
                    .map(|z| (ankle + sole * Vec3::new(0.0, -0.085, z)).y)
                    .into_iter()
                    .fold(f32::INFINITY, f32::min);
                assert!((-0.004..0.08).contains(&lowest), "walker {w}, frame {frame}: a foot at {lowest} m");
                // Knees bend forward only.
                let knee = thigh.conjugate() * shin * Vec3::NEG_Y;
                assert!(knee.z < 1e-3, "walker {w}, frame {frame}: a knee bends back");
            }
        }
    }
}

#[test]
fn arms_swing_against_legs() {
    for walker in crew() {
        let mut sum = 0.0;
        for frame in 0..300 {
            let pose = walker.gait.pose(f64::from(frame) / 60.0);
            // About X, whichever of its two quaternions a turn is.
            let about_x = |q: glam::Quat| q.x * q.w.signum();
            sum += about_x(pose.turns[4]) * about_x(pose.turns[8]);
        }
        assert!(sum < -0.5, "{sum}");
    }
}

#[test]
fn the_last_frame_meets_the_first() {
    for walker in crew() {
        let (a, b) = (walker.gait.pose(0.0), walker.gait.pose(f64::from(SECONDS)));
        assert!(a.pelvis.distance(b.pelvis) < 1e-3);
        for (p, q) in a.turns.iter().zip(b.turns) {
            assert!(p.dot(q).abs() > 0.999_99);
        }
    }
}

#[test]
fn nobody_walks_through_things() {
    let scene = loaded();
    let solids = solids();
    let walkers = walkers(&scene);
    for step in 0..75 {
        let pose = scene.pose(0.2 * f64::from(step));
        for (w, &i) in walkers.iter().enumerate() {
            for p in scene.vertex_positions(&pose, i) {
                for solid in &solids {
                    // What it walks on it may touch.
                    if matches!(solid, Solid::Box { max, .. } if max.y <= floor(w)) {
                        continue;
                    }
                    assert!(
                        solid.distance(*p) > 0.04,
                        "walker {w} at {:.1} s: {p} is {} m from {solid:?}",
                        0.2 * f64::from(step),
                        solid.distance(*p)
                    );
                }
            }
        }
    }
}

#[test]
fn nobody_walks_through_another() {
    let scene = loaded();
    let walkers = walkers(&scene);
    let mut nearest = (9.0_f32, 0, 0, 0);
    for step in 0..150 {
        let pose = scene.pose(0.1 * f64::from(step));
        // A capsule around each body: its axis through the middle of its box, as wide as the farthest vertex.
        let capsules: Vec<(Vec2, f32, bool)> = walkers
            .iter()
            .enumerate()
            .map(|(w, &i)| {
                let flat = |p: &Vec3| Vec2::new(p.x, p.z);
                let vertices = scene.vertex_positions(&pose, i);
                let (lo, hi) = vertices
                    .iter()
                    .map(flat)
                    .fold((Vec2::INFINITY, Vec2::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
                let center = 0.5 * (lo + hi);
                let radius = vertices.iter().map(|p| flat(p).distance(center)).fold(0.0, f32::max);
                (center, radius, floor(w) == DECK[0])
            })
            .collect();
        for (a, p) in capsules.iter().enumerate() {
            for (b, q) in capsules.iter().enumerate().skip(a + 1) {
                let gap = p.0.distance(q.0) - p.1 - q.1;
                if p.2 == q.2 && gap < nearest.0 {
                    nearest = (gap, a, b, step);
                }
            }
        }
    }
    eprintln!(
        "walkers {} and {} come as near as {:.2} m (step {})",
        nearest.1, nearest.2, nearest.0, nearest.3
    );
    assert!(nearest.0 > 0.02, "{nearest:?}");
}
