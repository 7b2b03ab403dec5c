//! Places that stand still, untouched by anything that moves, from one client frame to the next: what changes there is flicker.

use dapple_client::Drawn;
use dapple_render::gbuffer::GBuffer;
use dapple_scene::glam::Vec3;
use dapple_scene::{Aabb, PosedCamera, Scene};

/// Farthest that a place may lie from the plane of what is seen there a frame later, as a part of its distance.
const PLANE_TOLERANCE: f32 = 2e-3;
/// Least cosine between the normals.
const LEAST_COSINE: f32 = 0.95;

/// For each pixel, where its place is seen one frame later: pixels from the top left corner, or NaN if it is not seen, moves, or is
/// within reach of something that moves.
pub(super) type StillMap = Vec<[f32; 2]>;

/// What one pixel shows, if all its samples show one surface.
#[derive(Clone, Copy)]
struct Place {
    instance: u32,
    position_world: Vec3,
    normal_world: Vec3,
}

pub(super) fn still_map(
    scene: &Scene,
    before: &Drawn,
    after: &Drawn,
    after_camera: &PosedCamera,
    moving: &[bool],
    radius_m: f32,
) -> StillMap {
    let reach = reach(scene, before, after, moving, radius_m);
    let (from, to) = (places(scene, before), places(scene, after));
    let (width, height) = (after.gbuffer.width, after.gbuffer.height);
    let clip_from_world = after_camera.clip_from_view(width as f32 / height as f32)
        * dapple_scene::glam::Mat4::from(after_camera.view_from_world());
    let eye = after_camera.eye_world();
    let map = |place: &Option<Place>| {
        let place = (*place).filter(|p| !moving[p.instance as usize])?;
        if reach.iter().any(|bounds| bounds.distance_squared(place.position_world) == 0.0) {
            return None;
        }
        let clip = clip_from_world * place.position_world.extend(1.0);
        if clip.w <= 0.0 {
            return None;
        }
        let x = (0.5 + 0.5 * clip.x / clip.w) * width as f32;
        let y = (0.5 - 0.5 * clip.y / clip.w) * height as f32;
        let tolerance_m = PLANE_TOLERANCE * place.position_world.distance(eye);
        let same = |x: i64, y: i64| {
            let inside = (0..i64::from(width)).contains(&x) && (0..i64::from(height)).contains(&y);
            let other = inside.then(|| to[(y * i64::from(width) + x) as usize]).flatten();
            other.is_some_and(|other| {
                other.instance == place.instance
                    && other.normal_world.dot(place.normal_world) >= LEAST_COSINE
                    && (other.position_world - place.position_world).dot(place.normal_world).abs()
                        <= tolerance_m
            })
        };
        // All four pixels that it is interpolated from.
        let (left, top) = ((x - 0.5).floor() as i64, (y - 0.5).floor() as i64);
        let seen = (0..2).all(|dy| (0..2).all(|dx| same(left + dx, top + dy)));
        seen.then_some([x, y])
    };
    use rayon::prelude::*;
    from.par_iter().map(|place| map(place).unwrap_or([f32::NAN; 2])).collect()
}

/// Boxes around what moves between the two pictures, as wide as rays reach.
fn reach(scene: &Scene, before: &Drawn, after: &Drawn, moving: &[bool], radius_m: f32) -> Vec<Aabb> {
    let movers = (0..scene.instances.len()).filter(|&i| moving[i] && scene.instances[i].casts);
    movers
        .map(|i| {
            let bounds = [before, after].map(|d| scene.instance_bounds_world(&d.pose, i));
            bounds[0].union(bounds[1]).inflated(radius_m)
        })
        .collect()
}

fn places(scene: &Scene, drawn: &Drawn) -> Vec<Option<Place>> {
    let gbuffer: &GBuffer = &drawn.gbuffer;
    let surfaces = gbuffer.map_surfaces(scene, &drawn.pose, |index, surface| {
        let instance = gbuffer.samples()[index].instance;
        surface.map(|s| Place { instance, position_world: s.position_world, normal_world: s.normal_world })
    });
    gbuffer.map_pixels(|samples| {
        let mut place: Option<Place> = None;
        let mut count = 0.0;
        for index in samples {
            let found = surfaces[index]?;
            match &mut place {
                None => place = Some(found),
                Some(first) if first.instance == found.instance => {
                    first.position_world += found.position_world;
                }
                Some(_) => return None,
            }
            count += 1.0;
        }
        place.map(|p| Place { position_world: p.position_world / count, ..p })
    })
}
