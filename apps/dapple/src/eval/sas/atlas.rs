//! Rectangles in an atlas, by halving: each block is the atlas, or half of another, or a half of that.

use std::collections::{BTreeMap, BTreeSet};

/// Longest side of a block, texels.
pub(super) const MOST_SIDE: u32 = 256;
/// Least side of a block, texels.
pub(super) const LEAST_SIDE: u32 = 2;

/// Sizes of atlases, texels: the first that is large enough is taken. Video codecs in real time go no further.
const SIZES: [[u32; 2]; 7] =
    [[256, 256], [512, 256], [512, 512], [1024, 512], [1024, 1024], [2048, 1024], [2048, 2048]];

/// A block of texels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(in crate::eval) struct Block {
    pub(super) x: u16,
    pub(super) y: u16,
    pub(super) width: u16,
    pub(super) height: u16,
}

impl Block {
    fn size(self) -> [u16; 2] {
        [self.width, self.height]
    }

    /// Both halves along the axis.
    fn halves(self, axis: usize) -> [Block; 2] {
        let mut halves = [self; 2];
        if axis == 0 {
            halves.iter_mut().for_each(|half| half.width /= 2);
            halves[1].x += halves[0].width;
        } else {
            halves.iter_mut().for_each(|half| half.height /= 2);
            halves[1].y += halves[0].height;
        }
        halves
    }
}

/// Which texels are in use.
#[derive(Debug, Clone)]
pub(super) struct Atlas {
    pub(super) width: u32,
    pub(super) height: u32,
    /// By size.
    free: BTreeMap<[u16; 2], BTreeSet<Block>>,
    /// For every half what it is a half of.
    whole: BTreeMap<Block, Block>,
}

impl Atlas {
    /// One that holds at least so many texels, if the largest does.
    pub(super) fn new(texels: u64) -> Atlas {
        let fits = |size: &&[u32; 2]| u64::from(size[0]) * u64::from(size[1]) >= texels;
        let [width, height] = *SIZES.iter().find(fits).unwrap_or(&SIZES[SIZES.len() - 1]);
        let all = Block { x: 0, y: 0, width: width as u16, height: height as u16 };
        Atlas { width, height, free: [(all.size(), [all].into())].into(), whole: BTreeMap::new() }
    }

    /// A block with sides that are powers of two, 2 … 256; `None` if there is no room.
    pub(super) fn take(&mut self, width: u32, height: u32) -> Option<Block> {
        let wanted = [width as u16, height as u16];
        // Of the smallest blocks that are large enough the first.
        let large_enough = |size: &&[u16; 2]| size[0] >= wanted[0] && size[1] >= wanted[1];
        let area = |size: &[u16; 2]| u32::from(size[0]) * u32::from(size[1]);
        let size = *self.free.keys().filter(large_enough).min_by_key(|size| area(size))?;
        let mut block = self.free.get(&size)?.first().copied()?;
        self.remove(block);
        while block.size() != wanted {
            // Across the side that is the longer one beside what is wanted, so that what is left is as square.
            let over = [0, 1].map(|axis| block.size()[axis] / wanted[axis]);
            let halves = block.halves(usize::from(over[1] > over[0]));
            self.whole.extend(halves.map(|half| (half, block)));
            self.insert(halves[1]);
            block = halves[0];
        }
        Some(block)
    }

    /// Gives a block back.
    pub(super) fn give(&mut self, block: Block) {
        let mut block = block;
        while let Some(&whole) = self.whole.get(&block) {
            let axis = usize::from(whole.width == block.width);
            let halves = whole.halves(axis);
            let other = if halves[0] == block { halves[1] } else { halves[0] };
            if !self.free.get(&other.size()).is_some_and(|free| free.contains(&other)) {
                break;
            }
            self.remove(other);
            for half in halves {
                self.whole.remove(&half);
            }
            block = whole;
        }
        self.insert(block);
    }

    fn insert(&mut self, block: Block) {
        self.free.entry(block.size()).or_default().insert(block);
    }

    fn remove(&mut self, block: Block) {
        if let Some(free) = self.free.get_mut(&block.size()) {
            free.remove(&block);
            if free.is_empty() {
                self.free.remove(&block.size());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_never_overlap_and_all_room_comes_back() {
        let mut atlas = Atlas::new(1 << 20);
        assert_eq!((atlas.width, atlas.height), (1024, 1024));
        let mut held: Vec<Block> = Vec::new();
        let mut owner = vec![false; 1024 * 1024];
        let mut state = 1u64;
        let mut next = |below: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % below
        };
        let mark = |owner: &mut Vec<bool>, block: Block, used: bool| {
            for y in block.y..block.y + block.height {
                for x in block.x..block.x + block.width {
                    let texel = &mut owner[usize::from(y) * 1024 + usize::from(x)];
                    assert_ne!(*texel, used, "{block:?}");
                    *texel = used;
                }
            }
        };
        for _ in 0..4000 {
            if next(3) > 0 || held.is_empty() {
                if let Some(block) = atlas.take(2 << next(8), 2 << next(8)) {
                    mark(&mut owner, block, true);
                    held.push(block);
                }
            } else {
                let block = held.swap_remove(next(held.len() as u64) as usize);
                mark(&mut owner, block, false);
                atlas.give(block);
            }
        }
        for block in held {
            atlas.give(block);
        }
        assert!(atlas.whole.is_empty() && atlas.free.len() == 1, "all halves are whole again");
        // Full of the largest: there is no room for more.
        assert_eq!((0..20).filter_map(|_| atlas.take(256, 256)).count(), 16);
        assert_eq!(atlas.take(2, 2), None);
    }

    #[test]
    fn the_smallest_that_fits_is_taken() {
        for (texels, size) in [(65_537, [512, 256]), (1 << 20, [1024, 1024]), (u64::MAX, [2048, 2048])] {
            let atlas = Atlas::new(texels);
            assert_eq!([atlas.width, atlas.height], size);
        }
    }
}
