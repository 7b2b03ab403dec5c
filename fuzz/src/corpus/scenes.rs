//! Small scene files that have one of each thing a scene can hold.

/// A picture of 2 × 2 pixels as PNG, one of them half transparent.
const PNG: [u8; 77] = [
    137, 80, 78, 71, 13, 10, 26, 10, 0, 0, 0, 13, 73, 72, 68, 82, 0, 0, 0, 2, 0, 0, 0, 2, 8, 6, 0, 0, 0, 114,
    182, 13, 36, 0, 0, 0, 20, 73, 68, 65, 84, 120, 218, 99, 248, 207, 192, 240, 31, 8, 109, 24, 128, 52, 24,
    0, 0, 66, 42, 9, 52, 145, 18, 44, 207, 0, 0, 0, 0, 73, 69, 78, 68, 174, 66, 96, 130,
];

/// The nodes and what hangs on them, shared by both glTF seeds. Accessors: 0 indices, 1 positions, 2 normals, 3 uv,
/// 4 colors, 5 joints, 6 weights, 7 displacements, 8 inverse bind matrices, 9 times, 10 rotations, 11 morph weights.
const DOCUMENT: &str = r#"
"extensionsUsed":["KHR_lights_punctual","KHR_materials_unlit","KHR_texture_transform"],
"scene":0,"scenes":[{"nodes":[0,1,3,4,5,6,7]}],
"nodes":[{"mesh":0,"skin":0},{"children":[2]},{"translation":[0,0.5,0]},
{"mesh":1,"translation":[0,-0.2,0],"scale":[2,1,-2],"extras":{"casts":false}},
{"mesh":1,"matrix":[1,0,0,0,0,0,1,0,0,-1,0,0,0,1,-1,1],"weights":[0.25]},
{"camera":0,"translation":[0,0.5,3]},{"camera":1,"translation":[0,0.5,2]},
{"extensions":{"KHR_lights_punctual":{"light":0}},"translation":[1,2,1],"children":[8,9]},
{"extensions":{"KHR_lights_punctual":{"light":1}}},{"extensions":{"KHR_lights_punctual":{"light":2}}}],
"cameras":[{"type":"perspective","perspective":{"yfov":0.8,"znear":0.1,"zfar":10}},
{"type":"orthographic","orthographic":{"xmag":1,"ymag":1,"znear":0,"zfar":9}}],
"extensions":{"KHR_lights_punctual":{"lights":[{"type":"point","intensity":9,"range":5},
{"type":"spot","spot":{"outerConeAngle":0.6}},{"type":"directional","color":[1,0.9,0.8]}]}},
"meshes":[{"primitives":[{"indices":0,"material":0,"attributes":{"POSITION":1,"NORMAL":2,"TEXCOORD_0":3,"COLOR_0":4,
"JOINTS_0":5,"WEIGHTS_0":6}}]},
{"weights":[0.5],"primitives":[{"indices":0,"material":1,"mode":5,"attributes":{"POSITION":1,"TEXCOORD_0":3},
"targets":[{"POSITION":7}]},{"material":2,"mode":6,"attributes":{"POSITION":1},"targets":[{"POSITION":7}]}]}],
"skins":[{"joints":[1,2],"inverseBindMatrices":8}],
"animations":[{"channels":[{"sampler":0,"target":{"node":2,"path":"rotation"}},{"sampler":1,"target":{"node":4,"path":"weights"}}],
"samplers":[{"input":9,"output":10},{"input":9,"output":11,"interpolation":"STEP"}]}],
"materials":[{"alphaMode":"MASK","alphaCutoff":0.4,"doubleSided":true,"pbrMetallicRoughness":{"baseColorTexture":{"index":0},
"metallicRoughnessTexture":{"index":0}},"normalTexture":{"index":0,"scale":0.5},"occlusionTexture":{"index":0}},
{"alphaMode":"BLEND","emissiveFactor":[1,0,0],"emissiveTexture":{"index":0,"extensions":{"KHR_texture_transform":{"scale":[2,2]}}}},
{"extensions":{"KHR_materials_unlit":{}}}],
"samplers":[{"magFilter":9728,"wrapS":33071,"wrapT":33648}],"textures":[{"source":0,"sampler":0}],
"images":[{"bufferView":12,"mimeType":"image/png"}],"#;

/// The buffer of [`DOCUMENT`], and its views and accessors as JSON.
fn buffer() -> (Vec<u8>, String) {
    let floats = |values: &[f32]| values.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    let identity = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    let mut lowered = identity;
    lowered[13] = -0.5;
    let lists: [(u32, &str, u32, Vec<u8>); 12] = [
        (5121, "SCALAR", 6, vec![0, 1, 2, 0, 2, 3]),
        (5126, "VEC3", 4, floats(&[-0.5, 0.0, 0.0, 0.5, 0.0, 0.0, 0.5, 1.0, 0.0, -0.5, 1.0, 0.0])),
        (5126, "VEC3", 4, floats(&[0.0, 0.0, 1.0].repeat(4))),
        (5126, "VEC2", 4, floats(&[0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0])),
        (5121, "VEC4", 4, [255, 128, 64, 255].repeat(4)),
        (5121, "VEC4", 4, [0, 1, 0, 0].repeat(4)),
        (5126, "VEC4", 4, floats(&[[1.0, 0.0, 0.0, 0.0], [0.5, 0.5, 0.0, 0.0]].concat().repeat(2))),
        (5126, "VEC3", 4, floats(&[0.0, 0.0, 0.3, 0.0, 0.0, -0.3].repeat(2))),
        (5126, "MAT4", 2, floats(&[identity, lowered].concat())),
        (5126, "SCALAR", 2, floats(&[0.0, 1.0])),
        (5126, "VEC4", 2, floats(&[0.0, 0.0, 0.0, 1.0, 0.6, 0.0, 0.0, 0.8])),
        (5126, "SCALAR", 2, floats(&[0.0, 1.0])),
    ];
    let (mut bytes, mut views, mut accessors) = (Vec::new(), Vec::new(), Vec::new());
    let mut view = |data: &[u8]| {
        bytes.resize(bytes.len().next_multiple_of(4), 0u8);
        views.push(format!(r#"{{"buffer":0,"byteOffset":{},"byteLength":{}}}"#, bytes.len(), data.len()));
        bytes.extend(data);
    };
    for (index, (component, kind, count, data)) in lists.iter().enumerate() {
        view(data);
        let normalized = if index == 4 { r#","normalized":true"# } else { "" };
        let range = match index {
            1 => r#","min":[-0.5,0,0],"max":[0.5,1,0]"#,
            9 => r#","min":[0],"max":[1]"#,
            _ => "",
        };
        accessors.push(format!(
            r#"{{"bufferView":{index},"componentType":{component},"count":{count},"type":"{kind}"{normalized}{range}}}"#
        ));
    }
    view(&PNG);
    let json = format!(r#""bufferViews":[{}],"accessors":[{}]"#, views.join(","), accessors.join(","));
    (bytes, json)
}

/// Everything in one container.
pub(super) fn glb() -> Vec<u8> {
    let (mut bytes, lists) = buffer();
    let length = bytes.len();
    let mut json =
        format!(r#"{{"asset":{{"version":"2.0"}},{DOCUMENT}{lists},"buffers":[{{"byteLength":{length}}}]}}"#);
    while json.len() % 4 != 0 {
        json.push(' ');
    }
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    let total = 12 + 8 + json.len() + 8 + bytes.len();
    let word = |n: usize| (n as u32).to_le_bytes();
    let head = [&b"glTF"[..], &word(2), &word(total)].concat();
    [&head[..], &word(json.len()), b"JSON", json.as_bytes(), &word(bytes.len()), b"BIN\0", &bytes].concat()
}

/// The same as text, its buffer embedded.
pub(super) fn gltf() -> Vec<u8> {
    let (bytes, lists) = buffer();
    let (length, data) = (bytes.len(), base64(&bytes));
    let buffers = format!(
        r#""buffers":[{{"byteLength":{length},"uri":"data:application/octet-stream;base64,{data}"}}]"#
    );
    format!(r#"{{"asset":{{"version":"2.0"}},{DOCUMENT}{lists},{buffers}}}"#).into_bytes()
}

/// Faces of all kinds of corners, and materials that are nowhere.
pub(super) fn obj() -> Vec<u8> {
    b"# a corner\nmtllib absent.mtl\no floor\nv -1 0 -1\nv 1 0 -1 0.5 0.5 0.5\nv 1 0 1\nv -1 0 1\nvt 0 0\nvt 1 1 0\nvn 0 1 0\n\
      usemtl stone\ns off\nf 4/1/1 3/2/1 2/1/1 1/2/1\ng wall low\nv -1 1 -1\nv 1 1e0 -1.0\nf -2//1 1//1 2//1\nf 6 5 2 # half\n\
      usemtl brick\ns 1\nf -1/-1 -5/-2 -2/-1\nl 1 2 3\np 1\n"
        .to_vec()
}

fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::new();
    for chunk in bytes.chunks(3) {
        let at = |i: usize| u32::from(chunk.get(i).copied().unwrap_or(0));
        let bits = at(0) << 16 | at(1) << 8 | at(2);
        for i in 0..4 {
            let digit = DIGITS[(bits >> (18 - 6 * i) & 63) as usize] as char;
            text.push(if i <= chunk.len() { digit } else { '=' });
        }
    }
    text
}
