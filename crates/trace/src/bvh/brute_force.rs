//! The tracer against a loop over all triangles, on random soups of them.

use dapple_scene::glam::{Affine3A, Quat, Vec3};
use dapple_scene::{Pose, Scene};
use proptest::prelude::*;

use super::{Hit, Ray, Tracer};
use crate::test_support::{Random, deform, scene, soup};

/// Where [`Tracer::closest_hit`] should be: a loop over everything, in world space, in `f64`, by another formula
/// (Cramer's rule). The second value is how far (in barycentrics, or relative t) the nearest decision was from
/// tipping: only rays with a clear answer are compared.
fn brute_force(scene: &Scene, pose: &Pose, ray: &Ray) -> (Option<Hit>, f64) {
    type V = [f64; 3];
    let v = |a: Vec3| -> V { a.to_array().map(f64::from) };
    let sub = |a: V, b: V| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    let cross =
        |a: V, b: V| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let dot = |a: V, b: V| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let (mut best, mut best_t, mut margin) = (None, f64::INFINITY, 1.0_f64);
    for (i, instance) in scene.instances.iter().enumerate().filter(|(_, i)| i.casts) {
        let (m, posed) = (&scene.meshes[instance.mesh as usize], &pose.instances[i]);
        let positions = posed.deformed.as_ref().map_or(&m.positions, |d| &d.positions);
        let map = &posed.world_from_mesh;
        let (x, y, z) =
            (v(map.matrix3.x_axis.into()), v(map.matrix3.y_axis.into()), v(map.matrix3.z_axis.into()));
        let (mirrored, offset) = (dot(x, cross(y, z)) < 0.0, v(map.translation.into()));
        let world = |p: Vec3| {
            let p = v(p);
            [0, 1, 2].map(|k| x[k] * p[0] + y[k] * p[1] + z[k] * p[2] + offset[k])
        };
        for (j, t) in m.triangles.iter().enumerate() {
            let [a, b, c] = t.map(|k| world(positions[k as usize]));
            let (e1, e2, d) = (sub(b, a), sub(c, a), v(ray.direction_world));
            let p = cross(d, e2);
            let det = dot(e1, p);
            let s = sub(v(ray.origin_world), a);
            let q = cross(s, e1);
            let (wb, wc, t) = (dot(s, p) / det, dot(d, q) / det, dot(e2, q) / det);
            if !t.is_finite() {
                continue;
            }
            let wa = 1.0 - wb - wc;
            let inside = wa.min(wb).min(wc);
            let sine = det.abs() / (dot(e1, e1) * dot(e2, e2)).sqrt();
            let t_max = f64::from(ray.t_max);
            let relative = (t - t_max).abs() / t_max.min(1e9);
            // A decision counts if the others do not settle the matter anyway.
            if t > -1e-4 && t < best_t.min(t_max) * 1.001 + 1e-3 && inside > -1e-3 {
                margin = margin
                    .min(inside.abs().min(relative).min(t.abs()).min((t - best_t).abs()) * sine.min(1.0));
            }
            if inside >= 0.0 && t > 0.0 && t <= t_max && t < best_t {
                best_t = t;
                best = Some(Hit {
                    t: t as f32,
                    instance: i as u32,
                    triangle: j as u32,
                    barycentrics: Vec3::new(wa as f32, wb as f32, wc as f32),
                    // det > 0: against the normal of the transformed corners, which mirroring turns over.
                    back_face: (det < 0.0) != mirrored,
                });
            }
        }
    }
    (best, margin)
}

fn placement(random: &mut Random, scale: f32) -> Affine3A {
    let rotation = Quat::from_axis_angle(random.direction(), 6.0 * random.next());
    let mut s = Vec3::splat(scale) * (0.4 + Vec3::new(random.next(), random.next(), random.next()));
    if random.next() < 0.5 {
        s.x = -s.x;
    }
    Affine3A::from_scale_rotation_translation(s, rotation, 1.5 * random.vector())
}

/// Compares all queries with each other and with the loop; returns how many rays were clear enough to compare.
fn check(tracer: &Tracer, scene: &Scene, pose: &Pose, random: &mut Random, points: u32) -> u32 {
    let mut compared = 0;
    for _ in 0..points {
        let origin = 2.0 * random.vector();
        let t_max = if random.next() < 0.3 { f32::INFINITY } else { 0.1 + 3.0 * random.next() };
        let directions: Vec<Vec3> =
            (0..1 + (150.0 * random.next()) as u32).map(|_| random.direction()).collect();
        let blocked = tracer.occlusion(origin, &directions, t_max);
        for (i, &direction_world) in directions.iter().enumerate() {
            let ray = Ray { origin_world: origin, direction_world, t_max };
            let bit = blocked[i / 64] >> (i % 64) & 1 != 0;
            assert_eq!(bit, tracer.occluded(&ray), "direction {i} of {origin}, t_max {t_max}");
            let hit = tracer.closest_hit(&ray);
            assert_eq!(bit, hit.is_some());
            let (expected, margin) = brute_force(scene, pose, &ray);
            if margin < 1e-5 {
                continue;
            }
            compared += 1;
            match (hit, expected) {
                (None, None) => {}
                (Some(h), Some(e)) => {
                    let same_corners = {
                        let m = &scene.meshes[scene.instances[e.instance as usize].mesh as usize];
                        m.triangles[h.triangle as usize] == m.triangles[e.triangle as usize]
                    };
                    assert!(h.instance == e.instance && same_corners, "{h:?} {e:?} {margin}");
                    assert!((h.t - e.t).abs() <= 1e-4 * (1.0 + e.t), "{h:?} {e:?} {margin}");
                    assert!(h.barycentrics.abs_diff_eq(e.barycentrics, 0.02), "{h:?} {e:?} {margin}");
                    assert_eq!(h.back_face, e.back_face);
                }
                _ => panic!("{hit:?} instead of {expected:?}, margin {margin}, {ray:?}"),
            }
        }
    }
    compared
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(24) })]

    #[test]
    fn agrees_with_brute_force(seed in any::<u32>(), triangles in 1_usize..120, instances in 1_usize..14) {
        let mut random = Random(seed >> 1);
        let meshes = vec![soup(&mut random, triangles, 0.5), soup(&mut random, 7, 1.0)];
        let placed: Vec<_> = (0..instances).map(|i| (i as u32 % 2, placement(&mut random, 1.0))).collect();
        let (mut scene, mut pose) = scene(meshes, &placed);
        if instances > 2 {
            scene.instances[1].casts = false;
            let moved = scene.meshes[0].positions.iter().map(|p| *p * 1.2).collect();
            deform(&mut pose, 2, moved);
        }
        let mut tracer = Tracer::new(&scene, &pose);
        let compared = check(&tracer, &scene, &pose, &mut random, 8);
        prop_assert!(compared > 0);

        // Instances move; the deformed one's vertices too, by little (refit) and by much (rebuild).
        for shift in [0.1, 3.0] {
            for instance in &mut pose.instances {
                instance.world_from_mesh = placement(&mut random, 1.0);
            }
            if instances > 2 {
                let m = &scene.meshes[0];
                let moved = m.positions.iter().map(|p| *p + shift * random.vector()).collect();
                deform(&mut pose, 2, moved);
            }
            tracer.update(&scene, &pose);
            check(&tracer, &scene, &pose, &mut random, 4);
        }
    }

    #[test]
    fn any_numbers_are_survived(
        seed in any::<u32>(),
        exponent in -44_i32..39,
        scale_exponent in -44_i32..39,
        flat in any::<bool>(),
    ) {
        let mut random = Random(seed >> 1);
        let size = libm::powf(10.0, exponent as f32);
        let mut m = soup(&mut random, 60, 0.5);
        for p in &mut m.positions {
            *p *= size;
        }
        let scale = libm::powf(10.0, scale_exponent as f32);
        let s = if flat { Vec3::new(scale, 0.0, scale) } else { Vec3::splat(scale) };
        let map = Affine3A::from_scale_rotation_translation(s, Quat::IDENTITY, random.vector() * size);
        let (scene, mut pose) = scene(vec![m], &[(0, map), (0, Affine3A::IDENTITY)]);
        let mut tracer = Tracer::new(&scene, &pose);
        deform(&mut pose, 1, scene.meshes[0].positions.iter().map(|p| *p / size).collect());
        for _ in 0..2 {
            for _ in 0..20 {
                let origin_world = random.vector() * size;
                let directions: Vec<Vec3> = (0..40).map(|_| random.direction()).collect();
                let blocked = tracer.occlusion(origin_world, &directions, f32::INFINITY);
                for (i, &direction_world) in directions.iter().enumerate() {
                    let ray = Ray { origin_world, direction_world, t_max: f32::INFINITY };
                    let hit = tracer.closest_hit(&ray);
                    prop_assert_eq!(hit.is_some(), blocked[0] >> i & 1 != 0);
                    if let Some(hit) = hit {
                        prop_assert!(!hit.t.is_nan() && !hit.barycentrics.is_nan());
                    }
                }
            }
            tracer.update(&scene, &pose);
        }
    }
}
