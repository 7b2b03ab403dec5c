//! Any bytes as a camera path: what is read has a camera at every time, and is written to the same path.

use dapple_scene::KeyedPath;

/// Reads `data` as a camera path. Nothing may panic; an error has a message; what is read shows a finite camera at any time, stays
/// where its keys are, repeats after its duration if it says so, and written it reads back to the bit.
pub fn read_camera_path(data: &[u8]) {
    let path = match KeyedPath::parse(data) {
        Ok(path) => path,
        Err(error) => {
            assert!(!error.to_string().is_empty());
            return;
        }
    };
    let json = path.to_json();
    assert_eq!(KeyedPath::parse(json.as_bytes()).as_ref(), Ok(&path), "written it differs: {json}");

    let keys = path.keys();
    let duration_s = path.duration_s();
    assert!((0.0..=1e6).contains(&duration_s));
    for (index, key) in keys.iter().enumerate().take(64) {
        // The last key of a path that repeats is its first moment.
        if !(path.repeats() && index + 1 == keys.len()) {
            assert_eq!(path.camera(key.time_s).eye_world(), key.eye_world, "key {index}");
        }
        for time_s in [key.time_s - 1e-3, key.time_s + 0.3, 2.0 * key.time_s] {
            assert!(path.camera(time_s).world_from_view.is_finite(), "at {time_s}");
        }
    }
    for time_s in [f64::NAN, f64::INFINITY, f64::MIN, f64::MAX, -1.0, 1e300] {
        assert!(path.camera(time_s).world_from_view.is_finite(), "at {time_s}");
    }
}
