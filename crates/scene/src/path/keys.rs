//! Camera paths made of keys: recorded, written by hand, read from files.

use glam::{Quat, Vec3};

use super::file::PathError;
use crate::{PosedCamera, Projection};

/// Most keys of a path.
pub const MAX_KEYS: usize = 1_000_000;
/// Longest name of a path, bytes.
pub const MAX_NAME_BYTES: usize = 255;
/// Latest time of a key, seconds.
const MAX_TIME_S: f64 = 1e6;
/// Shortest time from a key to the next, seconds.
const MIN_STEP_S: f64 = 1e-6;
/// Farthest coordinate, metres.
const MAX_COORDINATE_M: f32 = 1e9;
/// Smallest and largest vertical field of view, degrees.
const FOV_DEGREES: [f32; 2] = [0.1, 179.0];
/// Smallest and largest distance of the near plane, metres.
const NEAR_M: [f32; 2] = [1e-6, 1e6];

/// Where a camera is at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraKey {
    /// Scene time, seconds, 0 … 10⁶, to the nanosecond; at least a microsecond later than the key before.
    pub time_s: f64,
    /// Where the camera is, metres.
    pub eye_world: Vec3,
    /// Where it looks.
    pub aim: Aim,
    /// Vertical field of view, degrees, 0.1 … 179.
    pub fov_degrees: f32,
    /// Distance of the near plane, metres, 10⁻⁶ … 10⁶.
    pub near_m: f32,
}

/// Where a key's camera looks. All keys of a path have the one or the other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Aim {
    /// At a place other than the eye, metres; upright, as [`PosedCamera::look_at`] has it.
    Target(Vec3),
    /// World from view space: the camera looks along −Z, Y up. A unit quaternion.
    Rotation(Quat),
}

/// What is between keys.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Blend {
    /// Eyes and targets move along curves without a jerk that overshoot no key: each coordinate by Steffen's monotonic
    /// cubic, "A simple method for monotonic interpolation in one dimension", Astronomy & Astrophysics 239 (1990), eq. 2 to 11.
    /// At both ends the tangent is the way to the neighbour, unless the path repeats and ends where it begins.
    #[default]
    Smooth,
    /// They move straight and evenly.
    Linear,
}

/// Checked keys with a name. Rotations are interpolated spherically, the short way; field of view and near plane
/// linearly. Before the first key the first holds; after the last the last, or the path begins anew.
#[derive(Clone, Debug, PartialEq)]
pub struct KeyedPath {
    name: String,
    repeats: bool,
    blend: Blend,
    keys: Vec<CameraKey>,
}

impl KeyedPath {
    /// A path of at least one and at most [`MAX_KEYS`] keys. Rotations are made unit quaternions, times are rounded to
    /// nanoseconds, so that they have a short decimal form.
    ///
    /// # Errors
    /// [`PathError`] if a number is out of its range (see [`CameraKey`]), if times do not increase, if some keys have targets and
    /// others rotations, or if the name is empty, longer than [`MAX_NAME_BYTES`] or has control characters.
    pub fn new(
        name: String,
        repeats: bool,
        blend: Blend,
        mut keys: Vec<CameraKey>,
    ) -> Result<KeyedPath, PathError> {
        if name.is_empty() || name.len() > MAX_NAME_BYTES || name.chars().any(char::is_control) {
            return Err(PathError::Name);
        }
        if keys.is_empty() {
            return Err(PathError::NoKeys);
        }
        if keys.len() > MAX_KEYS {
            return Err(PathError::TooManyKeys { keys: keys.len() });
        }
        let has_targets = matches!(keys[0].aim, Aim::Target(_));
        let mut earliest = 0.0;
        for (index, key) in keys.iter_mut().enumerate() {
            key.time_s = (key.time_s * 1e9).round() / 1e9;
            check(key, earliest, has_targets).map_err(|(field, reason)| PathError::Key {
                index,
                field,
                reason,
            })?;
            match &mut key.aim {
                // What is a unit quaternion already keeps its bits.
                Aim::Rotation(rotation) if (rotation.length() - 1.0).abs() > 1e-6 => {
                    *rotation = rotation.normalize();
                }
                _ => {}
            }
            earliest = key.time_s + MIN_STEP_S;
        }
        Ok(KeyedPath { name, repeats, blend, keys })
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Whether it begins anew after its last key.
    pub fn repeats(&self) -> bool {
        self.repeats
    }

    /// What is between its keys.
    pub fn blend(&self) -> Blend {
        self.blend
    }

    /// Its keys, in order of time; at least one.
    pub fn keys(&self) -> &[CameraKey] {
        &self.keys
    }

    /// Seconds after which it repeats or ends; 0 if it has one key.
    pub fn duration_s(&self) -> f64 {
        match self.keys[..] {
            [] | [_] => 0.0,
            [first, .., last] if self.repeats => last.time_s - first.time_s,
            [.., last] => last.time_s,
        }
    }

    /// The camera at a time, seconds.
    pub fn camera(&self, time_s: f64) -> PosedCamera {
        let time_s = self.own_time_s(time_s);
        let after = self.keys.partition_point(|key| key.time_s <= time_s);
        let Some(to) = self.keys.get(after) else { return posed(&self.keys[self.keys.len() - 1]) };
        let Some(from) = after.checked_sub(1).map(|i| &self.keys[i]) else { return posed(to) };
        let part = ((time_s - from.time_s) / (to.time_s - from.time_s)) as f32;
        let between = |a: f32, b: f32| a + (b - a) * part;
        let aim = match (from.aim, to.aim) {
            (Aim::Rotation(a), Aim::Rotation(b)) => Aim::Rotation(a.slerp(b, part).normalize()),
            _ => Aim::Target(self.between(after - 1, part, |key| match key.aim {
                Aim::Target(target) => target,
                Aim::Rotation(_) => key.eye_world,
            })),
        };
        posed(&CameraKey {
            time_s,
            eye_world: self.between(after - 1, part, |key| key.eye_world),
            aim,
            fov_degrees: between(from.fov_degrees, to.fov_degrees),
            near_m: between(from.near_m, to.near_m),
        })
    }

    /// The time of the path at a time of the scene.
    fn own_time_s(&self, time_s: f64) -> f64 {
        let first_s = self.keys[0].time_s;
        let time_s = if time_s.is_finite() { time_s } else { first_s };
        let period_s = self.duration_s();
        match self.repeats && period_s > 0.0 {
            true => first_s + (time_s - first_s).rem_euclid(period_s),
            false => time_s,
        }
    }

    /// A place of each key, interpolated from key `i` (`part` 0) to the next (`part` 1).
    fn between(&self, i: usize, part: f32, place: impl Fn(&CameraKey) -> Vec3) -> Vec3 {
        let (from, to) = (place(&self.keys[i]), place(&self.keys[i + 1]));
        if self.blend == Blend::Linear {
            return from.lerp(to, part);
        }
        // Seconds and metres a second from a key to the next.
        let way = |i: usize| {
            let (a, b) = (&self.keys[i], &self.keys[i + 1]);
            let seconds = (b.time_s - a.time_s) as f32;
            (seconds, (place(b) - place(a)) / seconds)
        };
        let last = self.keys.len() - 1;
        let closes = self.repeats && place(&self.keys[0]) == place(&self.keys[last]);
        let own = way(i);
        let before = i.checked_sub(1).or(closes.then(|| last - 1)).map_or(own, way);
        let after = if i + 2 <= last {
            way(i + 1)
        } else if closes {
            way(0)
        } else {
            own
        };
        let (start, end) = (tangent(before, own), tangent(own, after));
        let (t, t2, t3) = (part, part * part, part * part * part);
        from * (2.0 * t3 - 3.0 * t2 + 1.0)
            + start * (own.0 * (t3 - 2.0 * t2 + t))
            + to * (3.0 * t2 - 2.0 * t3)
            + end * (own.0 * (t3 - t2))
    }
}

/// The tangent at a key by seconds and slopes of the ways before and after it (Steffen 1990, eq. 11).
fn tangent((seconds0, slope0): (f32, Vec3), (seconds1, slope1): (f32, Vec3)) -> Vec3 {
    let of = |s0: f32, s1: f32| {
        if (s0 > 0.0) != (s1 > 0.0) || s0 == 0.0 || s1 == 0.0 {
            return 0.0;
        }
        let parabola = (s0 * seconds1 + s1 * seconds0) / (seconds0 + seconds1);
        (2.0 * s0.abs().min(s1.abs()).min(0.5 * parabola.abs())).copysign(s0)
    };
    Vec3::new(of(slope0.x, slope1.x), of(slope0.y, slope1.y), of(slope0.z, slope1.z))
}

fn posed(key: &CameraKey) -> PosedCamera {
    let yfov = key.fov_degrees.to_radians();
    let mut camera = match key.aim {
        Aim::Target(target) => PosedCamera::look_at(key.eye_world, target, yfov),
        Aim::Rotation(rotation) => PosedCamera {
            world_from_view: glam::Affine3A::from_rotation_translation(rotation, key.eye_world),
            projection: Projection::Perspective { yfov, near: key.near_m },
        },
    };
    camera.projection = Projection::Perspective { yfov, near: key.near_m };
    camera
}

/// What is wrong with a key: its field, and why.
fn check(key: &CameraKey, earliest_s: f64, has_targets: bool) -> Result<(), (&'static str, String)> {
    let place = |field, p: Vec3| match p.abs().max_element() <= MAX_COORDINATE_M && p.is_finite() {
        true => Ok(()),
        false => Err((field, format!("{p} is no place: give three numbers within ±{MAX_COORDINATE_M:e}"))),
    };
    if !(0.0..=MAX_TIME_S).contains(&key.time_s) {
        return Err(("time_s", format!("{} is out of range: give 0 to {MAX_TIME_S:e} seconds", key.time_s)));
    }
    if key.time_s < earliest_s {
        let reason = format!(
            "{} does not come after the key before: times must increase, by a microsecond at least",
            key.time_s
        );
        return Err(("time_s", reason));
    }
    place("eye", key.eye_world)?;
    match key.aim {
        Aim::Target(target) if has_targets => {
            place("target", target)?;
            if target == key.eye_world {
                return Err(("target", "it is where the eye is: look at another place".into()));
            }
        }
        Aim::Rotation(rotation) if !has_targets => {
            let length = rotation.length();
            if !(0.99..=1.01).contains(&length) {
                return Err((
                    "rotation",
                    format!("its length is {length}: give a unit quaternion x, y, z, w"),
                ));
            }
        }
        Aim::Target(_) => {
            return Err(("target", "keys before have rotations: give all keys the one or the other".into()));
        }
        Aim::Rotation(_) => {
            return Err(("rotation", "keys before have targets: give all keys the one or the other".into()));
        }
    }
    let range = |field, value: f32, [least, most]: [f32; 2], unit: &str| match (least..=most).contains(&value)
    {
        true => Ok(()),
        false => Err((field, format!("{value} is out of range: give {least} to {most} {unit}"))),
    };
    range("fov_degrees", key.fov_degrees, FOV_DEGREES, "degrees")?;
    range("near_m", key.near_m, NEAR_M, "metres")
}
