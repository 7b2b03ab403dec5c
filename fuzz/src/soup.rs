//! Any bytes as a soup of triangles and rays: however they lie, all queries on all widths agree with each other, and with
//! asking the triangles one by one.

use dapple_scene::glam::{Affine3A, Mat3, Mat3A, Vec3};
use dapple_scene::{Instance, Material, Mesh, Part, Pose, PosedInstance, Scene};
use dapple_trace::{Ray, Tracer, Vectors};

use crate::input::Input;

/// Most triangles of a soup.
const MAX_TRIANGLES: usize = 64;
/// Most rays from one origin; more than one word of a mask.
const MAX_RAYS: usize = 72;

/// Builds a tracer over what `data` says and compares its answers. Nothing may panic.
pub fn triangle_soup(data: &[u8]) {
    let mut input = Input(data);
    let coarse = input.byte();
    let triangles: Vec<[Vec3; 3]> =
        (0..1 + input.below(MAX_TRIANGLES)).map(|_| [0; 3].map(|_| place(&mut input, coarse))).collect();
    let maps: Vec<Affine3A> = (0..1 + input.below(3)).map(|_| map(&mut input, coarse)).collect();

    let (scene, pose) = scene(&triangles, &maps);
    let mut tracer = Tracer::new(&scene, &pose);
    let alone: Vec<Tracer> = triangles
        .iter()
        .map(|triangle| {
            let (scene, pose) = self::scene(&[*triangle], &maps);
            Tracer::new(&scene, &pose)
        })
        .collect();

    let mut hits = Vec::new();
    for _ in 0..1 + input.below(4) {
        let origin = place(&mut input, coarse);
        let t_max = if input.byte() < 64 { f32::INFINITY } else { number(&mut input, coarse).abs() };
        let directions: Vec<Vec3> = (0..input.below(MAX_RAYS))
            .map(|_| match input.byte() % 3 {
                // To a corner or through an edge, where neighbours must agree.
                0 => triangles[input.below(triangles.len())][input.below(3)] - origin,
                1 => {
                    let [a, b, _] = triangles[input.below(triangles.len())];
                    0.5 * (a + b) - origin
                }
                _ => place(&mut input, coarse),
            })
            .collect();
        let mut expected = [0_u64; 4];
        for (i, &direction_world) in directions.iter().enumerate() {
            let ray = Ray { origin_world: origin, direction_world, t_max };
            let closest = tracer.closest_hit(&ray);
            tracer.all_hits(&ray, &mut hits);
            assert_eq!(hits.first().copied(), closest, "{ray:?}");
            assert!(hits.is_sorted_by(|a, b| a.t <= b.t), "{ray:?}: {hits:?}");
            // Of a mesh that is badly skewed a part and the whole may have boxes that differ by more than rounding.
            if maps.iter().all(|map| map.matrix3 == Mat3A::IDENTITY) {
                assert_eq!(alone.iter().any(|one| one.occluded(&ray)), closest.is_some(), "{ray:?}");
            }
            expected[i / 64] |= u64::from(closest.is_some()) << (i % 64);
        }
        for vectors in Vectors::all() {
            tracer.set_vectors(vectors);
            let name = vectors.name();
            assert_eq!(
                tracer.occlusion(origin, &directions, t_max),
                expected,
                "{name}: {origin} {directions:?}"
            );
            for (i, &direction_world) in directions.iter().enumerate() {
                let ray = Ray { origin_world: origin, direction_world, t_max };
                assert_eq!(tracer.occluded(&ray), expected[i / 64] >> (i % 64) & 1 == 1, "{name}: {ray:?}");
            }
        }
    }
}

/// A number: any bits, or one of few, so that corners, edges and planes coincide.
fn number(input: &mut Input<'_>, coarse: u8) -> f32 {
    match coarse % 3 {
        0 => f32::from_le_bytes([input.byte(), input.byte(), input.byte(), input.byte()]),
        1 => f32::from(input.byte() as i8) / 16.0,
        _ => f32::from(input.below(5) as u8) - 2.0,
    }
}

fn place(input: &mut Input<'_>, coarse: u8) -> Vec3 {
    Vec3::new(number(input, coarse), number(input, coarse), number(input, coarse))
}

/// Mostly where the mesh is; else anything.
fn map(input: &mut Input<'_>, coarse: u8) -> Affine3A {
    match input.byte() % 4 {
        0 => {
            let [x, y, z] = [0; 3].map(|_| place(input, coarse));
            Affine3A::from_mat3_translation(Mat3::from_cols(x, y, z), place(input, coarse))
        }
        1 => Affine3A::from_translation(place(input, coarse)),
        _ => Affine3A::IDENTITY,
    }
}

fn scene(triangles: &[[Vec3; 3]], maps: &[Affine3A]) -> (Scene, Pose) {
    let positions: Vec<Vec3> = triangles.iter().flatten().copied().collect();
    let count = triangles.len() as u32;
    let mesh = Mesh {
        normals: vec![Vec3::Y; positions.len()],
        positions,
        triangles: (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        parts: vec![Part { first_triangle: 0, triangle_count: count, material: 0 }],
        ..Mesh::default()
    };
    let instance = |_: &Affine3A| Instance {
        node: 0,
        mesh: 0,
        skin: None,
        casts: true,
        emitter: Default::default(),
        receives: true,
        rest_from_mesh: Mat3::IDENTITY,
        spare: false,
    };
    let scene = Scene {
        meshes: vec![mesh],
        materials: vec![Material::default()],
        instances: maps.iter().map(instance).collect(),
        ..Scene::default()
    };
    let posed = |&world_from_mesh: &Affine3A| PosedInstance { world_from_mesh, deformed: None };
    (scene, Pose { instances: maps.iter().map(posed).collect(), ..Pose::default() })
}
