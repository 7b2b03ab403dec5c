//! A camera path while it is recorded: samples along the time of the scene, thinned to few keys, written to a new file.

use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use dapple_scene::glam::Quat;
use dapple_scene::path::{Aim, Blend, CameraKey, KeyedPath, MAX_KEYS};
use dapple_scene::{PosedCamera, Projection};

/// Least seconds from a sample to the next: every picture of most screens is one, since who walks stops at once.
const SAMPLE_S: f64 = 0.01;
/// Longest step in which a clock may begin again, seconds.
const LATE_S: f64 = 1.0;
/// Samples closer than this are one, seconds.
const SAME_S: f64 = 1e-3;
/// How far a camera may be off the samples that were left out, in diagonals of the scene, at most so many metres.
const TOLERANCE_OF_DIAGONAL: f32 = 1e-4;
const TOLERANCE_M: f32 = 2e-3;
/// How far its direction and its field of view may be off.
const TOLERANCE_DEGREES: f32 = 0.05;
/// Most samples that one way between keys stands for, some seconds: bounds the work.
const MOST_BETWEEN: usize = 300;
/// Files that are tried before the search for a free name ends.
const MOST_FILES: u32 = 100_000;

/// Cameras at their times.
pub(super) struct PathRecorder {
    samples: Vec<CameraKey>,
    /// The last camera, if it came too soon after a sample.
    latest: Option<CameraKey>,
    /// Scene time of the last camera, as the scene has it.
    last_s: Option<f64>,
    /// When the clock of the scene begins again, seconds; 0 for never. The path goes on.
    lap_s: f64,
    tolerance_m: f32,
}

/// Whether recording goes on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Going {
    On,
    /// Time was set back, or the path is as long as paths may be.
    Ended,
}

impl PathRecorder {
    /// For a scene of a diagonal; `lap_s` is when its clock begins again, seconds, 0 for never.
    pub(super) fn new(diagonal_m: f32, lap_s: f64) -> PathRecorder {
        let tolerance_m = (TOLERANCE_OF_DIAGONAL * diagonal_m).min(TOLERANCE_M);
        PathRecorder { samples: Vec::new(), latest: None, last_s: None, lap_s, tolerance_m }
    }

    /// Takes the camera at a time of the scene. While time stands still, the last camera counts.
    pub(super) fn take(&mut self, time_s: f64, camera: &PosedCamera) -> Going {
        let Projection::Perspective { yfov, near } = camera.projection else { return Going::On };
        let own_s = match (self.last_s, self.latest.or(self.samples.last().copied())) {
            (Some(last_s), Some(before)) => {
                // The laps so far, a whole number of them, and perhaps one more.
                let laps_s = before.time_s - last_s;
                let next_s = if time_s < last_s { time_s + self.lap_s } else { time_s };
                // Who sets the time back goes farther than a clock that begins again.
                if next_s < last_s || (time_s < last_s && next_s > last_s + LATE_S) {
                    return Going::Ended;
                }
                laps_s + next_s
            }
            _ => time_s,
        };
        self.last_s = Some(time_s);
        let key = CameraKey {
            time_s: own_s,
            eye_world: camera.eye_world(),
            aim: Aim::Rotation(Quat::from_mat3a(&camera.world_from_view.matrix3).normalize()),
            fov_degrees: yfov.to_degrees(),
            near_m: near,
        };
        match self.samples.last_mut() {
            Some(last) if key.time_s - last.time_s < SAME_S => {
                *last = CameraKey { time_s: last.time_s, ..key };
                self.latest = Some(key);
            }
            Some(last) if key.time_s - last.time_s < SAMPLE_S => self.latest = Some(key),
            _ => {
                self.samples.push(key);
                self.latest = None;
            }
        }
        if self.samples.len() < MAX_KEYS { Going::On } else { Going::Ended }
    }

    /// Seconds recorded so far.
    pub(super) fn seconds(&self) -> f64 {
        let last = self.latest.or(self.samples.last().copied());
        last.zip(self.samples.first()).map_or(0.0, |(last, first)| last.time_s - first.time_s)
    }

    /// The path, with the keys left out that their neighbours tell.
    pub(super) fn finish(mut self, name: &str) -> Result<KeyedPath> {
        let end_s = self.samples.last().map_or(0.0, |last| last.time_s);
        match self.latest {
            Some(latest) if latest.time_s >= end_s + SAME_S && self.samples.len() < MAX_KEYS => {
                self.samples.push(latest);
            }
            _ => {}
        }
        if self.samples.is_empty() {
            bail!("nothing was recorded: a camera without perspective has no place in a camera path");
        }
        let kept = thinned(&self.samples, self.tolerance_m);
        Ok(KeyedPath::new(name.to_owned(), false, Blend::Linear, kept)?)
    }
}

/// The samples without those that lie, within the tolerances, on the straight way between others.
fn thinned(samples: &[CameraKey], tolerance_m: f32) -> Vec<CameraKey> {
    let Some(&first) = samples.first() else { return Vec::new() };
    let mut kept = vec![first];
    let mut from = 0;
    while from + 1 < samples.len() {
        let mut to = from + 1;
        let fits = |to: usize| {
            (from + 1..to).all(|i| is_between(&samples[from], &samples[i], &samples[to], tolerance_m))
        };
        while to + 1 < samples.len() && to + 1 - from <= MOST_BETWEEN && fits(to + 1) {
            to += 1;
        }
        kept.push(samples[to]);
        from = to;
    }
    kept
}

/// Whether a sample is what a linear path from `a` to `b` has at its time.
fn is_between(a: &CameraKey, sample: &CameraKey, b: &CameraKey, tolerance_m: f32) -> bool {
    let part = ((sample.time_s - a.time_s) / (b.time_s - a.time_s)) as f32;
    let between = |a: f32, b: f32| a + (b - a) * part;
    let (Aim::Rotation(turn_a), Aim::Rotation(turn), Aim::Rotation(turn_b)) = (a.aim, sample.aim, b.aim)
    else {
        return false;
    };
    // The sine of half the angle between; for small angles it is exact where the cosine is not.
    let off = turn_a.slerp(turn_b, part).conjugate() * turn;
    a.eye_world.lerp(b.eye_world, part).distance(sample.eye_world) <= tolerance_m
        && 2.0 * off.xyz().length() <= TOLERANCE_DEGREES.to_radians()
        && (between(a.fov_degrees, b.fov_degrees) - sample.fov_degrees).abs() <= TOLERANCE_DEGREES
        && (between(a.near_m, b.near_m) - sample.near_m).abs() <= 1e-3 * sample.near_m
}

/// Writes a path to the first file of `camera-path-1.json`, `camera-path-2.json`, … that does not exist, or of `walk.json`,
/// `walk-2.json`, … if one is asked for. Whatever exists is left alone.
pub(super) fn write_new(path: PathRecorder, wanted: Option<&Path>) -> Result<(PathBuf, KeyedPath)> {
    let name = |number: u32| match wanted {
        None => PathBuf::from(format!("camera-path-{number}.json")),
        Some(file) if number == 1 => file.to_owned(),
        Some(file) => {
            let stem = file.file_stem().unwrap_or_default().to_string_lossy();
            file.with_file_name(format!("{stem}-{number}.json"))
        }
    };
    for number in 1..=MOST_FILES {
        let file = name(number);
        let mut created = match std::fs::OpenOptions::new().write(true).create_new(true).open(&file) {
            Ok(created) => created,
            Err(error) if error.kind() == ErrorKind::AlreadyExists => continue,
            Err(error) => return Err(error).with_context(|| format!("cannot write {}", file.display())),
        };
        let stem = file.file_stem().unwrap_or_default().to_string_lossy();
        let written = path.finish(&stem).and_then(|keys| {
            created.write_all(keys.to_json().as_bytes())?;
            Ok(keys)
        });
        return match written {
            Ok(keys) => Ok((file, keys)),
            Err(error) => {
                // Only what was made here a moment ago goes.
                drop(created);
                std::fs::remove_file(&file).ok();
                Err(error).with_context(|| format!("cannot write {}", file.display()))
            }
        };
    }
    bail!("no free name: {} and {MOST_FILES} others exist", name(1).display())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::find_path;
    use dapple_scene::Scene;
    use dapple_scene::glam::Vec3;

    /// A camera that goes straight for two seconds, stands for two, and turns for two.
    fn camera(time_s: f64) -> PosedCamera {
        let t = time_s as f32;
        let eye = Vec3::new(3.0 * t.min(2.0), 1.7, 0.0);
        let turn = 0.5 * (t - 4.0).max(0.0);
        PosedCamera::look_at(eye, eye + Quat::from_rotation_y(turn) * Vec3::NEG_Z, 1.0)
    }

    fn recorded(until_s: f64, step_s: f64) -> PathRecorder {
        let mut recorder = PathRecorder::new(20.0, 10.0);
        let steps = (until_s / step_s).round() as u32;
        for i in 0..=steps {
            let time_s = step_s * f64::from(i);
            assert_eq!(recorder.take(time_s, &camera(time_s)), Going::On);
        }
        recorder
    }

    fn assert_same(a: &PosedCamera, b: &PosedCamera, at: f64) {
        assert!(a.eye_world().distance(b.eye_world()) < 3e-3, "at {at}: {} {}", a.eye_world(), b.eye_world());
        let turn = |c: &PosedCamera| Quat::from_mat3a(&c.world_from_view.matrix3);
        let off = turn(a).conjugate() * turn(b);
        assert!(2.0 * off.xyz().length() < 2e-3, "at {at}");
    }

    #[test]
    fn few_keys_tell_the_whole_way() {
        for step_s in [1.0 / 144.0, 1.0 / 60.0, 0.031] {
            let path = recorded(6.0, step_s).finish("walk").unwrap();
            assert!((4..12).contains(&path.keys().len()), "{} keys", path.keys().len());
            for i in 0..=(6.0 / step_s) as u32 {
                let time_s = step_s * f64::from(i);
                assert_same(&path.camera(time_s), &camera(time_s), time_s);
            }
        }
    }

    #[test]
    fn a_long_wait_is_cheap_and_bounded() {
        let mut recorder = PathRecorder::new(20.0, 10.0);
        for i in 0..60_000 {
            recorder.take((0.05 * f64::from(i)) % 10.0, &camera(0.0));
        }
        let keys = recorder.finish("wait").unwrap().keys().len();
        assert!((60_000 / MOST_BETWEEN..210).contains(&keys), "{keys}");
    }

    #[test]
    fn while_time_stands_still_the_last_camera_counts() {
        let mut recorder = PathRecorder::new(20.0, 10.0);
        for x in [0.0, 1.0, 5.0] {
            recorder.take(2.0, &camera(x));
        }
        let path = recorder.finish("paused").unwrap();
        assert_eq!(path.keys().len(), 1);
        assert_same(&path.camera(0.0), &camera(5.0), 5.0);
    }

    #[test]
    fn it_goes_on_when_the_scene_begins_again_and_ends_when_time_is_set_back() {
        let mut recorder = PathRecorder::new(20.0, 10.0);
        for i in 0..500 {
            let time_s = 0.05 * f64::from(i);
            assert_eq!(recorder.take(time_s % 10.0, &camera(time_s)), Going::On);
        }
        assert_eq!(recorder.take(2.0, &camera(0.0)), Going::Ended);
        assert!((recorder.seconds() - 24.95).abs() < 1e-6, "{}", recorder.seconds());
        let path = recorder.finish("long").unwrap();
        assert!((path.duration_s() - 24.95).abs() < 1e-6, "{}", path.duration_s());
        assert_same(&path.camera(20.0), &camera(20.0), 20.0);
        // A clock that never begins again.
        let mut endless = PathRecorder::new(20.0, 0.0);
        assert_eq!(endless.take(1.0, &camera(1.0)), Going::On);
        assert_eq!(endless.take(0.9, &camera(0.9)), Going::Ended);
    }

    #[test]
    fn a_camera_without_perspective_is_not_recorded() {
        let mut recorder = PathRecorder::new(20.0, 10.0);
        let projection = Projection::Orthographic { half_height: 1.0, near: 0.1, far: 9.0 };
        recorder.take(0.0, &PosedCamera { projection, ..camera(0.0) });
        let error = recorder.finish("flat").unwrap_err().to_string();
        assert!(error.contains("perspective"), "{error}");
    }

    #[test]
    fn what_is_written_is_found_again_and_nothing_is_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let wanted = folder.path().join("walk.json");
        let scene = Scene::default();
        let mut files = Vec::new();
        for _ in 0..3 {
            let (file, keys) = write_new(recorded(6.0, 1.0 / 60.0), Some(&wanted)).unwrap();
            let path = find_path(&scene, Some(file.to_str().unwrap())).unwrap();
            assert_eq!(path, keys.into());
            for i in 0..=360 {
                let time_s = f64::from(i) / 60.0;
                assert_same(&path.camera(&scene, &scene.pose(time_s)), &camera(time_s), time_s);
            }
            files.push(file.file_name().unwrap().to_string_lossy().into_owned());
        }
        assert_eq!(files, ["walk.json", "walk-2.json", "walk-3.json"]);
        // Nothing recorded, nothing written.
        let empty = PathRecorder::new(20.0, 10.0);
        write_new(empty, Some(&wanted)).unwrap_err();
        assert!(!folder.path().join("walk-4.json").exists());
        let nowhere = folder.path().join("none/walk.json");
        let error = write_new(recorded(1.0, 0.05), Some(&nowhere)).unwrap_err();
        assert!(format!("{error:#}").contains("none"), "{error:#}");
    }
}
