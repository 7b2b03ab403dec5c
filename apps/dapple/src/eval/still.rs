//! Places that stand still, out of reach of anything that moves, for some client frames: what changes there is flicker.
//!
//! The same places are looked up again, not the pixels that they have moved to: so a moving camera adds nothing of its own.

use dapple_client::Drawn;
use dapple_scene::glam::Vec3;
use dapple_scene::{Aabb, Scene};

/// What of a picture stands still, and what does not.
pub(super) struct StillMap {
    /// For each pixel its own centre, in pixels from the top left corner, or NaN where it shows, in part at least, nothing, something
    /// that moves, or a place within reach of something that moves.
    pub(super) places: Vec<[f32; 2]>,
    /// Whether a pixel shows, in part at least, something that moves or a place within reach of it.
    pub(super) touched: Vec<bool>,
}

/// Still at the picture's time and at all of `times_s`.
pub(super) fn still_map(
    scene: &Scene,
    drawn: &Drawn,
    times_s: &[f64],
    moving: &[bool],
    radius_m: f32,
) -> StillMap {
    let reach = reach(scene, drawn, times_s, moving, radius_m);
    let gbuffer = &drawn.gbuffer;
    // Of each sample, where it shows something: whether that stands still.
    let still: Vec<Option<bool>> = gbuffer.map_surfaces(scene, &drawn.pose, |index, surface| {
        let place: Vec3 = surface?.position_world;
        let untouched = reach.iter().all(|bounds| bounds.distance_squared(place) > 0.0);
        Some(untouched && !moving[gbuffer.samples()[index].instance as usize])
    });
    let width = gbuffer.width as usize;
    let pixels =
        gbuffer.map_pixels(|mut samples| Iterator::all(&mut samples, |index| still[index] == Some(true)));
    let touched =
        gbuffer.map_pixels(|mut samples| Iterator::any(&mut samples, |index| still[index] == Some(false)));
    let centre = |pixel: usize| [(pixel % width) as f32 + 0.5, (pixel / width) as f32 + 0.5];
    let places = pixels
        .into_iter()
        .enumerate()
        .map(|(pixel, still)| if still { centre(pixel) } else { [f32::NAN; 2] })
        .collect();
    StillMap { places, touched: touched.into_iter().collect() }
}

/// Boxes around what moves, at all times together, as wide as rays reach.
fn reach(scene: &Scene, drawn: &Drawn, times_s: &[f64], moving: &[bool], radius_m: f32) -> Vec<Aabb> {
    let movers: Vec<usize> =
        (0..scene.instances.len()).filter(|&i| moving[i] && scene.instances[i].casts).collect();
    let mut bounds: Vec<Aabb> = movers.iter().map(|&i| scene.instance_bounds_world(&drawn.pose, i)).collect();
    if movers.is_empty() {
        return bounds;
    }
    for &time_s in times_s {
        let pose = scene.pose(time_s);
        for (bounds, &i) in bounds.iter_mut().zip(&movers) {
            *bounds = bounds.union(scene.instance_bounds_world(&pose, i));
        }
    }
    bounds.into_iter().map(|b| b.inflated(radius_m)).collect()
}
