//! What others make of baked files: glTF's own validator, and a library for JavaScript.

use std::path::PathBuf;
use std::process::{Command, Stdio};

use serde_json::{Value, json};

use super::options::one_of_two_under_a_lid;
use super::values::something_of_everything;
use super::*;

/// The folder of the readers, if they can run here. `cargo xtask wasm` installs them.
fn readers() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/bake/readers");
    let has_node = Command::new("node").arg("--version").stdout(Stdio::null()).status().is_ok();
    let missing = match (has_node, folder.join("node_modules/gltf-validator").is_dir()) {
        (false, _) => "there is no node: install Debian's nodejs and npm",
        (true, false) => "they are not installed: run `npm ci` in apps/dapple/tests/bake/readers",
        (true, true) => return Some(folder),
    };
    eprintln!("skipped: other readers of baked files: {missing}");
    None
}

/// What they say of a file and the one that was baked from it.
fn read_both(readers: &Path, before: &Path, after: &Path) -> Value {
    let output = Command::new("node").arg(readers.join("read.mjs")).args([before, after]).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{}: {said}", after.display());
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn others_read_baked_files_with_equal_geometry() {
    let Some(readers) = readers() else { return };
    let (two, all) = (one_of_two_under_a_lid(), something_of_everything());
    let at = folder(&[("two.glb", &two), ("all.glb", &all)]);
    let mut scenes = vec![at.path().join("two.glb"), at.path().join("all.glb")];
    scenes.extend(
        ["godot-room/room.glb", "anim-CesiumMan/CesiumMan.glb"]
            .iter()
            .filter_map(|scene| shared(&format!("scenes/{scene}"))),
    );
    for scene in &scenes {
        for options in [&["--into", "texture", "--uv", "new"][..], &["--into", "both", "--bent-normals"]] {
            let name = scene.display().to_string();
            let arguments = [&[name.as_str(), "-o", "baked.glb"], options, &COARSE].concat();
            bake(at.path(), &arguments);
            let found = read_both(&readers, scene, &at.path().join("baked.glb"));
            assert_eq!(found["differing"], json!([]), "{name} {options:?}");
            assert!(found["triangles"].as_u64().unwrap() > 10, "{name}: {found}");
            // What was wrong before is not mended.
            let before = found["before"]["errors"].as_array().unwrap().len();
            let errors = found["errors"].as_array().unwrap();
            assert!(errors.len() <= before, "{name} {options:?}: {errors:#?}");
        }
    }
    // They would notice.
    let mut other = two;
    let from = other.windows(7).position(|w| w == b"[5,0,0]").unwrap();
    other[from + 1] = b'6';
    std::fs::write(at.path().join("moved.glb"), other).unwrap();
    let found = read_both(&readers, &scenes[0], &at.path().join("moved.glb"));
    assert_eq!(found["differing"], json!([1]));
}
