//! Parameters of the method and their ranges.

use super::MipFilter;
use crate::RenderError;
use crate::obscurance::Obscurance;

/// Most places that are looked at around a sample.
pub const MAX_SAMPLES: u32 = 256;
/// Most levels of the pyramid of distances.
pub const MAX_LEVELS: u32 = 12;

/// How visibility is estimated. Names of the paper's symbols are in brackets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SaoParams {
    /// Radius of the ball around a place in which others are looked at, metres, > 0; default 0.6 \[r\].
    pub radius_m: f32,
    /// How much what is found darkens, metres, ≥ 0; `None` (default) for [`SaoParams::SIGMA_OF_RADIUS`] of the radius \[σ\].
    pub sigma_m: Option<f32>,
    /// How far what blocks must stand above the surface, as a part of the distance to the eye, ≥ 0; default 0.0001 \[β\].
    pub beta: f32,
    /// The same as a length, metres, ≥ 0; `None` (default) for [`SaoParams::BIAS_OF_RADIUS`] of the radius.
    pub bias_m: Option<f32>,
    /// Contrast: visibility to this power, > 0; default 1 \[k\].
    pub exponent: f32,
    /// Places looked at around each sample, 1 … [`MAX_SAMPLES`]; default 9 \[s\].
    pub samples: u32,
    /// Turns of the spiral that they lie on, any number; default 7 \[τ\].
    pub turns: u32,
    /// How a level of the pyramid is made from the one below. Default: the rotated grid.
    pub filter: MipFilter,
    /// Levels of the pyramid above the first, 0 (none: all is read at full resolution) … [`MAX_LEVELS`]; default 5.
    pub levels: u32,
    /// The first level serves places nearer than twice 2 to this, samples of the picture, 0 … 12; default 3 \[log₂ q′\].
    pub switch_log2: u32,
    /// Beyond this distance edges are not kept apart, metres, > 0; default 200 \[−z_min\].
    pub farthest_m: f32,
    /// How fast the weight of a neighbour falls with the difference of distances, as a part of `farthest_m`, ≥ 0; default 2¹¹.
    pub sharpness: f32,
    /// Taps of the reconstruction on either side of a sample, 0 (none) … 16; default 3.
    pub blur_taps: u32,
    /// Samples of the picture between two taps, 1 … 16; default 3.
    pub blur_stride: u32,
}

impl SaoParams {
    /// Default \[σ\] as a part of the radius: chosen on the atrium, see `README.md`.
    pub const SIGMA_OF_RADIUS: f32 = 0.5;
    /// Default bias as a part of the radius: 5 mm at 0.6 m.
    pub const BIAS_OF_RADIUS: f32 = 1.0 / 120.0;

    /// What darkens is multiplied by this, metres.
    pub fn sigma_m(&self) -> f32 {
        self.sigma_m.unwrap_or(SaoParams::SIGMA_OF_RADIUS * self.radius_m)
    }

    /// How far what blocks must stand above the surface, metres.
    pub fn bias_m(&self) -> f32 {
        self.bias_m.unwrap_or(SaoParams::BIAS_OF_RADIUS * self.radius_m)
    }

    pub(crate) fn estimator(&self) -> Obscurance {
        Obscurance {
            sigma_m: self.sigma_m(),
            bias_m: self.bias_m(),
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
        let within = |value: u32, low: u32, high: u32| (low..=high).contains(&value);
        let (sigma, bias) = (self.sigma_m(), self.bias_m());
        let checks: [(&'static str, f64, bool, &'static str); 12] = [
            ("sao: radius_m", self.radius_m.into(), positive(self.radius_m), "finite and above 0"),
            ("sao: sigma_m", sigma.into(), not_negative(sigma), "finite and at least 0"),
            ("sao: beta", self.beta.into(), not_negative(self.beta), "finite and at least 0"),
            ("sao: bias_m", bias.into(), not_negative(bias), "finite and at least 0"),
            ("sao: exponent", self.exponent.into(), positive(self.exponent), "finite and above 0"),
            ("sao: samples", self.samples.into(), within(self.samples, 1, MAX_SAMPLES), "1 to 256"),
            ("sao: levels", self.levels.into(), within(self.levels, 0, MAX_LEVELS), "0 to 12"),
            ("sao: switch_log2", self.switch_log2.into(), within(self.switch_log2, 0, 12), "0 to 12"),
            ("sao: farthest_m", self.farthest_m.into(), positive(self.farthest_m), "finite and above 0"),
            ("sao: sharpness", self.sharpness.into(), not_negative(self.sharpness), "finite and at least 0"),
            ("sao: blur_taps", self.blur_taps.into(), within(self.blur_taps, 0, 16), "0 to 16"),
            ("sao: blur_stride", self.blur_stride.into(), within(self.blur_stride, 1, 16), "1 to 16"),
        ];
        match checks.into_iter().find(|(_, _, holds, _)| !holds) {
            Some((name, found, _, range)) => Err(RenderError::Parameter { name, found, range }),
            None => Ok(()),
        }
    }
}

impl Default for SaoParams {
    fn default() -> Self {
        SaoParams {
            radius_m: 0.6,
            sigma_m: None,
            beta: 1e-4,
            bias_m: None,
            exponent: 1.0,
            samples: 9,
            turns: 7,
            filter: MipFilter::RotatedGrid,
            levels: 5,
            switch_log2: 3,
            farthest_m: 200.0,
            sharpness: 2048.0,
            blur_taps: 3,
            blur_stride: 3,
        }
    }
}
