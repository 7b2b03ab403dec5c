//! The command as a user meets it: help, scenes, pictures, and what it says when something is wrong.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod common;

use std::path::Path;

use common::command::{fail, files, partial_files, png_size, run, succeed};
use common::made;
use dapple_gpu::testing::gpu_for_tests;
use dapple_scene::{NoFiles, builtin, load};
use tempfile::TempDir;

const PLAIN: &str = "{}";

/// A folder with sound and broken scenes in it.
fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes).unwrap();
    let lid = made::two_squares_under_a_lid(PLAIN, PLAIN);
    write("lid.glb", &lid);
    write("sheet.glb", &made::folding_sheet());
    write("cut.glb", &lid[..lid.len() - 100]);
    write("empty.glb", b"");
    write("notes.txt", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    write("points.obj", b"v 0 0 0\n");
    std::fs::create_dir(folder.path().join("subfolder")).unwrap();
    folder
}

#[test]
fn help_shows_examples() {
    let folder = Path::new(".");
    let top = succeed(folder, &["--help"]);
    for command in ["eval", "render", "scene", "record", "inspect", "view", "demo"] {
        assert!(top.contains(command), "{top}");
        let help = succeed(folder, &[command, "--help"]);
        let examples = help.split_once("Examples:").unwrap().1;
        let own = format!("\n  dapple {command}");
        assert!(examples.matches(&own).count() >= 3, "{help}");
    }
    assert!(succeed(folder, &["--version"]).contains(env!("CARGO_PKG_VERSION")));
}

#[test]
fn scenes_that_cannot_be_used_are_named() {
    let folder = folder();
    let at = folder.path();
    for (scene, says) in [
        ("absent.glb", "absent.glb"),
        ("subfolder", "folder"),
        ("empty.glb", "empty"),
        ("cut.glb", "cut.glb"),
        ("notes.txt", ".glb"),
        ("points.obj", "points.obj"),
    ] {
        let name = scene.trim_end_matches(".glb");
        fail(at, &["render", scene, "-o", "out.png"], &[name, says]);
        fail(at, &["eval", scene, "--out", "out"], &[name, says]);
    }
    assert!(!at.join("out.png").exists() && !at.join("out").exists(), "nothing is written for a bad scene");
    fail(at, &["render", "-o", "out.png"], &["--builtin"]);
    fail(at, &["render", "lid.glb"], &["--output"]);
    for arguments in
        [["render", "--builtin", "palace", "-o", "x.png"], ["eval", "--builtin", "palace", "--out", "x"]]
    {
        fail(at, &arguments, &["palace", "atrium"]);
    }
    fail(at, &["scene", "palace"], &["palace", "atrium"]);
}

#[test]
fn arguments_that_make_no_sense_are_named() {
    let folder = folder();
    let at = folder.path();
    for (arguments, names) in [
        (&["--path", "flight"][..], &["flight", "above", "orbit"][..]),
        (&["--size", "640"], &["--size", "640", "1280x720"]),
        (&["--size", "0x5"], &["--size", "0x5"]),
        (&["--size", "8x8"], &["--size", "8x8"]),
        (&["--methods", "psao,magic"], &["--methods", "magic", "psao-hat", "rtao-", "ssao"]),
        (&["--methods", "rtao-0"], &["rtao-0"]),
        (&["--frames", "0"], &["--frames"]),
        (&["--seconds", "0"], &["--seconds"]),
        (&["--seconds=-1"], &["--seconds"]),
        (&["--seconds", "nan"], &["--seconds"]),
        (&["--hz", "0"], &["--hz"]),
        (&["--hz", "15,inf"], &["--hz"]),
        (&["--points", "0"], &["--points"]),
        (&["--points", "1e30"], &["--points"]),
        (&["--radius", "0"], &["--radius"]),
        (&["--radius", "wide"], &["--radius", "wide", "auto"]),
        (&["--point-rays", "0"], &["rays"]),
        (&["--point-rays", "257"], &["256"]),
        (&["--reference-rays", "0"], &["--reference-rays"]),
        (&["--supersample", "9"], &["--supersample"]),
        (&["--threshold", "256"], &["--threshold", "256"]),
        (&["--animation", "walk"], &["--animation", "walk"]),
        (&["--threads", "-1"], &["-1"]),
        (&["--frobnicate"], &["--frobnicate"]),
    ] {
        fail(at, &[&["eval", "lid.glb", "--out", "out"], arguments].concat(), names);
    }
    for (arguments, names) in [
        (&["--camera", "front"][..], &["front", "above", "orbit"][..]),
        (&["--camera", "eye=1,2"], &["eye=1,2", "target="]),
        (&["--camera", "eye=0,0,0,target=0,0,0"], &["eye=0,0,0"]),
        (&["--camera", "eye=0,0,1,target=0,0,0,fov=180"], &["fov=180"]),
        (&["--size", "big"], &["--size", "big"]),
        (&["--time", "inf"], &["--time"]),
        (&["--rays", "0"], &["--rays"]),
        (&["--points", "-1"], &["-1"]),
        (&["--points=-1"], &["points"]),
        (&["--points", "nan"], &["points"]),
        (&["--supersample", "0"], &["0"]),
        (&["--method", "magic"], &["magic", "psao", "ssao"]),
        (&["--view", "depth"], &["depth", "beauty"]),
        (&["--view", "error", "--method", "rtao"], &["--view error", "--method"]),
        (&["--view", "points", "--method", "rtao"], &["--view points", "--method"]),
        (&["--view", "points", "--method", "ssao"], &["--view points", "--method"]),
    ] {
        fail(at, &[&["render", "lid.glb", "-o", "out.png"], arguments].concat(), names);
    }
    fail(at, &["render", "lid.glb", "--builtin", "atrium", "-o", "out.png"], &["--builtin"]);
    for detail in ["0", "2", "nan"] {
        fail(at, &["scene", "atrium", "--detail", detail, "-o", "out.glb"], &["detail"]);
    }
    assert!(files(at).iter().all(|path| !path.ends_with("out.png") && !path.ends_with("out.glb")));
}

#[test]
fn built_in_scenes_are_listed_and_written() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let list = succeed(at, &["scene"]);
    assert!(list.lines().any(|line| line.starts_with("atrium ")), "{list}");
    // Into a folder that does not exist yet.
    let out = succeed(at, &["scene", "atrium", "--detail", "0.05", "-o", "new/small.glb"]);
    assert!(out.contains("small.glb"), "{out}");
    let written = load("small.glb", &std::fs::read(at.join("new/small.glb")).unwrap(), &NoFiles).unwrap();
    let made = load("atrium.glb", &builtin::glb("atrium", 0.05).unwrap(), &NoFiles).unwrap();
    assert_eq!(written.hash(), made.hash());
    succeed(at, &["scene", "atrium", "--detail", "0.05"]);
    assert_eq!(
        std::fs::read(at.join("atrium.glb")).unwrap(),
        std::fs::read(at.join("new/small.glb")).unwrap()
    );
}

#[test]
fn every_view_of_every_method_is_rendered() {
    let folder = folder();
    let at = folder.path();
    let common =
        ["--size", "48x32", "--rays", "16", "--points", "500", "--supersample", "1", "--camera", "above"];
    for view in ["beauty", "visibility", "normal", "error", "points"] {
        for method in ["psao", "psao-hat", "rtao", "ssao", "none"] {
            // What these would show is refused; see the test of arguments.
            if view == "error" && method == "rtao" || view == "points" && !method.starts_with("psao") {
                continue;
            }
            let name = format!("{view}-{method}.png");
            let out = succeed(
                at,
                &[&["render", "lid.glb", "--view", view, "--method", method, "-o", &name], &common[..]]
                    .concat(),
            );
            assert!(out.contains(&name), "{out}");
            assert_eq!(png_size(&at.join(&name)), (48, 32), "{name}");
        }
    }
    assert_eq!(partial_files(at), Vec::<std::path::PathBuf>::new());
    let read = |name: &str| image::open(at.join(name)).unwrap().to_rgb8().into_raw();
    assert!(read("beauty-psao.png") != read("beauty-none.png"), "occlusion shows");
    assert!(read("visibility-psao.png") != read("visibility-none.png"));
    assert!(read("visibility-ssao.png") != read("visibility-none.png"));
    assert!(read("normal-psao.png") == read("normal-none.png"), "normals have nothing to do with it");
}

#[test]
fn time_camera_and_animation_choose_the_picture() {
    let folder = folder();
    let at = folder.path();
    let render = |name: &str, arguments: &[&str]| {
        let common = ["render", "sheet.glb", "--size", "48x32", "--points", "200", "-o", name];
        succeed(at, &[&common, arguments].concat());
        std::fs::read(at.join(name)).unwrap()
    };
    let flat = render("flat.png", &[]);
    assert!(flat == render("again.png", &["--threads", "1", "--animation", "0"]), "the same again");
    assert!(flat != render("folded.png", &["--time", "1"]));
    assert!(flat != render("orbit.png", &["--camera", "orbit"]));
    assert!(flat != render("placed.png", &["--camera", "eye=0,2,0,target=0,0,0,fov=70"]));
    fail(at, &["render", "sheet.glb", "--animation", "1", "-o", "x.png"], &["--animation", "1"]);
}

#[test]
fn area_lights_light_a_picture() {
    let folder = folder();
    let at = folder.path();
    std::fs::write(
        at.join("sky.hdr"),
        b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n\x80\x80\x80\x82\x80\x80\x80\x82",
    )
    .unwrap();
    std::fs::write(at.join("bad.hdr"), b"no picture").unwrap();
    let box_alone =
        ["render", "--builtin", "cornell", "--detail", "0.1", "--camera", "path-box", "--method", "none"];
    let render = |name: &str, arguments: &[&str]| {
        succeed(at, &[&box_alone[..], &["--size", "48x27", "-o", name], arguments].concat());
        let picture = image::open(at.join(name)).unwrap().to_rgb8().into_raw();
        picture.iter().map(|v| f64::from(*v)).sum::<f64>() / picture.len() as f64
    };
    let rays = render("rays.png", &["--direct-light", "rt-64"]);
    for method in ["slc", "slc-power", "slc-fast", "slc-quick", "slc-fine", "slc-paper", "ris", "restir-di"] {
        let found = render("other.png", &["--direct-light", method]);
        assert!((found - rays).abs() < 0.1 * rays, "{method}: {found}, by rays {rays}");
    }
    if gpu_for_tests().is_some() {
        let [card, twin] = ["slc-card", "slc"].map(|method| {
            render("of.png", &["--direct-light", method]);
            image::open(at.join("of.png")).unwrap().to_rgb8().into_raw()
        });
        let off = card.iter().zip(&twin).filter(|(a, b)| a.abs_diff(**b) > 1).count();
        assert!(off * 500 < twin.len(), "{off} of {} bytes differ", twin.len());
    }
    // What there is no room for is told.
    let fine = ["--direct-light", "slc-fine", "--light-steps", "1", "--light-memory", "1"];
    let full = [&box_alone[..], &["--size", "320x180", "-o", "full.png"], &fine].concat();
    let (output, out, err) = run(at, &full);
    assert!(output.status.success(), "{out}\n{err}");
    assert!(err.contains("stay dark") && err.contains("--light-memory"), "{err}");
    let lit = render("sky.png", &["--direct-light", "rt-16", "--environment", "sky.hdr"]);
    assert!(lit > rays + 5.0, "{lit}, without a sky {rays}");
    let lid = |arguments: &[&'static str]| [&["render", "lid.glb", "-o", "out.png"], arguments].concat();
    fail(at, &lid(&["--direct-light", "slc"]), &["--direct-light", "emits", "--environment"]);
    fail(at, &lid(&["--direct-light", "torch"]), &["torch", "rt-N", "slc"]);
    fail(at, &lid(&["--environment", "sky.hdr"]), &["--direct-light"]);
    fail(at, &lid(&["--direct-light", "slc", "--environment", "bad.hdr"]), &["bad.hdr", ".hdr"]);
    fail(at, &lid(&["--direct-light", "slc", "--environment", "none.hdr"]), &["none.hdr"]);
    fail(at, &lid(&["--direct-light", "slc", "--light-steps", "0"]), &["--light-steps", "0"]);
    fail(at, &lid(&["--direct-light", "slc", "--light-memory", "0"]), &["--light-memory", "0"]);
    assert!(!at.join("out.png").exists());
}

#[test]
fn failed_writes_are_told_and_leave_nothing() {
    let folder = folder();
    let at = folder.path();
    let before = files(at);
    let small = ["render", "lid.glb", "--size", "32x32", "--points", "50", "--method", "none", "-o"];
    // Below a file, and onto a folder.
    fail(at, &[&small[..], &["lid.glb/x.png"]].concat(), &["lid.glb"]);
    fail(at, &[&small[..], &["subfolder"]].concat(), &["subfolder"]);
    fail(at, &["scene", "atrium", "--detail", "0.05", "-o", "lid.glb/x.glb"], &["lid.glb"]);
    fail(at, &["scene", "atrium", "--detail", "0.05", "-o", "subfolder"], &["subfolder"]);
    fail(at, &["eval", "lid.glb", "--out", "lid.glb"], &["lid.glb"]);
    fail(at, &["eval", "lid.glb", "--out", "lid.glb/x"], &["lid.glb/x"]);
    assert_eq!(files(at), before);
    assert!(at.join("subfolder").is_dir());
}
