//! Pictures for looking at data: normals, visibility, errors, points.

use dapple_scene::{Pose, PosedCamera, Scene};
use glam::Vec3;

use super::resolve_plane;
use crate::RenderError;
use crate::gbuffer::GBuffer;
use crate::image::{Plane, Rgb8Image, unorm8};
use crate::projection;

/// What views show where nothing is covered: a dark blue that no gray and no error has.
pub const BACKGROUND_RGB8: [u8; 3] = [24, 34, 62];

/// Error at which the colours of [`view_error`] end.
pub const ERROR_RANGE: f32 = 0.25;

/// Absolute errors, dark to light: nothing is nearly black, the end is yellow. Blue and yellow differ for everyone.
const SEQUENTIAL: [[f32; 3]; 5] = [
    [8.0, 8.0, 12.0],
    [30.0, 60.0, 130.0],
    [118.0, 116.0, 128.0],
    [196.0, 170.0, 92.0],
    [255.0, 233.0, 68.0],
];

/// Signed errors: too dark is blue, none is white, too light is orange to brown.
const DIVERGING: [[f32; 3]; 5] = [
    [5.0, 60.0, 130.0],
    [110.0, 170.0, 215.0],
    [247.0, 247.0, 247.0],
    [240.0, 165.0, 85.0],
    [150.0, 65.0, 5.0],
];

/// Whose normals a view shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NormalSpace {
    /// Interpolated, in the world.
    World,
    /// Of the resting triangles.
    Rest,
}

/// Which difference a view shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorKind {
    /// test − reference, −0.25 … 0.25.
    Signed,
    /// |test − reference|, 0 … 0.25.
    Absolute,
}

/// Normals as colours: −1 … 1 becomes 0 … 255 in each channel, without an sRGB curve.
pub fn view_normals(gbuffer: &GBuffer, scene: &Scene, pose: &Pose, space: NormalSpace) -> Rgb8Image {
    let colors = gbuffer.map_surfaces(scene, pose, |_, surface| {
        surface.map(|s| match space {
            NormalSpace::World => s.normal_shading_world,
            NormalSpace::Rest => s.normal_rest,
        })
    });
    let background = Vec3::from_array(BACKGROUND_RGB8.map(|c| f32::from(c) / 255.0));
    let scale = 1.0 / (gbuffer.samples_per_axis * gbuffer.samples_per_axis) as f32;
    let pixels = gbuffer.map_pixels(|samples| {
        let sum = samples.fold(Vec3::ZERO, |sum, i| sum + colors[i].map_or(background, |n| n * 0.5 + 0.5));
        (sum * scale).to_array().map(unorm8)
    });
    Rgb8Image { width: gbuffer.width, height: gbuffer.height, pixels }
}

/// Visibility as gray: 255 × visibility without an sRGB curve, so that a picture can be measured.
///
/// # Errors
/// A list that is not as long as the G-buffer has samples.
pub fn view_visibility(gbuffer: &GBuffer, visibility: &[f32]) -> Result<Rgb8Image, RenderError> {
    let resolved = resolve_plane(gbuffer, visibility, 0.0)?;
    let pixels = resolved.values.values.iter().zip(&resolved.coverage.values);
    let pixels = pixels.map(|(&v, &c)| over_background([v.clamp(0.0, 1.0) * 255.0; 3], c)).collect();
    Ok(Rgb8Image { width: gbuffer.width, height: gbuffer.height, pixels })
}

/// The difference of two planes in colours; where `coverage` is 0 the background.
///
/// # Errors
/// Planes of different sizes.
pub fn view_error(
    reference: &Plane,
    test: &Plane,
    coverage: &Plane,
    kind: ErrorKind,
) -> Result<Rgb8Image, RenderError> {
    let expected = reference.width as usize * reference.height as usize;
    RenderError::check_length("the reference plane", reference.values.len(), expected)?;
    RenderError::check_length("the test plane", test.values.len(), expected)?;
    RenderError::check_length("the coverage plane", coverage.values.len(), expected)?;
    let pixels = (0..expected).map(|i| {
        let error = (test.values[i] - reference.values[i]) / ERROR_RANGE;
        let color = match kind {
            ErrorKind::Signed => ramp(&DIVERGING, 0.5 + 0.5 * error),
            ErrorKind::Absolute => ramp(&SEQUENTIAL, error.abs()),
        };
        over_background(color, coverage.values[i])
    });
    Ok(Rgb8Image { width: reference.width, height: reference.height, pixels: pixels.collect() })
}

/// A colour on a ramp at `t`, clamped to 0 … 1.
fn ramp(colors: &[[f32; 3]; 5], t: f32) -> [f32; 3] {
    let t = if t.is_nan() { 0.0 } else { t.clamp(0.0, 1.0) * 4.0 };
    let i = (t.floor() as usize).min(3);
    let f = t - i as f32;
    std::array::from_fn(|c| colors[i][c] + (colors[i + 1][c] - colors[i][c]) * f)
}

fn over_background(color: [f32; 3], coverage: f32) -> [u8; 3] {
    std::array::from_fn(|c| {
        let background = f32::from(BACKGROUND_RGB8[c]);
        unorm8((background + (color[c] - background) * coverage) / 255.0)
    })
}

/// How [`draw_points`] draws.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointsView {
    /// Radius of a disc, pixels, > 0; default 1.5.
    pub radius_px: f32,
    /// What the picture below is multiplied with, 0 … 1; default 0.4.
    pub dim: f32,
}

impl Default for PointsView {
    fn default() -> Self {
        PointsView { radius_px: 1.5, dim: 0.4 }
    }
}

/// Draws points in the world as discs over a dimmed picture of the same G-buffer, coloured by their values (0 dark
/// blue … 1 yellow), hidden where the G-buffer shows something nearer. Of discs that overlap the nearest is seen.
///
/// # Errors
/// Lists or picture of the wrong size, or a camera that cannot project.
pub fn draw_points(
    picture: &Rgb8Image,
    gbuffer: &GBuffer,
    camera: &PosedCamera,
    positions_world: &[Vec3],
    values: &[f32],
    params: &PointsView,
) -> Result<Rgb8Image, RenderError> {
    let (width, height) = (gbuffer.width, gbuffer.height);
    let pixel_count = width as usize * height as usize;
    RenderError::check_length("the picture", picture.pixels.len(), pixel_count)?;
    RenderError::check_length("the points' values", values.len(), positions_world.len())?;
    let clip_from_world = projection::clip_from_world(camera, width, height)?;
    // The farthest that a pixel shows: a disc at a silhouette is not cut by what is in front of half of it.
    let shown = gbuffer.map_pixels(|samples| {
        let nearest_last = samples.map(|i| gbuffer.samples()[i].depth).fold(f32::INFINITY, f32::min);
        projection::view_distance(&camera.projection, nearest_last)
    });
    let dimmed = |p: &[u8; 3]| p.map(|c| unorm8(f32::from(c) / 255.0 * params.dim));
    let mut pixels: Vec<[u8; 3]> = picture.pixels.iter().map(dimmed).collect();
    let mut disc_distance = vec![f32::INFINITY; pixel_count];
    let radius = params.radius_px.clamp(0.5, 64.0);
    // Metres a pixel at distance 1 (perspective) or anywhere (parallel).
    let pixel_m = match camera.projection {
        dapple_scene::Projection::Perspective { yfov, .. } => 2.0 * libm::tanf(0.5 * yfov) / height as f32,
        dapple_scene::Projection::Orthographic { half_height, .. } => 2.0 * half_height / height as f32,
    };
    let is_perspective = matches!(camera.projection, dapple_scene::Projection::Perspective { .. });
    for (position, &value) in positions_world.iter().zip(values) {
        let clip = clip_from_world * position.as_dvec3().extend(1.0);
        if !(clip.is_finite() && clip.w > 0.0 && clip.z >= 0.0 && clip.z <= clip.w) {
            continue;
        }
        let x = ((0.5 + 0.5 * clip.x / clip.w) * f64::from(width)) as f32;
        let y = ((0.5 - 0.5 * clip.y / clip.w) * f64::from(height)) as f32;
        let distance = projection::view_distance(&camera.projection, (clip.z / clip.w) as f32);
        // A disc lies on a slanted surface: what is nearer by no more than its own size does not hide it.
        let disc_m = radius * pixel_m * if is_perspective { distance } else { 1.0 };
        let tolerance = 2.0 * disc_m + 1e-3 * distance.abs();
        let [red, green, blue] = ramp(&SEQUENTIAL, 0.15 + 0.85 * value);
        let color = [red, green, blue].map(|c| unorm8(c / 255.0));
        let range = |center: f32, limit: u32| {
            let first = (center - radius - 0.5).ceil().max(0.0) as u32;
            let end = ((center + radius - 0.5).floor() + 1.0).clamp(0.0, limit as f32) as u32;
            first..end
        };
        for row in range(y, height) {
            for column in range(x, width) {
                let (dx, dy) = (column as f32 + 0.5 - x, row as f32 + 0.5 - y);
                let i = row as usize * width as usize + column as usize;
                if dx * dx + dy * dy > radius * radius
                    || distance >= disc_distance[i]
                    || distance > shown[i] + tolerance
                {
                    continue;
                }
                disc_distance[i] = distance;
                pixels[i] = color;
            }
        }
    }
    Ok(Rgb8Image { width, height, pixels })
}
