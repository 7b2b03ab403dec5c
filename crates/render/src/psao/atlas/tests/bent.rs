//! Bent normals in the atlas: as exact as visibility, by the same weights, and carried along by what moves.

use dapple_scene::PosedCamera;
use dapple_store::points::{BentChange, BentNormal, BentPlanes, PointStore};

use super::*;
use crate::gbuffer::rasterize;

fn planes(layout: &PointLayout, byte: impl Fn(u32) -> [u8; 2]) -> BentPlanes {
    let all: Vec<[u8; 2]> = (0..layout.len() as u32).map(byte).collect();
    [0, 1].map(|k| all.iter().map(|bytes| bytes[k]).collect())
}

/// The bent normal of every triangle of an instance at its middle.
fn middles(scene: &Scene, atlas: &VisibilityAtlas, instance: u32) -> Vec<Option<Vec3>> {
    let mesh = &scene.meshes[scene.instances[instance as usize].mesh as usize];
    (0..mesh.triangles.len() as u32)
        .map(|triangle| atlas.bent_normal(instance, triangle, [0.3, 0.3], false))
        .collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    #[test]
    fn changes_lead_to_what_a_fresh_atlas_has(seed: u32, rounds in prop::collection::vec(0usize..200, 1..5)) {
        let scene = stage();
        let layout = lay(&scene, 0.1);
        let random = |i: u32| noise(i, seed).to_le_bytes();
        let bent = planes(&layout, |i| [random(i)[0], random(i)[1]]);
        let visibility = vec![9; layout.len()];
        let mut store = PointStore::new(layout.clone(), visibility.clone()).unwrap().with_bent(bent).unwrap();
        let mut atlas = complete(&scene, &layout, &visibility);
        atlas.resolve_bent(store.bent().unwrap());
        for (round, count) in rounds.into_iter().enumerate() {
            for k in 0..count {
                let random = noise(k as u32, seed ^ round as u32);
                let point = random % layout.len() as u32;
                let old = store.bent_of(point as usize).unwrap();
                let change = BentChange { point, old, new: BentNormal([random as u8, (random >> 24) as u8]) };
                store.apply_bent(&[change]).unwrap();
                atlas.apply_bent(&[change]);
            }
        }
        let mut fresh = complete(&scene, &layout, &visibility);
        fresh.resolve_bent(store.bent().unwrap());
        for instance in 0..4 {
            prop_assert_eq!(middles(&scene, &atlas, instance), middles(&scene, &fresh, instance));
        }
    }
}

#[test]
fn what_is_unbent_shows_the_normal_and_nothing_shows_before_it_is_taken_in() {
    let scene = stage();
    let layout = lay(&scene, 0.1);
    let mut atlas = complete(&scene, &layout, &vec![9; layout.len()]);
    let memory = atlas.memory_bytes();
    assert!((0..4).all(|instance| middles(&scene, &atlas, instance).iter().all(Option::is_none)));
    atlas.resolve_bent(&planes(&layout, |_| [128; 2]));
    let more = atlas.memory_bytes() - memory;
    assert!(more > 0 && more.is_multiple_of(6) && more <= 6 * atlas.texel_count() as u64, "{more} bytes");
    for (instance, degrees) in [(0, 1.5f32), (1, 1.5)] {
        let positions = rest_positions(&scene, instance as usize);
        let mesh = &scene.meshes[scene.instances[instance as usize].mesh as usize];
        for (triangle, bent) in mesh.triangles.iter().zip(middles(&scene, &atlas, instance)) {
            let [a, b, c] = triangle.map(|v| positions[v as usize]);
            let off = (b - a).cross(c - a).angle_between(bent.unwrap()).to_degrees();
            assert!(off < degrees, "{off}° off the normal");
        }
    }
}

/// A camera that turns with a body sees the same bent normals relative to itself.
#[test]
fn bent_normals_turn_with_the_body() {
    let mut stage = Stage::new();
    stage.add(ground(1.0), 0, Affine3A::IDENTITY);
    let layout = lay(&stage.scene, 0.2);
    let mut atlas = complete(&stage.scene, &layout, &vec![9; layout.len()]);
    // Towards +x: whatever the tangents are, this is what is packed.
    let towards = Vec3::new(0.6, 0.8, 0.0);
    let normals: Vec<PackedNormal> = layout.sets()[0].normals.clone();
    let bent = planes(&layout, |i| BentNormal::pack(towards, normals[i as usize]).0);
    atlas.resolve_bent(&bent);
    let mut look = |world_from_mesh: Affine3A, expected: Vec3| {
        stage.pose.instances[0].world_from_mesh = world_from_mesh;
        let eye = world_from_mesh.transform_point3(Vec3::new(0.2, 3.0, 0.3));
        let target = world_from_mesh.transform_point3(Vec3::ZERO);
        let camera = PosedCamera::look_at(eye, target, 0.4);
        let gbuffer = rasterize(&stage.scene, &stage.pose, &camera, 16, 16, 1).unwrap();
        let bent = atlas.reconstruct_bent(&stage.scene, &stage.pose, &gbuffer);
        let found: Vec<Vec3> = bent.into_iter().filter(|bent| *bent != Vec3::ZERO).collect();
        assert!(found.len() > 100);
        assert!(found.iter().all(|bent| bent.distance(expected) < 0.02), "{} for {expected}", found[0]);
    };
    look(Affine3A::IDENTITY, towards);
    let turn = turned(1.2, Vec3::new(3.0, 1.0, 2.0));
    look(turn, turn.transform_vector3(towards));
    // A mirror shows it the other way round.
    look(Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0)), Vec3::new(-0.6, 0.8, 0.0));
}
