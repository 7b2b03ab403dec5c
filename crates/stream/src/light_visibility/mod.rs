//! Changes of lights' visibility ⇄ choices: which lights, which stretches of points, which points, and by how much.
//!
//! Written once for both ends, as a part of a delta ([`crate::codec`]); a snapshot has them as it has other values. `README.md` has the bits.
//!
//! What changes is mostly where the edge of a shadow passes: points go all the way from blocked to open or
//! back, and their neighbours did so just before them in the order, or have what they get already.

use std::ops::Range;

use dapple_store::light_visibility::{LightChange, OPEN};
use dapple_store::points::PointLayout;

use crate::codec::entropy::{Chance, Coder, Number};
use crate::codec::{BLOCK, Back, Near, SHARES};

/// Points of a stretch on each level; a stretch is one of the next level's parts.
const LEVELS: [usize; 3] = [1024, BLOCK, LEAF];

/// Points of the smallest stretch.
const LEAF: usize = 8;

/// Codes what of `held` (light by light) is another in `wanted`, which a reader has not. Gives the changes in order, or nothing if the bytes of a
/// reader ended too early.
pub(crate) fn code_light_changes<C: Coder>(
    coder: &mut C,
    (layout, near): (&PointLayout, &mut Near),
    held: &[u8],
    wanted: Option<&[u8]>,
) -> Option<Vec<LightChange>> {
    let points = layout.len();
    if points == 0 {
        return Some(Vec::new());
    }
    let (mut chances, mut changes) = (Chances::new(), Vec::new());
    let mut moved = vec![0i8; points];
    let mut lights = 0;
    for (light, held) in held.chunks_exact(points).enumerate() {
        let first = light * points;
        let wanted = wanted.map(|wanted| &wanted[first..first + points]);
        let is_coded = coder.bit(&mut chances.lights[lights & 3], wanted.is_some_and(|w| w != held));
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
                back: [[0; 4]; BLOCK],
                changes: &mut changes,
            };
            walk.descend(0, 0..points)?;
        }
    }
    Some(changes)
}

/// One light.
struct Walk<'a, C> {
    coder: &'a mut C,
    layout: &'a PointLayout,
    near: &'a mut Near,
    held: &'a [u8],
    wanted: Option<&'a [u8]>,
    /// Index of the light's first value.
    first: usize,
    chances: &'a mut Chances,
    /// Of each level: which of the last stretches have changes, the last one lowest.
    flags: [usize; LEVELS.len()],
    /// By how much each point changed.
    moved: &'a mut [i8],
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
                let wants = self.wanted.is_some_and(|w| w[part.clone()] != self.held[part.clone()]);
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
        let points = (start..(start + LEAF).min(self.held.len())).step_by(3);
        let changed = |point: usize| {
            let back = &self.back[point % BLOCK];
            back.iter().filter(|back| self.moved[point - usize::from(**back)] != 0).count()
        };
        let changed: usize = points.map(changed).sum();
        before * 4 + rank(changed as i32, &[1, 3, 7])
    }

    fn code_point(&mut self, point: usize) {
        let old = i32::from(self.held[point]);
        let wanted = self.wanted.map_or(old, |wanted| i32::from(wanted[point]));
        let around = self.around(point, old);
        let chances = &mut *self.chances;
        let end = edge(old);
        let some =
            &mut chances.some[rank(around.changed, &[1, 3, 6])][rank(around.gap.abs(), &[4, 32, 96])][end];
        if !self.coder.bit(some, wanted != old) {
            return;
        }
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
        let change = if rises { size } else { -size };
        self.moved[point] = change as i8;
        let index = (self.first + point) as u32;
        self.changes.push(LightChange { index, old: old as u8, new: (old + change) as u8 });
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
            around.gap += share * (i32::from(self.held[other]) + moved - old);
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
        }
    }
}
