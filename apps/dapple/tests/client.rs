//! A client on its own: what it shows before and after the first snapshot, and what it refuses.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod common;

use std::sync::Arc;

use common::{config, covered, made, server, small};
use dapple_client::{Client, Drawn, Reconstruction};
use dapple_scene::{NoFiles, PosedCamera, Scene};
use dapple_stream::{Applied, Limits};

fn sheet() -> (Arc<Scene>, PosedCamera) {
    let scene = Arc::new(dapple_scene::load("sheet.glb", &made::folding_sheet(), &NoFiles).unwrap());
    let camera = scene.camera_paths()[0].camera(&scene, &scene.pose(1.0));
    (scene, camera)
}

fn show(client: &Client, camera: &PosedCamera) -> (Drawn, Vec<f32>) {
    let drawn = client.draw(camera, 1.0, &small(64, 48)).unwrap();
    let visibility = client.visibility(&drawn, &Reconstruction::default());
    (drawn, visibility)
}

#[test]
fn all_is_open_before_the_first_snapshot() {
    let (scene, camera) = sheet();
    let client = Client::new(scene, Limits::default());
    assert!(client.store().is_none() && client.epoch().is_none());
    let (drawn, visibility) = show(&client, &camera);
    assert!(covered(&drawn).contains(&true));
    assert_eq!(visibility, vec![1.0; 64 * 48]);
    assert!(drawn.compose(Some(&visibility)).unwrap() == drawn.compose(None).unwrap());
}

#[test]
fn what_is_not_for_it_is_refused_and_changes_nothing() {
    let (scene, camera) = sheet();
    let lid = made::two_squares_under_a_lid("{}", "{}");
    let other = Arc::new(dapple_scene::load("lid.glb", &lid, &NoFiles).unwrap());
    let mut config = config(200.0, 32);
    let mut newer = config;
    newer.publish.first_group = 1;
    let foreign = server(&other, &newer).join().unwrap().unwrap();
    let mut right = server(&scene, &config);
    right.step(1.0).unwrap();
    let snapshot = right.join().unwrap().unwrap();

    let mut client = Client::new(scene.clone(), Limits::default());
    let refuse = |client: &mut Client, bytes: &[u8], says: &str| {
        let message = client.receive(bytes).unwrap_err().to_string();
        assert!(message.contains(says), "{message}");
    };
    refuse(&mut client, &foreign.bytes, "scene");
    assert!(client.store().is_none());
    assert_eq!(client.receive(&snapshot.bytes).unwrap(), Applied::NewLayout);
    let before = show(&client, &camera).1;
    assert!(before.iter().any(|&v| v < 0.9), "the fold is dark");

    let mut damaged = snapshot.bytes.to_vec();
    *damaged.last_mut().unwrap() ^= 1;
    for bytes in [&foreign.bytes[..], &damaged, &snapshot.bytes[..20], b"", b"hello"] {
        refuse(&mut client, bytes, "");
    }
    assert_eq!(client.store(), Some(right.store()));
    assert_eq!(show(&client, &camera).1, before);

    // A client with tight limits refuses what a server with more points sends, and says so.
    config.generate.points_per_m2 = 5000.0;
    let many = server(&scene, &config).join().unwrap().unwrap();
    let mut client = Client::new(scene, Limits { max_points: 100, ..Limits::default() });
    refuse(&mut client, &many.bytes, "100");
}

#[test]
fn a_server_that_starts_anew_with_other_points_is_followed() {
    let (scene, camera) = sheet();
    let mut client = Client::new(scene.clone(), Limits::default());
    for (group, points_per_m2) in [(1, 200.0), (2, 800.0)] {
        let mut config = config(points_per_m2, 32);
        config.publish.first_group = group;
        let mut server = server(&scene, &config);
        assert_eq!(client.receive(&server.join().unwrap().unwrap().bytes).unwrap(), Applied::NewLayout);
        let frame = server.step(1.0).unwrap().frame.unwrap();
        assert!(matches!(client.receive(&frame.bytes).unwrap(), Applied::Changes(_)));
        assert!(client.store() == Some(server.store()));
        // The index of the points is that of the new ones, or their number would not fit.
        assert!(show(&client, &camera).1.iter().any(|&v| v < 0.9));
    }
}

#[test]
fn pictures_of_no_or_too_great_size_are_refused() {
    let (scene, camera) = sheet();
    let client = Client::new(scene, Limits::default());
    for (width, height, supersample) in
        [(0, 1, 1), (1, 0, 1), (8, 8, 0), (8, 8, 9), (100_000, 1, 1), (16384, 16384, 8)]
    {
        let mut params = small(width, height);
        params.supersample = supersample;
        let refused = client.draw(&camera, 0.0, &params);
        assert!(refused.is_err(), "{width} × {height}, {supersample} samples");
    }
}
