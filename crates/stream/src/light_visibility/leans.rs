//! Where on a light lies what is seen of it ⇄ choices, one point after the other.

use dapple_store::light_visibility::{LEAN_STEPS, Lean, OPEN};
use dapple_store::points::PointLayout;

use crate::codec::entropy::{Chance, Coder, Number};
use crate::codec::{BLOCK, Candidates, Near, SHARES, unzigzag, zigzag};

/// What is learned of leans while a frame is coded.
pub(super) struct Leans {
    /// By how many neighbours have one, and whether they lean.
    differs: [[Chance; 2]; 3],
    /// Of each axis, the second by whether the first differs.
    axis: [[Number; 2]; 2],
}

impl Leans {
    pub(super) fn new() -> Leans {
        Leans { differs: [[Chance::EVEN; 2]; 3], axis: [[Number::default(); 2]; 2] }
    }

    /// Codes one, foretold from those of neighbours that have one, each with its share in eighths.
    pub(super) fn code<C: Coder>(
        &mut self,
        coder: &mut C,
        neighbours: impl Iterator<Item = (i32, Lean)>,
        wanted: Lean,
    ) -> Lean {
        let (mut sums, mut shares, mut count) = ([0i32; 2], 0, 0);
        for (share, lean) in neighbours {
            (0..2).for_each(|k| sums[k] += share * i32::from(lean.0[k]));
            (shares, count) = (shares + share, count + 1);
        }
        let mean = |sum: i32| if shares > 0 { (2 * sum + shares).div_euclid(2 * shares) as i8 } else { 0 };
        let expected = Lean(sums.map(mean));
        let many = usize::from(count > 0) + usize::from(count > 2);
        let chance = &mut self.differs[many][usize::from(expected != Lean::NONE)];
        if !coder.bit(chance, wanted != expected) {
            return expected;
        }
        let mut found = expected;
        let mut context = 0;
        for k in 0..2 {
            let (from, to) = (expected.0[k] as u8, wanted.0[k] as u8);
            let number = &mut self.axis[k][context];
            let code = number.code(coder, zigzag(to.wrapping_sub(from)).into(), 4 * LEAN_STEPS as u32);
            let step = from.wrapping_add(unzigzag(code as u8)) as i8;
            found.0[k] = step.clamp(-LEAN_STEPS, LEAN_STEPS);
            context = usize::from(code != 0);
        }
        found
    }
}

/// Codes leans of whole lights, as a snapshot has them.
pub(crate) struct LeanCoder {
    leans: Leans,
    some: Chance,
    candidates: Candidates,
}

impl LeanCoder {
    pub(crate) fn new() -> LeanCoder {
        LeanCoder { leans: Leans::new(), some: Chance::EVEN, candidates: Candidates::default() }
    }

    /// Codes those of one light, whose values are known; a reader has none `wanted`. Nothing if its bytes end too early.
    pub(crate) fn code_all<C: Coder>(
        &mut self,
        coder: &mut C,
        (layout, near): (&PointLayout, &Near),
        values: &[u8],
        wanted: Option<&[Lean]>,
    ) -> Option<Vec<Lean>> {
        let mut found = vec![Lean::NONE; values.len()];
        let some = wanted.is_some_and(|wanted| wanted.iter().any(|lean| *lean != Lean::NONE));
        if !coder.bit(&mut self.some, some) {
            return (!coder.is_exhausted()).then_some(found);
        }
        let has = |value: u8| value > 0 && value < OPEN;
        for (block, of_block) in values.chunks(BLOCK).enumerate() {
            if !of_block.iter().any(|value| has(*value)) {
                continue;
            }
            let back = near.neighbours(layout, block, &mut self.candidates);
            for point in (block * BLOCK..).take(of_block.len()).filter(|point| has(values[*point])) {
                let before = SHARES.iter().zip(back[point % BLOCK]).filter(|(_, back)| *back > 0);
                let before = before.map(|(share, back)| (*share, point - usize::from(back)));
                let before = before.filter(|(_, other)| has(values[*other]));
                let neighbours = before.map(|(share, other)| (share, found[other]));
                let lean = wanted.map_or(Lean::NONE, |wanted| wanted[point]);
                found[point] = self.leans.code(coder, neighbours, lean);
            }
            if coder.is_exhausted() {
                return None;
            }
        }
        Some(found)
    }
}
