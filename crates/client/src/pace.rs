//! How long a fade takes that is over just when the next update comes.

/// Seconds before two updates have come.
const START_S: f32 = 1.0 / 15.0;
/// Longest fade, seconds: after that an update is late, not smooth.
const LONGEST_S: f64 = 0.5;
/// Seconds without an update after which the next one ends a pause and says nothing of the pace.
const PAUSE_S: f64 = 2.0;
/// Part of the newest interval in the smoothed one.
const NEWEST: f64 = 0.25;

/// The smoothed interval between updates that changed something.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pace {
    last_s: Option<f64>,
    interval_s: Option<f64>,
}

impl Pace {
    /// Notes that an update came at `now_s` (seconds on the caller's clock). Updates that come together count as one, and a
    /// clock that goes back begins anew.
    pub fn note(&mut self, now_s: f64) {
        let Some(gap_s) = self.last_s.map(|last| now_s - last) else {
            self.last_s = Some(now_s);
            return;
        };
        if gap_s == 0.0 {
            return;
        }
        self.last_s = Some(now_s);
        if gap_s > 0.0 && gap_s <= PAUSE_S {
            let gap_s = gap_s.min(LONGEST_S);
            self.interval_s = Some(self.interval_s.map_or(gap_s, |i| i + NEWEST * (gap_s - i)));
        }
    }

    /// Seconds that a fade takes, 0 … 0.5; 1/15 before two updates have come.
    pub fn fade_s(&self) -> f32 {
        self.known_s().unwrap_or(START_S)
    }

    /// The same where two updates have come.
    pub(crate) fn known_s(&self) -> Option<f32> {
        self.interval_s.map(|interval_s| interval_s as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The fade after updates at these intervals.
    fn fade_after(intervals_s: impl IntoIterator<Item = f64>) -> f32 {
        let (mut pace, mut now_s) = (Pace::default(), 3.0);
        pace.note(now_s);
        for interval_s in intervals_s {
            now_s += interval_s;
            pace.note(now_s);
        }
        pace.fade_s()
    }

    #[test]
    fn five_updates_a_second_fade_over_a_fifth() {
        assert!((fade_after([0.2; 5]) - 0.2).abs() < 1e-6);
        // Pictures come in between, so that arrivals are late by up to one of them.
        let jittered = (0..40).map(|i| if i % 2 == 0 { 0.217 } else { 0.183 });
        assert!((fade_after(jittered) - 0.2).abs() < 0.01);
        // Another pace is taken on within a dozen updates.
        let slower = [0.05; 10].into_iter().chain([0.2; 12]);
        assert!((fade_after(slower) - 0.2).abs() < 0.01);
    }

    #[test]
    fn pauses_and_bursts_say_nothing() {
        assert_eq!(fade_after([]), START_S);
        assert_eq!(fade_after([60.0]), START_S);
        let steady = fade_after([0.1; 10]);
        assert_eq!(fade_after([0.1; 10].into_iter().chain([60.0])), steady);
        assert_eq!(fade_after([0.1; 10].into_iter().chain([0.0; 30])), steady);
        assert_eq!(fade_after([0.1; 10].into_iter().chain([-3.0])), steady);
        assert_eq!(fade_after([1.5; 10]), 0.5, "no longer than half a second");
        assert!((0.0..0.002).contains(&fade_after([0.001; 10])));
    }
}
