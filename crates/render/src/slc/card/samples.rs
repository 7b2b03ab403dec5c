//! What a viewer sees, as texels: eight layers of four words a sample, which `cone_fragment` reads.

use dapple_scene::ShadingPoint;
use dapple_store::cones::{ChartPlace, PixelPlace, level_of};
use glam::Vec3;

use super::Texel;

/// Layers of a sample.
pub(super) const LAYERS: usize = 8;

const IS_THERE: u32 = 1;
const HAS_PLACE: u32 = 2;
const HAS_GLOSS: u32 = 4;

/// Layer after layer: position and α; triangle's normal and what there is; shading normal and footprint; direction to the viewer, diffuse albedo and
/// emission, each with a colour of F0; instance, chart and texels of its rectangle; coordinates in it, depth, and level.
pub(super) fn texels(
    points: &[Option<ShadingPoint>],
    pixels: &[Option<PixelPlace>],
    bias: f32,
) -> Vec<Texel> {
    let mut texels = vec![Texel::default(); LAYERS * points.len()];
    for (i, (point, pixel)) in points.iter().zip(pixels).enumerate() {
        let Some(point) = point else { continue };
        let sample = sample(point, pixel.as_ref(), bias);
        for (layer, texel) in sample.into_iter().enumerate() {
            texels[layer * points.len() + i] = texel;
        }
    }
    texels
}

fn sample(point: &ShadingPoint, pixel: Option<&PixelPlace>, bias: f32) -> [Texel; LAYERS] {
    let with = |v: Vec3, w: f32| [v.x, v.y, v.z, w].map(f32::to_bits);
    // Without numbers there are no texels to read. The level is found here: rounded otherwise, it would be one that nobody asked for.
    let pixel = pixel.and_then(|pixel| {
        let ChartPlace { uv: [u, v], depth, texel_m, .. } = pixel.place;
        let level = level_of(pixel.footprint_m, texel_m, bias)?;
        [u, v, depth].into_iter().all(f32::is_finite).then_some((pixel, level))
    });
    let gloss = if point.reflectance.specular { HAS_GLOSS } else { 0 };
    let place = if pixel.is_some() { HAS_PLACE } else { 0 };
    let [x, y, z] = point.normal_world.to_array().map(f32::to_bits);
    let f0 = point.reflectance.f0;
    let (chart, texels) = pixel.map_or_else(Default::default, |(pixel, level)| {
        let place = &pixel.place;
        let [width, height] = place.size.map(u32::from);
        (
            [pixel.instance, place.chart, width | height << 16, 0],
            [place.uv[0].to_bits(), place.uv[1].to_bits(), place.depth.to_bits(), i32::from(level) as u32],
        )
    });
    [
        with(point.position_world, point.reflectance.alpha),
        [x, y, z, IS_THERE | place | gloss],
        with(point.normal_shading_world, pixel.map_or(0.0, |(pixel, _)| pixel.footprint_m)),
        with(point.to_viewer_world, f0.x),
        with(point.reflectance.diffuse, f0.y),
        with(point.emitted, f0.z),
        chart,
        texels,
    ]
}
