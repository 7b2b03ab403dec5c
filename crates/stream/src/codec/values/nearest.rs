//! The points that are nearest to a point and come before it, among candidates that many points share.
//!
//! Candidates lie in chunks of eight, by coordinate, so that a compiler can compare them all at once. Coordinates are whole
//! numbers of 21 bits, which single precision holds exactly; so it does every squared distance that counts, and what it rounds
//! is far beyond them.

use std::ops::Range;

use dapple_store::points::{PackedNormal, PointSet};

use super::near::{BLOCK, NEIGHBOURS};
use crate::codec::plane::direction;

/// Most blocks that neighbours are looked for in.
pub(super) const BLOCKS_SEARCHED: usize = 12;

/// How far a neighbour may lie back in the order of points.
pub(super) const MOST_BACK: usize = u16::MAX as usize;

/// How much farther points with other normals count: as this over 4096 for each squared step between them.
const ALIKE: u64 = 4096;

/// Candidates of a chunk.
const CHUNK: usize = 8;

/// Points that look through the same chunks: they follow each other, so they lie close together.
const GROUP: usize = 16;

/// Chunks whose candidates within reach are noted in one word.
const CHUNKS_AT_ONCE: usize = u64::BITS as usize / CHUNK;

const MOST_CHUNKS: usize = BLOCKS_SEARCHED * BLOCK / CHUNK;

/// Least and largest coordinates.
pub(super) type Bounds = [[u32; 3]; 2];

/// Whether two boxes have a place in common.
#[inline]
pub(super) fn touches(a: &Bounds, b: &Bounds) -> bool {
    let along = |axis: usize| (a[0][axis] <= b[1][axis]) & (a[1][axis] >= b[0][axis]);
    // No early end: one answer that is seldom guessed right is better than six.
    along(0) & along(1) & along(2)
}

/// What may be near the points of a part of a block, the last first. Kept to be used again.
#[derive(Clone, Debug)]
pub(crate) struct Candidates {
    chunks: Vec<Chunk>,
    /// By index within their set, before they are put into chunks; the first `count` count.
    kept: Box<[u32; BLOCKS_SEARCHED * BLOCK]>,
    count: usize,
}

/// Eight candidates; beyond the last one, none is within any reach.
#[derive(Clone, Debug)]
struct Chunk {
    positions: [[f32; CHUNK]; 3],
    /// Least and largest coordinates.
    bounds: [[f32; 3]; 2],
    /// Index within the set.
    points: [u32; CHUNK],
    /// Direction of the normal, and its squared length.
    normals: [[i32; 4]; CHUNK],
}

impl Default for Candidates {
    fn default() -> Candidates {
        Candidates { chunks: Vec::new(), kept: Box::new([0; BLOCKS_SEARCHED * BLOCK]), count: 0 }
    }
}

impl Candidates {
    /// Bytes held, by capacity: at most some 30,000.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&self.kept[..]) + self.chunks.capacity() * size_of::<Chunk>()
    }

    pub(super) fn clear(&mut self) {
        self.chunks.clear();
        self.count = 0;
    }

    /// Adds those of a block's points that lie in the box, the last first; each by its index within `positions`.
    pub(super) fn add(&mut self, positions: &[[u32; 3]], block: Range<usize>, [low, high]: &Bounds) {
        let size = [0, 1, 2].map(|axis| high[axis] - low[axis]);
        let mut count = self.count;
        let points = block.start as u32..block.end as u32;
        for (index, position) in points.rev().zip(positions[block].iter().rev()) {
            // Written always, kept if it is inside. There is always room: no more blocks are searched.
            let Some(place) = self.kept.get_mut(count) else { break };
            *place = index;
            // What is below is far above after it has wrapped.
            let inside = |axis: usize| position[axis].wrapping_sub(low[axis]) <= size[axis];
            count += usize::from(inside(0) & inside(1) & inside(2));
        }
        self.count = count;
    }

    /// Makes chunks of what was added.
    pub(super) fn arrange(&mut self, set: &PointSet) {
        for points in self.kept[..self.count].chunks(CHUNK) {
            let mut chunk = Chunk {
                positions: [[f32::INFINITY; CHUNK]; 3],
                bounds: [[f32::INFINITY; 3], [0.0; 3]],
                points: [0; CHUNK],
                normals: [[0; 4]; CHUNK],
            };
            for (lane, &point) in points.iter().enumerate() {
                let position = set.positions[point as usize];
                for (axis, coordinate) in position.map(|coordinate| coordinate as f32).into_iter().enumerate()
                {
                    chunk.positions[axis][lane] = coordinate;
                    chunk.bounds[0][axis] = chunk.bounds[0][axis].min(coordinate);
                    chunk.bounds[1][axis] = chunk.bounds[1][axis].max(coordinate);
                }
                chunk.points[lane] = point;
                chunk.normals[lane] = normal(set.normals[point as usize]);
            }
            self.chunks.push(chunk);
        }
    }

    /// The neighbours of the first `points` candidates: how far back each is.
    pub(super) fn nearest(&self, points: usize, reach: u32, mut found: impl FnMut(u32, [u16; NEIGHBOURS])) {
        let mut near = [0u8; MOST_CHUNKS];
        for start in (0..points).step_by(GROUP) {
            let group = start..points.min(start + GROUP);
            let first = start / CHUNK;
            let own = &self.chunks[first..group.end.div_ceil(CHUNK)];
            let low =
                |axis: usize| own.iter().fold(f32::INFINITY, |low, chunk| low.min(chunk.bounds[0][axis]));
            let high = |axis: usize| own.iter().fold(0f32, |high, chunk| high.max(chunk.bounds[1][axis]));
            let low = [0, 1, 2].map(|axis| low(axis) - reach as f32);
            let high = [0, 1, 2].map(|axis| high(axis) + reach as f32);
            let mut count = 0;
            for (at, chunk) in self.chunks.iter().enumerate().skip(first).take(MOST_CHUNKS) {
                near[count] = at as u8;
                let [least, most] = &chunk.bounds;
                let along = |axis: usize| (least[axis] <= high[axis]) & (most[axis] >= low[axis]);
                count += usize::from(along(0) & along(1) & along(2));
            }
            for own in group {
                // The chunks of a group come first and all touch it.
                let near = &near[own / CHUNK - first..count];
                found(self.chunks[own / CHUNK].points[own % CHUNK], self.nearest_of(own, near, reach));
            }
        }
    }

    /// How far back the nearest candidates after `own` are; where there are fewer than there should be, the nearest counts for
    /// them too. `near` are the chunks that may hold them, the first that of `own`.
    fn nearest_of(&self, own: usize, near: &[u8], reach: u32) -> [u16; NEIGHBOURS] {
        let (chunk, lane) = (&self.chunks[own / CHUNK], own % CHUNK);
        let (point, normal) = (chunk.points[lane], chunk.normals[lane]);
        let position = [0, 1, 2].map(|axis| chunk.positions[axis][lane]);
        let limit = u64::from(reach) * u64::from(reach);
        // A distance above, steps back below: of equals those come first that are nearer in the order.
        let mut best = [(limit + 1) << 16; NEIGHBOURS];
        // Only those that come after it in its own chunk, which is the first.
        let first = u64::from_le_bytes([1; CHUNK]);
        let mut after = !(first & (!0 >> (CHUNKS_AT_ONCE * (CHUNK - 1 - lane))));
        for near in near.chunks(CHUNKS_AT_ONCE) {
            let mut squared = [[0f32; CHUNK]; CHUNKS_AT_ONCE];
            // Those within reach: a word for each lane, a bit for each chunk.
            let mut hits = [0u32; CHUNK];
            for (at, (&chunk, squared)) in near.iter().zip(&mut squared).enumerate() {
                *squared = self.chunks[usize::from(chunk)].squared_distances(position);
                for (hits, squared) in hits.iter_mut().zip(squared) {
                    *hits |= if *squared <= limit as f32 { 1 << at } else { 0 };
                }
            }
            let mut hits =
                u64::from_le_bytes(hits.map(|hits| hits as u8)) & std::mem::replace(&mut after, !0);
            while hits != 0 {
                let at = hits.trailing_zeros() as usize;
                hits &= hits - 1;
                let (at, lane) = (at % CHUNKS_AT_ONCE, at / CHUNKS_AT_ONCE);
                let chunk = &self.chunks[usize::from(near[at])];
                let squared = squared[at][lane] as i32 as u64;
                let back = u64::from(point - chunk.points[lane]);
                let distance = stretched(squared, &normal, &chunk.normals[lane]);
                let far = back > MOST_BACK as u64;
                let mut key = if far { u64::MAX } else { distance.saturating_mul(1 << 16) | back };
                for best in &mut best {
                    (*best, key) = (key.min(*best), key.max(*best));
                }
            }
        }
        let nearest = best[0] as u16;
        best.map(|key| if key as u16 == 0 { nearest } else { key as u16 })
    }
}

impl Chunk {
    #[inline]
    fn squared_distances(&self, position: [f32; 3]) -> [f32; CHUNK] {
        std::array::from_fn(|lane| {
            let step = |axis: usize| self.positions[axis][lane] - position[axis];
            step(0) * step(0) + step(1) * step(1) + step(2) * step(2)
        })
    }
}

/// A normal's direction, and its squared length.
fn normal(packed: PackedNormal) -> [i32; 4] {
    let [x, y, z] = direction(packed).map(|component| component as i32);
    [x, y, z, x * x + y * y + z * z]
}

/// A squared distance, larger the more the normals differ; endless where they are at right angles or more.
#[inline]
fn stretched(squared: u64, a: &[i32; 4], b: &[i32; 4]) -> u64 {
    let facing = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let turned = (a[3] + b[3] - 2 * facing) as u64;
    if facing <= 0 { u64::MAX } else { squared * (ALIKE + turned) / ALIKE }
}
