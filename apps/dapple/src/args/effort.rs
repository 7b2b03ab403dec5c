//! Arguments of screen-space methods.

use clap::Args;

use crate::screen_space::Effort;

/// How screen-space methods run.
#[derive(Debug, Clone, Copy, PartialEq, Args)]
pub(crate) struct EffortArgs {
    /// Work of the screen-space methods: low, medium (both at half resolution), high (their defaults) or ultra.
    #[arg(long, value_name = "PRESET", default_value = "high")]
    pub(crate) ao_preset: dapple_render::Preset,
    /// Screen-space methods look at a quarter of the samples, and the rest is filled in along surfaces [default: the preset's].
    #[arg(long, num_args = 0..=1, require_equals = true, default_missing_value = "true", value_name = "BOOL")]
    pub(crate) half_resolution: Option<bool>,
    /// How far screen-space methods see beyond the picture, as a part of its height, 0 to 0.5.
    #[arg(long, value_name = "PART", default_value_t = Effort::GUARD_BAND)]
    pub(crate) guard_band: f32,
}

impl EffortArgs {
    pub(crate) fn effort(self) -> Effort {
        Effort {
            preset: self.ao_preset,
            half_resolution: self.half_resolution,
            guard_band: self.guard_band,
            ..Effort::default()
        }
    }
}
