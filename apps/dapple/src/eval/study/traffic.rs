//! Counts the bytes that come from a card's memory while a sampling pass runs: a model of its caches, fed with the texels that the method reads.

use dapple_render::alchemy::{self, AlchemyParams};
use dapple_render::gbuffer::Screen;
use dapple_render::sao::{self, Pyramid, SaoParams};

/// A set-associative cache that drops what was used longest ago. Lines are known by number.
pub(super) struct LineCache {
    /// Lines of each set, the latest used first.
    sets: Vec<Vec<u64>>,
    ways: usize,
}

impl LineCache {
    pub(super) fn new(bytes: usize, line_bytes: usize, ways: usize) -> LineCache {
        let sets = (bytes / line_bytes / ways).max(1);
        LineCache { sets: vec![Vec::with_capacity(ways); sets], ways }
    }

    /// Whether the line is there; it is afterwards.
    pub(super) fn read(&mut self, line: u64) -> bool {
        // Rows of blocks must not all fall into the same sets.
        let hash = line.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 24;
        let count = self.sets.len() as u64;
        let set = &mut self.sets[(hash % count) as usize];
        if let Some(at) = set.iter().position(|other| *other == line) {
            set[..=at].rotate_right(1);
            return true;
        }
        if set.len() == self.ways {
            set.pop();
        }
        set.insert(0, line);
        false
    }
}

/// The card: groups of 16 × 16 samples are given to processors in the order of the picture, as many at a time as fit, and all of them do each read together.
#[derive(Debug, Clone, Copy)]
pub(super) struct Card {
    pub(super) line_bytes: usize,
    processors: usize,
    /// At a time on each processor.
    groups: usize,
    first_bytes: usize,
    first_ways: usize,
    second_bytes: usize,
    second_ways: usize,
}

impl Card {
    /// Like a GeForce GTX 580, the paper's: 16 processors with 48 KiB each, of 1536 threads, and 768 KiB together.
    pub(super) fn gtx_580(line_bytes: usize) -> Card {
        Card {
            line_bytes,
            processors: 16,
            groups: 6,
            first_bytes: 48 << 10,
            first_ways: 6,
            second_bytes: 768 << 10,
            second_ways: 16,
        }
    }
}

/// Bytes a sample of the picture.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Traffic {
    /// What the pass asks for.
    pub(super) asked: f64,
    /// What the processors' own caches let through.
    pub(super) second: f64,
    /// What comes from memory.
    pub(super) memory: f64,
}

/// A texture in blocks of as many texels as fill a line, as square as can be.
struct Texture {
    first_line: u64,
    blocks: u64,
    block: [u32; 2],
}

impl Texture {
    fn new(columns: usize, rows: usize, texel_bytes: usize, line_bytes: usize, next: &mut u64) -> Texture {
        let log = (line_bytes / texel_bytes).max(1).ilog2();
        let block = [log.div_ceil(2), log / 2];
        let blocks = columns.div_ceil(1 << block[0]) as u64;
        let first_line = *next;
        *next += blocks * rows.div_ceil(1 << block[1]) as u64;
        Texture { first_line, blocks, block }
    }

    fn line(&self, [column, row]: [usize; 2]) -> u64 {
        self.first_line + (row >> self.block[1]) as u64 * self.blocks + (column >> self.block[0]) as u64
    }
}

/// Side of a group of samples.
const GROUP: usize = 16;
/// Numbers of lines that stand for no read.
const NONE: u64 = u64::MAX;

/// Runs a pass of at most `reads` reads a sample; `lines` puts down the lines of one sample, and gives the bytes that it asks for.
fn run(
    card: &Card,
    [columns, rows]: [usize; 2],
    reads: usize,
    mut lines: impl FnMut([usize; 2], &mut [u64]) -> usize,
) -> Traffic {
    let mut first: Vec<LineCache> = (0..card.processors)
        .map(|_| LineCache::new(card.first_bytes, card.line_bytes, card.first_ways))
        .collect();
    let mut second = LineCache::new(card.second_bytes, card.line_bytes, card.second_ways);
    let (mut asked, mut missed_first, mut missed_second) = (0usize, 0usize, 0usize);
    let (across, down) = (columns.div_ceil(GROUP), rows.div_ceil(GROUP));
    let wave = card.processors * card.groups;
    let mut all = Vec::new();
    for start in (0..across * down).step_by(wave) {
        let groups = start..(start + wave).min(across * down);
        all.clear();
        for group in groups.clone() {
            for i in 0..GROUP * GROUP {
                let at = [group % across * GROUP + i % GROUP, group / across * GROUP + i / GROUP];
                let begin = all.len();
                all.resize(begin + reads, NONE);
                if at[0] < columns && at[1] < rows {
                    asked += lines(at, &mut all[begin..]);
                }
            }
        }
        for read in 0..reads {
            for (number, samples) in all.chunks(reads * GROUP * GROUP).enumerate() {
                let own = &mut first[number % card.processors];
                for line in samples.iter().skip(read).step_by(reads).filter(|line| **line != NONE) {
                    if !own.read(*line) {
                        missed_first += 1;
                        missed_second += usize::from(!second.read(*line));
                    }
                }
            }
        }
    }
    let a_sample = |bytes: usize| bytes as f64 / (columns * rows).max(1) as f64;
    Traffic {
        asked: a_sample(asked),
        second: a_sample(missed_first * card.line_bytes),
        memory: a_sample(missed_second * card.line_bytes),
    }
}

/// Bytes of AlchemyAO's texels: a position in four singles, a normal in four bytes.
const POSITION_BYTES: usize = 16;
const NORMAL_BYTES: usize = 4;
/// Bytes of SAO's: a distance in single precision.
const DISTANCE_BYTES: usize = 4;

/// Of AlchemyAO's sampling pass.
pub(super) fn of_alchemy(card: &Card, screen: &Screen, params: &AlchemyParams) -> Traffic {
    let size = [screen.columns() as usize, screen.rows() as usize];
    let mut next = 0;
    let mut texture = |bytes| Texture::new(size[0], size[1], bytes, card.line_bytes, &mut next);
    let (positions, normals) = (texture(POSITION_BYTES), texture(NORMAL_BYTES));
    let sampler = alchemy::Sampler::new(screen, params);
    run(card, size, params.samples as usize + 2, |at, lines| {
        let mut asked = NORMAL_BYTES;
        lines[1] = normals.line(at);
        sampler.visit_reads(at, &mut |read, texel| {
            lines[if read == 0 { 0 } else { read + 1 }] = positions.line(texel);
            asked += POSITION_BYTES;
        });
        asked
    })
}

/// Of SAO's.
pub(super) fn of_sao(card: &Card, screen: &Screen, params: &SaoParams) -> Traffic {
    let size = [screen.columns() as usize, screen.rows() as usize];
    let pyramid = Pyramid::new(screen, params.filter, params.levels);
    let mut next = 0;
    let levels: Vec<Texture> = (0..pyramid.levels())
        .map(|level| {
            let [columns, rows] = size.map(|side| side.div_ceil(1 << level));
            Texture::new(columns, rows, DISTANCE_BYTES, card.line_bytes, &mut next)
        })
        .collect();
    let sampler = sao::Sampler::new(screen, &pyramid, params);
    run(card, size, params.samples as usize + 1, |at, lines| {
        let mut asked = 0;
        sampler.visit_reads(at, &mut |read, level, texel| {
            lines[read] = levels[level].line(texel);
            asked += DISTANCE_BYTES;
        });
        asked
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cache_keeps_what_was_used_last() {
        let mut cache = LineCache::new(4 * 64, 64, 4);
        assert!([1, 2, 3, 4].iter().all(|line| !cache.read(*line)));
        assert!(cache.read(1) && cache.read(3));
        assert!(!cache.read(5), "2 goes");
        assert!(cache.read(1) && cache.read(4) && cache.read(3) && cache.read(5) && !cache.read(2));
        // Sets are apart: a cache of many lines keeps about as many.
        let mut cache = LineCache::new(768 << 10, 64, 16);
        let lines = 768 * 1024 / 64;
        (0..lines * 3 / 4).for_each(|line| assert!(!cache.read(line)));
        let kept = (0..lines * 3 / 4).filter(|line| cache.read(*line)).count() as u64;
        assert!(kept > lines * 7 / 10, "{kept} of {}", lines * 3 / 4);
    }

    #[test]
    fn textures_do_not_share_lines_and_blocks_are_square() {
        let mut next = 0;
        let textures = [(33, 21, 4), (17, 11, 4), (9, 9, 16)]
            .map(|(columns, rows, bytes)| (columns, rows, Texture::new(columns, rows, bytes, 64, &mut next)));
        let mut all = std::collections::BTreeMap::<u64, usize>::new();
        for (columns, rows, texture) in &textures {
            for at in (0..columns * rows).map(|i| [i % columns, i / columns]) {
                *all.entry(texture.line(at)).or_default() += 1;
            }
        }
        assert_eq!(all.values().sum::<usize>(), 33 * 21 + 17 * 11 + 81);
        assert!(all.keys().all(|line| *line < next) && all.len() as u64 == next);
        assert_eq!(all.values().copied().max(), Some(16));
        assert_eq!(textures[0].2.line([3, 3]), textures[0].2.line([0, 0]));
        assert_eq!(textures[2].2.line([1, 1]), textures[2].2.line([0, 0]));
        assert_ne!(textures[2].2.line([2, 0]), textures[2].2.line([0, 0]));
    }

    /// Every sample reads its own texel: each line comes once, all else from the first cache.
    #[test]
    fn a_picture_that_is_read_in_place_comes_once() {
        let card = Card::gtx_580(64);
        let (size, mut next) = ([160, 96], 0);
        let texture = Texture::new(size[0], size[1], 4, 64, &mut next);
        let traffic = run(&card, size, 2, |at, lines| {
            lines.fill(texture.line(at));
            8
        });
        assert_eq!(traffic, Traffic { asked: 8.0, second: 4.0, memory: 4.0 });
    }
}
