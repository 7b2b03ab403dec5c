//! Whatever bytes come: a scene that can be used, or an error. Never a panic.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod common;

use common::{Builder, use_scene};
use dapple_scene::{Files, NoFiles, load};
use proptest::prelude::*;

/// A small file that uses nearly everything the loader reads.
fn everything() -> Vec<u8> {
    let mut b = Builder::default();
    let p = b.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.5]);
    let n = b.floats("VEC3", &[0.0, 0.0, 1.0].repeat(4));
    let t = b.floats("VEC4", &[1.0, 0.0, 0.0, 1.0].repeat(4));
    let uv = b.floats("VEC2", &[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 1.0]);
    let j = b.bytes("VEC4", &[0, 1, 0, 0].repeat(4));
    let w = b.floats("VEC4", &[0.5, 0.5, 0.0, 0.0].repeat(4));
    let i = b.bytes("SCALAR", &[0, 1, 2, 2, 1, 3]);
    let times = b.floats("SCALAR", &[0.0, 0.5, 1.0]);
    let moves = b.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 0.0, 0.0, 0.0]);
    let turns = b.floats("VEC4", &[0.0, 0.0, 0.0, 1.0].repeat(9));
    let weights = b.floats("SCALAR", &[0.0, 1.0, 0.0]);
    let sparse_indices = b.view(&[1, 3], "");
    let sparse_values = b.view(&[0_u8; 24], "");
    let sparse = b.accessor(format!(
        r#"{{"componentType":5126,"count":4,"type":"VEC3","sparse":{{"count":2,
        "indices":{{"bufferView":{sparse_indices},"componentType":5121}},"values":{{"bufferView":{sparse_values}}}}}}}"#
    ));
    let mut png = Vec::new();
    let image = image::RgbImage::from_raw(2, 2, vec![100; 12]).unwrap();
    image.write_to(&mut std::io::Cursor::new(&mut png), image::ImageFormat::Png).unwrap();
    let png = b.view(&png, "");
    b.glb(&format!(
        r#""scene":0,"scenes":[{{"nodes":[0,3]}}],"extensionsUsed":["KHR_lights_punctual"],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":{p},"NORMAL":{n},"TANGENT":{t},"TEXCOORD_0":{uv},
            "COLOR_0":{n},"JOINTS_0":{j},"WEIGHTS_0":{w}}},"indices":{i},"material":0,
            "targets":[{{"POSITION":{sparse}}}]}},{{"attributes":{{"POSITION":{p}}},"mode":5}}],"weights":[0.5]}}],
        "nodes":[{{"children":[1,2]}},{{"mesh":0,"skin":0}},{{"translation":[1,0,0],"children":[4]}},
            {{"mesh":0,"extensions":{{"KHR_lights_punctual":{{"light":0}}}}}},{{"camera":0,"matrix":[1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1]}}],
        "skins":[{{"joints":[0,2]}}],"cameras":[{{"type":"perspective","perspective":{{"yfov":1,"znear":0.1}}}}],
        "extensions":{{"KHR_lights_punctual":{{"lights":[{{"type":"spot","intensity":3}}]}}}},
        "materials":[{{"pbrMetallicRoughness":{{"baseColorTexture":{{"index":0}}}},"alphaMode":"MASK"}}],
        "textures":[{{"source":0,"sampler":0}}],"samplers":[{{}}],"images":[{{"bufferView":{png}}}],
        "animations":[{{"samplers":[{{"input":{times},"output":{moves}}},
            {{"input":{times},"output":{turns},"interpolation":"CUBICSPLINE"}},{{"input":{times},"output":{weights}}}],
            "channels":[{{"sampler":0,"target":{{"node":2,"path":"translation"}}}},
            {{"sampler":1,"target":{{"node":0,"path":"rotation"}}}},{{"sampler":2,"target":{{"node":3,"path":"weights"}}}}]}}]"#
    ))
}

/// The same bytes for every file.
struct Same<'a>(&'a [u8]);

impl Files for Same<'_> {
    fn read(&self, _uri: &str, _limit_bytes: u64) -> std::io::Result<Vec<u8>> {
        Ok(self.0.to_vec())
    }
}

fn survive(name: &str, bytes: &[u8]) {
    if let Ok(scene) = load(name, bytes, &NoFiles) {
        use_scene(&scene, name);
    }
}

#[test]
fn the_whole_file_loads() {
    let scene = load("all.glb", &everything(), &NoFiles).unwrap_or_else(|error| panic!("{error}"));
    use_scene(&scene, "all.glb");
    // Its second primitive has no morph targets.
    assert_eq!(scene.warnings.len(), 1, "{:?}", scene.warnings);
    assert_eq!(scene.triangle_count(), 8);
    assert_eq!(scene.animations[0].channels.len(), 3);
    assert!(scene.instances[0].skin.is_some());
}

#[test]
fn every_truncation() {
    let whole = everything();
    for length in 0..whole.len() {
        survive("cut.glb", &whole[..length]);
    }
    // Cut inside, with a header that says so.
    for length in (12..whole.len()).step_by(7) {
        let mut cut = whole[..length].to_vec();
        cut[8..12].copy_from_slice(&(length as u32).to_le_bytes());
        survive("cut.glb", &cut);
    }
}

#[test]
fn every_byte_changed() {
    let whole = everything();
    for i in 0..whole.len() {
        for change in [0x01, 0x80, 0xFF] {
            let mut changed = whole.clone();
            changed[i] ^= change;
            survive("changed.glb", &changed);
        }
    }
}

#[test]
fn every_number_in_the_json_changed() {
    let whole = everything();
    let json_length = u32::from_le_bytes(whole[12..16].try_into().unwrap()) as usize;
    let json = std::str::from_utf8(&whole[20..20 + json_length]).unwrap();
    let bin = &whole[28 + json_length..];
    let digits: Vec<usize> = json.match_indices(|c: char| c.is_ascii_digit()).map(|(i, _)| i).collect();
    for at in digits {
        for number in ["0", "7", "-1", "4294967295", "1e9", "1.5", "1e300", "null", "[]", "\"x\"", "{}"] {
            let changed = format!("{}{number}{}", &json[..at], &json[at + 1..]);
            survive("changed.glb", &common::glb(&changed, bin));
        }
    }
}

/// Text that makes the OBJ library itself panic or fail where it is not checked before.
#[test]
fn obj_text_that_the_library_cannot_take() {
    const VERTICES: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\n";
    for faces in [
        "f 1/-2/1 2/-2/1 3/-2/1",
        "f 1/9223372036854775807 2/1 3/1",
        "f 1//-2 2//-2 3//-2",
        "f 1/1/1/1 2/1/1/1 3/1/1/1",
        "f",
        "f 0 0 0",
        "usemtl\nf 1 2 3",
        "usemtl\tb\nf 1 2 3",
        "g\nf 1 2 3",
        "mtllib\nf 1 2 3",
        "v 1 2 3 0\nf 1 2 4",
        "v 1 2 3 0.5 0.5\nf 1 2 4",
        "v 1 2 3 1 0 0\nf 1 2 4",
        "v 1 2 3 1 0 0 1\nf 1 2 4",
        "vt 1\nf 1/2 2/2 3/2",
        "f 1 2/1 3//1",
    ] {
        survive("x.obj", format!("{VERTICES}{faces}\n").as_bytes());
    }
    let obj = b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n";
    for line in ["Kd 0.25", "Ke 1 0", "Ka", "Ks 1", "d", "Ns x", "illum 999", "newmtl", "map_Kd", "bump"] {
        let mtl = format!("newmtl a\nKd 0.5 0.5 0.5\n{line}\nd 0.5\n");
        let scene = load("x.obj", obj, &Same(mtl.as_bytes())).unwrap_or_else(|error| panic!("{error}"));
        use_scene(&scene, line);
        assert_eq!(scene.materials[0].base_color_factor.w, 0.5, "{line}: one bad line costs only itself");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn arbitrary_bytes(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        for name in ["x.glb", "x.gltf", "x.obj", "x"] {
            survive(name, &bytes);
        }
        let mut with_magic = b"glTF\x02\0\0\0".to_vec();
        with_magic.extend(&bytes);
        survive("x", &with_magic);
    }

    #[test]
    fn obj_like_text(text in "([vf]|vt|vn|g|o|usemtl|mtllib|#|\\\\|\n|[-/. 0-9]| |\n){0,120}") {
        survive("x.obj", text.as_bytes());
    }

    #[test]
    fn mtl_like_text(text in "(newmtl a|newmtl|K[aksde]|d|Tr|P[rm]|N[si]|illum|(map_)?(Kd|Ke|d|Bump|bump)|#|\n|[-. 0-9]{1,4}| |\n){0,60}") {
        let obj = b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n";
        let scene = load("x.obj", obj, &Same(text.as_bytes())).unwrap_or_else(|error| panic!("{error}"));
        use_scene(&scene, &text);
    }

    #[test]
    fn several_bytes_changed(changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..12)) {
        let mut bytes = everything();
        for (at, value) in changes {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        survive("changed.glb", &bytes);
    }
}
