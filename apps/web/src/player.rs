//! Which time of the scene is shown.

/// Longest step in seconds: a tab that slept goes on where it was.
const MAX_STEP_S: f64 = 0.25;

/// The time of a scene that plays, waits, or is moved by hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clock {
    time_s: f64,
    duration_s: f64,
    loaded_s: f64,
    playing: bool,
    looping: bool,
}

impl Default for Clock {
    /// At 0, playing, without end.
    fn default() -> Clock {
        Clock { time_s: 0.0, duration_s: 0.0, loaded_s: f64::INFINITY, playing: true, looping: true }
    }
}

impl Clock {
    /// Time of the scene, seconds.
    pub fn time_s(&self) -> f64 {
        self.time_s
    }

    /// Where it ends or begins again, seconds; 0 for never.
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// Whether it goes on by itself.
    pub fn is_playing(&self) -> bool {
        self.playing
    }

    /// Sets where it ends or begins again (seconds, 0 for never), and up to where there is something to play.
    pub fn set_extent(&mut self, duration_s: f64, loaded_s: f64) {
        self.duration_s = finite(duration_s);
        self.loaded_s = if loaded_s.is_nan() { 0.0 } else { loaded_s.max(0.0) };
    }

    /// Lets it go on or wait. One that has come to its end begins again.
    pub fn set_playing(&mut self, playing: bool) {
        if playing && !self.playing && self.at_end() {
            self.time_s = 0.0;
        }
        self.playing = playing;
    }

    /// Whether it begins again at its end (default), or waits there.
    pub fn set_looping(&mut self, looping: bool) {
        self.looping = looping;
    }

    /// Goes to a time, as far as there is something to show.
    pub fn seek(&mut self, time_s: f64) {
        self.time_s = finite(time_s).min(self.limit());
    }

    /// Goes on by `elapsed_s`, at most a quarter of a second; true if the time changed. It waits where nothing has come yet.
    pub fn advance(&mut self, elapsed_s: f64) -> bool {
        if !self.playing {
            return false;
        }
        let before = self.time_s;
        let next = before + finite(elapsed_s).min(MAX_STEP_S);
        let complete = self.loaded_s >= self.duration_s;
        self.time_s = if self.duration_s > 0.0 && complete && next >= self.duration_s {
            if self.looping {
                // Not the remainder of a division, which a short step never needs.
                (next - self.duration_s).min(self.duration_s)
            } else {
                self.playing = false;
                self.duration_s
            }
        } else {
            next.min(self.limit()).max(before)
        };
        self.time_s != before
    }

    fn at_end(&self) -> bool {
        self.duration_s > 0.0 && self.time_s >= self.duration_s
    }

    fn limit(&self) -> f64 {
        if self.duration_s > 0.0 { self.loaded_s.min(self.duration_s) } else { self.loaded_s }
    }
}

/// The number, or 0 if it is not finite or below 0.
fn finite(number: f64) -> f64 {
    if number.is_finite() { number.max(0.0) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clock(duration_s: f64, loaded_s: f64) -> Clock {
        let mut clock = Clock::default();
        clock.set_extent(duration_s, loaded_s);
        clock
    }

    #[test]
    fn it_begins_again_at_its_end() {
        let mut clock = clock(1.0, 1.0);
        clock.seek(0.9);
        assert!(clock.advance(0.2));
        assert!((clock.time_s() - 0.1).abs() < 1e-12, "{}", clock.time_s());
    }

    #[test]
    fn or_waits_there_until_it_is_played_again() {
        let mut clock = clock(1.0, 1.0);
        clock.set_looping(false);
        clock.seek(0.9);
        assert!(clock.advance(0.2));
        assert_eq!((clock.time_s(), clock.is_playing()), (1.0, false));
        assert!(!clock.advance(0.2));
        clock.set_playing(true);
        assert_eq!(clock.time_s(), 0.0);
    }

    #[test]
    fn it_waits_for_what_has_not_come() {
        let mut clock = clock(10.0, 0.3);
        assert!(clock.advance(0.2));
        assert!(clock.advance(0.2));
        assert_eq!(clock.time_s(), 0.3);
        assert!(!clock.advance(0.2));
        assert!(clock.is_playing());
        clock.seek(9.0);
        assert_eq!(clock.time_s(), 0.3);
        clock.set_extent(10.0, 10.0);
        clock.seek(9.0);
        assert_eq!(clock.time_s(), 9.0);
    }

    #[test]
    fn a_tab_that_slept_goes_on_where_it_was() {
        let mut clock = clock(100.0, 100.0);
        clock.advance(3600.0);
        assert_eq!(clock.time_s(), MAX_STEP_S);
    }

    #[test]
    fn without_an_end_it_goes_on_for_ever() {
        let mut clock = clock(0.0, f64::INFINITY);
        clock.seek(1e6);
        assert!(clock.advance(0.1));
        assert!(clock.time_s() > 1e6);
    }

    #[test]
    fn numbers_that_are_none_do_no_harm() {
        let mut clock = clock(f64::NAN, f64::NAN);
        clock.seek(f64::NAN);
        clock.advance(f64::NAN);
        clock.advance(-1.0);
        assert_eq!(clock.time_s(), 0.0);
    }
}
