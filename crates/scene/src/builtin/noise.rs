//! Hashes and smooth noise that are the same on every machine.

use glam::Vec3;

/// A hash of four integers, uniform in 32 bits.
pub fn hash(seed: u32, x: i32, y: i32, z: i32) -> u32 {
    let mut h = seed ^ 0x9e37_79b9;
    for word in [x as u32, y as u32, z as u32] {
        h = (h ^ word).wrapping_mul(0x85eb_ca6b);
        h ^= h >> 13;
        h = h.wrapping_mul(0xc2b2_ae35);
        h ^= h >> 16;
    }
    h
}

/// A number in 0 … 1 (1 excluded) for one index of one seed.
pub fn unit(seed: u32, index: u32) -> f32 {
    (hash(seed, index as i32, 0, 0) >> 8) as f32 / (1 << 24) as f32
}

/// Smooth noise in −1 … 1 with features about one unit of `p` apart.
pub fn value_noise(seed: u32, p: Vec3) -> f32 {
    let cell = p.floor();
    let f = p - cell;
    let s = f * f * (Vec3::splat(3.0) - 2.0 * f);
    let (x, y, z) = (cell.x as i32, cell.y as i32, cell.z as i32);
    let corner = |dx: i32, dy: i32, dz: i32| {
        let h = hash(seed, x.wrapping_add(dx), y.wrapping_add(dy), z.wrapping_add(dz));
        (h >> 8) as f32 / (1 << 23) as f32 - 1.0
    };
    let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
    let row = |dy: i32, dz: i32| mix(corner(0, dy, dz), corner(1, dy, dz), s.x);
    let slab = |dz: i32| mix(row(0, dz), row(1, dz), s.y);
    mix(slab(0), slab(1), s.z)
}

/// Several octaves of [`value_noise`], each half as strong and twice as fine; within −1 … 1.
pub fn fractal_noise(seed: u32, p: Vec3, octaves: u32) -> f32 {
    let (mut sum, mut weight, mut total, mut q) = (0.0, 1.0, 0.0, p);
    for octave in 0..octaves.max(1) {
        sum += weight * value_noise(seed.wrapping_add(octave), q);
        total += weight;
        weight *= 0.5;
        q *= 2.0;
    }
    sum / total
}
