//! When to try again.

/// Shortest and longest wait, microseconds.
const FIRST_US: u64 = 250_000;
const LONGEST_US: u64 = 10_000_000;

/// Waits that double, less up to a half by chance.
#[derive(Clone, Debug)]
pub(super) struct Backoff {
    seed: u64,
    tries: u32,
}

impl Backoff {
    pub(super) fn new(seed: u64) -> Backoff {
        Backoff { seed, tries: 0 }
    }

    pub(super) fn reset(&mut self) {
        self.tries = 0;
    }

    pub(super) fn next_us(&mut self) -> u64 {
        let longest_us = (FIRST_US << self.tries.min(16)).min(LONGEST_US);
        self.tries += 1;
        let chance = mix(self.seed ^ (u64::from(self.tries) << 32)) % 1024;
        longest_us - longest_us * chance / 2048
    }
}

/// Scrambles the bits of a number (the finaliser of SplitMix64).
fn mix(mut bits: u64) -> u64 {
    bits = bits.wrapping_add(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ (bits >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waits_grow_and_differ() {
        let mut one = Backoff::new(1);
        let waits: Vec<u64> = (0..40).map(|_| one.next_us()).collect();
        assert!(waits[0] <= FIRST_US && waits[0] >= FIRST_US / 2);
        assert!(waits[39] <= LONGEST_US && waits[39] >= LONGEST_US / 2);
        let mut other = Backoff::new(2);
        assert_ne!(waits[..4], (0..4).map(|_| other.next_us()).collect::<Vec<_>>()[..]);
        one.reset();
        assert!(one.next_us() <= FIRST_US);
    }
}
