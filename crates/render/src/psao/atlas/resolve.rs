//! From point values to texel values: for each point the texels it counts at, and exact sums.

use std::ops::Range;

use dapple_store::charts::{PointNeighbours, Site, SiteCut, TexelWeights, WEIGHT_SUM};
use dapple_store::points::PointSet;
use rayon::prelude::*;

/// Sum of a texel that is open.
const OPEN: u16 = 255 * WEIGHT_SUM;

/// For each point of a set the texels it counts at, ascending, with its weight there.
///
/// Neighbouring texels of a row are most of them, so a texel is told as its distance from the one before: about 2.4
/// bytes an entry.
#[derive(Clone, Debug, Default)]
pub(super) struct PointTexels {
    /// Where the run of each point begins in `runs`; one closing entry.
    starts: Vec<u32>,
    /// Per entry: texel − (texel before + 1) as a varint (the first − 0), then weight − 1.
    runs: Vec<u8>,
}

impl PointTexels {
    #[inline]
    pub(super) fn for_each(&self, point: usize, mut f: impl FnMut(u32, u16)) {
        let mut run = &self.runs[self.starts[point] as usize..self.starts[point + 1] as usize];
        let mut next = 0u32;
        while let [first, rest @ ..] = run {
            run = rest;
            let mut gap = u32::from(first & 0x7f);
            let (mut byte, mut shift) = (*first, 7);
            while byte & 0x80 != 0 {
                let [more, rest @ ..] = run else { return };
                run = rest;
                byte = *more;
                gap |= u32::from(byte & 0x7f) << shift;
                shift += 7;
            }
            let [weight, rest @ ..] = run else { return };
            run = rest;
            let texel = next + gap;
            next = texel + 1;
            f(texel, u16::from(*weight) + 1);
        }
    }

    pub(super) fn points(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    pub(super) fn bytes(&self) -> usize {
        self.runs.len() + self.starts.len() * size_of::<u32>()
    }
}

/// Bytes of a gap as a varint.
fn gap_bytes(gap: u32) -> u32 {
    (32 - (gap | 1).leading_zeros()).div_ceil(7)
}

/// Exact sums of weight × value, one a texel.
#[derive(Clone, Debug, Default)]
pub(super) struct Sums {
    sums: Vec<u16>,
}

impl Sums {
    /// Adds the change of a point's value at one texel; gives the texel's value.
    #[inline]
    pub(super) fn add(&mut self, texel: u32, weight: u16, difference: i32) -> u8 {
        let sum = &mut self.sums[texel as usize];
        // Weights sum to 256 and values are at most 255, so the true sum fits; modulo 2¹⁶ the way there does not matter.
        *sum = sum.wrapping_add((i32::from(weight) * difference) as u16);
        value_of(*sum)
    }

    pub(super) fn value(&self, texel: u32) -> u8 {
        value_of(self.sums[texel as usize])
    }

    pub(super) fn len(&self) -> usize {
        self.sums.len()
    }

    pub(super) fn bytes(&self) -> usize {
        self.sums.len() * size_of::<u16>()
    }
}

/// A sum / 256, rounded; at most 255, because a sum is at most 255 · 256.
fn value_of(sum: u16) -> u8 {
    ((u32::from(sum) + u32::from(WEIGHT_SUM) / 2) >> 8) as u8
}

/// Makes the tables of one set, a piece at a time.
pub(super) struct Builder {
    neighbours: PointNeighbours,
    sites: Vec<Site>,
    cuts: Vec<SiteCut>,
    texels: u32,
    /// Points a site has; filled as far as weights are made.
    counts: Vec<u8>,
    /// Site after site: point, and (weight − 1) in the highest 8 bits.
    entries: Vec<u32>,
    /// Per point: bytes of its run so far, later where to write next.
    at: Vec<u32>,
    /// Per point: the texel after its last one.
    next: Vec<u32>,
    encoded: usize,
    encoded_entries: usize,
    table: PointTexels,
}

impl Builder {
    /// `sites` ascend by texel, and all texels are below `texels`; `cuts` ascend by site.
    pub(super) fn new(
        neighbours: PointNeighbours,
        set: &PointSet,
        sites: Vec<Site>,
        cuts: Vec<SiteCut>,
        texels: u32,
    ) -> Builder {
        Builder {
            neighbours,
            cuts,
            texels,
            counts: Vec::with_capacity(sites.len()),
            entries: Vec::with_capacity(sites.len() * 5),
            sites,
            at: vec![0; set.len()],
            next: vec![0; set.len()],
            encoded: 0,
            encoded_entries: 0,
            table: PointTexels::default(),
        }
    }

    pub(super) fn bytes(&self) -> usize {
        self.neighbours.memory_bytes()
            + self.sites.capacity() * size_of::<Site>()
            + self.counts.capacity()
            + (self.entries.capacity() + self.at.len() + self.next.len()) * size_of::<u32>()
            + self.table.bytes()
    }

    pub(super) fn sites(&self) -> usize {
        self.sites.len()
    }

    pub(super) fn weighed(&self) -> usize {
        self.counts.len()
    }

    pub(super) fn encoded(&self) -> usize {
        self.encoded
    }

    /// Makes the weights of the next sites, at most `most`, in parallel.
    pub(super) fn weigh(&mut self, set: &PointSet, most: usize) {
        let first = self.counts.len();
        let piece = &self.sites[first..first.saturating_add(most).min(self.sites.len())];
        let (neighbours, cuts) = (&self.neighbours, &self.cuts);
        let cut = |site: usize| match cuts.binary_search_by_key(&site, |cut| cut.site as usize) {
            Ok(at) => cuts[at].mask,
            Err(_) => 0,
        };
        let weights: Vec<TexelWeights> = piece
            .par_iter()
            .enumerate()
            .with_min_len(256)
            .map_init(|| neighbours.weigher(set), |weigher, (i, site)| weigher.weigh(site, cut(first + i)))
            .collect();
        for (site, weights) in piece.iter().zip(&weights) {
            self.counts.push(weights.len() as u8);
            for (point, weight) in weights.iter() {
                self.entries.push(point | u32::from(weight - 1) << 24);
                let (bytes, next) = (&mut self.at[point as usize], &mut self.next[point as usize]);
                *bytes += gap_bytes(site.texel - *next) + 1;
                *next = site.texel + 1;
            }
        }
    }

    /// Makes room for the tables, once all weights are made.
    pub(super) fn begin_encoding(&mut self) {
        let mut starts = Vec::with_capacity(self.at.len() + 1);
        let mut total = 0u32;
        for at in &mut self.at {
            starts.push(total);
            total += std::mem::replace(at, total);
        }
        starts.push(total);
        self.next.fill(0);
        self.table = PointTexels { starts, runs: vec![0; total as usize] };
    }

    /// Writes the entries of the next sites, at most `most`, into the tables.
    pub(super) fn encode(&mut self, most: usize) {
        let end = self.encoded.saturating_add(most).min(self.sites.len());
        for index in self.encoded..end {
            let texel = self.sites[index].texel;
            let count = usize::from(self.counts[index]);
            for &entry in &self.entries[self.encoded_entries..][..count] {
                let (point, weight) = ((entry & 0xff_ffff) as usize, (entry >> 24) as u8);
                let mut at = self.at[point] as usize;
                let mut gap = texel - self.next[point];
                while gap >= 0x80 {
                    self.table.runs[at] = gap as u8 | 0x80;
                    gap >>= 7;
                    at += 1;
                }
                self.table.runs[at] = gap as u8;
                self.table.runs[at + 1] = weight;
                self.at[point] = at as u32 + 2;
                self.next[point] = texel + 1;
            }
            self.encoded_entries += count;
        }
        self.encoded = end;
    }

    /// The tables, and sums in which every point still has value 0 (texels without points are open).
    pub(super) fn finish(self) -> (PointTexels, Sums) {
        let mut sums = vec![OPEN; self.texels as usize];
        for (site, &count) in self.sites.iter().zip(&self.counts) {
            if count > 0 {
                sums[site.texel as usize] = 0;
            }
        }
        (self.table, Sums { sums })
    }
}

/// Adds the values of `points` to the sums.
pub(super) fn add_values(table: &PointTexels, sums: &mut Sums, values: &[u8], points: Range<usize>) {
    for point in points {
        let value = i32::from(values[point]);
        table.for_each(point, |texel, weight| {
            sums.add(texel, weight, value);
        });
    }
}
