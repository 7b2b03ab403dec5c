//! Where entries of the cache are in the world: what their triangles say ([Stadlbauer2023] sec. 2.1, *triangle lookup*).

use dapple_scene::area_lights::Facing;
use dapple_scene::glam::{Mat3, Vec3};
use dapple_scene::{Pose, Scene};
use dapple_store::cones::{BACK, ConeCache, ConeEntry, EntryId, GRAZING_COSINE, TexelPlace, UpdateQueue};
use rayon::prelude::*;

use super::changes::is_still;

/// A place on a surface, this moment and the last.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EntryPlace {
    /// Metres.
    pub position_world: Vec3,
    /// Unit normal of the triangle, on the side that was seen; zero for what is not there.
    pub normal_world: Vec3,
    /// Unit normal that it is shaded with, on the same side: that of the pixel that gave it its place.
    pub normal_shading_world: Vec3,
    /// Where it was.
    pub position_before_world: Vec3,
    /// How its triangle's normal was turned.
    pub normal_before_world: Vec3,
    /// How its shading normal was turned.
    pub normal_shading_before_world: Vec3,
}

impl EntryPlace {
    /// How it faces the light that it keeps: by the shading normal. What that faces away from counts a little as well, as pixels beside have other bumps.
    pub(super) fn facing(&self) -> Facing {
        facing(self.normal_world, self.normal_shading_world)
    }

    /// How it did.
    pub(super) fn facing_before(&self) -> Facing {
        facing(self.normal_before_world, self.normal_shading_before_world)
    }

    /// Whether it is where it was, and turned as it was.
    pub(super) fn is_still(&self) -> bool {
        self.position_before_world == self.position_world && self.facing_before() == self.facing()
    }
}

fn facing(ground_world: Vec3, normal_world: Vec3) -> Facing {
    Facing { normal_world, ground_world, least_cosine: GRAZING_COSINE }
}

/// Places of a frame's queue.
#[derive(Clone, Debug, Default)]
pub struct EntryPlaces {
    places: Vec<EntryPlace>,
    /// Index in the queue of an entry, by its number; `u32::MAX` for those that are not in it.
    of_entry: Vec<u32>,
    /// Frame of the queue.
    frame: u32,
    /// The cache's clock when an instance was last found to have moved.
    moved_at: Vec<u64>,
    /// Whether everything is where it was.
    all_still: bool,
}

impl EntryPlaces {
    /// Of all texels of a queue, in two poses of the scene (the same where there is no last moment).
    pub fn of<E: ConeEntry>(
        cache: &ConeCache<E>,
        queue: &UpdateQueue,
        scene: &Scene,
        before: &Pose,
        now: &Pose,
    ) -> EntryPlaces {
        let mut places = EntryPlaces::default();
        places.follow(cache, queue, scene, before, now);
        places
    }

    /// Turns the places of the frame before, found in the pose `before` of the same scene for the same cache, into what [`EntryPlaces::of`] would
    /// give: what stayed where it was is not looked up again.
    pub fn follow<E: ConeEntry>(
        &mut self,
        cache: &ConeCache<E>,
        queue: &UpdateQueue,
        scene: &Scene,
        before: &Pose,
        now: &Pose,
    ) {
        let still: Vec<bool> = (0..now.instances.len())
            .map(|i| before.instances.get(i).is_some_and(|then| is_still(then, &now.instances[i])))
            .collect();
        self.moved_at.resize(still.len(), 0);
        for (at, still) in self.moved_at.iter_mut().zip(&still) {
            if !still {
                *at = cache.clock();
            }
        }
        let follows = self.frame != 0 && self.frame.wrapping_add(1) == queue.frame();
        self.frame = queue.frame();
        let all_still = !still.contains(&false);
        if follows && queue.is_repeat() && all_still && self.all_still {
            return;
        }
        self.all_still = all_still;
        let stands = |instance: u32| still.get(instance as usize) == Some(&true);
        let place = |texel: &dapple_store::cones::QueuedTexel| {
            let stayed = follows && !texel.is_new && !texel.moved && texel.absent == 0;
            if stayed
                && stands(texel.instance)
                && let Some(index) = self.of_entry.get(texel.id.index())
                && let Some(held) = self.places.get(*index as usize)
            {
                return EntryPlace {
                    position_before_world: held.position_world,
                    normal_before_world: held.normal_world,
                    normal_shading_before_world: held.normal_shading_world,
                    ..*held
                };
            }
            let side =
                if cache.key(texel.id).is_some_and(|key| key.block.chart & BACK != 0) { -1.0 } else { 1.0 };
            let at = |pose| world_place(scene, pose, texel.instance, &texel.place, side);
            let Some([position_world, normal_world, normal_shading_world]) = at(now) else {
                return EntryPlace::default();
            };
            // Between two equal poses nothing is to be found out.
            let then = if stands(texel.instance) { None } else { at(before) };
            let [position_before_world, normal_before_world, normal_shading_before_world] =
                then.unwrap_or([position_world, normal_world, normal_shading_world]);
            EntryPlace {
                position_world,
                normal_world,
                normal_shading_world,
                position_before_world,
                normal_before_world,
                normal_shading_before_world,
            }
        };
        self.places = queue.texels.par_iter().with_min_len(1024).map(place).collect();
        if follows && queue.is_repeat() {
            return;
        }
        let last = queue.texels.iter().map(|t| t.id.index()).max();
        self.of_entry.clear();
        self.of_entry.resize(last.map_or(0, |i| i + 1), u32::MAX);
        for (i, texel) in (0u32..).zip(&queue.texels) {
            self.of_entry[texel.id.index()] = i;
        }
    }

    /// The cache's clock ([`ConeCache::clock`]) when an instance was last found to have moved; 0 if it never did.
    pub fn moved_at(&self, instance: u32) -> u64 {
        self.moved_at.get(instance as usize).copied().unwrap_or(0)
    }

    /// Of the queue's texel with that index, if its instance is there.
    #[inline]
    pub fn get(&self, index: usize) -> Option<&EntryPlace> {
        self.places.get(index).filter(|p| p.normal_world != Vec3::ZERO)
    }

    /// Of an entry that is in the queue.
    #[inline]
    pub fn of_entry(&self, id: EntryId) -> Option<&EntryPlace> {
        self.get(*self.of_entry.get(id.index())? as usize)
    }
}

/// Position, unit normal and unit shading normal of a place on an instance's triangle, seen from its front (`side` 1) or back (−1); `None` if
/// it is not there or has no area.
fn world_place(
    scene: &Scene,
    pose: &Pose,
    instance: u32,
    place: &TexelPlace,
    side: f32,
) -> Option<[Vec3; 3]> {
    let index = instance as usize;
    let posed = pose.instances.get(index).filter(|p| p.is_there())?;
    let mesh = scene.meshes.get(scene.instances.get(index)?.mesh as usize)?;
    let corners = mesh.triangles.get(place.triangle as usize)?;
    let vertices = scene.vertex_positions(pose, index);
    let map = posed.world_from_mesh;
    let mut world = [Vec3::ZERO; 3];
    for (corner, &vertex) in world.iter_mut().zip(corners) {
        *corner = map.transform_point3(*vertices.get(vertex as usize)?);
    }
    let [a, b, c] = world;
    let (e1, e2) = (b - a, c - a);
    let cross = e1.as_dvec3().cross(e2.as_dvec3()).normalize_or_zero().as_vec3();
    let mirror = if Mat3::from(map.matrix3).determinant() < 0.0 { -1.0 } else { 1.0 };
    if cross == Vec3::ZERO {
        return None;
    }
    let ([v, w], [along, across]) = (place.barycentrics, place.lean());
    let normal = cross * (mirror * side);
    let upright = (1.0 - along * along - across * across).max(0.0).sqrt();
    let tangent = e1.normalize_or_zero();
    let shading = tangent * along + cross.cross(tangent) * across + normal * upright;
    Some([a + e1 * v + e2 * w, normal, shading.normalize_or(normal)])
}
