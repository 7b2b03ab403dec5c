//! `dapple eval diff` and `dapple eval compare` as a user meets them.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod common;

use std::path::{Path, PathBuf};

use common::command::{dapple, fail, files, png_size, succeed};
use dapple_metrics::{PIXELS_PER_DEGREE, flip, flip_hdr};
use image::{Rgb, Rgb32FImage, RgbImage, RgbaImage};
use serde_json::Value;
use tempfile::TempDir;

const SIDE: (u32, u32) = (40, 24);

/// Colours on ramps, some of them lifted by `lift` codes: those of columns that `lifted` takes.
fn picture(lift: u8, lifted: impl Fn(u32) -> bool) -> RgbImage {
    RgbImage::from_fn(SIDE.0, SIDE.1, |x, y| {
        let base = [30 + 3 * x as u8, 60 + 4 * y as u8, 100 + (x * y % 40) as u8];
        Rgb(if lifted(x) { base.map(|v| v + lift) } else { base })
    })
}

fn linear(scale: f32) -> Rgb32FImage {
    Rgb32FImage::from_fn(SIDE.0, SIDE.1, |x, y| {
        let value = scale * (1 << (x / 8)) as f32 * (1.0 + y as f32 / 24.0);
        Rgb([value, 0.7 * value, 0.4 * value])
    })
}

/// A folder with pictures that can and cannot be compared.
fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name);
    picture(0, |_| false).save(at("truth.png")).unwrap();
    picture(26, |x| x >= 20).save(at("test.png")).unwrap();
    RgbImage::new(8, 8).save(at("small.png")).unwrap();
    RgbImage::new(8, 8).save(at("small2.png")).unwrap();
    RgbaImage::from_pixel(SIDE.0, SIDE.1, image::Rgba([200, 200, 200, 0])).save(at("clear.png")).unwrap();
    linear(1.0).save(at("truth.exr")).unwrap();
    linear(1.25).save(at("test.exr")).unwrap();
    std::fs::write(at("broken.png"), b"\x89PNG\r\n\x1a\n").unwrap();
    std::fs::write(at("text.png"), b"no picture").unwrap();
    std::fs::create_dir(at("empty")).unwrap();
    folder
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_else(|error| panic!("{error}: {text}"))
}

/// Trained weights, if they are there.
fn weights() -> Option<PathBuf> {
    let default = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared");
    let shared = PathBuf::from(std::env::var("DAPPLE_SHARED").unwrap_or(default.to_owned()));
    let file = shared.join("metrics/lpips-squeeze/lpips_v0.1_squeeze.safetensors");
    if !file.is_file() {
        eprintln!("skipped: LPIPS of files, because {} is not there", file.display());
        return None;
    }
    Some(file)
}

#[test]
fn diff_tells_what_the_library_finds() {
    let folder = folder();
    let at = folder.path();
    let found = json(&succeed(at, &["eval", "diff", "truth.png", "test.png", "--json"]));
    // Half of the pixels are off by 26 codes.
    let mse = (26.0f64 / 255.0).powi(2) / 2.0;
    assert!((found["mse"].as_f64().unwrap() - mse).abs() < 1e-7, "{found}");
    assert!((found["psnr_db"].as_f64().unwrap() + 10.0 * mse.log10()).abs() < 1e-4, "{found}");
    let [truth, test] = [picture(0, |_| false), picture(26, |x| x >= 20)].map(RgbImage::into_raw);
    let expected = flip(SIDE.0, SIDE.1, &truth, &test, PIXELS_PER_DEGREE).unwrap().mean;
    assert!((found["flip"].as_f64().unwrap() - expected).abs() < 1e-12, "{found} {expected}");
    assert!((0.5..1.0).contains(&found["ssim"].as_f64().unwrap()));
    assert_eq!((&found["lpips"], &found["hdr_flip"]), (&Value::Null, &Value::Null));
    assert_eq!((&found["width"], &found["height"]), (&Value::from(40), &Value::from(24)));

    let text = succeed(at, &["eval", "diff", "truth.png", "test.png", "--ppd", "30"]);
    for part in
        ["test.png against truth.png, 40 x 24", "PSNR", "SSIM", "FLIP", "30 pixels", "--lpips-weights"]
    {
        assert!(text.contains(part), "{part}: {text}");
    }
    let equal = succeed(at, &["eval", "diff", "truth.png", "truth.png"]);
    assert!(equal.contains("equal") && equal.contains("0.0000") && equal.contains("1.0000"), "{equal}");
    let equal = json(&succeed(at, &["eval", "diff", "truth.png", "truth.png", "--json"]));
    assert_eq!(
        (&equal["psnr_db"], equal["mse"].as_f64(), equal["flip"].as_f64()),
        (&Value::Null, Some(0.0), Some(0.0))
    );
}

#[test]
fn diff_compares_linear_light_at_all_exposures() {
    let folder = folder();
    let found = json(&succeed(folder.path(), &["eval", "diff", "truth.exr", "test.exr", "--json"]));
    let expected = flip_hdr(SIDE.0, SIDE.1, &linear(1.0), &linear(1.25), PIXELS_PER_DEGREE, None).unwrap();
    assert!((found["hdr_flip"].as_f64().unwrap() - expected.mean).abs() < 1e-12, "{found}");
    // Everything is a quarter too bright: sixteen times the mean of squares is that of the truth.
    let truth = linear(1.0);
    let squares: f64 = truth.iter().map(|v| f64::from(*v) * f64::from(*v)).sum::<f64>() / truth.len() as f64;
    assert!((found["mse"].as_f64().unwrap() * 16.0 / squares - 1.0).abs() < 1e-6, "{found}");
    assert_eq!((&found["ssim"], &found["flip"]), (&Value::Null, &Value::Null));
    linear(0.0).save(folder.path().join("black.exr")).unwrap();
    let dark = succeed(folder.path(), &["eval", "diff", "black.exr", "test.exr"]);
    assert!(dark.contains("not black"), "{dark}");
    fail(folder.path(), &["eval", "diff", "black.exr", "test.exr", "-o", "map.png"], &["no light in it"]);
    let text = succeed(folder.path(), &["eval", "diff", "truth.exr", "test.exr"]);
    assert!(text.contains("HDR-FLIP") && text.contains("exposures") && text.contains("peak 31.33"), "{text}");
}

#[test]
fn diff_writes_maps_of_the_error() {
    let folder = folder();
    let at = folder.path();
    let kinds = ["flip", "signed", "absolute", "squared", "ssim"];
    let out = succeed(
        at,
        &["eval", "diff", "truth.png", "test.png", "-o", "e/map.png", "--kind", &kinds.join(",")],
    );
    for kind in kinds {
        let name = format!("e/map-{kind}.png");
        assert!(out.contains(&format!("map-{kind}.png")), "{out}");
        assert_eq!(png_size(&at.join(&name)), SIDE);
        let map = image::open(at.join(&name)).unwrap().into_rgb8();
        let [left, right] = [map.get_pixel(2, 12), map.get_pixel(37, 12)];
        assert_ne!(left, right, "{kind}: only the right half differs");
        if kind == "signed" {
            assert!(*left == Rgb([247; 3]) && right.0[0] > right.0[2], "too light is warm: {right:?}");
        }
        if ["flip", "absolute", "squared"].contains(&kind) {
            assert!(
                left.0.iter().all(|v| *v < 16) && right.0.iter().any(|v| *v > 48),
                "{kind}: {left:?} {right:?}"
            );
        }
    }
    // A single one has the name it was given; the other way around the sign is.
    succeed(at, &["eval", "diff", "test.png", "truth.png", "-o", "one.png", "--kind", "signed"]);
    let map = image::open(at.join("one.png")).unwrap().into_rgb8();
    assert!(map.get_pixel(37, 12).0[2] > map.get_pixel(37, 12).0[0], "too dark is blue");
    succeed(at, &["eval", "diff", "truth.exr", "test.exr", "-o", "hdr.png"]);
    assert_eq!(png_size(&at.join("hdr.png")), SIDE);
}

#[test]
fn diff_takes_weights_from_a_flag_or_the_environment() {
    let folder = folder();
    let at = folder.path();
    std::fs::write(at.join("bad.safetensors"), b"no weights").unwrap();
    let arguments = ["eval", "diff", "truth.png", "test.png", "--lpips-weights"];
    let with = |file| [&arguments[..], &[file]].concat();
    fail(at, &with("bad.safetensors"), &["bad.safetensors", "safetensors format"]);
    fail(at, &with("absent.safetensors"), &["cannot read the weights", "absent.safetensors"]);

    let Some(weights) = weights() else { return };
    let out = succeed(at, &with(weights.to_str().unwrap()));
    assert!(out.contains("LPIPS") && !out.contains("needs"), "{out}");
    let mut command =
        dapple(at, &["eval", "diff", "truth.png", "test.png", "--json", "-o", "l.png", "--kind", "lpips"]);
    let output = command.env("DAPPLE_LPIPS_WEIGHTS", &weights).output().unwrap();
    let found = json(&String::from_utf8(output.stdout).unwrap());
    assert!((0.001..1.0).contains(&found["lpips"].as_f64().unwrap()), "{found}");
    assert_eq!(png_size(&at.join("l.png")), SIDE);
}

#[test]
fn diff_says_what_it_did_with_transparency_and_with_small_pictures() {
    let folder = folder();
    let out = succeed(folder.path(), &["eval", "diff", "truth.png", "clear.png"]);
    assert!(out.contains("clear.png has transparent pixels, which were compared over black"), "{out}");
    let found = json(&succeed(folder.path(), &["eval", "diff", "truth.png", "clear.png", "--json"]));
    assert_eq!(found["over_black"], Value::Bool(true));
    let out = succeed(folder.path(), &["eval", "diff", "small.png", "small2.png"]);
    assert!(out.contains("needs 11 pixels on each side, not 8"), "{out}");
}

#[test]
fn diff_names_what_is_wrong() {
    let folder = folder();
    let at = folder.path();
    let wrong =
        |arguments: &[&str], names: &[&str]| fail(at, &[&["eval", "diff"], arguments].concat(), names);
    wrong(&["truth.png", "absent.png"], &["cannot read the picture absent.png"]);
    wrong(&["truth.png", "small.png"], &["small.png", "truth.png", "40 x 24", "8 x 8"]);
    wrong(&["truth.png", "broken.png"], &["broken.png"]);
    wrong(&["text.png", "truth.png"], &["text.png", "png, jpg"]);
    wrong(&["truth.png", "empty"], &["empty is a folder", "dapple eval compare"]);
    wrong(&["truth.png", "truth.exr"], &["truth.exr", "linear light"]);
    wrong(&["truth.png", "test.png", "--ppd", "0"], &["--ppd", "1 to 1000"]);
    wrong(&["truth.png", "test.png", "-o", "map.jpg"], &["map.jpg", ".png"]);
    wrong(&["truth.png", "test.png", "-o", "map.png", "--kind", "lpips"], &["--lpips-weights"]);
    wrong(&["truth.exr", "test.exr", "-o", "map.png", "--kind", "flip,ssim"], &["ssim", "sRGB-encoded"]);
    wrong(&["truth.png", "test.png", "--kind", "flip"], &["--output"]);
    wrong(&["truth.png", "test.png", "-o", "map.png", "--kind", "blurred"], &["blurred", "absolute"]);
    assert!(!files(at).iter().any(|file| file.to_string_lossy().contains("map")), "nothing is written");
}

/// Folders `truth`, `test` and `same` of pictures under a still camera. In `test` every second picture is lighter.
fn sequences() -> TempDir {
    let folder = TempDir::new().unwrap();
    for name in ["truth", "test", "same"] {
        std::fs::create_dir(folder.path().join(name)).unwrap();
    }
    // Names that sort otherwise by letters.
    for frame in 8..12u8 {
        let at = |name: &str| folder.path().join(name).join(format!("frame-{frame}.png"));
        picture(0, |_| false).save(at("truth")).unwrap();
        picture(0, |_| false).save(at("same")).unwrap();
        picture(if frame % 2 == 1 { 10 + frame } else { 0 }, |_| true).save(at("test")).unwrap();
    }
    picture(0, |_| false).save(folder.path().join("truth/extra.png")).unwrap();
    std::fs::write(folder.path().join("test/notes.txt"), b"not looked at").unwrap();
    folder
}

#[test]
fn compare_measures_pictures_and_flicker() {
    let folder = sequences();
    let at = folder.path();
    let arguments = ["eval", "compare", "truth", "test", "same", "--still-camera", "--csv", "out/all.csv"];
    let found = json(&succeed(at, &[&arguments[..], &["--json"]].concat()));
    assert_eq!((&found["pictures"], &found["left_out"][0]), (&Value::from(4), &Value::from("extra.png")));
    let (test, same) = (&found["tests"][0], &found["tests"][1]);
    let names: Vec<&str> =
        test["pictures"].as_array().unwrap().iter().map(|p| p["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["frame-8.png", "frame-9.png", "frame-10.png", "frame-11.png"]);
    // Pictures 9 and 11 are 19 and 21 codes too light; 8 and 10 are equal.
    let mse = (19.0f64.powi(2) + 21.0f64.powi(2)) / 4.0 / 255.0f64.powi(2);
    let pooled = test["psnr_db"]["value"].as_f64().unwrap();
    assert!((pooled + 10.0 * mse.log10()).abs() < 1e-4, "{pooled}");
    assert_eq!((&same["psnr_db"]["value"], &test["equal_pictures"]), (&Value::Null, &Value::from(2)));
    assert!(test["psnr_db"]["ci95"].as_f64().unwrap() > 0.0);
    assert!(test["flip"]["ci95"].as_f64().unwrap() > 0.0);
    assert_eq!(test["worst"], serde_json::json!(["frame-11.png", "frame-9.png", "frame-8.png"]));
    // Luma goes up by 19, down by 19, up by 21 codes; the reference stands still.
    let flicker = ((19.0f64.powi(2) * 2.0 + 21.0f64.powi(2)) / 3.0).sqrt();
    for key in ["flicker", "error_flicker"] {
        assert!((test[key].as_f64().unwrap() - flicker).abs() < 1e-3, "{key}: {test}");
        assert_eq!(same[key].as_f64(), Some(0.0));
    }
    assert_eq!((found["reference_flicker"].as_f64(), &same["equal_pictures"]), (Some(0.0), &Value::from(4)));

    let csv = std::fs::read_to_string(at.join("out/all.csv")).unwrap();
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!((lines.len(), lines[0].split(',').count()), (9, 8), "{csv}");
    assert!(
        lines[0].starts_with("folder,picture,mse,psnr_db") && lines[2].starts_with("test,frame-9.png,"),
        "{csv}"
    );
    let flips: Vec<f64> = lines[1..5].iter().map(|l| l.split(',').nth(5).unwrap().parse().unwrap()).collect();
    assert!((flips.iter().sum::<f64>() / 4.0 - test["flip"]["value"].as_f64().unwrap()).abs() < 1e-9);

    let text = succeed(at, &arguments);
    for part in [
        "4 pictures against truth",
        "frame-11.png",
        "flicker of error 1/255",
        "19.689",
        "±",
        "equal in test: 2 of 4",
        "extra.png",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
    // What applies to no folder has no column.
    assert!(!text.contains("LPIPS") && !text.contains("HDR-FLIP"), "{text}");
}

#[test]
fn compare_writes_maps() {
    let folder = sequences();
    let at = folder.path();
    let arguments = ["eval", "compare", "truth", "test", "--still-camera", "--maps", "maps", "--worst", "1"];
    let text = succeed(at, &arguments);
    assert!(text.contains("flicker.png") && text.contains("frame-11-flip.png"), "{text}");
    let flicker = image::open(at.join("maps/flicker.png")).unwrap().into_rgb8();
    assert_eq!(flicker.dimensions(), SIDE);
    // Everything flickers alike, by 19.7 of 25: light, but not the palest.
    let first = flicker.get_pixel(0, 0);
    assert!(first.0[0] > 200 && first.0[2] < 150, "{first:?}");
    assert_eq!(files(&at.join("maps")).len(), 2);
    // Two folders do not write over each other.
    succeed(at, &["eval", "compare", "truth", "test", "same", "--maps", "two", "--worst", "1"]);
    assert!(at.join("two/1-test/frame-11-flip.png").is_file() && at.join("two/2-same").is_dir());
    // Nor do pictures that differ in their ending alone.
    for (folder, lift) in [("truth", 0), ("test", 20)] {
        picture(lift, |_| true).save(at.join(folder).join("frame-9.jpg")).unwrap();
    }
    let text = succeed(at, &["eval", "compare", "truth", "test", "--maps", "endings", "--worst", "9"]);
    let written = files(&at.join("endings"));
    assert_eq!((written.len(), text.matches("written: ").count()), (5, 5), "{text}");
    for name in ["frame-9.png-flip.png", "frame-9.jpg-flip.png", "frame-11-flip.png"] {
        assert!(at.join("endings").join(name).is_file(), "{name}: {written:?}");
    }
}

#[test]
fn compare_pools_linear_light_by_the_brightest_of_each_picture() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    for (name, scale) in [("truth", 1.0), ("test", 1.25)] {
        std::fs::create_dir(at.join(name)).unwrap();
        linear(scale).save(at.join(name).join("a.exr")).unwrap();
        // The same picture, eight times as bright: errors count as much.
        linear(8.0 * scale).save(at.join(name).join("b.exr")).unwrap();
    }
    let found = json(&succeed(at, &["eval", "compare", "truth", "test", "--json"]));
    let test = &found["tests"][0];
    let (pooled, first) = (&test["psnr_db"]["value"], &test["pictures"][0]["psnr_db"]);
    assert!((pooled.as_f64().unwrap() - first.as_f64().unwrap()).abs() < 1e-3, "{found}");
}

#[test]
fn pictures_of_visibility_are_compared_as_they_are() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let render = |method: &str, name: &str| {
        let scene = ["--builtin", "cornell", "--detail", "0.05", "--size", "48x32", "--rays", "16"];
        let what = ["--view", "visibility", "--method", method, "-o", name];
        succeed(at, &[&["render"], &scene[..], &what].concat());
    };
    render("rtao", "truth.exr");
    render("none", "none.exr");
    let found = json(&succeed(at, &["eval", "diff", "truth.exr", "none.exr", "--json"]));
    assert!(found["hdr_flip"].as_f64().unwrap() > 0.0 && found["psnr_db"].as_f64().unwrap() > 5.0, "{found}");
    let equal = succeed(at, &["eval", "diff", "truth.exr", "truth.exr"]);
    assert!(equal.contains("equal"), "{equal}");
}

#[test]
fn compare_names_what_is_wrong() {
    let folder = sequences();
    let at = folder.path();
    std::fs::create_dir(at.join("other")).unwrap();
    let wrong =
        |arguments: &[&str], names: &[&str]| fail(at, &[&["eval", "compare"], arguments].concat(), names);
    wrong(&["truth", "absent"], &["cannot read the folder absent"]);
    wrong(&["truth", "other"], &["other holds no pictures"]);
    wrong(&["truth", "truth/frame-8.png"], &["no folder", "dapple eval diff"]);
    wrong(&["truth"], &["TEST"]);
    picture(0, |_| false).save(at.join("other/alone.png")).unwrap();
    wrong(&["truth", "other"], &["same name", "truth", "other"]);
    RgbImage::new(30, 24).save(at.join("other/frame-9.png")).unwrap();
    wrong(&["truth", "other"], &["frame-9.png", "30 x 24"]);
    // Of one size with their references, but not with each other.
    for name in ["truth", "other"] {
        RgbImage::new(30, 24).save(at.join(name).join("frame-10.png")).unwrap();
        picture(0, |_| false).save(at.join(name).join("frame-9.png")).unwrap();
    }
    assert!(succeed(at, &["eval", "compare", "truth", "other"]).contains("equal"));
    wrong(&["truth", "other", "--still-camera"], &["frame-10.png", "--still-camera"]);
}

#[test]
fn help_of_the_verbs_shows_examples() {
    for verb in ["diff", "compare"] {
        let help = succeed(Path::new("."), &["eval", verb, "--help"]);
        let examples = help.split_once("Examples:").unwrap().1;
        assert!(examples.matches(&format!("\n  dapple eval {verb}")).count() >= 3, "{help}");
    }
    let help = succeed(Path::new("."), &["eval", "--help"]);
    assert!(help.contains("diff") && help.contains("compare"), "{help}");
    // After a flag of the evaluation, words are scenes.
    fail(Path::new("."), &["eval", "--frames", "2", "diff", "a.png", "b.png"], &["scene diff"]);
}

#[test]
fn the_truth_alone_is_written_with_its_cameras() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    let arguments = [
        "eval",
        "reference",
        "--builtin",
        "atrium",
        "--detail",
        "0.05",
        "--path",
        "all",
        "--frames",
        "2",
        "--size",
        "64x48",
        "--reference-rays",
        "16",
        "--formats",
        "png,exr",
        "--out",
        "truth",
    ];
    let told = succeed(at, &arguments);
    assert!(told.contains("4 pictures"), "{told}");
    let index: serde_json::Value =
        serde_json::from_slice(&std::fs::read(at.join("truth/truth.json")).unwrap()).unwrap();
    let cases = index["cases"].as_array().unwrap();
    assert_eq!(cases.len(), 2);
    for case in cases {
        let frames = case["frames"].as_array().unwrap();
        assert_eq!(frames.len(), 2);
        assert_ne!(frames[0]["world_from_view"], frames[1]["world_from_view"], "the camera moves");
        for frame in frames {
            assert_eq!(frame["world_from_view"].as_array().unwrap().len(), 16);
            assert!(frame["projection"]["perspective"]["yfov_radians"].as_f64().unwrap() > 0.1);
            for kind in ["beauty", "visibility"] {
                let stem = at.join("truth").join(frame[kind].as_str().unwrap());
                assert_eq!(png_size(&stem.with_extension("png")), (64, 48));
                let exr = image::open(stem.with_extension("exr")).unwrap().to_rgb32f();
                assert!(exr.pixels().any(|p| p.0[0] > 0.0) && exr.dimensions() == (64, 48));
            }
        }
    }
    // The pictures are those that an evaluation compares with.
    let told = succeed(
        at,
        &[
            "eval",
            "--builtin",
            "atrium",
            "--detail",
            "0.05",
            "--frames",
            "2",
            "--size",
            "64x48",
            "--reference-rays",
            "16",
            "--methods",
            "none",
            "--truth-cache",
            "truth/truth",
            "--out",
            "o",
        ],
    );
    assert!(told.contains("none"));
    let results: serde_json::Value =
        serde_json::from_slice(&std::fs::read(at.join("o/results.json")).unwrap()).unwrap();
    for (number, frame) in results["cases"][0]["truth"]["frames"].as_array().unwrap().iter().enumerate() {
        let own = std::fs::read(at.join("o").join(frame["beauty"].as_str().unwrap())).unwrap();
        assert!(
            own == std::fs::read(at.join(format!("truth/atrium-path-walk/beauty/{number:04}.png"))).unwrap()
        );
    }
}
