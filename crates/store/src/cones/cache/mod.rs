//! The on-surface cache ([Stadlbauer2023] sec. 2.1): entries in blocks of 8×8 texels of the charts, for all viewers together.
//!
//! A frame is: [`Requests::gather`] what the viewers see, [`ConeCache::admit`] it, which gives an [`UpdateQueue`], trace what
//! of it one can afford, [`ConeCache::update`] the entries, and read them with a [`Reader`]. Where nobody moved,
//! [`Requests::gather_again`] and [`ConeCache::repeat`] take the place of the first two. Nothing here depends on the
//! number of threads or on the layout of the hash map.

mod admit;
mod read;
#[cfg(test)]
mod repeat_tests;
mod requests;
#[cfg(test)]
mod tests;

use std::collections::HashMap;
use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;

use super::entry::{ConeEntry, ConeError, check_rules};
use super::key::{BLOCK_TEXELS, BlockKey, KeyHash, TexelKey};
use requests::bits;

pub use admit::{QueuedTexel, UpdateQueue};
pub use read::{Reader, Reads};
pub use requests::{LookUp, PixelPlace, Requests, TexelPlace, View};

/// Most blocks of a cache: their texels are numbered in 32 bits.
const MOST_BLOCKS: u64 = 1 << 26;

/// What a block costs in the hash map, bytes: key, index, control byte, at the load that it doubles at.
const MAP_BYTES: u64 = 64;

/// How a cache is kept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CacheParams {
    /// Memory it may take, bytes; at least one block's. Default 512 MiB.
    pub most_bytes: u64,
    /// How many levels away a new entry looks for one to begin with, 0 … 4. Default 2.
    pub reuse_levels: u8,
    /// Whether that may be a finer one: these go first. Default true; [Stadlbauer2023] sec. 2.1 knows coarser ones alone.
    pub reuse_finer: bool,
    /// Most samples that what it begins with counts for, 1 … 4095. Default 16.
    pub reuse_samples: u16,
}

impl Default for CacheParams {
    fn default() -> Self {
        CacheParams { most_bytes: 512 << 20, reuse_levels: 2, reuse_finer: true, reuse_samples: 16 }
    }
}

impl CacheParams {
    /// Whether the parameters are in range.
    ///
    /// # Errors
    ///
    /// The first that is not.
    pub fn check(&self) -> Result<(), ConeError> {
        let (levels, samples) = (self.reuse_levels, self.reuse_samples);
        check_rules([
            ("reuse_levels", f64::from(levels), levels <= 4, "it must be 0 to 4"),
            ("reuse_samples", f64::from(samples), (1..=4095).contains(&samples), "it must be 1 to 4095"),
        ])
    }
}

/// Where an entry is in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EntrySite {
    /// Metres.
    pub position_world: Vec3,
    /// Unit normal of its triangle, on the side that is seen.
    pub normal_world: Vec3,
    /// Unit normal that irradiance in its cones is by the cosine to.
    pub normal_shading_world: Vec3,
}

/// Names an entry until the next [`ConeCache::admit`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct EntryId(u32);

impl EntryId {
    fn new(slot: usize, texel: usize) -> EntryId {
        EntryId((slot * BLOCK_TEXELS + texel) as u32)
    }

    /// Its number: small, and its own among all entries of the cache.
    #[inline]
    pub fn index(self) -> usize {
        self.0 as usize
    }

    fn slot(self) -> usize {
        self.0 as usize / BLOCK_TEXELS
    }

    fn texel(self) -> usize {
        self.0 as usize % BLOCK_TEXELS
    }
}

/// What an update did to an entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Touch {
    /// It is as it was.
    Nothing,
    /// It is not, but took no samples.
    Changed,
    /// It took samples: others may begin with it.
    Updated,
}

impl From<bool> for Touch {
    fn from(updated: bool) -> Touch {
        if updated { Touch::Updated } else { Touch::Nothing }
    }
}

/// The texels of one block that are in a frame's queue, with their entries.
#[derive(Debug)]
pub struct QueuedBlock<'a, E> {
    /// Which block.
    pub key: BlockKey,
    /// Index in the queue of the first of its texels; the others follow.
    pub first: usize,
    /// Its texels, in order of their entries' numbers.
    pub texels: &'a [QueuedTexel],
    /// What was done to the entry of each, to be set; at first nothing.
    pub touched: [Touch; BLOCK_TEXELS],
    entries: &'a mut [E; BLOCK_TEXELS],
    head: &'a mut Head,
}

impl<E: ConeEntry> QueuedBlock<'_, E> {
    /// The entry of the texel with that index in `texels`.
    #[inline]
    pub fn entry(&mut self, index: usize) -> &mut E {
        &mut self.entries[self.texels[index].id.texel()]
    }

    /// Keeps what was done; returns how many were updated.
    fn note(&mut self, clock: u64) -> u64 {
        let mut done = 0;
        for (queued, touch) in self.texels.iter().zip(self.touched) {
            let texel = queued.id.texel();
            if touch == Touch::Updated {
                self.head.own |= 1 << texel;
                done += 1;
            }
            if touch != Touch::Nothing {
                self.head.note_samples(texel, &self.entries[texel]);
                self.head.changed = clock;
            }
        }
        done
    }
}

/// What is looked at often of a block.
#[derive(Clone, Copy, Debug)]
struct Head {
    key: BlockKey,
    /// Texels that have a place.
    known: u64,
    /// Texels wanted in this frame.
    wanted: u64,
    /// Texels whose entry has samples: what a reader asks first.
    sampled: u64,
    /// Texels whose entry was updated since it began: what others may begin with.
    own: u64,
    /// Texels whose place became another in this frame.
    moved: u64,
    /// Texels wanted in the frame before.
    before: u64,
    /// [`ConeCache::clock`] of its last change.
    changed: u64,
    last_wanted: u32,
    /// Where its texels are in this frame's queue.
    first_queued: u32,
    /// Whether a key leads here; the others wait to be used again.
    is_used: bool,
}

impl Head {
    /// Whether a texel's entry has samples, to be known before the entry is looked at.
    fn note_samples(&mut self, texel: usize, entry: &impl ConeEntry) {
        self.sampled = self.sampled & !(1 << texel) | u64::from(entry.confidence() > 0) << texel;
    }
}

/// A block's texels.
#[derive(Clone, Debug)]
struct Body<E> {
    places: [TexelPlace; BLOCK_TEXELS],
    /// When somebody last wanted it, before this frame.
    wanted: [u32; BLOCK_TEXELS],
    entries: [E; BLOCK_TEXELS],
}

impl<E: ConeEntry> Body<E> {
    fn empty() -> Box<Body<E>> {
        Box::new(Body {
            places: [TexelPlace::default(); BLOCK_TEXELS],
            wanted: [0; BLOCK_TEXELS],
            entries: std::array::from_fn(|_| E::default()),
        })
    }
}

/// What the cache holds and did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CacheCounts {
    /// Blocks in use.
    pub blocks: u64,
    /// Texels that have a place.
    pub entries: u64,
    /// Memory, bytes, with blocks that wait to be used again.
    pub bytes: u64,
}

/// Entries of all instances.
#[derive(Clone, Debug)]
pub struct ConeCache<E> {
    params: CacheParams,
    /// Never walked through: the order is that of `heads`.
    slot_of: HashMap<BlockKey, u32, KeyHash>,
    heads: Vec<Head>,
    bodies: Vec<Box<Body<E>>>,
    /// Slots that wait to be used again.
    free: Vec<u32>,
    frame: u32,
    clock: u64,
    /// Blocks that were ever removed.
    releases: u64,
    /// Names the requests of this frame; 0 if there were none.
    admitted: u64,
}

impl<E: ConeEntry> ConeCache<E> {
    /// An empty cache.
    ///
    /// # Errors
    ///
    /// A parameter out of range.
    pub fn new(params: CacheParams) -> Result<ConeCache<E>, ConeError> {
        params.check()?;
        Ok(ConeCache {
            params,
            slot_of: HashMap::default(),
            heads: Vec::new(),
            bodies: Vec::new(),
            free: Vec::new(),
            frame: 0,
            clock: 0,
            releases: 0,
            admitted: 0,
        })
    }

    /// Memory of one block, bytes.
    pub fn block_bytes() -> u64 {
        (size_of::<Head>() + size_of::<Body<E>>()) as u64 + MAP_BYTES
    }

    /// Most blocks that its memory allows.
    pub fn most_blocks(&self) -> u64 {
        (self.params.most_bytes / Self::block_bytes()).clamp(1, MOST_BLOCKS)
    }

    /// What it holds now.
    pub fn counts(&self) -> CacheCounts {
        let used = self.heads.iter().filter(|head| head.is_used);
        let (blocks, entries) =
            used.fold((0, 0), |(b, e), head| (b + 1, e + u64::from(head.known.count_ones())));
        CacheCounts { blocks, entries, bytes: self.heads.len() as u64 * Self::block_bytes() }
    }

    /// Number of the frame: how often something was admitted or repeated.
    pub fn frame(&self) -> u32 {
        self.frame
    }

    /// Goes up with all that may change an entry.
    pub fn clock(&self) -> u64 {
        self.clock
    }

    /// When a block last changed, by [`ConeCache::clock`]: which of its texels are wanted, their places or their entries. `block` is the number of any
    /// of its entries divided by [`BLOCK_TEXELS`].
    #[inline]
    pub fn changed_at(&self, block: usize) -> u64 {
        self.heads.get(block).map_or(0, |head| head.changed)
    }

    /// The instance that a block is of.
    #[inline]
    pub fn instance_of(&self, block: usize) -> Option<u32> {
        self.heads.get(block).filter(|head| head.is_used).map(|head| head.key.instance)
    }

    /// Updates entries of this frame's queue in parallel, in the caller's thread pool: `update` gets the index in the queue, what
    /// stands there, and the entry, and says what it did (`true`: [`Touch::Updated`], `false`: nothing). Returns how many entries it updated.
    ///
    /// # Errors
    ///
    /// The queue is of another frame.
    pub fn update<F, T>(&mut self, queue: &UpdateQueue, update: F) -> Result<u64, ConeError>
    where
        F: Fn(usize, &QueuedTexel, &mut E) -> T + Sync,
        T: Into<Touch>,
    {
        self.update_blocks(queue, 0, |blocks| {
            for block in blocks {
                for i in 0..block.texels.len() {
                    let texel = &block.texels[i];
                    block.touched[i] = update(block.first + i, texel, block.entry(i)).into();
                }
            }
        })
    }

    /// As [`ConeCache::update`], for blocks that lie beside each other on a chart at once: `update` has those of a square of 2^`up` × 2^`up` blocks
    /// (`up` 0 … 16, more counts as that) that have texels in the queue, in an order that the queue alone tells.
    ///
    /// # Errors
    ///
    /// The queue is of another frame.
    pub fn update_blocks<F>(&mut self, queue: &UpdateQueue, up: u8, update: F) -> Result<u64, ConeError>
    where
        F: Fn(&mut [QueuedBlock<'_, E>]) + Sync,
    {
        if queue.frame != self.frame {
            let (name, rule) = ("frame of the queue", "it must be the cache's last one");
            return Err(ConeError::BadParameter { name, value: f64::from(queue.frame), rule });
        }
        self.clock += 1;
        let clock = self.clock;
        let wanted = self.heads.iter_mut().zip(&mut self.bodies).filter(|(head, _)| head.wanted != 0);
        let mut blocks: Vec<QueuedBlock<'_, E>> = wanted
            .filter_map(|(head, body)| {
                let first = head.first_queued as usize;
                let texels = queue.texels.get(first..first + head.wanted.count_ones() as usize)?;
                let touched = [Touch::Nothing; BLOCK_TEXELS];
                Some(QueuedBlock { key: head.key, first, texels, touched, entries: &mut body.entries, head })
            })
            .collect();
        let square = |block: &QueuedBlock<'_, E>| block.key.square(up);
        // Alone they are in order, each a square.
        if up > 0 {
            blocks.par_sort_unstable_by_key(|block| (square(block), block.first));
        }
        let squares: Vec<&mut [QueuedBlock<'_, E>]> =
            blocks.chunk_by_mut(|a, b| square(a) == square(b)).collect();
        let done = squares.into_par_iter().map(|blocks| {
            update(blocks);
            blocks.iter_mut().map(|block| block.note(clock)).sum::<u64>()
        });
        Ok(done.sum())
    }

    /// An entry, if it has a place.
    #[inline]
    pub fn entry(&self, id: EntryId) -> Option<&E> {
        let head = self.heads.get(id.slot())?;
        (head.known >> id.texel() & 1 == 1).then(|| &self.bodies[id.slot()].entries[id.texel()])
    }

    /// Changes an entry outside the queue, if it has a place; says whether it has.
    pub fn change(&mut self, id: EntryId, change: impl FnOnce(&mut E)) -> bool {
        let Some(head) = self.heads.get_mut(id.slot()).filter(|head| head.known >> id.texel() & 1 == 1)
        else {
            return false;
        };
        let entry = &mut self.bodies[id.slot()].entries[id.texel()];
        change(entry);
        head.note_samples(id.texel(), entry);
        self.clock += 1;
        head.changed = self.clock;
        true
    }

    /// Instance and place of an entry.
    pub fn place(&self, id: EntryId) -> Option<(u32, TexelPlace)> {
        let head = self.heads.get(id.slot())?;
        let body = self.bodies.get(id.slot())?;
        (head.known >> id.texel() & 1 == 1).then(|| (head.key.instance, body.places[id.texel()]))
    }

    /// The texel of an entry.
    pub fn key(&self, id: EntryId) -> Option<TexelKey> {
        let head = self.heads.get(id.slot()).filter(|head| head.is_used)?;
        Some(TexelKey { block: head.key, texel: id.texel() as u8 })
    }

    /// The entry of a texel, if it has a place.
    pub fn find(&self, key: &TexelKey) -> Option<EntryId> {
        let slot = *self.slot_of.get(&key.block)? as usize;
        let known = self.heads[slot].known.checked_shr(u32::from(key.texel)).unwrap_or(0);
        (known & 1 == 1).then(|| EntryId::new(slot, usize::from(key.texel)))
    }

    /// All entries that have a place, in an order that depends on what was admitted alone.
    pub fn ids(&self) -> impl Iterator<Item = EntryId> + '_ {
        self.ids_of_blocks(0..self.heads.len())
    }

    /// Those of them whose block's number, the entry's divided by [`BLOCK_TEXELS`], is in the range.
    pub fn ids_of_blocks(&self, blocks: Range<usize>) -> impl Iterator<Item = EntryId> + '_ {
        let slots = blocks.start.min(self.heads.len())..blocks.end.min(self.heads.len());
        let used = slots.filter(|slot| self.heads[*slot].is_used);
        used.flat_map(|slot| bits(self.heads[slot].known).map(move |texel| EntryId::new(slot, texel)))
    }

    /// One past the last block's number.
    pub fn end_block(&self) -> usize {
        self.heads.len()
    }

    /// Removes the blocks of instances that are not to be kept. What the frame's queue has of them is gone.
    pub fn retain_instances(&mut self, keep: impl Fn(u32) -> bool) {
        for slot in 0..self.heads.len() {
            if self.heads[slot].is_used && !keep(self.heads[slot].key.instance) {
                self.release(slot);
            }
        }
    }

    /// Forgets a block. Its memory waits to be used again.
    fn release(&mut self, slot: usize) {
        self.clock += 1;
        self.releases += 1;
        let head = &mut self.heads[slot];
        self.slot_of.remove(&head.key);
        (head.is_used, head.known, head.sampled, head.own, head.wanted, head.moved) = (false, 0, 0, 0, 0, 0);
        head.changed = self.clock;
        self.free.push(slot as u32);
    }
}
