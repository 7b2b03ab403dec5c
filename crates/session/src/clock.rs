//! The scene's time as a function of the host's clock.

use serde::{Deserialize, Serialize};

/// Runs, or stands still, from a moment of the host's clock on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneClock {
    /// Whether it runs.
    pub playing: bool,
    /// Scene time at the moment, microseconds.
    pub time_us: u64,
    /// The moment, microseconds of the host's clock.
    pub at_us: u64,
}

impl SceneClock {
    /// Latest scene time that can be gone to, seconds: eleven days.
    pub const MAX_TIME_S: f64 = 1e6;

    /// Scene time at a moment of the host's clock, microseconds. It does not run before its own moment.
    pub fn time_us(&self, host_us: u64) -> u64 {
        let ran_us = if self.playing { host_us.saturating_sub(self.at_us) } else { 0 };
        self.time_us.saturating_add(ran_us)
    }

    /// The clock that goes on from a moment, running or not.
    pub fn with_playing(self, playing: bool, host_us: u64) -> SceneClock {
        SceneClock { playing, time_us: self.time_us(host_us), at_us: host_us }
    }

    /// The clock that is set to a scene time at a moment.
    pub fn with_time(self, time_us: u64, host_us: u64) -> SceneClock {
        SceneClock { time_us, at_us: host_us, ..self }
    }
}
