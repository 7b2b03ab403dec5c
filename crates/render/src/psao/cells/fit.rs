//! The fit of a plane in one pass over the points, as `cells.wgsl` does it: sums, then the plane's value.

use dapple_store::charts::{LEAST_WEIGHT, RIDGE};

/// Weighted normal equations of value ≈ a + b·u + c·v.
#[derive(Debug)]
pub(super) struct Fit {
    /// Σw, Σw·u, Σw·v, Σw·y.
    first: [f32; 4],
    /// Σw·u², Σw·u·v, Σw·v².
    second: [f32; 3],
    /// Σw·u·y, Σw·v·y.
    mixed: [f32; 2],
    least: f32,
    greatest: f32,
}

impl Fit {
    pub(super) fn new() -> Fit {
        Fit { first: [0.0; 4], second: [0.0; 3], mixed: [0.0; 2], least: 255.0, greatest: 0.0 }
    }

    pub(super) fn add(&mut self, w: f32, u: f32, v: f32, y: f32) {
        let add = |sum: &mut f32, term: f32| *sum += w * term;
        self.first.iter_mut().zip([1.0, u, v, y]).for_each(|(sum, term)| add(sum, term));
        self.second.iter_mut().zip([u * u, u * v, v * v]).for_each(|(sum, term)| add(sum, term));
        self.mixed.iter_mut().zip([u * y, v * y]).for_each(|(sum, term)| add(sum, term));
        self.least = self.least.min(y);
        self.greatest = self.greatest.max(y);
    }

    /// a, kept within the range of the values that were fitted; `None` where hardly anything has weight.
    pub(super) fn value_at_origin(&self) -> Option<f32> {
        if self.first[0].is_nan() || self.first[0] < LEAST_WEIGHT {
            return None;
        }
        // Moments about the weighted centre.
        let inverse = 1.0 / self.first[0];
        let [_, u, v, y] = self.first.map(|sum| sum * inverse);
        let [uu, uv, vv] = self.second.map(|sum| sum * inverse);
        let [uy, vy] = self.mixed.map(|sum| sum * inverse);
        let (uu, uv, vv) = (uu - u * u + RIDGE, uv - u * v, vv - v * v + RIDGE);
        let (uy, vy) = (uy - u * y, vy - v * y);
        let determinant = uu * vv - uv * uv;
        if determinant.is_nan() || determinant <= 0.0 {
            return Some(y);
        }
        let b = (uy * vv - vy * uv) / determinant;
        let c = (vy * uu - uy * uv) / determinant;
        Some((y - b * u - c * v).clamp(self.least, self.greatest))
    }
}
