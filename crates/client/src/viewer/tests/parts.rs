//! Light that comes in parts, each from a server of its own.

use std::sync::Arc;

use dapple_gpu::testing::gpu_for_tests;
use dapple_scene::Scene;
use dapple_server::shards::Shard;
use dapple_server::{Server, ServerConfig};
use dapple_stream::{Applied, Limits, Precision, PublisherConfig, ReceiveError};

use super::{DrawOptions, atrium, picture, viewer, work_to_the_end};
use crate::viewer::received::Received;

const PARTS: u32 = 3;

/// A server of a part, or of all; its groups count from `first_group`, and what it sends is exact.
fn server(scene: &Arc<Scene>, points_per_m2: f32, shard: Option<Shard>, first_group: u64) -> Server {
    let mut config = ServerConfig { shard, ..ServerConfig::default() };
    config.generate.points_per_m2 = points_per_m2;
    config.update.rays = 16;
    config.publish = PublisherConfig {
        first_group,
        precision: Precision { tolerance: 0, step: 0 },
        ..PublisherConfig::default()
    };
    Server::new(scene.clone(), &config, &|_| ()).expect("defaults are in range")
}

fn servers(scene: &Arc<Scene>, points_per_m2: f32, of: u32, first_group: u64) -> Vec<Server> {
    (0..of).map(|number| server(scene, points_per_m2, Some(Shard { number, of }), first_group)).collect()
}

fn join(server: &mut Server) -> Arc<[u8]> {
    server.join().expect("it can be encoded").expect("it has light").bytes
}

#[test]
fn parts_are_drawn_as_the_whole() {
    let Some(gpu) = gpu_for_tests() else { return };
    let scene = atrium();
    let (mut whole, mut parts) = (server(&scene, 12.0, None, 1), servers(&scene, 12.0, PARTS, 1));
    let (mut one, mut other) = (viewer(&gpu, &scene), viewer(&gpu, &scene));
    let options = DrawOptions { fade_s: Some(0.0), ..DrawOptions::default() };
    one.receive(&join(&mut whole), 0.0).expect("it fits");
    // The last comes first, and each is drawn before the next comes.
    for (number, part) in (0..PARTS as u8).zip(&mut parts).rev() {
        other.receive_part(Some(number), &join(part), 0.0).expect("it fits");
        work_to_the_end(&mut other, 5000);
        picture(&gpu, &mut other, 0.0, 0.0, &options);
    }
    work_to_the_end(&mut one, 5000);
    for step in 1..5 {
        let time_s = 0.2 * f64::from(step);
        if let Some(frame) = whole.step(time_s).expect("it steps").frame {
            one.receive(&frame.bytes, time_s).expect("it fits");
        }
        for (number, part) in (0..).zip(&mut parts) {
            if let Some(frame) = part.step(time_s).expect("it steps").frame {
                // As they come over a network: one after the other.
                let now_s = time_s + 1e-3 * f64::from(number);
                other.receive_part(Some(number), &frame.bytes, now_s).expect("it fits");
            }
        }
        assert!(one.store() == other.store(), "step {step}");
        let [a, b] = [&mut one, &mut other].map(|v| picture(&gpu, v, time_s, time_s + 0.1, &options));
        // Pages lie elsewhere in the atlas, so the last bit may differ.
        let off = a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| a.abs_diff(*b));
        assert!(off.max() <= Some(2), "step {step}");
    }
    assert!(other.held().is_none() && one.held().is_some());
    // A fade takes as long as steps are apart, not as parts of one are.
    let fade_s = other.fade_s(&DrawOptions::default());
    assert!((fade_s - 0.2).abs() < 0.02, "{fade_s}");
}

#[test]
fn what_came_last_is_what_is_held() {
    let scene = atrium();
    let hash = scene.hash().0;
    let mut whole = server(&scene, 6.0, None, 1);
    let mut parts = servers(&scene, 6.0, PARTS, 1);
    let mut received = Received::new(hash, Limits::default());
    let points = |received: &Received| received.store().map_or(0, |store| store.layout().len());
    assert!(received.store().is_none() && received.held().is_none());
    assert_eq!(received.receive(None, &join(&mut whole)), Ok(Applied::NewLayout));
    let all = points(&received);
    assert!(received.held().is_some());
    // What does not fit does not take its place.
    assert!(received.receive(Some(0), b"no frame").is_err());
    assert_eq!(points(&received), all);
    assert_eq!(received.receive(Some(1), &join(&mut parts[1])), Ok(Applied::NewLayout));
    assert!(points(&received) < all && received.held().is_none());
    for number in [0, 2] {
        let applied =
            received.receive(Some(number), &join(&mut parts[usize::from(number)])).expect("it fits");
        assert!(matches!(applied, Applied::Sets { .. }), "{applied:?}");
    }
    assert_eq!(points(&received), all);
    received.receive(None, &join(&mut whole)).expect("it fits");
    assert!(received.held().is_some());
}

#[test]
fn a_host_that_comes_back_otherwise_is_taken() {
    let scene = atrium();
    let mut parts = servers(&scene, 6.0, PARTS, 1);
    let mut received = Received::new(scene.hash().0, Limits::default());
    for (number, part) in (0..).zip(&mut parts) {
        received.receive(Some(number), &join(part)).expect("it fits");
    }
    // Other points, and another number of parts, where nothing was said of another stream.
    let mut denser = servers(&scene, 12.0, PARTS, 2);
    let mut fewer = servers(&scene, 6.0, 2, 3);
    let before = received.store().cloned();
    for part in [&mut denser[0], &mut fewer[0]] {
        let misfit = received.receive(Some(0), &join(part));
        assert!(matches!(misfit, Err(ReceiveError::Misfit(_))), "{misfit:?}");
        assert!(received.store() == before.as_ref());
    }
    received.outdate();
    assert_eq!(received.receive(Some(0), &join(&mut denser[0])), Ok(Applied::NewLayout));
    for number in [1, 2] {
        received.receive(Some(number), &join(&mut denser[usize::from(number)])).expect("it fits");
    }
    let mut whole = server(&scene, 12.0, None, 1);
    let mut oracle = Received::new(scene.hash().0, Limits::default());
    oracle.receive(None, &join(&mut whole)).expect("it fits");
    assert!(received.store() == oracle.store());
    // The same host again: what is held is known again.
    received.outdate();
    let again = received.receive(Some(2), &join(&mut denser[2]));
    assert_eq!(again, Ok(Applied::Changes(Vec::new())));
}
