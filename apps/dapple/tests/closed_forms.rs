//! The stages beside the Cornell box: rays and points find the visibility that a closed form gives there.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod common;

use std::f32::consts::PI;
use std::sync::Arc;

use common::{config, server};
use dapple_scene::glam::Vec3;
use dapple_scene::{NoFiles, Scene, builtin};
use dapple_trace::Tracer;
use dapple_trace::rtao::{RtaoParams, Site, trace_visibility};

/// The largest occlusion distance at which a stage sees only itself, metres; it is the default, too.
const REACH_M: f32 = 0.6;

// Measures of the stages, as the documentation of the scene gives them.
const DISC: [f32; 2] = [0.4, 0.3];
const WALL_HEIGHT_M: f32 = 0.4;
const BALL: [f32; 2] = [0.25, 0.32];

/// At the detail at which round things are round.
fn cornell() -> Scene {
    dapple_scene::load("cornell.glb", &builtin::glb("cornell", 1.0).unwrap(), &NoFiles).unwrap()
}

/// Where a stage's node is.
fn stage(scene: &Scene, name: &str) -> Vec3 {
    let node = scene.nodes.iter().position(|n| n.name == name).unwrap();
    scene.pose(0.0).world_from_node[node].translation.into()
}

/// Under the middle of a disc of radius `r` at height `h`, rays cut at `reach`.
fn under_disc([r, h]: [f32; 2], reach: f32) -> f32 {
    if reach <= h { 1.0 } else { h * h / (reach * reach).min(r * r + h * h) }
}

/// At a distance `d` from an endless wall of height `height`, rays cut at `reach`.
///
/// Seen from above, cosine-weighted directions are evenly spread over the unit disc, where a direction lies at its sideways
/// parts (u, v). Those that meet the wall's plane in time have u ≥ c = d / reach: a segment of the disc. Of them those pass over
/// the wall that lie in the ellipse (u / a)² + v² ≤ 1 with a = d / √(d² + height²), which the same line cuts.
fn beside_wall(d: f32, height: f32, reach: f32) -> f32 {
    let segment = |c: f32| if c >= 1.0 { 0.0 } else { c.acos() - c * (1.0 - c * c).sqrt() };
    let (a, c) = (d / d.hypot(height), d / reach);
    1.0 - (segment(c) - a * segment(c / a)) / PI
}

/// Sideways by `x` from the place under a ball of radius `r` whose middle is at height `h`, all of it above the horizon: the part
/// of the sphere of directions that it covers, seen from above (Nusselt's analogue), is r² h / D³ of the disc.
fn under_ball([r, h]: [f32; 2], x: f32) -> f32 {
    let distance = h.hypot(x);
    assert!(distance * distance - r * r <= REACH_M * REACH_M, "rays would end before the ball's outline");
    1.0 - r * r * h / distance.powi(3)
}

/// What rays find on level ground.
fn traced(scene: &Scene, places: &[Vec3], radius_m: f32, time_s: f64) -> Vec<f32> {
    let tracer = Tracer::new(scene, &scene.pose(time_s));
    let site = |(key, &position_world): (usize, &Vec3)| Site {
        position_world,
        normal_world: Vec3::Y,
        key: key as u64,
    };
    let sites: Vec<Site> = places.iter().enumerate().map(site).collect();
    let mut visibility = vec![0.0; sites.len()];
    trace_visibility(&tracer, &sites, &RtaoParams { rays: 16_384, radius_m, seed: 5 }, &mut visibility);
    visibility
}

#[test]
fn the_formula_of_the_wall_has_the_right_limits() {
    let endless = |d: f32, height: f32| 1.0 - 0.5 * (1.0 - d / d.hypot(height));
    for (d, height) in [(0.1, 0.4), (0.4, 0.4), (1.0, 0.2)] {
        assert!((beside_wall(d, height, 1e4) - endless(d, height)).abs() < 1e-4);
        assert_eq!(beside_wall(d, height, d), 1.0, "nothing is met in time");
        // The height counts no more once rays end below it.
        assert_eq!(beside_wall(d, 7.0, 1.5 * d), beside_wall(d, 9.0, 1.5 * d));
        assert!(beside_wall(d, height, 2.0 * d) > beside_wall(d, height, 3.0 * d));
    }
    assert!((beside_wall(1e-5, 0.4, 0.6) - 0.5).abs() < 1e-4, "a half at its foot");
}

#[test]
fn rays_find_the_closed_forms() {
    let scene = cornell();
    let [open, disc, wall, ball] =
        ["stage-open", "stage-disc", "stage-wall", "stage-ball"].map(|name| stage(&scene, name));
    // The block that turns changes nothing.
    for (radius_m, time_s) in [(REACH_M, 0.0), (0.45, 3.0), (0.25, 6.5)] {
        let along: Vec<f32> = (0..12).map(|i| 0.02 + 0.05 * i as f32).collect();
        let mut places = vec![open, open + Vec3::new(0.4, 0.0, -0.3), disc];
        places.extend(along.iter().map(|&d| wall + Vec3::new(d, 0.0, 0.2)));
        let mut expected = vec![1.0, 1.0, under_disc(DISC, radius_m)];
        expected.extend(along.iter().map(|&d| beside_wall(d, WALL_HEIGHT_M, radius_m)));
        if radius_m == REACH_M {
            for x in [0.0, 0.1, 0.2, 0.3] {
                places.push(ball + Vec3::new(x, 0.0, 0.0));
                expected.push(under_ball(BALL, x));
            }
        }
        let found = traced(&scene, &places, radius_m, time_s);
        for (i, (found, expected)) in found.iter().zip(&expected).enumerate() {
            let error = found - expected;
            assert!(error.abs() < 0.002, "place {i} at {radius_m} m: {found} instead of {expected}");
            assert!(*expected < 1.0 || *found == 1.0, "place {i}: an open place is open to every ray");
        }
    }
}

#[test]
fn points_find_the_closed_forms() {
    let mut scene = cornell();
    let [wall, free] = ["stage-wall", "stage-open"].map(|name| stage(&scene, name));
    // Points on the stages alone, rays against everything.
    for instance in &mut scene.instances {
        let name = &scene.nodes[instance.node as usize].name;
        instance.receives = name == "stage-wall" || name == "stage-open";
    }
    let (scene, config) = (Arc::new(scene), config(4096.0, 256));
    assert_eq!(config.update.radius_m, REACH_M);
    let server = server(&scene, &config);
    let positions = server.positions_world(&scene.pose(0.0));
    let level = |p: &Vec3| (p.y - wall.y).abs() < 1e-3;
    let (mut errors, mut open) = (Vec::new(), 0);
    for (position, value) in positions.iter().zip(server.store().visibility()) {
        let Some(position) = position.filter(level) else { continue };
        let (found, local) = (f32::from(*value) / 255.0, position - wall);
        // Along the wall up to where rays cannot pass its ends; not the points of its own face.
        let beside = (0.005..0.55).contains(&local.x) && local.z.abs() < 1.0 - REACH_M;
        let is_open =
            position.distance(free) < 1.2 || (REACH_M..1.1).contains(&local.x) && local.z.abs() < 0.6;
        if beside {
            errors.push(f64::from(found - beside_wall(local.x, WALL_HEIGHT_M, REACH_M)));
        } else if is_open {
            assert_eq!(found, 1.0, "an open place at {local}");
            open += 1;
        }
    }
    let count = errors.len() as f64;
    let mean = errors.iter().sum::<f64>() / count;
    let deviation = (errors.iter().map(|e| e * e).sum::<f64>() / count).sqrt();
    eprintln!("{count} points beside the wall: {mean:+.4} on average, {deviation:.4} rms; {open} open ones");
    assert!(errors.len() > 400 && open > 1000);
    assert!(mean.abs() < 0.003 && deviation < 0.01, "{mean} on average, {deviation} rms");
}
