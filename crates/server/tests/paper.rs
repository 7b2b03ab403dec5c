//! The paper's server and what a subscriber makes of its frames.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

#[path = "common/slide.rs"]
mod slide;

use std::sync::Arc;

use dapple_scene::glam::Vec3;
use dapple_scene::{NoFiles, PosedCamera, Scene, builtin};
use dapple_server::paper::{Look, PaperConfig, PaperServer};
use dapple_server::{Server, ServerConfig, ServerError};
use dapple_stream::cells::{CellCodec, CellLimits, CellSubscriber};
use dapple_trace::psao::paper::PaperParams;
use dapple_trace::psao::update::StepInput;

fn start(scene: &Arc<Scene>, points_per_m2: f32, config: &PaperConfig) -> Result<PaperServer, ServerError> {
    let mut server = ServerConfig { cuts: false, ..ServerConfig::default() };
    server.generate.points_per_m2 = points_per_m2;
    PaperServer::new(Server::new(scene.clone(), &server, &|_| ()).unwrap(), config)
}

fn step(server: &mut PaperServer, now_s: f64) -> dapple_server::paper::PaperReport {
    server.step(now_s, None, &StepInput::default()).unwrap()
}

fn subscriber(scene: &Scene) -> CellSubscriber {
    CellSubscriber::new(Some(scene.hash().0), CellLimits::default())
}

/// Plays some steps to a subscriber and to one that joins in the middle; returns all frames.
fn play(scene: &Arc<Scene>, points_per_m2: f32, config: &PaperConfig) -> Vec<Vec<u8>> {
    let mut server = start(scene, points_per_m2, config).unwrap();
    let mut frames = vec![server.join().unwrap().bytes];
    let mut first = subscriber(scene);
    first.receive(&frames[0]).unwrap();
    let mut late = subscriber(scene);
    for tick in 1..=8 {
        let now_s = f64::from(tick) / 15.0;
        if let Some(frame) = step(&mut server, now_s).frame {
            first.receive(&frame.bytes).unwrap();
            assert_eq!(first.time_s(), Some(now_s));
            if tick > 4 {
                late.receive(&frame.bytes).unwrap();
            }
            frames.push(frame.bytes);
        }
        if tick == 4 {
            late.receive(&server.join().unwrap().bytes).unwrap();
        }
        assert!(first.table().unwrap().holds_same(server.table()));
    }
    assert!(late.table().unwrap().holds_same(server.table()));
    assert_eq!(server.points() - server.unplaced(), server.table().point_count());
    frames
}

#[test]
fn subscribers_hold_the_servers_table_whenever_they_join() {
    let frames = play(&slide::scene(), 200.0, &PaperConfig::default());
    assert!(frames.len() > 6, "{} frames", frames.len());
    let lz4 = PaperConfig { codec: CellCodec::Lz4, ..PaperConfig::default() };
    let bytes = |frames: &[Vec<u8>]| frames.iter().map(Vec::len).sum::<usize>();
    assert!(bytes(&frames) < bytes(&play(&slide::scene(), 200.0, &lz4)));
}

#[test]
fn skinned_walkers_move_between_cells_and_arrive() {
    let glb = builtin::glb("lab", 0.05).unwrap();
    let scene = Arc::new(dapple_scene::load("lab.glb", &glb, &NoFiles).unwrap());
    let frames = play(&scene, 30.0, &PaperConfig::default());
    assert_eq!(frames.len(), 9, "there is always someone who walks");
    let again = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let again = again.install(|| play(&scene, 30.0, &PaperConfig::default()));
    assert!(frames == again, "the same bytes on any number of threads");
    // Boxes hold the whole animation.
    let mut server = start(&scene, 30.0, &PaperConfig::default()).unwrap();
    let report = step(&mut server, 0.7);
    assert!(report.paper.updated > 0 && report.paper.buckets > 0);
    assert_eq!(report.paper.outside_box, 0, "{:?}", report.paper);
}

#[test]
fn a_stopped_clock_sends_nothing() {
    let mut server = start(&slide::scene(), 200.0, &PaperConfig::default()).unwrap();
    assert!(step(&mut server, 0.0).frame.is_none());
    assert!(step(&mut server, 0.8).frame.is_some());
    for _ in 0..3 {
        assert!(step(&mut server, 0.8).frame.is_none());
    }
}

#[test]
fn what_the_viewer_does_not_see_is_sent_when_he_turns() {
    let mut server = start(&slide::scene(), 200.0, &PaperConfig::default()).unwrap();
    let look =
        |target| Look { camera: PosedCamera::look_at(Vec3::new(0.0, 1.0, 4.0), target, 0.9), aspect: 1.5 };
    let away = look(Vec3::new(0.0, 1.0, 9.0));
    let report = server.step(1.0, Some(&away), &StepInput::default()).unwrap();
    assert!(report.frame.is_none() && report.paper.out_of_view > 0);
    let towards = look(Vec3::ZERO);
    let turned = server.step(1.0, Some(&towards), &StepInput::default()).unwrap();
    assert_eq!(turned.paper.updated, report.paper.out_of_view);
    assert!(turned.frame.is_some());
}

#[test]
fn settings_out_of_range_are_refused() {
    let params = PaperParams { edge_spacings: -1.0, ..PaperParams::default() };
    let error =
        start(&slide::scene(), 50.0, &PaperConfig { params, ..PaperConfig::default() }).err().unwrap();
    assert!(error.to_string().contains("edge_spacings is -1, must be positive"), "{error}");
}
