//! What shading reads of a cache: cones as caps, and where entries are, close together and each made once, however many samples of however many viewers
//! read it.

use std::ops::Range;
use std::sync::Arc;

use dapple_store::cones::{BLOCK_TEXELS, ConeCache, ConeEntry, EntryId, EntrySite, LightSet};
use rayon::prelude::*;

use super::blend::WHOLE;
use super::{Cap, Caps, ConeLight, SeenPart};
use crate::area_lights::{AreaLightTable, Spot};

/// Blocks of a chunk.
const CHUNK_BLOCKS: usize = 16;
/// Texels of those.
const CHUNK_TEXELS: usize = CHUNK_BLOCKS * BLOCK_TEXELS;

/// A cone, and which part of which light that is.
#[derive(Clone, Copy, Debug)]
pub(super) struct TableCap {
    pub(super) cap: Cap,
    /// [`SeenPart::fraction`].
    pub(super) fraction: f32,
    /// [`SeenPart::settled`].
    pub(super) settled: f32,
    /// Place of the light in the table of lights.
    slot: u16,
    /// Whether all cones of it together see all of it.
    pub(super) is_whole: bool,
    /// The lights that it is of, if these are several and all in the table of lights.
    pub(super) several: LightSet,
}

/// No light of the table.
const NO_SLOT: u16 = u16::MAX;

impl TableCap {
    fn new(cap: Cap, set: LightSet, seen: Option<SeenPart>, lights: Option<&AreaLightTable>) -> TableCap {
        let is_shown = set.single().is_none() && lights.is_some_and(|table| !table.may_lack(set));
        let several = if is_shown { set } else { LightSet::NONE };
        let of_light = seen.and_then(|seen| Some((seen, lights?.slot_of_form(seen.light)?)));
        match of_light {
            Some((seen, slot)) => TableCap {
                cap,
                fraction: seen.fraction,
                settled: seen.settled.clamp(0.0, 1.0),
                slot: slot as u16,
                is_whole: seen.of_all >= WHOLE,
                several,
            },
            None => TableCap { cap, fraction: 0.0, settled: 0.0, slot: NO_SLOT, is_whole: false, several },
        }
    }

    /// Place of its light in the table of lights, if that shows it by its form.
    #[inline]
    pub(super) fn slot(&self) -> Option<usize> {
        (self.slot != NO_SLOT).then_some(usize::from(self.slot))
    }
}

/// Where an entry is, and which of its chunk's caps it has.
#[derive(Clone, Copy, Debug)]
struct TableEntry {
    #[cfg(feature = "gpu")]
    id: EntryId,
    site: EntrySite,
    first: u32,
    count: u32,
}

/// Entries of [`CHUNK_BLOCKS`] blocks.
#[derive(Debug)]
struct Chunk {
    entries: Vec<TableEntry>,
    caps: Vec<TableCap>,
    /// Place in `entries` of each texel of the blocks; [`NO_PLACE`] where there is none.
    place_of: Vec<u16>,
    /// [`ConeCache::clock`] when it was made.
    clock: u64,
}

const NO_PLACE: u16 = u16::MAX;

// Places are numbered in 16 bits.
const _: () = assert!(CHUNK_TEXELS < NO_PLACE as usize);

/// Entries of a cache at one moment, ready to be shaded: [`ConeLight`] turned into caps.
#[derive(Clone, Debug)]
pub struct CapTable<'a, E> {
    pub(super) cache: &'a ConeCache<E>,
    pub(super) lights: Option<&'a AreaLightTable>,
    /// The same, as points.
    pub(super) spots: Vec<Spot>,
    chunks: Vec<Arc<Chunk>>,
}

/// Caps of a cache that are kept from one moment to the next, so that only those of blocks in which something changed are made.
#[derive(Debug, Default)]
pub struct KeptCaps {
    chunks: Vec<Arc<Chunk>>,
    /// What caps say of lights: those that have forms, their places in the table, and classes of those that are not in it.
    shown: Option<(Vec<(u32, usize)>, u32)>,
}

impl KeptCaps {
    /// What [`CapTable::new`] gives. `changed_at` says of a block ([`ConeCache::changed_at`]) when its entries or their places in the world last changed,
    /// by the cache's clock. Always of the same cache.
    pub fn table<'a, E: ConeEntry + Caps, F: Fn(EntryId) -> Option<EntrySite> + Sync>(
        &mut self,
        light: &ConeLight<'a, E, F>,
        changed_at: impl Fn(usize) -> u64 + Sync,
    ) -> CapTable<'a, E> {
        let shown = light.lights.map(|table| {
            let slots = table.lights().iter().filter_map(|light| Some((*light, table.slot_of_form(*light)?)));
            (slots.collect::<Vec<_>>(), table.hidden_classes())
        });
        if self.shown != shown {
            (self.chunks, self.shown) = (Vec::new(), shown);
        }
        let end = light.cache.end_block();
        let count = end.div_ceil(CHUNK_BLOCKS);
        let held = &self.chunks;
        let chunk = |number: usize| {
            let blocks = number * CHUNK_BLOCKS..(number + 1) * CHUNK_BLOCKS;
            let is_same = |chunk: &Arc<Chunk>| {
                blocks.clone().take_while(|block| *block < end).all(|block| changed_at(block) <= chunk.clock)
            };
            let kept = held.get(number).filter(|chunk| is_same(chunk)).cloned();
            kept.unwrap_or_else(|| Arc::new(Chunk::new(light, blocks)))
        };
        self.chunks = (0..count).into_par_iter().map(chunk).collect();
        let spots = light.lights.map_or_else(Vec::new, |table| table.spots().collect());
        CapTable { cache: light.cache, lights: light.lights, spots, chunks: self.chunks.clone() }
    }
}

impl Chunk {
    fn new<E: ConeEntry + Caps, F: Fn(EntryId) -> Option<EntrySite>>(
        light: &ConeLight<'_, E, F>,
        blocks: Range<usize>,
    ) -> Chunk {
        let (mut entries, mut caps, mut place_of) = (Vec::new(), Vec::new(), vec![NO_PLACE; CHUNK_TEXELS]);
        for id in light.cache.ids_of_blocks(blocks) {
            let Some((site, entry)) = (light.place_of)(id).zip(light.cache.entry(id)) else { continue };
            let first = caps.len();
            entry.each_cap(|cap, set, seen| caps.push(TableCap::new(cap, set, seen, light.lights)));
            let count = (caps.len() - first) as u32;
            place_of[id.index() % CHUNK_TEXELS] = entries.len() as u16;
            entries.push(TableEntry {
                #[cfg(feature = "gpu")]
                id,
                site,
                first: first as u32,
                count,
            });
        }
        Chunk { entries, caps, place_of, clock: light.cache.clock() }
    }
}

impl<'a, E: ConeEntry + Caps> CapTable<'a, E> {
    /// Of all entries that have a place, in parallel in the caller's rayon pool.
    pub fn new<F: Fn(EntryId) -> Option<EntrySite> + Sync>(light: &ConeLight<'a, E, F>) -> CapTable<'a, E> {
        KeptCaps::default().table(light, |_| 0)
    }

    /// Where an entry is, and its cones; `None` if it has no place.
    #[inline]
    pub(super) fn get(&self, id: EntryId) -> Option<(&EntrySite, &[TableCap])> {
        let chunk = self.chunks.get(id.index() / CHUNK_TEXELS)?;
        let entry = chunk.entries.get(usize::from(chunk.place_of[id.index() % CHUNK_TEXELS]))?;
        Some((&entry.site, chunk.caps_of(entry)))
    }

    /// All entries that have a place, in the order of the cache.
    #[cfg(feature = "gpu")]
    pub(super) fn each(&self) -> impl Iterator<Item = (EntryId, &EntrySite, &[TableCap])> {
        self.chunks
            .iter()
            .flat_map(|chunk| chunk.entries.iter().map(|entry| (entry.id, &entry.site, chunk.caps_of(entry))))
    }
}

impl Chunk {
    #[inline]
    fn caps_of(&self, entry: &TableEntry) -> &[TableCap] {
        let first = entry.first as usize;
        &self.caps[first..first + entry.count as usize]
    }
}
