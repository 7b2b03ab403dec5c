//! Which points are near a point and coded before it: what its value is foretold from. Whole numbers throughout.

use std::ops::Range;

use dapple_store::points::{PointLayout, PointSet};

use super::nearest::{BLOCKS_SEARCHED, Bounds, Candidates, MOST_BACK, touches};

/// Points of a block: they are asked for together.
pub(crate) const BLOCK: usize = 64;

/// How many neighbours a point has.
pub(crate) const NEIGHBOURS: usize = 4;

/// What each counts for, the nearest first, in 8ths.
pub(crate) const SHARES: [i32; NEIGHBOURS] = [3, 2, 2, 1];

/// How far neighbours may be, in 2 to the power of the layout's local bits: about the distance of points.
const REACH: u32 = 2;

/// Blocks whose boxes lie in one larger box.
const CLUSTER: usize = 16;

/// How many points back each neighbour is, for each point of a block. 0: there is none.
pub(crate) type Back = [[u16; NEIGHBOURS]; BLOCK];

/// Neighbours, found when they are first asked for, block by block.
#[derive(Clone, Debug)]
pub(crate) struct Near {
    blocks: Blocks,
    /// Where in `found` a block's neighbours are, + 1; 0 while nobody has asked.
    slots: Vec<u32>,
    found: Vec<Back>,
    candidates: Candidates,
}

/// Where the blocks of a layout lie.
#[derive(Clone, Debug)]
pub(super) struct Blocks {
    /// How far neighbours may be, in steps of integer coordinates.
    reach: u32,
    /// Least and largest coordinates of each block.
    boxes: Vec<Bounds>,
    /// The same of each [`CLUSTER`] of blocks.
    clusters: Vec<Bounds>,
}

impl Near {
    /// Nothing is found yet. `local_bits` are the layout's: 2 to their power is about the distance of points.
    pub(crate) fn new(layout: &PointLayout, local_bits: u32) -> Near {
        let blocks = Blocks::new(layout, local_bits);
        let slots = vec![0; blocks.boxes.len()];
        Near { blocks, slots, found: Vec::new(), candidates: Candidates::default() }
    }

    /// Where the blocks lie, to find neighbours without keeping them.
    pub(super) fn blocks(&self) -> &Blocks {
        &self.blocks
    }

    /// The neighbours of a block's points, found anew.
    pub(crate) fn neighbours(&self, layout: &PointLayout, block: usize, candidates: &mut Candidates) -> Back {
        self.blocks.find(layout, block, candidates)
    }

    /// The neighbours of a block's points, kept for the next time.
    pub(crate) fn of_block(&mut self, layout: &PointLayout, block: usize) -> &Back {
        if self.slots[block] == 0 {
            let back = self.blocks.find(layout, block, &mut self.candidates);
            if self.found.len() == self.found.capacity() {
                // Sparingly: it stays.
                self.found.reserve_exact((self.found.len() / 8).max(16));
            }
            self.found.push(back);
            self.slots[block] = self.found.len() as u32;
        }
        &self.found[self.slots[block] as usize - 1]
    }

    /// Bytes held, by capacity.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(&self.blocks.boxes[..])
            + size_of_val(&self.blocks.clusters[..])
            + size_of_val(&self.slots[..])
            + self.found.capacity() * size_of::<Back>()
            + self.candidates.bytes()
    }
}

impl Blocks {
    fn new(layout: &PointLayout, local_bits: u32) -> Blocks {
        let mut boxes = vec![[[u32::MAX; 3], [0; 3]]; layout.len().div_ceil(BLOCK)];
        for set in layout.sets() {
            for (point, position) in (set.first as usize..).zip(&set.positions) {
                let [low, high] = &mut boxes[point / BLOCK];
                for axis in 0..3 {
                    low[axis] = low[axis].min(position[axis]);
                    high[axis] = high[axis].max(position[axis]);
                }
            }
        }
        let join = |boxes: &[Bounds]| {
            boxes.iter().fold([[u32::MAX; 3], [0; 3]], |[low, high], [l, h]| {
                [[0, 1, 2].map(|axis| low[axis].min(l[axis])), [0, 1, 2].map(|axis| high[axis].max(h[axis]))]
            })
        };
        let clusters = boxes.chunks(CLUSTER).map(join).collect();
        Blocks { reach: REACH << local_bits, boxes, clusters }
    }

    /// The neighbours of a block's points.
    pub(super) fn find(&self, layout: &PointLayout, block: usize, candidates: &mut Candidates) -> Back {
        let mut back = [[0; NEIGHBOURS]; BLOCK];
        let (start, end) = (block * BLOCK, ((block + 1) * BLOCK).min(layout.len()));
        let sets = layout.sets();
        let first = sets.partition_point(|set| set.first as usize + set.len() <= start);
        for set in sets[first..].iter().take_while(|set| (set.first as usize) < end) {
            let set_start = set.first as usize;
            let part = start.max(set_start)..end.min(set_start + set.len());
            if part.is_empty() {
                continue;
            }
            let points = part.len();
            self.gather(set, part, candidates);
            candidates.nearest(points, self.reach, |point, nearest| {
                back[set_start + point as usize - start] = nearest;
            });
        }
        back
    }

    /// Finds what may be near points `part` of a set: these themselves first, the last of them at the beginning.
    fn gather(&self, set: &PointSet, part: Range<usize>, candidates: &mut Candidates) {
        let set_start = set.first as usize;
        let mut around = [[u32::MAX; 3], [0; 3]];
        for position in &set.positions[part.start - set_start..part.end - set_start] {
            for axis in 0..3 {
                around[0][axis] = around[0][axis].min(position[axis]);
                around[1][axis] = around[1][axis].max(position[axis]);
            }
        }
        around[0] = around[0].map(|low| low.saturating_sub(self.reach));
        around[1] = around[1].map(|high| high + self.reach);
        let oldest = (part.end.saturating_sub(MOST_BACK).max(set_start)) / BLOCK;
        let newest = part.start / BLOCK;
        let clusters = (oldest / CLUSTER..=newest / CLUSTER).rev();
        let blocks =
            clusters.filter(|cluster| touches(&self.clusters[*cluster], &around)).flat_map(|cluster| {
                (oldest.max(cluster * CLUSTER)..=newest.min(cluster * CLUSTER + CLUSTER - 1)).rev()
            });
        candidates.clear();
        for block in blocks.filter(|block| touches(&self.boxes[*block], &around)).take(BLOCKS_SEARCHED) {
            let points = set_start.max(block * BLOCK)..part.end.min((block + 1) * BLOCK);
            candidates.add(&set.positions, points.start - set_start..points.end - set_start, &around);
        }
        candidates.arrange(set);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::plane::direction;
    use dapple_store::points::{PackedNormal, morton_code};
    use proptest::prelude::*;

    type Points = Vec<([u32; 3], [u8; 2])>;

    fn layout(sets: Vec<Points>) -> PointLayout {
        let set = |(instance, mut points): (usize, Points)| {
            points.sort_by_key(|&(position, normal)| (morton_code(position), normal));
            PointSet {
                instance: instance as u32,
                positions: points.iter().map(|point| point.0).collect(),
                normals: points.iter().map(|point| PackedNormal(point.1)).collect(),
                ..PointSet::default()
            }
        };
        PointLayout::new(1.0, 8.0, sets.into_iter().enumerate().map(set).collect()).unwrap()
    }

    fn points() -> impl Strategy<Value = Points> {
        let normal = prop_oneof![Just([127, 127]), Just([127, 140]), Just([127, 254]), any::<[u8; 2]>()];
        prop::collection::vec((prop::array::uniform3(0u32..60), normal), 0..150)
    }

    /// As `docs/wire.md` has it; endless where the normals are at right angles or more.
    fn distance(set: &PointSet, a: usize, b: usize) -> u64 {
        let dot = |a: [i64; 3], b: [i64; 3]| (0..3).map(|axis| a[axis] * b[axis]).sum::<i64>();
        let less = |a: [i64; 3], b: [i64; 3]| [0, 1, 2].map(|axis| a[axis] - b[axis]);
        let [p, q] = [a, b].map(|point| set.positions[point].map(i64::from));
        let [m, n] = [a, b].map(|point| direction(set.normals[point]));
        let (step, turn) = (less(p, q), less(m, n));
        if dot(m, n) > 0 { (dot(step, step) * (4096 + dot(turn, turn)) / 4096) as u64 } else { u64::MAX }
    }

    /// The neighbours of a block's points, word for word as `docs/wire.md` has them, and how many blocks are left out.
    fn naive(layout: &PointLayout, reach: u64, block: usize) -> (Back, usize) {
        let mut back = [[0; NEIGHBOURS]; BLOCK];
        let mut left_out = 0;
        let block_of = |set: &PointSet, at: usize| (set.first as usize + at) / BLOCK;
        let bounds = |block: usize| {
            let points = layout.sets().iter().flat_map(|set| {
                (0..set.len()).filter(move |at| block_of(set, *at) == block).map(|at| set.positions[at])
            });
            let points: Vec<_> = points.collect();
            [0, 1, 2].map(|axis| {
                let along = || points.iter().map(|point| i64::from(point[axis]));
                (along().min().unwrap(), along().max().unwrap())
            })
        };
        for set in layout.sets() {
            let own: Vec<usize> = (0..set.len()).filter(|at| block_of(set, *at) == block).collect();
            let Some(&end) = own.last() else { continue };
            let around = [0, 1, 2].map(|axis| {
                let along = || own.iter().map(|at| i64::from(set.positions[*at][axis]));
                (along().min().unwrap() - reach as i64, along().max().unwrap() + reach as i64)
            });
            let touches =
                |of: &[(i64, i64); 3]| (0..3).all(|k| of[k].0 <= around[k].1 && of[k].1 >= around[k].0);
            let oldest = block_of(set, (end + 1).saturating_sub(65_535));
            let touching: Vec<usize> =
                (oldest..=block).rev().filter(|other| touches(&bounds(*other))).collect();
            let searched = &touching[..touching.len().min(12)];
            left_out += touching.len() - searched.len();
            for at in own {
                let mut all: Vec<(u64, u16)> = (0..at)
                    .filter(|other| searched.contains(&block_of(set, *other)))
                    .filter(|other| touches(&set.positions[*other].map(|c| (c.into(), c.into()))))
                    .map(|other| (distance(set, at, other), (at - other) as u16))
                    .filter(|(distance, _)| *distance <= reach * reach)
                    .collect();
                all.sort_unstable();
                let nearest = all.first().map_or(0, |first| first.1);
                let found = |k: usize| all.get(k).map_or(nearest, |found| found.1);
                back[set.first as usize + at - block * BLOCK] = [0, 1, 2, 3].map(found);
            }
        }
        (back, left_out)
    }

    proptest! {
        #[test]
        fn neighbours_are_the_nearest_before(sets in prop::collection::vec(points(), 1..4)) {
            let layout = layout(sets);
            let mut near = Near::new(&layout, 3);
            for block in 0..layout.len().div_ceil(BLOCK) {
                prop_assert_eq!(*near.of_block(&layout, block), naive(&layout, 16, block).0, "block {}", block);
            }
        }
    }

    #[test]
    fn neighbours_in_a_crowd_are_those_of_the_last_blocks_that_touch() {
        let mut random = 1u64;
        let mut below = |n: u64| {
            random = random.wrapping_mul(0x5851_f42d_4c95_7f2d).wrapping_add(0x1405_7b7e_f767_814f);
            (random >> 33) as u32 % n as u32
        };
        // Crowded or wide, a whole solid or nearly a plane, small or as large as it can be.
        let mut left_out = 0;
        for (size, height, shift) in
            [(40, 40, 0), (300, 3, 0), (60, 2, 0), (120, 120, 0), (1 << 20, 9, 1 << 20)]
        {
            let mut some = |count| -> Points {
                let mut point = || {
                    let position = [below(size), below(height), below(size)].map(|c| c + shift);
                    (position, [127 + (below(3) * 30) as u8, 127])
                };
                (0..count).map(|_| point()).collect()
            };
            let layout = layout(vec![some(1500), some(70), some(5), some(1000)]);
            for local_bits in [1, 3, 8] {
                let mut near = Near::new(&layout, local_bits);
                for block in (0..layout.len().div_ceil(BLOCK)).rev() {
                    let (expected, left) = naive(&layout, 2 << local_bits, block);
                    assert_eq!(*near.of_block(&layout, block), expected, "size {size}, block {block}");
                    left_out += left;
                }
            }
        }
        assert!(left_out > 0);
    }

    #[test]
    fn points_of_other_sets_and_of_the_other_side_are_no_neighbours() {
        let up = |x: u32| ([x, 5, 5], [127, 127]);
        let down = |x: u32| ([x, 5, 5], [0, 0]);
        let layout = layout(vec![vec![up(1), down(2), up(3)], vec![up(2)]]);
        let back = *Near::new(&layout, 3).of_block(&layout, 0);
        assert_eq!(back[..4], [[0; 4], [0; 4], [2; 4], [0; 4]]);
    }
}
