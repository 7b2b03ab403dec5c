//! Directions that stand for the light of a cap, the same for all that is shaded with them.

use std::sync::LazyLock;

/// Directions evenly in a cap, by lanes: part of the cap's height, and the turn about the axis.
pub(crate) struct Pattern<const N: usize> {
    pub(crate) height: [f32; N],
    pub(crate) cos: [f32; N],
    pub(crate) sin: [f32; N],
}

impl<const N: usize> Pattern<N> {
    /// A spiral of golden turns, the same for all: patterns that differ from sample to sample would be noise.
    fn new() -> Pattern<N> {
        const GOLDEN_TURN: f64 = 2.399_963_229_728_653;
        let mut pattern = Pattern { height: [0.0; N], cos: [1.0; N], sin: [0.0; N] };
        for i in 0..N {
            let turn = i as f64 * GOLDEN_TURN;
            pattern.height[i] = ((i as f64 + 0.5) / N as f64) as f32;
            pattern.cos[i] = libm::cos(turn) as f32;
            pattern.sin[i] = libm::sin(turn) as f32;
        }
        if N == 1 {
            pattern.height[0] = 0.0;
        }
        pattern
    }
}

pub(crate) static ONE: LazyLock<Pattern<1>> = LazyLock::new(Pattern::new);
pub(crate) static FOUR: LazyLock<Pattern<4>> = LazyLock::new(Pattern::new);
pub(crate) static EIGHT: LazyLock<Pattern<8>> = LazyLock::new(Pattern::new);
pub(crate) static SIXTEEN: LazyLock<Pattern<16>> = LazyLock::new(Pattern::new);
pub(crate) static SIXTY_FOUR: LazyLock<Pattern<64>> = LazyLock::new(Pattern::new);
