//! Test images made by formulas that any language repeats exactly: integer arithmetic, then a division by 256.
//!
//! The same in Python, with which the constants of the tests were made (numpy, scikit-image, flip-evaluator):
//!
//! ```text
//! def h(x, y, c):                         # numpy uint32 arrays, wrapping
//!     v = x * 0x9E3779B1 ^ y * 0x85EBCA77 ^ c * 0xC2B2AE3D
//!     v = (v ^ v >> 15) * 0x2C1B3C6D; v = (v ^ v >> 12) * 0x297A2D39; return v ^ v >> 15
//! noise_r = h(x, y, 0) & 255              # noisy_pair, both / 256
//! noise_t = (noise_r * 3 + (h(x, y, 1) & 255)) >> 2
//! smooth_r = (3 * x + 2 * y) & 255        # smooth_pair, both / 256
//! smooth_t = min(smooth_r + (8 if (x // 8 + y // 8) % 2 else 0), 255)
//! rgb_r[c] = ((c + 2) * x + (5 - c) * y + (h(x // 4, y // 4, c) & 63)) & 255
//! rgb_t[c] = (rgb_r[c] * 7 + (h(x, y, c + 3) & 255)) >> 3
//! hdr_r = (rgb_r + 1) / 256 * 2.0 ** ((x // 8 + y // 8) % 12 - 6)        # and so hdr_t
//! ```

/// Three rounds of multiply and shift: neighbouring pixels get unrelated values.
fn hash(x: u32, y: u32, c: u32) -> u32 {
    let mut v = x.wrapping_mul(0x9E37_79B1) ^ y.wrapping_mul(0x85EB_CA77) ^ c.wrapping_mul(0xC2B2_AE3D);
    v = (v ^ (v >> 15)).wrapping_mul(0x2C1B_3C6D);
    v = (v ^ (v >> 12)).wrapping_mul(0x297A_2D39);
    v ^ (v >> 15)
}

fn pixels(width: u32, height: u32) -> impl Iterator<Item = (u32, u32)> {
    (0..height).flat_map(move |y| (0..width).map(move |x| (x, y)))
}

fn luma(bytes: impl Iterator<Item = (u32, u32)>) -> (Vec<f32>, Vec<f32>) {
    bytes.map(|(r, t)| (r as f32 / 256.0, t as f32 / 256.0)).unzip()
}

/// White noise, and the same with a quarter of it exchanged for other noise; luma 0 … 1.
pub(crate) fn noisy_pair(width: u32, height: u32) -> (Vec<f32>, Vec<f32>) {
    luma(pixels(width, height).map(|(x, y)| {
        let r = hash(x, y, 0) & 255;
        (r, (r * 3 + (hash(x, y, 1) & 255)) >> 2)
    }))
}

/// A ramp with a wrap, and the same under a faint chequerboard; luma 0 … 1.
pub(crate) fn smooth_pair(width: u32, height: u32) -> (Vec<f32>, Vec<f32>) {
    luma(pixels(width, height).map(|(x, y)| {
        let r = (3 * x + 2 * y) & 255;
        let lift = if (x / 8 + y / 8) % 2 == 1 { 8 } else { 0 };
        (r, (r + lift).min(255))
    }))
}

/// Coloured blocks on ramps, and the same with an eighth of noise; sRGB bytes.
pub(crate) fn color_pair(width: u32, height: u32) -> (Vec<u8>, Vec<u8>) {
    pixels(width, height)
        .flat_map(|(x, y)| (0..3).map(move |c| (x, y, c)))
        .map(|(x, y, c)| {
            let r = ((c + 2) * x + (5 - c) * y + (hash(x / 4, y / 4, c) & 63)) & 255;
            (r as u8, ((r * 7 + (hash(x, y, c + 3) & 255)) >> 3) as u8)
        })
        .unzip()
}

/// The same in blocks of twelve brightnesses; linear light.
pub(crate) fn hdr_pair(width: u32, height: u32) -> (Vec<f32>, Vec<f32>) {
    let (reference, test) = color_pair(width, height);
    let lit = |picture: Vec<u8>| {
        let values = picture.into_iter().zip(0..);
        let lit = values.map(|(byte, i)| {
            let (x, y) = (i / 3 % width, i / 3 / width);
            (f32::from(byte) + 1.0) / 256.0 * ((1 << ((x / 8 + y / 8) % 12)) as f32 / 64.0)
        });
        lit.collect()
    };
    (lit(reference), lit(test))
}

/// Runs `work` in pools of 1, 2 and 5 threads and compares what it returns.
pub(crate) fn assert_same_on_every_thread_count<T: PartialEq + std::fmt::Debug + Send>(
    work: impl Fn() -> T + Sync,
) {
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(&work)
    };
    let alone = on(1);
    assert_eq!(alone, on(2));
    assert_eq!(alone, on(5));
}
