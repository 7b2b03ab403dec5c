//! Stages 1 to 3: blocks for what is wanted, the queue of texels to update, and their places ([Stadlbauer2023] sec. 2.1).

use rayon::prelude::*;

use super::super::entry::ConeEntry;
use super::super::key::{BLOCK_TEXELS, BlockKey, TexelKey};
use super::requests::{Requests, TexelPlace, bits};
use super::{Body, ConeCache, EntryId, Head};

/// A texel that some viewer sees.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct QueuedTexel {
    /// Its entry.
    pub id: EntryId,
    /// Index of the instance.
    pub instance: u32,
    /// The place on the surface that it stands for.
    pub place: TexelPlace,
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
    /// [`ConeCache::releases`] when it was made.
    releases: u64,
    /// Whether the frame before had the same.
    is_repeat: bool,
}

impl UpdateQueue {
    /// Number of the frame that it is of.
    pub fn frame(&self) -> u32 {
        self.frame
    }

    /// Whether it has the texels of the frame before, in the same order ([`ConeCache::repeat`]).
    pub fn is_repeat(&self) -> bool {
        self.is_repeat
    }
}

impl<E: ConeEntry> ConeCache<E> {
    /// Begins a frame: finds or makes the entries that are wanted, and lists them. Where memory is at its limit, the blocks
    /// that were not wanted for longest make room; those wanted now never do, so what does not fit is refused. In parallel in the caller's
    /// rayon pool.
    pub fn admit(&mut self, requests: &Requests) -> UpdateQueue {
        let last = self.begin_frame();
        for (head, body) in self.heads.iter_mut().zip(&mut self.bodies) {
            bits(head.wanted).for_each(|texel| body.wanted[texel] = last);
            (head.before, head.wanted, head.moved) = (head.wanted, 0, 0);
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
        // Each block once, in the order in which they are first asked for, with all that is asked of it.
        let mut asked: Vec<Asked<'_>> = Vec::new();
        let mut index_of: Vec<u32> = Vec::new();
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
            index_of.resize(self.heads.len(), u32::MAX);
            let head = &mut self.heads[slot];
            if head.wanted == 0 {
                index_of[slot] = asked.len() as u32;
                asked.push(Asked { slot, requests: Vec::new() });
            }
            head.wanted |= request.wanted;
            asked[index_of[slot] as usize].requests.push((request.wanted, &places[request.first as usize..]));
        }
        self.enqueue(&asked, &index_of, &mut queue);
        for head in &mut self.heads {
            if head.wanted != head.before || head.moved != 0 {
                head.changed = self.clock;
            }
        }
        queue.releases = self.releases;
        self.admitted = requests.name;
        queue
    }

    /// Begins a frame with what the last one had: the same as [`ConeCache::admit`] with these requests, in next to no time. `queue` is the last
    /// frame's and becomes this one's. `false`, and nothing is done, if the last frame's requests were others, if the queue is not its, if blocks were
    /// removed since, or if something was refused, for which there may be room now.
    #[must_use]
    pub fn repeat(&mut self, requests: &Requests, queue: &mut UpdateQueue) -> bool {
        let is_last = queue.frame == self.frame && requests.name == self.admitted && requests.name != 0;
        if !is_last || queue.releases != self.releases || queue.refused > 0 {
            return false;
        }
        self.begin_frame();
        for head in self.heads.iter_mut().filter(|head| head.wanted != 0) {
            (head.before, head.moved, head.last_wanted) = (head.wanted, 0, self.frame);
        }
        if !queue.is_repeat {
            for texel in &mut queue.texels {
                (texel.is_new, texel.moved, texel.absent) = (false, false, 0);
            }
        }
        (queue.reused, queue.evicted, queue.frame, queue.is_repeat) = (0, 0, self.frame, true);
        true
    }

    /// Returns the number of the frame before.
    fn begin_frame(&mut self) -> u32 {
        self.clock += 1;
        // Frame 0 is before all.
        let next = self.frame.wrapping_add(1).max(1);
        std::mem::replace(&mut self.frame, next)
    }

    /// Finds the places of wanted texels, lists these, and begins the new ones. Blocks do not look at what becomes of each other.
    fn enqueue(&mut self, asked: &[Asked<'_>], index_of: &[u32], queue: &mut UpdateQueue) {
        let begins: Vec<Vec<(usize, E)>> = asked.par_iter().map(|asked| self.begins(asked.slot)).collect();
        queue.reused = begins.iter().map(|begins| begins.len() as u32).sum();
        let counts = asked.iter().map(|asked| self.heads[asked.slot].wanted.count_ones() as usize);
        let counts: Vec<usize> = counts.collect();
        queue.texels = vec![QueuedTexel::default(); counts.iter().sum()];
        let mut blocks: Vec<Option<Block<'_, E>>> = asked.iter().map(|_| None).collect();
        for ((slot, head), body) in self.heads.iter_mut().enumerate().zip(&mut self.bodies) {
            let index = index_of.get(slot).map_or(usize::MAX, |index| *index as usize);
            if let Some(block) = blocks.get_mut(index) {
                *block = Some(Block { slot, head, body });
            }
        }
        let mut left = &mut queue.texels[..];
        let mut first = 0;
        let mut jobs = Vec::with_capacity(asked.len());
        for (((asked, block), begins), count) in asked.iter().zip(blocks).zip(begins).zip(counts) {
            let (out, rest) = std::mem::take(&mut left).split_at_mut(count);
            left = rest;
            if let Some(block) = block {
                block.head.first_queued = first;
                jobs.push((block, asked, begins, out));
            }
            first += count as u32;
        }
        let frame = self.frame;
        jobs.into_par_iter().with_min_len(16).for_each(|(mut block, asked, begins, out)| {
            let wanted = std::mem::take(&mut block.head.wanted);
            for (wanted, places) in &asked.requests {
                block.place_texels(*wanted, places);
            }
            debug_assert_eq!(block.head.wanted, wanted, "the sum of what is asked");
            block.enqueue(begins, frame, out);
        });
    }

    /// What new texels of a block begin with, of those that begin with something.
    fn begins(&self, slot: usize) -> Vec<(usize, E)> {
        let Head { key, known, wanted, .. } = self.heads[slot];
        // One look for the whole block is cheaper than many for each texel.
        let levels = 1..=self.params.reuse_levels as i8;
        let can_reuse = wanted & !known != 0
            && levels
                .flat_map(|k| [self.params.reuse_finer.then_some(-k), Some(k)])
                .flatten()
                .any(|k| key.relatives(k).any(|block| self.has_samples(&block)));
        if !can_reuse {
            return Vec::new();
        }
        let texel_key = |texel: usize| TexelKey { block: key, texel: texel as u8 };
        bits(wanted & !known).filter_map(|texel| Some((texel, self.begin_with(&texel_key(texel))?))).collect()
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
            own: 0,
            moved: 0,
            before: 0,
            changed: self.clock,
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

    /// What a new entry begins with: the entry of the nearest level that has one at its place, finer ones first.
    fn begin_with(&self, key: &TexelKey) -> Option<E> {
        let found = (1..=self.params.reuse_levels).find_map(|steps| {
            let finer = self.params.reuse_finer.then(|| key.finer(steps)).into_iter().flatten();
            let finer = finer.filter_map(|key| self.updated_entry(&key));
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
        (self.heads[slot].own >> texel & 1 == 1).then(|| &self.bodies[slot].entries[texel])
    }
}

/// A block that is wanted, and what each tile of pixels wants of it.
struct Asked<'a> {
    slot: usize,
    requests: Vec<(u64, &'a [TexelPlace])>,
}

/// A block at work.
struct Block<'a, E> {
    slot: usize,
    head: &'a mut Head,
    body: &'a mut Body<E>,
}

impl<E: ConeEntry> Block<'_, E> {
    /// Takes note of wanted texels, and of the best place for those that have none yet.
    fn place_texels(&mut self, wanted: u64, places: &[TexelPlace]) {
        let (head, body) = (&mut *self.head, &mut *self.body);
        for (texel, place) in bits(wanted).zip(places) {
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

    /// Lists the wanted texels, and begins the new ones.
    fn enqueue(&mut self, begins: Vec<(usize, E)>, frame: u32, out: &mut [QueuedTexel]) {
        let (head, body) = (&mut *self.head, &mut *self.body);
        let mut begins = begins.into_iter().peekable();
        for (texel, out) in bits(head.wanted).zip(out) {
            let is_new = head.known >> texel & 1 == 0;
            if is_new {
                let begin = begins.next_if(|(of, _)| *of == texel);
                body.entries[texel] = begin.map_or_else(E::default, |(_, entry)| entry);
                head.own &= !(1 << texel);
                head.note_samples(texel, &body.entries[texel]);
            }
            *out = QueuedTexel {
                id: EntryId::new(self.slot, texel),
                instance: head.key.instance,
                place: body.places[texel],
                is_new,
                moved: head.moved >> texel & 1 == 1,
                absent: if is_new { 0 } else { frame.wrapping_sub(body.wanted[texel]).saturating_sub(1) },
            };
        }
        head.known |= head.wanted;
    }
}
