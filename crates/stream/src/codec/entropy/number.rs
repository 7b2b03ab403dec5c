//! Whole numbers as choices: one by one while they are small, in powers of two beyond.

use super::{Chance, Coder};

/// Numbers below this are counted out: "is it more?", each time with a chance of its own.
const COUNTED: usize = 8;

/// The chances of numbers of one kind.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Number {
    more: [Chance; COUNTED],
    /// How many bits what is left has.
    longer: [Chance; COUNTED],
}

impl Number {
    /// Chances that were learned before; `more` for numbers up to [`COUNTED`], in 256ths.
    pub(crate) const fn starting_at(more: [u8; COUNTED]) -> Number {
        let mut number = Number { more: [Chance::EVEN; COUNTED], longer: [Chance::EVEN; COUNTED] };
        let mut at = 0;
        while at < COUNTED {
            number.more[at] = Chance::of((more[at] as u16) << 8);
            at += 1;
        }
        number
    }

    /// Codes `value`, which is at most `most`; `most` is below 263. Returns what was coded, never more than `most`.
    #[inline(always)]
    pub(crate) fn code<C: Coder>(&mut self, coder: &mut C, value: u32, most: u32) -> u32 {
        for (at, chance) in (0u32..).zip(&mut self.more) {
            if at == most || !coder.bit(chance, value > at) {
                return at;
            }
        }
        // What is left is written with its highest bit left out: 1, 10, 11, 100, …
        let least = COUNTED as u32;
        let left = value.saturating_sub(least) + 1;
        let mut length = 0;
        while length < COUNTED - 1 && coder.bit(&mut self.longer[length], left >> (length + 1) != 0) {
            length += 1;
        }
        let low = coder.plain(left, length as u32);
        (least + (1 << length | low) - 1).min(most)
    }
}

impl Default for Number {
    fn default() -> Number {
        Number::starting_at([128; COUNTED])
    }
}

#[cfg(all(test, feature = "publish"))]
mod tests {
    use super::*;
    use crate::codec::entropy::{Reader, Writer};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn reading_inverts_writing(numbers in prop::collection::vec((0u32..263, 0u32..263), 0..200)) {
            let mut writer = Writer::new(Vec::new());
            let mut chances = Number::default();
            for (value, most) in &numbers {
                chances.code(&mut writer, (*value).min(*most), *most);
            }
            let bytes = writer.finish();
            let mut reader = Reader::new(&bytes);
            let mut chances = Number::default();
            for (value, most) in &numbers {
                prop_assert_eq!(chances.code(&mut reader, 0, *most), *value.min(most));
            }
            prop_assert!(reader.is_complete());
        }
    }
}
