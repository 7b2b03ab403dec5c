//! Where numbers stand among limits, which chooses chances: for those that every point asks for, from tables.

/// Where the largest change of a leaf's neighbours stands.
pub(super) const LEAF_RANKS: [i32; 7] = [1, 4, 8, 12, 16, 32, 64];

/// Where the distance from the neighbours stands, 8ths.
const GAP_RANKS: [i32; 7] = [-128, -48, -16, 16, 48, 128, 320];

/// Where the size of the neighbours' numbers stands, 8ths: for whether a number is 0, and for its size.
const SIZE_RANKS: ([i32; 5], [i32; 4]) = ([1, 4, 8, 14, 28], [1, 8, 16, 32]);

/// Where the neighbours' change stands, 8ths: for whether a number is 0, for its sign, and for its size.
const STRENGTH_RANKS: ([i32; 5], [i32; 4], [i32; 4]) =
    ([1, 24, 64, 128, 256], [1, 24, 64, 160], [1, 32, 96, 224]);

/// From here on, sizes and strengths stand where this does.
const MOST_SIZE: usize = 32;
const MOST_STRENGTH: usize = 256;

/// Parts of the indices of chances, by size and by strength: their sums are the indices.
static BY_SIZE: [Of; MOST_SIZE + 1] = {
    let mut table = [Of(0); MOST_SIZE + 1];
    let mut at = 0;
    while at <= MOST_SIZE {
        let (some, size) = (rank(at as i32, &SIZE_RANKS.0), rank(at as i32, &SIZE_RANKS.1));
        table[at] = Of::new(some * 18, 0, size * 5);
        at += 1;
    }
    table
};
static BY_STRENGTH: [Of; MOST_STRENGTH + 1] = {
    let (some, against, size) = STRENGTH_RANKS;
    let mut table = [Of(0); MOST_STRENGTH + 1];
    let mut at = 0;
    while at <= MOST_STRENGTH {
        let strength = at as i32;
        let ranks = [rank(strength, &some), rank(strength, &against), rank(strength, &size)];
        table[at] = Of::new(ranks[0] * 3, ranks[1] * 3, ranks[2]);
        at += 1;
    }
    table
};

/// Where a point's neighbours stand: where its chances begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Of(u32);

impl Of {
    /// Each below 256, also their sums.
    const fn new(some: usize, against: usize, size: usize) -> Of {
        Of((some | against << 8 | size << 16) as u32)
    }

    /// By the size of the neighbours' numbers, at least 0, and how much they changed, both in 8ths.
    #[inline]
    pub(super) fn point(size: i32, drift: i32) -> Of {
        let size = BY_SIZE[(size as usize).min(MOST_SIZE)];
        let strength = BY_STRENGTH[(drift.unsigned_abs() as usize).min(MOST_STRENGTH)];
        Of(size.0 + strength.0)
    }

    /// For whether a number is other than 0: the first of three, by edge, of 36 times as many.
    #[inline]
    pub(super) fn some(self) -> usize {
        (self.0 & 0xff) as usize
    }

    /// For the sign: the first of three, by edge, of five times as many.
    #[inline]
    pub(super) fn against(self) -> usize {
        (self.0 >> 8 & 0xff) as usize
    }

    /// For the size: one of 25.
    #[inline]
    pub(super) fn size(self) -> usize {
        (self.0 >> 16) as usize
    }
}

/// Where a distance from the neighbours stands, of 8.
#[inline]
pub(super) fn gap_rank(gap: i32) -> usize {
    rank(gap, &GAP_RANKS)
}

/// Where `value` stands among ascending `limits`: how many it reaches.
#[inline]
pub(super) const fn rank<const N: usize>(value: i32, limits: &[i32; N]) -> usize {
    let (mut rank, mut at) = (0, 0);
    while at < N {
        rank += (value >= limits[at]) as usize;
        at += 1;
    }
    rank
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_hold_what_is_counted() {
        for size in 0..=120 {
            for drift in -2040..=2040i32 {
                let (of, strength) = (Of::point(size, drift), drift.abs());
                let some = rank(size, &SIZE_RANKS.0) * 6 + rank(strength, &STRENGTH_RANKS.0);
                assert_eq!(of.some(), some * 3, "{size} {drift}");
                assert_eq!(of.against(), rank(strength, &STRENGTH_RANKS.1) * 3, "{size} {drift}");
                let kind = rank(size, &SIZE_RANKS.1) * 5 + rank(strength, &STRENGTH_RANKS.2);
                assert_eq!(of.size(), kind, "{size} {drift}");
            }
        }
    }
}
