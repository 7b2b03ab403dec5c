//! The weights of moving least squares: how much each point near a place counts there.

use glam::Vec3;

/// First-order moving least squares: fits a plane to the values around a place and reads it there. How the defaults
/// were chosen stands in `docs/evaluation.md`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MovingLeastSquares {
    /// Radius of the weights in units of the layout's spacing r0. Default 2.
    pub radius: f32,
    /// Exponent of the cosine between normals, a power of two ≥ 1. Default 16.
    pub normal_power: u32,
    /// How fast the weight falls with the distance from the place's tangent plane: 1 / (1 + k (h/r)²)². Default 128.
    pub plane: f32,
}

impl Default for MovingLeastSquares {
    fn default() -> Self {
        MovingLeastSquares { radius: 2.0, normal_power: 16, plane: 128.0 }
    }
}

/// Below this sum of weights a fit means nothing.
pub const LEAST_WEIGHT: f32 = 1e-9;

/// Pulls the gradient to zero where the points do not determine it (in units of the weights' sum and the squared radius).
pub const RIDGE: f32 = 1e-3;

impl MovingLeastSquares {
    /// Weight of a point at `d` (in radii) from a place: (1 − |d|²)² · (n·nₚ)^power · plane factor, 0 … 1.
    pub fn weight(&self, d: Vec3, normal: Vec3, point_normal: Vec3) -> f32 {
        let inside = 1.0 - d.length_squared();
        let mut cosine = normal.dot(point_normal);
        if inside <= 0.0 || cosine <= 0.0 {
            return 0.0;
        }
        for _ in 0..self.normal_power.max(1).ilog2() {
            cosine *= cosine;
        }
        let height = normal.dot(d);
        let plane = 1.0 / (1.0 + self.plane * height * height);
        inside * inside * cosine * plane * plane
    }
}

/// A point as the fit sees it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Weighed {
    /// From [`MovingLeastSquares::weight`].
    pub weight: f32,
    /// Where the point lies in the tangent plane, the place being the origin; in radii.
    pub tangent: [f32; 2],
}

/// The value at the origin of the plane that is fitted to values at points: a sum of the values, each times
/// [`Fit::coefficient`]. Depends on where the points are, never on the values.
#[derive(Clone, Copy, Debug)]
pub struct Fit {
    inverse_sum: f32,
    center: [f32; 2],
    slope: [f32; 2],
}

impl Fit {
    /// The fit to points; `None` if their weights are next to nothing.
    pub fn new(points: impl Iterator<Item = Weighed> + Clone) -> Option<Fit> {
        let (mut sum, mut u, mut v) = (0.0f32, 0.0f32, 0.0f32);
        let (mut uu, mut uv, mut vv) = (0.0f32, 0.0f32, 0.0f32);
        for p in points {
            let (w, [pu, pv]) = (p.weight, p.tangent);
            sum += w;
            u += w * pu;
            v += w * pv;
            uu += w * pu * pu;
            uv += w * pu * pv;
            vv += w * pv * pv;
        }
        if sum.is_nan() || sum < LEAST_WEIGHT {
            return None;
        }
        // Moments about the weighted centre.
        let inverse_sum = 1.0 / sum;
        let (u, v) = (u * inverse_sum, v * inverse_sum);
        let uu = uu * inverse_sum - u * u + RIDGE;
        let vv = vv * inverse_sum - v * v + RIDGE;
        let uv = uv * inverse_sum - u * v;
        let determinant = uu * vv - uv * uv;
        let slope = if determinant.is_nan() || determinant <= 0.0 {
            [0.0; 2]
        } else {
            [(u * vv - v * uv) / determinant, (v * uu - u * uv) / determinant]
        };
        Some(Fit { inverse_sum, center: [u, v], slope })
    }

    /// What the value of a point is multiplied with. Sums to 1 over the points of the fit; negative beyond the far end
    /// of a neighbourhood that lies to one side.
    pub fn coefficient(&self, p: Weighed) -> f32 {
        let tilt =
            self.slope[0] * (p.tangent[0] - self.center[0]) + self.slope[1] * (p.tangent[1] - self.center[1]);
        p.weight * self.inverse_sum * (1.0 - tilt)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn coefficients_sum_to_one_and_reproduce_planes(
            points in prop::collection::vec((0.05f32..1.0, -1f32..1.0, -1f32..1.0), 8..20),
            [a, b, c] in prop::array::uniform3(-1f32..1.0),
        ) {
            let points: Vec<Weighed> =
                points.into_iter().map(|(weight, u, v)| Weighed { weight, tangent: [u, v] }).collect();
            let fit = Fit::new(points.iter().copied()).unwrap();
            let sum: f32 = points.iter().map(|&p| fit.coefficient(p)).sum();
            prop_assert!((sum - 1.0).abs() < 1e-4);
            let value: f32 = points
                .iter()
                .map(|&p| fit.coefficient(p) * (a + b * p.tangent[0] + c * p.tangent[1]))
                .sum();
            // The ridge bends planes a little where the points hardly determine them.
            prop_assert!((value - a).abs() < 0.05, "{value} instead of {a}");
        }
    }

    #[test]
    fn nothing_fits_nothing() {
        assert!(Fit::new([].into_iter()).is_none());
        assert!(Fit::new([Weighed { weight: 1e-12, tangent: [0.0; 2] }].into_iter()).is_none());
        assert!(Fit::new([Weighed { weight: f32::NAN, tangent: [0.0; 2] }].into_iter()).is_none());
    }
}
