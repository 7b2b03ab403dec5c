//! Puts a picture together: direct + visibility × ambient a sample, then the mean of each pixel's samples.
//!
//! Takes shaded samples and (optionally) visibility a sample; returns linear radiance a pixel. Tone mapping comes
//! after, on the resolved radiance ([`LinearImage::to_rgb8`]).

#[cfg(test)]
mod tests;
mod views;

use glam::Vec3;

use crate::RenderError;
use crate::gbuffer::GBuffer;
use crate::image::{LinearImage, Plane};
use crate::shade::Shaded;
pub use views::{
    BACKGROUND_RGB8, ERROR_RANGE, ErrorKind, NormalSpace, PointsView, draw_points, view_error, view_normals,
    view_visibility,
};

/// Composes and box-filters. Visibility (one a sample, 1 = open; `None` is 1 everywhere) multiplies ambient only.
///
/// # Errors
/// Lists that are not as long as the G-buffer has samples.
pub fn compose(
    shaded: &Shaded,
    gbuffer: &GBuffer,
    visibility: Option<&[f32]>,
) -> Result<LinearImage, RenderError> {
    compose_with(&shaded.ambient, shaded, gbuffer, visibility)
}

/// As [`compose`] with other ambient radiance than is in `shaded`, one a sample
/// ([`shade_gathered`](crate::shade::shade_gathered)).
///
/// # Errors
/// As there.
pub fn compose_with(
    ambient: &[Vec3],
    shaded: &Shaded,
    gbuffer: &GBuffer,
    visibility: Option<&[f32]>,
) -> Result<LinearImage, RenderError> {
    let expected = gbuffer.samples().len();
    RenderError::check_length("ambient radiance", ambient.len(), expected)?;
    RenderError::check_length("direct radiance", shaded.direct.len(), expected)?;
    if let Some(visibility) = visibility {
        RenderError::check_length("visibility", visibility.len(), expected)?;
    }
    let radiance = |i: usize| {
        let open = visibility.map_or(1.0, |v| v[i]);
        shaded.direct[i] + ambient[i] * open
    };
    let scale = 1.0 / (gbuffer.samples_per_axis * gbuffer.samples_per_axis) as f32;
    let pixels = gbuffer.map_pixels(|samples| samples.fold(Vec3::ZERO, |sum, i| sum + radiance(i)) * scale);
    Ok(LinearImage { width: gbuffer.width, height: gbuffer.height, pixels })
}

/// A plane of pixels made from values of samples.
#[derive(Clone, Debug, PartialEq)]
pub struct ResolvedPlane {
    /// Mean over a pixel's covered samples; the `uncovered` value where there are none.
    pub values: Plane,
    /// Fraction 0 … 1 of a pixel's samples that are covered.
    pub coverage: Plane,
}

/// Resolves one number a sample (say, visibility) to pixels. Background samples do not count.
///
/// # Errors
/// A list that is not as long as the G-buffer has samples.
pub fn resolve_plane(
    gbuffer: &GBuffer,
    values: &[f32],
    uncovered: f32,
) -> Result<ResolvedPlane, RenderError> {
    RenderError::check_length("the plane's values", values.len(), gbuffer.samples().len())?;
    let all = gbuffer.samples_per_axis * gbuffer.samples_per_axis;
    let pixels = gbuffer.map_pixels(|samples| {
        let (mut sum, mut count) = (0.0f32, 0u32);
        for i in samples.filter(|&i| gbuffer.samples()[i].is_covered()) {
            sum += values[i];
            count += 1;
        }
        (if count == 0 { uncovered } else { sum / count as f32 }, count as f32 / all as f32)
    });
    let (values, coverage) = pixels.into_iter().unzip();
    let plane = |values| Plane { width: gbuffer.width, height: gbuffer.height, values };
    Ok(ResolvedPlane { values: plane(values), coverage: plane(coverage) })
}
