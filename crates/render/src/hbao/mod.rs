//! Horizon-based ambient occlusion, and HBAO+, its simpler successor.
//!
//! Takes distances and normals of a picture's samples ([`Screen`]); returns one visibility a sample. See `README.md`.

#[cfg(test)]
mod tests;

use crate::bilateral::Bilateral;
use crate::gbuffer::Screen;
use crate::noise::interleaved_gradient;
use crate::sdao::{Looks, Lookup};
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
    estimate_visibility_with(screen, params, &Lookup::default())
}

/// The same with what is known of hidden surfaces: of all that a step may look at, what blocks most counts (\[Vermeer2021\] Alg. 2, and lines 18 to 25 of Alg. 3).
///
/// # Errors
/// A parameter out of its range, or hidden surfaces of another picture.
pub fn estimate_visibility_with(
    screen: &Screen,
    params: &HbaoParams,
    lookup: &Lookup<'_>,
) -> Result<Vec<f32>, RenderError> {
    estimate_by_passes(screen, params, lookup, &mut |_| ())
}

/// As [`estimate_visibility_with`], and tells when each pass is done: `samples`, `blur`.
///
/// # Errors
/// As there.
pub fn estimate_by_passes(
    screen: &Screen,
    params: &HbaoParams,
    lookup: &Lookup<'_>,
    after: AfterPass<'_>,
) -> Result<Vec<f32>, RenderError> {
    params.check()?;
    lookup.check(screen)?;
    let estimator = Estimator::new(screen, params, lookup);
    let visibility = screen.map(|at| match estimator.centre(at) {
        Some(centre) => params.visibility(estimator.occlusion(&centre)),
        None => 1.0,
    });
    after("samples");
    let visibility = Bilateral::within(params.radius_m, params.blur_taps).smooth(screen, &visibility);
    after("blur");
    Ok(visibility)
}

impl HbaoParams {
    /// By the mean occlusion of all directions.
    pub(crate) fn visibility(&self, occlusion: f32) -> f32 {
        1.0 - (self.strength * occlusion).clamp(0.0, 1.0)
    }
}

/// A place on a surface, in the view space of some picture, and where on that picture it lies.
pub(crate) struct Centre {
    /// Coordinates as of [`Screen::place_view`].
    pub(crate) point: [f32; 2],
    pub(crate) place: Vec3,
    pub(crate) normal: Vec3,
    /// How far directions are turned, as a part of the angle between two of them, and steps moved, as a part of one.
    pub(crate) turn: f32,
    pub(crate) jitter: f32,
}

/// Looks along directions of a picture.
pub(crate) struct Estimator<'a> {
    screen: &'a Screen,
    params: &'a HbaoParams,
    lookup: &'a Lookup<'a>,
    bias: f32,
    sin_bias: f32,
}

impl<'a> Estimator<'a> {
    pub(crate) fn new(screen: &'a Screen, params: &'a HbaoParams, lookup: &'a Lookup<'a>) -> Estimator<'a> {
        let bias = params.bias_degrees.to_radians();
        Estimator { screen, params, lookup, bias, sin_bias: libm::sinf(bias) }
    }

    /// What a sample of the picture itself sees; `None` for the background, and for a triangle without an area, which has no normal.
    pub(crate) fn centre(&self, at: [usize; 2]) -> Option<Centre> {
        let index = at[1] * self.screen.columns() as usize + at[0];
        let normal = self.screen.normals_view()[index];
        let place = self.screen.position_view(index).filter(|_| normal != Vec3::ZERO)?;
        // Directions and steps begin elsewhere in each sample.
        let (turn, jitter) = (interleaved_gradient(at), interleaved_gradient([at[1] + 57, at[0] + 23]));
        Some(Centre { point: self.screen.centre(at), place, normal, turn, jitter })
    }

    /// The mean over all directions.
    pub(crate) fn occlusion(&self, centre: &Centre) -> f32 {
        let mut sum = 0.0;
        for direction in 0..self.params.directions {
            sum += self.along(centre, self.direction(centre, direction));
        }
        sum / self.params.directions as f32
    }

    /// Unit vector of a direction on the picture, row downwards.
    pub(crate) fn direction(&self, centre: &Centre, direction: u32) -> [f32; 2] {
        let turn = (direction as f32 + centre.turn) / self.params.directions as f32;
        let (sin, cos) = libm::sincosf(std::f32::consts::TAU * turn);
        [cos, sin]
    }

    /// Where the plane of the surface goes in a direction of the picture.
    pub(crate) fn tangent(&self, centre: &Centre, [cos, sin]: [f32; 2]) -> Option<Vec3> {
        let [column, row] = centre.point;
        let next = self.screen.on_plane(column + cos, row + sin, centre.place, centre.normal);
        next.map(|next| next - centre.place)
    }

    /// Occlusion from one direction.
    pub(crate) fn along(&self, centre: &Centre, [cos, sin]: [f32; 2]) -> f32 {
        let radius = self.params.radius_m * self.screen.samples_per_metre(-centre.place.z);
        let step = radius / (self.params.steps + 1) as f32;
        let steps = (0..self.params.steps).filter_map(|i| {
            let length = step * (i as f32 + 0.5 + centre.jitter);
            let point = [centre.point[0] + length * cos, centre.point[1] + length * sin];
            self.screen.sample_in(point)
        });
        match self.params.horizon {
            Horizon::Highest => {
                let tangent = self.tangent(centre, [cos, sin]).unwrap_or(Vec3::NEG_Z);
                self.under_horizon(centre, tangent, steps)
            }
            Horizon::Mean => steps.map(|at| self.height(centre, at)).sum::<f32>() / self.params.steps as f32,
        }
    }

    /// The way to the first surface of a sample.
    fn to_first(&self, centre: &Centre, at: [usize; 2]) -> Option<Vec3> {
        Some(self.screen.position_at(at)? - centre.place)
    }

    /// The ways to hidden ones.
    fn to_hidden(&self, centre: &Centre, at: [usize; 2]) -> impl Iterator<Item = Vec3> {
        let place = centre.place;
        self.lookup.places(self.screen, at).map(move |hidden| hidden - place)
    }

    /// How much what is so far away counts; `None` beyond the radius.
    fn weight(&self, to_seen: Vec3) -> Option<f32> {
        let squared = to_seen.length_squared();
        let part = squared / (self.params.radius_m * self.params.radius_m);
        (part < 1.0 && squared > 0.0).then_some(1.0 - part)
    }

    /// Alg. 2, lines 8 to 35: how much of the rays over the surface in a direction is under the highest place, each stretch weighted by how far what raised the
    /// horizon is.
    fn under_horizon(&self, centre: &Centre, tangent: Vec3, steps: impl Iterator<Item = [usize; 2]>) -> f32 {
        let tangent = libm::asinf((tangent.z / tangent.length().max(1e-12)).clamp(-1.0, 1.0));
        let mut sine = libm::sinf((tangent + self.bias).min(std::f32::consts::FRAC_PI_2));
        let mut sum = 0.0;
        for at in steps {
            // By how much what is seen raises the sum, and to where the horizon.
            let gain = |to_seen: Vec3| {
                let weight = self.weight(to_seen)?;
                let (length, found) = (to_seen.length(), to_seen.z / to_seen.length());
                // Samples lie beside the direction by up to half of one each way: the plane must not rise over itself for that.
                let is_above = centre.normal.dot(to_seen) > self.sin_bias * length;
                (is_above && found > sine).then_some((weight * (found - sine), found))
            };
            let first = self.to_first(centre, at);
            let seen = first.and_then(gain);
            let is_under = |first: Vec3| first.z <= sine * first.length();
            let is_decided = first.is_some_and(|first| match self.lookup.looks {
                Looks::Everywhere => false,
                Looks::WhereFirstIsFar => self.weight(first).is_some() || is_under(first),
                Looks::WhereFirstRises => is_under(first),
            });
            let hidden = if is_decided || self.lookup.is_empty() {
                None
            } else {
                let gains = self.to_hidden(centre, at).filter_map(gain);
                gains.reduce(|best, other| if other.0 > best.0 { other } else { best })
            };
            let hidden = hidden.map(|(more, found)| (self.lookup.compensation * more, found));
            let hidden = hidden.filter(|(more, _)| *more > seen.map_or(0.0, |seen| seen.0));
            if let Some((more, found)) = hidden.or(seen) {
                sum += more;
                sine = found;
            }
        }
        sum
    }

    /// Alg. 3, lines 18 to 24: the greatest height over the surface, as a sine over a bias, by weight, of all that is known under a sample.
    fn height(&self, centre: &Centre, at: [usize; 2]) -> f32 {
        let first = self.to_first(centre, at);
        // Its own sample blocks nothing, and a card draws it twice with other last bits.
        if first == Some(Vec3::ZERO) {
            return 0.0;
        }
        let seen = first.and_then(|first| self.height_of(centre, first));
        if self.lookup.is_empty() || first.is_some_and(|first| self.is_decided(centre, first)) {
            return seen.unwrap_or(0.0);
        }
        seen.unwrap_or(0.0).max(self.lookup.compensation * self.hidden_height(centre, at))
    }

    /// Of one surface (line 23); `None` beyond the radius.
    fn height_of(&self, centre: &Centre, to_seen: Vec3) -> Option<f32> {
        let weight = self.weight(to_seen)?;
        Some(weight * (centre.normal.dot(to_seen) / to_seen.length() - self.sin_bias).max(0.0))
    }

    /// Whether the first surface is all that matters.
    fn is_decided(&self, centre: &Centre, first: Vec3) -> bool {
        match self.lookup.looks {
            Looks::Everywhere => false,
            Looks::WhereFirstIsFar => self.weight(first).is_some(),
            // Rays that come from below the plane may still rise over it.
            Looks::WhereFirstRises => {
                centre.normal.dot(first) <= self.sin_bias * first.length()
                    && self.screen.falls_on(centre.place + first, centre.normal)
            }
        }
    }

    /// The greatest of hidden surfaces. Apart, so that what is always done stays small.
    #[inline(never)]
    fn hidden_height(&self, centre: &Centre, at: [usize; 2]) -> f32 {
        let heights = self.to_hidden(centre, at).filter_map(|hidden| self.height_of(centre, hidden));
        heights.fold(0.0, f32::max)
    }
}
