//! AlchemyAO: the estimator that SAO shares, from positions and normals at full resolution. The baseline that SAO is measured against.
//!
//! Takes distances and normals of a picture's samples ([`Screen`]); returns one visibility a sample. See `README.md`.

#[cfg(test)]
mod tests;

use crate::RenderError;
use crate::bilateral::Bilateral;
use crate::gbuffer::Screen;
use crate::noise::alchemy_turn;
use crate::obscurance::Obscurance;

/// Most places that are looked at around a sample.
pub const MAX_SAMPLES: u32 = 256;

/// How visibility is estimated. Names of the paper's symbols are in brackets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AlchemyParams {
    /// Radius of the ball around a place in which others are looked at, metres, > 0; default 0.6 \[r\].
    pub radius_m: f32,
    /// How much what is found darkens, as a part of the radius, ≥ 0; default 0.5 \[σ / r\].
    pub sigma_of_radius: f32,
    /// How far what blocks must stand above the surface, as a part of the distance to the eye, ≥ 0; default 0.0001 \[β\].
    pub beta: f32,
    /// The same as a part of the radius, ≥ 0; default 1/120: 5 mm at 0.6 m.
    pub bias_of_radius: f32,
    /// Contrast: visibility to this power, > 0; default 1 \[k\].
    pub exponent: f32,
    /// Places looked at around each sample, 1 … [`MAX_SAMPLES`]; default 12 \[s\].
    pub samples: u32,
    /// Turns of the spiral that they lie on, any number; default 7.
    pub turns: u32,
    /// Taps of the blur on either side, 0 (none) … 16; default 6, a window of 13 × 13.
    pub blur_taps: u32,
}

impl Default for AlchemyParams {
    fn default() -> Self {
        AlchemyParams {
            radius_m: 0.6,
            sigma_of_radius: 0.5,
            beta: 1e-4,
            bias_of_radius: 1.0 / 120.0,
            exponent: 1.0,
            samples: 12,
            turns: 7,
            blur_taps: 6,
        }
    }
}

impl AlchemyParams {
    pub(crate) fn estimator(&self) -> Obscurance {
        Obscurance {
            sigma_m: self.sigma_of_radius * self.radius_m,
            bias_m: self.bias_of_radius * self.radius_m,
            beta: self.beta,
            exponent: self.exponent,
            samples: self.samples,
            turns: self.turns,
        }
    }

    /// Whether every parameter is in its range.
    ///
    /// # Errors
    /// Names the first that is not.
    pub fn check(&self) -> Result<(), RenderError> {
        let positive = |value: f32| value > 0.0 && value.is_finite();
        let not_negative = |value: f32| value >= 0.0 && value.is_finite();
        let samples = (1..=MAX_SAMPLES).contains(&self.samples);
        let sigma = self.sigma_of_radius;
        let bias = self.bias_of_radius;
        let checks: [(&'static str, f64, bool, &'static str); 7] = [
            ("alchemy: radius_m", self.radius_m.into(), positive(self.radius_m), "finite and above 0"),
            ("alchemy: sigma_of_radius", sigma.into(), not_negative(sigma), "finite and at least 0"),
            ("alchemy: beta", self.beta.into(), not_negative(self.beta), "finite and at least 0"),
            ("alchemy: bias_of_radius", bias.into(), not_negative(bias), "finite and at least 0"),
            ("alchemy: exponent", self.exponent.into(), positive(self.exponent), "finite and above 0"),
            ("alchemy: samples", self.samples.into(), samples, "1 to 256"),
            ("alchemy: blur_taps", self.blur_taps.into(), self.blur_taps <= 16, "0 to 16"),
        ];
        match checks.into_iter().find(|(_, _, holds, _)| !holds) {
            Some((name, found, _, range)) => Err(RenderError::Parameter { name, found, range }),
            None => Ok(()),
        }
    }
}

/// Visibility 0 … 1 of each sample of a picture, row-major from the top, 1 for the background; in parallel in the caller's rayon pool, and the same for any
/// number of threads.
///
/// # Errors
/// A parameter out of its range.
pub fn estimate_visibility(screen: &Screen, params: &AlchemyParams) -> Result<Vec<f32>, RenderError> {
    params.check()?;
    let estimator = params.estimator();
    let spiral = estimator.spiral();
    let visibility = screen.map(|at| visibility_at(screen, params.radius_m, &estimator, &spiral, at));
    Ok(Bilateral::within(params.radius_m, params.blur_taps).smooth(screen, &visibility))
}

fn visibility_at(
    screen: &Screen,
    radius_m: f32,
    estimator: &Obscurance,
    spiral: &[(f32, f32)],
    at: [usize; 2],
) -> f32 {
    let Some(place) = screen.position_at(at) else { return 1.0 };
    let normal = screen.normals_view()[at[1] * screen.columns() as usize + at[0]];
    let radius = radius_m * screen.samples_per_metre(-place.z);
    let turn = alchemy_turn(at);
    let mut sum = 0.0;
    for (part, angle) in spiral {
        let (sin, cos) = libm::sincosf(angle + turn);
        let seen = screen.neighbour(at, [radius * part * cos, radius * part * sin]);
        let Some(seen) = seen.and_then(|seen| screen.position_at(seen)) else { continue };
        sum += estimator.term(seen - place, normal, -place.z);
    }
    estimator.visibility(sum)
}
