//! Which stream a viewer's link can carry.

/// A link that was full for so long, more than it was not, is too slow for its stream, microseconds.
const FULL_US: u64 = 4_000_000;

/// After so long without a full link a richer stream is tried, microseconds: each time that fails, twice as long, up to the second.
const TRY_RICHER_US: (u64, u64) = (30_000_000, 960_000_000);

/// Longest time between two questions that counts, microseconds.
const LONGEST_GAP_US: u64 = 250_000;

/// What is known of a link.
#[derive(Debug)]
pub(super) struct Pace {
    /// How long it was full more than not.
    full_us: u64,
    asked_us: u64,
    /// When it was full last, or the stream was changed.
    calm_since_us: u64,
    patience_us: u64,
    /// Whether the first light of its stream has come: that takes its time on any link.
    pub(super) has_light: bool,
}

impl Pace {
    pub(super) fn new(now_us: u64) -> Pace {
        let patience_us = TRY_RICHER_US.0;
        Pace { full_us: 0, asked_us: now_us, calm_since_us: now_us, patience_us, has_light: false }
    }

    /// Its link is full, or has room.
    pub(super) fn note(&mut self, is_full: bool, now_us: u64) {
        let passed_us = now_us.saturating_sub(self.asked_us).min(LONGEST_GAP_US);
        self.asked_us = now_us;
        if !self.has_light {
            return;
        }
        if is_full {
            self.full_us += passed_us;
            self.calm_since_us = now_us;
        } else {
            self.full_us = self.full_us.saturating_sub(passed_us);
        }
    }

    /// The stream that it should be in instead of `rung`: a leaner one (a larger number, up to `leanest`), or a richer one, down to the one it asked for.
    pub(super) fn better(&mut self, rung: usize, asked: usize, leanest: usize, now_us: u64) -> Option<usize> {
        let rung = if self.full_us >= FULL_US && rung < leanest {
            self.patience_us = (2 * self.patience_us).min(TRY_RICHER_US.1);
            rung + 1
        } else if rung > asked && now_us.saturating_sub(self.calm_since_us) >= self.patience_us {
            rung - 1
        } else {
            return None;
        };
        (self.full_us, self.calm_since_us, self.has_light) = (0, now_us, false);
        Some(rung)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Asks 20 times a second for so long.
    fn ask(pace: &mut Pace, now_us: &mut u64, seconds: u64, is_full: impl Fn(u64) -> bool) {
        for step in 0..20 * seconds {
            *now_us += 50_000;
            pace.note(is_full(step), *now_us);
        }
    }

    #[test]
    fn a_full_link_gets_a_leaner_stream_and_later_the_richer_again() {
        let (mut pace, mut now_us) = (Pace::new(0), 0);
        // The first light fills any link.
        ask(&mut pace, &mut now_us, 60, |_| true);
        assert_eq!(pace.better(0, 0, 2, now_us), None);
        pace.has_light = true;
        // Now and then it is full.
        ask(&mut pace, &mut now_us, 60, |step| step % 3 == 0);
        assert_eq!(pace.better(0, 0, 2, now_us), None);
        ask(&mut pace, &mut now_us, 5, |_| true);
        assert_eq!(pace.better(0, 0, 2, now_us), Some(1));
        assert_eq!(pace.better(1, 0, 2, now_us), None, "not at once");
        pace.has_light = true;
        ask(&mut pace, &mut now_us, 59, |_| false);
        assert_eq!(pace.better(1, 0, 2, now_us), None);
        ask(&mut pace, &mut now_us, 2, |_| false);
        assert_eq!(pace.better(1, 0, 2, now_us), Some(0));
        pace.has_light = true;
        ask(&mut pace, &mut now_us, 5, |_| true);
        assert_eq!(pace.better(0, 0, 2, now_us), Some(1));
        ask(&mut pace, &mut now_us, 61, |_| false);
        assert_eq!(pace.better(1, 0, 2, now_us), None, "it failed before: twice as long");
        // There is nothing leaner than the leanest, nor richer than what was asked for.
        pace.has_light = true;
        ask(&mut pace, &mut now_us, 10, |_| true);
        assert_eq!(pace.better(2, 0, 2, now_us), None);
        ask(&mut pace, &mut now_us, 2000, |_| false);
        assert_eq!(pace.better(2, 2, 2, now_us), None);
    }
}
