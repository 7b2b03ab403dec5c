//! Damaged and unusual files: never a panic, and errors that say what and where.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod common;

use std::path::PathBuf;

use common::{load_path, shared, use_scene};
use dapple_scene::{LoadError, Scene};

/// Files of the glTF validator without errors in its report that are refused all the same, and why.
const REFUSED_THOUGH_VALID: [(&str, &str); 2] = [
    ("asset/min_version_valid.gltf", "demands a reader of glTF 2.1; the loader reads 2.0"),
    ("root/unused_objects.gltf", "its skin and animation read a buffer that has no bytes at all"),
];

fn files(folder: &PathBuf, extensions: &[&str]) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(files(&path, extensions));
        } else if extensions.iter().any(|e| path.extension().is_some_and(|found| found == *e))
            && !path.to_str().unwrap().ends_with(".report.json")
        {
            found.push(path);
        }
    }
    found.sort();
    found
}

#[test]
fn validator_assets() {
    let Some(folder) = shared("malformed/gltf-validator") else { return };
    let (mut with_errors, mut without) = (0, 0);
    for path in files(&folder, &["gltf", "glb"]) {
        let name = path.strip_prefix(&folder).unwrap().to_str().unwrap().to_owned();
        let report = std::fs::read_to_string(format!("{}.report.json", path.display())).unwrap();
        let report: serde_json::Value = serde_json::from_str(&report).unwrap();
        let errors = report["issues"]["numErrors"].as_u64().unwrap();
        let loaded = load_path(&path);
        match &loaded {
            Ok(scene) => {
                eprintln!(
                    "{errors} {name}: {:?}",
                    scene.warnings.iter().map(|w| &w.message).collect::<Vec<_>>()
                );
                use_scene(scene, &name);
            }
            Err(error) => {
                eprintln!("{errors} {name}: ERROR {error}");
                assert!(error.to_string().contains(path.file_name().unwrap().to_str().unwrap()), "{error}");
            }
        }
        if errors > 0 {
            with_errors += 1;
        } else {
            without += 1;
            let refused = REFUSED_THOUGH_VALID.iter().any(|(known, _)| *known == name);
            assert_eq!(loaded.is_err(), refused, "{name}: {:?}", loaded.err().map(|e| e.to_string()));
        }
    }
    assert_eq!((with_errors, without), (141, 57));
}

fn load_shared(path: &str) -> Option<Result<Scene, LoadError>> {
    Some(load_path(&shared("malformed")?.join(path)))
}

/// Asserts that loading fails with an error of one kind whose message contains all of some words.
macro_rules! assert_fails {
    ($path:expr, $kind:pat, $($word:expr),*) => {
        if let Some(loaded) = load_shared($path) {
            let error = loaded.err().unwrap_or_else(|| panic!("{} should not load", $path));
            assert!(matches!(error, $kind), "{}: {error:?}", $path);
            $(assert!(error.to_string().contains($word), "{}: '{error}' without '{}'", $path, $word);)*
        }
    };
}

#[test]
fn known_flaws_are_named() {
    assert_fails!(
        "assimp/RecursiveNodes/RecursiveNodes.gltf",
        LoadError::NodeCycle { .. },
        "node ",
        "RecursiveNodes.gltf"
    );
    assert_fails!(
        "assimp/MissingBin/BoxTextured.gltf",
        LoadError::Read { .. },
        "BoxTextured0.bin",
        "buffer 0"
    );
    assert_fails!(
        "assimp/IndexOutOfRange/IndexOutOfRange.gltf",
        LoadError::OutOfRange { .. },
        "indices",
        "accessor",
        "mesh 0"
    );
    assert_fails!(
        "assimp/SchemaFailures/sceneWrongType.gltf",
        LoadError::Schema { .. },
        "scene",
        "hello",
        "line"
    );
    assert_fails!(
        "assimp/wrongTypes/badArray.gltf",
        LoadError::Schema { .. },
        "meshes[0].primitives",
        "expected a sequence"
    );
    assert_fails!(
        "assimp/wrongTypes/badObject.gltf",
        LoadError::Schema { .. },
        "materials[0].pbr",
        "expected an array"
    );
    assert_fails!(
        "assimp/wrongTypes/badNumber.gltf",
        LoadError::Schema { .. },
        "normalTexture",
        "expected f32"
    );
    assert_fails!("assimp/wrongTypes/badExtension.gltf", LoadError::Schema { .. }, "KHR_texture_transform");
    assert_fails!("assimp/invalid/empty.obj", LoadError::Empty { .. }, "empty.obj");
    assert_fails!("assimp/invalid/empty.ply", LoadError::Empty { .. }, "empty.ply");
    assert_fails!(
        "assimp/invalid/malformed.obj",
        LoadError::Invalid { .. },
        "line 23",
        "vertex 12",
        "object \"1\""
    );
    assert_fails!("assimp/invalid/OutOfMemory.off", LoadError::UnknownFormat { .. }, ".glb", ".obj");
    assert_fails!(
        "unsupported-required-extension/heart_draco.glb",
        LoadError::RequiredExtension { .. },
        "KHR_draco_mesh_compression",
        "without mesh compression"
    );
    let validator = |path: &str| format!("gltf-validator/{path}");
    assert_fails!(&validator("json/empty_file.gltf"), LoadError::Empty { .. }, "empty_file.gltf");
    assert_fails!(
        &validator("node/node_loop.gltf"),
        LoadError::NodeCycle { .. } | LoadError::NodeTwoParents { .. },
        "node"
    );
    assert_fails!(&validator("node/node_parent_override.gltf"), LoadError::NodeTwoParents { .. }, "node");
    assert_fails!(
        &validator("node/infinite_transform.gltf"),
        LoadError::NotFinite { .. } | LoadError::Json { .. },
        ""
    );
    assert_fails!(
        &validator("node/unresolved_child_node.gltf"),
        LoadError::OutOfRange { .. },
        "children",
        "node 0"
    );
    assert_fails!(&validator("node/unresolved_mesh.gltf"), LoadError::OutOfRange { .. }, "mesh");
    assert_fails!(&validator("skin/unresolved_joint.gltf"), LoadError::OutOfRange { .. }, "joints", "skin 0");
    assert_fails!(
        &validator("skin/ibm_invalid_count.gltf"),
        LoadError::Invalid { .. },
        "inverseBindMatrices"
    );
    assert_fails!(
        &validator("mesh/unresolved_material.gltf"),
        LoadError::OutOfRange { .. },
        "material",
        "mesh 0"
    );
    assert_fails!(&validator("mesh/unresolved_positions.gltf"), LoadError::OutOfRange { .. }, "POSITION");
    assert_fails!(&validator("mesh/indices_invalid_format.gltf"), LoadError::Invalid { .. }, "indices");
    assert_fails!(&validator("mesh_data/index_buffer_oob.gltf"), LoadError::OutOfRange { .. }, "vertex");
    assert_fails!(
        &validator("material/unresolved_basecolor.gltf"),
        LoadError::OutOfRange { .. },
        "material 0",
        "texture"
    );
    assert_fails!(&validator("glb/chunk_too_big.glb"), LoadError::Container { .. }, "chunk");
    assert_fails!(&validator("glb/no_header.glb"), LoadError::Container { .. }, "glTF");
    assert_fails!(&validator("glb/invalid_magic.glb"), LoadError::Container { .. }, "glTF");
    assert_fails!(&validator("glb/invalid_version.glb"), LoadError::Version { .. }, "2.0");
    assert_fails!(&validator("glb/truncated_chunk_header.glb"), LoadError::Container { .. }, "chunk");
    assert_fails!(&validator("asset/1_0_version.gltf"), LoadError::Version { .. }, "1.0");
    assert_fails!(&validator("scene/unresolved_node.gltf"), LoadError::OutOfRange { .. }, "scene 0");
}

#[test]
fn degenerate_files_load_with_a_warning() {
    let cases = [
        ("assimp/BoxBadNormals-glTF-Binary/BoxBadNormals.glb", "normals"),
        ("gltf-validator/node/rotation_non_unit.gltf", "unit quaternion"),
        ("gltf-validator/node/matrix_trs.gltf", "matrix"),
        ("gltf-validator/image/not_found.gltf", "image 0"),
        ("gltf-validator/image/invalid_image_data.gltf", "image 0"),
        ("gltf-validator/glb/extra_data.glb", "after the end"),
        ("gltf-validator/camera/perspective_yfov.gltf", "yfov"),
        ("gltf-validator/scene/unresolved_default_scene.gltf", "no scenes"),
        ("assimp/TestNoRootNode/NoScene.gltf", "no scenes"),
        ("gltf-validator/accessor/unresolved_bufferviews.gltf", "buffer view"),
    ];
    for (path, word) in cases {
        let Some(loaded) = load_shared(path) else { return };
        let scene = loaded.unwrap_or_else(|error| panic!("{error}"));
        use_scene(&scene, path);
        let found = scene.warnings.iter().any(|warning| warning.message.contains(word));
        assert!(found, "{path}: no warning with '{word}' in {:?}", scene.warnings);
    }
}

#[test]
fn every_bad_file_is_survived() {
    let Some(folder) = shared("malformed") else { return };
    for path in files(&folder, &["gltf", "glb", "obj", "ply", "off", "bin", "json"]) {
        match load_path(&path) {
            Ok(scene) => use_scene(&scene, path.to_str().unwrap()),
            Err(error) => assert!(!error.to_string().is_empty()),
        }
    }
}

#[test]
fn unusual_valid_files_load() {
    let Some(folder) = shared("malformed/edge-valid") else { return };
    let (primitives, mut quads) = (folder.join("glTF-Asset-Generator/Mesh_PrimitiveMode"), 0);
    for i in 0..16 {
        let path = primitives.join(format!("Mesh_PrimitiveMode_{i:02}.gltf"));
        let scene = load_path(&path).unwrap_or_else(|error| panic!("{error}"));
        use_scene(&scene, path.to_str().unwrap());
        let drawn = matches!(i, 4..=6 | 11..=15);
        assert_eq!(scene.triangle_count(), if drawn { 2 } else { 0 }, "{}", path.display());
        assert_eq!(scene.warnings.is_empty(), drawn, "{}: {:?}", path.display(), scene.warnings);
        if drawn {
            // All are the same square, facing the same way.
            let mesh = &scene.meshes[0];
            let side: Vec<bool> = mesh
                .triangles
                .iter()
                .map(|t| {
                    let [a, b, c] = t.map(|v| mesh.positions[v as usize]);
                    (b - a).cross(c - a).z > 0.0
                })
                .collect();
            assert_eq!(side, [true, true], "{}", path.display());
            quads += 1;
        }
    }
    assert_eq!(quads, 8);
    for (path, triangles, joints, cameras, targets) in [
        ("simple_skin/simple_skin.gltf", 8, 2, 0, 0),
        ("simple_skin/quad_skin.glb", 0, 0, 0, 0),
        ("cameras/Cameras.gltf", 2, 0, 2, 0),
        ("MorphPrimitivesTest/glTF/MorphPrimitivesTest.gltf", 0, 0, 0, 1),
    ] {
        let scene = load_path(&folder.join(path)).unwrap_or_else(|error| panic!("{error}"));
        use_scene(&scene, path);
        eprintln!("{path}: {} tris {:?}", scene.triangle_count(), scene.warnings);
        if triangles > 0 {
            assert_eq!(scene.triangle_count(), triangles, "{path}");
            assert_eq!(scene.skins.first().map_or(0, |skin| skin.joints.len()), joints, "{path}");
        }
        assert_eq!(scene.cameras.len(), cameras, "{path}");
        assert_eq!(scene.camera_paths().len(), cameras + 1, "{path}");
        assert_eq!(scene.meshes[0].morph_targets.len(), targets, "{path}");
    }
}
