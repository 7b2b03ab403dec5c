//! Choices with probabilities ⇄ bytes: an adaptive binary range coder in whole numbers of 32 bits.
//!
//! [`Coder`] is what both ends have in common: code that walks over what is to be coded is written once, asks for every
//! choice with [`Coder::bit`], and goes on with what comes back. To write, that is what was handed in; to read, what the bytes say.

/// How a choice is expected to fall, learned from those before it: two estimates of different patience, averaged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Chance {
    /// Probability of 1 in 65,536ths, after the last dozen choices.
    quick: u16,
    /// The same, after the last hundred.
    slow: u16,
}

/// An estimate moves by 2⁻⁴ and 2⁻⁷ of its distance from what came.
const QUICK: u32 = 4;
const SLOW: u32 = 7;

/// The range is widened below this.
#[cfg(feature = "publish")]
const LEAST_RANGE: u32 = 1 << 24;

/// Bytes that a reader is ahead of a writer.
const AHEAD: usize = 4;

/// Most bits that one choice uses up: a range is at least 2²⁴ before it and 2⁸ after it.
const MOST_USED: u32 = 16;

/// Bits that a reader takes at once when it has few.
const TAKEN: u32 = 24;

impl Chance {
    /// As likely as not.
    pub(crate) const EVEN: Chance = Chance::of(1 << 15);

    /// 1 with a probability of `share` / 65,536.
    pub(crate) const fn of(share: u16) -> Chance {
        Chance { quick: share, slow: share }
    }

    /// Probability of 1 in 65,536ths: 1 … 65,535.
    #[inline]
    fn of_one(self) -> u32 {
        ((u32::from(self.quick) + u32::from(self.slow)) >> 1).max(1)
    }

    #[inline(always)]
    fn learn_one(&mut self) {
        self.quick += (u16::MAX - self.quick) >> QUICK;
        self.slow += (u16::MAX - self.slow) >> SLOW;
    }

    #[inline(always)]
    fn learn_zero(&mut self) {
        self.quick -= self.quick >> QUICK;
        self.slow -= self.slow >> SLOW;
    }
}

/// One end of a coded stream of choices. The default is one without bytes; it is left in the place of a coder that is moved
/// into a function's own variables, where it can be kept in registers.
pub(crate) trait Coder: Default {
    /// Codes one choice and learns from it. A writer returns `one`; a reader ignores it and returns what it read.
    fn bit(&mut self, chance: &mut Chance, one: bool) -> bool;

    /// Codes the low `count` bits of `value` (at most 16), all as likely as not; the highest first.
    fn plain(&mut self, value: u32, count: u32) -> u32 {
        (0..count).rev().fold(0, |read, at| {
            let one = self.bit(&mut Chance::EVEN.clone(), value >> at & 1 == 1);
            read << 1 | u32::from(one)
        })
    }

    /// Whether a reader has come to the end of its bytes, so that what it returns means nothing any more.
    fn is_exhausted(&self) -> bool;
}

/// The writing end.
#[cfg(feature = "publish")]
#[derive(Debug)]
pub(crate) struct Writer {
    /// Where the range begins; bit 32 is a carry into bytes that are out already.
    low: u64,
    range: u32,
    /// The byte that a carry can still change, and how many bytes of 255 follow it.
    held: u8,
    full: usize,
    /// Nothing was held yet: the first byte is always 0 and is left out.
    first: bool,
    out: Vec<u8>,
}

#[cfg(feature = "publish")]
impl Writer {
    /// Appends to `out`.
    pub(crate) fn new(out: Vec<u8>) -> Writer {
        Writer { low: 0, range: u32::MAX, held: 0, full: 0, first: true, out }
    }

    /// Bytes that are certain so far.
    pub(crate) fn bytes(&self) -> usize {
        self.out.len()
    }

    fn shift(&mut self) {
        if self.low < 0xff00_0000 || self.low > u64::from(u32::MAX) {
            let carry = (self.low >> 32) as u8;
            if !self.first {
                self.out.push(self.held.wrapping_add(carry));
            }
            self.first = false;
            self.out.extend(std::iter::repeat_n(carry.wrapping_sub(1), self.full));
            self.full = 0;
            self.held = (self.low >> 24) as u8;
        } else {
            self.full += 1;
        }
        self.low = (self.low << 8) & u64::from(u32::MAX);
    }

    /// Closes the stream with as few bytes as tell it from every other.
    pub(crate) fn finish(mut self) -> Vec<u8> {
        // Of all numbers within the range, the one with the most zeros at its end.
        let last = self.low + u64::from(self.range) - 1;
        let kept = (0..32).rev().map(|zeros| last >> zeros << zeros).find(|value| *value >= self.low);
        self.low = kept.unwrap_or(self.low);
        let before = self.out.len() + self.full + usize::from(!self.first);
        for _ in 0..=AHEAD {
            self.shift();
        }
        while self.out.len() > before && self.out.last() == Some(&0) {
            self.out.pop();
        }
        self.out
    }
}

#[cfg(feature = "publish")]
impl Default for Writer {
    fn default() -> Writer {
        Writer::new(Vec::new())
    }
}

#[cfg(feature = "publish")]
impl Coder for Writer {
    #[inline]
    fn bit(&mut self, chance: &mut Chance, one: bool) -> bool {
        let bound = (self.range >> 16) * chance.of_one();
        if one {
            self.range = bound;
            chance.learn_one();
        } else {
            self.low += u64::from(bound);
            self.range -= bound;
            chance.learn_zero();
        }
        while self.range < LEAST_RANGE {
            self.range <<= 8;
            self.shift();
        }
        one
    }

    fn is_exhausted(&self) -> bool {
        false
    }
}

/// The reading end.
#[derive(Clone, Debug)]
pub(crate) struct Reader<'a> {
    range: u32,
    /// What the range is compared with in the high 32 bits, then the `ahead` bits that follow it, then zeros.
    window: u64,
    ahead: u32,
    bytes: &'a [u8],
    /// Bytes that went into the window, also beyond the end.
    taken: usize,
}

impl<'a> Reader<'a> {
    /// Reads what a writer made: all of `bytes`.
    pub(crate) fn new(bytes: &'a [u8]) -> Reader<'a> {
        let window =
            (0..AHEAD).fold(0, |code, at| code << 8 | u64::from(bytes.get(at).copied().unwrap_or(0)));
        let mut reader = Reader { range: u32::MAX, window: window << 32, ahead: 0, bytes, taken: AHEAD };
        reader.take();
        reader
    }

    /// Takes [`TAKEN`] bits more; there are fewer than [`MOST_USED`], so there is room. Beyond the end all are 0.
    #[inline(always)]
    fn take(&mut self) {
        let next = self.bytes.get(self.taken..).and_then(|rest| rest.first_chunk());
        let next =
            next.map_or_else(|| last(self.bytes, self.taken), |next: &[u8; 4]| u32::from_be_bytes(*next));
        self.window |= u64::from(next >> (u32::BITS - TAKEN)) << (u32::BITS - TAKEN - self.ahead);
        self.ahead += TAKEN;
        self.taken += TAKEN as usize / 8;
    }

    /// Makes the range 2²⁴ at least, by whole bytes.
    #[inline(always)]
    fn widen(&mut self) {
        // Without a branch: when they are due is as hard to guess as the choices.
        let used = self.range.leading_zeros() & !7;
        self.range <<= used;
        self.window <<= used;
        self.ahead -= used;
        if self.ahead < MOST_USED {
            self.take();
        }
    }

    /// Bytes that were asked for, also beyond the end.
    fn read(&self) -> usize {
        self.taken - self.ahead as usize / 8
    }

    /// Whether just these bytes were needed.
    pub(crate) fn is_complete(&self) -> bool {
        self.read() >= self.bytes.len() && !self.is_exhausted()
    }
}

/// Four bytes from `at` on, the first highest, where there are not as many any more.
#[cold]
fn last(bytes: &[u8], at: usize) -> u32 {
    (at..at + 4).fold(0, |next, at| next << 8 | u32::from(bytes.get(at).copied().unwrap_or(0)))
}

impl Default for Reader<'_> {
    #[inline]
    fn default() -> Self {
        Reader { range: u32::MAX, window: 0, ahead: 0, bytes: &[], taken: 0 }
    }
}

impl Coder for Reader<'_> {
    #[inline(always)]
    fn bit(&mut self, chance: &mut Chance, _: bool) -> bool {
        let bound = (self.range >> 16) * chance.of_one();
        let high = u64::from(bound) << 32;
        // All that follows from it is done on either side, so that a processor guesses once for a choice.
        if self.window < high {
            self.range = bound;
            chance.learn_one();
            self.widen();
            true
        } else {
            self.window -= high;
            self.range -= bound;
            chance.learn_zero();
            self.widen();
            false
        }
    }

    #[inline]
    fn is_exhausted(&self) -> bool {
        self.read() > self.bytes.len() + AHEAD
    }
}

#[cfg(all(test, feature = "publish"))]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Choices with some of eight chances, so that some are learned well and some are not.
    fn choices() -> impl Strategy<Value = Vec<(usize, bool)>> {
        let rare =
            (0usize..8, prop::sample::select(vec![false; 60].into_iter().chain([true]).collect::<Vec<_>>()));
        prop::collection::vec(prop_oneof![(0usize..8, any::<bool>()), rare, Just((7, true))], 0..3000)
    }

    fn write(choices: &[(usize, bool)]) -> Vec<u8> {
        let mut writer = Writer::new(vec![1, 2, 3]);
        let mut chances = [Chance::EVEN; 8];
        for &(at, one) in choices {
            assert_eq!(writer.bit(&mut chances[at], one), one);
        }
        writer.finish().split_off(3)
    }

    proptest! {
        #[test]
        fn reading_inverts_writing(choices in choices()) {
            let bytes = write(&choices);
            let mut reader = Reader::new(&bytes);
            let mut chances = [Chance::EVEN; 8];
            for &(at, one) in &choices {
                prop_assert_eq!(reader.bit(&mut chances[at], !one), one);
                prop_assert!(!reader.is_exhausted());
            }
            prop_assert!(reader.is_complete());
            // Within a byte or two of what the chances allow.
            let mut chances = [Chance::EVEN; 8];
            let mut bits = 0.0;
            for &(at, one) in &choices {
                let share = f64::from(chances[at].of_one()) / 65536.0;
                bits -= (if one { share } else { 1.0 - share }).log2();
                if one { chances[at].learn_one() } else { chances[at].learn_zero() }
            }
            prop_assert!(bytes.len() as f64 <= bits * 1.002 / 8.0 + 2.0, "{} bytes for {bits} bits", bytes.len());
        }

        #[test]
        fn any_bytes_are_read_as_byte_by_byte(bytes in prop::collection::vec(any::<u8>(), 0..60)) {
            let mut reader = Reader::new(&bytes);
            let mut rest = bytes.iter().copied().chain(std::iter::repeat(0)).map(u32::from);
            let (mut range, mut code, mut read) = (u32::MAX, 0u32, 0);
            for _ in 0..4 {
                code = code << 8 | rest.next().unwrap();
                read += 1;
            }
            let (mut ours, mut chances) = ([Chance::EVEN; 4], [Chance::EVEN; 4]);
            for at in 0..400 {
                let chance = &mut chances[at % 4];
                let bound = (range >> 16) * chance.of_one();
                let one = code < bound;
                if one {
                    range = bound;
                    chance.learn_one();
                } else {
                    (code, range) = (code - bound, range - bound);
                    chance.learn_zero();
                }
                while range < 1 << 24 {
                    (range, code) = (range << 8, code << 8 | rest.next().unwrap());
                    read += 1;
                }
                prop_assert_eq!(reader.bit(&mut ours[at % 4], !one), one);
                prop_assert_eq!(reader.read(), read);
                prop_assert_eq!(reader.is_exhausted(), read > bytes.len() + 4);
            }
        }

        #[test]
        fn any_bytes_are_read_and_run_out(bytes in prop::collection::vec(any::<u8>(), 0..50), one: bool) {
            let mut reader = Reader::new(&bytes);
            let mut chances = [Chance::EVEN; 2];
            let mut read = 0;
            while !reader.is_exhausted() && read < 1_000_000 {
                let which = reader.bit(&mut chances[0], one);
                reader.bit(&mut chances[usize::from(which)], one);
                read += 1;
            }
            prop_assert!(reader.is_exhausted() || read == 1_000_000);
            prop_assert!(!reader.is_complete() || !reader.is_exhausted());
        }
    }

    #[test]
    fn a_carry_runs_through_full_bytes() {
        // Zeros lift the lower end towards 1; the last choices lift it over.
        for zeros in 0..200 {
            let choices: Vec<(usize, bool)> =
                (0..zeros).map(|i| (i % 8, false)).chain([(0, true), (1, true), (2, false)]).collect();
            let bytes = write(&choices);
            let mut reader = Reader::new(&bytes);
            let mut chances = [Chance::EVEN; 8];
            assert!(
                choices.iter().all(|&(at, one)| reader.bit(&mut chances[at], false) == one),
                "{zeros} zeros"
            );
        }
    }

    #[test]
    fn equal_choices_cost_next_to_nothing() {
        let bytes = write(&vec![(3, false); 100_000]);
        assert!(bytes.len() < 40, "{} bytes", bytes.len());
    }
}
