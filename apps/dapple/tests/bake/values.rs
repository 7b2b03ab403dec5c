//! Baked values are the traced ones, and everything else stays as it was.

use super::*;

#[test]
fn vertices_under_a_disc_have_the_exact_visibility() {
    let (r, h) = (1.0_f64, 1.0_f64);
    let at = folder(&[("disc.glb", &ground_under_disc(2.0, 40, r as f32, h as f32))]);
    let arguments =
        ["disc.glb", "--into", "vertex", "--attribute", "_OPEN", "--radius", "1000", "-o", "baked.glb"];
    let glb = bake(at.path(), &arguments);
    let exact = h * h / (r * r + h * h);
    let near: Vec<f64> = vertices(&glb, 0, "_OPEN")
        .into_iter()
        .filter(|(p, _)| p.length() < 0.08)
        .map(|(_, visibility)| visibility[0])
        .collect();
    assert!(near.len() >= 5);
    for value in near {
        assert!((value - exact).abs() < 0.01, "{value}, not {exact}");
    }
}

#[test]
fn vertices_beside_a_wall_have_the_exact_visibility_and_bent_normal() {
    let (height, half) = (3.0_f32, 3000.0_f32);
    let mut builder = Builder::default();
    let (ground, ground_indices) = grid(&mut builder, 2.0, 40);
    let wall = builder
        .floats("VEC3", &[[1.0, 0.0, -half], [1.0, 0.0, half], [1.0, height, half], [1.0, height, -half]]);
    let wall_indices = builder.indices(&[0, 1, 2, 0, 2, 3]);
    let scene = builder.glb(&format!(
        r#""nodes":[{{"mesh":0}},{{"mesh":1,"extras":{{"receives":false}}}}],"meshes":[
        {{"primitives":[{{"attributes":{{"POSITION":{ground}}},"indices":{ground_indices}}}]}},
        {{"primitives":[{{"attributes":{{"POSITION":{wall}}},"indices":{wall_indices}}}]}}]"#
    ));
    let at = folder(&[("wall.glb", &scene)]);
    let arguments = ["wall.glb", "--into", "vertex", "--bent-normals", "--radius", "1e6", "-o", "baked.glb"];
    let glb = bake(at.path(), &arguments);
    let (mut errors, mut angles) = (Vec::new(), Vec::new());
    let bent = vertices(&glb, 0, "_BENT_NORMAL");
    for ((p, color), (_, bent)) in vertices(&glb, 0, "COLOR_0").into_iter().zip(bent) {
        let (d, h) = (1.0 - p.x, f64::from(height));
        let exact = 1.0 - 0.5 * (1.0 - d / (d * d + h * h).sqrt());
        errors.push((color[0] - exact).abs());
        assert_eq!((color[1], color[2], color[3]), (color[0], color[0], 1.0));
        // crates/trace/src/rtao/tests.rs has the derivation.
        let angle = libm::atan2(h, d);
        let across = 4.0 / 3.0 / std::f64::consts::PI * 0.5 * libm::sin(angle) * libm::sin(angle);
        let up = 4.0 / 3.0 / std::f64::consts::PI * (0.5 * angle - 0.25 * libm::sin(2.0 * angle));
        let exact = DVec3::new(-across, 2.0 / 3.0 - up, 0.0).normalize();
        angles.push(exact.angle_between(DVec3::new(bent[0], bent[1], bent[2])));
    }
    let worst = |list: &[f64]| list.iter().copied().fold(0.0, f64::max);
    assert!(worst(&errors) < 0.015, "{}", worst(&errors));
    assert!(worst(&angles) < 0.03, "{}", worst(&angles));
    // What receives nothing is left alone.
    assert!(glb.json.pointer("/meshes/1/primitives/0/attributes/COLOR_0").is_none());
}

/// The baked texture where a place of a mesh reads it.
pub(super) fn read(scene: &Scene, instance: usize, triangle: u32, barycentrics: [f32; 2]) -> f32 {
    let mesh = &scene.meshes[scene.instances[instance].mesh as usize];
    let material = &scene.materials[mesh.material_of(triangle) as usize];
    let texture = material.occlusion_texture.expect("an occlusion texture");
    scene.sample(&texture, mesh.uv(texture.uv_set, triangle, barycentrics)).x
}

/// Root mean square difference, and 99th percentile, between the baked textures and rays at random places.
fn texture_errors(scene: &Scene, radius_m: f32, per_triangle: u32) -> (f64, f64) {
    let pose = scene.pose(0.0);
    let tracer = Tracer::new(scene, &pose);
    let (mut sites, mut baked) = (Vec::new(), Vec::new());
    for (index, instance) in scene.instances.iter().enumerate() {
        let mesh = &scene.meshes[instance.mesh as usize];
        let map = pose.instances[index].world_from_mesh;
        for (t, triangle) in (0u32..).zip(&mesh.triangles) {
            let [a, b, c] = triangle.map(|v| map.transform_point3(mesh.positions[v as usize]));
            for k in 0..per_triangle {
                let unit = |d: u32| {
                    dapple_trace::sampling::unit_interval(dapple_trace::sampling::hash(
                        7,
                        u64::from(t * per_triangle + k),
                        d,
                    ))
                };
                let (u, v) = (unit(0), unit(1));
                let weights = if u + v > 1.0 { [1.0 - u, 1.0 - v] } else { [u, v] };
                baked.push(read(scene, index, t, weights));
                sites.push(Site {
                    position_world: a + (b - a) * weights[0] + (c - a) * weights[1],
                    normal_world: (b - a).cross(c - a).normalize_or_zero(),
                    key: sites.len() as u64,
                });
            }
        }
    }
    let mut traced = vec![0.0; sites.len()];
    trace_visibility(&tracer, &sites, &RtaoParams { rays: 1024, radius_m, seed: 9 }, &mut traced);
    let mut errors: Vec<f64> = baked.iter().zip(&traced).map(|(a, b)| f64::from((a - b).abs())).collect();
    errors.sort_by(f64::total_cmp);
    let square: f64 = errors.iter().map(|e| e * e).sum();
    ((square / errors.len() as f64).sqrt(), errors[errors.len() * 99 / 100])
}

#[test]
fn textures_read_at_any_place_give_the_visibility_there() {
    let at = folder(&[("disc.glb", &ground_under_disc(3.0, 8, 0.5, 0.3))]);
    let arguments = ["disc.glb", "--texture-size", "256", "--radius", "2", "-o", "baked.glb"];
    bake(at.path(), &arguments);
    let scene = load_glb(&at.path().join("baked.glb"));
    let (rms, most) = texture_errors(&scene, 2.0, 40);
    assert!(rms < 0.006 && most < 0.02, "{rms} {most}");
}

#[test]
fn seams_read_the_same_on_both_sides() {
    let Some(bunny) = shared("scenes/stanford-bunny/stanford-bunny.obj") else { return };
    let at = folder(&[]);
    let arguments = [bunny.to_str().unwrap(), "--rays", "64", "-o", "baked.glb"];
    bake(at.path(), &[&arguments[..], &["--texture-size", "512"]].concat());
    check_seams(&at.path().join("baked.glb"), 500, 0);
    // As fine on images of half the side: seams from one to another, too.
    let glb = bake(at.path(), &[&arguments[..], &["--texture-size", "256", "--texel", "0.0006"]].concat());
    assert!(glb.count("images") > 2);
    check_seams(&at.path().join("baked.glb"), 500, 50);
}

/// Both sides of so many seams at least read the same, and of so many from image to image.
fn check_seams(file: &Path, least: usize, least_across: usize) {
    let scene = load_glb(file);
    let mesh = &scene.meshes[0];
    // Edges by the places of their ends, with the triangle and where the edge's middle is on it.
    type Ends = Vec<(u32, [f32; 2])>;
    let mut edges: std::collections::BTreeMap<[[u32; 3]; 2], Ends> = Default::default();
    for (t, triangle) in (0u32..).zip(&mesh.triangles) {
        for (k, middle) in [[0.5, 0.0], [0.5, 0.5], [0.0, 0.5]].into_iter().enumerate() {
            let ends = [triangle[k], triangle[(k + 1) % 3]];
            let mut ends = ends.map(|v| mesh.positions[v as usize].to_array().map(f32::to_bits));
            ends.sort();
            edges.entry(ends).or_default().push((t, middle));
        }
    }
    let texture = |t: u32| scene.materials[mesh.material_of(t) as usize].occlusion_texture.unwrap();
    let image = |t: u32| scene.textures[texture(t).texture as usize].image;
    let uv = |(t, middle): (u32, [f32; 2])| mesh.uv(texture(t).uv_set, t, middle);
    let (mut jumps, mut across): (Vec<f32>, Vec<f32>) = Default::default();
    // Where the surface has a crease light may jump.
    let normals = |t: u32| mesh.triangles[t as usize].map(|v| mesh.normals[v as usize]);
    let is_smooth = |a: u32, b: u32| {
        let (a, b) = (normals(a), normals(b));
        a.iter().all(|n| b.iter().all(|m| n.dot(*m) > 0.9))
    };
    for sides in edges.values().filter(|sides| sides.len() == 2 && is_smooth(sides[0].0, sides[1].0)) {
        let jump =
            || (read(&scene, 0, sides[0].0, sides[0].1) - read(&scene, 0, sides[1].0, sides[1].1)).abs();
        if image(sides[0].0) != image(sides[1].0) {
            across.push(jump());
        } else if uv(sides[0]).distance(uv(sides[1])) > 2.0 / 512.0 {
            jumps.push(jump());
        }
    }
    for (jumps, least) in [(&mut jumps, least), (&mut across, least_across)] {
        jumps.sort_by(f32::total_cmp);
        assert!(jumps.len() >= least, "{} edges lie on seams", jumps.len());
        let Some(last) = jumps.len().checked_sub(1) else { continue };
        let (median, most) = (jumps[last / 2], jumps[last * 95 / 100]);
        assert!(median < 0.006 && most < 0.03, "median {median}, 95th percentile {most}");
    }
}

/// A file with something of everything: a folding sheet with extras, extensions nobody knows, a morph target, an
/// attribute of its own, spare nodes and numbers written in odd ways.
pub(super) fn something_of_everything() -> Vec<u8> {
    let sheet = Glb::parse(&folding_sheet());
    let mut json = sheet.json.clone();
    let vertices = sheet.accessor(sheet.whole("/meshes/0/primitives/0/attributes/POSITION"));
    let mut bin = sheet.bin.clone();
    // Interleaved: displacement (VEC3) and a number, 16 bytes a vertex.
    bin.resize(bin.len().next_multiple_of(4), 0);
    let first = bin.len();
    for (i, p) in vertices.iter().enumerate() {
        for x in [0.0, 0.1 * p[0] as f32, 0.0, i as f32 * 0.25] {
            bin.extend(x.to_le_bytes());
        }
    }
    let (views, accessors) = (sheet.count("bufferViews"), sheet.count("accessors"));
    json["bufferViews"].as_array_mut().unwrap().push(serde_json::json!({
        "buffer": 0, "byteOffset": first, "byteLength": bin.len() - first, "byteStride": 16
    }));
    let count = vertices.len();
    json["accessors"].as_array_mut().unwrap().extend([
        serde_json::json!({"bufferView": views, "componentType": 5126, "count": count, "type": "VEC3", "min": [0, -0.1, 0], "max": [0, 0.1, 0]}),
        serde_json::json!({"bufferView": views, "byteOffset": 12, "componentType": 5126, "count": count, "type": "SCALAR"}),
    ]);
    json["buffers"][0]["byteLength"] = bin.len().into();
    let primitive = &mut json["meshes"][0]["primitives"][0];
    primitive["targets"] = serde_json::json!([{"POSITION": accessors}]);
    primitive["attributes"]["_THING"] = (accessors + 1).into();
    primitive["extras"] = serde_json::json!({"of": "a primitive"});
    json["meshes"][0]["extras"] = serde_json::json!({"targetNames": ["bulge"]});
    json["meshes"][0]["weights"] = serde_json::json!([0.5]);
    json["extensionsUsed"] = serde_json::json!(["KHR_lights_punctual"]);
    json["extensions"] = serde_json::json!({"KHR_lights_punctual": {"lights": [{"type": "point"}]}, "X_unknown": {"deep": [1, {"a": null}]}});
    json["nodes"][2]["extensions"] =
        serde_json::json!({"KHR_lights_punctual": {"light": 0}, "X_unknown": true});
    json["nodes"][2]["name"] = "ünïcode".into();
    // As it stands in the file, to the letter.
    let text = json.to_string().replace(
        r#""of":"a primitive""#,
        r#""of" : "a primitive", "odd":[ 1.0e-3 ,12345678901234567890123 ]"#,
    );
    let text = text.replace(r#"{"X_unknown""#, r#"{ "X_unknown""#);
    let pad = |bytes: &[u8], with: u8| {
        let mut padded = bytes.to_vec();
        padded.resize(bytes.len().next_multiple_of(4), with);
        padded
    };
    let (json, bin) = (pad(text.as_bytes(), b' '), pad(&bin, 0));
    let mut file = b"glTF".to_vec();
    file.extend([2u32, (28 + json.len() + bin.len()) as u32].iter().flat_map(|x| x.to_le_bytes()));
    for (kind, data) in [(b"JSON", &json), (b"BIN\0", &bin)] {
        file.extend((data.len() as u32).to_le_bytes());
        file.extend(kind);
        file.extend(data);
    }
    file
}

/// The text of a top-level member of a document.
fn member(text: &str, key: &str) -> String {
    let members: std::collections::BTreeMap<String, Box<serde_json::value::RawValue>> =
        serde_json::from_str(text).unwrap();
    members.get(key).map_or(String::new(), |raw| raw.get().to_owned())
}

#[test]
fn everything_else_is_kept() {
    let before = something_of_everything();
    let at = folder(&[("all.glb", &before)]);
    let before = Glb::parse(&before);
    for uv in ["new", "auto"] {
        let arguments = ["all.glb", "--into", "both", "--bent-normals", "--uv", uv, "-o", "baked.glb"];
        let after = bake(at.path(), &[&arguments[..], &COARSE].concat());
        // To the letter.
        for key in [
            "asset",
            "scene",
            "scenes",
            "nodes",
            "animations",
            "skins",
            "cameras",
            "extensions",
            "extensionsUsed",
        ] {
            assert_eq!(member(&after.text, key), member(&before.text, key), "{key}");
        }
        assert!(after.text.contains(r#"{"of" : "a primitive", "odd":[ 1.0e-3 ,12345678901234567890123 ]}"#));
        assert_eq!(after.json["meshes"][0]["extras"], before.json["meshes"][0]["extras"]);
        assert_eq!(after.json["meshes"][0]["weights"], before.json["meshes"][0]["weights"]);
        // Corner by corner, whatever vertices were split.
        for attribute in ["POSITION", "JOINTS_0", "WEIGHTS_0", "_THING"] {
            let attribute = format!("attributes/{attribute}");
            assert_eq!(
                after.at_corners(0, 0, &attribute),
                before.at_corners(0, 0, &attribute),
                "{attribute}"
            );
        }
        assert_eq!(
            after.at_corners(0, 0, "targets/0/POSITION"),
            before.at_corners(0, 0, "targets/0/POSITION")
        );
        for attribute in ["COLOR_0", "_BENT_NORMAL", "TEXCOORD_0"] {
            assert!(after.json.pointer(&format!("/meshes/0/primitives/0/attributes/{attribute}")).is_some());
        }
        same_scene_when_posed(&at.path().join("all.glb"), &at.path().join("baked.glb"));
    }
}

/// Both files load, and their triangles lie at the same places at several times.
pub(super) fn same_scene_when_posed(before: &Path, after: &Path) {
    let at = before.display();
    let [before, after] = [before, after].map(|path| {
        let folder = Beside(path.parent().unwrap().to_owned());
        load(path.file_name().unwrap().to_str().unwrap(), &std::fs::read(path).unwrap(), &folder).unwrap()
    });
    let soup = |scene: &Scene, time: f64| -> Vec<[Vec3; 3]> {
        let pose = scene.pose(time);
        let instances = 0..scene.instances.len();
        let of = |i: usize| {
            let map = pose.instances[i].world_from_mesh;
            let positions = scene.vertex_positions(&pose, i).to_vec();
            let mesh = &scene.meshes[scene.instances[i].mesh as usize];
            let triangles: Vec<_> = mesh
                .triangles
                .iter()
                .map(|t| t.map(|v| map.transform_point3(positions[v as usize])))
                .collect();
            triangles
        };
        instances.flat_map(of).collect()
    };
    for time in [0.0, 0.3, 1.5] {
        let [mut before, mut after] = [soup(&before, time), soup(&after, time)];
        // What lies on several images comes image by image.
        let bits = |t: &[Vec3; 3]| t.map(|p| p.to_array().map(f32::to_bits));
        before.sort_by_key(bits);
        after.sort_by_key(bits);
        assert!(before == after, "{at} at {time} s");
    }
    assert_eq!(before.animations.len(), after.animations.len());
    assert_eq!(before.skins.len(), after.skins.len());
}

struct Beside(std::path::PathBuf);

impl Files for Beside {
    fn read(&self, uri: &str, _limit_bytes: u64) -> std::io::Result<Vec<u8>> {
        std::fs::read(self.0.join(uri))
    }
}

#[test]
fn scenes_by_others_are_the_same_after_a_bake() {
    for scene in [
        "godot-room/room.glb",
        "anim-Fox/Fox.glb",
        "anim-CesiumMilkTruck/CesiumMilkTruck.glb",
        "anim-MorphStressTest/morph-stress-test.glb",
        "house-alphamask/house.glb",
        "webxr-garage/garage.gltf",
        "asset-generator-skin/Animation_Skin_00.gltf",
    ] {
        let Some(path) = shared(&format!("scenes/{scene}")) else { continue };
        let at = folder(&[]);
        let arguments =
            [path.to_str().unwrap(), "--into", "both", "--uv", "new", "--radius", "auto", "-o", "baked.glb"];
        bake(at.path(), &[&arguments[..], &COARSE].concat());
        same_scene_when_posed(&path, &at.path().join("baked.glb"));
    }
}
