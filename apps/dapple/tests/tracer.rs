//! The tracer against a loop over all triangles, on built-in scenes and scenes by others.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod common;

use common::shared_scene;
use dapple_scene::glam::{DVec3, Vec3};
use dapple_scene::{AlphaMode, NoFiles, Pose, Scene};
use dapple_trace::sampling::{fixed_pattern, hash, orthonormal_basis, unit_interval};
use dapple_trace::{Ray, Tracer, offset_origin};

/// All triangles in the world, in `f64` but for the vertices' own rounding.
fn world_triangles(scene: &Scene, pose: &Pose) -> Vec<[DVec3; 3]> {
    let mut triangles = Vec::new();
    for (instance, posed) in scene.instances.iter().zip(&pose.instances).filter(|(i, _)| i.casts) {
        let mesh = &scene.meshes[instance.mesh as usize];
        let positions = posed.deformed.as_ref().map_or(&mesh.positions, |d| &d.positions);
        let map = &posed.world_from_mesh;
        let columns =
            [map.matrix3.x_axis, map.matrix3.y_axis, map.matrix3.z_axis].map(|c| Vec3::from(c).as_dvec3());
        let offset = Vec3::from(map.translation).as_dvec3();
        triangles.extend(mesh.triangles.iter().map(|t| {
            t.map(|i| {
                let p = positions[i as usize].as_dvec3();
                columns[0] * p.x + columns[1] * p.y + columns[2] * p.z + offset
            })
        }));
    }
    triangles
}

/// Whether anything is met within `t_max`, by Cramer's rule; `None` where a decision was near tipping.
fn brute_force(triangles: &[[DVec3; 3]], ray: &Ray) -> Option<bool> {
    let (origin, direction, t_max) =
        (ray.origin_world.as_dvec3(), ray.direction_world.as_dvec3(), f64::from(ray.t_max));
    let (mut hit, mut unclear) = (false, false);
    for [a, b, c] in triangles {
        let (ab, ac, s) = (*b - *a, *c - *a, origin - *a);
        let p = direction.cross(ac);
        let det = ab.dot(p);
        let q = s.cross(ab);
        let (u, v, t) = (s.dot(p) / det, direction.dot(q) / det, ac.dot(q) / det);
        let inside = u.min(v).min(1.0 - u - v);
        // How far corners may be off, in units of the triangle's own size.
        let size = ab.length().max(ac.length());
        if ab.cross(ac).length() < 1e-6 * size * size {
            // A line: what meets it is chance.
            continue;
        }
        let scale = s.length().max(origin.length()).max(size);
        let loose = 3e-6 * scale / size.max(1e-30) + 3e-6;
        if !t.is_finite() || inside < -loose || t < -3e-6 * scale || t > t_max + 3e-6 * scale {
            continue;
        }
        let steep = det.abs() > 1e-6 * size * size;
        if inside > loose && t > 3e-6 * scale && t < t_max - 3e-6 * scale && steep {
            hit = true;
        } else {
            unclear = true;
        }
    }
    if hit { Some(true) } else { (!unclear).then_some(false) }
}

/// Compares some rays from surfaces; returns how many were clear and how many of those were blocked.
fn compare(name: &str, mut scene: Scene) -> (usize, usize) {
    // What alpha does has its own tests.
    for material in &mut scene.materials {
        material.alpha_mode = AlphaMode::Opaque;
    }
    let pose = scene.pose(0.4);
    let tracer = Tracer::new(&scene, &pose);
    let triangles = world_triangles(&scene, &pose);
    let diagonal = scene.bounds_world(&pose).diagonal();
    let (mut compared, mut blocked) = (0, 0);
    let rays = 16;
    let mut sites = 0;
    // Some scenes have many triangles without area.
    for site in 0..1000_u64 {
        let random = |k: u32| unit_interval(hash(7, site, k));
        let [a, b, c] = triangles[(random(0) * triangles.len() as f32) as usize];
        let (u, v) = (f64::from(random(1)), f64::from(random(2)));
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        if sites == 24 {
            break;
        }
        let Some(normal) = (b - a).cross(c - a).try_normalize() else { continue };
        sites += 1;
        let normal = normal.as_vec3();
        let origin_world = offset_origin((a + (b - a) * u + (c - a) * v).as_vec3(), normal);
        let t_max = diagonal * if random(3) < 0.5 { 0.03 } else { 0.4 };
        let (tangent, bitangent) = orthonormal_basis(normal);
        let mut directions = Vec::new();
        fixed_pattern(rays, hash(1, site, 0), &mut directions);
        for d in &mut directions {
            *d = tangent * d.x + bitangent * d.y + normal * d.z;
        }
        let mask = tracer.occlusion(origin_world, &directions, t_max)[0];
        for (i, &direction_world) in directions.iter().enumerate() {
            let ray = Ray { origin_world, direction_world, t_max };
            let ours = mask >> i & 1 == 1;
            assert_eq!(tracer.occluded(&ray), ours, "{name}: {ray:?}");
            assert_eq!(tracer.closest_hit(&ray).is_some(), ours, "{name}: {ray:?}");
            if let Some(expected) = brute_force(&triangles, &ray) {
                assert_eq!(ours, expected, "{name}: {ray:?}");
                compared += 1;
                blocked += usize::from(expected);
            }
        }
    }
    (compared, blocked)
}

fn check(name: &str, scene: Scene) {
    let (compared, blocked) = compare(name, scene);
    println!("{name}: {compared} of 384 rays were clear, {blocked} of them blocked");
    assert!(compared > 150, "{name}: only {compared} rays were clear");
}

#[test]
fn built_in_scenes_agree_with_brute_force() {
    for builtin in dapple_scene::builtin::BUILTINS {
        let glb = dapple_scene::builtin::glb(builtin.name, 0.1).unwrap();
        check(builtin.name, dapple_scene::load("scene.glb", &glb, &NoFiles).unwrap());
    }
}

#[test]
fn scenes_by_others_agree_with_brute_force() {
    for path in [
        "scenes/sponza-dabrovic/sponza.obj",
        "scenes/pandora/pandora.obj",
        "scenes/zdm2/zdm2.glb",
        "scenes/godot-room/room.glb",
        "scenes/godot-living-room/living_room.glb",
        "scenes/webxr-garage/garage.gltf",
        "scenes/webxr-cave/cave.gltf",
        "scenes/vr-gallery/vr-gallery.glb",
        "scenes/house-alphamask/house.glb",
        "scenes/cornell-box-mcguire/cornellbox.obj",
        "scenes/cornell-box-emissive/CornellBox.glb",
        "scenes/stanford-bunny/stanford-bunny.obj",
        "scenes/DamagedHelmet/DamagedHelmet.glb",
        "scenes/NormalTangentTest/NormalTangentTest.glb",
        "scenes/anim-CesiumMan/CesiumMan.glb",
        "scenes/anim-Fox/Fox.glb",
        "scenes/anim-mannequiny/mannequiny.glb",
        "scenes/anim-CesiumMilkTruck/CesiumMilkTruck.glb",
        "scenes/anim-AnimatedMorphSphere/AnimatedMorphSphere.glb",
        "scenes/anim-MorphStressTest/morph-stress-test.glb",
    ] {
        let Some(scene) = shared_scene(path) else { return };
        check(path, scene);
    }
}
