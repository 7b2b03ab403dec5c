//! Which points are near a point and coded before it: what its value is foretold from. Whole numbers throughout.

use dapple_store::points::{PackedNormal, PointLayout};

use crate::codec::plane::direction;

/// Points of a block: they are asked for together.
pub(crate) const BLOCK: usize = 64;

/// How many neighbours a point has.
pub(crate) const NEIGHBOURS: usize = 4;

/// What each counts for, the nearest first, in 8ths.
pub(crate) const SHARES: [i32; NEIGHBOURS] = [3, 2, 2, 1];

/// How far neighbours may be, in 2 to the power of the layout's local bits: about the distance of points.
const REACH: u32 = 2;

/// Most blocks that neighbours are looked for in.
const BLOCKS_SEARCHED: usize = 12;

/// How far a neighbour may lie back in the order of points.
const MOST_BACK: usize = u16::MAX as usize;

/// How much farther points with other normals count: as this over 4096 for each squared step between them.
const ALIKE: u64 = 4096;

/// How many points back each neighbour is, for each point of a block. 0: there is none.
pub(crate) type Back = [[u16; NEIGHBOURS]; BLOCK];

/// Neighbours, found when they are first asked for, block by block.
#[derive(Clone, Debug, Default)]
pub(crate) struct Near {
    /// How far neighbours may be, in steps of integer coordinates.
    reach: u32,
    /// Least and largest coordinates of each block.
    boxes: Vec<[[u32; 3]; 2]>,
    /// Where in `found` a block's neighbours are, + 1; 0 while nobody has asked.
    slots: Vec<u32>,
    found: Vec<Back>,
}

impl Near {
    /// Nothing is found yet. `local_bits` are the layout's: 2 to their power is about the distance of points.
    pub(crate) fn new(layout: &PointLayout, local_bits: u32) -> Near {
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
        let slots = vec![0; boxes.len()];
        Near { reach: REACH << local_bits, boxes, slots, found: Vec::new() }
    }

    /// The neighbours of a block's points, kept for the next time.
    pub(crate) fn of_block(&mut self, layout: &PointLayout, block: usize) -> &Back {
        if self.slots[block] == 0 {
            let back = self.find(layout, block);
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
        size_of_val(&self.boxes[..])
            + size_of_val(&self.slots[..])
            + self.found.capacity() * size_of::<Back>()
    }

    /// The neighbours of a block's points.
    pub(crate) fn find(&self, layout: &PointLayout, block: usize) -> Back {
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
            let candidates = self.candidates(set_start, &part, &set.positions, &set.normals);
            for point in part {
                let at = point - set_start;
                let own = Candidate::new(point, set.positions[at], set.normals[at]);
                back[point - start] = own.nearest(&candidates, self.reach);
            }
        }
        back
    }

    /// What may be near points `part` of a set, the last first.
    fn candidates(
        &self,
        set_start: usize,
        part: &std::ops::Range<usize>,
        positions: &[[u32; 3]],
        normals: &[PackedNormal],
    ) -> Vec<Candidate> {
        let own = &positions[part.start - set_start..part.end - set_start];
        let mut around = [[u32::MAX; 3], [0; 3]];
        for axis in 0..3 {
            let along = || own.iter().map(|position| position[axis]);
            around[0][axis] = along().min().unwrap_or(0).saturating_sub(self.reach);
            around[1][axis] = along().max().unwrap_or(0) + self.reach;
        }
        let block = part.start / BLOCK;
        let oldest = (part.end.saturating_sub(MOST_BACK).max(set_start)) / BLOCK;
        let touches = |of: &[[u32; 3]; 2]| {
            (0..3).all(|axis| of[0][axis] <= around[1][axis] && of[1][axis] >= around[0][axis])
        };
        let mut found = Vec::new();
        for block in (oldest..=block).rev().filter(|b| touches(&self.boxes[*b])).take(BLOCKS_SEARCHED) {
            for point in (set_start.max(block * BLOCK)..part.end.min((block + 1) * BLOCK)).rev() {
                let position = positions[point - set_start];
                if touches(&[position, position]) {
                    found.push(Candidate::new(point, position, normals[point - set_start]));
                }
            }
        }
        found
    }
}

struct Candidate {
    point: usize,
    position: [i32; 3],
    normal: [i32; 3],
}

impl Candidate {
    fn new(point: usize, position: [u32; 3], normal: PackedNormal) -> Candidate {
        let normal = direction(normal).map(|c| c as i32);
        Candidate { point, position: position.map(|c| c as i32), normal }
    }

    /// How far the nearest of `candidates` are back that come before this one; the list is in order, the last first.
    /// Where there are fewer than there should be, the nearest counts for them too.
    fn nearest(&self, candidates: &[Candidate], reach: u32) -> [u16; NEIGHBOURS] {
        let mut best = [(u64::from(reach) * u64::from(reach) + 1, 0u16); NEIGHBOURS];
        let before = candidates.partition_point(|other| other.point >= self.point);
        for other in &candidates[before..] {
            let farthest = best[NEIGHBOURS - 1].0;
            // Normals only make it farther.
            let squared = self.squared_distance(other);
            if squared >= farthest {
                continue;
            }
            let distance = self.stretched(other, squared);
            let back = self.point - other.point;
            if distance >= farthest || back > MOST_BACK {
                continue;
            }
            let mut at = NEIGHBOURS - 1;
            while at > 0 && distance < best[at - 1].0 {
                best[at] = best[at - 1];
                at -= 1;
            }
            best[at] = (distance, back as u16);
        }
        let nearest = best[0].1;
        best.map(|(_, back)| if back == 0 { nearest } else { back })
    }

    fn squared_distance(&self, other: &Candidate) -> u64 {
        let step = |axis: usize| i64::from(self.position[axis] - other.position[axis]);
        (step(0) * step(0) + step(1) * step(1) + step(2) * step(2)) as u64
    }

    /// A squared distance, larger the more the normals differ; endless where they are at right angles or more.
    fn stretched(&self, other: &Candidate, squared: u64) -> u64 {
        let (mut turned, mut facing) = (0u64, 0i32);
        for axis in 0..3 {
            let turn = u64::from(self.normal[axis].abs_diff(other.normal[axis]));
            turned += turn * turn;
            facing += self.normal[axis] * other.normal[axis];
        }
        if facing <= 0 { u64::MAX } else { squared * (ALIKE + turned) / ALIKE }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dapple_store::points::{PointSet, morton_code};
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

    proptest! {
        #[test]
        fn neighbours_are_the_nearest_before(sets in prop::collection::vec(points(), 1..4)) {
            let layout = layout(sets);
            let mut near = Near::new(&layout, 3);
            for set in layout.sets() {
                for at in 0..set.len() {
                    let point = set.first as usize + at;
                    let found = near.of_block(&layout, point / BLOCK)[point % BLOCK];
                    let own = Candidate::new(0, set.positions[at], set.normals[at]);
                    // So few points that all blocks are searched; the box around a block holds all that are within reach.
                    let mut all: Vec<(u64, u16)> = (0..at)
                        .map(|other| {
                            let candidate = Candidate::new(0, set.positions[other], set.normals[other]);
                            let squared = own.squared_distance(&candidate);
                            (own.stretched(&candidate, squared), (at - other) as u16)
                        })
                        .filter(|(distance, _)| *distance <= 16 * 16)
                        .collect();
                    all.sort_unstable();
                    let nearest = all.first().map_or(0, |first| first.1);
                    let expected: Vec<u16> =
                        (0..NEIGHBOURS).map(|k| all.get(k).map_or(nearest, |found| found.1)).collect();
                    prop_assert_eq!(&found[..], &expected[..], "point {}", point);
                }
            }
        }
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
