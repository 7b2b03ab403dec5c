//! Where the samples of a picture lie in the charts.

use dapple_scene::{Pose, PosedCamera, Projection, Scene, ShadingPoint};
use dapple_store::cones::{BACK, Charting, PixelPlace};
use glam::Vec3;
use rayon::prelude::*;

use crate::gbuffer::GBuffer;

/// The place of every sample in the charts, with the edge of a pixel there and the normal that it is shaded with; `None` for the background
/// and what carries no cones. `points` are the same samples, of [`crate::shade::shading_points`].
///
/// The footprint is that of a surface that faces the viewer at the sample's distance along the camera's axis.
///
/// # Panics
/// If there is not one point a sample.
pub fn pixel_places(
    scene: &Scene,
    pose: &Pose,
    camera: &PosedCamera,
    gbuffer: &GBuffer,
    points: &[Option<ShadingPoint>],
    charting: &Charting,
) -> Vec<Option<PixelPlace>> {
    assert_eq!(points.len(), gbuffer.samples().len(), "one point a sample");
    let eye_world = camera.eye_world();
    let axis_world = camera.world_from_view.transform_vector3(Vec3::NEG_Z).normalize_or_zero();
    let height = gbuffer.height as f32;
    let edge = |position: Vec3| match camera.projection {
        Projection::Perspective { yfov, .. } => {
            2.0 * libm::tanf(0.5 * yfov) * (position - eye_world).dot(axis_world).max(0.0) / height
        }
        Projection::Orthographic { half_height, .. } => 2.0 * half_height.abs() / height,
    };
    let samples = (0..gbuffer.samples().len()).into_par_iter().with_min_len(1024);
    samples
        .map(|i| {
            let sample = &gbuffer.samples()[i];
            let point = points[i].as_ref()?;
            let (instance, triangle, barycentrics) = (sample.instance, sample.triangle, sample.barycentrics);
            let mut place = charting.place_with(instance, triangle, barycentrics, || {
                gbuffer.surface_rest(scene, i).map(|rest| (rest.position_rest, rest.normal_rest))
            })?;
            let lean = if point.normal_shading_world == point.normal_world {
                [0.0; 2]
            } else {
                gbuffer.lean(scene, pose, i, point.normal_shading_world)?
            };
            if sample.is_back_face() {
                place.chart |= BACK;
            }
            Some(PixelPlace {
                instance,
                triangle,
                barycentrics,
                place,
                footprint_m: edge(point.position_world),
                lean,
            })
        })
        .collect()
}
