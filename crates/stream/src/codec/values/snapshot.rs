//! All values ⇄ choices: which values there are, and how far each point's is from what its neighbours foretell.
//!
//! Values are counted by their place among those that occur: of 64 rays only 65 values can come, and what cannot come should
//! cost nothing.

use dapple_store::points::PointLayout;

use super::near::{BLOCK, Near, SHARES};
use super::nearest::Candidates;
use crate::codec::entropy::{Chance, Coder, Number};

/// What is learned while values are coded.
struct Chances {
    occurs: [Chance; 4],
    some: [[Chance; 3]; 10],
    falls: [[Chance; 3]; 3],
    size: [Number; 10],
}

/// Codes the values of all points; `wanted` are those to write, and are ignored by a reader. Gives what was coded, or says
/// what is wrong with the bytes of a reader.
pub(crate) fn code_values<C: Coder>(
    coder: &mut C,
    layout: &PointLayout,
    near: &Near,
    wanted: impl Fn(usize) -> u8,
) -> Result<Vec<u8>, &'static str> {
    let points = layout.len();
    let mut occurs = [false; 256];
    (0..points).for_each(|point| occurs[usize::from(wanted(point))] = true);
    let mut chances = Chances {
        occurs: [Chance::EVEN; 4],
        some: [[Chance::EVEN; 3]; 10],
        falls: [[Chance::EVEN; 3]; 3],
        size: [Number::default(); 10],
    };
    if points == 0 {
        return Ok(Vec::new());
    }
    // The values that occur in order, and the place of each among them.
    let (mut palette, mut places, mut flags) = (Vec::new(), [0u8; 256], 0);
    for value in 0..=u8::MAX {
        let one = coder.bit(&mut chances.occurs[flags & 3], occurs[usize::from(value)]);
        flags = flags << 1 | usize::from(one);
        if one {
            places[usize::from(value)] = palette.len() as u8;
            palette.push(value);
        }
    }
    // Who claims many planes and sends none is found out here, not after all of them.
    if coder.is_exhausted() {
        return Err("end early");
    }
    let top = match palette[..] {
        [] => return Err("are none"),
        [only] => return Ok(vec![only; points]),
        _ => palette.len() as i32 - 1,
    };
    let mut coded: Vec<u8> = Vec::new();
    let mut candidates = Candidates::default();
    for start in (0..points).step_by(BLOCK) {
        let back = near.blocks().find(layout, start / BLOCK, &mut candidates);
        for point in start..points.min(start + BLOCK) {
            // Who has no neighbours takes the point before.
            let neighbours = back[point - start].map(|back| match back {
                0 => coded.last().copied().map_or(top, i32::from),
                back => i32::from(coded[point - usize::from(back)]),
            });
            let place = chances.code(coder, neighbours, top, places[usize::from(wanted(point))].into());
            coded.push(place as u8);
        }
        if coder.is_exhausted() {
            return Err("end early");
        }
    }
    coded.iter_mut().for_each(|place| *place = palette[usize::from(*place)]);
    Ok(coded)
}

impl Chances {
    /// Codes one place, 0 … `top`.
    fn code<C: Coder>(&mut self, coder: &mut C, neighbours: [i32; 4], top: i32, wanted: i32) -> i32 {
        let expected = (SHARES.iter().zip(neighbours).map(|(share, v)| share * v).sum::<i32>() + 4) >> 3;
        let spread: i32 = SHARES.iter().zip(neighbours).map(|(share, v)| share * (v - expected).abs()).sum();
        let kind = [1, 3, 6, 10, 16, 24, 36, 56, 90].iter().filter(|limit| spread >= **limit).count();
        let edge = if expected == top { 2 } else { usize::from(expected == 0) };
        if !coder.bit(&mut self.some[kind][edge], wanted != expected) {
            return expected;
        }
        let falls = match expected {
            0 => false,
            _ if expected == top => true,
            _ => {
                let leans = |limit| usize::from(neighbours[0] >= expected + limit);
                let chance = &mut self.falls[leans(0) + leans(1)][usize::from(expected * 2 > top)];
                coder.bit(chance, wanted < expected)
            }
        };
        let room = if falls { expected } else { top - expected };
        let off = (wanted - expected).unsigned_abs().saturating_sub(1);
        let off = 1 + self.size[kind].code(coder, off, room as u32 - 1) as i32;
        if falls { expected - off } else { expected + off }
    }
}
