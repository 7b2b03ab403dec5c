//! Camera paths of keys: what files may say, what is between keys, that written files read back to the bit.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

use dapple_scene::glam::{Quat, Vec3};
use dapple_scene::path::{Aim, Blend, CameraKey, CameraSource, MAX_PATH_BYTES, PathError};
use dapple_scene::{CameraPath, KeyedPath, Projection, Scene};
use proptest::prelude::*;

fn key(time_s: f64, x: f32) -> CameraKey {
    let aim = Aim::Target(Vec3::new(x, 1.0, -5.0));
    CameraKey { time_s, eye_world: Vec3::new(x, 1.0, 0.0), aim, fov_degrees: 60.0, near_m: 0.02 }
}

fn path(repeats: bool, blend: Blend, keys: &[CameraKey]) -> KeyedPath {
    KeyedPath::new("made".into(), repeats, blend, keys.to_vec()).unwrap()
}

fn eye_x(path: &KeyedPath, time_s: f64) -> f32 {
    path.camera(time_s).eye_world().x
}

/// The example of the specification.
fn example() -> KeyedPath {
    let page = include_str!("../../../docs/camera-path.md");
    let (_, rest) = page.split_once("```json\n").unwrap();
    KeyedPath::parse(rest.split_once("```").unwrap().0.as_bytes()).unwrap()
}

#[test]
fn the_specifications_example_goes_round_the_table() {
    let path = example();
    assert_eq!((path.name(), path.repeats(), path.blend()), ("round the table", true, Blend::Smooth));
    assert_eq!(path.duration_s(), 10.0);
    for (time_s, eye) in [(0.0, [2.0, 1.7, 0.0]), (2.5, [0.0, 1.7, 2.0]), (17.5, [0.0, 1.7, -2.0])] {
        let camera = path.camera(time_s);
        assert!(camera.eye_world().distance(Vec3::from(eye)) < 1e-5, "at {time_s}");
        let Projection::Perspective { yfov, near } = camera.projection else { panic!("no perspective") };
        assert_eq!((yfov, near), (50_f32.to_radians(), 0.02), "the lens of the first key holds");
    }
    // It looks at the table all the way, keeps its height, and goes on smoothly over its seam.
    let step = |time_s: f64| path.camera(time_s + 0.01).eye_world() - path.camera(time_s).eye_world();
    for i in 0..200 {
        let time_s = 0.05 * f64::from(i);
        let camera = path.camera(time_s);
        let forward = -Vec3::from(camera.world_from_view.matrix3.z_axis);
        let to_table = (Vec3::new(0.0, 0.8, 0.0) - camera.eye_world()).normalize();
        assert!(forward.distance(to_table) < 1e-5 && (camera.eye_world().y - 1.7).abs() < 1e-6);
        assert!(step(time_s).distance(step(time_s + 0.01)) < 0.001, "a jerk at {time_s}");
    }
}

#[test]
fn a_path_of_keys_is_a_camera_path_of_any_scene() {
    let path = CameraPath::from(example());
    assert_eq!((path.name.as_str(), path.duration_s()), ("round the table", 10.0));
    assert!(matches!(path.source, CameraSource::Keys(_)));
    let scene = Scene::default();
    let camera = path.camera(&scene, &scene.pose(5.0));
    assert_eq!(camera.eye_world(), Vec3::new(-2.0, 1.7, 0.0));
    assert!(scene.animations_of_camera(&path).is_empty());
}

#[test]
fn first_and_last_key_hold() {
    let keys = [key(1.0, 0.0), key(2.0, 4.0), key(4.0, 2.0)];
    for blend in [Blend::Smooth, Blend::Linear] {
        let path = path(false, blend, &keys);
        assert_eq!(path.duration_s(), 4.0);
        for (time_s, x) in [(0.0, 0.0), (1.0, 0.0), (2.0, 4.0), (4.0, 2.0), (9.0, 2.0), (f64::NAN, 0.0)] {
            assert_eq!(eye_x(&path, time_s), x, "at {time_s}");
        }
    }
    // One key stands still.
    let still = path(true, Blend::Smooth, &keys[..1]);
    assert_eq!((still.duration_s(), eye_x(&still, 7.0)), (0.0, 0.0));
}

#[test]
fn linear_paths_are_straight_and_loops_begin_anew() {
    let path = path(true, Blend::Linear, &[key(1.0, 0.0), key(2.0, 4.0), key(4.0, 2.0)]);
    assert_eq!(path.duration_s(), 3.0);
    for (time_s, x) in [(1.25, 1.0), (3.0, 3.0), (4.0, 0.0), (4.25, 1.0), (0.0, 3.0)] {
        assert_eq!(eye_x(&path, time_s), x, "at {time_s}");
    }
}

#[test]
fn smooth_paths_do_not_overshoot_or_drift() {
    // Stands still for long, then hurries off: a plain Catmull-Rom spline would sway by metres before.
    let keys = [key(0.0, 1.0), key(10.0, 1.0), key(10.5, 6.0), key(11.0, 6.5), key(12.0, 2.0)];
    let path = path(false, Blend::Smooth, &keys);
    let mut last = 1.0;
    for i in 0..=1100 {
        let (time_s, x) = (0.01 * f64::from(i), eye_x(&path, 0.01 * f64::from(i)));
        if time_s <= 10.0 {
            assert_eq!(x, 1.0, "at {time_s}");
        }
        assert!(x >= last - 1e-5 && x <= 6.5, "{x} after {last} at {time_s}");
        last = x;
    }
    // A line at constant speed stays one.
    let line: Vec<CameraKey> = [0.0, 1.0, 1.5, 4.0].map(|t| key(t, 2.0 * t as f32)).to_vec();
    let path = self::path(false, Blend::Smooth, &line);
    for i in 0..=40 {
        let time_s = 0.1 * f64::from(i);
        assert!((eye_x(&path, time_s) - 2.0 * time_s as f32).abs() < 1e-5);
    }
}

#[test]
fn rotations_are_interpolated_spherically() {
    let at = |time_s, angle: f32| {
        let aim = Aim::Rotation(Quat::from_rotation_y(angle));
        CameraKey { aim, fov_degrees: 40.0 + 10.0 * time_s as f32, ..key(time_s, 0.0) }
    };
    // The second with the other sign, which is the same rotation.
    let mut keys = [at(0.0, 0.2), at(2.0, 1.4)];
    if let Aim::Rotation(rotation) = &mut keys[1].aim {
        *rotation = -*rotation * 1.005;
    }
    let path = path(false, Blend::Smooth, &keys);
    for (time_s, angle) in [(0.0, 0.2), (0.5, 0.5), (1.0, 0.8), (2.0, 1.4)] {
        let camera = path.camera(time_s);
        let found = Quat::from_mat3a(&camera.world_from_view.matrix3);
        assert!(found.angle_between(Quat::from_rotation_y(angle)) < 2e-3, "at {time_s}");
        let Projection::Perspective { yfov, .. } = camera.projection else { panic!("no perspective") };
        assert!((yfov.to_degrees() - (40.0 + 10.0 * time_s as f32)).abs() < 1e-4);
        assert!((camera.world_from_view.matrix3.determinant() - 1.0).abs() < 1e-5);
    }
}

/// A file with some text in the place of its only key, and of what comes before.
fn file(head: &str, keys: &str) -> String {
    format!(r#"{{"version": 1, "name": "x"{head}, "keys": [{keys}]}}"#)
}

#[test]
fn errors_say_what_is_wrong_and_where() {
    let good = r#"{"time_s": 0, "eye": [0, 0, 0], "target": [0, 0, -1]}"#;
    assert!(KeyedPath::parse(file("", good).as_bytes()).is_ok());
    let with = |time: &str, rest: &str| format!(r#"{{"time_s": {time}, {rest}}}"#);
    let eye = r#""eye": [0, 0, 0]"#;
    let turn = |q: &str| format!(r#"{eye}, "rotation": {q}"#);
    for (text, words) in [
        (String::new(), vec!["camera-path.md", "EOF"]),
        ("{".into(), vec!["EOF"]),
        ("[]".into(), vec!["version"]),
        (r#"{"version": 2, "frames": []}"#.into(), vec!["version 2", "version 1"]),
        (r#"{"name": "x", "keys": []}"#.into(), vec!["version"]),
        (file("", ""), vec!["at least one key"]),
        (file("", good) + "x", vec!["trailing"]),
        (file(r#", "speed": 1"#, good), vec!["speed"]),
        (file(r#", "interpolation": "cubic""#, good), vec!["interpolation", "cubic", "linear"]),
        (file(r#", "loop": 1"#, good), vec!["loop"]),
        (file("", r#"{"time_s": 0, "eye": [0, 0], "target": [0, 0, 1]}"#), vec!["keys[0].eye", "length"]),
        (
            file("", &format!("{good}, {}", with("1", r#""eye": [0, "a", 0], "target": [1, 0, 0]"#))),
            vec!["keys[1].eye[1]"],
        ),
        (file("", &with("0", eye)), vec!["key 0", "either a target or a rotation"]),
        (
            file("", &with("0", &format!(r#"{eye}, "target": [0, 0, 1], "rotation": [0, 0, 0, 1]"#))),
            vec!["key 0", "either"],
        ),
        (file("", &with("0", &format!(r#"{eye}, "target": [0, 0, 0]"#))), vec!["key 0, target", "eye"]),
        (file("", &with("0", &turn("[0, 0, 0, 2]"))), vec!["key 0, rotation", "length is 2"]),
        (file("", &with("0", &turn("[0, 0, 0, 1e38]"))), vec!["key 0, rotation", "unit"]),
        (
            file("", &format!("{good}, {}", with("1", &turn("[0, 0, 0, 1]")))),
            vec!["key 1, rotation", "all keys"],
        ),
        (
            file(
                "",
                &format!(
                    "{}, {}",
                    with("0", &turn("[0, 0, 0, 1]")),
                    with("1", &format!(r#"{eye}, "target": [0, 0, 1]"#))
                ),
            ),
            vec!["key 1, target", "all keys"],
        ),
        (file("", &format!("{good}, {good}")), vec!["key 1, time_s", "increase"]),
        (file("", &with("-1", r#""eye": [0, 0, 0], "target": [0, 0, 1]"#)), vec!["key 0, time_s", "-1"]),
        (
            file("", &with("1e7", r#""eye": [0, 0, 0], "target": [0, 0, 1]"#)),
            vec!["key 0, time_s", "10000000"],
        ),
        (file("", &with("0", r#""eye": [0, 1e12, 0], "target": [0, 0, 1]"#)), vec!["key 0, eye", "within"]),
        (
            // Said by the reader of numbers or by ours, as it reads them.
            file("", &with("0", r#""eye": [0, 0, 0], "target": [0, 1e300, 1]"#)),
            vec!["target"],
        ),
        (
            file("", &with("0", r#""eye": [0, 0, 0], "target": [0, 0, 1], "fov_degrees": 190"#)),
            vec!["key 0, fov_degrees", "190", "179"],
        ),
        (
            file("", &with("0", r#""eye": [0, 0, 0], "target": [0, 0, 1], "near_m": 0"#)),
            vec!["key 0, near_m", "metres"],
        ),
        (
            file("", &with("0", r#""eye": [0, 0, 0], "target": [0, 0, 1], "far_m": 9"#)),
            vec!["keys[0]", "far_m"],
        ),
        (r#"{"version": 1, "name": "", "keys": []}"#.into(), vec!["name"]),
        (
            format!(r#"{{"version": 1, "name": "{}", "keys": [{good}]}}"#, "n".repeat(256)),
            vec!["name", "255"],
        ),
        (format!(r#"{{"version": 1, "name": "a\nb", "keys": [{good}]}}"#), vec!["name", "control"]),
    ] {
        let error = KeyedPath::parse(text.as_bytes()).expect_err(&text).to_string();
        for word in words {
            assert!(error.contains(word), "{text}: {error}");
        }
    }
    let huge = vec![b' '; MAX_PATH_BYTES + 1];
    assert_eq!(KeyedPath::parse(&huge), Err(PathError::TooLarge { bytes: huge.len() }));
    let many = vec![key(0.0, 0.0); 1_000_001];
    let error = KeyedPath::new("many".into(), false, Blend::Linear, many).unwrap_err();
    assert_eq!(error, PathError::TooManyKeys { keys: 1_000_001 });
}

/// Any valid path.
fn any_path() -> impl Strategy<Value = KeyedPath> {
    let place = || prop::array::uniform3(-1e4_f32..1e4).prop_map(Vec3::from);
    let key = (
        1e-6_f64..50.0,
        place(),
        place(),
        prop::array::uniform4(-1.0_f32..1.0),
        0.1_f32..179.0,
        1e-6_f32..10.0,
    );
    let flags = (any::<bool>(), any::<bool>(), any::<bool>(), "[a-z \"\\\\é]{1,20}");
    (flags, prop::collection::vec(key, 1..12)).prop_map(|((repeats, smooth, targets, name), keys)| {
        let mut time_s = 0.0;
        let keys = keys.into_iter().map(|(step_s, eye_world, other, turn, fov_degrees, near_m)| {
            time_s += step_s;
            let rotation = Quat::from_array(turn);
            let rotation = if rotation.length() > 0.1 { rotation.normalize() } else { Quat::IDENTITY };
            let aim = if targets { Aim::Target(other) } else { Aim::Rotation(rotation) };
            CameraKey { time_s, eye_world, aim, fov_degrees, near_m }
        });
        let blend = if smooth { Blend::Smooth } else { Blend::Linear };
        KeyedPath::new(name, repeats, blend, keys.collect()).unwrap()
    })
}

proptest! {
    #[test]
    fn what_is_written_is_read(path in any_path()) {
        prop_assert_eq!(KeyedPath::parse(path.to_json().as_bytes()), Ok(path));
    }

    #[test]
    fn between_two_keys_the_eye_is_in_their_box(path in any_path(), part in 0.0_f64..1.0) {
        let keys = path.keys();
        for pair in keys.windows(2) {
            let time_s = pair[0].time_s + part * (pair[1].time_s - pair[0].time_s);
            let camera = path.camera(time_s);
            prop_assert!(camera.world_from_view.is_finite());
            let (a, b) = (pair[0].eye_world, pair[1].eye_world);
            let slack = 1e-5 * (a.abs().max(b.abs())).max_element() + 1e-5;
            let eye = camera.eye_world();
            prop_assert!(eye.cmpge(a.min(b) - slack).all() && eye.cmple(a.max(b) + slack).all());
        }
    }
}
