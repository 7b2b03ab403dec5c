//! Presets, and the names of what can be chosen.

use dapple_client::viewer::{DebugView, Method};

use dapple_render::screen_space::ScreenKind;

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

pub(super) const METHODS: [(Method, &str); 12] = [
    (Method::Psao, "psao"),
    (Method::PsaoPaper, "psao-paper"),
    screen(ScreenKind::Ssao),
    screen(ScreenKind::Alchemy),
    screen(ScreenKind::Sao),
    screen(ScreenKind::Hbao),
    screen(ScreenKind::HbaoPlus),
    screen(ScreenKind::Gtao),
    screen(ScreenKind::SdSsao),
    screen(ScreenKind::SdHbao),
    screen(ScreenKind::SdHbaoPlus),
    (Method::None, "none"),
];

const fn screen(kind: ScreenKind) -> (Method, &'static str) {
    (Method::Screen(kind), kind.name())
}

pub(super) const VIEWS: [(DebugView, &str); 8] = [
    (DebugView::Beauty, "beauty"),
    (DebugView::Visibility, "visibility"),
    (DebugView::Normal, "normal"),
    (DebugView::Points, "points"),
    (DebugView::Texels, "texels"),
    (DebugView::Weights, "weights"),
    (DebugView::Age, "age"),
    (DebugView::Error, "error"),
];

/// The name of a choice.
pub(super) fn name_of<T: PartialEq>(table: &[(T, &'static str)], choice: T) -> &'static str {
    table.iter().find(|(known, _)| *known == choice).map_or("", |(_, name)| name)
}

/// The choice after this one, round and round.
pub(super) fn next_of<T: PartialEq + Copy>(table: &[(T, &'static str)], choice: T) -> T {
    let at = table.iter().position(|(known, _)| *known == choice).map_or(0, |at| at + 1);
    table.get(at).or(table.first()).map_or(choice, |(next, _)| *next)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn choices_go_round() {
        let mut view = DebugView::Beauty;
        let mut seen = Vec::new();
        for _ in VIEWS {
            seen.push(name_of(&VIEWS, view));
            view = next_of(&VIEWS, view);
        }
        assert_eq!(seen, VIEWS.map(|(_, name)| name));
        assert_eq!(view, DebugView::Beauty);
    }
}
