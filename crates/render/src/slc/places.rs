//! Where the samples of a picture lie in the charts.

use dapple_scene::{Pose, PosedCamera, Projection, Scene};
use dapple_store::cones::{BACK, Charting, PixelPlace};
use glam::Vec3;
use rayon::prelude::*;

use crate::gbuffer::GBuffer;

/// The place of every sample in the charts, with the edge of a pixel there; `None` for the background and what carries no cones.
///
/// The footprint is that of a surface that faces the viewer at the sample's distance along the camera's axis.
pub fn pixel_places(
    scene: &Scene,
    pose: &Pose,
    camera: &PosedCamera,
    gbuffer: &GBuffer,
    charting: &Charting,
) -> Vec<Option<PixelPlace>> {
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
            let rest = gbuffer.surface_rest(scene, i)?;
            let position = gbuffer.position_world(scene, pose, i)?;
            let (instance, triangle, barycentrics) = (sample.instance, sample.triangle, sample.barycentrics);
            let mut place =
                charting.place(instance, triangle, barycentrics, rest.position_rest, rest.normal_rest)?;
            if sample.is_back_face() {
                place.chart |= BACK;
            }
            Some(PixelPlace { instance, triangle, barycentrics, place, footprint_m: edge(position) })
        })
        .collect()
}
