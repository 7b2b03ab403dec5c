//! Ray directions that belong to a point for ever.

use glam::Vec3;

use crate::sampling::fixed_pattern;

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
        let mut one = Vec::new();
        for pattern in 0..PATTERNS {
            one.clear();
            fixed_pattern(rays, crate::sampling::hash(0x9a77, u64::from(pattern), 0), &mut one);
            directions.extend_from_slice(&one);
        }
        Patterns { rays: rays as usize, directions }
    }

    /// Directions around +Z in the point's surface frame.
    pub(super) fn of(&self, site: u32) -> &[Vec3] {
        let pattern = (site % PATTERNS) as usize;
        &self.directions[pattern * self.rays..(pattern + 1) * self.rays]
    }
}
