//! Presets, and what comes after a choice.

use crate::args::{Preset, ViewArgs};

/// How much effort is made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Quality {
    pub(super) samples: u32,
    pub(super) shadow_resolution: u32,
    pub(super) points_per_m2: f32,
}

impl Quality {
    pub(super) fn of(preset: Preset) -> Quality {
        let (samples, shadow_resolution) = match preset {
            Preset::Phone => (1, 1024),
            Preset::Headset => (4, 1024),
            Preset::Desktop => (4, 2048),
        };
        Quality { samples, shadow_resolution, points_per_m2: preset.points_per_m2() }
    }

    /// The preset of the arguments, with what they say otherwise.
    pub(super) fn from_args(args: &ViewArgs) -> Quality {
        let preset = Quality::of(args.preset);
        Quality {
            samples: args.samples.unwrap_or(preset.samples),
            points_per_m2: args.points.unwrap_or(preset.points_per_m2),
            ..preset
        }
    }
}

pub(super) const PRESETS: [(Preset, &str); 3] =
    [(Preset::Phone, "phone"), (Preset::Headset, "headset"), (Preset::Desktop, "desktop")];

/// The choice after this one, round and round.
pub(super) fn next_of<T: PartialEq + Copy>(all: &[T], choice: T) -> T {
    let at = all.iter().position(|known| *known == choice).map_or(0, |at| at + 1);
    all.get(at).or(all.first()).copied().unwrap_or(choice)
}

#[cfg(test)]
mod tests {
    use dapple_client::viewer::{DebugView, Method};

    use super::*;

    #[test]
    fn choices_go_round() {
        let (mut view, mut seen) = (DebugView::Beauty, Vec::new());
        for _ in DebugView::ALL {
            seen.push(view);
            view = next_of(&DebugView::ALL, view);
        }
        assert_eq!(seen, DebugView::ALL);
        assert_eq!(view, DebugView::Beauty);
        assert_eq!(next_of(&Method::ALL, Method::None), Method::Psao);
    }
}
