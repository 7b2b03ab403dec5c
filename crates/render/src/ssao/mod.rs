//! Screen-space ambient occlusion by random places in a hemisphere, with a blur: a baseline of evaluations.
//!
//! Takes distances and normals of a picture's samples ([`Screen`]); returns one visibility a sample. See `README.md`.

mod blur;
mod pattern;
#[cfg(test)]
mod tests;

use glam::Vec3;
use rayon::prelude::*;

use crate::gbuffer::Screen;
use crate::sdao::Lookup;
use crate::{AfterPass, RenderError};
use pattern::Pattern;

/// Most places that are looked at around a sample.
pub const MAX_SAMPLES: u32 = 256;
/// Widest blur, samples of the picture.
pub const MAX_BLUR_WIDTH: u32 = 63;

/// How visibility is estimated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SsaoParams {
    /// Occlusion distance, metres, > 0; default 0.6, that of \[Neff2023\] sec. 4.
    pub radius_m: f32,
    /// Places looked at around each sample, 1 … [`MAX_SAMPLES`]; default 16, Falcor's.
    pub samples: u32,
    /// How far what blocks must stand above the surface's plane, as a part of the radius, 0 … 1; default 0.01. Less
    /// and planes seen at a grazing angle block themselves, because a sample of the picture has one depth.
    pub bias: f32,
    /// Width of the blur in samples of the picture, odd, 1 (none) … [`MAX_BLUR_WIDTH`]; default 5, Falcor's.
    pub blur_width: u32,
    /// Standard deviation of the blur in samples of the picture, > 0; default 2, Falcor's.
    pub blur_sigma: f32,
    /// Of the places and of how they are turned; any, default 0.
    pub seed: u32,
}

impl Default for SsaoParams {
    fn default() -> Self {
        SsaoParams { radius_m: 0.6, samples: 16, bias: 0.01, blur_width: 5, blur_sigma: 2.0, seed: 0 }
    }
}

impl SsaoParams {
    /// Whether every parameter is in its range.
    ///
    /// # Errors
    /// Names the first that is not.
    pub fn check(&self) -> Result<(), RenderError> {
        let positive = |value: f32| value > 0.0 && value.is_finite();
        let odd = self.blur_width % 2 == 1 && self.blur_width <= MAX_BLUR_WIDTH;
        let checks: [(&'static str, f64, bool, &'static str); 5] = [
            ("ssao: radius_m", self.radius_m.into(), positive(self.radius_m), "finite and above 0"),
            ("ssao: samples", self.samples.into(), (1..=MAX_SAMPLES).contains(&self.samples), "1 to 256"),
            ("ssao: bias", self.bias.into(), (0.0..=1.0).contains(&self.bias), "0 to 1"),
            ("ssao: blur_width", self.blur_width.into(), odd, "odd, 1 to 63"),
            ("ssao: blur_sigma", self.blur_sigma.into(), positive(self.blur_sigma), "finite and above 0"),
        ];
        match checks.into_iter().find(|(_, _, holds, _)| !holds) {
            Some((name, found, _, range)) => Err(RenderError::Parameter { name, found, range }),
            None => Ok(()),
        }
    }
}

/// Visibility 0 … 1 of each sample of a picture, row-major from the top, 1 for the background; in parallel by rows in
/// the caller's rayon pool, and the same for any number of threads.
///
/// # Errors
/// A parameter out of its range.
pub fn estimate_visibility(screen: &Screen, params: &SsaoParams) -> Result<Vec<f32>, RenderError> {
    estimate_visibility_with(screen, params, &Lookup::default())
}

/// The same with what is known of hidden surfaces: a place is blocked if any of those that are seen through its sample blocks it (\[Vermeer2021\] sec. 3.2).
///
/// # Errors
/// A parameter out of its range, or hidden surfaces of another picture.
pub fn estimate_visibility_with(
    screen: &Screen,
    params: &SsaoParams,
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
    params: &SsaoParams,
    lookup: &Lookup<'_>,
    after: AfterPass<'_>,
) -> Result<Vec<f32>, RenderError> {
    estimate_with_more(screen, params, lookup, after, |_, _, _, _| 0.0)
}

/// As [`estimate_by_passes`]; of each sample the more of its occlusion and of `more`, which is given place and normal in view space, and turn.
///
/// # Errors
/// As there.
pub(crate) fn estimate_with_more(
    screen: &Screen,
    params: &SsaoParams,
    lookup: &Lookup<'_>,
    after: AfterPass<'_>,
    more: impl Fn(&Estimator<'_>, Vec3, Vec3, Vec3) -> f32 + Sync,
) -> Result<Vec<f32>, RenderError> {
    params.check()?;
    lookup.check(screen)?;
    let pattern = Pattern::new(params.samples, params.seed);
    let estimator = Estimator { params, offsets: &pattern.offsets };
    let columns = screen.columns() as usize;
    let occlusion = screen.map(|[column, row]| {
        let index = row * columns + column;
        let normal = screen.normals_view()[index];
        // A triangle without an area has no normal.
        let Some(place) = screen.position_view(index).filter(|_| normal != Vec3::ZERO) else { return 0.0 };
        let turn = pattern.turn(column, row);
        estimator.occlusion(screen, lookup, place, normal, turn).max(more(&estimator, place, normal, turn))
    });
    after("samples");
    // Blurred as occlusion, so that what is open stays exactly 1.
    let mut visibility = blur::blur(&occlusion, columns, params.blur_width, params.blur_sigma);
    visibility.par_iter_mut().zip(screen.distances_m()).with_min_len(1024).for_each(|(value, distance)| {
        *value = if distance.is_finite() { 1.0 - value.clamp(0.0, 1.0) } else { 1.0 };
    });
    after("blur");
    Ok(visibility)
}

/// The places in the unit hemisphere about +z, and the 16 × 16 unit vectors that they are turned to, row by row.
#[cfg(feature = "gpu")]
pub(crate) fn pattern(params: &SsaoParams) -> (Vec<Vec3>, Vec<Vec3>) {
    let pattern = Pattern::new(params.samples, params.seed);
    (pattern.offsets, pattern.turns)
}

/// Weight of a sample itself in one direction of the blur.
#[cfg(feature = "gpu")]
pub(crate) fn middle_weight(params: &SsaoParams) -> f32 {
    blur::weights(params.blur_width, params.blur_sigma)[0]
}

/// Looks at places around others.
pub(crate) struct Estimator<'a> {
    params: &'a SsaoParams,
    offsets: &'a [Vec3],
}

impl Estimator<'_> {
    /// Part of the places around a position of the view space of a picture, whose surface has this normal, that lie behind what the picture shows.
    pub(crate) fn occlusion(
        &self,
        screen: &Screen,
        lookup: &Lookup<'_>,
        position: Vec3,
        normal: Vec3,
        turn: Vec3,
    ) -> f32 {
        let tangent = tangent(normal, turn);
        let bitangent = normal.cross(tangent);
        let (radius, height) = (self.params.radius_m, self.params.bias * self.params.radius_m);
        let (mut seen, mut hidden) = (0u32, 0u32);
        for offset in self.offsets {
            let place = position + (tangent * offset.x + bitangent * offset.y + normal * offset.z) * radius;
            let is_blocked_by = |by: Vec3| {
                let to_seen = by - position;
                let is_nearer = by.z > place.z;
                let is_within = to_seen.length_squared() <= radius * radius;
                // What hides a place of the hemisphere from an eye above the plane is above it, too: only rounding to samples says else.
                is_nearer && is_within && normal.dot(to_seen) > height
            };
            let Some(other) = screen.point_of(place).and_then(|point| screen.sample_in(point)) else {
                continue;
            };
            // Where the first surface blocks, others change nothing: whether they are looked at there (sec. 3.3) is a matter of time alone.
            if screen.position_at(other).is_some_and(is_blocked_by) {
                seen += 1;
            } else if lookup.places(screen, other).any(is_blocked_by) {
                hidden += 1;
            }
        }
        (seen as f32 + lookup.compensation * hidden as f32) / self.offsets.len() as f32
    }
}

/// The unit vector of the plane with unit normal `normal` that is nearest to `turn`.
fn tangent(normal: Vec3, turn: Vec3) -> Vec3 {
    let along = turn - normal * normal.dot(turn);
    // Nearly parallel vectors leave rounding only.
    if along.length_squared() > 1e-6 { along.normalize() } else { normal.any_orthonormal_vector() }
}
