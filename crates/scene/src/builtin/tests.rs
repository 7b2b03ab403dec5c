//! The list of built-in scenes, its errors, and the writer.

pub(super) mod document;

use glam::{Mat4, Vec2, Vec3};

use super::builder::{Emitter, GlbBuilder, Influences, MaterialSpec, NodeSpec, Track};
use super::shapes::{self, Geometry};
use super::{BUILTINS, BuiltinError, glb};

#[test]
fn every_listed_scene_is_made_and_none_is_another() {
    let mut known = std::collections::BTreeSet::new();
    for builtin in BUILTINS {
        let bytes = glb(builtin.name, 0.1).expect("a listed scene");
        gltf::Gltf::from_slice(&bytes).expect("valid glTF");
        assert!(known.insert(blake3::hash(&bytes).to_hex()), "{} is as another scene", builtin.name);
    }
    assert_eq!(known.len(), BUILTINS.len());
}

#[test]
fn nodes_name_the_shape_that_their_mesh_stands_for() {
    let mut b = GlbBuilder::new();
    let glow = b.material("glow", &super::emitters::glow(Vec3::splat(50.0)));
    let mesh = b.mesh("disc", &[(&super::emitters::disc(super::Detail(1.0), 0.5), glow)]);
    for emitter in [Emitter::Sphere, Emitter::Disc, Emitter::Rectangle] {
        b.node(emitter.name(), &NodeSpec { emitter: Some(emitter), ..NodeSpec::mesh_at(mesh, Vec3::Y, 0.0) });
    }
    let spec =
        NodeSpec { emitter: Some(Emitter::Disc), casts: false, receives: false, ..NodeSpec::default() };
    b.node("all", &NodeSpec { mesh: Some(mesh), ..spec });
    let bytes = b.finish().expect("written");
    let gltf = gltf::Gltf::from_slice(&bytes).expect("valid glTF");
    let extras: Vec<String> =
        gltf.nodes().map(|n| n.extras().as_ref().map(|e| e.get().to_string()).unwrap_or_default()).collect();
    assert_eq!(
        extras,
        [
            r#"{"light":"sphere"}"#,
            r#"{"light":"disc"}"#,
            r#"{"light":"rectangle"}"#,
            r#"{"casts":false,"receives":false,"light":"disc"}"#
        ]
    );
    assert!(gltf.extensions_used().any(|name| name == "KHR_materials_emissive_strength"));
    let scene = crate::load("lamps.glb", &bytes, &crate::NoFiles).expect("loads");
    assert_eq!(scene.materials[0].emissive_factor, Vec3::splat(50.0));
    // A fan of 64 triangles, flat, towards −Z.
    let disc = &scene.meshes[0];
    assert_eq!(disc.triangles.len(), 64);
    for t in &disc.triangles {
        let [a, b, c] = t.map(|v| disc.positions[v as usize]);
        assert!((b - a).cross(c - a).z < 0.0);
    }
}

#[test]
fn loops_are_closed_and_even() {
    let corners = [Vec3::ZERO, Vec3::new(4.0, 0.0, 0.0), Vec3::new(4.0, 1.0, 3.0), Vec3::new(0.0, 2.0, 3.0)];
    let points = super::path::even_loop(&corners, 120);
    assert_eq!((points.len(), points[0]), (121, points[120]));
    let steps: Vec<f32> = points.windows(2).map(|pair| pair[0].distance(pair[1])).collect();
    let mean = steps.iter().sum::<f32>() / steps.len() as f32;
    assert!(mean > 0.02 && steps.iter().all(|step| (step / mean - 1.0).abs() < 0.01), "{steps:?}");
    // It bends at its ends as anywhere else.
    let (before, after) = (points[120] - points[119], points[1] - points[0]);
    assert!(before.normalize().dot(after.normalize()) > 0.99);
}

#[test]
fn bad_arguments_say_what_is_known() {
    let error = glb("atrum", 1.0).expect_err("unknown").to_string();
    assert!(error.contains("\"atrum\"") && error.contains("atrium"), "{error}");
    for detail in [0.0, -1.0, 1.5, f32::NAN, f32::INFINITY] {
        let error = glb("atrium", detail).expect_err("out of range");
        assert!(matches!(error, BuiltinError::Detail(_)), "{error}");
        assert!(error.to_string().contains("at most 1"), "{error}");
    }
}

fn closed_volume(g: &Geometry) -> f32 {
    let key = |i: u32| (g.positions[i as usize] + Vec3::ZERO).to_array().map(f32::to_bits);
    let mut edges = std::collections::BTreeMap::new();
    for &[a, b, c] in &g.triangles {
        for (p, q) in [(a, b), (b, c), (c, a)] {
            let (p, q) = (key(p), key(q));
            *edges.entry((p.min(q), p.max(q))).or_insert(0) += if p < q { 1 } else { -1 };
        }
    }
    assert!(edges.values().all(|&balance| balance == 0), "not closed");
    g.signed_volume()
}

#[test]
fn shapes_enclose_the_volume_they_should() {
    let near = |a: f32, b: f32, tolerance: f32| assert!((a - b).abs() <= tolerance * b, "{a} is not {b}");
    let (lo, hi) = (Vec3::new(-1.0, 0.0, 2.0), Vec3::new(1.0, 3.0, 4.0));
    near(closed_volume(&shapes::cuboid(lo, hi)), 12.0, 1e-5);
    // Cut edges: each of the 4 edges of length L loses bevel² / 2 · L, corners a little less.
    near(closed_volume(&shapes::beveled_box(lo, hi, 0.01)), 12.0 - 4.0 * 7.0 * 0.00005, 1e-4);
    let cylinder = shapes::lathe(&[Vec2::new(0.5, 0.0), Vec2::new(0.5, 2.0)], 128);
    near(closed_volume(&cylinder), std::f32::consts::PI * 0.5, 1e-3);
    let bar = shapes::tube(&[Vec3::ZERO, Vec3::X, Vec3::new(2.0, 1.0, 0.0)], 0.1, 64);
    near(closed_volume(&bar), std::f32::consts::PI * 0.01 * (1.0 + libm::sqrtf(2.0)), 1e-2);
    let arch = shapes::arcade_wall(1, 3.0, 1.0, [2.0, 4.0], 0.5, 0.0, 128);
    near(closed_volume(&arch), 0.5 * (3.0 * 2.0 - 0.5 * std::f32::consts::PI), 1e-3);
    let ring = shapes::ring_slab(Vec2::new(3.0, 2.0), Vec2::new(2.0, 1.0), [1.0, 1.5]);
    near(closed_volume(&ring), 0.5 * (24.0 - 8.0), 1e-4);
    // Without a slanted underside every step is a full block.
    let stairs = shapes::stairs(4, 0.2, 0.3, 2.0, 10.0, 0.0);
    near(closed_volume(&stairs), 0.2 * 0.3 * 2.0 * (1.0 + 2.0 + 3.0 + 4.0), 1e-4);
    assert!(closed_volume(&shapes::stairs(9, 0.2, 0.3, 2.0, 0.3, 0.02)) > 0.0);
    for level in 0..4 {
        let volume = closed_volume(&shapes::boulder(level, 3));
        assert!((2.0..5.5).contains(&volume), "{volume}");
    }
}

#[test]
fn cloth_faces_plus_z() {
    let cloth = shapes::cloth(2.0, 3.0, 5.0, 0.2, [60, 10], 1);
    let facing: f32 = cloth
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|i| cloth.positions[i as usize]);
            (b - a).cross(c - a).z
        })
        .sum();
    assert!(facing > 0.0);
    assert!(cloth.normals.iter().all(|n| n.z > 0.0 && (n.length() - 1.0).abs() < 1e-4));
}

#[test]
fn skins_and_big_meshes_are_valid() {
    let mut b = GlbBuilder::new();
    let material = b.material("m", &MaterialSpec { emissive: Vec3::splat(3.0), ..MaterialSpec::default() });
    let big = shapes::boulder(7, 1);
    assert!(big.positions.len() > 65535);
    let mesh = b.mesh("big", &[(&big, material)]);
    b.node("big", &NodeSpec::mesh_at(mesh, Vec3::Y, 1.0));
    let bar = shapes::tube(&[Vec3::ZERO, Vec3::Y], 0.1, 6);
    let (root, tip) = (b.node("root", &NodeSpec::default()), Vec3::Y);
    let tip = b.node("tip", &NodeSpec { parent: Some(root), translation: tip, ..NodeSpec::default() });
    let weights: Vec<[f32; 4]> = bar.positions.iter().map(|p| [1.0 - p.y, p.y, 0.0, 0.0]).collect();
    let joints = vec![[0, 1, 0, 0]; weights.len()];
    let mesh = b.skinned_mesh("bar", &[(&bar, material, Influences { joints: &joints, weights: &weights })]);
    let skin = b.skin("skin", &[root, tip], &[Mat4::IDENTITY, Mat4::from_translation(-Vec3::Y)]);
    b.node("bar", &NodeSpec { mesh: Some(mesh), skin: Some(skin), receives: false, ..NodeSpec::default() });
    let animation = b.animation("grow");
    b.channel(animation, tip, &[0.0, 1.0], Track::Scale(&[Vec3::ONE, Vec3::splat(2.0)]), true);
    let texels = vec![128; 4 * 6];
    b.texture("t", [2, 3], &texels, true).expect("six texels");
    assert!(matches!(b.texture("t", [2, 2], &texels, true), Err(BuiltinError::Png { .. })));
    let bytes = b.finish().expect("written");
    let gltf = gltf::Gltf::from_slice(&bytes).expect("valid glTF");
    assert_eq!(gltf.skins().next().expect("a skin").joints().count(), 2);
    let accessor = gltf.meshes().next().expect("a mesh").primitives().next().expect("a primitive").indices();
    assert_eq!(accessor.expect("indices").data_type(), gltf::accessor::DataType::U32);
    let extras = gltf.nodes().last().and_then(|n| n.extras().as_ref().map(|e| e.get().to_string()));
    assert_eq!(extras.as_deref(), Some(r#"{"receives":false}"#));
}
