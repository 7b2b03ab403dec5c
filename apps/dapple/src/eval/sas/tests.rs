//! The rival from end to end, on a small scene.

use std::collections::BTreeMap;
use std::sync::Arc;

use dapple_client::{Drawn, PictureParams, draw};
use dapple_scene::{PosedCamera, Scene};
use dapple_trace::Tracer;
use dapple_trace::rtao::{RtaoParams, trace_visibility};

use super::*;

const SIZE: (u32, u32) = (96, 64);

/// The atrium, coarse, and what its first camera sees at a time.
fn atrium(time_s: f64) -> (Arc<Scene>, PosedCamera, Drawn) {
    let glb = dapple_scene::builtin::glb("atrium", 0.05).unwrap();
    let scene = Arc::new(dapple_scene::load("atrium.glb", &glb, &dapple_scene::NoFiles).unwrap());
    let camera = scene.camera_paths()[0].camera(&scene, &scene.pose(time_s));
    let params = PictureParams { width: SIZE.0, height: SIZE.1, supersample: 1, shade: Default::default() };
    let drawn = draw(&scene, &camera, time_s, &params).unwrap();
    (scene, camera, drawn)
}

fn server(scene: &Arc<Scene>, camera: &PosedCamera, bias: u32) -> SasServer {
    let tracer = Tracer::new(scene, &scene.pose(0.0));
    let rays = RtaoParams { rays: 64, radius_m: 0.6, seed: 7 };
    SasServer::new(scene.clone(), tracer, camera, SasParams { bias, hz: 15.0, size: SIZE, rays }).unwrap()
}

fn psnr_db(scene: &Arc<Scene>, drawn: &Drawn, visibility: &[f32]) -> f64 {
    let (indices, sites) = crate::picture::sites(scene, drawn);
    let tracer = Tracer::new(scene, &drawn.pose);
    let mut truth = vec![1.0; sites.len()];
    let params = RtaoParams { rays: 256, radius_m: 0.6, seed: 1 };
    trace_visibility(&tracer, &sites, &params, &mut truth);
    let squares: f64 = indices.iter().zip(&truth).map(|(&i, t)| f64::from(visibility[i] - t).powi(2)).sum();
    -10.0 * (squares / truth.len() as f64).log10()
}

#[test]
fn the_client_shows_what_the_server_traced() {
    let (scene, camera, drawn) = atrium(1.0);
    let quality = |bias| {
        let mut server = server(&scene, &camera, bias);
        let mut client = SasClient::of(&server).unwrap();
        let step = server.step(1.0, &camera).unwrap();
        let frame = step.frame.unwrap();
        assert_eq!(step.rays, 64 * server.texels());
        client.receive(&frame.video, frame.blocks.clone()).unwrap();
        // What one step's samples miss, the next ones find.
        for _ in 0..7 {
            if let Some(frame) = server.step(1.0, &camera).unwrap().frame {
                client.receive(&frame.video, frame.blocks.clone()).unwrap();
            }
        }
        let visibility = client.visibility(&drawn);
        assert!(visibility.iter().all(|v| (0.0..=1.0).contains(v)));
        (psnr_db(&scene, &drawn, &visibility), server.texels())
    };
    let (fine, coarse) = (quality(1), quality(32));
    // Nothing but large patches suffers; without visibility it is 14 dB.
    assert!(fine.0 > 26.0 && coarse.0 > 16.0 && fine.0 > coarse.0 + 6.0, "{fine:?} {coarse:?}");
    assert!(fine.1 > 2 * coarse.1, "{fine:?} {coarse:?}");
}

#[test]
fn only_what_can_change_is_traced_again() {
    let (scene, camera, _) = atrium(1.0);
    let mut server = server(&scene, &camera, 8);
    let first = server.step(1.0, &camera).unwrap().rays;
    // The clock stands: what was found keeps its texels, and only what moves was traced again.
    let before = server.texels_seen();
    let still = server.step(1.0, &camera).unwrap();
    assert!(still.rays < first / 2, "{first} {}", still.rays);
    assert_same_where_both(&before, &server.texels_seen());
    // A moment later: what moves, and what it may darken.
    let moved = server.step(1.1, &camera).unwrap();
    assert!(moved.frame.is_some() && moved.rays > 0 && moved.rays < first, "{first} {}", moved.rays);
    // The same as a server that begins there: nothing was forgotten.
    let mut fresh = self::server(&scene, &camera, 8);
    fresh.step(1.1, &camera).unwrap();
    assert_same_where_both(&server.texels_seen(), &fresh.texels_seen());
}

/// Patches that have as many texels in both have the same; most do.
fn assert_same_where_both(a: &BTreeMap<u32, Vec<u8>>, b: &BTreeMap<u32, Vec<u8>>) {
    let both: Vec<_> =
        a.iter().filter_map(|(number, a)| Some((a, b.get(number).filter(|b| b.len() == a.len())?))).collect();
    assert!(2 * both.len() > a.len().max(b.len()), "{} of {} and {}", both.len(), a.len(), b.len());
    assert!(both.iter().all(|(a, b)| a == b));
}

/// A floor of 8 × 8 m, and a closed block of 4 × 4 m that stands in its middle, half sunk, 0.4 m high.
const BLOCK: &str = "\
v -4 0 -4\nv -4 0 4\nv 4 0 4\nv 4 0 -4\nf 1 2 3\nf 1 3 4\n\
v -2 -0.5 -2\nv -2 -0.5 2\nv 2 -0.5 2\nv 2 -0.5 -2\nv -2 0.4 -2\nv -2 0.4 2\nv 2 0.4 2\nv 2 0.4 -2\n\
f 5 8 7\nf 5 7 6\nf 9 10 11\nf 9 11 12\nf 6 7 11\nf 6 11 10\nf 8 5 9\nf 8 9 12\nf 7 8 12\nf 7 12 11\nf 5 6 10\nf 5 10 9\n";

#[test]
fn what_lies_inside_of_a_body_darkens_nothing() {
    let scene = dapple_scene::load("block.obj", BLOCK.as_bytes(), &dapple_scene::NoFiles).unwrap();
    let scene = Arc::new(scene);
    let camera = PosedCamera::look_at([0.0, 8.0, 6.0].into(), [0.0; 3].into(), 0.9);
    let mut server = server(&scene, &camera, 16);
    server.step(0.0, &camera).unwrap();
    let texels = server.texels_seen();
    let floor = texels.values().max_by_key(|texels| texels.len()).unwrap();
    assert_eq!(floor.len(), 64, "a texel a metre: the block hides sixteen");
    // A low wall half a metre away leaves most of the sky open; under the block there is none.
    assert!(floor.iter().all(|v| *v >= 150), "{floor:?}");
}
