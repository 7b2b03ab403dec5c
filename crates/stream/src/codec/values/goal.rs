//! What a writer wants: values near the true ones, with numbers as small as that allows.

use std::ops::Range;

use super::delta::{Guide, LEAF, MOST_FOLLOW, Scale};

/// Which share of its neighbours' change a point follows, learned from the deltas so far.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Fit {
    /// Sums over points of drift × change and drift × drift, both in 8ths.
    along: i64,
    square: i64,
}

/// What is taken before anything is known, 64ths.
const FIRST_FOLLOW: i64 = 58;

/// How much the first guess counts for: as so much squared drift (8ths).
const FIRST_WEIGHT: i64 = 1 << 16;

impl Default for Fit {
    fn default() -> Fit {
        Fit { along: FIRST_FOLLOW * FIRST_WEIGHT / 64, square: FIRST_WEIGHT }
    }
}

impl Fit {
    /// The best share so far, 64ths.
    pub(crate) fn follow(&self) -> u8 {
        ((64 * self.along + self.square / 2) / self.square).clamp(0, MOST_FOLLOW.into()) as u8
    }

    /// Takes in what came out of one more delta; what is older counts for less.
    pub(crate) fn learn(&mut self, goal: &Goal<'_>) {
        let first = Fit::default();
        for (sum, (seen, first)) in
            [(&mut self.along, (goal.along, first.along)), (&mut self.square, (goal.square, first.square))]
        {
            *sum = (*sum - first) * 3 / 4 + seen + first;
        }
    }
}

/// How far off what subscribers hold may be, 255ths: more than any difference in a stretch that is not to be coded.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Tolerances<'a> {
    /// Everywhere.
    Even(u8),
    /// For each of the smallest stretches.
    Each(&'a [u8]),
}

impl Tolerances<'_> {
    fn of_leaf(&self, leaf: usize) -> u8 {
        match self {
            Tolerances::Even(tolerance) => *tolerance,
            Tolerances::Each(tolerances) => tolerances[leaf],
        }
    }
}

/// Values that a delta is to bring subscribers near to.
#[derive(Debug)]
pub(crate) struct Goal<'a> {
    values: &'a [u8],
    tolerances: Tolerances<'a>,
    step: i32,
    /// Which of the smallest stretches hold a point that is too far off.
    leaves: Vec<bool>,
    along: i64,
    square: i64,
}

impl<'a> Goal<'a> {
    /// From values `held` to `values`; `None` where none is farther off than it may be. `step` is at most
    /// 2 × the least tolerance + 1, so that every value can be brought as near.
    pub(crate) fn new(
        held: &[u8],
        values: &'a [u8],
        tolerances: Tolerances<'a>,
        step: u8,
    ) -> Option<Goal<'a>> {
        let far = |(leaf, (a, b)): (usize, (&[u8], &[u8]))| {
            // No early end, so that it is done many points at a time.
            a.iter().zip(b).fold(0, |most, (a, b)| most.max(a.abs_diff(*b))) > tolerances.of_leaf(leaf)
        };
        let leaves: Vec<bool> = held.chunks(LEAF).zip(values.chunks(LEAF)).enumerate().map(far).collect();
        leaves.contains(&true).then_some(Goal {
            values,
            tolerances,
            step: step.into(),
            leaves,
            along: 0,
            square: 0,
        })
    }

    /// The scale of a delta to this goal.
    pub(crate) fn scale(&self, fit: &Fit) -> Scale {
        Scale { step: self.step as u8, follow: fit.follow() }
    }
}

impl Guide for Goal<'_> {
    fn wants(&self, points: Range<usize>) -> bool {
        self.leaves[points.start / LEAF..points.end.div_ceil(LEAF)].contains(&true)
    }

    fn choose(&mut self, point: usize, old: i32, expected: i32, drift: i32) -> i32 {
        let value = i32::from(self.values[point]);
        if drift != 0 {
            let drift = i64::from(drift);
            self.along += drift * i64::from(8 * (value - old));
            self.square += drift * drift;
        }
        let off = value - expected;
        let size = off.abs();
        let tolerance = i32::from(self.tolerances.of_leaf(point / LEAF));
        if size <= tolerance {
            return 0;
        }
        // The smallest number that comes near enough.
        (size - tolerance + self.step - 1) / self.step * off.signum()
    }
}
