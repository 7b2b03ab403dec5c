//! Stages 1 to 3: blocks for what is wanted, the queue of texels to update, and their places ([Stadlbauer2023] sec. 2.1).

use super::super::entry::ConeEntry;
use super::super::key::{BLOCK_TEXELS, BlockKey, TexelKey};
use super::requests::{BlockRequest, Requests, TexelPlace, bits};
use super::{Body, ConeCache, EntryId, Head};

/// A texel that some viewer sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QueuedTexel {
    /// Its entry.
    pub id: EntryId,
    /// Index of the instance.
    pub instance: u32,
    /// The place on the surface that it stands for.
    pub place: TexelPlace,
    /// Frames since the last update; `u32::MAX` if there was none.
    pub age: u32,
    /// Samples that the entry stands for.
    pub samples: u16,
    /// Whether it got its place in this frame. If it has samples, they are those of an entry of another level.
    pub is_new: bool,
    /// Whether its place became another: until now only pixels beside it had asked for it.
    pub moved: bool,
    /// Frames before this in which it was there and nobody saw it.
    pub absent: u32,
}

/// The texels that viewers see in a frame, each once. The order depends on the requests alone.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct UpdateQueue {
    /// In blocks, in the order in which these were first asked for.
    pub texels: Vec<QueuedTexel>,
    /// New entries that began with one of another level.
    pub reused: u32,
    /// Blocks that were removed to make room.
    pub evicted: u32,
    /// Requests for texels of blocks that there was no room for, counted once a tile of pixels.
    pub refused: u32,
    pub(super) frame: u32,
}

impl<E: ConeEntry> ConeCache<E> {
    /// Begins a frame: finds or makes the entries that are wanted, and lists them. Where memory is at its limit, the blocks
    /// that were not wanted for longest make room; those wanted now never do, so what does not fit is refused.
    pub fn admit(&mut self, requests: &Requests) -> UpdateQueue {
        // Frame 0 is before all, so that an entry never updated has no age.
        self.frame = self.frame.wrapping_add(1).max(1);
        for head in &mut self.heads {
            (head.wanted, head.moved) = (0, 0);
        }
        let mut queue = UpdateQueue { frame: self.frame, ..UpdateQueue::default() };
        let blocks = || requests.tiles.iter().flat_map(|t| t.blocks.iter().map(move |b| (b, &t.places)));
        // What exists is marked first, so that it does not make room for what is new.
        let mut slots: Vec<Option<u32>> = Vec::new();
        for (request, _) in blocks() {
            let slot = self.slot_of.get(&request.key).copied();
            if let Some(slot) = slot {
                self.heads[slot as usize].last_wanted = self.frame;
            }
            slots.push(slot);
        }
        let mut victims = None;
        let mut order = Vec::new();
        for ((request, places), slot) in blocks().zip(slots) {
            let slot = match slot {
                Some(slot) => slot as usize,
                None => match self.slot_for(&request.key, &mut victims, &mut queue.evicted) {
                    Some(slot) => slot,
                    None => {
                        queue.refused += request.wanted.count_ones();
                        continue;
                    }
                },
            };
            if self.heads[slot].wanted == 0 {
                order.push(slot as u32);
            }
            self.place_texels(slot, request, &places[request.first as usize..]);
        }
        for slot in order {
            self.enqueue(slot as usize, &mut queue);
        }
        queue
    }

    /// The block of a key, made if it is not there. `None` if there is no room.
    fn slot_for(
        &mut self,
        key: &BlockKey,
        victims: &mut Option<Vec<(u32, u32)>>,
        evicted: &mut u32,
    ) -> Option<usize> {
        if let Some(&slot) = self.slot_of.get(key) {
            return Some(slot as usize);
        }
        if self.free.is_empty() && self.heads.len() as u64 >= self.most_blocks() {
            // Those wanted least recently last, to be taken from the end.
            let victims = victims.get_or_insert_with(|| {
                let idle =
                    (0u32..).zip(&self.heads).filter(|(_, h)| h.is_used && h.last_wanted != self.frame);
                let mut idle: Vec<_> = idle.map(|(slot, h)| (h.last_wanted, slot)).collect();
                idle.sort_unstable_by(|a, b| b.cmp(a));
                idle
            });
            self.release(victims.pop()?.1 as usize);
            *evicted += 1;
        }
        let head = Head {
            key: *key,
            known: 0,
            sampled: 0,
            wanted: 0,
            moved: 0,
            last_wanted: self.frame,
            first_queued: 0,
            is_used: true,
        };
        let slot = match self.free.pop() {
            Some(slot) => {
                self.heads[slot as usize] = head;
                slot as usize
            }
            None => {
                self.heads.push(head);
                self.bodies.push(Body::empty());
                self.heads.len() - 1
            }
        };
        self.slot_of.insert(*key, slot as u32);
        Some(slot)
    }

    /// Takes note of the wanted texels of a block, and of the best place for those that have none yet.
    fn place_texels(&mut self, slot: usize, request: &BlockRequest, places: &[TexelPlace]) {
        let (head, body) = (&mut self.heads[slot], &mut self.bodies[slot]);
        for (texel, place) in bits(request.wanted).zip(places) {
            let (bit, held) = (1u64 << texel, &mut body.places[texel]);
            if (head.known | head.wanted) & bit == 0 {
                *held = *place;
            } else if (head.known & !head.moved) & bit == 0 {
                held.improve(place);
            } else if !held.is_inside() && place.is_inside() {
                *held = *place;
                head.moved |= bit;
            }
            head.wanted |= bit;
        }
    }

    /// Lists the wanted texels of a block, and begins the new ones.
    fn enqueue(&mut self, slot: usize, queue: &mut UpdateQueue) {
        let Head { key, known, wanted, moved, .. } = self.heads[slot];
        self.heads[slot].first_queued = queue.texels.len() as u32;
        // One look for the whole block is cheaper than many for each texel.
        let levels = 1..=self.params.reuse_levels as i8;
        let can_reuse = wanted & !known != 0
            && levels.flat_map(|k| [-k, k]).any(|k| key.relatives(k).any(|block| self.has_samples(&block)));
        for texel in bits(wanted) {
            let is_new = known >> texel & 1 == 0;
            if is_new {
                let texel_key = TexelKey { block: key, texel: texel as u8 };
                let begin = if can_reuse { self.begin_with(&texel_key) } else { None };
                queue.reused += u32::from(begin.is_some());
                let body = &mut self.bodies[slot];
                body.entries[texel] = begin.unwrap_or_default();
                body.updated[texel] = 0;
                self.heads[slot].note_samples(texel, &body.entries[texel]);
            }
            let body = &mut self.bodies[slot];
            let last = std::mem::replace(&mut body.wanted[texel], self.frame);
            let absent = if is_new { 0 } else { self.frame.wrapping_sub(last).saturating_sub(1) };
            let age = match body.updated[texel] {
                0 => u32::MAX,
                updated => self.frame.wrapping_sub(updated),
            };
            queue.texels.push(QueuedTexel {
                id: EntryId::new(slot, texel),
                instance: key.instance,
                place: body.places[texel],
                age,
                samples: body.entries[texel].confidence(),
                is_new,
                moved: moved >> texel & 1 == 1,
                absent,
            });
        }
        self.heads[slot].known |= wanted;
    }

    /// What a new entry begins with: the entry of the nearest level that has one at its place, finer ones first.
    fn begin_with(&self, key: &TexelKey) -> Option<E> {
        let found = (1..=self.params.reuse_levels).find_map(|steps| {
            let finer = key.finer(steps).filter_map(|key| self.updated_entry(&key));
            // The first of those with most samples.
            let finer = finer.fold(None, |best: Option<&E>, next| match best {
                Some(best) if best.confidence() >= next.confidence() => Some(best),
                _ => Some(next),
            });
            finer.or_else(|| self.updated_entry(&key.coarser(steps)?))
        });
        found.map(|entry| {
            let mut entry = entry.clone();
            entry.cut_confidence(self.params.reuse_samples);
            entry
        })
    }

    /// Whether a block exists and an entry of it has samples.
    fn has_samples(&self, key: &BlockKey) -> bool {
        self.slot_of.get(key).is_some_and(|&slot| self.heads[slot as usize].sampled != 0)
    }

    /// The entry of a texel if it has samples of its own.
    fn updated_entry(&self, key: &TexelKey) -> Option<&E> {
        let slot = *self.slot_of.get(&key.block)? as usize;
        let texel = usize::from(key.texel);
        debug_assert!(texel < BLOCK_TEXELS);
        let body = &self.bodies[slot];
        (self.heads[slot].known >> texel & 1 == 1 && body.updated[texel] != 0).then(|| &body.entries[texel])
    }
}
