//! What glTF can say arrives in the scene: made-up files with one feature each.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod common;

use common::{Builder, glb, load_bytes, use_scene};
use dapple_scene::glam::{Mat3, Quat, Vec2, Vec3, Vec4};
use dapple_scene::{
    AlphaMode, CameraSource, Files, LightKind, LoadError, LocalTransform, NoFiles, Projection, Scene, load,
};

const TRIANGLE: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];

/// Loads a file with one mesh of one primitive at one node.
fn load_primitive(builder: &Builder, primitive: &str) -> Result<Scene, LoadError> {
    let rest = format!(r#""meshes":[{{"primitives":[{{{primitive}}}]}}],"nodes":[{{"mesh":0}}]"#);
    load_bytes(&builder.glb(&rest))
}

fn loaded(bytes: &[u8]) -> Scene {
    let scene = load_bytes(bytes).unwrap_or_else(|error| panic!("{error}"));
    use_scene(&scene, "made");
    scene
}

#[test]
fn missing_normals_are_flat() {
    let mut b = Builder::default();
    // Two triangles that share an edge, at a right angle.
    let p = b.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
    let i = b.bytes("SCALAR", &[0, 1, 2, 0, 3, 1]);
    let scene = load_primitive(&b, &format!(r#""attributes":{{"POSITION":{p}}},"indices":{i}"#)).unwrap();
    let mesh = &scene.meshes[0];
    assert_eq!(mesh.positions.len(), 6);
    assert_eq!(mesh.normals, [[Vec3::Z; 3], [Vec3::Y; 3]].concat());
    assert_eq!(mesh.positions[3..], [Vec3::ZERO, Vec3::Z, Vec3::X]);
}

#[test]
fn only_used_vertices_are_kept() {
    let mut b = Builder::default();
    let positions: Vec<f32> = (0..30).map(|i| i as f32 * if i % 2 == 0 { 1.0 } else { -1.0 }).collect();
    let p = b.floats("VEC3", &positions);
    let n = b.floats("VEC3", &[0.0, 0.0, 1.0].repeat(10));
    let i = b.bytes("SCALAR", &[9, 2, 5]);
    let scene = load_primitive(&b, &format!(r#""attributes":{{"POSITION":{p},"NORMAL":{n}}},"indices":{i}"#))
        .unwrap();
    let mesh = &scene.meshes[0];
    assert_eq!(mesh.positions.iter().map(|p| p.x).collect::<Vec<_>>(), [6.0, -15.0, -27.0]);
    assert_eq!(mesh.triangles, [[2, 0, 1]]);
}

#[test]
fn strided_and_sparse_accessors() {
    let mut b = Builder::default();
    // Position and normal interleaved.
    let rows: Vec<u8> = TRIANGLE
        .chunks(3)
        .flat_map(|p| {
            p.iter().chain(&[0.0, 0.0, 1.0]).flat_map(|x: &f32| x.to_le_bytes()).collect::<Vec<_>>()
        })
        .collect();
    let view = b.view(&rows, r#","byteStride":24"#);
    // The second position is replaced.
    let indices = b.view(&1_u16.to_le_bytes(), "");
    let values = b.view(&[5.0_f32, 6.0, 7.0].map(f32::to_le_bytes).concat(), "");
    let sparse = format!(
        r#""sparse":{{"count":1,"indices":{{"bufferView":{indices},"componentType":5123}},"values":{{"bufferView":{values}}}}}"#
    );
    let p = b.accessor(format!(
        r#"{{"bufferView":{view},"componentType":5126,"count":3,"type":"VEC3",{sparse}}}"#
    ));
    let n = b.accessor(format!(
        r#"{{"bufferView":{view},"byteOffset":12,"componentType":5126,"count":3,"type":"VEC3"}}"#
    ));
    let scene = load_primitive(&b, &format!(r#""attributes":{{"POSITION":{p},"NORMAL":{n}}}"#)).unwrap();
    assert_eq!(scene.meshes[0].positions, [Vec3::ZERO, Vec3::new(5.0, 6.0, 7.0), Vec3::Y]);
    assert_eq!(scene.meshes[0].normals, [Vec3::Z; 3]);
    // Without a view the base is zero.
    let zeros = b.accessor(format!(r#"{{"componentType":5126,"count":3,"type":"VEC3",{sparse}}}"#));
    let scene = load_primitive(&b, &format!(r#""attributes":{{"POSITION":{zeros}}}"#)).unwrap();
    assert_eq!(scene.meshes[0].positions, [Vec3::ZERO, Vec3::new(5.0, 6.0, 7.0), Vec3::ZERO]);
}

#[test]
fn quantized_attributes() {
    let mut b = Builder::default();
    let view = b.view(&[0_i8, 0, 0, 0, 127, 0, 0, 0, 0, -127, 0, 0].map(|x| x as u8), r#","byteStride":4"#);
    let make = |b: &mut Builder, flag: &str| {
        b.accessor(format!(r#"{{"bufferView":{view},"componentType":5120,"count":3,"type":"VEC3"{flag}}}"#))
    };
    let (raw, unit) = (make(&mut b, ""), make(&mut b, r#","normalized":true"#));
    let view = b.view(&[0_u16, 0, 65535, 0, 0, 32768].map(u16::to_le_bytes).concat(), "");
    let uv = b.accessor(format!(
        r#"{{"bufferView":{view},"componentType":5123,"count":3,"type":"VEC2","normalized":true}}"#
    ));
    let rest = format!(
        r#""extensionsRequired":["KHR_mesh_quantization"],"meshes":[{{"primitives":[
            {{"attributes":{{"POSITION":{raw},"TEXCOORD_0":{uv}}}}},{{"attributes":{{"POSITION":{unit}}}}}]}}],
            "nodes":[{{"mesh":0}}]"#
    );
    let scene = loaded(&b.glb(&rest));
    let mesh = &scene.meshes[0];
    assert_eq!(mesh.positions[1], Vec3::new(127.0, 0.0, 0.0));
    assert_eq!(mesh.positions[4..], [Vec3::X, Vec3::NEG_Y]);
    assert_eq!(mesh.uvs[0][1], Vec2::X);
    assert!((mesh.uvs[0][2].y - 32768.0 / 65535.0).abs() < 1e-7);
    assert_eq!(mesh.uvs[0][3], Vec2::ZERO, "the second primitive has none");
    assert_eq!(mesh.parts.len(), 2);
}

#[test]
fn several_influence_sets_are_normalized() {
    let mut b = Builder::default();
    let p = b.floats("VEC3", &TRIANGLE);
    let n = b.floats("VEC3", &[0.0, 0.0, 1.0].repeat(3));
    let j = b.bytes("VEC4", &[0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3]);
    let w = b.floats("VEC4", &[0.5, 0.5, 0.5, 0.5].repeat(3));
    let attributes = format!(
        r#""POSITION":{p},"NORMAL":{n},"JOINTS_0":{j},"WEIGHTS_0":{w},"JOINTS_1":{j},"WEIGHTS_1":{w}"#
    );
    let file = |joints: &str| {
        b.glb(&format!(
            r#""meshes":[{{"primitives":[{{"attributes":{{{attributes}}}}}]}}],"skins":[{{"joints":[{joints}]}}],
            "nodes":[{{"mesh":0,"skin":0,"translation":[9,9,9]}},{{"translation":[2,0,0],"scale":[2,2,2]}},{{}},{{}},{{}}]"#
        ))
    };
    let scene = loaded(&file("1,1,1,1"));
    let mesh = &scene.meshes[0];
    assert_eq!(mesh.influences.len(), 2);
    assert_eq!(mesh.influences[1].weights[2], [0.125; 4]);
    let pose = scene.pose(0.0);
    assert_eq!(scene.vertex_positions(&pose, 0)[1], Vec3::new(4.0, 0.0, 0.0));
    assert!(scene.instances[0].rest_from_mesh.abs_diff_eq(Mat3::from_diagonal(Vec3::splat(2.0)), 1e-6));
    // Vertices that refer to joints which the skin lacks.
    let error = load_bytes(&file("1,2,3")).unwrap_err();
    assert!(matches!(error, LoadError::OutOfRange { what: "joint", index: 3, count: 3, .. }), "{error}");
}

#[test]
fn nodes_are_sorted_and_extras_read() {
    let mut b = Builder::default();
    let p = b.floats("VEC3", &TRIANGLE);
    let t = b.floats("SCALAR", &[0.0, 1.0]);
    let v = b.floats("VEC3", &[0.0, 0.0, 0.0, 4.0, 0.0, 0.0]);
    // Node 0 is the grandchild, node 1 hidden (not in the scene), node 3 the root.
    let scene = loaded(&b.glb(&format!(
        r#""scene":1,"scenes":[{{"nodes":[1]}},{{"nodes":[3]}}],"meshes":[{{"primitives":[{{"attributes":{{"POSITION":{p}}}}}]}}],
        "nodes":[{{"name":"leaf","mesh":0,"extras":{{"casts":false}}}},{{"name":"hidden","mesh":0}},
                 {{"name":"middle","children":[0],"mesh":0,"extras":{{"receives":false,"other":[1]}}}},
                 {{"name":"root","children":[2],"matrix":[2,0,0,0, 0,2,0,0, 0,0,2,0, 1,0,0,1]}}],
        "animations":[{{"name":"slide","samplers":[{{"input":{t},"output":{v}}}],
                        "channels":[{{"sampler":0,"target":{{"node":2,"path":"translation"}}}}]}}]"#
    )));
    let names: Vec<&str> = scene.nodes.iter().map(|node| node.name.as_str()).collect();
    assert_eq!(names, ["hidden", "root", "middle", "leaf"]);
    assert_eq!(
        scene.nodes.iter().map(|node| node.parent).collect::<Vec<_>>(),
        [None, None, Some(1), Some(2)]
    );
    assert!(matches!(scene.nodes[1].local, LocalTransform::Matrix(_)));
    let flags: Vec<_> = scene.instances.iter().map(|i| (i.node, i.casts, i.receives)).collect();
    assert_eq!(flags, [(2, true, false), (3, false, true)]);
    assert_eq!(scene.animations[0].channels[0].node, 2);
    assert_eq!(Vec3::from(scene.pose(0.5).world_from_node[3].translation), Vec3::new(5.0, 0.0, 0.0));
    assert_eq!(scene.instances[0].rest_from_mesh, Mat3::from_diagonal(Vec3::splat(2.0)));
    assert_eq!(scene.triangle_count(), 2);
}

#[test]
fn lights_of_a_form_that_shine_otherwise_are_told() {
    let mut b = Builder::default();
    let p = b.floats("VEC3", &TRIANGLE);
    let piece = |material: u32| format!(r#"{{"attributes":{{"POSITION":{p}}},"material":{material}}}"#);
    let (dark, red, green) = (piece(0), piece(1), piece(2));
    let scene = loaded(&b.glb(&format!(
        r#""extensionsUsed":["KHR_materials_unlit"],
        "materials":[{{"emissiveFactor":[1,1,1],"extensions":{{"KHR_materials_unlit":{{}}}}}},{{"emissiveFactor":[1,0,0]}},{{"emissiveFactor":[0,1,0]}}],
        "meshes":[{{"primitives":[{dark}]}},{{"primitives":[{dark},{red}]}},{{"primitives":[{red},{green}]}}],
        "nodes":[{{"name":"unlit","mesh":0,"extras":{{"light":"sphere"}}}},{{"name":"lamp","mesh":1,"extras":{{"light":"disc"}}}},
                 {{"name":"two","mesh":2,"extras":{{"light":"rectangle"}}}},{{"name":"mesh","mesh":2,"extras":{{"light":"triangles"}}}}]"#
    )));
    let told: Vec<&str> = scene.warnings.iter().map(|w| w.message.as_str()).collect();
    assert_eq!(told.len(), 2, "{told:?}");
    assert!(told[0].contains("unlit") && told[0].contains("emissiveFactor"), "{told:?}");
    assert!(told[1].contains("two") && told[1].contains("2 materials"), "{told:?}");
}

#[test]
fn cameras_and_lights() {
    let scene = loaded(&glb(
        r#"{"asset":{"version":"2.0"},
        "cameras":[{"type":"perspective","perspective":{"yfov":1.0,"znear":0.5}},
                   {"type":"orthographic","orthographic":{"xmag":3,"ymag":2,"znear":0.1,"zfar":9}}],
        "extensions":{"KHR_lights_punctual":{"lights":[
            {"type":"spot","intensity":7,"color":[1,0.5,0],"range":4,"spot":{"innerConeAngle":0.1}},{"type":"point"}]}},
        "nodes":[{"name":"eye","camera":0,"translation":[0,0,5],"scale":[2,2,2]},{"camera":1},
                 {"rotation":[0.7071068,0,0,0.7071068],"extensions":{"KHR_lights_punctual":{"light":0}}}]}"#,
        &[],
    ));
    assert_eq!(scene.cameras[0].projection, Projection::Perspective { yfov: 1.0, near: 0.5 });
    assert_eq!(
        scene.cameras[1].projection,
        Projection::Orthographic { half_height: 2.0, near: 0.1, far: 9.0 }
    );
    let paths = scene.camera_paths();
    assert_eq!(paths[0].source, CameraSource::Still { node: 0 });
    assert_eq!(paths[0].name, "eye");
    let pose = scene.pose(0.0);
    assert_eq!(pose.cameras[0].1.world_from_view.matrix3, dapple_scene::glam::Mat3A::IDENTITY);
    let light = &scene.lights[0];
    assert_eq!((light.intensity, light.range, light.color), (7.0, Some(4.0), Vec3::new(1.0, 0.5, 0.0)));
    let outer_cone_angle = std::f32::consts::FRAC_PI_4;
    assert_eq!(light.kind, LightKind::Spot { inner_cone_angle: 0.1, outer_cone_angle });
    assert!(pose.lights[0].direction_world.abs_diff_eq(Vec3::Y, 1e-6));
    assert_eq!(pose.lights.len(), 1);
}

#[test]
fn cameras_move_with_the_active_animation() {
    let mut b = Builder::default();
    let times = b.floats("SCALAR", &[0.0, 2.0]);
    let ride = b.floats("VEC3", &[0.0, 0.0, 0.0, 4.0, 0.0, 0.0]);
    let turn = Quat::from_rotation_y(1.0);
    let turns = b.floats("VEC4", &[Quat::IDENTITY.to_array(), turn.to_array()].concat());
    // The rig carries one camera, turns with it, and is moved by "ride" alone; "spin" turns the other; "wobble" neither.
    let mut scene = loaded(&b.glb(&format!(
        r#""cameras":[{{"type":"perspective","perspective":{{"yfov":1.0,"znear":0.1}}}}],
        "nodes":[{{"name":"rig","children":[1]}},{{"name":"aboard","camera":0,"translation":[0,1,2]}},
                 {{"name":"tripod","camera":0,"translation":[9,1,0]}},{{"name":"thing"}}],
        "animations":[
            {{"name":"wobble","samplers":[{{"input":{times},"output":{ride}}}],
              "channels":[{{"sampler":0,"target":{{"node":3,"path":"translation"}}}}]}},
            {{"name":"ride","samplers":[{{"input":{times},"output":{ride}}},{{"input":{times},"output":{turns}}}],
              "channels":[{{"sampler":0,"target":{{"node":0,"path":"translation"}}}},
                          {{"sampler":1,"target":{{"node":0,"path":"rotation"}}}}]}},
            {{"name":"spin","samplers":[{{"input":{times},"output":{turns}}}],
              "channels":[{{"sampler":0,"target":{{"node":2,"path":"rotation"}}}}]}}]"#
    )));
    let list = |scene: &dapple_scene::Scene| -> Vec<(String, f64)> {
        scene.camera_paths().into_iter().map(|path| (path.name.clone(), path.duration_s())).collect()
    };
    let orbit = ("orbit".to_owned(), 20.0);
    let [aboard, tripod] = ["aboard", "tripod"].map(str::to_owned);
    assert_eq!(list(&scene), [(aboard.clone(), 0.0), (tripod.clone(), 0.0), orbit.clone()]);
    // The list tells which animations would move them.
    let movers: Vec<Vec<u32>> = scene.camera_paths().iter().map(|p| scene.animations_of_camera(p)).collect();
    assert_eq!(movers, [vec![1], vec![2], vec![]]);

    scene.set_active_animation(Some(1));
    assert_eq!(list(&scene), [(aboard.clone(), 2.0), (tripod.clone(), 0.0), orbit.clone()]);
    let path = &scene.camera_paths()[0];
    for (time, x, angle) in [(0.0, 0.0, 0.0), (1.0, 2.0, 0.5), (1.5, 3.0, 0.75)] {
        let camera = path.camera(&scene, &scene.pose(time));
        let turn = Quat::from_rotation_y(angle);
        let eye = Vec3::new(x, 0.0, 0.0) + turn * Vec3::new(0.0, 1.0, 2.0);
        assert!(camera.eye_world().distance(eye) < 1e-5, "at {time}: {}", camera.eye_world());
        let ahead = camera.world_from_view.transform_vector3(Vec3::NEG_Z);
        assert!(ahead.distance(turn * Vec3::NEG_Z) < 1e-5, "at {time}: {ahead}");
    }
    let still = scene.camera_paths()[1].camera(&scene, &scene.pose(1.0));
    assert_eq!(still.eye_world(), Vec3::new(9.0, 1.0, 0.0));

    // The one that moves comes first.
    scene.set_active_animation(Some(2));
    assert_eq!(list(&scene), [(tripod, 2.0), (aboard, 0.0), orbit]);
}

/// A PNG of 2 × 1 texels, red and green, made with an independent encoder.
fn png() -> Vec<u8> {
    let mut bytes = Vec::new();
    let image = image::RgbImage::from_raw(2, 1, vec![255, 0, 0, 0, 255, 0]).unwrap();
    image.write_to(&mut std::io::Cursor::new(&mut bytes), image::ImageFormat::Png).unwrap();
    bytes
}

#[test]
fn materials_and_textures() {
    let mut b = Builder::default();
    let view = b.view(&png(), "");
    let scene = loaded(&b.glb(&format!(
        r#""images":[{{"bufferView":{view},"mimeType":"image/png"}},{{"uri":"missing.png"}}],
        "samplers":[{{"magFilter":9728,"wrapS":33071,"wrapT":33648}}],
        "textures":[{{"source":1}},{{"source":0,"sampler":0}}],
        "materials":[{{"name":"full","pbrMetallicRoughness":{{"baseColorFactor":[0.5,1,1,0.25],"metallicFactor":0,
            "baseColorTexture":{{"index":1,"extensions":{{"KHR_texture_transform":
                {{"offset":[0.5,0.25],"rotation":1.5707963,"scale":[2,3],"texCoord":1}}}}}}}},
            "normalTexture":{{"index":1,"scale":0.5}},"emissiveFactor":[1,2,3],"alphaMode":"MASK","doubleSided":true,
            "extensions":{{"KHR_materials_emissive_strength":{{"emissiveStrength":4}},"KHR_materials_unlit":{{}}}}}},
            {{"emissiveTexture":{{"index":0}},"alphaMode":"BLEND"}}]"#
    )));
    assert_eq!(scene.images[0].rgba8, [[255, 0, 0, 255], [0, 255, 0, 255]]);
    assert_eq!(scene.textures.len(), 1);
    let full = &scene.materials[0];
    assert_eq!(full.base_color_factor, Vec4::new(0.5, 1.0, 1.0, 0.25));
    assert_eq!(full.emissive_factor, Vec3::new(4.0, 8.0, 12.0));
    assert_eq!(full.alpha_mode, AlphaMode::Mask { cutoff: 0.5 });
    assert!(full.double_sided && full.unlit && full.metallic_factor == 0.0 && full.roughness_factor == 1.0);
    let texture = full.base_color_texture.unwrap();
    assert_eq!(texture.uv_set, 1);
    // A quarter turn counter-clockwise on an image whose v points down takes u to −v and v to u.
    let moved = texture.image_from_uv.transform_point2(Vec2::new(1.0, 0.0));
    assert!(moved.abs_diff_eq(Vec2::new(0.5, -1.75), 1e-5), "{moved}");
    assert_eq!(full.normal_texture.unwrap().scale, 0.5);
    assert_eq!(scene.materials[1].emissive_texture, None);
    assert_eq!(scene.materials[1].alpha_mode, AlphaMode::Blend);
    let warned =
        scene.warnings.iter().any(|w| w.message.contains("image 1") && w.message.contains("missing.png"));
    assert!(warned, "{:?}", scene.warnings);
}

#[test]
fn animations_of_all_kinds() {
    let mut b = Builder::default();
    let p = b.floats("VEC3", &TRIANGLE);
    let times = b.floats("SCALAR", &[0.0, 1.0]);
    let cubic = b.floats("VEC3", &[[0.0; 9], [0.0, 0.0, 0.0, 2.0, 2.0, 2.0, 0.0, 0.0, 0.0]].concat());
    let turn = Quat::from_rotation_y(1.0).to_array();
    // Longer than a unit quaternion.
    let turns = b.floats("VEC4", &[[0.0, 0.0, 0.0, 1.0], turn.map(|x| 3.0 * x)].concat());
    let view = b.view(&[0, 255], "");
    let weights = b.accessor(format!(
        r#"{{"bufferView":{view},"componentType":5121,"normalized":true,"count":2,"type":"SCALAR"}}"#
    ));
    let scene = loaded(&b.glb(&format!(
        r#""meshes":[{{"primitives":[{{"attributes":{{"POSITION":{p}}},"targets":[{{"POSITION":{p}}}]}}],"weights":[0.25]}}],
        "nodes":[{{"mesh":0}}],"animations":[{{"samplers":[
            {{"input":{times},"output":{cubic},"interpolation":"CUBICSPLINE"}},{{"input":{times},"output":{turns}}},
            {{"input":{times},"output":{weights},"interpolation":"STEP"}}],"channels":[
            {{"sampler":0,"target":{{"node":0,"path":"scale"}}}},{{"sampler":1,"target":{{"node":0,"path":"rotation"}}}},
            {{"sampler":2,"target":{{"node":0,"path":"weights"}}}},{{"sampler":2,"target":{{"path":"weights"}}}}]}}]"#
    )));
    assert_eq!(scene.meshes[0].morph_weights, [0.25]);
    assert_eq!(scene.animations[0].channels.len(), 3);
    let pose = scene.pose(0.5);
    assert_eq!(scene.vertex_positions(&pose, 0)[1], Vec3::X);
    let x = pose.world_from_node[0].transform_vector3(Vec3::X);
    assert!((x.length() - 1.0).abs() < 1e-6, "half of 2 by symmetry");
    assert!(x.angle_between(Vec3::X) - 0.5 < 1e-4);
    assert_eq!(scene.warnings.len(), 2, "{:?}", scene.warnings);
}

#[test]
fn claims_do_not_cost_memory() {
    let mut b = Builder::default();
    let huge = 4_000_000_000_u64;
    for kind in ["VEC3", "SCALAR"] {
        let component = if kind == "VEC3" { 5126 } else { 5125 };
        b.accessor(format!(r#"{{"componentType":{component},"count":{huge},"type":"{kind}"}}"#));
    }
    let p = b.floats("VEC3", &TRIANGLE);
    for primitive in [
        r#""attributes":{"POSITION":0}"#.to_owned(),
        r#""attributes":{"POSITION":0},"indices":1"#.to_owned(),
        format!(r#""attributes":{{"POSITION":{p}}},"indices":1"#),
    ] {
        let error = load_primitive(&b, &primitive).unwrap_err();
        assert!(matches!(error, LoadError::TooLarge { .. }), "{primitive}: {error}");
    }
    // A huge zero accessor of which only little is used is no problem.
    let i = b.bytes("SCALAR", &[0, 1, 2]);
    let scene = load_primitive(&b, &format!(r#""attributes":{{"POSITION":0}},"indices":{i}"#)).unwrap();
    assert_eq!(scene.triangle_count(), 1);
    // The same data a thousand times over.
    let (indices, many) = (b.bytes("SCALAR", &[0, 1, 2].repeat(20_000)), 1000);
    let primitive = format!(r#"{{"attributes":{{"POSITION":{p}}},"indices":{indices}}}"#);
    let error =
        load_bytes(&b.glb(&format!(r#""meshes":[{{"primitives":[{}]}}]"#, vec![primitive; many].join(","))))
            .unwrap_err();
    assert!(matches!(error, LoadError::TooLarge { .. }), "{error}");
    // Lengths beyond the buffer, and offsets that overflow.
    for view in [
        r#"{"buffer":0,"byteLength":10000000000}"#,
        r#"{"buffer":0,"byteOffset":18446744073709551615,"byteLength":8}"#,
    ] {
        let json = format!(
            r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":8}}],"bufferViews":[{view}],
            "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}}],
            "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}]}}"#
        );
        let error = load_bytes(&glb(&json, &[0; 8])).unwrap_err();
        assert!(matches!(error, LoadError::Truncated { .. }), "{error}");
    }
}

#[test]
fn numbers_that_are_not_finite_are_refused() {
    for bad in [f32::NAN, f32::INFINITY, 1e20] {
        let mut b = Builder::default();
        let p = b.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, bad, 0.0]);
        let error = load_primitive(&b, &format!(r#""attributes":{{"POSITION":{p}}}"#)).unwrap_err();
        assert!(matches!(error, LoadError::NotFinite { .. }), "{error}");
        for word in ["mesh 0", "POSITION", "accessor 0", "element 2"] {
            assert!(error.to_string().contains(word), "{error}");
        }
    }
    // Each scale is fine, their product is not.
    let node = |child: &str| format!(r#"{{"scale":[1e14,1e14,1e14]{child}}}"#);
    let mut b = Builder::default();
    let p = b.floats("VEC3", &TRIANGLE);
    let nodes = [r#","children":[1]"#, r#","children":[2]"#, r#","mesh":0"#].map(node).join(",");
    let error = load_bytes(&b.glb(&format!(
        r#""meshes":[{{"primitives":[{{"attributes":{{"POSITION":{p}}}}}]}}],"nodes":[{nodes}]"#
    )))
    .unwrap_err();
    assert!(matches!(error, LoadError::NotFinite { .. }) && error.to_string().contains("node 2"), "{error}");
}

#[test]
fn deep_hierarchies_do_not_overflow_the_stack() {
    let nodes: Vec<String> = (1..=100_000).map(|i| format!(r#"{{"children":[{i}]}}"#)).collect();
    let json = format!(r#"{{"asset":{{"version":"2.0"}},"nodes":[{},{{}}]}}"#, nodes.join(","));
    let scene = load("deep.gltf", json.as_bytes(), &NoFiles).unwrap();
    assert_eq!(scene.nodes.len(), 100_001);
}

#[test]
fn formats_and_names() {
    let json = br#"{"asset":{"version":"2.0"}}"#;
    assert_eq!(load("folder/my.scene.gltf", json, &NoFiles).unwrap().name, "my.scene");
    assert_eq!(load("noname", json, &NoFiles).unwrap().name, "noname");
    assert!(matches!(load("a.fbx", json, &NoFiles), Err(LoadError::UnknownFormat { .. })));
    assert!(matches!(load("a.glb", b"", &NoFiles), Err(LoadError::Empty { .. })));
    assert!(matches!(load("a.gltf", b"{\"asset\":\"\xff\"}", &NoFiles), Err(LoadError::Json { .. })));
    let external = br#"{"asset":{"version":"2.0"},"buffers":[{"byteLength":1,"uri":"b.bin"}],
        "bufferViews":[{"buffer":0,"byteLength":1}],"skins":[{"joints":[0],"inverseBindMatrices":0}],"nodes":[{}],
        "accessors":[{"bufferView":0,"componentType":5126,"count":1,"type":"MAT4"}]}"#;
    let error = load("a.gltf", external, &NoFiles).unwrap_err();
    assert!(matches!(error, LoadError::Read { .. }) && error.to_string().contains("b.bin"), "{error}");
}

#[test]
fn valid_json_that_the_typed_document_refuses_is_mended() {
    let scene = loaded(&glb(
        r#"{"asset":{"version":"2.0"},"scene":1.0,"scenes":[{},{"nodes":[1e0]}],"nodes":[{},{"camera":0.0}],
        "cameras":[{"type":"perspective","perspective":{"yfov":1.5,"znear":1}}],
        "animations":[{"samplers":[],"channels":[{"sampler":0,"target":{"path":"pointer"}}]}]}"#,
        &[],
    ));
    assert_eq!(scene.nodes[1].camera, Some(0));
    assert_eq!(scene.warnings.len(), 1, "{:?}", scene.warnings);
    // An error beside it is the one that is told.
    let error = load_bytes(&glb(r#"{"asset":{"version":"2.0"},"scene":0.0,"nodes":[{"mesh":"x"}]}"#, &[]))
        .unwrap_err();
    assert!(
        matches!(error, LoadError::Schema { .. }) && error.to_string().contains("nodes[0].mesh"),
        "{error}"
    );
    // Of another version, whose document looks different.
    let error = load("a.gltf", br#"{"asset":{"version":"1.0"},"meshes":{}}"#, &NoFiles).unwrap_err();
    assert!(matches!(error, LoadError::Version { .. }), "{error}");
}

/// Remembers what it was asked for.
struct Asked(std::cell::RefCell<Vec<String>>);

impl Files for Asked {
    fn read(&self, uri: &str, _limit_bytes: u64) -> std::io::Result<Vec<u8>> {
        self.0.borrow_mut().push(uri.to_owned());
        Ok(vec![0; 4])
    }
}

#[test]
fn only_clean_paths_are_read() {
    let uris =
        ["a%20b.bin", "./sub/../a%20b.bin", "../x.bin", "%2e%2e/x.bin", "/etc/passwd", "http://x/y", "c:/x"];
    let buffers: Vec<String> =
        uris.iter().map(|uri| format!(r#"{{"byteLength":4,"uri":"{uri}"}}"#)).collect();
    let json = format!(r#"{{"asset":{{"version":"2.0"}},"buffers":[{}]}}"#, buffers.join(","));
    let files = Asked(std::cell::RefCell::default());
    let scene = load("a.gltf", json.as_bytes(), &files).unwrap();
    assert_eq!(files.0.into_inner(), ["a b.bin"], "one file, read once");
    assert_eq!(scene.warnings.len(), 5, "{:?}", scene.warnings);
}
