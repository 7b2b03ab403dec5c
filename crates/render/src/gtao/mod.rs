//! Ground-truth ambient occlusion with a visibility bitmask: what screen space does best with one layer of depth.
//!
//! Takes distances and normals of a picture's samples ([`Screen`]); returns one visibility a sample. See `README.md`.

#[cfg(test)]
mod tests;

use std::f32::consts::{FRAC_PI_2, PI};

use crate::bilateral::Bilateral;
use crate::gbuffer::Screen;
use crate::noise::interleaved_gradient;
use crate::{AfterPass, RenderError};
use glam::Vec3;

/// Most slices, and most steps along each half of one.
pub const MAX_STEPS: u32 = 64;

/// Sectors of a slice, one a bit.
const SECTORS: f32 = 32.0;

/// How visibility is estimated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GtaoParams {
    /// Radius in which others block, metres, > 0; default 0.6.
    pub radius_m: f32,
    /// Planes through the eye's ray that are looked along, 1 … [`MAX_STEPS`]; default 3.
    pub slices: u32,
    /// Steps to either side in each, 1 … [`MAX_STEPS`]; default 6.
    pub steps: u32,
    /// How thick what the picture shows is taken to be, as a part of the radius, > 0: what is behind that blocks nothing. Default 0.5.
    pub thickness_of_radius: f32,
    /// How far what blocks must stand above the surface, as a sine, 0 … 0.9; default 0.02.
    pub bias: f32,
    /// Taps of the blur on either side, 0 (none) … 16; default 3.
    pub blur_taps: u32,
}

impl Default for GtaoParams {
    fn default() -> Self {
        GtaoParams { radius_m: 0.6, slices: 3, steps: 6, thickness_of_radius: 0.5, bias: 0.02, blur_taps: 3 }
    }
}

impl GtaoParams {
    /// Whether every parameter is in its range.
    ///
    /// # Errors
    /// Names the first that is not.
    pub fn check(&self) -> Result<(), RenderError> {
        let positive = |value: f32| value > 0.0 && value.is_finite();
        let counted = |value: u32| (1..=MAX_STEPS).contains(&value);
        let (bias, thickness) = ((0.0..=0.9).contains(&self.bias), self.thickness_of_radius);
        let checks: [(&'static str, f64, bool, &'static str); 6] = [
            ("gtao: radius_m", self.radius_m.into(), positive(self.radius_m), "finite and above 0"),
            ("gtao: slices", self.slices.into(), counted(self.slices), "1 to 64"),
            ("gtao: steps", self.steps.into(), counted(self.steps), "1 to 64"),
            ("gtao: thickness_of_radius", thickness.into(), positive(thickness), "finite and above 0"),
            ("gtao: bias", self.bias.into(), bias, "0 to 0.9"),
            ("gtao: blur_taps", self.blur_taps.into(), self.blur_taps <= 16, "0 to 16"),
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
pub fn estimate_visibility(screen: &Screen, params: &GtaoParams) -> Result<Vec<f32>, RenderError> {
    estimate_by_passes(screen, params, &mut |_| ())
}

/// As [`estimate_visibility`], and tells when each pass is done: `samples`, `blur`.
///
/// # Errors
/// As there.
pub fn estimate_by_passes(
    screen: &Screen,
    params: &GtaoParams,
    after: AfterPass<'_>,
) -> Result<Vec<f32>, RenderError> {
    params.check()?;
    let visibility = screen.map(|at| visibility_at(screen, params, at));
    after("samples");
    let visibility = Bilateral::within(params.radius_m, params.blur_taps).smooth(screen, &visibility);
    after("blur");
    Ok(visibility)
}

fn visibility_at(screen: &Screen, params: &GtaoParams, at: [usize; 2]) -> f32 {
    let index = at[1] * screen.columns() as usize + at[0];
    let normal = screen.normals_view()[index];
    // A triangle without an area has no normal.
    let Some(place) = screen.position_view(index).filter(|_| normal != Vec3::ZERO) else { return 1.0 };
    let eye = screen.towards_eye(place);
    let radius = params.radius_m * screen.samples_per_metre(-place.z);
    let (turn, jitter) = (interleaved_gradient(at), interleaved_gradient([at[1] + 57, at[0] + 23]));
    let thickness_m = params.thickness_of_radius * params.radius_m;
    let (mut open, mut all) = (0.0, 0.0);
    for number in 0..params.slices {
        let angle = PI * (number as f32 + turn) / params.slices as f32;
        let (sin, cos) = libm::sincosf(angle);
        // Down the picture is −y.
        let Some(slice) = Slice::new(eye, normal, Vec3::new(cos, -sin, 0.0)) else { continue };
        let mut blocked = 0u32;
        for side in [1.0, -1.0] {
            for step in 0..params.steps {
                // Most places lie near.
                let part = (step as f32 + 0.25 + 0.75 * jitter) / params.steps as f32;
                let length = side * (radius * part * part + 1.0);
                let Some(seen) = screen.neighbour(at, [length * cos, length * sin]) else { continue };
                let Some(seen) = screen.position_at(seen) else { continue };
                let to_seen = seen - place;
                let above = normal.dot(to_seen) > params.bias * to_seen.length();
                if above && to_seen.length_squared() <= params.radius_m * params.radius_m {
                    blocked |= slice.sectors(to_seen, to_seen - screen.towards_eye(seen) * thickness_m, side);
                }
            }
        }
        open += slice.weight * (1.0 - blocked.count_ones() as f32 / SECTORS);
        all += slice.weight;
    }
    if all > 0.0 { open / all } else { 1.0 }
}

/// A plane through the eye's ray. Angles in it are from the way to the eye, positive to one side.
struct Slice {
    eye: Vec3,
    /// Angle of the normal, brought into the plane.
    normal: f32,
    /// The least angle of the hemisphere, in [`Slice::gathered`].
    least: f32,
    /// What the slice counts: the light that comes through it.
    weight: f32,
    /// All that comes, in [`Slice::gathered`].
    all: f32,
}

impl Slice {
    fn new(eye: Vec3, normal: Vec3, direction: Vec3) -> Option<Slice> {
        let side = (direction - eye * direction.dot(eye)).try_normalize()?;
        let across = side.cross(eye);
        let projected = normal - across * normal.dot(across);
        let length = projected.length();
        if length < 1e-4 {
            return None;
        }
        let mut slice = Slice {
            eye,
            normal: libm::atan2f(projected.dot(side), projected.dot(eye)),
            least: 0.0,
            weight: 0.0,
            all: 0.0,
        };
        slice.least = slice.gathered(slice.normal - FRAC_PI_2);
        slice.all = slice.gathered(slice.normal + FRAC_PI_2) - slice.least;
        slice.weight = length * slice.all;
        Some(slice)
    }

    /// Light from the eye's ray up to an angle, cos(θ − γ) |sin θ| integrated (\[Jimenez2016\] eq. 7), with the angle's sign.
    fn gathered(&self, angle: f32) -> f32 {
        let gamma = self.normal;
        let value =
            0.25 * (libm::cosf(gamma) - libm::cosf(2.0 * angle - gamma) + 2.0 * angle * libm::sinf(gamma));
        value.copysign(angle)
    }

    /// Bits of the sectors between the front and the back of what is seen. All sectors bring the same light.
    fn sectors(&self, front: Vec3, back: Vec3, side: f32) -> u32 {
        let part = |to: Vec3| {
            let angle = side * libm::acosf((to.dot(self.eye) / to.length().max(1e-12)).clamp(-1.0, 1.0));
            let angle = angle.clamp(self.normal - FRAC_PI_2, self.normal + FRAC_PI_2);
            SECTORS * ((self.gathered(angle) - self.least) / self.all).clamp(0.0, 1.0)
        };
        let (a, b) = (part(front), part(back));
        // A sector is blocked where half of it is.
        let (low, high) = (a.min(b).round() as u32, a.max(b).round() as u32);
        let up_to = |bit: u32| u32::try_from((1u64 << bit) - 1).unwrap_or(u32::MAX);
        up_to(high) & !up_to(low)
    }
}
