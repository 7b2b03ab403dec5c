//! What generated points must be like.

use dapple_scene::glam::{Affine3A, Quat, Vec2};
use dapple_scene::{AlphaMode, Image, Texture, TextureRef, Wrap};

use super::*;
use crate::test_support::{cube, quad, scene, scene_of, sphere};

fn generate(scene: &Scene, pose: &Pose, params: &GenerateParams) -> GeneratedPoints {
    let tracer = Tracer::new(scene, pose);
    generate_points(scene, pose, &tracer, params, &|_| ()).unwrap()
}

fn floor(size: f32) -> dapple_scene::Mesh {
    let corner = |x: f32, z: f32| Vec3::new(x * size, 0.0, z * size);
    quad(corner(0.0, 0.0), corner(0.0, 1.0), corner(1.0, 1.0), corner(1.0, 0.0))
}

#[test]
fn half_of_the_density_is_kept_evenly_and_on_the_surface() {
    let (scene, pose) = scene_of(floor(2.0));
    let points = generate(&scene, &pose, &GenerateParams { points_per_m2: 512.0, ..Default::default() });
    assert_eq!(points.layout.len(), 1024);
    let set = &points.layout.sets()[0];
    let at = |i: usize| set.position_rest(i, points.layout.quantum_m());
    let spacing = points.layout.spacing_m();
    let mut least = f32::INFINITY;
    for i in 0..set.len() {
        assert!(at(i).y.abs() < 1e-6 && set.normal_rest(i).distance(Vec3::Y) < 1e-6);
        for j in 0..i {
            least = least.min(at(i).distance(at(j)));
        }
    }
    assert!(least > 0.35 * spacing, "nearest pair {least}, spacing {spacing}");
    // Quarters of the square get their share.
    let in_quarter = (0..set.len()).filter(|&i| at(i).x < 1.0 && at(i).z < 1.0).count();
    assert!((236..=276).contains(&in_quarter), "{in_quarter} of 1024 in one quarter");
}

#[test]
fn anchors_and_layout_name_the_same_places() {
    let map = Affine3A::from_scale_rotation_translation(
        Vec3::new(1.5, 0.5, 2.0),
        Quat::from_rotation_y(0.4),
        Vec3::new(3.0, 1.0, -2.0),
    );
    let (scene, pose) =
        scene(vec![sphere(Vec3::ZERO, 0.5, 12, 24), cube()], &[(0, map), (1, Affine3A::IDENTITY)]);
    let points = generate(&scene, &pose, &GenerateParams::default());
    let quantum = points.layout.quantum_m();
    assert_eq!(points.anchors.len(), points.layout.len());
    for set in points.layout.sets() {
        let rest_from_mesh = scene.instances[set.instance as usize].rest_from_mesh;
        for i in 0..set.len() {
            let anchor = &points.anchors[set.first as usize + i];
            let posed = anchor.pose(&scene, &pose, set.instance as usize).unwrap();
            // At time 0 a rigid instance's rest space is the world without the translation.
            let translation = Vec3::from(pose.instances[set.instance as usize].world_from_mesh.translation);
            let rest = posed.position - translation;
            assert!(rest.distance(set.position_rest(i, quantum)) < quantum, "{rest_from_mesh:?}");
            assert!(posed.normal.dot(set.normal_rest(i)) > 0.999);
        }
    }
}

#[test]
fn the_same_on_any_number_of_threads() {
    let (scene, pose) = scene(
        vec![sphere(Vec3::ZERO, 0.7, 12, 24), floor(3.0)],
        &[(0, Affine3A::IDENTITY), (1, Affine3A::from_translation(Vec3::NEG_Y))],
    );
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| generate(&scene, &pose, &GenerateParams::default()))
    };
    let (one, two) = (on(1), on(2));
    assert_eq!(one.layout, two.layout);
    assert_eq!(one.anchors, two.anchors);
    let other = generate(&scene, &pose, &GenerateParams { seed: 9, ..Default::default() });
    assert_ne!(one.layout, other.layout);
}

#[test]
fn both_sides_of_double_sided_triangles_carry_points() {
    let (mut scene, pose) = scene_of(floor(1.0));
    let single = generate(&scene, &pose, &GenerateParams::default());
    scene.materials[0].double_sided = true;
    let double = generate(&scene, &pose, &GenerateParams::default());
    assert_eq!(double.layout.len(), 2 * single.layout.len());
    let up = double.layout.sets()[0].normals.iter().filter(|n| n.unpack().y > 0.0).count();
    assert!((200..=312).contains(&up), "{up} of 512 point up");
    assert!(double.anchors.iter().any(Anchor::is_back));
}

#[test]
fn masked_out_texels_carry_none() {
    let mut mesh = floor(1.0);
    mesh.uvs[0] = vec![Vec2::new(0.0, 0.0), Vec2::new(0.0, 1.0), Vec2::new(1.0, 1.0), Vec2::new(1.0, 0.0)];
    let (mut scene, pose) = scene_of(mesh);
    let texels = (0..16).map(|i| [255, 255, 255, if i % 4 < 2 { 0 } else { 255 }]).collect();
    scene.images.push(Image { name: "mask".into(), width: 4, height: 4, rgba8: texels });
    scene.textures.push(Texture {
        image: 0,
        wrap_u: Wrap::Clamp,
        wrap_v: Wrap::Clamp,
        filter: dapple_scene::Filter::Nearest,
    });
    let texture = TextureRef { texture: 0, uv_set: 0, image_from_uv: dapple_scene::glam::Affine2::IDENTITY };
    scene.materials[0].base_color_texture = Some(texture);
    scene.materials[0].alpha_mode = AlphaMode::Mask { cutoff: 0.5 };
    let points = generate(&scene, &pose, &GenerateParams::default());
    let set = &points.layout.sets()[0];
    // x = u on this quad: the left half is cut out.
    assert!((0..set.len()).all(|i| set.position_rest(i, points.layout.quantum_m()).x > 0.499));
    assert!((120..=136).contains(&set.len()), "{} points on half a square metre", set.len());
}

#[test]
fn points_inside_a_closed_body_are_dropped() {
    // A cube stands in the middle of the floor and 5 cm through it.
    let stand = Affine3A::from_translation(Vec3::new(0.75, -0.05, 0.75));
    let body = Affine3A::from_scale(Vec3::splat(0.5));
    let (scene, pose) = scene(vec![floor(2.0), cube()], &[(0, Affine3A::IDENTITY), (1, stand * body)]);
    let kept = generate(&scene, &pose, &GenerateParams::default());
    let under = |points: &GeneratedPoints| {
        let set = points.layout.set_of_instance(0).unwrap();
        (0..set.len())
            .map(|i| set.position_rest(i, points.layout.quantum_m()))
            .filter(|p| (p.x - 1.0).abs() < 0.24 && (p.z - 1.0).abs() < 0.24)
            .count()
    };
    assert_eq!(under(&kept), 0);
    assert!(kept.dropped_inside > 40);
    let all = generate(&scene, &pose, &GenerateParams { inside_rays: 0, ..Default::default() });
    assert!(under(&all) > 40);
}

#[test]
fn tiny_and_non_receiving_instances() {
    let grain = Affine3A::from_translation(Vec3::splat(-3.0)) * Affine3A::from_scale(Vec3::splat(1e-4));
    let (mut scene, pose) = scene(vec![cube()], &[(0, grain), (0, Affine3A::IDENTITY)]);
    scene.instances[1].receives = false;
    let points = generate(&scene, &pose, &GenerateParams::default());
    assert_eq!(points.layout.sets().len(), 1);
    assert_eq!(points.layout.len(), 1);
}

#[test]
fn impossible_densities_say_what_to_do() {
    let (scene, pose) = scene_of(floor(1000.0));
    let tracer = Tracer::new(&scene, &pose);
    let with = |points_per_m2: f32| {
        let params = GenerateParams { points_per_m2, ..Default::default() };
        generate_points(&scene, &pose, &tracer, &params, &|_| ()).unwrap_err()
    };
    let message = with(512.0).to_string();
    assert!(message.contains("--radius auto") && message.contains("256000000"), "{message}");
    for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        assert!(matches!(with(bad), GenerateError::BadDensity(_)));
    }
}

#[test]
fn a_scene_without_surface_has_no_points() {
    let (scene, pose) = scene_of(quad(Vec3::ONE, Vec3::ONE, Vec3::ONE, Vec3::ONE));
    assert!(generate(&scene, &pose, &GenerateParams::default()).layout.is_empty());
}

/// A floor of 4 m with a cube of 0.6 m on its middle.
fn box_on_a_floor() -> (Scene, Pose) {
    let stand = Affine3A::from_translation(Vec3::new(1.7, 0.0, 1.7)) * Affine3A::from_scale(Vec3::splat(0.6));
    scene(vec![floor(4.0), cube()], &[(0, Affine3A::IDENTITY), (1, stand)])
}

const ADAPTIVE: GenerateParams = GenerateParams {
    points_per_m2: 512.0,
    max_points: 1_000_000,
    inside_fraction: 0.5,
    inside_rays: 64,
    seed: 0,
    adaptive: 1.0,
    radius_m: 0.6,
};

#[test]
fn adaptive_points_are_as_many_and_denser_where_visibility_changes() {
    let (scene, pose) = box_on_a_floor();
    let uniform = generate(&scene, &pose, &GenerateParams { adaptive: 0.0, ..ADAPTIVE });
    let adaptive = generate(&scene, &pose, &ADAPTIVE);
    let (of_uniform, of_adaptive) = (uniform.layout.len() as f32, adaptive.layout.len() as f32);
    assert!((of_adaptive / of_uniform - 1.0).abs() < 0.02, "{of_adaptive} points instead of {of_uniform}");
    assert_eq!(uniform.layout.spacing_m().to_bits(), adaptive.layout.spacing_m().to_bits());

    let set = adaptive.layout.set_of_instance(0).unwrap();
    let places: Vec<Vec3> =
        (0..set.len()).map(|i| set.position_rest(i, adaptive.layout.quantum_m())).collect();
    // Distance to the cube's foot, in the norm that makes squares of what is equally far.
    let from_box = |p: &Vec3| (p.x - 2.0).abs().max((p.z - 2.0).abs()) - 0.3;
    let per_m2 = |low: f32, high: f32| {
        let count = places.iter().filter(|p| (low..high).contains(&from_box(p))).count();
        let edge = |d: f32| (0.6 + 2.0 * d) * (0.6 + 2.0 * d);
        count as f32 / (edge(high) - edge(low))
    };
    let (near, far) = (per_m2(0.02, 0.3), per_m2(1.0, 1.7));
    assert!(near > 1.5 * far && far > 0.0, "{near} a m² near the box, {far} far from it");
    // Between the bounds, and so are the distances: a share of what the density there would allow at most.
    assert!(far > 0.4 * 256.0 && near < 2.2 * 256.0, "{near} and {far} a m², 256 uniform");
    let spacing_m = adaptive.layout.spacing_m();
    for (i, p) in places.iter().enumerate() {
        let local_m = spacing_m / if from_box(p) < 0.6 { 2.0f32.sqrt() } else { 1.0 };
        let nearest = places[i + 1..].iter().map(|q| q.distance(*p)).fold(f32::INFINITY, f32::min);
        assert!(nearest > 0.3 * local_m, "{nearest} m at {p}, spacing {local_m} m");
    }
}

#[test]
fn adaptive_points_are_the_same_on_any_number_of_threads() {
    let (scene, pose) = box_on_a_floor();
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| generate(&scene, &pose, &ADAPTIVE))
    };
    let (one, three) = (on(1), on(3));
    assert_eq!(one.layout, three.layout);
    assert_eq!(one.anchors, three.anchors);
    let half = generate(&scene, &pose, &GenerateParams { adaptive: 0.5, ..ADAPTIVE });
    assert_ne!(half.layout, one.layout);
}

#[test]
fn adaptive_points_on_scenes_without_any_gradient() {
    let (open, pose) = scene_of(floor(2.0));
    let points = generate(&open, &pose, &ADAPTIVE);
    let count = points.layout.len();
    assert!((1003..=1045).contains(&count), "{count} points instead of 1024");
    let set = &points.layout.sets()[0];
    let in_quarter = (0..set.len())
        .map(|i| set.position_rest(i, points.layout.quantum_m()))
        .filter(|p| p.x < 1.0 && p.z < 1.0)
        .count();
    assert!((236..=276).contains(&in_quarter), "{in_quarter} of {count} in one quarter");

    let one = crate::test_support::mesh(vec![Vec3::ZERO, Vec3::Z, Vec3::X], vec![[0, 1, 2]]);
    let (one, pose) = scene_of(one);
    let count = generate(&one, &pose, &ADAPTIVE).layout.len();
    assert!((125..=131).contains(&count), "{count} points on half a square metre");
    let (grain, pose) = scene(vec![cube()], &[(0, Affine3A::from_scale(Vec3::splat(1e-4)))]);
    assert_eq!(generate(&grain, &pose, &ADAPTIVE).layout.len(), 1);
    let (nothing, pose) = scene_of(quad(Vec3::ONE, Vec3::ONE, Vec3::ONE, Vec3::ONE));
    assert!(generate(&nothing, &pose, &ADAPTIVE).layout.is_empty());
    // Rays of no length or without end, and many surfaces in one place.
    let (scene, pose) = box_on_a_floor();
    let uniform = generate(&scene, &pose, &GenerateParams { adaptive: 0.0, ..ADAPTIVE }).layout.len() as f32;
    for radius_m in [0.0, f32::NAN, f32::INFINITY] {
        let count = generate(&scene, &pose, &GenerateParams { radius_m, ..ADAPTIVE }).layout.len() as f32;
        assert!(
            (count / uniform - 1.0).abs() < 0.02,
            "{count} points instead of {uniform}, radius {radius_m}"
        );
    }
    let (piled, pose) = scene_of(crate::test_support::joined(vec![floor(0.5); 8]));
    let count = generate(&piled, &pose, &ADAPTIVE).layout.len();
    assert!((500..=524).contains(&count), "{count} points instead of 512");
}

#[test]
fn adaptive_out_of_range_is_refused() {
    let (scene, _) = box_on_a_floor();
    for adaptive in [-0.1, 1.1, f32::NAN] {
        let refused = check_density(&scene, &GenerateParams { adaptive, ..ADAPTIVE });
        assert!(matches!(refused, Err(GenerateError::BadAdaptive(_))), "{adaptive}: {refused:?}");
    }
}
