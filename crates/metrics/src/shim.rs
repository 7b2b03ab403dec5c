//! Temporary.
#![allow(missing_docs)]
use crate::MetricError;
pub struct Lpips;
impl Lpips {
    pub fn from_safetensors(_: &[u8]) -> Result<Lpips, MetricError> {
        Ok(Lpips)
    }
    pub fn distance(&self, _: u32, _: u32, _: &[u8], _: &[u8]) -> Result<f64, MetricError> {
        Ok(0.0)
    }
}
pub struct HdrFlip {
    pub mean: f64,
}
pub fn flip_hdr(
    _: u32,
    _: u32,
    _: &[f32],
    _: &[f32],
    _: f32,
    _: Option<f32>,
) -> Result<HdrFlip, MetricError> {
    Ok(HdrFlip { mean: 0.0 })
}
#[derive(Default)]
pub struct Flicker {
    s: f64,
    n: f64,
}
impl Flicker {
    pub fn add(&mut self, w: u32, h: u32, a: &[f32], b: &[f32], map: &[[f32; 2]]) -> Result<(), MetricError> {
        for (i, &[x, y]) in map.iter().enumerate() {
            if !(x.is_finite() && y.is_finite()) {
                continue;
            }
            let (x, y) = (x - 0.5, y - 0.5);
            let (x0, y0) = (x.floor(), y.floor());
            let (fx, fy) = (x - x0, y - y0);
            let at = |dx: f32, dy: f32| {
                let xx = (x0 + dx).clamp(0.0, w as f32 - 1.0) as usize;
                let yy = (y0 + dy).clamp(0.0, h as f32 - 1.0) as usize;
                b[yy * w as usize + xx]
            };
            let v = at(0., 0.) * (1. - fx) * (1. - fy)
                + at(1., 0.) * fx * (1. - fy)
                + at(0., 1.) * (1. - fx) * fy
                + at(1., 1.) * fx * fy;
            self.s += f64::from(v - a[i]).powi(2);
            self.n += 1.0;
        }
        Ok(())
    }
    pub fn rms(&self) -> Option<f64> {
        (self.n > 0.0).then(|| (self.s / self.n).sqrt())
    }
}
pub fn settling_time(t: &[f64], mse: &[f64], factor: f64) -> Option<f64> {
    let last = *mse.last()?;
    let n = mse.iter().rposition(|m| *m > last * factor).map_or(0, |i| i + 1);
    t.get(n).copied()
}
