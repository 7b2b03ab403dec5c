//! What lies under one place of a picture, without drawing the rest of it.

use std::cell::OnceCell;

use dapple_scene::{Aabb, Pose, PosedCamera, Scene};
use glam::{Affine3A, DMat4, DVec4, Vec3};

use super::{GBuffer, MAX_SIDE, Sample, SampleSink, Surface, View, check_scene, draw, fill_barycentrics};
use crate::{RenderError, projection};

/// The surface that `camera` sees at a place of a picture of `size` pixels: `at` in pixels from its top left corner. The same that
/// [`rasterize`](super::rasterize) gives the sample whose centre lies there. `None` where there is none, and for places outside of
/// the picture.
///
/// Looks at all vertices and, of the instances whose box lies under the place, at all triangles.
///
/// # Errors
/// As [`rasterize`](super::rasterize).
pub fn surface_at(
    scene: &Scene,
    pose: &Pose,
    camera: &PosedCamera,
    size: (u32, u32),
    at: (f32, f32),
) -> Result<Option<Surface>, RenderError> {
    let (width, height) = size;
    if !(1..=MAX_SIDE).contains(&width) || !(1..=MAX_SIDE).contains(&height) {
        return Err(RenderError::Size { width, height, samples_per_axis: 1 });
    }
    let clip_from_world = projection::clip_from_world(camera, width, height)?;
    check_scene(scene, pose)?;
    let (width, height) = (f64::from(width), f64::from(height));
    let (x, y) = (f64::from(at.0), f64::from(at.1));
    if !((0.0..=width).contains(&x) && (0.0..=height).contains(&y)) {
        return Ok(None);
    }
    // The pixel around the place takes up the whole picture, which has one sample: in its middle.
    let (ndc_x, ndc_y) = (2.0 * x / width - 1.0, 1.0 - 2.0 * y / height);
    let pixel_from_clip = DMat4::from_cols(
        DVec4::new(width, 0.0, 0.0, 0.0),
        DVec4::new(0.0, height, 0.0, 0.0),
        DVec4::new(0.0, 0.0, 1.0, 0.0),
        DVec4::new(-ndc_x * width, -ndc_y * height, 0.0, 1.0),
    );
    let view = View { clip_from_world: pixel_from_clip * clip_from_world, columns: 1, rows: 1 };
    let boxes: Vec<OnceCell<Aabb>> = vec![OnceCell::new(); scene.meshes.len()];
    let is_under = |instance: usize| {
        let posed = &pose.instances[instance];
        let bounds = match &posed.deformed {
            Some(deformed) => Aabb::from_points(deformed.positions.iter().copied()),
            None => {
                let mesh = scene.instances[instance].mesh as usize;
                let around = || Aabb::from_points(scene.meshes[mesh].positions.iter().copied());
                *boxes[mesh].get_or_init(around)
            }
        };
        may_show(&view.clip_from_world, &posed.world_from_mesh, &bounds)
    };
    let mut samples = vec![Sample::BACKGROUND];
    let sink = SampleSink { scene, pose, view: &view };
    draw(&view, scene, pose, true, is_under, &sink, &mut samples);
    fill_barycentrics(&view, scene, pose, &mut samples);
    let gbuffer = GBuffer { width: 1, height: 1, samples_per_axis: 1, samples };
    Ok(gbuffer.surface(scene, pose, 0))
}

/// Whether a part of the box may lie in the picture; perhaps yes too often.
fn may_show(clip_from_world: &DMat4, world_from_mesh: &Affine3A, bounds: &Aabb) -> bool {
    if bounds.is_empty() {
        return false;
    }
    let corners: [DVec4; 8] = std::array::from_fn(|i| {
        let pick = |bit: usize, low: f32, high: f32| if i & bit == 0 { low } else { high };
        let (min, max) = (bounds.min, bounds.max);
        let corner = Vec3::new(pick(1, min.x, max.x), pick(2, min.y, max.y), pick(4, min.z, max.z));
        let world = world_from_mesh.transform_point3(corner);
        *clip_from_world * world.as_dvec3().extend(1.0)
    });
    // The sample in the middle is half a picture from the border: rounding does not reach it.
    let all = |is_outside: fn(&DVec4) -> bool| corners.iter().all(is_outside);
    !(all(|c| c.x > c.w) || all(|c| c.x < -c.w) || all(|c| c.y > c.w) || all(|c| c.y < -c.w))
}
