//! Horizon-based ambient occlusion, and HBAO+, its simpler successor.
//!
//! Takes distances and normals of a picture's samples ([`Screen`]); returns one visibility a sample. See `README.md`.

#[cfg(test)]
mod tests;

use crate::bilateral::Bilateral;
use crate::gbuffer::Screen;
use crate::noise::interleaved_gradient;
use crate::{AfterPass, RenderError};
use glam::Vec3;

/// Most directions, and most steps along each.
pub const MAX_STEPS: u32 = 64;

/// How what is found along a direction becomes occlusion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Horizon {
    /// HBAO: rays under the highest place found are blocked (\[Vermeer2021\] Alg. 2 without its stochastic part).
    #[default]
    Highest,
    /// HBAO+: each place counts by its height over the surface, and all are averaged.
    Mean,
}

/// How visibility is estimated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HbaoParams {
    /// Which of the two.
    pub horizon: Horizon,
    /// Radius in which others are looked at, metres, > 0; default 0.6 \[r\].
    pub radius_m: f32,
    /// Directions on the picture, 1 … [`MAX_STEPS`]; default 8 \[N_d\].
    pub directions: u32,
    /// Steps along each, 1 … [`MAX_STEPS`]; default 4 \[N_s\].
    pub steps: u32,
    /// Angle over the surface under which nothing blocks, degrees, 0 … 89; default 4 for HBAO, 3 for HBAO+.
    pub bias_degrees: f32,
    /// What is found is multiplied by this, ≥ 0; default 1.8 for HBAO, 4 for HBAO+: chosen on the atrium, see `README.md`.
    pub strength: f32,
    /// Taps of the blur on either side, 0 (none) … 16; default 3.
    pub blur_taps: u32,
}

impl HbaoParams {
    /// Defaults of HBAO.
    pub fn hbao() -> HbaoParams {
        HbaoParams {
            horizon: Horizon::Highest,
            radius_m: 0.6,
            directions: 8,
            steps: 4,
            bias_degrees: 4.0,
            strength: 1.8,
            blur_taps: 3,
        }
    }

    /// Defaults of HBAO+.
    pub fn hbao_plus() -> HbaoParams {
        HbaoParams { horizon: Horizon::Mean, bias_degrees: 3.0, strength: 4.0, ..HbaoParams::hbao() }
    }

    /// Whether every parameter is in its range.
    ///
    /// # Errors
    /// Names the first that is not.
    pub fn check(&self) -> Result<(), RenderError> {
        let positive = |value: f32| value > 0.0 && value.is_finite();
        let not_negative = |value: f32| value >= 0.0 && value.is_finite();
        let counted = |value: u32| (1..=MAX_STEPS).contains(&value);
        let bias = (0.0..=89.0).contains(&self.bias_degrees);
        let checks: [(&'static str, f64, bool, &'static str); 6] = [
            ("hbao: radius_m", self.radius_m.into(), positive(self.radius_m), "finite and above 0"),
            ("hbao: directions", self.directions.into(), counted(self.directions), "1 to 64"),
            ("hbao: steps", self.steps.into(), counted(self.steps), "1 to 64"),
            ("hbao: bias_degrees", self.bias_degrees.into(), bias, "0 to 89"),
            ("hbao: strength", self.strength.into(), not_negative(self.strength), "finite and at least 0"),
            ("hbao: blur_taps", self.blur_taps.into(), self.blur_taps <= 16, "0 to 16"),
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
pub fn estimate_visibility(screen: &Screen, params: &HbaoParams) -> Result<Vec<f32>, RenderError> {
    estimate_by_passes(screen, params, &mut |_| ())
}

/// As [`estimate_visibility`], and tells when each pass is done: `samples`, `blur`.
///
/// # Errors
/// As there.
pub fn estimate_by_passes(
    screen: &Screen,
    params: &HbaoParams,
    after: AfterPass<'_>,
) -> Result<Vec<f32>, RenderError> {
    params.check()?;
    let visibility =
        screen.map(|at| 1.0 - (params.strength * occlusion_at(screen, params, at)).clamp(0.0, 1.0));
    after("samples");
    let visibility = Bilateral::within(params.radius_m, params.blur_taps).smooth(screen, &visibility);
    after("blur");
    Ok(visibility)
}

fn occlusion_at(screen: &Screen, params: &HbaoParams, at: [usize; 2]) -> f32 {
    let index = at[1] * screen.columns() as usize + at[0];
    let normal = screen.normals_view()[index];
    // A triangle without an area has no normal.
    let Some(place) = screen.position_view(index).filter(|_| normal != Vec3::ZERO) else { return 0.0 };
    let radius = params.radius_m * screen.samples_per_metre(-place.z);
    let step = radius / (params.steps + 1) as f32;
    // Directions and steps begin elsewhere in each sample.
    let (turn, jitter) = (interleaved_gradient(at), interleaved_gradient([at[1] + 57, at[0] + 23]));
    let bias = params.bias_degrees.to_radians();
    let mut sum = 0.0;
    for direction in 0..params.directions {
        let angle = std::f32::consts::TAU * (direction as f32 + turn) / params.directions as f32;
        let (sin, cos) = libm::sincosf(angle);
        let steps = (0..params.steps).filter_map(|i| {
            let length = step * (i as f32 + 0.5 + jitter);
            let seen = screen.neighbour(at, [length * cos, length * sin])?;
            let to_seen = screen.position_at(seen)? - place;
            let squared = to_seen.length_squared();
            let part = squared / (params.radius_m * params.radius_m);
            (part < 1.0 && squared > 0.0).then_some((to_seen, 1.0 - part))
        });
        sum += match params.horizon {
            Horizon::Highest => {
                // Where the plane of the surface goes in that direction of the picture.
                let [column, row] = screen.centre(at);
                let along = screen.on_plane(column + cos, row + sin, place, normal).map(|next| next - place);
                // Samples lie beside the direction by up to half of one each way: the plane must not rise over itself for that.
                let steps =
                    steps.filter(|(to_seen, _)| normal.dot(*to_seen) > libm::sinf(bias) * to_seen.length());
                under_horizon(along.unwrap_or(Vec3::NEG_Z), bias, steps)
            }
            Horizon::Mean => mean_height(normal, libm::sinf(bias), steps) / params.steps as f32,
        };
    }
    sum / params.directions as f32
}

/// Alg. 2, lines 8 to 19: how much of the rays over the surface in a direction is under the highest place, each stretch weighted by how far what raised the horizon
/// is.
fn under_horizon(tangent: Vec3, bias: f32, steps: impl Iterator<Item = (Vec3, f32)>) -> f32 {
    let tangent = libm::asinf((tangent.z / tangent.length().max(1e-12)).clamp(-1.0, 1.0));
    let mut sine = libm::sinf((tangent + bias).min(std::f32::consts::FRAC_PI_2));
    let mut sum = 0.0;
    for (to_seen, weight) in steps {
        let found = to_seen.z / to_seen.length();
        if found > sine {
            sum += weight * (found - sine);
            sine = found;
        }
    }
    sum
}

/// Heights over the surface of all places, as sines over a bias, by weight.
fn mean_height(normal: Vec3, bias: f32, steps: impl Iterator<Item = (Vec3, f32)>) -> f32 {
    steps.map(|(to_seen, weight)| weight * (normal.dot(to_seen) / to_seen.length() - bias).max(0.0)).sum()
}
