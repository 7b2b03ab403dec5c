//! What is written, and what is left where a run is interrupted.

use super::*;

#[test]
fn points_are_written_as_ply_and_as_a_recording() {
    let at = folder(&[("disc.glb", &ground_under_disc(3.0, 8, 0.5, 0.3))]);
    let out = succeed(at.path(), &["bake", "disc.glb", "--points", "200", "-o", "a.ply", "-o", "b.dapple"]);
    assert!(out.contains("a.ply") && out.contains("b.dapple"), "{out}");
    let ply = std::fs::read(at.path().join("a.ply")).unwrap();
    let end = ply.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let head = std::str::from_utf8(&ply[..end]).unwrap();
    assert!(head.starts_with("ply\nformat binary_little_endian 1.0\n"), "{head}");
    let count: usize =
        head.lines().find_map(|line| line.strip_prefix("element vertex ")).unwrap().parse().unwrap();
    let rows: Vec<&[u8]> = ply[end..].chunks(35).collect();
    assert_eq!((rows.len(), rows[count - 1].len()), (count, 35));
    assert!(count > 800, "{count} points");
    let exact = 0.09 / (0.25 + 0.09);
    let mut near = 0;
    for row in rows {
        let float = |i: usize| f32::from_le_bytes(row[4 * i..4 * i + 4].try_into().unwrap());
        let (p, n, visibility) =
            (Vec3::new(float(0), float(1), float(2)), Vec3::new(float(3), float(4), float(5)), float(6));
        let instance = i32::from_le_bytes(row[31..].try_into().unwrap());
        assert!((p.y - [0.0, 0.3][instance as usize]).abs() < 1e-5, "{p}");
        assert_eq!(n, [Vec3::Y, Vec3::NEG_Y][instance as usize]);
        assert!((0.0..=1.0).contains(&visibility));
        assert_eq!(row[28..31], [(visibility * 255.0).round() as u8; 3]);
        // The occlusion distance of 0.6 m reaches beyond the disc's rim, √(0.5² + 0.3²) away.
        if instance == 0 && p.length() < 0.12 {
            near += 1;
            assert!((f64::from(visibility) - exact).abs() < 0.06, "{visibility} at {p}");
        }
    }
    assert!(near >= 1, "some point is near the middle");
    let said = succeed(at.path(), &["inspect", "b.dapple", "--scene", "disc.glb"]);
    assert!(said.contains(&format!("{count} points")) || said.contains(&count.to_string()), "{said}");
}

#[test]
fn an_interrupted_bake_leaves_the_old_file_whole() {
    let file = ground_under_disc(3.0, 60, 0.5, 0.3);
    let at = folder(&[("disc.glb", &file)]);
    let arguments = ["bake", "disc.glb", "--rays", "65536", "-o", "disc.glb"];
    let mut child = dapple(at.path(), &arguments).spawn().unwrap();
    std::thread::sleep(std::time::Duration::from_millis(700));
    assert!(child.try_wait().unwrap().is_none(), "still at work");
    child.kill().unwrap();
    child.wait().unwrap();
    assert_eq!(std::fs::read(at.path().join("disc.glb")).unwrap(), file);
    assert_eq!(files(at.path()).len(), 1);
    // Left alone it takes the scene's own place.
    bake(at.path(), &["disc.glb", "--rays", "4", "--texture-size", "32", "-o", "disc.glb"]);
    assert!(std::fs::read(at.path().join("disc.glb")).unwrap() != file);
    assert_eq!(partial_files(at.path()).len(), 0);
}

/// A GLB with so many bytes that nothing refers to but a buffer view: what a bake keeps.
fn with_ballast(file: &[u8], bytes: usize) -> Vec<u8> {
    let glb = Glb::parse(file);
    let (mut json, mut bin) = (glb.json.clone(), glb.bin.clone());
    let first = bin.len().next_multiple_of(4);
    bin.resize(first + bytes, 7);
    json["buffers"][0]["byteLength"] = bin.len().into();
    let view = serde_json::json!({"buffer": 0, "byteOffset": first, "byteLength": bytes});
    json["bufferViews"].as_array_mut().unwrap().push(view);
    json["extensionsUsed"] = serde_json::json!(["X_ballast"]);
    json["extensions"] = serde_json::json!({"X_ballast": {"bufferView": glb.count("bufferViews")}});
    let mut json = json.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut made = b"glTF".to_vec();
    made.extend([2u32, (28 + json.len() + bin.len()) as u32].iter().flat_map(|x| x.to_le_bytes()));
    for (kind, data) in [(b"JSON", &json), (b"BIN\0", &bin)] {
        made.extend((data.len() as u32).to_le_bytes());
        made.extend(kind);
        made.extend(data);
    }
    made
}

#[cfg(unix)]
#[test]
fn an_interrupt_takes_the_half_written_file_along() {
    let file = with_ballast(&two_squares_under_a_lid("{}", "{}"), 1 << 26);
    for signal in ["-INT", "-TERM"] {
        let at = folder(&[("lid.glb", &file)]);
        let arguments = ["bake", "lid.glb", "--into", "vertex", "--rays", "4", "-o", "lid.glb"];
        // Whether a file was being written when the signal came; it may just have been done.
        let interrupted = (0..20).any(|_| {
            let mut child =
                dapple(at.path(), &arguments).stdout(std::process::Stdio::null()).spawn().unwrap();
            let half_written = |at: &Path| {
                partial_files(at).iter().any(|path| path.metadata().is_ok_and(|found| found.len() > 1 << 20))
            };
            while child.try_wait().unwrap().is_none() && !half_written(at.path()) {
                std::thread::yield_now();
            }
            let number = child.id().to_string();
            let _ = std::process::Command::new("kill").args([signal, number.as_str()]).status().unwrap();
            let ended = child.wait().unwrap();
            assert_eq!(partial_files(at.path()), Vec::<std::path::PathBuf>::new(), "{signal}: {ended}");
            !ended.success()
        });
        assert!(interrupted, "{signal}: twenty runs were faster");
        assert!(std::fs::read(at.path().join("lid.glb")).unwrap().len() >= file.len());
    }
}

#[test]
fn what_a_recording_belongs_to_is_told_and_not_replaced() {
    let lid = two_squares_under_a_lid("{}", "{}");
    let at = folder(&[("lid.glb", &lid)]);
    let both = ["bake", "lid.glb", "--points", "64", "-o", "baked.glb", "-o", "lid.dapple"];
    let out = succeed(at.path(), &[&both[..], &COARSE].concat());
    assert!(out.contains("points of lid.glb"), "{out}");
    succeed(at.path(), &["inspect", "lid.dapple", "--scene", "lid.glb"]);
    fail(at.path(), &["inspect", "lid.dapple", "--scene", "baked.glb"], &["scene"]);
    let replaced = ["bake", "lid.glb", "-o", "lid.dapple", "-o", "./lid.glb"];
    fail(at.path(), &replaced, &["lid.dapple", "lid.glb", "another file"]);
    assert!(std::fs::read(at.path().join("lid.glb")).unwrap() == lid, "the scene is as it was");
}
