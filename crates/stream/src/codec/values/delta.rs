//! Changes ⇄ choices: which stretches of points changed, and how each of their points differs from what its neighbours foretell.
//!
//! Written once for both ends: a [`Guide`] says what is to be written, and is not asked for its opinion by a reader.

use std::ops::Range;

use dapple_store::points::PointLayout;

use super::near::{BLOCK, Near, SHARES};
use super::ranks::{LEAF_RANKS, Of, gap_rank, rank};
use super::start::Chances;
use crate::codec::entropy::{Chance, Coder};

/// Points of a stretch on each level; a stretch is one of the next level's parts.
const LEVELS: [usize; 4] = [4096, 512, BLOCK, LEAF];

/// Points of the smallest stretch: all of them are coded, or none.
pub(crate) const LEAF: usize = 16;

/// Largest share of the neighbours' change that a point can be expected to follow, in 64ths.
pub(crate) const MOST_FOLLOW: u8 = 128;

/// Largest size of a number that neighbours still tell apart.
const MOST_SIZE: i32 = 15;

/// Bits for a sum of sizes, 8ths: at most 8 × [`MOST_SIZE`]. What is above is a sum of changes; one of either fits 16 bits.
const SIZE_BITS: u32 = 7;

/// A point whose visibility changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ValueChange {
    /// Index of the point in the store.
    pub point: u32,
    /// Visibility before, 255 = open.
    pub old: u8,
    /// Visibility now; never the same.
    pub new: u8,
}

/// What a delta's numbers stand for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Scale {
    /// What a number counts, 1 … 255: a value differs from the expected one by this times the number.
    pub(crate) step: u8,
    /// Share of its neighbours' change that a point is expected to follow, 64ths, at most [`MOST_FOLLOW`].
    pub(crate) follow: u8,
}

/// What a writer wants. A reader's may return anything.
pub(crate) trait Guide {
    /// Whether any of these points must be coded; they are a stretch of some level.
    fn wants(&self, points: Range<usize>) -> bool;

    /// The number for a point that is `expected` from a change of its neighbours by `drift` 8ths.
    fn choose(&mut self, point: usize, old: i32, expected: i32, drift: i32) -> i32;
}

/// What is remembered of a delta while it is coded: by block, of those that have changes. Kept to be used again.
#[derive(Clone, Debug, Default)]
pub(crate) struct Scratch {
    /// Where in `cells` a block begins, in blocks; 0 is a block of zeros.
    slots: Vec<u32>,
    used: Vec<u32>,
    /// Per point: its change × 2^[`SIZE_BITS`] + the size of its number.
    cells: Vec<[i16; BLOCK]>,
}

impl Scratch {
    fn clear(&mut self, points: usize) {
        for block in self.used.drain(..) {
            self.slots[block as usize] = 0;
        }
        self.slots.resize(points.div_ceil(BLOCK), 0);
        self.cells.clear();
        self.cells.push([0; BLOCK]);
    }

    fn open(&mut self, block: usize) {
        self.slots[block] = self.cells.len() as u32;
        self.used.push(block as u32);
        self.cells.push([0; BLOCK]);
    }

    fn cell(&self, point: usize) -> i32 {
        cell(&self.slots, &self.cells, point)
    }

    /// Bytes held, by capacity.
    pub(crate) fn bytes(&self) -> usize {
        4 * (self.slots.capacity() + self.used.capacity()) + self.cells.capacity() * size_of::<[i16; BLOCK]>()
    }
}

/// What is remembered of a point.
#[inline]
fn cell(slots: &[u32], cells: &[[i16; BLOCK]], point: usize) -> i32 {
    i32::from(cells[slots[point / BLOCK] as usize][point % BLOCK])
}

/// Codes the changes of `values`. Gives them in order of point, or nothing if the bytes of a reader ended too early.
pub(crate) fn code_changes<C: Coder, G: Guide>(
    coder: &mut C,
    (layout, near): (&PointLayout, &mut Near),
    values: &[u8],
    scale: Scale,
    guide: &mut G,
    scratch: &mut Scratch,
) -> Option<Vec<ValueChange>> {
    scratch.clear(values.len());
    let mut walk = Walk {
        coder,
        layout,
        near,
        values,
        scale,
        guide,
        scratch,
        chances: Chances::START,
        flags: [0; LEVELS.len()],
        changes: Vec::new(),
    };
    walk.descend(0, 0..values.len())?;
    Some(walk.changes)
}

struct Walk<'a, C, G> {
    coder: &'a mut C,
    layout: &'a PointLayout,
    near: &'a mut Near,
    values: &'a [u8],
    scale: Scale,
    guide: &'a mut G,
    scratch: &'a mut Scratch,
    chances: Chances,
    /// Of each level: which of the last stretches have changes, the last one lowest.
    flags: [usize; LEVELS.len()],
    changes: Vec<ValueChange>,
}

impl<C: Coder, G: Guide> Walk<'_, C, G> {
    /// Codes which stretches of this level have changes, and these.
    fn descend(&mut self, level: usize, points: Range<usize>) -> Option<()> {
        let size = LEVELS[level];
        // Of a stretch that has changes, one part has some.
        let mut silent = level > 0;
        for start in points.clone().step_by(size) {
            let part = start..(start + size).min(points.end);
            let implied = silent && part.end == points.end;
            let coded = implied || {
                let wanted = self.guide.wants(part.clone());
                let context = self.flag_context(level, start);
                self.coder.bit(&mut self.chances.flags[level][context], wanted)
            };
            self.flags[level] = self.flags[level] << 1 | usize::from(coded);
            if !coded {
                continue;
            }
            if self.coder.is_exhausted() {
                return None;
            }
            silent = false;
            if size == BLOCK {
                self.scratch.open(start / BLOCK);
            }
            if level + 1 < LEVELS.len() {
                self.descend(level + 1, part)?;
            } else {
                self.code_leaf(part);
            }
        }
        (!self.coder.is_exhausted()).then_some(())
    }

    fn flag_context(&mut self, level: usize, start: usize) -> usize {
        if LEVELS[level] > LEAF {
            return self.flags[level] & 7;
        }
        // How much the neighbours of a quarter of the points have changed so far.
        let back = self.near.of_block(self.layout, start / BLOCK);
        let mut most = 0;
        for point in (start..(start + LEAF).min(self.values.len())).step_by(4) {
            for back in back[point % BLOCK] {
                most = most.max((self.scratch.cell(point - usize::from(back)) >> SIZE_BITS).abs());
            }
        }
        rank(most, &LEAF_RANKS) * 4 + (self.flags[level] & 3)
    }

    /// Codes all points of a smallest stretch.
    fn code_leaf(&mut self, points: Range<usize>) {
        let block = points.start / BLOCK;
        let back = self.near.of_block(self.layout, block);
        let (slots, cells) = (&self.scratch.slots[..], &mut self.scratch.cells[..]);
        let slot = slots[block] as usize;
        let (follow, step) = (i32::from(self.scale.follow), i32::from(self.scale.step));
        // Of what is below 256, times this is divided by the step, in 65,536ths.
        let per_step = (1 << 16) / step + 1;
        let (mut changes, mut count) = ([ValueChange { point: 0, old: 0, new: 0 }; LEAF], 0);
        // A variable of its own, which stays in registers.
        let mut coder = std::mem::take(self.coder);
        for point in points {
            let back = back[point % BLOCK].map(|back| point - usize::from(back));
            let around = back.map(|neighbour| cell(slots, cells, neighbour));
            // Both sums in one: the lower never reaches into the upper.
            let sums: i32 = SHARES.iter().zip(around).map(|(share, cell)| share * cell).sum();
            let (drift, size) = (sums >> SIZE_BITS, sums & ((1 << SIZE_BITS) - 1));
            let old = i32::from(self.values[point]);
            let expected = (old + ((drift * follow + 256) >> 9)).clamp(0, 255);
            let wanted = self.guide.choose(point, old, expected, drift);
            // How far the point was from its neighbours, in 8ths, as they are now.
            let gap = || {
                let now = |j: usize, cell: i32| i32::from(self.values[j]) + (cell >> SIZE_BITS);
                let off = |((share, j), cell): ((&i32, usize), i32)| share * (now(j, cell) - old);
                SHARES.iter().zip(back).zip(around).map(off).sum::<i32>()
            };
            let known = Known { drift, of: Of::point(size, drift), expected, per_step };
            let number = self.chances.code_number(&mut coder, &known, gap, wanted);
            let new = (expected + number * step).clamp(0, 255);
            cells[slot][point % BLOCK] = ((new - old) << SIZE_BITS | number.abs().min(MOST_SIZE)) as i16;
            // Written always, kept if it is a change.
            changes[count % LEAF] = ValueChange { point: point as u32, old: old as u8, new: new as u8 };
            count += usize::from(new != old);
        }
        self.changes.extend_from_slice(&changes[..count]);
        *self.coder = coder;
    }
}

/// What is known of a point before its number is.
struct Known {
    /// How much its neighbours changed, 8ths.
    drift: i32,
    /// Where that, and the size of their numbers, stands.
    of: Of,
    expected: i32,
    /// 65,536 / step, rounded up.
    per_step: i32,
}

impl Chances {
    #[inline(always)]
    fn code_number<C: Coder>(
        &mut self,
        coder: &mut C,
        known: &Known,
        gap: impl FnOnce() -> i32,
        wanted: i32,
    ) -> i32 {
        let &Known { drift, of, expected, per_step } = known;
        let (low, high) = (expected <= 5, expected >= 250);
        let edge = if high { 2 } else { usize::from(low) };
        if !coder.bit(&mut self.some[of.some() + edge], wanted != 0) {
            return 0;
        }
        // Told apart by whether it goes on as the neighbours do, or else towards them.
        let gap = gap();
        let down = if drift == 0 { gap < 0 } else { drift < 0 };
        let gap = if down { -gap } else { gap };
        let (closed, open) = if down { (low, high) } else { (high, low) };
        let edge = if closed { 2 } else { usize::from(open) };
        let sign = gap_rank(gap) * 15 + of.against() + edge;
        let falls = coder.bit(&mut self.against[sign], (wanted < 0) != down) != down;
        let room = if falls { expected } else { 255 - expected };
        // More than brings the value to its end would say nothing.
        let most = ((room.max(1) - 1) * per_step) >> 16;
        let sizes = &mut self.size[of.size()];
        let number = 1 + sizes.code(coder, wanted.unsigned_abs().saturating_sub(1), most as u32) as i32;
        if falls { -number } else { number }
    }
}

/// Chances of the flags of stretches, by level: what the last three were; on the last level, neighbours and the last two.
pub(super) type Flags = [[Chance; 32]; LEVELS.len()];
