//! Directions that depend on nothing but a seed, a site and a sample.
//!
//! [`fixed_pattern`] is a scrambled (0,2)-sequence (\[Sobol1967\] in two dimensions) with nested uniform scrambling by
//! a hash (\[Owen1995\], \[Burley2020\]), mapped to the hemisphere so that directions have cosine density.
//!
//! \[Burley2020\]: B. Burley, "Practical Hash-based Owen Scrambling", JCGT 9 (4), 2020.

use dapple_scene::glam::Vec3;
pub use dapple_store::points::orthonormal_basis;

/// A well mixed 32-bit hash of a seed, a site and a sample: every bit of the result depends on every bit of all three.
pub fn hash(seed: u64, site: u64, sample: u32) -> u32 {
    let x = mix(seed.wrapping_add(0x9e37_79b9_7f4a_7c15));
    let x = mix((x ^ site).wrapping_add(0x9e37_79b9_7f4a_7c15));
    (mix((x ^ u64::from(sample)).wrapping_add(0x9e37_79b9_7f4a_7c15)) >> 32) as u32
}

/// A bijection of 64 bits in which each input bit changes half the output bits (Stafford's 13th variant of the
/// MurmurHash3 finaliser).
fn mix(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// The upper 24 bits as a number in `[0, 1)`.
pub fn unit_interval(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / (1 << 24) as f32)
}

/// A unit direction around +Z with density cos θ / π, from `u` in `[0, 1)²`: `u[0]` is sin² θ, `u[1]` the turn about Z.
pub fn cosine_hemisphere(u: [f32; 2]) -> Vec3 {
    let (sin, cos) = sin_cos_turns(u[1]);
    let r = u[0].max(0.0).sqrt();
    Vec3::new(r * cos, r * sin, (1.0 - u[0]).max(0.0).sqrt())
}

/// Sine and cosine of `turns` full circles, for `turns` in `[0, 1]`, to 2e-7; only additions and multiplications, so
/// the same on every machine, and quick enough to make directions instead of keeping them.
fn sin_cos_turns(turns: f32) -> (f32, f32) {
    // To the nearest quarter, then Taylor series for at most an eighth of a circle, where they are exact enough.
    let quarter = (turns * 4.0 + 0.5) as i32;
    let x = (turns - quarter as f32 * 0.25) * std::f32::consts::TAU;
    let x2 = x * x;
    let sin =
        x * (1.0 + x2 * (-1.0 / 6.0 + x2 * (1.0 / 120.0 + x2 * (-1.0 / 5040.0 + x2 * (1.0 / 362_880.0)))));
    let cos = 1.0 + x2 * (-0.5 + x2 * (1.0 / 24.0 + x2 * (-1.0 / 720.0 + x2 * (1.0 / 40_320.0))));
    match quarter & 3 {
        0 => (sin, cos),
        1 => (cos, -sin),
        2 => (-sin, -cos),
        _ => (-cos, sin),
    }
}

/// The first `rays` directions (cosine density around +Z) of the site with that hash: fixed for ever for a site.
///
/// `out` is cleared first. Prefix property: the first `k` directions are the same whatever `rays ≥ k`, and each prefix
/// is spread evenly, best for powers of two.
pub fn fixed_pattern(rays: u32, site_hash: u32, out: &mut Vec<Vec3>) {
    out.clear();
    extend_pattern(0..rays, site_hash, out);
}

/// Appends the directions of those indices of the site's endless sequence.
pub(crate) fn extend_pattern(indices: std::ops::Range<u32>, site_hash: u32, out: &mut Vec<Vec3>) {
    let (seed_x, seed_y) = (hash(0, u64::from(site_hash), 0), hash(0, u64::from(site_hash), 1));
    out.extend(indices.map(|i| {
        let [x, y] = sobol(i);
        cosine_hemisphere([unit_interval(scramble(x, seed_x)), unit_interval(scramble(y, seed_y))])
    }));
}

/// Point `i` of the two-dimensional (0,2)-sequence, with bits from the top reversed: the bit of weight ½ is bit 0.
fn sobol(i: u32) -> [u32; 2] {
    // The second generator is the Pascal triangle modulo 2. Row by row it is a chain of shifted sums, which taken over
    // bits at distances 1, 2, 4, 8, 16 are five steps.
    let mut y = i;
    for (shift, mask) in
        [(1, 0x5555_5555_u32), (2, 0x3333_3333), (4, 0x0f0f_0f0f), (8, 0x00ff_00ff), (16, 0x0000_ffff)]
    {
        y ^= (y >> shift) & mask;
    }
    [i, y]
}

/// Nested uniform scrambling of a number whose bits are reversed (\[Burley2020\], the permutation of Laine and Karras):
/// each bit is flipped or not by a hash of the bits of more weight. Returns the bits in their usual order.
fn scramble(reversed: u32, seed: u32) -> u32 {
    let mut x = reversed.wrapping_add(seed);
    x ^= x.wrapping_mul(0x6c50_b47c);
    x ^= x.wrapping_mul(0xb82f_1e52);
    x ^= x.wrapping_mul(0xc7af_e638);
    x ^= x.wrapping_mul(0x8d22_f6e6);
    x.reverse_bits()
}

#[cfg(test)]
mod tests;
