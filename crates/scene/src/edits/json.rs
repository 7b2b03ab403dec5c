//! Edits as JSON: numbers that come back to the bit, lists instead of maps.

use serde::{Deserialize, Serialize, Serializer};

use super::{Edits, LightSetting, Placement};

/// A number that every reader makes `x` again, whether it reads to `f32` or to `f64` first, and is off by a digit in that: as short
/// as `x` is written, unless that is not sure.
fn exactly(x: f32) -> f64 {
    let short = x.to_string().parse().unwrap_or(f64::NAN);
    let is_sure = [short, short.next_up(), short.next_down()].iter().all(|y| *y as f32 == x);
    if is_sure { short } else { f64::from(x) }
}

pub(super) fn number<S: Serializer>(x: &f32, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_f64(exactly(*x))
}

pub(super) fn numbers<S: Serializer>(
    xs: &(impl AsRef<[f32]> + ?Sized),
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(xs.as_ref().iter().map(|x| exactly(*x)))
}

/// [`Edits`] as they are written: keys that are numbers do not survive every way that JSON is read.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct EditsForm {
    placed: Vec<Placed>,
    removed: Vec<u32>,
    lights: Vec<Lit>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Placed {
    node: u32,
    placement: Placement,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Lit {
    light: u32,
    #[serde(serialize_with = "numbers")]
    color: [f32; 3],
    #[serde(serialize_with = "number")]
    intensity: f32,
}

impl From<Edits> for EditsForm {
    fn from(edits: Edits) -> EditsForm {
        let placed = edits.placed.into_iter().map(|(node, placement)| Placed { node, placement });
        let lights = edits.lights.into_iter();
        EditsForm {
            placed: placed.collect(),
            removed: edits.removed.into_iter().collect(),
            lights: lights
                .map(|(light, LightSetting { color, intensity })| Lit { light, color, intensity })
                .collect(),
        }
    }
}

impl From<EditsForm> for Edits {
    fn from(form: EditsForm) -> Edits {
        let setting = |lit: Lit| (lit.light, LightSetting { color: lit.color, intensity: lit.intensity });
        Edits {
            placed: form.placed.into_iter().map(|placed| (placed.node, placed.placement)).collect(),
            removed: form.removed.into_iter().collect(),
            lights: form.lights.into_iter().map(setting).collect(),
        }
    }
}
