//! The estimator that AlchemyAO and SAO share (\[McGuire2012\] eq. 1, 6 and 7).

use glam::Vec3;

/// Keeps the quotient of eq. 1 finite, square metres.
const EPSILON_M2: f32 = 1e-4;

/// Parameters of the estimator, in the units of eq. 1.
pub(crate) struct Obscurance {
    pub(crate) sigma_m: f32,
    pub(crate) bias_m: f32,
    pub(crate) beta: f32,
    pub(crate) exponent: f32,
    pub(crate) samples: u32,
    pub(crate) turns: u32,
}

impl Obscurance {
    /// Eq. 6: of each place on the spiral the part of the radius, and the angle in radians.
    pub(crate) fn spiral(&self) -> Vec<(f32, f32)> {
        let step = |i: u32| {
            let part = (i as f32 + 0.5) / self.samples as f32;
            (part, std::f32::consts::TAU * part * self.turns as f32)
        };
        (0..self.samples).map(step).collect()
    }

    /// What is seen at `to_seen` from a place with this normal, at this distance from the eye, adds to the sum.
    pub(crate) fn term(&self, to_seen: Vec3, normal: Vec3, distance_m: f32) -> f32 {
        // Behind a parallel camera's own place the bias must not turn round.
        let height = to_seen.dot(normal) - self.bias_m - distance_m.max(0.0) * self.beta;
        height.max(0.0) / (to_seen.length_squared() + EPSILON_M2)
    }

    /// Visibility by the sum over all places.
    pub(crate) fn visibility(&self, sum: f32) -> f32 {
        let open = (1.0 - 2.0 * self.sigma_m / self.samples as f32 * sum).max(0.0);
        if self.exponent == 1.0 { open } else { libm::powf(open, self.exponent) }
    }
}
