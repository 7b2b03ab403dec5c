//! The tracer against leaks, holes, flaws and large numbers.

use dapple_scene::glam::{Affine2, Affine3A, Mat3, Quat, Vec2, Vec3, Vec4};
use dapple_scene::{AlphaMode, Filter, Image, Mesh, Pose, Scene, Texture, TextureRef, Wrap};

use super::triangle::{MeshRay, Triangle, intersect};
use super::{BackFaces, Ray, Tracer, Vectors, count_blocked, offset_origin};
use crate::test_support::{Random, cube, deform, joined, mesh, quad, scene, scene_of, soup, sphere};

#[test]
fn closed_sphere_does_not_leak() {
    // Rays from inside through every vertex and along every edge; origins on and off the axes of symmetry.
    for (center, radius) in [(Vec3::ZERO, 1.0), (Vec3::new(3.1, -7.7, 12.9), 0.37), (Vec3::splat(900.0), 5.0)]
    {
        let m = sphere(center, radius, 24, 36);
        let (scene, pose) = scene_of(m.clone());
        let tracer = Tracer::new(&scene, &pose);
        for origin in [
            center,
            center + radius * Vec3::new(0.3, 0.0, 0.0),
            center + radius * Vec3::new(0.31, -0.2, 0.43),
        ] {
            let mut directions = Vec::new();
            for t in &m.triangles {
                let [a, b, c] = t.map(|i| m.positions[i as usize] - origin);
                directions.extend([
                    a,
                    0.5 * (a + b),
                    0.3 * b + 0.7 * c,
                    0.9 * c + 0.1 * a,
                    (a + b + c) / 3.0,
                ]);
            }
            for chunk in directions.chunks(256) {
                // Not normalized first, so that the ray goes exactly through the vertex; then unit ones.
                for d in chunk {
                    let ray = Ray { origin_world: origin, direction_world: *d, t_max: f32::INFINITY };
                    assert!(tracer.occluded(&ray), "{d} from {origin} escapes");
                    assert!(
                        tracer.closest_hit(&ray).is_some_and(|h| h.back_face && (0.5..2.0).contains(&h.t))
                    );
                }
                let unit: Vec<Vec3> = chunk.iter().map(|d| d.normalize()).collect();
                assert_eq!(
                    count_blocked(&tracer.occlusion(origin, &unit, 10.0 * radius)) as usize,
                    unit.len()
                );
            }
        }
    }
}

#[test]
fn single_triangles_are_exact_at_their_edges() {
    // Two triangles share an edge through the rays: each ray meets at least one of them.
    let mut random = Random(5);
    for _ in 0..20_000 {
        let [a, b] = [0, 1].map(|_| random.vector());
        let (c, d) = (random.vector(), random.vector());
        let on_edge = a + (b - a) * random.next();
        let origin = 3.0 * random.direction();
        // c and d on opposite sides of the edge as seen from the origin.
        let normal = (on_edge - origin).cross(b - a);
        if normal.dot(c - a) * normal.dot(d - a) > -0.01 {
            continue;
        }
        let ray = MeshRay::new(origin, on_edge - origin, f32::INFINITY).unwrap();
        let hit = [[a, b, c], [b, a, d]].map(|t| {
            let corners = t.map(|p| p.to_array());
            intersect(&ray, &Triangle { corners }).is_some()
        });
        assert!(hit[0] || hit[1]);
    }
}

#[test]
fn t_max_and_faces() {
    // Counter-clockwise seen from above.
    let floor = quad(
        Vec3::new(-1.0, 0.0, 1.0),
        Vec3::new(1.0, 0.0, 1.0),
        Vec3::new(1.0, 0.0, -1.0),
        Vec3::new(-1.0, 0.0, -1.0),
    );
    let mirror = Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0));
    for map in [Affine3A::IDENTITY, mirror] {
        let (scene, pose) = scene(vec![floor.clone()], &[(0, map)]);
        let tracer = Tracer::new(&scene, &pose);
        for (y, back_face) in [(2.0, false), (-2.0, true)] {
            let ray = |t_max| Ray {
                origin_world: Vec3::new(0.2, y, 0.1),
                direction_world: Vec3::new(0.0, -y, 0.0).normalize(),
                t_max,
            };
            let hit = tracer.closest_hit(&ray(2.0)).unwrap();
            assert_eq!((hit.t, hit.back_face, hit.instance), (2.0, back_face, 0));
            assert!(tracer.occluded(&ray(2.0)));
            assert!(!tracer.occluded(&ray(1.999)));
            assert!(tracer.closest_hit(&ray(1.999)).is_none());
            for t_max in [0.0, -1.0, f32::NAN] {
                assert!(!tracer.occluded(&ray(t_max)));
                assert!(tracer.closest_hit(&ray(t_max)).is_none());
                assert_eq!(tracer.occlusion(ray(1.0).origin_world, &[Vec3::Y, Vec3::NEG_Y], t_max), [0; 4]);
            }
        }
    }
}

#[test]
fn a_surface_does_not_block_its_own_rays() {
    // A rotated, stretched ball at the origin, and 1 km from it: convex, so that every ray leaves.
    let m = sphere(Vec3::ZERO, 1.0, 20, 30);
    for (translation, scale) in
        [(Vec3::ZERO, 1.0), (Vec3::new(1000.0, 300.0, -800.0), 1.0), (Vec3::splat(50.0), 20.0)]
    {
        let map = Affine3A::from_scale_rotation_translation(
            Vec3::new(1.0, 0.6, 1.4) * scale,
            Quat::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), 1.1),
            translation,
        );
        let (scene, pose) = scene(vec![m.clone()], &[(0, map)]);
        let tracer = Tracer::new(&scene, &pose);
        let mut random = Random(9);
        for t in &m.triangles {
            let [a, b, c] = t.map(|i| map.transform_point3(m.positions[i as usize]));
            let n = (Mat3::from(map.matrix3).inverse().transpose() * {
                let [a, b, c] = t.map(|i| m.positions[i as usize]);
                (b - a).cross(c - a)
            })
            .normalize();
            let (u, v) = (random.next(), random.next());
            let p = a + (b - a) * (u * (1.0 - v)) + (c - a) * (u * v);
            let directions: Vec<Vec3> = (0..64)
                .map(|_| {
                    let d = random.direction();
                    if d.dot(n) < 0.0 { -d } else { d }
                })
                .collect();
            assert_eq!(tracer.occlusion(offset_origin(p, n), &directions, f32::INFINITY), [0; 4]);
            // And from below nothing gets out: the lift is no hole.
            let inside: Vec<Vec3> = directions.iter().map(|d| -*d).collect();
            let blocked = tracer.occlusion(offset_origin(p, -n), &inside, f32::INFINITY);
            assert_eq!(count_blocked(&blocked), 64);
        }
    }
}

#[test]
fn distance_from_the_origin_costs_no_digits() {
    // 1 km away, where steps of 2^-10 m are exact, hits are to the bit those at the origin.
    let m = sphere(Vec3::ZERO, 1.0, 20, 30);
    let rotation = Quat::from_axis_angle(Vec3::new(0.6, 0.0, 0.8), 1.1);
    let far = Vec3::new(1000.0, 300.0, -800.0);
    let tracer_at = |translation| {
        let map = Affine3A::from_scale_rotation_translation(Vec3::new(-1.0, 0.6, 1.4), rotation, translation);
        let (scene, pose) = scene(vec![m.clone()], &[(0, map)]);
        Tracer::new(&scene, &pose)
    };
    let (here, there) = (tracer_at(Vec3::ZERO), tracer_at(far));
    let mut random = Random(2);
    for _ in 0..500 {
        let origin = (0.3 * random.vector() * 1024.0).floor() / 1024.0;
        let ray = Ray { origin_world: origin, direction_world: random.direction(), t_max: 5.0 };
        let hit = here.closest_hit(&ray);
        assert!(hit.is_some());
        assert_eq!(hit, there.closest_hit(&Ray { origin_world: far + origin, ..ray }));
    }
}

#[test]
fn nothing_to_hit() {
    let directions = [Vec3::X, Vec3::Y, Vec3::ZERO, Vec3::NAN];
    let flat = Affine3A::from_scale(Vec3::new(1.0, 0.0, 1.0));
    let nan = Affine3A::from_translation(Vec3::NAN);
    let broken = mesh(vec![Vec3::ZERO, Vec3::NAN, Vec3::X], vec![[0, 1, 2], [0, 1, 9]]);
    for (scene, pose) in [
        (Scene::default(), Pose::default()),
        scene_of(Mesh::default()),
        scene(vec![cube()], &[]),
        scene(vec![cube()], &[(0, flat), (0, nan)]),
        scene(vec![cube()], &[(7, Affine3A::IDENTITY)]),
        scene_of(broken),
    ] {
        let mut tracer = Tracer::new(&scene, &pose);
        for _ in 0..2 {
            for d in directions {
                let ray = Ray { origin_world: Vec3::splat(0.5), direction_world: d, t_max: f32::INFINITY };
                assert!(!tracer.occluded(&ray));
                assert!(tracer.closest_hit(&ray).is_none());
            }
            assert_eq!(tracer.occlusion(Vec3::splat(0.5), &directions, f32::INFINITY), [0; 4]);
            assert_eq!(tracer.occlusion(Vec3::splat(0.5), &[], 1.0), [0; 4]);
            tracer.update(&scene, &pose);
        }
    }
    // The same query does hit what is there, and directions that are none are not blocked.
    let (scene, pose) = scene_of(cube());
    let tracer = Tracer::new(&scene, &pose);
    assert_eq!(tracer.occlusion(Vec3::splat(0.4), &directions, f32::INFINITY), [0b11, 0, 0, 0]);
    assert_eq!(tracer.occlusion(Vec3::NAN, &directions, f32::INFINITY), [0; 4]);
    let many = vec![Vec3::X; 300];
    assert_eq!(tracer.occlusion(Vec3::splat(0.4), &many, 2.0), [u64::MAX; 4]);
}

#[test]
fn holes_let_rays_through() {
    let mut floor = quad(
        Vec3::new(0.0, 0.0, 1.0),
        Vec3::new(1.0, 0.0, 1.0),
        Vec3::new(1.0, 0.0, 0.0),
        Vec3::new(0.0, 0.0, 0.0),
    );
    floor.uvs[1] = vec![Vec2::new(0.0, 1.0), Vec2::new(1.0, 1.0), Vec2::new(1.0, 0.0), Vec2::new(0.0, 0.0)];
    let (mut scene, pose) = scene_of(floor);
    // Alpha 255 and 100 left and right.
    scene.images =
        vec![Image { name: String::new(), width: 2, height: 1, rgba8: vec![[0, 0, 0, 255], [0, 0, 0, 100]] }];
    scene.textures =
        vec![Texture { image: 0, wrap_u: Wrap::Repeat, wrap_v: Wrap::Repeat, filter: Filter::Nearest }];
    let blocked = |scene: &Scene| {
        let tracer = Tracer::new(scene, &pose);
        [0.25, 0.75].map(|x| {
            let origin_world = Vec3::new(x, 1.0, 0.4);
            let ray = Ray { origin_world, direction_world: Vec3::NEG_Y, t_max: 2.0 };
            let hit = tracer.occluded(&ray);
            assert_eq!(tracer.closest_hit(&ray).is_some(), hit);
            assert_eq!(
                tracer.occlusion(origin_world, &[Vec3::NEG_Y; 64], 2.0)[0],
                if hit { u64::MAX } else { 0 }
            );
            hit
        })
    };
    let texture = TextureRef { texture: 0, uv_set: 1, image_from_uv: Affine2::IDENTITY };
    let material = |f: &dyn Fn(&mut dapple_scene::Material)| {
        let mut s = scene.clone();
        s.materials[0].base_color_texture = Some(texture);
        f(&mut s.materials[0]);
        s
    };
    assert_eq!(blocked(&material(&|_| ())), [true, true], "opaque ignores alpha");
    assert_eq!(blocked(&material(&|m| m.alpha_mode = AlphaMode::Blend)), [true, false]);
    assert_eq!(blocked(&material(&|m| m.alpha_mode = AlphaMode::Mask { cutoff: 0.3 })), [true, true]);
    let masked = material(&|m| {
        m.alpha_mode = AlphaMode::Mask { cutoff: 0.5 };
        m.base_color_texture.as_mut().unwrap().image_from_uv = Affine2::from_translation(Vec2::new(0.5, 0.0));
    });
    assert_eq!(blocked(&masked), [false, true], "image_from_uv");
    let faded = material(&|m| {
        m.alpha_mode = AlphaMode::Blend;
        m.base_color_factor.w = 0.4;
    });
    assert_eq!(blocked(&faded), [false, false], "factor");
    let mut plain = faded.clone();
    plain.materials[0].base_color_texture = None;
    assert_eq!(blocked(&plain), [false, false], "no texture");
    plain.materials[0].base_color_factor.w = 0.5;
    assert_eq!(blocked(&plain), [true, true], "at the cutoff");
    let mut colored = plain.clone();
    colored.materials[0].base_color_factor.w = 1.0;
    colored.meshes[0].colors = [0.0, 1.0, 1.0, 0.0].map(|a| Vec4::new(1.0, 1.0, 1.0, a)).to_vec();
    assert_eq!(blocked(&colored), [false, true], "vertex colour");
    let mut far = material(&|m| m.alpha_mode = AlphaMode::Blend);
    for uv in &mut far.meshes[0].uvs[1] {
        *uv *= f32::MAX;
    }
    assert_eq!(blocked(&far), [true, true], "coordinates too large to look up are solid");
    let mut torn = material(&|m| m.alpha_mode = AlphaMode::Blend);
    torn.images[0].rgba8.clear();
    assert_eq!(blocked(&torn), [true, true], "an image without its texels is none");
}

#[test]
fn casts_false_is_not_hit_and_may_change_form() {
    let (mut scene, mut pose) =
        scene(vec![cube()], &[(0, Affine3A::IDENTITY), (0, Affine3A::from_translation(Vec3::X * 5.0))]);
    let ray = Ray { origin_world: Vec3::new(-1.0, 0.4, 0.3), direction_world: Vec3::X, t_max: f32::INFINITY };
    let mut tracer = Tracer::new(&scene, &pose);
    assert_eq!(tracer.closest_hit(&ray).map(|h| (h.instance, h.t)), Some((0, 1.0)));
    scene.instances[0].casts = false;
    tracer.update(&scene, &pose);
    assert_eq!(tracer.closest_hit(&ray).map(|h| (h.instance, h.t)), Some((1, 6.0)));
    // Rigid, then deformed, then rigid again.
    deform(&mut pose, 1, scene.meshes[0].positions.iter().map(|p| *p + Vec3::X).collect());
    tracer.update(&scene, &pose);
    assert_eq!(tracer.closest_hit(&ray).map(|h| (h.instance, h.t)), Some((1, 7.0)));
    pose.instances[1].deformed = None;
    tracer.update(&scene, &pose);
    assert_eq!(tracer.closest_hit(&ray).map(|h| h.t), Some(6.0));
}

#[test]
fn equal_distances_go_to_the_lowest_instance_and_triangle() {
    let two = joined([cube(), cube()]);
    let (scene, pose) = scene(
        vec![cube(), two],
        &[(1, Affine3A::IDENTITY), (0, Affine3A::IDENTITY), (1, Affine3A::IDENTITY)],
    );
    let tracer = Tracer::new(&scene, &pose);
    let mut random = Random(1);
    for _ in 0..500 {
        let direction_world = random.direction();
        let hit = tracer
            .closest_hit(&Ray { origin_world: Vec3::splat(0.45), direction_world, t_max: 9.0 })
            .unwrap();
        assert!(hit.instance == 0 && hit.triangle < 12, "{hit:?}");
    }
}

#[test]
fn trees_do_not_depend_on_threads() {
    let mut random = Random(3);
    let m = soup(&mut random, 90_000, 0.02);
    let (scene, pose) = scene_of(m);
    let hits = [1, 2, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let tracer = pool.install(|| Tracer::new(&scene, &pose));
        tracer.leaf_orders()
    });
    assert!(hits[0] == hits[1] && hits[1] == hits[2]);
    assert_eq!(hits[0][0].len(), 90_000);
}

#[test]
fn spiteful_spacing_stays_shallow() {
    // Each triangle a tenth the size of the last: the heuristic alone would peel off one at a time.
    let mut positions = Vec::new();
    for i in 0..3000 {
        let s = libm::exp2f(126.0 - 0.08 * i as f32);
        positions.extend([Vec3::new(s, 0.0, 0.0), Vec3::new(s, 0.1 * s, 0.0), Vec3::new(s, 0.0, 0.1 * s)]);
    }
    let triangles = (0..3000).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let (scene, pose) = scene_of(mesh(positions, triangles));
    let tracer = Tracer::new(&scene, &pose);
    assert_eq!(tracer.leaf_orders()[0].len(), 3000);
    let ray =
        Ray { origin_world: Vec3::new(3.0, 0.01, 0.01), direction_world: Vec3::X, t_max: f32::INFINITY };
    assert!(tracer.occluded(&ray));
}

#[test]
fn all_widths_give_the_same_answers() {
    let widths = Vectors::all();
    let names: Vec<String> = widths.iter().map(Vectors::name).collect();
    println!("widths compared: {}", names.join(", "));
    // Wherever this is built there is more than one, but for the plainest of machines.
    assert!(!names.is_empty() && names.iter().all(|name| !name.is_empty()), "{names:?}");
    let mut random = Random(17);
    // Dense, with many near misses: a fan around one corner, a soup, and both far from the origin and huge.
    for (offset, size) in [(0.0, 1.0), (1000.0, 1.0), (0.0, 1e12), (0.0, 1e-15)] {
        let meshes = vec![soup(&mut random, 400, 0.3), sphere(Vec3::ZERO, 0.8, 12, 16)];
        let place = |shift: Vec3| {
            Affine3A::from_scale_rotation_translation(
                Vec3::splat(size),
                Quat::from_rotation_y(shift.x),
                (shift + offset) * size,
            )
        };
        let (scene, pose) = scene(meshes, &[(0, place(Vec3::ZERO)), (1, place(Vec3::splat(0.5)))]);
        let tracer = Tracer::new(&scene, &pose);
        let tracers: Vec<Tracer> = widths
            .iter()
            .map(|&width| {
                let mut tracer = tracer.clone();
                tracer.set_vectors(width);
                tracer
            })
            .collect();
        for _ in 0..60 {
            let origin = (random.vector() + offset) * size;
            let mut directions: Vec<Vec3> = (0..150).map(|_| random.direction()).collect();
            // Through corners and along edges.
            let corners = &scene.meshes[1].positions;
            directions.extend((0..100).map(|i| {
                let corner = place(Vec3::splat(0.5)).transform_point3(corners[i % corners.len()]);
                (corner - origin).normalize_or(Vec3::X)
            }));
            let t_max = size * (0.1 + 3.0 * random.next());
            let answer = tracers[0].occlusion(origin, &directions, t_max);
            for (tracer, name) in tracers.iter().zip(&names) {
                assert_eq!(tracer.occlusion(origin, &directions, t_max), answer, "{name}");
            }
            for (i, &direction_world) in directions.iter().enumerate() {
                let ray = Ray { origin_world: origin, direction_world, t_max };
                let hit = tracers[0].closest_hit(&ray);
                assert_eq!(hit.is_some(), answer[i / 64] >> (i % 64) & 1 == 1);
                for (tracer, name) in tracers.iter().zip(&names) {
                    assert_eq!(tracer.closest_hit(&ray), hit, "{name}");
                    assert_eq!(tracer.occluded(&ray), hit.is_some(), "{name}");
                }
            }
        }
    }
}

#[test]
fn bundles_and_single_rays_agree_at_any_scale() {
    let mut random = Random(23);
    // Sizes of the mesh and of the instance: products overflow or vanish in some, in others only some of the way.
    for (size, scale) in
        [(1.0, 1e17), (1.0, 1e-17), (1e10, 1e8), (1e12, 100.0), (1e17, 1e-5), (1e-15, 1e-10), (1e-17, 1e17)]
    {
        let mut m = soup(&mut random, 80, 0.6);
        for p in &mut m.positions {
            *p *= size;
        }
        let map = Affine3A::from_scale(Vec3::splat(scale));
        let (scene, pose) = scene(vec![m], &[(0, map)]);
        let mut tracer = Tracer::new(&scene, &pose);
        let mut blocked = 0;
        for i in 0..30 {
            let mut origin = random.vector() * (size * scale);
            if i % 3 == 0 {
                // In the plane of a triangle.
                let [a, b, c] = scene.meshes[0].triangles[i].map(|k| scene.meshes[0].positions[k as usize]);
                origin = map.transform_point3(2.0 * b - 0.7 * a - 0.3 * c);
            }
            let directions: Vec<Vec3> = (0..64).map(|_| random.direction()).collect();
            for t_max in [f32::INFINITY, size * scale] {
                for vectors in Vectors::all() {
                    tracer.set_vectors(vectors);
                    let mask = tracer.occlusion(origin, &directions, t_max)[0];
                    for (i, &direction_world) in directions.iter().enumerate() {
                        let ray = Ray { origin_world: origin, direction_world, t_max };
                        let bit = mask >> i & 1 == 1;
                        assert_eq!(bit, tracer.occluded(&ray), "{size} {scale} {ray:?}");
                        assert_eq!(bit, tracer.closest_hit(&ray).is_some(), "{size} {scale} {ray:?}");
                    }
                    blocked += mask.count_ones();
                }
            }
        }
        assert!(blocked > 100, "{size} {scale}: {blocked}");
    }
}

#[test]
fn all_hits_come_in_order() {
    let walls = (0..5).map(|i| {
        let z = 1.0 + i as f32;
        quad(
            Vec3::new(-9.0, -9.0, z),
            Vec3::new(9.0, -9.0, z),
            Vec3::new(9.0, 9.0, z),
            Vec3::new(-9.0, 9.0, z),
        )
    });
    let (scene, pose) = scene(
        vec![joined(walls), cube()],
        &[(0, Affine3A::IDENTITY), (1, Affine3A::from_translation(Vec3::new(-0.5, -0.3, 2.2)))],
    );
    let tracer = Tracer::new(&scene, &pose);
    let ray = Ray { origin_world: Vec3::new(0.1, 0.2, 0.0), direction_world: Vec3::Z, t_max: 4.5 };
    let mut hits = vec![tracer.closest_hit(&ray).unwrap(); 3];
    tracer.all_hits(&ray, &mut hits);
    let found: Vec<(u32, f32)> = hits.iter().map(|h| (h.instance, h.t)).collect();
    assert_eq!(found, [(0, 1.0), (0, 2.0), (1, 2.2), (0, 3.0), (1, 3.2), (0, 4.0)]);
    assert_eq!(hits[0], tracer.closest_hit(&ray).unwrap());
    tracer.all_hits(&Ray { t_max: 0.5, ..ray }, &mut hits);
    assert!(hits.is_empty());
}

#[test]
fn backs_of_single_sided_triangles_may_let_rays_through() {
    let map = Affine3A::from_scale_rotation_translation(
        Vec3::new(-1.0, 1.0, 1.0),
        Quat::IDENTITY,
        Vec3::new(3.0, 0.0, 0.0),
    );
    let (mut scene, pose) = scene(vec![cube()], &[(0, Affine3A::IDENTITY), (0, map)]);
    let ask = |scene: &Scene, back_faces: BackFaces, origin_world: Vec3| {
        let tracer = Tracer::with_back_faces(scene, &pose, back_faces);
        let ray = Ray { origin_world, direction_world: Vec3::Y, t_max: 5.0 };
        let blocked = tracer.occluded(&ray);
        let mask = tracer.occlusion(origin_world, &[Vec3::Y; 70], 5.0);
        assert_eq!(count_blocked(&mask), if blocked { 70 } else { 0 });
        assert_eq!(tracer.closest_hit(&ray).is_some(), blocked);
        blocked
    };
    // From inside and from below, also of the mirrored one.
    for (x, z) in [(0.4, 0.3), (2.4, 0.3)] {
        let (inside, below) = (Vec3::new(x, 0.5, z), Vec3::new(x, -0.5, z));
        scene.materials[0].double_sided = false;
        assert!(ask(&scene, BackFaces::Block, inside) && ask(&scene, BackFaces::Block, below));
        assert!(!ask(&scene, BackFaces::PassSingleSided, inside));
        assert!(ask(&scene, BackFaces::PassSingleSided, below));
        scene.materials[0].double_sided = true;
        assert!(ask(&scene, BackFaces::PassSingleSided, inside));
    }
}
