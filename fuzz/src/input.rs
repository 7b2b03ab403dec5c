//! Bytes as choices, and choices as bytes.

use std::sync::Arc;

use dapple_store::points::{PackedNormal, PointLayout, PointSet, PointStore, morton_code};
use dapple_stream::{Publisher, PublisherConfig};

/// Splitmix64: random numbers from a seed.
#[derive(Clone, Debug)]
pub struct Random(pub u64);

impl Random {
    /// The next 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    /// A number below `n`, or 0.
    pub fn below(&mut self, n: usize) -> usize {
        (self.bits() % (n as u64).max(1)) as usize
    }
}

/// Choices taken from bytes; after their end all are 0.
pub(crate) struct Input<'a>(pub(crate) &'a [u8]);

impl Input<'_> {
    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub(crate) fn byte(&mut self) -> u8 {
        match self.0.split_first() {
            Some((&first, rest)) => {
                self.0 = rest;
                first
            }
            None => 0,
        }
    }

    /// A number below `n` (at most 65,536), or 0.
    pub(crate) fn below(&mut self, n: usize) -> usize {
        usize::from(u16::from_le_bytes([self.byte(), self.byte()])) % n.max(1)
    }

    /// A store of up to 3 sets of up to 40 points, with or without bent normals.
    pub(crate) fn store(&mut self) -> PointStore {
        let mut instance = 0;
        let sets: Vec<PointSet> = (0..self.below(4))
            .map(|_| {
                instance += 1 + u32::from(self.byte());
                // Small coordinates and, with a shift, any of 21 bits.
                let shift = u32::from(self.byte()) % 14;
                let mut points: Vec<([u32; 3], PackedNormal)> = (0..self.below(41))
                    .map(|_| {
                        let position = [self.byte(), self.byte(), self.byte()].map(|c| u32::from(c) << shift);
                        (position, PackedNormal([self.byte(), self.byte() & 0x81]))
                    })
                    .collect();
                points.sort_by_key(|&(p, n)| (morton_code(p), n));
                let mut set = PointSet { instance, ..PointSet::default() };
                set.origin_rest.x = f32::from(self.byte());
                set.positions = points.iter().map(|p| p.0).collect();
                set.normals = points.iter().map(|p| p.1).collect();
                set
            })
            .collect();
        let spacing = self.byte();
        let has_bent = spacing & 1 == 1;
        let spacing = f32::from(spacing) + 0.5;
        let layout = Arc::new(PointLayout::new(1.0, spacing, sets).expect("points were sorted"));
        let points = layout.len();
        let mut plane = || (0..points).map(|_| self.byte()).collect();
        let store = PointStore::new(layout, plane()).expect("one value a point");
        if has_bent { store.with_bent([plane(), plane()]).expect("one a point") } else { store }
    }
}

/// The frame that carries a store: equal bytes mean stores that are equal to the bit.
pub(crate) fn fingerprint(store: &PointStore) -> Arc<[u8]> {
    let mut publisher = Publisher::new([0; 32], PublisherConfig::default());
    publisher.publish(store).expect("the first state").bytes
}
