//! Changes of lights' visibility ⇄ choices: which lights, which stretches of points, which points, and by how much.
//!
//! Written once for both ends, as a part of a delta ([`crate::codec`]); a snapshot has them as it has other values. `README.md` has the bits.
//!
//! What changes is mostly where the edge of a shadow passes: points go all the way from blocked to open or
//! back, and their neighbours did so just before them in the order, or have what they get already.

mod leans;

use std::ops::Range;

use dapple_store::light_visibility::{Lean, LightChange, LightVisibility, OPEN};
use dapple_store::points::PointLayout;

use crate::codec::entropy::{Chance, Coder, Number};
use crate::codec::{BLOCK, Back, Near, SHARES};
pub(crate) use leans::LeanCoder;
use leans::Leans;

/// Points of a stretch on each level; a stretch is one of the next level's parts.
const LEVELS: [usize; 3] = [1024, BLOCK, LEAF];

/// Points of the smallest stretch.
const LEAF: usize = 8;

/// Codes what of `held` is another in `wanted`, which has as many values, and leans if `held` has; a reader has none. Gives the changes in order, or
/// nothing if the bytes of a reader ended too early.
pub(crate) fn code_light_changes<'a, C: Coder>(
    coder: &mut C,
    (layout, near): (&PointLayout, &mut Near),
    held: &'a LightVisibility,
    wanted: Option<&'a LightVisibility>,
) -> Option<Vec<LightChange>> {
    let points = layout.len();
    if points == 0 {
        return Some(Vec::new());
    }
    let (mut chances, mut changes) = (Chances::new(), Vec::new());
    let mut moved = vec![0i8; points];
    let mut lights = 0;
    for light in 0..held.lights() {
        let first = light as usize * points;
        let planes =
            |of: &'a LightVisibility| Planes { values: of.of_light(light), leans: of.leans_of_light(light) };
        let (held, wanted) = (planes(held), wanted.map(planes));
        let is_coded =
            coder.bit(&mut chances.lights[lights & 3], wanted.is_some_and(|w| w.differs(&held, 0..points)));
        lights = lights << 1 | usize::from(is_coded);
        if coder.is_exhausted() {
            return None;
        }
        if is_coded {
            moved.fill(0);
            let mut walk = Walk {
                coder,
                layout,
                near,
                held,
                wanted,
                first,
                chances: &mut chances,
                flags: [0; LEVELS.len()],
                moved: &mut moved,
                leans: held.leans.to_vec(),
                back: [[0; 4]; BLOCK],
                changes: &mut changes,
            };
            walk.descend(0, 0..points)?;
        }
    }
    Some(changes)
}

/// What is held of one light.
#[derive(Clone, Copy)]
struct Planes<'a> {
    values: &'a [u8],
    /// As many, or none.
    leans: &'a [Lean],
}

impl Planes<'_> {
    fn differs(&self, other: &Planes<'_>, points: Range<usize>) -> bool {
        self.values[points.clone()] != other.values[points.clone()]
            || self.leans.get(points.clone()) != other.leans.get(points)
    }
}

/// One light.
struct Walk<'a, C> {
    coder: &'a mut C,
    layout: &'a PointLayout,
    near: &'a mut Near,
    held: Planes<'a>,
    wanted: Option<Planes<'a>>,
    /// Index of the light's first value.
    first: usize,
    chances: &'a mut Chances,
    /// Of each level: which of the last stretches have changes, the last one lowest.
    flags: [usize; LEVELS.len()],
    /// By how much each point changed.
    moved: &'a mut [i8],
    /// As they are now; none if none are held.
    leans: Vec<Lean>,
    /// Neighbours of the points of the block that is coded.
    back: Back,
    changes: &'a mut Vec<LightChange>,
}

impl<C: Coder> Walk<'_, C> {
    /// Codes which stretches of this level have changes, and these.
    fn descend(&mut self, level: usize, points: Range<usize>) -> Option<()> {
        // Of a stretch that has changes, one part has some.
        let mut is_silent = true;
        for start in points.clone().step_by(LEVELS[level]) {
            let part = start..(start + LEVELS[level]).min(points.end);
            let is_implied = is_silent && part.end == points.end;
            let is_coded = is_implied || {
                let wants = self.wanted.is_some_and(|w| w.differs(&self.held, part.clone()));
                let context = self.flag_context(level, start);
                self.coder.bit(&mut self.chances.flags[level][context], wants)
            };
            self.flags[level] = self.flags[level] << 1 | usize::from(is_coded);
            if !is_coded {
                continue;
            }
            is_silent = false;
            if LEVELS[level] == BLOCK {
                self.back = *self.near.of_block(self.layout, start / BLOCK);
            }
            if level + 1 < LEVELS.len() {
                self.descend(level + 1, part)?;
            } else {
                part.for_each(|point| self.code_point(point));
            }
            if self.coder.is_exhausted() {
                return None;
            }
        }
        Some(())
    }

    fn flag_context(&self, level: usize, start: usize) -> usize {
        let before = self.flags[level] & 3;
        if LEVELS[level] != LEAF {
            return before;
        }
        // How many neighbours of some of its points changed.
        let points = (start..(start + LEAF).min(self.held.values.len())).step_by(3);
        let changed = |point: usize| {
            let back = &self.back[point % BLOCK];
            back.iter().filter(|back| self.moved[point - usize::from(**back)] != 0).count()
        };
        let changed: usize = points.map(changed).sum();
        before * 4 + rank(changed as i32, &[1, 3, 7])
    }

    fn code_point(&mut self, point: usize) {
        let old = i32::from(self.held.values[point]);
        let wanted = self.wanted.map_or(old, |wanted| i32::from(wanted.values[point]));
        let around = self.around(point, old);
        let differs = self.wanted.is_some_and(|wanted| wanted.differs(&self.held, point..point + 1));
        let chances = &mut *self.chances;
        let end = edge(old);
        let some =
            &mut chances.some[rank(around.changed, &[1, 3, 6])][rank(around.gap.abs(), &[4, 32, 96])][end];
        if !self.coder.bit(some, differs) {
            return;
        }
        // Where it lies that is seen may change alone.
        let can_lean = end == 0 && !self.leans.is_empty();
        let change = match can_lean && !self.coder.bit(&mut chances.shares, wanted != old) {
            true => 0,
            false => self.code_change(&around, old, wanted),
        };
        self.moved[point] = change as i8;
        let (index, new) = ((self.first + point) as u32, old + change);
        let old_lean = self.leans.get(point).copied().unwrap_or_default();
        let new_lean = self.code_lean(point, new);
        self.changes.push(LightChange { index, old: old as u8, new: new as u8, old_lean, new_lean });
    }

    /// Codes by how much a value changes that does.
    fn code_change(&mut self, around: &Around, old: i32, wanted: i32) -> i32 {
        let (chances, end) = (&mut *self.chances, edge(old));
        let rises = match end {
            1 => true,
            2 => false,
            _ => {
                let side = |number: i32| (number.signum() + 1) as usize;
                self.coder.bit(&mut chances.rises[side(around.drift)][side(around.gap)], wanted > old)
            }
        };
        let room = if rises { i32::from(OPEN) - old } else { old };
        let size = (wanted - old).abs();
        let size = if room == 1 {
            1
        } else {
            // Whether the neighbours are there, or on the way there.
            let toward = if rises { around.gap } else { -around.gap };
            let near = rank(toward, &[1, 4 * room, 7 * room]);
            let kind = usize::from(end != 0);
            if self.coder.bit(&mut chances.whole[near][kind], size == room) {
                room
            } else {
                let of = &mut chances.size[near.min(2)][kind];
                let most = (room - 2).max(0) as u32;
                1 + of.code(self.coder, (size - 1).clamp(0, most as i32) as u32, most) as i32
            }
        };
        if rises { size } else { -size }
    }

    /// Codes where it lies what is seen of the light from now on.
    fn code_lean(&mut self, point: usize, new: i32) -> Lean {
        if self.leans.is_empty() {
            return Lean::NONE;
        }
        let lean = if edge(new) != 0 {
            Lean::NONE
        } else {
            let before = SHARES.iter().zip(self.back[point % BLOCK]).filter(|(_, back)| *back > 0);
            let before = before.map(|(share, back)| (*share, point - usize::from(back)));
            let (values, moved, leans) = (self.held.values, &*self.moved, &self.leans);
            let neighbours = before
                .filter(|(_, other)| edge(i32::from(values[*other]) + i32::from(moved[*other])) == 0)
                .map(|(share, other)| (share, leans[other]));
            let wanted = self.wanted.map_or(Lean::NONE, |wanted| wanted.leans[point]);
            self.chances.leans.code(self.coder, neighbours, wanted)
        };
        self.leans[point] = lean;
        lean
    }

    fn around(&self, point: usize, old: i32) -> Around {
        let mut around = Around::default();
        for (share, back) in SHARES.iter().zip(self.back[point % BLOCK]) {
            if back == 0 {
                continue;
            }
            let other = point - usize::from(back);
            let moved = i32::from(self.moved[other]);
            around.changed += if moved != 0 { *share } else { 0 };
            around.drift += share * moved;
            around.gap += share * (i32::from(self.held.values[other]) + moved - old);
        }
        around
    }
}

/// What neighbours say, each by its share.
#[derive(Default)]
struct Around {
    /// Share of them that changed, 8ths.
    changed: i32,
    /// How much, 8ths of a step.
    drift: i32,
    /// How far they are above the point as it was, 8ths of a step.
    gap: i32,
}

/// How many of the limits a number reaches.
fn rank(number: i32, limits: &[i32; 3]) -> usize {
    limits.iter().filter(|limit| number >= **limit).count()
}

/// 1 for blocked, 2 for open, 0 between.
fn edge(value: i32) -> usize {
    if value == 0 { 1 } else { 2 * usize::from(value == i32::from(OPEN)) }
}

/// What is learned while changes are coded.
struct Chances {
    lights: [Chance; 4],
    flags: [[Chance; 16]; LEVELS.len()],
    /// By the share of neighbours that changed, how far they are, and at which end the point is.
    some: [[[Chance; 3]; 4]; 4],
    rises: [[Chance; 3]; 3],
    whole: [[Chance; 2]; 4],
    size: [[Number; 2]; 3],
    /// Whether the value changes, or only where it lies what is seen.
    shares: Chance,
    leans: Leans,
}

impl Chances {
    fn new() -> Chances {
        Chances {
            lights: [Chance::EVEN; 4],
            flags: [[Chance::EVEN; 16]; LEVELS.len()],
            some: [[[Chance::EVEN; 3]; 4]; 4],
            rises: [[Chance::EVEN; 3]; 3],
            whole: [[Chance::EVEN; 2]; 4],
            size: [[Number::default(); 2]; 3],
            shares: Chance::EVEN,
            leans: Leans::new(),
        }
    }
}
