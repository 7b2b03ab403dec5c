//! Characters that move: their points stay, only visibility flows, and it is that of the present pose.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod common;

use std::sync::Arc;

use common::{config, join, made, server, shared, small, truth, visibility_psnr_db};
use dapple_client::{Client, Reconstruction};
use dapple_scene::{NoFiles, PosedCamera, Scene};
use dapple_server::ServerConfig;
use dapple_stream::{Applied, FrameKind};

/// Plays the scene at 15 Hz to `until_s`. Gives a client that followed, and one that holds the first snapshot still.
fn play(scene: &Arc<Scene>, config: &ServerConfig, until_s: f64) -> (Client, Client) {
    let mut server = server(scene, config);
    let (mut client, stale) = (join(&mut server), join(&mut server));
    let layout = client.store().unwrap().layout().clone();
    let mut changes = 0;
    for tick in 1..=(until_s * 15.0).round() as u32 {
        let Some(frame) = server.step(f64::from(tick) / 15.0).unwrap().frame else { continue };
        assert_eq!(frame.kind, FrameKind::Delta, "no point is sent again");
        match client.receive(&frame.bytes).unwrap() {
            Applied::Changes(list) => changes += list.len(),
            other => panic!("{other:?}"),
        }
        let after = client.store().unwrap().layout();
        assert!(Arc::ptr_eq(&layout, after), "the points stay where they are");
    }
    assert!(changes > 0);
    assert!(client.store() == Some(server.store()));
    (client, stale)
}

/// PSNR of visibility at `time_s` in dB: of the client that followed, and of the one that did not.
fn compare(
    scene: &Arc<Scene>,
    config: &ServerConfig,
    camera: impl Fn(&Scene) -> PosedCamera,
    time_s: f64,
) -> (f64, f64) {
    let (client, stale) = play(scene, config, time_s);
    let drawn = client.draw(&camera(scene), time_s, &small(160, 120)).unwrap();
    let truth = truth(scene, &drawn, 256, config.update.radius_m);
    let [followed, stale] = [client, stale]
        .map(|c| visibility_psnr_db(&drawn, &truth, &c.visibility(&drawn, &Reconstruction::default())));
    eprintln!("{}: followed {followed:.2} dB, stale {stale:.2} dB", scene.name);
    (followed, stale)
}

#[test]
fn a_sheet_that_folds_darkens_at_the_fold() {
    let scene = Arc::new(dapple_scene::load("sheet.glb", &made::folding_sheet(), &NoFiles).unwrap());
    let camera = |scene: &Scene| {
        scene.camera_paths().iter().find(|p| p.name == "front").unwrap().camera(scene, &scene.pose(1.0))
    };
    let (followed, stale) = compare(&scene, &config(1000.0, 128), camera, 1.0);
    assert!(followed > 36.0 && stale < 20.0, "{followed:.2} dB, stale {stale:.2} dB");
}

#[test]
fn a_walker_is_lit_as_it_stands_now() {
    let Some(path) = shared("scenes/anim-CesiumMan/CesiumMan.glb") else { return };
    let bytes = std::fs::read(path).unwrap();
    let scene = Arc::new(dapple_scene::load("CesiumMan.glb", &bytes, &NoFiles).unwrap());
    let mut config = config(4000.0, 128);
    config.update.radius_m = 0.3;
    // The farthest from where the walk begins.
    let time_s = 1.0;
    let camera = |scene: &Scene| scene.camera_paths()[0].camera(scene, &scene.pose(time_s));
    let (followed, stale) = compare(&scene, &config, camera, time_s);
    assert!(followed > 29.0 && stale < 22.0, "{followed:.2} dB, stale {stale:.2} dB");
}
