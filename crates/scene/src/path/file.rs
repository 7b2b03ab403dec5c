//! Camera paths as JSON files; `docs/camera-path.md` is their specification.

use glam::{Quat, Vec3};
use serde::Deserialize;

use super::keys::{Aim, Blend, CameraKey, KeyedPath, MAX_KEYS, MAX_NAME_BYTES};

/// The version that is read and written.
const VERSION: u32 = 1;
/// Largest file, bytes: a million keys of 134 bytes. Reading takes a few times as much memory.
pub const MAX_PATH_BYTES: usize = 128 << 20;
/// Vertical field of view of a first key that gives none, degrees.
const DEFAULT_FOV_DEGREES: f32 = 60.0;
/// Near plane of a first key that gives none, metres.
const DEFAULT_NEAR_M: f32 = 0.02;

/// Why a camera path cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PathError {
    /// The file is too large.
    #[error("a camera path of {bytes} bytes: {MAX_PATH_BYTES} is the most; thin its keys out")]
    TooLarge {
        /// Its size.
        bytes: usize,
    },
    /// The file is no JSON, or not of the format.
    #[error("no camera path (docs/camera-path.md tells the format): {place}{reason}")]
    Json {
        /// Where, such as `keys[3].eye`; empty or with a colon at its end.
        place: String,
        /// What the parser says.
        reason: String,
    },
    /// A version that is not known here.
    #[error("a camera path of version {found}: this program reads version {VERSION}")]
    Version {
        /// The file's version.
        found: u64,
    },
    /// The name cannot be used.
    #[error("a camera path's name has 1 to {MAX_NAME_BYTES} bytes and no control characters")]
    Name,
    /// There is no key.
    #[error("a camera path needs at least one key")]
    NoKeys,
    /// There are too many keys.
    #[error("a camera path of {keys} keys: {MAX_KEYS} are the most; thin them out")]
    TooManyKeys {
        /// How many there are.
        keys: usize,
    },
    /// A key is wrong.
    #[error("key {index}, {field}: {reason}")]
    Key {
        /// Its index, from 0.
        index: usize,
        /// Which of its fields.
        field: &'static str,
        /// What is wrong, and what to do.
        reason: String,
    },
}

/// Only the version, so that files of later versions are told by it.
#[derive(Deserialize)]
#[serde(expecting = "an object with a version")]
struct AnyVersion {
    version: u64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "an object with version, name and keys")]
struct FileText {
    #[serde(rename = "version")]
    _version: u64,
    name: String,
    #[serde(default, rename = "loop")]
    repeats: bool,
    #[serde(default)]
    interpolation: BlendText,
    keys: Vec<KeyText>,
}

#[derive(Default, Deserialize)]
#[serde(rename_all = "lowercase")]
enum BlendText {
    #[default]
    Smooth,
    Linear,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "an object with time_s, eye and target or rotation")]
struct KeyText {
    time_s: f64,
    eye: [f32; 3],
    target: Option<[f32; 3]>,
    rotation: Option<[f32; 4]>,
    fov_degrees: Option<f32>,
    near_m: Option<f32>,
}

impl KeyedPath {
    /// Reads a file of at most [`MAX_PATH_BYTES`].
    ///
    /// # Errors
    /// [`PathError`] says what is wrong and where.
    pub fn parse(json: &[u8]) -> Result<KeyedPath, PathError> {
        if json.len() > MAX_PATH_BYTES {
            return Err(PathError::TooLarge { bytes: json.len() });
        }
        let AnyVersion { version } = read(json)?;
        if version != u64::from(VERSION) {
            return Err(PathError::Version { found: version });
        }
        let file: FileText = read(json)?;
        let mut lens = (DEFAULT_FOV_DEGREES, DEFAULT_NEAR_M);
        let mut keys = Vec::with_capacity(file.keys.len());
        for (index, text) in file.keys.iter().enumerate() {
            let aim = match (text.target, text.rotation) {
                (Some(target), None) => Aim::Target(Vec3::from(target)),
                (None, Some(rotation)) => Aim::Rotation(Quat::from_array(rotation)),
                _ => {
                    let reason = "give either a target or a rotation".to_owned();
                    return Err(PathError::Key { index, field: "target", reason });
                }
            };
            lens = (text.fov_degrees.unwrap_or(lens.0), text.near_m.unwrap_or(lens.1));
            let eye_world = Vec3::from(text.eye);
            keys.push(CameraKey { time_s: text.time_s, eye_world, aim, fov_degrees: lens.0, near_m: lens.1 });
        }
        let blend = match file.interpolation {
            BlendText::Smooth => Blend::Smooth,
            BlendText::Linear => Blend::Linear,
        };
        KeyedPath::new(file.name, file.repeats, blend, keys)
    }

    /// The path as a file, a line for each key. [`KeyedPath::parse`] reads it to the same bits.
    pub fn to_json(&self) -> String {
        let name = serde_json::Value::from(self.name());
        let interpolation = match self.blend() {
            Blend::Smooth => "smooth",
            Blend::Linear => "linear",
        };
        let mut out = format!(
            "{{\n\"version\": {VERSION},\n\"name\": {name},\n\"loop\": {},\n\"interpolation\": \"{interpolation}\",\n\"keys\": [\n",
            self.repeats()
        );
        let list = |numbers: &[f32]| numbers.iter().map(f32::to_string).collect::<Vec<_>>().join(", ");
        let mut lens = None;
        for (i, key) in self.keys().iter().enumerate() {
            let aim = match key.aim {
                Aim::Target(target) => format!("\"target\": [{}]", list(&target.to_array())),
                Aim::Rotation(rotation) => format!("\"rotation\": [{}]", list(&rotation.to_array())),
            };
            let eye = list(&key.eye_world.to_array());
            out.push_str(&format!("{{\"time_s\": {}, \"eye\": [{eye}], {aim}", key.time_s));
            let own = (key.fov_degrees, key.near_m);
            if lens != Some(own) {
                out.push_str(&format!(", \"fov_degrees\": {}, \"near_m\": {}", own.0, own.1));
                lens = Some(own);
            }
            out.push_str(if i + 1 < self.keys().len() { "},\n" } else { "}\n" });
        }
        out.push_str("]\n}\n");
        out
    }
}

/// Reads JSON; where it does not fit, says at which place.
fn read<'a, T: Deserialize<'a>>(json: &'a [u8]) -> Result<T, PathError> {
    let mut reader = serde_json::Deserializer::from_slice(json);
    let found = serde_path_to_error::deserialize(&mut reader).map_err(|error| {
        let place = error.path().to_string();
        let place = if place == "." { String::new() } else { format!("{place}: ") };
        PathError::Json { place, reason: error.into_inner().to_string() }
    })?;
    reader.end().map_err(|error| PathError::Json { place: String::new(), reason: error.to_string() })?;
    Ok(found)
}
