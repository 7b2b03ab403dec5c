//! Numbers that differ from sample to sample of a picture, alike on every machine.

/// AlchemyAO's hash (\[McGuire2012\] eq. 8), an angle in radians: how far the pattern of a sample is turned.
pub(crate) fn alchemy_turn([column, row]: [usize; 2]) -> f32 {
    let (x, y) = (column as u32, row as u32);
    let hash = (x.wrapping_mul(3) ^ y.wrapping_add(x.wrapping_mul(y))).wrapping_mul(10);
    // Of large angles single precision keeps little.
    (f64::from(hash) % std::f64::consts::TAU) as f32
}

/// Interleaved gradient noise (J. Jimenez, *Next Generation Post Processing in Call of Duty: Advanced Warfare*, SIGGRAPH 2014), 0 … 1: any
/// 3 × 3 neighbours have about all values between them, which a small blur makes even.
pub(crate) fn interleaved_gradient([column, row]: [usize; 2]) -> f32 {
    let inner = 0.067_110_56 * column as f64 + 0.005_837_15 * row as f64;
    (52.982_918_9 * inner.fract()).fract() as f32
}

/// Bits that depend on every bit of every word, and on their order: rounds of the finaliser of MurmurHash3.
pub(crate) fn hash(words: impl IntoIterator<Item = u32>) -> u32 {
    let mix = |mut h: u32| {
        h ^= h >> 16;
        h = h.wrapping_mul(0x85eb_ca6b);
        h ^= h >> 13;
        h = h.wrapping_mul(0xc2b2_ae35);
        h ^ (h >> 16)
    };
    words.into_iter().fold(0, |h: u32, v| mix((h ^ v).wrapping_add(0x9e37_79b9)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_spread_evenly() {
        let (mut eighths, mut sectors) = ([0; 8], [0; 8]);
        for at in (0..64 * 64).map(|i| [i % 64 + 100, i / 64 + 40]) {
            eighths[(8.0 * interleaved_gradient(at)) as usize] += 1;
            let turn = alchemy_turn(at);
            assert!((0.0..std::f32::consts::TAU + 1e-6).contains(&turn), "{turn}");
            sectors[((8.0 * turn / std::f32::consts::TAU) as usize).min(7)] += 1;
        }
        for count in eighths.into_iter().chain(sectors) {
            // 512 expected.
            assert!((420..610).contains(&count), "{eighths:?}, {sectors:?}");
        }
    }
}
