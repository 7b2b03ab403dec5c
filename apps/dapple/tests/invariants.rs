//! The laws of the whole loop: same bytes, one store on both ends, silence when nothing moves.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod common;

use std::sync::Arc;

use common::{atrium, config, covered, fingerprint, join, made, server, small, truth, with_threads};
use dapple_client::{Client, Reconstruction};
use dapple_render::shade::Ambient;
use dapple_scene::glam::Vec3;
use dapple_scene::{NoFiles, Scene};
use dapple_stream::{Applied, FrameKind, Limits};
use dapple_trace::Tracer;
use dapple_trace::psao::generate::generate_points;
use dapple_trace::psao::update::{StepInput, UpdateParams, Updater};

/// Times at which boulders roll and lights sweep, not evenly spaced.
const TIMES_S: [f64; 6] = [0.2, 0.4, 0.45, 1.0, 3.0, 2.5];

/// Every frame of a run, and the last picture.
fn record(scene: &Arc<Scene>) -> (Vec<Arc<[u8]>>, Vec<Vec3>) {
    let mut server = server(scene, &config(24.0, 32));
    let mut client = join(&mut server);
    let mut frames = vec![server.join().unwrap().unwrap().bytes];
    for time_s in TIMES_S {
        if let Some(frame) = server.step(time_s).unwrap().frame {
            client.receive(&frame.bytes).unwrap();
            frames.push(frame.bytes);
        }
    }
    let last_s = TIMES_S[TIMES_S.len() - 1];
    let camera = scene.camera_paths()[0].camera(scene, &scene.pose(last_s));
    let drawn = client.draw(&camera, last_s, &small(96, 54)).unwrap();
    let visibility = client.visibility(&drawn, &Reconstruction::default());
    (frames, drawn.compose(Some(&visibility)).unwrap().pixels)
}

#[test]
fn bytes_and_pictures_depend_on_neither_threads_nor_repetition() {
    let scene = atrium(0.05);
    let (frames, picture) = with_threads(1, || record(&scene));
    assert_eq!(frames.len(), 1 + TIMES_S.len(), "something changes at every time");
    for (threads, what) in [(1, "the second time"), (2, "with two threads"), (3, "with three threads")] {
        // The scene too is made anew.
        let again = with_threads(threads, || record(&atrium(0.05)));
        assert!(again.0 == frames, "{what}: other bytes");
        assert!(again.1 == picture, "{what}: another picture");
    }
}

#[test]
fn who_follows_and_who_joins_late_hold_the_servers_store() {
    let scene = atrium(0.05);
    let mut server = server(&scene, &config(24.0, 32));
    let mut clients = vec![join(&mut server)];
    let mut changed = 0;
    for (tick, time_s) in TIMES_S.into_iter().enumerate() {
        let report = server.step(time_s).unwrap();
        changed += report.changed;
        let frame = report.frame.unwrap();
        assert_eq!(frame.kind, FrameKind::Delta);
        for client in &mut clients {
            let applied = client.receive(&frame.bytes).unwrap();
            assert!(matches!(applied, Applied::Changes(c) if c.len() == report.changed as usize));
        }
        if tick % 2 == 1 {
            clients.push(join(&mut server));
        }
        for client in &clients {
            assert!(client.store() == Some(server.store()), "at {time_s} s");
            assert_eq!(client.epoch(), Some(frame.epoch));
        }
    }
    assert!(clients.len() == 4 && changed > 0);
    let held = fingerprint(server.store());
    for client in &clients {
        assert!(fingerprint(client.store().unwrap()) == held, "the stores differ in some bit");
    }
}

#[test]
fn a_lost_update_is_noticed_and_a_snapshot_mends_it() {
    let scene = atrium(0.05);
    let mut server = server(&scene, &config(16.0, 16));
    let mut client = join(&mut server);
    let before = client.store().unwrap().clone();
    let lost = server.step(1.0).unwrap().frame.unwrap();
    let next = server.step(2.0).unwrap().frame.unwrap();
    let error = client.receive(&next.bytes).unwrap_err();
    assert!(error.snapshot_helps(), "{error}");
    assert!(client.store() == Some(&before), "an error changes nothing");
    client.receive(&server.join().unwrap().unwrap().bytes).unwrap();
    assert!(client.store() == Some(server.store()));
    assert!(matches!(client.receive(&lost.bytes), Ok(Applied::Ignored(_))));
}

#[test]
fn a_still_scene_sends_nothing_and_its_picture_stands_still() {
    let mut still = Scene::clone(&atrium(0.05));
    let cameras_moving = still.camera_paths();
    still.active_animation = None;
    // One that could move but whose time stands, and one without animation whose time runs.
    for (scene, times_s) in [(atrium(0.05), [1.25; 4]), (Arc::new(still), [0.5, 1.0, 7.0, -3.0])] {
        let mut server = server(&scene, &config(16.0, 16));
        let mut client = join(&mut server);
        if let Some(frame) = server.step(times_s[0]).unwrap().frame {
            client.receive(&frame.bytes).unwrap();
        }
        let camera = cameras_moving[0].camera(&scene, &scene.pose(times_s[0]));
        let mut first = None;
        for time_s in times_s {
            let report = server.step(time_s).unwrap();
            assert!(report.frame.is_none(), "a frame at {time_s}");
            assert_eq!((report.changed, report.traced, report.rays), (0, 0, 0));
            let drawn = client.draw(&camera, time_s, &small(96, 54)).unwrap();
            let visibility = client.visibility(&drawn, &Reconstruction::default());
            assert!(visibility.iter().any(|&v| v < 0.9), "the picture shows occlusion");
            let picture = drawn.compose(Some(&visibility)).unwrap().pixels;
            let bits: Vec<[u32; 3]> = picture.iter().map(|p| p.to_array().map(f32::to_bits)).collect();
            assert!(*first.get_or_insert(bits.clone()) == bits, "the picture changed at {time_s}");
        }
    }
}

#[test]
fn updating_selectively_equals_tracing_every_point() {
    let scene = atrium(0.05);
    let pose = scene.pose(0.0);
    let mut tracer = Tracer::new(&scene, &pose);
    let points = generate_points(&scene, &pose, &tracer, &config(16.0, 16).generate, &|_| ()).unwrap();
    let params = UpdateParams { rays: 16, ..UpdateParams::default() };
    let mut selective = Updater::new(&scene, &pose, &tracer, points, params, &|_| ()).unwrap();
    let mut thorough = selective.clone();
    let (mut changes, mut traced, mut all) = (0, 0, 0);
    // A second at 15 Hz, and leaps after which nothing is where it was.
    let times_s = (1..=15).map(|tick| f64::from(tick) / 15.0).chain([5.0, 11.0, 2.5]);
    for time_s in times_s {
        let pose = scene.pose(time_s);
        tracer.update(&scene, &pose);
        let some = selective.step(&scene, &pose, &mut tracer, &StepInput::default());
        let every = thorough.step_all(&scene, &pose, &tracer);
        assert_eq!(some.changes, every.changes, "at {time_s} s");
        assert!(selective.store() == thorough.store());
        changes += some.changes.len();
        traced += some.counts.traced();
        all += every.counts.traced();
    }
    assert!(changes > 0 && traced < all / 4, "{changes} changes, {traced} of {all} points traced");
}

/// Metal without color reflects nothing, so all it shows is emitted.
const EMISSIVE: &str = r#"{"emissiveFactor":[0.3,0.6,0.9],"pbrMetallicRoughness":{"baseColorFactor":[0,0,0,1],"metallicFactor":0}}"#;
const UNLIT: &str =
    r#"{"extensions":{"KHR_materials_unlit":{}},"pbrMetallicRoughness":{"baseColorFactor":[0.8,0.5,0.2,1]}}"#;
const PLAIN: &str = r#"{"pbrMetallicRoughness":{"metallicFactor":0}}"#;

#[test]
fn visibility_touches_neither_emission_nor_unlit_color() {
    for (shining, specular) in [(EMISSIVE, false), (UNLIT, true)] {
        let glb = made::two_squares_under_a_lid(shining, PLAIN);
        let scene = Arc::new(dapple_scene::load("lid.glb", &glb, &NoFiles).unwrap());
        let mut server = server(&scene, &config(4000.0, 64));
        let client = join(&mut server);
        let camera = scene.camera_paths()[0].camera(&scene, &scene.pose(0.0));
        let mut params = small(96, 72);
        params.shade.specular = specular;
        let drawn = client.draw(&camera, 0.0, &params).unwrap();
        let visibility = client.visibility(&drawn, &Reconstruction::default());
        let open = drawn.compose(None).unwrap().pixels;
        let occluded = drawn.compose(Some(&visibility)).unwrap().pixels;
        let (mut shadowed, mut darker) = (0, 0);
        for (i, sample) in drawn.gbuffer.samples().iter().enumerate().filter(|s| s.1.is_covered()) {
            if sample.instance == 0 {
                assert_eq!(open[i], occluded[i], "visibility {} reached light of its own", visibility[i]);
                shadowed += u32::from(visibility[i] < 0.8);
            } else if visibility[i] < 0.8 {
                darker += u32::from(occluded[i].cmplt(open[i]).all());
            }
        }
        assert!(shadowed > 50 && darker > 50, "{shadowed} samples of the left square, {darker} of the right");
    }
}

#[test]
fn visibility_does_not_touch_direct_light() {
    let scene = atrium(0.05);
    let camera = scene.camera_paths()[0].camera(&scene, &scene.pose(1.0));
    let mut params = small(96, 54);
    params.shade.ambient = Ambient::Constant(Vec3::ZERO);
    let client = Client::new(scene.clone(), Limits::default());
    let drawn = client.draw(&camera, 1.0, &params).unwrap();
    let visibility = truth(&scene, &drawn, 16, 0.6);
    let occluded = covered(&drawn).iter().zip(&visibility).filter(|(c, v)| **c && **v < 0.5).count();
    assert!(occluded > 100, "{occluded}");
    let open = drawn.compose(None).unwrap();
    assert!(open.pixels.iter().any(|p| p.max_element() > 0.2), "the lamps shine");
    assert!(open == drawn.compose(Some(&visibility)).unwrap());
}
