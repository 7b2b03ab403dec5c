//! Where entries of the cache are in the world: what their triangles say ([Stadlbauer2023] sec. 2.1, *triangle lookup*).

use dapple_scene::glam::{Mat3, Vec3};
use dapple_scene::{Pose, Scene};
use dapple_store::cones::{BACK, ConeCache, ConeEntry, EntryId, UpdateQueue};
use rayon::prelude::*;

/// A place on a surface, this moment and the last.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EntryPlace {
    /// Metres.
    pub position_world: Vec3,
    /// Unit normal of the triangle, on the side that was seen; zero for what is not there.
    pub normal_world: Vec3,
    /// Where it was.
    pub position_before_world: Vec3,
    /// How it was turned.
    pub normal_before_world: Vec3,
}

/// Places of a frame's queue.
#[derive(Clone, Debug, Default)]
pub struct EntryPlaces {
    places: Vec<EntryPlace>,
    /// Index in the queue of an entry, by its number; `u32::MAX` for those that are not in it.
    of_entry: Vec<u32>,
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
        let place = |texel: &dapple_store::cones::QueuedTexel| {
            let at = |pose| {
                world_place(scene, pose, texel.instance, texel.place.triangle, texel.place.barycentrics)
            };
            let Some((position_world, normal)) = at(now) else { return EntryPlace::default() };
            let (before_world, normal_before) = at(before).unwrap_or((position_world, normal));
            let side =
                if cache.key(texel.id).is_some_and(|key| key.block.chart & BACK != 0) { -1.0 } else { 1.0 };
            EntryPlace {
                position_world,
                normal_world: normal * side,
                position_before_world: before_world,
                normal_before_world: normal_before * side,
            }
        };
        let places: Vec<EntryPlace> = queue.texels.par_iter().with_min_len(1024).map(place).collect();
        let last = queue.texels.iter().map(|t| t.id.index()).max();
        let mut of_entry = vec![u32::MAX; last.map_or(0, |i| i + 1)];
        for (i, texel) in (0u32..).zip(&queue.texels) {
            of_entry[texel.id.index()] = i;
        }
        EntryPlaces { places, of_entry }
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

/// Position and unit normal of a place on an instance's triangle; `None` if it is not there or has no area.
fn world_place(
    scene: &Scene,
    pose: &Pose,
    instance: u32,
    triangle: u32,
    [v, w]: [f32; 2],
) -> Option<(Vec3, Vec3)> {
    let index = instance as usize;
    let posed = pose.instances.get(index).filter(|p| p.is_there())?;
    let mesh = scene.meshes.get(scene.instances.get(index)?.mesh as usize)?;
    let corners = mesh.triangles.get(triangle as usize)?;
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
    (cross != Vec3::ZERO).then(|| (a + e1 * v + e2 * w, cross * mirror))
}
