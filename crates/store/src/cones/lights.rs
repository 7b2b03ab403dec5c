//! Which lights a cone's energy came from, in 32 bits.

/// Bits of a [`LightSet`].
pub(super) const LIGHT_SET_BITS: u32 = 32;

/// Set in a set of several lights.
const SEVERAL: u32 = 1 << (LIGHT_SET_BITS - 1);

/// Classes that lights fall into where there are several. A prime: lights that are placed in rows of 2, 4, 8 … do not
/// fall into the same.
const CLASSES: u32 = 31;

/// Lights: none, exactly one, or several. One is known by its index; of several only the classes (index modulo 31) are,
/// so a set may claim to hold a light that it does not, never the other way round.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct LightSet(u32);

impl LightSet {
    /// No light.
    pub const NONE: LightSet = LightSet(0);

    /// One light. An index of 2³¹ − 1 or more is known by its class alone.
    pub fn one(light: u32) -> LightSet {
        if light < SEVERAL - 1 { LightSet(light + 1) } else { LightSet(SEVERAL | 1 << (light % CLASSES)) }
    }

    /// The light, if it is known that there is exactly one.
    pub fn single(self) -> Option<u32> {
        (self.0 & SEVERAL == 0).then(|| self.0.checked_sub(1)).flatten()
    }

    /// Whether the light may be among them; true for every light that is.
    pub fn may_hold(self, light: u32) -> bool {
        match self.single() {
            Some(single) => single == light,
            None => self.classes() >> (light % CLASSES) & 1 == 1,
        }
    }

    /// Whether both may hold the same light; true whenever they do.
    pub fn meets(self, other: LightSet) -> bool {
        match (self.single(), other.single()) {
            (Some(a), Some(b)) => a == b,
            _ => self.classes() & other.classes() != 0,
        }
    }

    /// The lights of both.
    #[must_use]
    pub fn union(self, other: LightSet) -> LightSet {
        if self == other || other == LightSet::NONE {
            self
        } else if self == LightSet::NONE {
            other
        } else {
            LightSet(SEVERAL | self.classes() | other.classes())
        }
    }

    /// The class of a light, 0 … 30: of several, those of a class are not told apart.
    pub fn class_of(light: u32) -> u32 {
        light % CLASSES
    }

    /// The set in 32 bits: the index of a single light + 1; of several, the highest bit and one of each class ([`LightSet::class_of`]).
    pub fn bits(self) -> u32 {
        self.0
    }

    /// From [`LightSet::bits`]. Any bits are a set.
    pub fn from_bits(bits: u32) -> LightSet {
        LightSet(bits)
    }

    /// The class of each light as a bit.
    fn classes(self) -> u32 {
        match self.single() {
            Some(light) => 1 << (light % CLASSES),
            None => self.0 & (SEVERAL - 1),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_set_holds_every_light_that_was_put_in(lights in prop::collection::vec(any::<u32>(), 0..6)) {
            let set = lights.iter().fold(LightSet::NONE, |set, &light| set.union(LightSet::one(light)));
            prop_assert!(lights.iter().all(|&light| set.may_hold(light)));
            prop_assert!(lights.iter().all(|&light| set.meets(LightSet::one(light))));
            prop_assert_eq!(LightSet::from_bits(set.bits()), set);
            if let Some(light) = set.single() {
                prop_assert!(lights.iter().all(|&other| other == light));
            }
        }

        #[test]
        fn order_does_not_matter(a: u32, b: u32, c: u32) {
            let [a, b, c] = [a, b, c].map(LightSet::from_bits);
            prop_assert!(a.union(b).meets(c) || !(a.meets(c) || b.meets(c)));
            prop_assert_eq!(a.union(b), b.union(a));
            prop_assert_eq!(a.meets(c), c.meets(a));
        }
    }

    #[test]
    fn one_light_is_exact_and_several_are_classes() {
        let two = LightSet::one(2).union(LightSet::one(7));
        assert_eq!(LightSet::one(7).single(), Some(7));
        assert!(!LightSet::one(7).may_hold(7 + 31), "one light is no class");
        assert!(two.may_hold(7 + 31) && !two.may_hold(8));
        assert_eq!((two.single(), LightSet::NONE.single()), (None, None));
        assert!(!LightSet::NONE.may_hold(0) && !LightSet::NONE.meets(LightSet::one(0)));
        assert_eq!(LightSet::one(3).union(LightSet::one(3)).single(), Some(3));
    }
}
