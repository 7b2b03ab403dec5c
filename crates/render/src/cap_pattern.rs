//! Directions that stand for the light of a cap, the same for all that is shaded with them.

use std::sync::LazyLock;

/// Directions evenly in a cap, by lanes: part of the cap's height, and the turn about the axis.
pub(crate) struct Pattern<const N: usize> {
    pub(crate) height: [f32; N],
    pub(crate) cos: [f32; N],
    pub(crate) sin: [f32; N],
}

/// Directions of a ring, a right angle apart: their mean is the axis, and they are spread alike in all directions about it. A spiral of four leans by
/// a sixth of the cap's radius, which moves highlights.
const RING: usize = 4;
/// Part of a ring's height that its directions lie at. Lobes made wider by what each direction stands for (α² by (1 − cos a) / 4N) are then, all together, as high in
/// the middle as the cap's, to second order; in the middle of the ring, at 2, they would be too low, and have too much spread.
const INSET: f64 = 1.75;
/// How far a ring is turned against the one inside it: a right angle's golden section.
const RING_TURN: f64 = 0.970_805_519_362_733;

impl<const N: usize> Pattern<N> {
    /// The same for all: patterns that differ from sample to sample would be noise.
    fn new() -> Pattern<N> {
        let mut pattern = Pattern { height: [0.0; N], cos: [1.0; N], sin: [0.0; N] };
        for i in 0..N {
            let (ring, step) = (i / RING, i % RING);
            let turn = ring as f64 * RING_TURN + step as f64 * std::f64::consts::FRAC_PI_2;
            pattern.height[i] = (((ring * RING) as f64 + INSET) / N as f64) as f32;
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean and variance across the axis, in parts of the cap's radius.
    fn moments<const N: usize>(pattern: &Pattern<N>) -> ([f32; 2], [f32; 3]) {
        let at = |i: usize| [pattern.cos[i], pattern.sin[i]].map(|v| v * pattern.height[i].sqrt());
        let mean = |of: &dyn Fn([f32; 2]) -> f32| (0..N).map(|i| of(at(i))).sum::<f32>() / N as f32;
        let middle = [mean(&|[x, _]| x), mean(&|[_, y]| y)];
        (middle, [mean(&|[x, _]| x * x), mean(&|[_, y]| y * y), mean(&|[x, y]| x * y)])
    }

    #[test]
    fn directions_have_the_mean_and_the_spread_of_the_cap() {
        let all =
            [(4, moments(&FOUR)), (8, moments(&EIGHT)), (16, moments(&SIXTEEN)), (64, moments(&SIXTY_FOUR))];
        for (count, (middle, [x, y, xy])) in all {
            assert!(middle.iter().chain([&xy]).all(|v| v.abs() < 1e-6), "{count}: {middle:?}, {xy}");
            // A disc of radius 1 has 1/4.
            let whole = 0.25 - 0.125 / count as f32;
            assert!((x - whole).abs() < 1e-6 && (y - whole).abs() < 1e-6, "{count}: {x}, {y}, {whole}");
        }
    }
}
