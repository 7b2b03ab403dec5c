//! Ray directions that belong to a point for ever.

use glam::Vec3;

use crate::sampling::{extend_pattern, hash};

/// A table of cosine-distributed patterns; a point's site number chooses one.
///
/// Fresh rays each frame would make every point flicker within its noise, and cost 6–8 times the bits.
#[derive(Clone, Debug)]
pub(super) struct Patterns {
    rays: usize,
    directions: Vec<Vec3>,
}

/// Enough that neighbours hardly ever share one (shared patterns show as banding), few enough to stay in cache.
const PATTERNS: u32 = 256;

impl Patterns {
    pub(super) fn new(rays: u32) -> Patterns {
        let mut directions = Vec::with_capacity((PATTERNS * rays) as usize);
        for pattern in 0..PATTERNS {
            extend_pattern(0..rays, seed(pattern), &mut directions);
        }
        Patterns { rays: rays as usize, directions }
    }

    /// The first directions around +Z in the point's surface frame.
    pub(super) fn of(&self, site: u32) -> &[Vec3] {
        let pattern = (site % PATTERNS) as usize;
        &self.directions[pattern * self.rays..(pattern + 1) * self.rays]
    }

    /// Those of some indices, of which the first ones are those of [`Patterns::of`].
    pub(super) fn extend(&self, site: u32, indices: std::ops::Range<u32>, out: &mut Vec<Vec3>) {
        extend_pattern(indices, seed(site % PATTERNS), out);
    }

    pub(super) fn bytes(&self) -> usize {
        self.directions.capacity() * size_of::<Vec3>()
    }
}

fn seed(pattern: u32) -> u32 {
    hash(0x9a77, u64::from(pattern), 0)
}
