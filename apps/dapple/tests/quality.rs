//! `dapple quality`: what it writes, and that no reconstruction falls behind on surfaces or leaks more under thin walls.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod common;

use common::command::succeed;
use serde_json::Value;
use tempfile::TempDir;

fn report(arguments: &[&str]) -> (String, Value) {
    let folder = TempDir::new().unwrap();
    let out = succeed(folder.path(), &[&["quality", "-o", "report.json"], arguments].concat());
    (out, serde_json::from_slice(&std::fs::read(folder.path().join("report.json")).unwrap()).unwrap())
}

/// The row of a method in a list of rows, of the first that fit.
fn row<'a>(rows: &'a Value, scene: Option<&str>, method: &str) -> &'a Value {
    let fits = |row: &&Value| row["method"] == method && scene.is_none_or(|scene| row["scene"] == scene);
    rows.as_array().unwrap().iter().find(fits).unwrap_or_else(|| panic!("no {method} in {rows}"))
}

#[test]
fn leaks_under_thin_walls_stay_within_bounds() {
    let (out, found) = report(&[
        "--leaks",
        "--points",
        "512",
        "--samples",
        "10000",
        "--reference-rays",
        "128",
        "--threads",
        "2",
    ]);
    let leaks = &found["leaks"];
    for scene in ["thin wall", "shelves"] {
        for method in ["paper", "hat", "mls", "atlas-uncut", "atlas"] {
            let row = row(leaks, Some(scene), method);
            assert!(row["places"].as_u64().unwrap() > 50, "{row}");
            // The dark side can only gain light, the open side only lose it, up to noise.
            assert!(
                row["dark_bias"].as_f64().unwrap() > -0.01 && row["open_bias"].as_f64().unwrap() < 0.01,
                "{row}"
            );
            assert!(out.contains(method) && out.contains(scene), "{out}");
        }
        let figure = |method, column| row(leaks, Some(scene), method)[column].as_f64().unwrap();
        let (atlas, direct) = (figure("atlas", "near_psnr_db"), figure("mls", "near_psnr_db"));
        assert!(atlas > direct - 0.1, "{scene}: atlas {atlas} dB, direct {direct} dB");
        assert!(figure("atlas", "dark_bias") < figure("mls", "dark_bias") + 0.005, "{scene}: {leaks}");
        let (atlas, paper) = (figure("atlas", "all_psnr_db"), figure("paper", "all_psnr_db"));
        assert!(atlas > paper + 5.0, "{scene}: atlas {atlas} dB, the paper's {paper} dB");
        assert!(
            figure("atlas", "dark_bias") < 0.09 && figure("atlas", "open_bias") > -0.07,
            "{scene}: {leaks}"
        );
    }
}

#[test]
fn least_squares_beats_the_papers_kernel_on_every_class_of_surface() {
    let arguments = [
        "--detail",
        "0.1",
        "--points",
        "128",
        "--samples",
        "6000",
        "--reference-rays",
        "64",
        "--threads",
        "2",
    ];
    let (out, found) = report(&arguments);
    let surfaces = &found["surfaces"];
    let places = |class: &str| row(surfaces, None, "mls")[class]["places"].as_u64().unwrap();
    assert!(places("all") > 4000, "{out}");
    assert_eq!(places("static") + places("backs") + places("movers"), places("all"));
    assert!(places("movers") > 0 && places("backs") > 0);
    let db = |method, class: &str| row(surfaces, None, method)[class]["psnr_db"].as_f64().unwrap();
    for class in ["all", "static", "backs"] {
        assert!(
            db("mls", class) > db("hat", class) + 1.0 && db("hat", class) > db("paper", class),
            "{class}: {out}"
        );
    }
    assert!(db("atlas", "static") > db("hat", "static") + 1.0, "{out}");
    assert!(row(surfaces, None, "paper")["discarded"].as_u64().unwrap() > 0, "{out}");
}
