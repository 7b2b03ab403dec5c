//! What textures are painted with: texels, noise that repeats, normal maps from heights.

use glam::{Vec2, Vec3};

use super::noise::fractal_noise;

/// Texels a side of every texture.
pub(super) const SIZE: u32 = 256;

/// A texture from a function of its texels: RGBA, 0 … 1.
pub(super) fn paint(texel: impl Fn(u32, u32) -> [f32; 4]) -> Vec<u8> {
    let mut rgba = Vec::with_capacity((4 * SIZE * SIZE) as usize);
    for y in 0..SIZE {
        for x in 0..SIZE {
            rgba.extend(texel(x, y).map(|c| libm::roundf(255.0 * c.clamp(0.0, 1.0)) as u8));
        }
    }
    rgba
}

/// Noise that repeats over the texture: two shifted copies, blended across the seam.
pub(super) fn tiling(seed: u32, x: u32, y: u32, stretch: [f32; 2], octaves: u32) -> f32 {
    let (u, v) = (x as f32 / SIZE as f32, y as f32 / SIZE as f32);
    let at = |u: f32, v: f32| fractal_noise(seed, Vec3::new(u * stretch[0], v * stretch[1], 3.5), octaves);
    let top = at(u, v) * (1.0 - u) + at(u - 1.0, v) * u;
    let bottom = at(u, v - 1.0) * (1.0 - u) + at(u - 1.0, v - 1.0) * u;
    top * (1.0 - v) + bottom * v
}

/// A normal map of a relief: `height` in metres at every texel, over a texture that is `side_m` metres wide and repeats.
/// Green points up, against v, as glTF has it.
pub(super) fn normal_map(side_m: f32, height: impl Fn(u32, u32) -> f32) -> Vec<u8> {
    let heights: Vec<f32> = (0..SIZE * SIZE).map(|i| height(i % SIZE, i / SIZE)).collect();
    let at = |x: u32, y: u32| heights[((y % SIZE) * SIZE + x % SIZE) as usize];
    let step = side_m / SIZE as f32;
    paint(|x, y| {
        let slope =
            Vec2::new(at(x + 1, y) - at(x + SIZE - 1, y), at(x, y + SIZE - 1) - at(x, y + 1)) / (2.0 * step);
        let n = 0.5 * Vec3::new(-slope.x, -slope.y, 1.0).normalize() + Vec3::splat(0.5);
        [n.x, n.y, n.z, 1.0]
    })
}
