//! From point values to texel values: for each point the texels it counts at, and exact sums.

use std::ops::Range;

use dapple_store::charts::{PointNeighbours, Site, SiteCut, TexelWeights, WEIGHT_SUM};
use dapple_store::points::PointSet;
use rayon::prelude::*;

/// Sum of a texel that is open.
const OPEN: u16 = 255 * WEIGHT_SUM;

/// Bits of a run's head that hold its texels − 1.
const COUNT_BITS: u32 = 3;
/// Most texels of a run.
const MOST_OF_RUN: u32 = 1 << COUNT_BITS;

/// For each point of a set the texels it counts at, ascending, with its weight there.
///
/// Most of them follow each other in a few rows of a page, so they are told in runs of up to 8 neighbours, about
/// 1.7 bytes a texel.
#[derive(Clone, Debug, Default)]
pub(super) struct PointTexels {
    /// Where the runs of each point begin in `runs`; one closing entry.
    starts: Vec<u32>,
    /// Per run: its head, then a byte a texel, weight − 1. The head is a varint (7 bits a byte, lowest first):
    /// texels − 1 in the lowest [`COUNT_BITS`], above them first texel − (texel before + 1), the first − 0.
    runs: Vec<u8>,
}

impl PointTexels {
    /// Hands over the runs of a point: first texel, and of each texel weight − 1.
    #[inline]
    pub(super) fn for_each_run<'a>(&'a self, point: usize, mut f: impl FnMut(u32, &'a [u8])) {
        let mut left = &self.runs[self.starts[point] as usize..self.starts[point + 1] as usize];
        let mut next = 0u32;
        while let [first, rest @ ..] = left {
            left = rest;
            let mut head = u32::from(first & 0x7f);
            let (mut byte, mut shift) = (*first, 7);
            while byte & 0x80 != 0 {
                let [more, rest @ ..] = left else { return };
                left = rest;
                byte = *more;
                head |= u32::from(byte & 0x7f) << shift;
                shift += 7;
            }
            let count = (head & (MOST_OF_RUN - 1)) + 1;
            let Some((weights, rest)) = left.split_at_checked(count as usize) else { return };
            left = rest;
            let texel = next + (head >> COUNT_BITS);
            next = texel + count;
            f(texel, weights);
        }
    }

    /// Reads where the runs of points begin, then the first byte of each; what it gives means nothing.
    #[inline]
    pub(super) fn read_ahead(&self, points: impl Iterator<Item = usize> + Clone) -> u8 {
        let starts = points.clone().fold(0, |all, point| all ^ self.starts[point]);
        let runs = points.fold(0, |all, point| match self.runs.get(self.starts[point] as usize) {
            Some(byte) => all ^ byte,
            None => all,
        });
        starts as u8 ^ runs
    }

    pub(super) fn points(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    pub(super) fn bytes(&self) -> usize {
        self.runs.len() + self.starts.len() * size_of::<u32>()
    }
}

/// Bytes of the head of a run that begins `gap` texels after the one before ended.
fn head_bytes(gap: u32) -> u32 {
    (32 + COUNT_BITS - (gap | 1).leading_zeros()).div_ceil(7)
}

/// Whether a texel `gap` texels after the last one of a run of so many (none: 0) begins a new one.
fn is_new_run(gap: u32, texels: u32) -> bool {
    gap > 0 || texels == 0 || texels == MOST_OF_RUN
}

/// Exact sums of weight × value, one a texel.
#[derive(Clone, Debug, Default)]
pub(super) struct Sums {
    sums: Vec<u16>,
}

impl Sums {
    /// Adds the change of a point's value along a run; gives each texel's value to `f`, which takes them in order.
    #[inline]
    pub(super) fn add(&mut self, first_texel: u32, weights: &[u8], difference: i32, mut f: impl FnMut(u8)) {
        for (sum, &weight) in self.sums[first_texel as usize..][..weights.len()].iter_mut().zip(weights) {
            // Weights sum to 256 and values are at most 255, so the true sum fits; modulo 2¹⁶ the way there does not matter.
            *sum = sum.wrapping_add(((i32::from(weight) + 1) * difference) as u16);
            f(value_of(*sum));
        }
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
    /// Per point: bytes of its runs so far, later where to write next.
    at: Vec<u32>,
    /// Per point: texels of its last run so far, later where that run begins.
    run: Vec<u32>,
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
            run: vec![0; set.len()],
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
            + (self.entries.capacity() + 3 * self.at.len()) * size_of::<u32>()
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
                let point = point as usize;
                let gap = site.texel - self.next[point];
                if is_new_run(gap, self.run[point]) {
                    self.at[point] += head_bytes(gap);
                    self.run[point] = 0;
                }
                self.at[point] += 1;
                self.run[point] += 1;
                self.next[point] = site.texel + 1;
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
                let gap = texel - self.next[point];
                let runs = &mut self.table.runs;
                let run = self.run[point] as usize;
                let texels = if at == self.table.starts[point] as usize {
                    0
                } else {
                    (u32::from(runs[run]) & (MOST_OF_RUN - 1)) + 1
                };
                if is_new_run(gap, texels) {
                    self.run[point] = at as u32;
                    // A mesh has at most 2²² texels, both sides counted.
                    let mut head = gap << COUNT_BITS;
                    while head >= 0x80 {
                        runs[at] = head as u8 | 0x80;
                        head >>= 7;
                        at += 1;
                    }
                    runs[at] = head as u8;
                    at += 1;
                } else {
                    // The count lies in the lowest bits, and stays there.
                    runs[run] += 1;
                }
                runs[at] = weight;
                self.at[point] = at as u32 + 1;
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
        table.for_each_run(point, |texel, weights| sums.add(texel, weights, value, |_| ()));
    }
}
