//! What can be chosen, what comes in and what goes out.

use super::values::{read, same_scene_when_posed};
use super::*;

/// Two squares that are one mesh, the second under a lid.
pub(super) fn one_of_two_under_a_lid() -> Vec<u8> {
    let mut builder = Builder::default();
    let (square, square_indices) = grid(&mut builder, 1.0, 4);
    let (lid, lid_indices) = disc(&mut builder, 0.7, 0.2);
    builder.glb(&format!(
        r#""scenes":[{{"nodes":[0,1,2,3]}},{{"nodes":[4]}}],"scene":0,"nodes":[
        {{"mesh":0,"name":"open"}},{{"mesh":0,"name":"dark","translation":[5,0,0]}},
        {{"mesh":1,"translation":[5,0,0]}},{{"mesh":0,"translation":[-5,0,0],"rotation":[0,1,0,0]}},
        {{"mesh":1,"name":"elsewhere"}}],"meshes":[
        {{"name":"square","primitives":[{{"attributes":{{"POSITION":{square}}},"indices":{square_indices},"material":0}}]}},
        {{"primitives":[{{"attributes":{{"POSITION":{lid}}},"indices":{lid_indices},"material":0}}]}}],
        "materials":[{{"name":"plain","pbrMetallicRoughness":{{"baseColorFactor":[0.5,0.25,0.125,1]}}}}]"#
    ))
}

#[test]
fn instances_that_differ_get_meshes_of_their_own() {
    let at = folder(&[("two.glb", &one_of_two_under_a_lid())]);
    let mean = |glb: &Glb, mesh: usize| {
        let values = vertices(glb, mesh, "COLOR_0");
        values.iter().map(|(_, color)| color[0]).sum::<f64>() / values.len() as f64
    };
    let arguments = ["two.glb", "--into", "vertex", "--radius", "5", "-o", "baked.glb"];
    let glb = bake(at.path(), &arguments);
    let mesh_of = |glb: &Glb, node: usize| glb.whole(&format!("/nodes/{node}/mesh"));
    // The open ones share a mesh, though one is turned; the dark one has a copy with the same name and geometry.
    let [open, dark, turned] = [0, 1, 3].map(|node| mesh_of(&glb, node));
    assert_eq!((open, turned), (0, 0));
    assert!(dark != 0 && glb.json["meshes"][dark]["name"] == "square");
    assert!(mean(&glb, open) > 0.98 && mean(&glb, dark) < 0.5, "{} {}", mean(&glb, open), mean(&glb, dark));
    let primitive = |mesh: usize| glb.json.pointer(&format!("/meshes/{mesh}/primitives/0")).unwrap().clone();
    assert_eq!(primitive(open)["indices"], primitive(dark)["indices"], "what is equal is stored once");
    assert_eq!(primitive(open)["attributes"]["POSITION"], primitive(dark)["attributes"]["POSITION"]);
    // The lid of another scene keeps its mesh as it was; the one that is baked is a copy.
    let [lid, elsewhere] = [2, 4].map(|node| mesh_of(&glb, node));
    assert_eq!(elsewhere, 1);
    assert!(lid != 1 && glb.json.pointer("/meshes/1/primitives/0/attributes/COLOR_0").is_none());

    let glb = bake(at.path(), &[&arguments[..], &["--instances", "share"]].concat());
    let nodes = [0, 1, 3].map(|node| mesh_of(&glb, node));
    assert_eq!(nodes, [0, 0, 0]);
    assert!((0.55..0.9).contains(&mean(&glb, 0)), "{}", mean(&glb, 0));

    // The same with textures: places of their own on one image.
    let glb = bake(at.path(), &["two.glb", "--radius", "5", "--texture-size", "256", "-o", "baked.glb"]);
    assert_eq!((glb.count("images"), glb.count("textures")), (1, 1));
    let scene = load_glb(&at.path().join("baked.glb"));
    let mean_of = |name: &str| {
        let node = scene.nodes.iter().position(|n| n.name == name).unwrap() as u32;
        let index = scene.instances.iter().position(|i| i.node == node).unwrap();
        let triangles = scene.meshes[scene.instances[index].mesh as usize].triangles.len() as u32;
        (0..triangles).map(|t| f64::from(read(&scene, index, t, [0.33, 0.33]))).sum::<f64>()
            / f64::from(triangles)
    };
    assert!(mean_of("open") > 0.98 && mean_of("dark") < 0.5);
    // All wear what they wore; the mesh of the other scene keeps the material as it was.
    assert!(glb.json["materials"][0].get("occlusionTexture").is_none());
    assert_eq!(glb.json["materials"][1]["name"], "plain");
    assert_eq!(
        glb.json["materials"][1]["pbrMetallicRoughness"],
        glb.json["materials"][0]["pbrMetallicRoughness"]
    );
}

#[test]
fn equal_instances_share_a_mesh_however_they_stand() {
    // Rough ground in a corner between walls: half blocked by itself, everywhere differently.
    let mut builder = Builder::default();
    let mut positions: Vec<[f32; 3]> = Vec::new();
    for z in 0..5u8 {
        for x in 0..5u8 {
            let height = f32::from((x * 7 + z * 5 + x * z) % 4) * 0.1;
            positions.push([f32::from(x) * 0.25, height, f32::from(z) * 0.25]);
        }
    }
    let corners = (0..4u16).flat_map(|z| (0..4u16).map(move |x| z * 5 + x));
    let mut indices: Vec<u16> = corners.flat_map(|v| [v, v + 5, v + 6, v, v + 6, v + 1]).collect();
    positions.extend([
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 0.8, 0.0],
        [0.0, 0.8, 0.0],
        [0.0, 0.0, 1.0],
        [0.0, 0.8, 1.0],
    ]);
    indices.extend([25, 26, 27, 25, 27, 28, 25, 28, 29, 28, 30, 29]);
    let (positions, indices) = (builder.floats("VEC3", &positions), builder.indices(&indices));
    let (lid, lid_indices) = disc(&mut builder, 0.7, 0.6);
    let scene = |nodes: &str| {
        let mut nodes = nodes.to_owned();
        nodes.push_str(r#",{"mesh":1,"translation":[-299.5,0,0.5]}"#);
        format!(
            r#""nodes":[{nodes}],"meshes":[
            {{"primitives":[{{"attributes":{{"POSITION":{positions}}},"indices":{indices}}}]}},
            {{"primitives":[{{"attributes":{{"POSITION":{lid}}},"indices":{lid_indices}}}]}}]"#
        )
    };
    let file = builder.glb(&scene(
        r#"{"mesh":0},{"mesh":0,"translation":[300,2,7]},
        {"mesh":0,"translation":[0,0,300],"rotation":[0.1,0.7,0.2,0.67823]},
        {"mesh":0,"translation":[0,0,-300],"rotation":[-0.5,0.5,0.5,0.5]},
        {"mesh":0,"translation":[0,90,0],"scale":[-1,1,1]},
        {"mesh":0,"translation":[-300,0,0]}"#,
    ));
    let at = folder(&[("corners.glb", &file)]);
    for into in ["vertex", "texture"] {
        let arguments = ["corners.glb", "--into", into, "--radius", "1", "-o", "baked.glb"];
        let glb = bake(at.path(), &[&arguments[..], &COARSE].concat());
        let meshes: Vec<usize> = (0..6).map(|node| glb.whole(&format!("/nodes/{node}/mesh"))).collect();
        assert_eq!(meshes[..5], [0; 5], "{into}: turned, moved and mirrored ones share");
        assert_ne!(meshes[5], 0, "{into}: the one under the disc does not");
    }
}

/// Two quads side by side with texture coordinates; the second is laid at `second`.
fn quads_with_coordinates(second: [f32; 2]) -> Vec<u8> {
    let mut builder = Builder::default();
    let quad = |x: f32| [[x, 0.0, 0.0], [x, 0.0, 1.0], [x + 1.0, 0.0, 1.0], [x + 1.0, 0.0, 0.0]];
    let positions = builder.floats("VEC3", &[quad(0.0), quad(3.0)].concat());
    let [u, v] = second;
    let uvs = [
        [0.1, 0.1],
        [0.1, 0.4],
        [0.4, 0.4],
        [0.4, 0.1],
        [u, v],
        [u, v + 0.3],
        [u + 0.3, v + 0.3],
        [u + 0.3, v],
    ];
    let uvs = builder.floats("VEC2", &uvs);
    let indices = builder.indices(&[0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7]);
    builder.glb(&format!(
        r#""nodes":[{{"mesh":0}}],"meshes":[{{"primitives":[{{"attributes":{{"POSITION":{positions},"TEXCOORD_0":{uvs}}},
        "indices":{indices}}}]}}]"#
    ))
}

#[test]
fn coordinates_of_the_file_are_used_where_nothing_overlaps() {
    let set = |glb: &Glb| {
        glb.json.pointer("/materials/0/occlusionTexture/texCoord").map_or(0, |v| v.as_u64().unwrap())
    };
    for (second, uv, expected) in [
        ([0.6, 0.6], "auto", 0),
        ([0.6, 0.6], "0", 0),
        ([0.6, 0.6], "1", 1),
        ([0.6, 0.6], "new", 1),
        // Whole numbers away, as images repeat.
        ([2.6, -0.4], "auto", 0),
        // Over the first, also by a whole number.
        ([0.2, 0.2], "auto", 1),
        ([1.2, 0.2], "0", 1),
        // Across a repetition.
        ([0.9, 0.6], "auto", 1),
    ] {
        let at = folder(&[("quads.glb", &quads_with_coordinates(second))]);
        let glb = bake(at.path(), &[&["quads.glb", "--uv", uv, "-o", "baked.glb"][..], &COARSE].concat());
        assert_eq!(set(&glb), expected, "{second:?} {uv}");
        let before = Glb::read(&at.path().join("quads.glb"));
        if expected == 0 {
            // Nothing but the image was added.
            assert_eq!(
                glb.json["meshes"][0]["primitives"][0]["attributes"],
                before.json["meshes"][0]["primitives"][0]["attributes"]
            );
            assert_eq!(glb.bin[..before.bin.len()], before.bin[..]);
        }
        let scene = load_glb(&at.path().join("baked.glb"));
        assert!((0..4).all(|t| read(&scene, 0, t, [0.3, 0.3]) == 1.0), "nothing is near");
    }
}

#[test]
fn colors_are_multiplied_and_alpha_stays() {
    let mut builder = Builder::default();
    let (square, indices) = grid(&mut builder, 1.0, 2);
    let (lid, lid_indices) = disc(&mut builder, 0.7, 0.2);
    let colors = builder.list(5121, "VEC4", 9, &[[255, 128, 0, 51]; 9].concat(), r#","normalized":true"#);
    let floats = builder.floats("VEC3", &[[0.5, 2.0, 0.0]; 257]);
    let file = builder.glb(&format!(
        r#""nodes":[{{"mesh":0}},{{"mesh":1}}],"meshes":[
        {{"primitives":[{{"attributes":{{"POSITION":{square},"COLOR_0":{colors}}},"indices":{indices}}}]}},
        {{"primitives":[{{"attributes":{{"POSITION":{lid},"COLOR_0":{floats}}},"indices":{lid_indices}}}]}}]"#
    ));
    let at = folder(&[("colors.glb", &file)]);
    let glb = bake(at.path(), &["colors.glb", "--into", "vertex", "--radius", "5", "-o", "baked.glb"]);
    for (_, color) in vertices(&glb, 0, "COLOR_0") {
        let open = color[0];
        assert!(open < 0.7 && open > 0.01, "{color:?}");
        assert!((color[1] - open * 128.0 / 255.0).abs() < 2e-5 && color[2] == 0.0, "{color:?}");
        assert!((color[3] - 0.2).abs() < 2e-5, "{color:?}");
    }
    for (_, color) in vertices(&glb, 1, "COLOR_0") {
        assert!((color[1] - 4.0 * color[0]).abs() < 1e-6 && color[0] <= 0.5 && color[3] == 1.0, "{color:?}");
    }
    // An attribute of one's own leaves them alone.
    let arguments = ["colors.glb", "--into", "vertex", "--attribute", "_VISIBILITY", "-o", "own.glb"];
    let own = bake(at.path(), &arguments);
    assert_eq!(
        own.at_corners(0, 0, "attributes/COLOR_0"),
        Glb::parse(&file).at_corners(0, 0, "attributes/COLOR_0")
    );
    assert!(
        vertices(&own, 0, "_VISIBILITY").iter().all(|(_, v)| v.len() == 1 && (0.0..=1.0).contains(&v[0]))
    );
}

#[test]
fn the_floor_under_a_body_does_not_darken_what_is_beside_it() {
    // A box stands on a floor of one quad a metre; its bottom touches the floor.
    let mut builder = Builder::default();
    let (floor, floor_indices) = grid(&mut builder, 8.0, 8);
    let corner =
        |i: u8| [f32::from(i & 1) * 2.0 - 1.0, f32::from(i >> 1 & 1) * 2.0, f32::from(i >> 2) * 2.0 - 1.0];
    let positions = builder.floats("VEC3", &(0..8).map(corner).collect::<Vec<_>>());
    let faces = [[0u16, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let indices: Vec<u16> = faces.iter().flat_map(|&[a, b, c, d]| [a, b, c, a, c, d]).collect();
    let indices = builder.indices(&indices);
    let file = builder.glb(&format!(
        r#""nodes":[{{"mesh":0}},{{"mesh":1}}],"meshes":[
        {{"primitives":[{{"attributes":{{"POSITION":{floor}}},"indices":{floor_indices},"material":0}}]}},
        {{"primitives":[{{"attributes":{{"POSITION":{positions}}},"indices":{indices},"material":0}}]}}],
        "materials":[{{"doubleSided":true}}]"#
    ));
    let at = folder(&[("box.glb", &file)]);
    let glb = bake(
        at.path(),
        &["box.glb", "--into", "vertex", "--attribute", "_OPEN", "--radius", "0.6", "-o", "baked.glb"],
    );
    for (p, open) in vertices(&glb, 0, "_OPEN") {
        // At the foot of the box half of the near surroundings are hidden, in the mean over a metre much less.
        let beside = p.x.abs().max(p.z.abs());
        if beside >= 0.99 {
            assert!(open[0] > 0.6, "{} at {p}", open[0]);
        }
    }
}

#[test]
fn obj_files_become_glb() {
    let obj = b"mtllib a.mtl\no square\nv -1 0 -1\nv -1 0 1\nv 1 0 1\nv 1 0 -1\nvt 0 0\nvt 0 1\nvt 1 1\nvt 1 0\nusemtl red\nf 1/1 2/2 3/3 4/4\n\
        o lid\nv -1 0.2 -1\nv -1 0.2 1\nv 1 0.2 1\nv 1 0.2 -1\nusemtl bright\nf 5 6 7 8\n";
    let mtl = b"newmtl red\nKd 1 0 0\nmap_Kd red.png\nnewmtl bright\nKe 4 2 1\nd 0.5\n";
    let mut png = Vec::new();
    image::ImageEncoder::write_image(
        image::codecs::png::PngEncoder::new(&mut png),
        &[255, 0, 0, 0, 255, 0],
        2,
        1,
        image::ExtendedColorType::Rgb8,
    )
    .unwrap();
    let at = folder(&[("a.obj", obj), ("a.mtl", mtl), ("red.png", &png)]);
    for into in ["texture", "vertex"] {
        bake(at.path(), &[&["a.obj", "--into", into, "-o", "baked.glb"][..], &COARSE].concat());
        same_scene_when_posed(&at.path().join("a.obj"), &at.path().join("baked.glb"));
        let scene = load_glb(&at.path().join("baked.glb"));
        assert_eq!(scene.materials[1].emissive_factor, Vec3::new(4.0, 2.0, 1.0));
        assert_eq!(scene.materials[1].alpha_mode, dapple_scene::AlphaMode::Blend);
        let texture = scene.materials[0].base_color_texture.unwrap();
        assert_eq!(scene.sample(&texture, Vec2::new(0.25, 0.5)).x, 1.0);
    }
}

#[test]
fn files_beside_a_gltf_are_brought_in() {
    let glb = Glb::parse(&quads_with_coordinates([0.6, 0.6]));
    let mut json = glb.json.clone();
    json["buffers"][0]["uri"] = "data%20of%20it.bin".into();
    json["buffers"][0]["name"] = "bytes".into();
    json["images"] = serde_json::json!([{"uri": "a.png", "extras": 7}]);
    json["textures"] = serde_json::json!([{"source": 0}]);
    json["materials"] = serde_json::json!([{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]);
    json["meshes"][0]["primitives"][0]["material"] = 0.into();
    let mut png = Vec::new();
    let encoder = image::codecs::png::PngEncoder::new(&mut png);
    image::ImageEncoder::write_image(encoder, &[9; 3], 1, 1, image::ExtendedColorType::Rgb8).unwrap();
    let text = json.to_string();
    let at = folder(&[("a.gltf", text.as_bytes()), ("data of it.bin", &glb.bin), ("a.png", &png)]);
    let baked = bake(at.path(), &[&["a.gltf", "-o", "baked.glb"][..], &COARSE].concat());
    assert_eq!(baked.json["buffers"].as_array().unwrap().len(), 1);
    assert!(baked.json["buffers"][0].get("uri").is_none() && baked.json["buffers"][0]["name"] == "bytes");
    assert!(baked.json["images"][0].get("uri").is_none() && baked.json["images"][0]["extras"] == 7);
    assert_eq!(baked.view(baked.whole("/images/0/bufferView")), png);
    same_scene_when_posed(&at.path().join("a.gltf"), &at.path().join("baked.glb"));
    // One file of text, too.
    succeed(at.path(), &[&["bake", "a.gltf", "-o", "baked.gltf"][..], &COARSE].concat());
    same_scene_when_posed(&at.path().join("a.gltf"), &at.path().join("baked.gltf"));
    assert!(!std::fs::read_to_string(at.path().join("baked.gltf")).unwrap().contains("a.png\","));
}

#[test]
fn the_same_bytes_on_any_number_of_threads() {
    let at = folder(&[("two.glb", &one_of_two_under_a_lid())]);
    let arguments = ["two.glb", "--into", "both", "--uv", "new", "--bent-normals", "--texture-size", "128"];
    let read = |threads: &str| {
        let name = format!("{threads}.glb");
        bake(at.path(), &[&arguments[..], &["--threads", threads, "-o", &name]].concat());
        std::fs::read(at.path().join(name)).unwrap()
    };
    let one = read("1");
    assert!(one == read("2") && one == read("3"));
}

#[test]
fn arguments_that_make_no_sense_are_named() {
    let lid = two_squares_under_a_lid("{}", "{}");
    let at = folder(&[("lid.glb", &lid), ("points.obj", b"v 0 0 0\n")]);
    std::fs::create_dir(at.path().join("subfolder.glb")).unwrap();
    let at = at.path();
    fail(at, &["bake", "lid.glb"], &["--output"]);
    fail(at, &["bake", "-o", "x.glb"], &["--builtin"]);
    fail(at, &["bake", "absent.glb", "-o", "x.glb"], &["absent.glb"]);
    fail(at, &["bake", "points.obj", "-o", "x.glb"], &["points.obj"]);
    fail(at, &["bake", "lid.glb", "-o", "x.fbx"], &["x.fbx", ".glb", ".ply", ".dapple"]);
    fail(at, &["bake", "lid.glb", "-o", "x"], &["x", ".glb"]);
    fail(at, &["bake", "lid.glb", "-o", "subfolder.glb"], &["subfolder.glb", "folder"]);
    fail(at, &["bake", "lid.glb", "-o", "lid.glb/x.glb"], &["lid.glb/x.glb"]);
    for (arguments, names) in [
        (&["--rays", "0"][..], &["--rays"][..]),
        (&["--rays", "65537"], &["--rays", "65536"]),
        (&["--radius", "0"], &["--radius", "auto"]),
        (&["--points", "0"], &["--points"]),
        (&["--points=-3"], &["--points"]),
        (&["--time", "inf"], &["--time"]),
        (&["--texture-size", "8"], &["--texture-size"]),
        (&["--texture-size", "20000"], &["--texture-size"]),
        (&["--texel", "0"], &["--texel"]),
        (&["--texel", "nan"], &["--texel"]),
        (&["--margin", "0"], &["--margin"]),
        (&["--margin", "60", "--texture-size", "128"], &["--margin"]),
        (&["--into", "lightmap"], &["lightmap", "texture", "vertex"]),
        (&["--uv", "2"], &["--uv"]),
        (&["--attribute", "COLOR_1"], &["--attribute", "COLOR_0"]),
        (&["--attribute", "_lower"], &["--attribute"]),
        (&["--attribute", "_BENT_NORMAL"], &["--attribute"]),
        (&["--instances", "merge"], &["merge", "split"]),
        (&["--threads", "4000"], &["--threads"]),
        (&["--texel", "1e-9"], &["--texel is", "0.000001 to 10000 m"]),
        (&["--texel", "20000"], &["--texel is 20000", "10000 m"]),
        (&["--texel", "0.00001"], &["--texel 0.00001", "images of 4096x4096", "longer"]),
        (
            &["--texel", "0.001", "--texture-size", "16", "--margin", "1"],
            &["--texel 0.001", "images of 16x16"],
        ),
    ] {
        fail(at, &[&["bake", "lid.glb", "-o", "x.glb"], arguments].concat(), names);
    }
    assert!(!at.join("x.glb").exists());
}

#[test]
fn pieces_that_need_too_many_images_are_refused() {
    // With its margin each square fills an image; their area alone would fill 30.
    let mut builder = Builder::default();
    let square =
        |i: u16| [[0.0, 0.0], [0.0, 0.8], [0.8, 0.8], [0.8, 0.0]].map(|[x, z]| [x + f32::from(i), 0.0, z]);
    let positions: Vec<[f32; 3]> = (0..80u16).flat_map(square).collect();
    let indices: Vec<u16> = (0..80u16).flat_map(|i| [0, 1, 2, 0, 2, 3].map(|k| 4 * i + k)).collect();
    let (positions, indices) = (builder.floats("VEC3", &positions), builder.indices(&indices));
    let file = builder.glb(&format!(
        r#""nodes":[{{"mesh":0}}],"meshes":[{{"primitives":[{{"attributes":{{"POSITION":{positions}}},"indices":{indices}}}]}}]"#
    ));
    let at = folder(&[("squares.glb", &file)]);
    let arguments = ["bake", "squares.glb", "--rays", "4", "--texel", "0.1", "--margin", "2", "-o", "x.glb"];
    let with_side = |side: &'static str| [&arguments[..], &["--texture-size", side]].concat();
    fail(at.path(), &with_side("16"), &["80 images of 16x16", "more than 64", "--texture-size", "--margin"]);
    succeed(at.path(), &with_side("256"));
}

#[test]
fn a_time_chooses_the_pose() {
    let at = folder(&[("sheet.glb", &folding_sheet())]);
    let mean = |arguments: &[&str]| {
        let fixed = ["sheet.glb", "--into", "vertex", "--attribute", "_OPEN", "-o", "baked.glb"];
        let values = vertices(&bake(at.path(), &[&fixed, arguments].concat()), 0, "_OPEN");
        values.iter().map(|(_, v)| v[0]).sum::<f64>() / values.len() as f64
    };
    let rest = mean(&[]);
    assert!(rest > 0.999, "flat at rest: {rest}");
    assert_eq!(mean(&["--time", "0"]), rest);
    let folded = mean(&["--time", "1"]);
    assert!(folded < 0.95, "a corner at 1 s: {folded}");
}

#[test]
fn unlit_materials_and_replaced_textures_are_told() {
    let with = |material: &str| {
        let mut builder = Builder::default();
        let (square, indices) = grid(&mut builder, 1.0, 2);
        let uvs = builder.floats("VEC2", &[[0.5, 0.5]; 9]);
        let file = builder.glb(&format!(
            r#""extensionsUsed":["KHR_materials_unlit","KHR_materials_variants"],"extensions":{{"KHR_materials_variants":{{"variants":[{{"name":"a"}}]}}}},
            "nodes":[{{"mesh":0}}],"meshes":[{{"primitives":[
            {{"attributes":{{"POSITION":{square},"TEXCOORD_0":{uvs}}},"indices":{indices},"material":0,
            "extensions":{{"KHR_materials_variants":{{"mappings":[{{"material":1,"variants":[0]}}]}}}}}}]}}],
            "materials":[{material},{{"name":"variant"}}]"#
        ));
        let at = folder(&[("a.glb", &file)]);
        let arguments = [&["bake", "a.glb", "-o", "baked.glb"][..], &COARSE].concat();
        let output = dapple(at.path(), &arguments).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{said}");
        (Glb::read(&at.path().join("baked.glb")), said)
    };
    let (glb, said) = with(r#"{"extensions":{"KHR_materials_unlit":{}}}"#);
    assert!(said.contains("unlit") && said.contains("--into vertex"), "{said}");
    // What a variant wears reads the image, too.
    assert_eq!(glb.json["materials"][1]["occlusionTexture"], glb.json["materials"][0]["occlusionTexture"]);
    assert_eq!(glb.json["materials"][1]["name"], "variant");
    let (_, said) = with("{}");
    assert!(!said.contains("unlit") && !said.contains("replaced"), "{said}");
}
