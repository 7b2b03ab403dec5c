//! Pictures: linear light, planes of numbers, 8-bit sRGB; tone mapping between them.

use std::sync::LazyLock;

use glam::Vec3;
use rayon::prelude::*;

use crate::texture::linear_from_srgb;

/// Linear radiance, rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearImage {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// `width × height` linear RGB values, ≥ 0.
    pub pixels: Vec<Vec3>,
}

/// One number a pixel, rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// `width × height` numbers.
    pub values: Vec<f32>,
}

/// 8-bit sRGB, rows from the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rgb8Image {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// `width × height` sRGB codes.
    pub pixels: Vec<[u8; 3]>,
}

/// How radiance becomes what a display shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ToneMap {
    /// Radiance is multiplied with this first; > 0, default 1.
    pub exposure: f32,
    /// The curve, applied to each channel.
    pub curve: ToneCurve,
}

impl Default for ToneMap {
    fn default() -> Self {
        ToneMap { exposure: 1.0, curve: ToneCurve::Filmic }
    }
}

/// Maps exposed radiance 0 … ∞ to display light 0 … 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ToneCurve {
    /// min(x, 1): exact below white; for measurements.
    Clamp,
    /// x / (1 + x), \[Reinhard2002\] Eq. 3.
    Reinhard,
    /// x (2.51 x + 0.03) / (x (2.43 x + 0.59) + 0.14), the fit of the ACES curve in \[Narkowicz2015\].
    Filmic,
}

impl ToneMap {
    /// Display light 0 … 1 of a radiance; not a number becomes 0.
    pub fn map(&self, radiance: Vec3) -> Vec3 {
        let curve = |x: f32| {
            let x = if x.is_nan() { 0.0 } else { (x * self.exposure).clamp(0.0, 1e6) };
            match self.curve {
                ToneCurve::Clamp => x.min(1.0),
                ToneCurve::Reinhard => x / (1.0 + x),
                ToneCurve::Filmic => ((x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14)).min(1.0),
            }
        };
        Vec3::new(curve(radiance.x), curve(radiance.y), curve(radiance.z))
    }
}

impl LinearImage {
    /// Tone-mapped, sRGB-encoded, rounded to the nearest code.
    pub fn to_rgb8(&self, tone_map: &ToneMap) -> Rgb8Image {
        let encode = |&radiance: &Vec3| tone_map.map(radiance).to_array().map(srgb8_from_linear);
        Rgb8Image {
            width: self.width,
            height: self.height,
            pixels: self.pixels.par_iter().with_min_len(1024).map(encode).collect(),
        }
    }
}

/// Linear light at which the sRGB code goes from i to i + 1: that of the value (i + ½) / 255.
static SRGB8_STEPS: LazyLock<[f32; 255]> =
    LazyLock::new(|| std::array::from_fn(|i| linear_from_srgb((i as f64 + 0.5) / 255.0) as f32));

/// The sRGB code nearest to a linear value (IEC 61966-2-1); clamped to 0 … 255, not a number becomes 0.
pub fn srgb8_from_linear(linear: f32) -> u8 {
    SRGB8_STEPS.partition_point(|&step| linear >= step) as u8
}

/// A number 0 … 1 as a code, without the sRGB curve: 255 v rounded to nearest. Not a number becomes 0.
pub fn unorm8(value: f32) -> u8 {
    (value * 255.0 + 0.5).floor().clamp(0.0, 255.0) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_encoding_rounds_to_nearest() {
        for code in 0..=255u8 {
            let linear = linear_from_srgb(f64::from(code) / 255.0) as f32;
            assert_eq!(srgb8_from_linear(linear), code);
            let above = linear_from_srgb((f64::from(code) + 0.49) / 255.0) as f32;
            assert_eq!(srgb8_from_linear(above), code);
            let next = linear_from_srgb((f64::from(code) + 0.51) / 255.0) as f32;
            assert_eq!(srgb8_from_linear(next), code.saturating_add(1));
        }
        assert_eq!(srgb8_from_linear(f32::NAN), 0);
        assert_eq!(srgb8_from_linear(-1.0), 0);
        assert_eq!(srgb8_from_linear(f32::INFINITY), 255);
    }

    #[test]
    fn tone_curves_keep_order_and_range() {
        for curve in [ToneCurve::Clamp, ToneCurve::Reinhard, ToneCurve::Filmic] {
            let tone_map = ToneMap { exposure: 1.0, curve };
            let mut last = 0.0;
            for i in 0..2000 {
                let y = tone_map.map(Vec3::splat(i as f32 * 0.01)).x;
                assert!((last..=1.0).contains(&y), "{curve:?} at {i}");
                last = y;
            }
            assert_eq!(tone_map.map(Vec3::ZERO), Vec3::ZERO);
            assert!(tone_map.map(Vec3::splat(f32::NAN)).is_finite());
        }
        let doubled = ToneMap { exposure: 2.0, curve: ToneCurve::Clamp };
        assert_eq!(doubled.map(Vec3::splat(0.25)), Vec3::splat(0.5));
    }
}
