//! A box slides over a floor: what the server publishes, whatever way time takes.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

#[path = "common/slide.rs"]
mod slide;

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use dapple_scene::Scene;
use dapple_server::{Progress, Server, ServerConfig, ServerError};
use dapple_stream::{FrameKind, Limits, Subscriber};
use dapple_trace::psao::update::StepInput;
use slide::scene;

fn config(threshold: u8) -> ServerConfig {
    let mut config = ServerConfig::default();
    config.generate.points_per_m2 = 200.0;
    config.publish.precision.tolerance = threshold;
    config
}

fn start(config: &ServerConfig) -> Server {
    Server::new(scene(), config, &|_| ()).unwrap()
}

#[test]
fn what_is_published_depends_on_the_time_and_not_on_the_way_there() {
    let at = |times_s: &[f64]| {
        let mut server = start(&config(0));
        for &time_s in times_s {
            server.step(time_s).unwrap();
        }
        server.store().clone()
    };
    let direct = at(&[1.3]);
    assert!(direct == at(&[0.1, 0.2, 0.7, 1.3]));
    assert!(direct == at(&[1.9, 0.0, 1.3, 1.3]));
    assert!(direct != at(&[0.4]));
    assert!(at(&[]) == at(&[1.0, 0.0]), "back at the start");
}

#[test]
fn only_what_the_box_comes_near_is_traced_and_sent() {
    let mut server = start(&config(0));
    let points = server.store().layout().len();
    let floor = server.store().layout().set_of_instance(0).unwrap().len();
    assert!((1400..1700).contains(&floor), "half of 200 points a square metre: {floor}");
    let before = server.store().clone();
    let pose = server.scene().pose(0.0);
    let positions = server.positions_world(&pose);
    assert_eq!(positions.len(), points);
    let report = server.step(0.5).unwrap();
    assert!(
        report.changed > 20 && report.changed <= report.traced && (report.traced as usize) < points * 3 / 4
    );
    assert_eq!(report.rays, u64::from(report.traced) * 64);
    let frame = report.frame.unwrap();
    assert_eq!(frame.kind, FrameKind::Delta);
    let mut changed = 0;
    for (i, (a, b)) in before.visibility().iter().zip(server.store().visibility()).enumerate() {
        if a == b {
            continue;
        }
        changed += 1;
        // The box swept from −1.25 to −0.25, and light is blocked within 0.6 m of it.
        let p = positions[i].unwrap();
        assert!((-1.9..0.4).contains(&p.x) && p.z.abs() < 0.9, "point {i} at {p}");
    }
    assert_eq!(changed, report.changed);
}

#[test]
fn a_slow_change_is_sent_once_it_adds_up() {
    // Each step alone stays below the threshold for almost all points; what was sent last is what counts.
    let (mut slow, mut exact) = (start(&config(10)), start(&config(0)));
    for step in 1..=100 {
        slow.step(f64::from(step) * 0.01).unwrap();
        let pairs = slow.store().visibility().iter().zip(slow.traced().visibility());
        assert!(pairs.clone().all(|(a, b)| a.abs_diff(*b) <= 10), "at step {step}");
    }
    exact.step(1.0).unwrap();
    let pairs = slow.store().visibility().iter().zip(exact.store().visibility());
    assert!(pairs.clone().all(|(a, b)| a.abs_diff(*b) <= 10), "no point is further off than the threshold");
    assert!(pairs.clone().any(|(a, b)| a != b), "and some are off a little");
}

#[test]
fn a_server_short_of_rays_falls_behind_and_catches_up() {
    let (mut short, mut free) = (start(&config(0)), start(&config(0)));
    let input = StepInput { ray_budget: Some(5000), ..StepInput::default() };
    let (mut behind, mut rays) = (0, 0);
    for step in 1..=10 {
        let time_s = f64::from(step) * 0.1;
        let report = short.step_with(time_s, &input).unwrap();
        behind = behind.max(report.counts.backlog);
        rays += report.rays;
        assert!(report.rays <= 5000);
        assert_eq!((report.traced, report.rays), (report.counts.traced(), report.counts.rays()));
        free.step(time_s).unwrap();
    }
    assert!(behind > 0 && rays > 40_000, "{behind} points behind, {rays} rays");
    assert!(short.store() != free.store());
    let mut subscriber = Subscriber::new(Some(short.scene().hash().0), Limits::default());
    subscriber.receive(&short.join().unwrap().unwrap().bytes).unwrap();
    for _ in 0..100 {
        let report = short.step_with(1.0, &input).unwrap();
        if let Some(frame) = report.frame {
            subscriber.receive(&frame.bytes).unwrap();
        } else if report.counts.backlog == 0 {
            assert!(short.store() == free.store());
            assert!(subscriber.store() == Some(free.store()));
            return;
        }
    }
    panic!("it never caught up");
}

#[test]
fn a_server_short_of_bits_sends_no_more_in_any_second_and_catches_up() {
    let mut config = config(4);
    config.bits_per_s = Some(4_000);
    let (mut short, mut free) = (start(&config), start(&ServerConfig { bits_per_s: None, ..config }));
    let mut subscriber = Subscriber::new(Some(short.scene().hash().0), Limits::default());
    subscriber.receive(&short.join().unwrap().unwrap().bytes).unwrap();
    let (mut sent, mut wanted, mut most_held_back) = (Vec::new(), 0, 0);
    let mut step = |short: &mut Server, tick: u32, time_s: f64| {
        let report = short.step_at(time_s, f64::from(tick) / 20.0, &StepInput::default()).unwrap();
        let bytes = report.frame.as_ref().map_or(0, |frame| frame.bytes.len());
        if let Some(frame) = &report.frame {
            assert_eq!(frame.kind, FrameKind::Delta);
            subscriber.receive(&frame.bytes).unwrap();
        }
        assert!(subscriber.store() == Some(short.store()));
        sent.push(bytes);
        report
    };
    for tick in 1..=40 {
        let time_s = f64::from(tick) / 20.0;
        most_held_back = most_held_back.max(step(&mut short, tick, time_s).held_back);
        wanted += free.step(time_s).unwrap().frame.map_or(0, |frame| frame.bytes.len());
    }
    assert!(most_held_back > 20, "{most_held_back}");
    // The scene stands still, the clock does not.
    let mut last = step(&mut short, 41, 2.0);
    for tick in 42..600 {
        last = step(&mut short, tick, 2.0);
    }
    assert!(last.frame.is_none() && last.held_back == 0, "{} held back", last.held_back);
    let pairs = short.store().visibility().iter().zip(short.traced().visibility());
    assert!(pairs.clone().all(|(a, b)| a.abs_diff(*b) <= 4));
    let seconds: Vec<usize> = sent.windows(20).map(|second| second.iter().sum()).collect();
    assert!(seconds.iter().all(|bytes| *bytes <= 500), "{seconds:?}");
    let moving: usize = sent[..40].iter().sum();
    assert!(2 * moving < wanted && moving > 500, "{moving} of {wanted} bytes");
}

#[test]
fn subscribers_are_brought_up_to_date_by_one_snapshot() {
    let mut server = start(&config(4));
    let first = server.join().unwrap().unwrap();
    assert_eq!((first.kind, first.epoch), (FrameKind::Snapshot, 0));
    assert_eq!(server.join().unwrap().unwrap(), first, "made once");
    server.step(0.5).unwrap();
    server.step(1.0).unwrap();
    let now = server.join().unwrap().unwrap();
    assert_eq!((now.kind, now.epoch), (FrameKind::Snapshot, 2));
    let mut subscriber = Subscriber::new(Some(server.scene().hash().0), Limits::default());
    subscriber.receive(&now.bytes).unwrap();
    assert!(subscriber.store() == Some(server.store()));
}

#[test]
fn progress_reaches_its_end() {
    let [laid, traced, all, cut] = [const { AtomicUsize::new(0) }; 4];
    let server = Server::new(scene(), &config(4), &|progress| match progress {
        Progress::Laying(done, of) => {
            assert_eq!(of, 2);
            laid.fetch_max(done, Ordering::Relaxed);
        }
        Progress::Tracing(done, of) => {
            all.store(of, Ordering::Relaxed);
            traced.fetch_max(done, Ordering::Relaxed);
        }
        Progress::Cutting(done, of) => {
            assert!(of > 0);
            cut.fetch_max(done, Ordering::Relaxed);
        }
    })
    .unwrap();
    assert_eq!(laid.into_inner(), 2);
    assert!(cut.into_inner() > 0);
    assert_eq!(all.into_inner(), server.store().layout().len());
    assert_eq!(traced.into_inner(), server.store().layout().len());
    assert!((20.0..200.0).contains(&server.bytes_per_point()), "{}", server.bytes_per_point());
}

#[test]
fn settings_out_of_range_are_refused_by_name() {
    let refused = |change: fn(&mut ServerConfig)| {
        let mut config = config(4);
        change(&mut config);
        match Server::new(scene(), &config, &|_| ()) {
            Err(error @ (ServerError::Generate(_) | ServerError::Update(_))) => error.to_string(),
            Err(error) => panic!("refused for another reason: {error}"),
            Ok(_) => panic!("it was accepted"),
        }
    };
    assert!(refused(|c| c.generate.points_per_m2 = 0.0).contains("points per m² is 0"));
    assert!(refused(|c| c.generate.points_per_m2 = f32::NAN).contains("points per m² is NaN"));
    assert!(refused(|c| c.generate.points_per_m2 = 1e9).contains("lower the density"));
    assert!(refused(|c| c.update.rays = 0).contains("rays a point is 0"));
    assert!(refused(|c| c.update.rays = 257).contains("257"));
    assert!(refused(|c| c.update.rays_still = 32).contains("rays of a point at rest is 32"));
    assert!(refused(|c| c.update.radius_m = -1.0).contains("radius is -1 m"));
}

#[test]
fn a_scene_without_surfaces_is_served_in_silence() {
    let mut server = Server::new(Arc::new(Scene::default()), &config(4), &|_| ()).unwrap();
    let snapshot = server.join().unwrap().unwrap();
    let mut subscriber = Subscriber::new(None, Limits::default());
    subscriber.receive(&snapshot.bytes).unwrap();
    assert!(subscriber.store().unwrap().layout().is_empty());
    assert!(server.step(1.0).unwrap().frame.is_none());
}
