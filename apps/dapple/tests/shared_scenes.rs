//! Scenes by others go through server and client.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod common;

use std::sync::Arc;

use common::{config, join, server, shared_scene, small};
use dapple_client::Reconstruction;

/// Loads, lights, streams and draws one scene, with an occlusion distance that fits its size.
fn light(name: &str, moves: bool) {
    let Some(scene) = shared_scene(name).map(Arc::new) else { return };
    let radius_m = scene.auto_radius_m();
    // Six points, of which three stay, in a square with the occlusion distance as its side.
    let mut config = config(6.0 / (radius_m * radius_m), 16);
    config.update.radius_m = radius_m;
    let mut server = server(&scene, &config);
    let mut client = join(&mut server);
    let points = server.store().layout().len();
    assert!(points > 500, "{name}: {points} points");
    let values = server.store().visibility();
    let mean = values.iter().map(|&v| f64::from(v)).sum::<f64>() / points as f64 / 255.0;
    assert!((0.2..0.99).contains(&mean), "{name}: mean visibility {mean:.3}");

    let mut bytes = 0;
    for time_s in [0.1, 0.4] {
        if let Some(frame) = server.step(time_s).unwrap().frame {
            client.receive(&frame.bytes).unwrap();
            bytes += frame.bytes.len();
        }
        assert!(client.store() == Some(server.store()), "{name} at {time_s} s");
        for path in scene.camera_paths() {
            let camera = path.camera(&scene, &scene.pose(time_s));
            let drawn = client.draw(&camera, time_s, &small(64, 48)).unwrap();
            let visibility = client.visibility(&drawn, &Reconstruction::default());
            assert!(visibility.iter().all(|v| (0.0..=1.0).contains(v)), "{name}, {}", path.name);
            assert!(visibility.iter().any(|&v| v < 0.99), "{name}, {}: nothing is occluded", path.name);
            let picture = drawn.compose(Some(&visibility)).unwrap();
            assert!(picture.pixels.iter().all(|p| p.is_finite()), "{name}, {}", path.name);
        }
    }
    assert_eq!(bytes > 0, moves, "{name}: updates of {bytes} bytes");
    eprintln!(
        "{name}: {points} points, radius {radius_m:.3} m, mean visibility {mean:.3}, {bytes} bytes of updates"
    );
}

#[test]
fn sponza() {
    light("scenes/sponza-dabrovic/sponza.obj", false);
}

#[test]
fn an_arena_without_materials() {
    light("scenes/zdm2/zdm2.glb", false);
}

#[test]
fn a_room_full_of_things() {
    light("scenes/godot-room/room.glb", false);
}

#[test]
fn a_walking_man() {
    light("scenes/anim-CesiumMan/CesiumMan.glb", true);
}

#[test]
fn a_mannequin() {
    light("scenes/anim-mannequiny/mannequiny.glb", true);
}
