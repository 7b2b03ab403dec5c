//! OBJ and MTL files made up for one feature each.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod common;

use std::collections::BTreeMap;

use common::use_scene;
use dapple_scene::glam::{Vec2, Vec3};
use dapple_scene::{AlphaMode, Files, LoadError, NoFiles, Scene, load};

struct Memory(BTreeMap<&'static str, Vec<u8>>);

impl Files for Memory {
    fn read(&self, uri: &str, _limit_bytes: u64) -> std::io::Result<Vec<u8>> {
        self.0.get(uri).cloned().ok_or_else(|| std::io::Error::other("absent"))
    }
}

fn loaded(text: &str, files: &dyn Files) -> Scene {
    let scene = load("thing.obj", text.as_bytes(), files).unwrap_or_else(|error| panic!("{error}"));
    use_scene(&scene, text);
    scene
}

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

#[test]
fn polygons_groups_and_materials() {
    let text = format!(
        "{SQUARE}vt 0.25 0.25\nvn 0 0 1\ng one\nusemtl a\nf 1/1/1 2/1/1 3/1/1 4/1/1\nusemtl b\nf -4//-1 -3//-1 \\\n -2//-1\n\
         g two\nusemtl a\nf 1 2 3\ng one\nf 1 3 4\nl 1 2\n"
    );
    let scene = loaded(&text, &NoFiles);
    assert_eq!(scene.name, "thing");
    let names: Vec<&str> = scene.meshes.iter().map(|mesh| mesh.name.as_str()).collect();
    assert_eq!(names, ["one", "two"]);
    assert_eq!(scene.triangle_count(), 5);
    let parts: Vec<_> =
        scene.meshes[0].parts.iter().map(|part| (part.triangle_count, part.material)).collect();
    assert_eq!(parts, [(3, 0), (1, 1)]);
    assert_eq!(scene.materials.iter().map(|m| m.name.as_str()).collect::<Vec<_>>(), ["a", "b"]);
    assert!(scene.materials.iter().all(|material| material.double_sided));
    assert_eq!(scene.meshes[0].uvs[0][0], Vec2::new(0.25, 0.75));
    assert!(scene.meshes[1].normals.iter().all(|n| *n == Vec3::Z));
    assert!(scene.warnings.iter().any(|w| w.message.contains("lines")), "{:?}", scene.warnings);
}

#[test]
fn objects_win_over_groups() {
    let scene = loaded(&format!("{SQUARE}o whole\ng a\nf 1 2 3\ng b\nf 1 3 4\n"), &NoFiles);
    assert_eq!(scene.meshes.len(), 1);
    assert_eq!(scene.meshes[0].name, "whole");
}

#[test]
fn faces_of_different_kinds_stay_apart() {
    let text = format!(
        "{SQUARE}v 2 0 0 1 0.5 0\nvt 0.5 0\nvn 0 0 -1\nf 1/1 2/1 3/1\nf 1//1 3//1 4//1\nf 2 5 3/1\nf 1/1 2/1 3/1\n"
    );
    let scene = loaded(&text, &NoFiles);
    let mesh = &scene.meshes[0];
    assert_eq!((mesh.parts.len(), mesh.triangles.len()), (1, 4));
    let corner = |t: usize, k: usize| mesh.triangles[t][k] as usize;
    // In the order of the file: with texture coordinates, with normals, with neither, with texture coordinates again.
    for (t, uv, normal) in [(0, 0.5, 1.0), (1, 0.0, -1.0), (2, 0.0, 1.0), (3, 0.5, 1.0)] {
        for k in 0..3 {
            assert_eq!((mesh.uvs[0][corner(t, k)].x, mesh.normals[corner(t, k)].z), (uv, normal), "{t} {k}");
        }
    }
    assert_eq!(mesh.colors[corner(2, 1)].to_array(), [1.0, 0.5, 0.0, 1.0]);
    assert_eq!(mesh.colors[corner(0, 1)].to_array(), [1.0; 4], "vertices without a color are white");
}

#[test]
fn material_libraries() {
    let mtl = "newmtl red # comment\nKd 1 0 0\nKe 2 3 4\nd 0.5\nnewmtl leaf\nKd 0 0 0\nmap_Kd -s 1 1 1 my leaf.png\n\
               map_d mask.png\nmap_Ke gone.png\nKe oops\n";
    let png = |texels: &[u8]| {
        let mut bytes = Vec::new();
        let image = image::RgbaImage::from_raw(2, 1, texels.to_vec()).unwrap();
        image.write_to(&mut std::io::Cursor::new(&mut bytes), image::ImageFormat::Png).unwrap();
        bytes
    };
    let files = Memory(BTreeMap::from([
        ("lib.mtl", mtl.into()),
        ("my leaf.png", png(&[9, 8, 7, 255, 6, 5, 4, 255])),
        ("mask.png", png(&[0, 0, 0, 255, 255, 255, 255, 255])),
    ]));
    let scene =
        loaded(&format!("mtllib lib.mtl\n{SQUARE}usemtl leaf\nf 1 2 3\nusemtl red\nf 1 3 4\n"), &files);
    let [leaf, red] = &scene.materials[..] else { panic!("{:?}", scene.materials) };
    assert_eq!(red.base_color_factor.to_array(), [1.0, 0.0, 0.0, 0.5]);
    assert_eq!((red.emissive_factor, red.alpha_mode), (Vec3::new(2.0, 3.0, 4.0), AlphaMode::Blend));
    assert_eq!(leaf.alpha_mode, AlphaMode::Mask { cutoff: 0.5 });
    assert_eq!(leaf.base_color_factor.to_array(), [1.0; 4], "black beside a texture means the texture alone");
    let texture = scene.textures[leaf.base_color_texture.unwrap().texture as usize];
    assert_eq!(scene.images[texture.image as usize].rgba8, [[9, 8, 7, 0], [6, 5, 4, 255]]);
    let warned = |word: &str| scene.warnings.iter().any(|warning| warning.message.contains(word));
    assert!(warned("gone.png") && warned("1 lines of the material library"), "{:?}", scene.warnings);
}

#[test]
fn a_missing_library_is_a_warning() {
    let scene = loaded(&format!("mtllib no.mtl\n{SQUARE}usemtl x\nf 1 2 3\n"), &NoFiles);
    assert_eq!(scene.materials[0].name, "x");
    assert!(scene.warnings.iter().any(|warning| warning.message.contains("no.mtl")), "{:?}", scene.warnings);
}

#[test]
fn flaws_are_named_with_their_line() {
    for (text, word) in [
        ("v 0 0\n", "line 1"),
        ("v 0 0 x\n", "'x' is not a number"),
        ("v 0 0 nan\n", "not a finite number"),
        ("v 1 1 1e30\n", "line 1"),
        ("v 0 0 0\n\nf 1 2 3\n", "line 3"),
        ("v 0 0 0\nf 1/1 1 1\n", "texture coordinate 1"),
        ("v 0 0 0\nf 0 1 1\n", "vertex 0"),
        ("v 0 0 0\nf -2 1 1\n", "vertex -2"),
        ("v 0 0 0\nf 1 1 9223372036854775808\n", "not a vertex index"),
        ("v 0 0 0\nf 1 1 -9223372036854775808\n", "line 2"),
        ("v 0 0 0\nf 1 1\n", "no faces"),
        ("hello", "no faces"),
    ] {
        let error = load("bad.obj", text.as_bytes(), &NoFiles).unwrap_err();
        assert!(
            error.to_string().contains(word) && error.to_string().contains("bad.obj"),
            "{text:?}: {error}"
        );
    }
    assert!(matches!(load("bad.obj", b"", &NoFiles), Err(LoadError::Empty { .. })));
}

#[test]
fn names_in_other_encodings_are_no_obstacle() {
    let mut text = b"o caf\xe9\n".to_vec();
    text.extend(SQUARE.bytes());
    text.extend(b"f 1 2 3\n");
    let scene = load("thing.obj", &text, &NoFiles).unwrap();
    assert_eq!(scene.meshes[0].name, "caf\u{fffd}");
    assert_eq!(scene.warnings.len(), 1);
}
