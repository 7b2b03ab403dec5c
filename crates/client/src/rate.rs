//! How much comes a second, seen over the last few.

use std::collections::VecDeque;

/// Seconds that a rate is taken over.
const WINDOW_S: f64 = 2.0;
/// Most entries that are kept; those that come faster are put together.
const MAX_ENTRIES: usize = 512;

/// Sums what came within the last two seconds.
#[derive(Clone, Debug, Default)]
pub struct Rate {
    entries: VecDeque<(f64, f64)>,
    /// When the first came, until a whole window has passed.
    since_s: Option<f64>,
}

impl Rate {
    /// Notes that `amount` came at `now_s` (seconds, never less than before).
    pub fn add(&mut self, now_s: f64, amount: f64) {
        self.since_s.get_or_insert(now_s);
        self.forget(now_s);
        let full = self.entries.len() >= MAX_ENTRIES;
        match self.entries.back_mut() {
            Some((time, sum)) if full || *time == now_s => {
                (*time, *sum) = (now_s, *sum + amount);
            }
            _ => self.entries.push_back((now_s, amount)),
        }
    }

    /// What came a second, up to `now_s`; 0 in the first half second, when too little is known.
    pub fn per_second(&mut self, now_s: f64) -> f64 {
        self.forget(now_s);
        let watched_s = self.since_s.map_or(0.0, |since| (now_s - since).min(WINDOW_S));
        if watched_s < 0.5 {
            return 0.0;
        }
        // An empty sum is −0.
        (self.entries.iter().map(|(_, amount)| amount).sum::<f64>() + 0.0) / watched_s
    }

    /// Starts anew.
    pub fn clear(&mut self) {
        *self = Rate::default();
    }

    fn forget(&mut self, now_s: f64) {
        while self.entries.front().is_some_and(|(time, _)| *time <= now_s - WINDOW_S) {
            self.entries.pop_front();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_steady_flow_has_its_rate_and_dries_up() {
        let mut rate = Rate::default();
        for tick in 0..100 {
            rate.add(f64::from(tick) * 0.1, 5.0);
        }
        assert!((rate.per_second(9.9) - 50.0).abs() < 1e-9, "{}", rate.per_second(9.9));
        assert!(rate.per_second(12.0) == 0.0 && rate.per_second(12.0).is_sign_positive());
    }

    #[test]
    fn a_short_flow_is_divided_by_its_own_length() {
        let mut rate = Rate::default();
        rate.add(1.0, 3.0);
        assert_eq!(rate.per_second(1.2), 0.0);
        rate.add(1.5, 3.0);
        assert_eq!(rate.per_second(2.0), 6.0);
    }

    #[test]
    fn a_flood_stays_small_and_loses_nothing() {
        let mut rate = Rate::default();
        for i in 0..10_000 {
            rate.add(f64::from(i) * 1e-4, 1.0);
        }
        assert!(rate.entries.len() <= MAX_ENTRIES);
        assert!((rate.per_second(1.0) - 10_000.0).abs() < 1e-6);
    }
}
