//! How often something is tried again before it counts as broken.

use std::collections::VecDeque;

/// Most tries within [`WINDOW_S`].
const MOST: usize = 3;
/// Seconds after which a try is forgotten.
const WINDOW_S: f64 = 10.0;

/// The tries of the last seconds.
#[derive(Debug, Default)]
pub(super) struct Retries(VecDeque<f64>);

impl Retries {
    /// Whether one more try at `now_s` (seconds, never less than before) is within bounds; if so it is counted.
    pub(super) fn allow(&mut self, now_s: f64) -> bool {
        while self.0.front().is_some_and(|then_s| now_s - then_s >= WINDOW_S) {
            self.0.pop_front();
        }
        let allowed = self.0.len() < MOST;
        if allowed {
            self.0.push_back(now_s);
        }
        allowed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_tries_in_ten_seconds() {
        let mut retries = Retries::default();
        let allowed = [0.0, 1.0, 2.0, 3.0, 9.9, 10.0, 10.5, 11.0].map(|now_s| retries.allow(now_s));
        assert_eq!(allowed, [true, true, true, false, false, true, false, true]);
        assert!((0..100).all(|i| retries.allow(100.0 + 4.0 * f64::from(i))), "now and then is no harm");
    }
}
