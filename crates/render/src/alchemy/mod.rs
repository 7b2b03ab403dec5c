//! AlchemyAO: the estimator that SAO shares, from positions and normals at full resolution. The baseline that SAO is measured against.
//!
//! Takes distances and normals of a picture's samples ([`Screen`]); returns one visibility a sample. See `README.md`.

#[cfg(test)]
mod tests;

use crate::bilateral::Bilateral;
use crate::gbuffer::Screen;
use crate::noise::alchemy_turn;
use crate::obscurance::Obscurance;
use crate::{AfterPass, RenderError};

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
    estimate_by_passes(screen, params, &mut |_| ())
}

/// As [`estimate_visibility`], and tells when each pass is done: `samples`, `blur`.
///
/// # Errors
/// As there.
pub fn estimate_by_passes(
    screen: &Screen,
    params: &AlchemyParams,
    after: AfterPass<'_>,
) -> Result<Vec<f32>, RenderError> {
    params.check()?;
    let sampler = Sampler::new(screen, params);
    let visibility = screen.map(|at| sampler.visibility_at(at, &mut |_, _| ()));
    after("samples");
    let visibility = Bilateral::within(params.radius_m, params.blur_taps).smooth(screen, &visibility);
    after("blur");
    Ok(visibility)
}

/// The sampling pass of a picture, sample by sample.
pub struct Sampler<'a> {
    screen: &'a Screen,
    radius_m: f32,
    estimator: Obscurance,
    /// Of each place the part of the radius, and the angle.
    spiral: Vec<(f32, f32)>,
}

impl<'a> Sampler<'a> {
    /// The parameters must have passed [`AlchemyParams::check`].
    pub fn new(screen: &'a Screen, params: &AlchemyParams) -> Sampler<'a> {
        let estimator = params.estimator();
        let spiral = estimator.spiral();
        Sampler { screen, radius_m: params.radius_m, estimator, spiral }
    }

    /// What the sample in a column and row reads, in its order: the number of the read (0: its own position and its normal; then the positions of the places, of which
    /// those outside of the picture are not read), and column and row.
    pub fn visit_reads(&self, at: [usize; 2], visit: &mut impl FnMut(usize, [usize; 2])) {
        self.visibility_at(at, visit);
    }

    /// A visitor that does nothing costs nothing.
    fn visibility_at(&self, at: [usize; 2], visit: &mut impl FnMut(usize, [usize; 2])) -> f32 {
        let screen = self.screen;
        visit(0, at);
        let Some(place) = screen.position_at(at) else { return 1.0 };
        let normal = screen.normals_view()[at[1] * screen.columns() as usize + at[0]];
        let radius = self.radius_m * screen.samples_per_metre(-place.z);
        let turn = alchemy_turn(at);
        let mut sum = 0.0;
        for (number, (part, angle)) in self.spiral.iter().enumerate() {
            let (sin, cos) = libm::sincosf(angle + turn);
            let Some(seen) = screen.neighbour(at, [radius * part * cos, radius * part * sin]) else {
                continue;
            };
            visit(number + 1, seen);
            let Some(seen) = screen.position_at(seen) else { continue };
            sum += self.estimator.term(seen - place, normal, -place.z);
        }
        self.estimator.visibility(sum)
    }
}
