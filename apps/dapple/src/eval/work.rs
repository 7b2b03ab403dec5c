//! How far a run is and how long it will still take: a bar on a terminal, a line a job elsewhere.

use std::io::IsTerminal;
use std::time::Instant;

use crate::progress::Bar;

/// Steps of the bar.
const STEPS: f64 = 1000.0;

/// Progress through jobs of different sizes. Work is counted in rays, about.
pub(super) struct Work {
    bar: Bar,
    lines: bool,
    begun: Instant,
    /// Of all jobs that are not yet done.
    left: f64,
    /// Of jobs that were done in this run.
    done: f64,
    jobs: usize,
    /// More scenes are to come.
    open: bool,
    finished: usize,
}

impl Work {
    /// Work that is expected; it may be corrected.
    pub(super) fn new() -> Work {
        let bar = Bar::new("", STEPS as u64);
        Work {
            bar,
            lines: !std::io::stderr().is_terminal(),
            begun: Instant::now(),
            left: 0.0,
            done: 0.0,
            jobs: 0,
            open: false,
            finished: 0,
        }
    }

    /// Another scene's jobs are known; `scenes` more are taken to be like it.
    pub(super) fn expect(&mut self, jobs: usize, work: f64, scenes: usize) {
        self.jobs = self.finished + jobs;
        self.open = scenes > 0;
        self.left = work * (1 + scenes) as f64;
    }

    /// Says what is done between jobs.
    pub(super) fn message(&self, what: &str) {
        self.bar.message(what);
    }

    /// A job begins; `part` of it is told by [`Work::part`].
    pub(super) fn begin(&self, what: &str) {
        self.bar.message(&format!("{} of {}: {what}", self.finished + 1, self.count()));
    }

    /// Jobs of the scenes so far.
    fn count(&self) -> String {
        if self.open { format!("{} or more", self.jobs) } else { self.jobs.to_string() }
    }

    /// How much of the running job is done, 0 … 1.
    pub(super) fn part(&self, work: f64, part: f64) {
        let done = self.done + work * part;
        self.bar.set((STEPS * done / (self.done + self.left).max(1.0)) as u64);
    }

    /// A job is done, or was done before (`fresh` is false).
    pub(super) fn finish(&mut self, what: &str, work: f64, fresh: bool) {
        self.finished += 1;
        self.left = (self.left - work).max(0.0);
        if fresh {
            self.done += work;
        }
        self.part(0.0, 0.0);
        if self.lines && fresh {
            let elapsed = self.begun.elapsed();
            let left = if self.left > 0.0 {
                format!(", about {} left", minutes(elapsed.as_secs_f64() * self.left / self.done.max(1.0)))
            } else {
                String::new()
            };
            eprintln!(
                "{} of {}: {what}, after {}{left}",
                self.finished,
                self.count(),
                minutes(elapsed.as_secs_f64())
            );
        }
    }
}

/// A time in seconds as people say it.
fn minutes(seconds: f64) -> String {
    match seconds {
        ..89.5 => format!("{seconds:.0} s"),
        ..5400.0 => format!("{:.0} min", seconds / 60.0),
        ..172_800.0 => format!("{:.1} h", seconds / 3600.0),
        _ => format!("{:.0} days", seconds / 86_400.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_said_in_the_unit_that_fits() {
        let times = [5.2, 100.0, 5399.0, 9000.0, 864_000.0, 1e300];
        let said = times.map(minutes);
        assert_eq!(said[..5], ["5 s", "2 min", "90 min", "2.5 h", "10 days"]);
        assert!(said[5].ends_with(" days"));
    }
}
