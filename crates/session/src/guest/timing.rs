//! The host's clock seen from here, and where the time goes.

use crate::{LightHead, Status};

/// Part of a new sample in what is smoothed.
const NEWEST: f64 = 0.1;

/// Off by more than this the shown time jumps instead of gliding, microseconds.
const JUMP_US: f64 = 250_000.0;

/// The least delay of late counts as the way's own; it is forgotten slowly: microseconds a sample.
const FORGET_US: f64 = 20.0;

/// Where the time goes from a step of the host to what is held here, seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Latency {
    /// The host's step: tracing and encoding.
    pub step_s: f64,
    /// What was made lay at the host.
    pub queue_s: f64,
    /// On its way, as far as it can be told from here: half of the round trip and what came on top.
    pub network_s: f64,
    /// Applying a frame here.
    pub apply_s: f64,
}

/// Differences of the two clocks. All in microseconds; the viewer's clock less the host's.
#[derive(Clone, Debug, Default)]
pub(super) struct Timing {
    /// From a step's beginning to its coming, smoothed: what is shown lies so far back.
    shown: Option<f64>,
    /// From a step's end to its coming: the least of late, and smoothed.
    least: Option<f64>,
    usual: f64,
    step_us: f64,
    round_trip_us: u64,
    newest_stamp_us: u64,
}

impl Timing {
    /// A new connection may lead to another host.
    pub(super) fn connected(&mut self) {
        *self = Timing { shown: self.shown, ..Timing::default() };
    }

    pub(super) fn round_trip(&mut self, round_trip_us: u64) {
        self.round_trip_us = round_trip_us;
    }

    /// Light came whole.
    pub(super) fn light(&mut self, head: &LightHead, now_us: u64) {
        let since_stamp = now_us as f64 - head.stamp_us as f64;
        let since_made = now_us as f64 - head.made_us as f64;
        // What was kept for a while and then sent says nothing of the way.
        let is_new = head.stamp_us > self.newest_stamp_us;
        self.newest_stamp_us = self.newest_stamp_us.max(head.stamp_us);
        if !is_new {
            return;
        }
        self.shown = Some(glide(self.shown, since_stamp));
        self.usual = match self.least {
            None => since_made,
            Some(_) => self.usual + NEWEST * (since_made - self.usual),
        };
        self.least = Some(self.least.map_or(since_made, |least| (least + FORGET_US).min(since_made)));
        let step_us = head.made_us.saturating_sub(head.stamp_us) as f64;
        self.step_us += NEWEST * (step_us - self.step_us);
    }

    /// The host's moment that is shown now.
    pub(super) fn shown_host_us(&self, now_us: u64) -> Option<u64> {
        self.shown.map(|shown| (now_us as f64 - shown).max(0.0) as u64)
    }

    /// How old what came last is.
    pub(super) fn age_us(&self, now_us: u64) -> Option<u64> {
        // The least delay is half of the shortest way there and back, as far as one can know.
        let offset = self.least? - self.round_trip_us as f64 / 2.0;
        Some((now_us as f64 - offset - self.newest_stamp_us as f64).max(0.0) as u64)
    }

    pub(super) fn latency(&self, status: &Status) -> Latency {
        let on_top = self.least.map_or(0.0, |least| (self.usual - least).max(0.0));
        Latency {
            step_s: self.step_us * 1e-6,
            queue_s: status.queue_us as f64 * 1e-6,
            network_s: (self.round_trip_us as f64 / 2.0 + on_top) * 1e-6,
            apply_s: 0.0,
        }
    }
}

fn glide(now: Option<f64>, sample: f64) -> f64 {
    match now {
        Some(now) if (sample - now).abs() <= JUMP_US => now + NEWEST * (sample - now),
        _ => sample,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn heads(count: u64) -> impl Iterator<Item = LightHead> {
        (0..count).map(|i| LightHead {
            stamp_us: 1_000_000 + i * 50_000,
            made_us: 1_010_000 + i * 50_000,
            ..LightHead::default()
        })
    }

    #[test]
    fn what_is_shown_is_what_came() {
        let mut timing = Timing::default();
        // The clocks differ by 7 s; the way takes 30 ms, at times 60.
        for (i, head) in heads(200).enumerate() {
            let way_us = if i % 5 == 0 { 60_000 } else { 30_000 };
            timing.light(&head, head.made_us + 7_000_000 + way_us);
        }
        timing.round_trip(60_000);
        let last = heads(200).last().unwrap();
        let now_us = last.made_us + 7_000_000 + 30_000;
        let shown_us = timing.shown_host_us(now_us).unwrap();
        assert!(shown_us.abs_diff(last.stamp_us) < 15_000, "{shown_us} {}", last.stamp_us);
        let age_us = timing.age_us(now_us).unwrap();
        assert!(age_us.abs_diff(40_000) < 5_000, "{age_us}");
        let latency = timing.latency(&Status::default());
        assert!(
            (latency.step_s - 0.01).abs() < 1e-3 && (0.03..0.045).contains(&latency.network_s),
            "{latency:?}"
        );
    }

    #[test]
    fn after_a_pause_of_the_host_it_jumps() {
        let mut timing = Timing::default();
        for head in heads(20) {
            timing.light(&head, head.made_us + 1000);
        }
        let late = LightHead { stamp_us: 3_000_000, made_us: 3_000_000, ..LightHead::default() };
        timing.light(&late, 3_900_000);
        assert_eq!(timing.shown_host_us(3_900_000), Some(3_000_000));
    }
}
