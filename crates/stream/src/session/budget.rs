//! How many bytes a frame may take, so that no second takes more than a budget.

use std::collections::VecDeque;

/// Bits a second that a stream may take, kept over every second and not only on average: what one frame took is given back one
/// second later. It owns no clock.
///
/// A frame gets a part of what is left of its second, so that something always is left for the next one. A stream that wants more
/// than the budget for long settles at 0.75 to 0.9 of it; one that rested may take a third of it at once.
#[derive(Clone, Debug)]
pub struct Budget {
    bits_per_s: u64,
    /// What was sent in the last second: when, and how many bytes.
    sent: VecDeque<(f64, u64)>,
    sent_bytes: u64,
    now_s: f64,
    /// What is added to the caller's clock.
    offset_s: f64,
    /// Seconds between the last two frames; 0 before.
    step_s: f64,
}

/// Parts of what is left that frames take, by how far apart they are: at 15 Hz a third.
const PARTS_PER_S: f64 = 5.0;
/// Never more: frames that are far apart leave something too.
const MOST_PART: f64 = 0.4;
/// Never less, as far as so much is left: a frame that is much shorter says next to nothing for its envelope.
const LEAST_BYTES: u64 = 400;
/// Before it is known how far apart frames are.
const FIRST_PART: f64 = 0.25;
/// Times this far apart are the same, seconds: sums of steps do not come out at whole seconds.
const SAME_S: f64 = 1e-6;

impl Budget {
    /// Nothing is sent yet.
    pub fn new(bits_per_s: u64) -> Budget {
        Budget {
            bits_per_s,
            sent: VecDeque::new(),
            sent_bytes: 0,
            now_s: f64::NEG_INFINITY,
            offset_s: 0.0,
            step_s: 0.0,
        }
    }

    /// Another budget for the same stream: what was sent still counts.
    pub fn with_bits_per_s(self, bits_per_s: u64) -> Budget {
        Budget { bits_per_s, ..self }
    }

    /// Bits a second.
    pub fn bits_per_s(&self) -> u64 {
        self.bits_per_s
    }

    /// Most bytes that a frame may take that is sent at `now_s` (seconds, of any clock). A clock that goes back, as the time of a scene does
    /// when it starts anew, is taken to have gone on by as much as between the frames before.
    pub fn allowance(&mut self, now_s: f64) -> usize {
        if now_s + self.offset_s < self.now_s {
            self.offset_s = self.now_s + self.step_s - now_s;
        }
        let now_s = now_s + self.offset_s;
        // Neither the same time nor what is no number.
        if now_s > self.now_s {
            self.step_s = if self.now_s.is_finite() { now_s - self.now_s } else { 0.0 };
            self.now_s = now_s;
        }
        while let Some(&(time_s, bytes)) = self.sent.front()
            && time_s <= self.now_s - 1.0 + SAME_S
        {
            self.sent.pop_front();
            self.sent_bytes -= bytes;
        }
        let left = (self.bits_per_s / 8).saturating_sub(self.sent_bytes);
        let part = if self.step_s > 0.0 { (PARTS_PER_S * self.step_s).min(MOST_PART) } else { FIRST_PART };
        ((left as f64 * part) as u64).max(left.min(LEAST_BYTES)) as usize
    }

    /// Takes note of a frame that was sent at the time of the last [`Budget::allowance`].
    pub fn spend(&mut self, bytes: usize) {
        self.sent.push_back((self.now_s, bytes as u64));
        self.sent_bytes += bytes as u64;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Most bytes in any second that begins with a frame.
    fn worst(sent: &[(f64, usize)]) -> usize {
        let from = |start: f64| sent.iter().filter(move |(t, _)| *t >= start && *t < start + 1.0 - SAME_S);
        sent.iter().map(|&(start, _)| from(start).map(|(_, bytes)| bytes).sum()).max().unwrap_or(0)
    }

    proptest! {
        #[test]
        fn no_second_takes_more(
            hz in prop_oneof![Just(1.0), Just(5.0), Just(15.0), Just(60.0), Just(71.3)],
            wants in prop::collection::vec(0usize..40_000, 1..300),
            bits in 0u64..1_000_000,
        ) {
            let mut budget = Budget::new(bits);
            let mut sent = Vec::new();
            for (step, want) in wants.iter().enumerate() {
                let now_s = step as f64 / hz;
                let bytes = budget.allowance(now_s).min(*want);
                if bytes > 0 {
                    budget.spend(bytes);
                    sent.push((now_s, bytes));
                }
            }
            prop_assert!(worst(&sent) as u64 <= bits / 8);
        }
    }

    #[test]
    fn a_stream_that_wants_more_gets_most_of_it_evenly() {
        for hz in [5.0, 15.0, 60.0] {
            let mut budget = Budget::new(800_000);
            let mut sizes = Vec::new();
            for step in 0..(6.0 * hz) as usize {
                let bytes = budget.allowance(step as f64 / hz);
                budget.spend(bytes);
                sizes.push(bytes);
            }
            let last = &sizes[(5.0 * hz) as usize..];
            let sum: usize = last.iter().sum();
            assert!((70_000..=100_000).contains(&sum), "{hz} Hz: {sum}");
            let (least, most) = (last.iter().min().unwrap(), last.iter().max().unwrap());
            assert!(3 * least >= *most, "{hz} Hz: {least} to {most}");
        }
    }

    #[test]
    fn a_clock_that_goes_back_neither_gives_nor_takes() {
        let mut budget = Budget::new(80_000);
        let first = budget.allowance(5.0);
        budget.spend(first);
        assert_eq!((first, budget.allowance(5.0)), (2500, 7500 / 4), "the same time");
        assert_eq!(budget.allowance(f64::NAN), 7500 / 4);
        assert_eq!(budget.allowance(6.0), 4000, "a second later all is there again");
        budget.spend(4000);
        assert_eq!(budget.allowance(0.5), 4000, "as long after it as the one before");
        budget.spend(4000);
        assert_eq!(budget.allowance(0.6), 2400, "and the clock goes on from there");
        let mut less = budget.with_bits_per_s(40_000);
        assert_eq!(less.allowance(0.6), 400, "what was sent counts, and a short frame is better than none");
    }
}
