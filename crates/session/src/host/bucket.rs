//! How often something may happen.

/// Refills at a steady rate; four seconds' worth fit in.
#[derive(Clone, Debug)]
pub(super) struct Bucket {
    per_s: u64,
    /// Millionths of a unit.
    level: u64,
    since_us: u64,
}

/// Seconds' worth that may be taken at once.
const DEPTH_S: u64 = 4;

impl Bucket {
    /// A full one.
    pub(super) fn new(per_s: u32, now_us: u64) -> Bucket {
        let per_s = u64::from(per_s);
        Bucket { per_s, level: per_s * DEPTH_S * 1_000_000, since_us: now_us }
    }

    /// Takes one unit, if there is one.
    pub(super) fn take(&mut self, now_us: u64) -> bool {
        let passed_us = now_us.saturating_sub(self.since_us).min(DEPTH_S * 1_000_000);
        self.since_us = self.since_us.max(now_us);
        self.level = (self.level + passed_us * self.per_s).min(self.per_s * DEPTH_S * 1_000_000);
        let enough = self.level >= 1_000_000;
        if enough {
            self.level -= 1_000_000;
        }
        enough
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_gives_its_rate_and_a_burst() {
        let mut bucket = Bucket::new(10, 0);
        let burst = (0..1000).filter(|_| bucket.take(0)).count();
        assert_eq!(burst, 40);
        let steady = (1..=10_000).filter(|ms| bucket.take(ms * 1000)).count();
        assert!((99..=101).contains(&steady), "{steady}");
        assert!(!bucket.take(0), "a clock that goes back gives nothing");
    }
}
