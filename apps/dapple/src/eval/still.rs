//! Places that stand still, out of reach of anything that moves, for some client frames: what changes there is flicker.
//!
//! The same places are looked up again, not the pixels that they have moved to: so a moving camera adds nothing of its own.

use dapple_client::Drawn;
use dapple_scene::glam::Vec3;
use dapple_scene::{Aabb, Scene};

/// For each pixel its own centre, in pixels from the top left corner, or NaN where it shows nothing, something that moves, or a
/// place within reach of something that moves.
pub(super) type StillMap = Vec<[f32; 2]>;

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
    let still = gbuffer.map_surfaces(scene, &drawn.pose, |index, surface| {
        let place: Option<Vec3> = surface.map(|s| s.position_world);
        let untouched = |place: Vec3| reach.iter().all(|bounds| bounds.distance_squared(place) > 0.0);
        place.is_some_and(|p| !moving[gbuffer.samples()[index].instance as usize] && untouched(p))
    });
    let width = gbuffer.width as usize;
    let pixels = gbuffer.map_pixels(|mut samples| Iterator::all(&mut samples, |index| still[index]));
    let centre = |pixel: usize| [(pixel % width) as f32 + 0.5, (pixel / width) as f32 + 0.5];
    pixels
        .into_iter()
        .enumerate()
        .map(|(pixel, still)| if still { centre(pixel) } else { [f32::NAN; 2] })
        .collect()
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
