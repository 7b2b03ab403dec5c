//! Rectangles in an atlas: squares of 64 × 64 texels, each cut into blocks of one size.

use std::collections::{BTreeMap, BTreeSet};

/// Side of a square, and of the largest block, texels.
pub(super) const SQUARE: u32 = 64;
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

/// Which texels are in use.
#[derive(Debug, Clone)]
pub(super) struct Atlas {
    pub(super) width: u32,
    pub(super) height: u32,
    /// Squares that belong to no size.
    free_squares: BTreeSet<u32>,
    sizes: BTreeMap<[u16; 2], Size>,
}

/// Squares that are cut into one size of blocks.
#[derive(Debug, Clone, Default)]
struct Size {
    /// By square, then by place in it.
    free: BTreeSet<(u32, u32)>,
    used_of_square: BTreeMap<u32, u32>,
}

impl Atlas {
    /// One that holds at least so many texels, if the largest does.
    pub(super) fn new(texels: u64) -> Atlas {
        let fits = |size: &&[u32; 2]| u64::from(size[0]) * u64::from(size[1]) >= texels;
        let [width, height] = *SIZES.iter().find(fits).unwrap_or(&SIZES[SIZES.len() - 1]);
        let squares = (width / SQUARE) * (height / SQUARE);
        Atlas { width, height, free_squares: (0..squares).collect(), sizes: BTreeMap::new() }
    }

    /// A block with sides that are powers of two, 2 … 64; `None` if there is no room.
    pub(super) fn take(&mut self, width: u32, height: u32) -> Option<Block> {
        let key = [width as u16, height as u16];
        let size = self.sizes.entry(key).or_default();
        if size.free.is_empty() {
            let square = self.free_squares.pop_first()?;
            let places = (SQUARE / width) * (SQUARE / height);
            size.free.extend((0..places).map(|place| (square, place)));
        }
        let (square, place) = size.free.pop_first()?;
        *size.used_of_square.entry(square).or_default() += 1;
        let (row, across) = (self.width / SQUARE, SQUARE / width);
        Some(Block {
            x: (square % row * SQUARE + place % across * width) as u16,
            y: (square / row * SQUARE + place / across * height) as u16,
            width: key[0],
            height: key[1],
        })
    }

    /// Gives a block back.
    pub(super) fn give(&mut self, block: Block) {
        let (x, y) = (u32::from(block.x), u32::from(block.y));
        let (width, height) = (u32::from(block.width), u32::from(block.height));
        let square = y / SQUARE * (self.width / SQUARE) + x / SQUARE;
        let place = y % SQUARE / height * (SQUARE / width) + x % SQUARE / width;
        let Some(size) = self.sizes.get_mut(&[block.width, block.height]) else { return };
        size.free.insert((square, place));
        if let Some(used) = size.used_of_square.get_mut(&square) {
            *used -= 1;
            if *used == 0 {
                size.used_of_square.remove(&square);
                size.free.retain(|(other, _)| *other != square);
                self.free_squares.insert(square);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_never_overlap_and_all_room_comes_back() {
        let mut atlas = Atlas::new(1);
        assert_eq!((atlas.width, atlas.height), (256, 256));
        let mut held: Vec<Block> = Vec::new();
        let mut owner = vec![false; 256 * 256];
        let mut state = 1u64;
        let mut next = |below: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % below
        };
        let mark = |owner: &mut Vec<bool>, block: Block, used: bool| {
            for y in block.y..block.y + block.height {
                for x in block.x..block.x + block.width {
                    let texel = &mut owner[usize::from(y) * 256 + usize::from(x)];
                    assert_ne!(*texel, used, "{block:?}");
                    *texel = used;
                }
            }
        };
        for _ in 0..4000 {
            if next(3) > 0 || held.is_empty() {
                if let Some(block) = atlas.take(2 << next(6), 2 << next(6)) {
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
        assert_eq!(atlas.free_squares.len(), 16);
        // Full of the largest: there is no room for more.
        assert_eq!((0..20).filter_map(|_| atlas.take(64, 64)).count(), 16);
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
