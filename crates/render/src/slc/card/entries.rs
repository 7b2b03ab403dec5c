//! The cache as texels: entries in the order of blocks, and a hash table of these. `read.wgsl` reads both.
//!
//! An entry is [`ENTRY_TEXELS`] texels of four words. Two say where it is: position and normal; shading normal, and in one word cones, and whether it
//! has samples. Of each cone two follow: energy and mean cosine; direction, cosine of its angle, part of its light that is seen through it,
//! and in one word which light that is and what else a [`TableCap`] tells; of several lights, which classes these are of. Normals and directions are octahedral, 16 bits a coordinate.

use dapple_store::cones::{
    BLOCK_TEXELS, BlockKey, ConeEntry, EntrySite, LightSet, MOST_MOMENT_CONES, MomentEntry,
};
use dapple_store::octahedral::flatten;
use glam::Vec3;

use super::super::CapTable;
use super::super::table::TableCap;
use super::{CardError, Texel};

/// Texels of an entry.
const ENTRY_TEXELS: usize = 2 + 2 * MOST_MOMENT_CONES;
/// Blocks of a row: as many as WebGL2's narrowest textures hold.
const BLOCKS_A_ROW: usize = 3;
/// Texels of a block.
const BLOCK_WIDTH: usize = BLOCK_TEXELS * ENTRY_TEXELS;
/// Texels of a row.
pub(super) const ROW_TEXELS: usize = BLOCKS_A_ROW * BLOCK_WIDTH;
/// Places of a row of the hash table, two texels each.
const HASH_A_ROW: usize = 1024;
/// Most blocks that it holds: half of the places of as many rows as WebGL2's textures have.
const MOST_HASHED: usize = HASH_A_ROW * 2048 / 2;
/// Texels of such a row.
pub(super) const HASH_ROW_TEXELS: usize = 2 * HASH_A_ROW;
/// How far a block may lie from the place that it hashes to.
const MOST_PROBES: usize = 64;
const HAS_SAMPLES: u32 = 0x100;
const IS_WHOLE: u32 = 1 << 31;
const SETTLED: u32 = 0x7fff;
/// In place of a light's: several, whose classes are in place of the part that is seen.
const OF_SEVERAL: u32 = 0xffff;

const _: () = assert!(ROW_TEXELS <= 2048 && ENTRY_TEXELS == 10);

/// What the card has, or is about to get.
#[derive(Debug, Default)]
pub(super) struct Entries {
    /// Whole rows of [`ROW_TEXELS`].
    pub(super) texels: Vec<Texel>,
    /// Rows that the card does not have yet.
    pub(super) dirty: Vec<bool>,
    /// The hash table, whole rows of [`HASH_ROW_TEXELS`].
    pub(super) hash: Vec<Texel>,
    /// Whether the card lacks it.
    pub(super) is_hash_dirty: bool,
}

impl Entries {
    /// Takes over the entries that have a place now, with all of their blocks: texels without one are empty. Other blocks stay as they were: nobody
    /// finds them.
    pub(super) fn take(
        &mut self,
        table: &CapTable<'_, MomentEntry>,
        most_rows: usize,
    ) -> Result<(), CardError> {
        let mut blocks: Vec<(BlockKey, u32)> = Vec::new();
        let mut texels = vec![Texel::default(); BLOCK_WIDTH];
        for (id, site, caps) in table.each() {
            let Some((key, entry)) = table.cache.key(id).zip(table.cache.entry(id)) else { continue };
            let block = (id.index() / BLOCK_TEXELS) as u32;
            if blocks.last().is_none_or(|(_, last)| *last != block) {
                if let Some((_, last)) = blocks.last() {
                    self.put(*last as usize, &texels, most_rows)?;
                }
                texels.fill(Texel::default());
                blocks.push((key.block, block));
            }
            let out = &mut texels.as_chunks_mut::<ENTRY_TEXELS>().0[usize::from(key.texel)];
            write(out, site, caps, entry.confidence() > 0);
        }
        if let Some((_, last)) = blocks.last() {
            self.put(*last as usize, &texels, most_rows)?;
        }
        let hash = hash_table(&blocks).ok_or(CardError::Blocks { found: blocks.len(), most: MOST_HASHED })?;
        self.is_hash_dirty |= hash != self.hash;
        self.hash = hash;
        Ok(())
    }

    /// All of it is to be sent again.
    pub(super) fn forget_sent(&mut self) {
        self.dirty.fill(true);
        self.is_hash_dirty = true;
    }

    /// Puts a block's texels where they belong.
    fn put(&mut self, block: usize, texels: &[Texel], most_rows: usize) -> Result<(), CardError> {
        let row = block / BLOCKS_A_ROW;
        if row >= most_rows {
            return Err(CardError::Blocks { found: block + 1, most: most_rows * BLOCKS_A_ROW });
        }
        if row >= self.dirty.len() {
            self.texels.resize((row + 1) * ROW_TEXELS, Texel::default());
            self.dirty.resize(row + 1, true);
        }
        let first = row * ROW_TEXELS + block % BLOCKS_A_ROW * BLOCK_WIDTH;
        let held = &mut self.texels[first..first + BLOCK_WIDTH];
        if held != texels {
            held.copy_from_slice(texels);
            self.dirty[row] = true;
        }
        Ok(())
    }
}

fn write(out: &mut [Texel; ENTRY_TEXELS], site: &EntrySite, caps: &[TableCap], has_samples: bool) {
    let count = caps.len().min(MOST_MOMENT_CONES);
    for (texels, cone) in out[2..].as_chunks_mut::<2>().0.iter_mut().zip(caps) {
        *texels = cone_texels(cone);
    }
    let has_samples = if has_samples { HAS_SAMPLES } else { 0 };
    let [x, y, z] = site.position_world.to_array().map(f32::to_bits);
    out[0] = [x, y, z, octahedral(site.normal_world)];
    out[1] = [octahedral(site.normal_shading_world), count as u32 | has_samples, 0, 0];
}

fn cone_texels(cone: &TableCap) -> [Texel; 2] {
    let cap = &cone.cap;
    let [r, g, b] = cap.energy.to_array().map(f32::to_bits);
    if cone.several != LightSet::NONE {
        return [
            [r, g, b, cap.mean_cosine.to_bits()],
            [octahedral(cap.direction), cap.cos_angle.to_bits(), cone.several.bits(), OF_SEVERAL],
        ];
    }
    let light = cone.slot().map_or(0, |slot| {
        // The largest is 1 itself, so that what is settled leaves nothing.
        let settled = ((cone.settled * 32768.0 + 0.5) as u32).min(SETTLED);
        (slot as u32 + 1) | settled << 16 | if cone.is_whole { IS_WHOLE } else { 0 }
    });
    [
        [r, g, b, cap.mean_cosine.to_bits()],
        [octahedral(cap.direction), cap.cos_angle.to_bits(), cone.fraction.to_bits(), light],
    ]
}

/// A unit vector in a word, for `unpack2x16snorm`.
fn octahedral(direction: Vec3) -> u32 {
    let p = flatten(direction) * f32::from(i16::MAX);
    let [x, y] = p.to_array().map(|v| u32::from(libm::roundf(v) as i16 as u16));
    x | y << 16
}

/// Blocks and their numbers where `read.wgsl` looks for them: from the place that a key hashes to on, up to the first that is free.
/// `None` if there are too many.
fn hash_table(blocks: &[(BlockKey, u32)]) -> Option<Vec<Texel>> {
    let mut places = (2 * blocks.len()).next_power_of_two().max(HASH_A_ROW);
    while places <= 2 * MOST_HASHED {
        if let Some(table) = hash_table_of(blocks, places) {
            return Some(table);
        }
        places *= 2;
    }
    None
}

/// With so many places, unless one lies too far from its own.
fn hash_table_of(blocks: &[(BlockKey, u32)], places: usize) -> Option<Vec<Texel>> {
    let mut table = vec![Texel::default(); 2 * places];
    for (key, block) in blocks {
        let first = hashed(key) as usize;
        let mut at = (0..MOST_PROBES).map(|i| (first + i) & (places - 1));
        let at = at.find(|at| table[2 * at + 1][2] == 0)?;
        table[2 * at] = [key.instance, key.chart, i32::from(key.level) as u32, key.slab as u32];
        table[2 * at + 1] = [key.x as u32, key.y as u32, block + 1, 0];
    }
    Some(table)
}

fn hashed(key: &BlockKey) -> u32 {
    let words =
        [key.instance, key.chart, i32::from(key.level) as u32, key.slab as u32, key.x as u32, key.y as u32];
    let h = words.into_iter().fold(0u32, |h, word| {
        let x = (h ^ word).wrapping_mul(0x9e37_79b1);
        x ^ x >> 15
    });
    h ^ h >> 16
}
