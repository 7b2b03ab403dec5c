//! Stage 5: which entries a pixel is shaded with ([Stadlbauer2023] sec. 2.1, *compositing*).

use super::super::entry::ConeEntry;
use super::super::key::{BlockKey, TexelKey};
use super::requests::{LookUp, Nearby, PixelPlace};
use super::{ConeCache, EntryId};

/// Blocks that a reader remembers.
const REMEMBERED: usize = 8;

/// Entries about a pixel, and how much each counts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reads {
    found: [(EntryId, f32); 4],
    count: u8,
}

impl Default for EntryId {
    fn default() -> Self {
        EntryId(u32::MAX)
    }
}

impl Reads {
    /// Entries and weights, which add up to 1; empty where nothing is known.
    pub fn entries(&self) -> &[(EntryId, f32)] {
        &self.found[..usize::from(self.count)]
    }

    fn push(&mut self, id: EntryId, weight: f32) {
        if let Some(place) = self.found.get_mut(usize::from(self.count)) {
            *place = (id, weight);
            self.count += 1;
        }
    }
}

/// Finds entries for pixels. One a thread; pixels near each other in turn are the quickest.
#[derive(Clone, Debug)]
pub struct Reader<'a, E> {
    cache: &'a ConeCache<E>,
    look_up: LookUp,
    recent: [Option<(BlockKey, Option<u32>)>; REMEMBERED],
    oldest: usize,
    last: usize,
}

impl<'a, E: ConeEntry> Reader<'a, E> {
    /// A reader with the parameters that the requests were made with.
    pub fn new(cache: &'a ConeCache<E>, look_up: LookUp) -> Reader<'a, E> {
        Reader { cache, look_up, recent: [None; REMEMBERED], oldest: 0, last: 0 }
    }

    /// The entries for a pixel: with [`LookUp::blend`] the 2×2 texels about it in its chart and level, weighted bilinearly
    /// (those without samples are left out), otherwise, or if there are none, its own texel. Shade each and
    /// weight the colours: cones do not average.
    pub fn read(&mut self, pixel: &PixelPlace) -> Reads {
        let mut reads = Reads::default();
        let Some(nearby) = Nearby::of(pixel, self.look_up.bias) else { return reads };
        if self.look_up.blend {
            let mut sum = 0.0;
            nearby.each_of_four(|key, weight, _| {
                if let Some(id) = self.find(&key) {
                    reads.push(id, weight);
                    sum += weight;
                }
            });
            for (_, weight) in &mut reads.found[..usize::from(reads.count)] {
                *weight /= sum;
            }
        }
        if reads.count == 0
            && let Some(id) = self.find(&nearby.own())
        {
            reads.push(id, 1.0);
        }
        reads
    }

    /// The entry of a texel, if it has samples.
    fn find(&mut self, key: &TexelKey) -> Option<EntryId> {
        let is_it = |recent: &Option<(BlockKey, _)>| recent.is_some_and(|(block, _)| block == key.block);
        if !is_it(&self.recent[self.last]) {
            self.last = self.recent.iter().position(is_it).unwrap_or_else(|| {
                let at = self.oldest;
                self.recent[at] = Some((key.block, self.cache.slot_of.get(&key.block).copied()));
                self.oldest = (at + 1) % REMEMBERED;
                at
            });
        }
        let slot = self.recent[self.last]?.1? as usize;
        let has_samples = self.cache.heads[slot].sampled >> key.texel & 1 == 1;
        has_samples.then(|| EntryId::new(slot, usize::from(key.texel)))
    }
}
