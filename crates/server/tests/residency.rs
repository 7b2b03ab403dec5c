//! A cap on points: who is seen has them, whoever listens follows, and without a cap nothing is different.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

#[path = "common/slide.rs"]
mod slide;

use std::sync::Arc;

use dapple_scene::glam::{Mat4, Vec3, Vec4};
use dapple_scene::{Instance, LocalTransform, Node, Scene};
use dapple_server::{Server, ServerConfig, ServerError};
use dapple_stream::{Applied, FrameKind, Limits, Subscriber};
use dapple_trace::psao::update::{ConvexVolume, StepInput};

/// Boxes beside the floor and the box that slides, one every two metres along x.
const BOXES: u32 = 10;

fn scene() -> Arc<Scene> {
    let mut scene = (*slide::scene()).clone();
    for i in 0..BOXES {
        let place = Vec3::new(4.0 + 2.0 * i as f32, 0.0, 0.0);
        let local = LocalTransform::Matrix(Mat4::from_translation(place));
        scene.nodes.push(Node { local, ..Node::default() });
        scene.instances.push(Instance { node: 2 + i, ..scene.instances[1].clone() });
    }
    Arc::new(scene)
}

fn config(max_resident_points: Option<u32>) -> ServerConfig {
    let mut config = ServerConfig { max_resident_points, ..ServerConfig::default() };
    config.generate.points_per_m2 = 100.0;
    config
}

/// Sees what lies in 4 m along x around a place.
fn look(x: f32) -> [ConvexVolume; 1] {
    let planes = vec![Vec4::new(1.0, 0.0, 0.0, 2.0 - x), Vec4::new(-1.0, 0.0, 0.0, 2.0 + x)];
    [ConvexVolume { planes, eye_world: Some(Vec3::new(x, 1.0, 2.0)) }]
}

#[test]
fn who_listens_follows_what_comes_and_goes() {
    let scene = scene();
    const CAP: u32 = 260;
    let run = |budget: Option<u64>, bits_per_s: Option<u64>| {
        let first = look(5.0);
        let input = StepInput { interest: &first, ray_budget: budget };
        let config = ServerConfig { bits_per_s, ..config(Some(CAP)) };
        let mut server = Server::watched(scene.clone(), &config, &input, &|_| ()).unwrap();
        assert!(server.too_large().contains(&0), "the floor has some 800 points");
        let mut live = Subscriber::new(Some(scene.hash().0), Limits::default());
        let mut frames = vec![server.join().unwrap().unwrap().bytes];
        live.receive(&frames[0]).unwrap();
        let (mut spawned, mut evicted, mut sets, mut most) = (0, 0, 0, 0);
        let mut delta_bytes = Vec::new();
        for tick in 1..=900u32 {
            // There and back.
            let x = 5.0 + 18.0 * (1.0 - (f64::from(tick) / 450.0 - 1.0).abs()) as f32;
            let interest = look(x);
            let input = StepInput { ray_budget: budget, interest: &interest };
            let report = server.step_with(f64::from(tick) / 30.0, &input).unwrap();
            assert!(report.points <= CAP && report.points as usize >= server.store().layout().len());
            assert!(report.rays <= budget.unwrap_or(u64::MAX));
            most = most.max(report.points);
            spawned += report.spawned;
            evicted += report.evicted;
            let delta = report.frame.as_ref().filter(|frame| frame.kind == FrameKind::Delta);
            delta_bytes.push(delta.map_or(0, |frame| frame.bytes.len() as u64));
            if let Some(frame) = report.frame {
                let applied = live.receive(&frame.bytes).unwrap();
                assert_eq!(matches!(applied, Applied::Sets { .. }), frame.kind == FrameKind::Sets);
                sets += u32::from(frame.kind == FrameKind::Sets);
                frames.push(frame.bytes);
            }
            assert!(live.store() == Some(server.store()), "tick {tick}");
            // Whatever stands in the middle of the view has been there for a while.
            let seen = (0..BOXES).find(|i| (4.0 + 2.0 * *i as f32 - x).abs() < 0.5);
            if let (Some(seen), None) = (seen, budget) {
                assert!(server.store().layout().set_of_instance(2 + seen).is_some(), "tick {tick}: {seen}");
            }
            if tick % 100 == 0 {
                let mut late = Subscriber::new(Some(scene.hash().0), Limits::default());
                late.receive(&server.join().unwrap().unwrap().bytes).unwrap();
                assert!(late.store() == live.store() && late.cuts() == live.cuts());
            }
        }
        assert!(spawned > 8 && evicted > 8 && sets >= 8 && most > 200, "{spawned} {evicted} {sets} {most}");
        assert!(evicted < 40, "{evicted}: nothing takes turns");
        if let Some(bits) = bits_per_s {
            // What comes and goes is not counted.
            let most = delta_bytes.windows(30).map(|second| 8 * second.iter().sum::<u64>()).max();
            assert!(most.is_some_and(|most| most <= bits), "{most:?}");
        }
        frames
    };
    for (rays, bits) in [(None, None), (Some(900), None), (None, Some(2000))] {
        let frames = run(rays, bits);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
        assert!(frames == pool.install(|| run(rays, bits)), "the same on any number of threads");
    }
}

#[test]
fn a_cap_with_room_for_all_changes_no_byte() {
    let scene = scene();
    let mut without = Server::new(scene.clone(), &config(None), &|_| ()).unwrap();
    let mut with = Server::new(scene, &config(Some(100_000)), &|_| ()).unwrap();
    assert_eq!(without.join().unwrap(), with.join().unwrap());
    for tick in 1..40 {
        let time_s = f64::from(tick) / 10.0;
        let (a, b) = (without.step(time_s).unwrap(), with.step(time_s).unwrap());
        assert_eq!((a.frame, a.counts, a.points), (b.frame, b.counts, b.points));
        assert_eq!((b.spawned, b.evicted), (0, 0));
    }
    assert_eq!(with.dropped_inside(), without.dropped_inside());
}

#[test]
fn a_cap_out_of_range_is_refused_and_a_scene_beyond_the_limit_is_not() {
    let scene = scene();
    for cap in [0, 4_000_001] {
        let error = Server::new(scene.clone(), &config(Some(cap)), &|_| ()).err().unwrap();
        assert!(matches!(error, ServerError::BadCap { points, .. } if points == cap), "{error}");
    }
    let mut uneven = config(Some(200));
    uneven.generate.adaptive = 0.5;
    let refusals = [uneven.check(&scene).err(), Server::new(scene.clone(), &uneven, &|_| ()).err()];
    assert!(refusals.iter().all(|error| matches!(error, Some(ServerError::AdaptiveCap))), "{refusals:?}");
    let mut dense = config(Some(200));
    dense.generate.max_points = 300;
    assert!(
        Server::new(scene.clone(), &ServerConfig { max_resident_points: None, ..dense }, &|_| ()).is_err()
    );
    dense.check(&scene).unwrap();
    let mut server = Server::new(scene, &dense, &|_| ()).unwrap();
    assert!((100..=200).contains(&server.step(0.1).unwrap().points));
}
