//! Every kind of study, small.

use std::sync::Arc;

use dapple_scene::glam::Vec3;
use dapple_scene::path::{Aim, Blend, CameraKey};
use dapple_scene::{CameraPath, KeyedPath, Mesh, Scene};

use super::hidden_layers::{add_mesh, add_rectangle};
use super::*;
use crate::args::{Options, Size};
use crate::eval::plan::Settings;
use crate::source::{Loaded, find_path};

/// Runs the study that a `[[study]]` without a scene describes, on a small atrium.
fn run(text: &str, size: [u32; 2]) -> Findings {
    let glb = dapple_scene::builtin::glb("atrium", 0.1).unwrap();
    let scene = dapple_scene::load("atrium.glb", &glb, &dapple_scene::NoFiles).unwrap();
    let path = find_path(&scene, None).unwrap();
    run_on(text, size, &[], (scene, path))
}

/// The same with some methods, or all if none is named, on a scene along a path.
fn run_on(
    text: &str,
    size: [u32; 2],
    methods: &[ScreenSpace],
    (scene, path): (Scene, CameraPath),
) -> Findings {
    let mut table: toml::Table = text.parse().unwrap();
    let Some(toml::Value::String(kind)) = table.remove("kind") else { panic!("no kind") };
    let study = read(&kind, &mut table).unwrap();
    assert!(table.is_empty(), "{table:?}");
    let folder = tempfile::tempdir().unwrap();
    let loaded = Loaded { scene: Arc::new(scene), title: "scene".to_owned() };
    let options = Options {
        size: Some(Size { width: size[0], height: size[1] }),
        frames: Some(2),
        methods: (!methods.is_empty()).then(|| methods.iter().map(|m| Method::Screen(*m)).collect()),
        supersample: Some(1),
        reference_rays: Some(16),
        ..Options::default()
    };
    let settings = Settings::new(&options, false).unwrap();
    let tracer = dapple_trace::Tracer::new(&loaded.scene, &loaded.scene.pose(0.0));
    let stage = Stage::new(&loaded, &settings, path, (0.6, 1.0), tracer);
    let cache = Cache::new(folder.path());
    let stage = study.has_scene().then_some(&stage);
    assert!(study.work(stage) > 0.0 && !study.title().is_empty());
    let findings = study
        .run(&Subject {
            stage,
            cache: &cache,
            progress: &|part| assert!(part <= 1.0),
            shots: &RefCell::default(),
        })
        .unwrap();
    assert!(!findings.tables.is_empty() && !findings.notes.is_empty(), "{findings:?}");
    for table in &findings.tables {
        assert!(!table.rows.is_empty(), "{table:?}");
        for row in &table.rows {
            assert_eq!(row.values.len(), table.columns.len(), "{table:?}");
        }
    }
    for plot in &findings.plots {
        assert!(plot.lines.iter().any(|line| line.points.len() > 1), "{plot:?}");
        for [x, y] in plot.lines.iter().flat_map(|line| &line.points) {
            assert!(x.is_finite() && y.is_finite(), "{plot:?}");
            assert!((!plot.x.is_log || *x > 0.0) && (!plot.y.is_log || *y > 0.0), "{plot:?}");
        }
    }
    findings
}

fn value(findings: &Findings, table: usize, row: usize, column: usize) -> f64 {
    findings.tables[table].rows[row].values[column].unwrap()
}

#[test]
fn filters_are_compared_with_no_levels() {
    let found = run("kind = \"mip-filters\"", [160, 90]);
    let psnr: Vec<f64> = (0..5).map(|row| value(&found, 0, row, 0)).collect();
    assert!(psnr.iter().all(|db| (10.0..80.0).contains(db)), "{psnr:?}");
    assert!(psnr[1..].iter().all(|other| *other < psnr[0]), "the rotated grid is the nearest: {psnr:?}");
    // Of four the farthest never blocks more, the nearest never less.
    assert!(value(&found, 0, 3, 1) > value(&found, 0, 4, 1));
}

#[test]
fn traffic_of_sao_does_not_grow_with_the_radius() {
    let found = run("kind = \"radius\"\nradii = [0.1, 1.0, 3.0]", [640, 360]);
    let memory = |row, pass| value(&found, 0, row, pass);
    assert!(memory(2, 0) > 3.0 * memory(0, 0), "alchemy: {} to {}", memory(0, 0), memory(2, 0));
    assert!(memory(2, 2) < 1.6 * memory(0, 2), "sao: {} to {}", memory(0, 2), memory(2, 2));
    assert!(memory(2, 1) > memory(2, 2), "levels save");
    for row in 0..3 {
        let asked = [0, 1, 2].map(|pass| value(&found, 2, row, pass));
        // At most 13 positions and a normal; 10 distances.
        assert!(asked[0] <= 212.0 && asked[1] <= 40.0 && asked[1] == asked[2], "{asked:?}");
        assert!(asked.iter().all(|asked| *asked > 4.0));
    }
}

#[test]
fn passes_add_up() {
    let found = run("kind = \"passes\"\nsizes = [\"64x36\", \"96x54\"]\nrepeats = 1", [64, 36]);
    assert_eq!(found.tables[0].rows.len(), 2);
    let row: Vec<f64> = (0..9).map(|column| value(&found, 0, 1, column)).collect();
    assert_eq!(row[..2], [6.0, 108.0 * 66.0]);
    assert!((row[2..7].iter().sum::<f64>() - row[7]).abs() < 1e-9, "{row:?}");
    assert!((row[8] - 1e6 * row[7] / (96.0 * 54.0)).abs() < 1e-6, "{row:?}");
    let all = &found.tables[1];
    assert_eq!(all.rows.len(), ScreenSpace::ALL.len());
    for row in &all.rows {
        let sum: f64 = row.values[..4].iter().flatten().sum();
        assert!((sum - row.values[4].unwrap()).abs() < 1e-9, "{row:?}");
        assert_eq!(row.values[0].is_some(), row.name == "sao", "{row:?}");
    }
}

#[test]
fn presets_and_guard_bands_are_judged_by_the_truth() {
    let presets = run("kind = \"presets\"", [64, 36]);
    assert_eq!(presets.tables[0].rows.len(), ScreenSpace::ALL.len());
    let bands = run("kind = \"guard-band\"\nparts = [0.0, 0.1, 0.3]", [64, 36]);
    for found in [&presets, &bands] {
        let all = found.tables[0].rows.iter().flat_map(|row| row.values.iter().flatten());
        assert!(all.clone().all(|db| (8.0..40.0).contains(db)), "{found:?}");
    }
    // The default preset and band are the same run.
    let high = value(&presets, 0, 2, 2);
    assert!((high - value(&bands, 0, 2, 1)).abs() < 1e-9, "{high}");
}

#[test]
fn precision_is_studied_without_a_scene() {
    let found = run("kind = \"z-precision\"\ndistances = [1.0, 10.0, 100.0]\ntriangles = 300", [16, 16]);
    assert_eq!(found.tables[0].rows.len(), 8);
    // Sixteen bits are worse than any other.
    let most = |row| value(&found, 0, row, 3);
    assert!((2..8).all(|row| most(0) > 10.0 * most(row)), "{found:?}");
}

#[test]
fn more_samples_are_nearer_to_the_limit() {
    let found = run("kind = \"layers\"", [128, 72]);
    assert_eq!(found.tables.len(), 3);
    for (table, shown) in found.tables.iter().enumerate() {
        let off = |row| value(&found, table, row, 0);
        let [none, ours_16, paper_16, limit] = [0, 5, 10, 11].map(off);
        assert!(none > 0.001 && limit == 0.0, "{shown:?}");
        assert!((1..6).all(|row| off(row) < 0.6 * none), "{shown:?}");
        assert!(ours_16 < 0.2 * none && ours_16 < paper_16 && paper_16 < off(6), "{shown:?}");
        assert!(shown.rows[11].values[1].is_none() && value(&found, table, 0, 2) == 0.0, "{shown:?}");
        assert!((value(&found, table, 3, 2) - 100.0 * (1.0 - off(3) / none)).abs() < 1e-9);
        // All layers are nearer to the truth than one, which is too light.
        assert!(value(&found, table, 11, 4) < value(&found, table, 0, 4), "{shown:?}");
    }
}

#[test]
fn costs_are_of_all_passes_and_beside_those_of_one_layer() {
    let found = run("kind = \"map-cost\"\nrepeats = 1", [96, 54]);
    let names: Vec<&str> = found.tables.iter().map(|table| table.title.as_str()).collect();
    assert_eq!(names.len(), 6);
    assert_eq!(names[4..], ["hbao-plus", "hbao-plus, the paper's parameters"]);
    for (table, shown) in found.tables.iter().enumerate() {
        assert_eq!(shown.rows.len(), 7);
        assert!(shown.rows[0].values[0].is_none(), "no map, no time of it: {shown:?}");
        for (number, _) in shown.rows.iter().enumerate() {
            let all = value(&found, table, number, 3);
            let passes = shown.rows[number].values[..3].iter().flatten();
            assert!(passes.clone().all(|ms| *ms > 0.0), "{shown:?}");
            assert!((passes.sum::<f64>() - all).abs() < 1e-9, "{shown:?}");
            let ratio = all / value(&found, table, 0, 3);
            assert!((value(&found, table, number, 4) - ratio).abs() < 1e-9, "{shown:?}");
        }
        assert!((1..7).all(|row| value(&found, table, row, 6) > 0.0 && value(&found, table, row, 8) > 0.0));
    }
    // 2.313 over 1.042.
    assert!((value(&found, 4, 3, 10) - 2.2198).abs() < 1e-3);
}

#[test]
fn compensation_darkens() {
    let found = run("kind = \"compensation\"\nfactors = [0.0, 1.0, 2.0]\nsamples = 1", [96, 54]);
    assert_eq!(found.tables[1].rows.len(), 6);
    for row in 0..6 {
        let bias = [0, 1, 2].map(|column| value(&found, 1, row, column));
        assert!(bias[0] > bias[1] && bias[1] > bias[2], "{bias:?}");
    }
}

#[test]
fn two_cameras_are_timed_and_judged() {
    let found = run("kind = \"multi-view\"\nrepeats = 2", [96, 54]);
    let time = |row, column| value(&found, 0, row, column);
    for row in 1..5 {
        assert!((0..4).all(|view| time(row, view) > value(&found, 1, row - 1, view)), "{:?}", found.tables);
        assert!((value(&found, 2, row - 1, 1) - time(row, 1) / time(row, 0)).abs() < 1e-9);
        // Two cameras find more that blocks.
        assert!(value(&found, 5, row, 1) < value(&found, 5, row, 0), "{:?}", found.tables[5]);
        assert_ne!(value(&found, 4, row, 1), value(&found, 4, row, 3), "a coarser second picture");
    }
}

/// A ground, and a box of half a metre on it that a thin pillar near the eye hides until the eye has gone aside.
fn behind_a_pillar() -> (Scene, CameraPath) {
    let mut scene = Scene::default();
    let mut ground = Mesh::default();
    let at = |x: f32, z: f32| Vec3::new(x, 0.0, z);
    add_rectangle(&mut ground, [at(-30.0, 30.0), at(30.0, 30.0), at(30.0, -30.0), at(-30.0, -30.0)]);
    add_mesh(&mut scene, ground);
    for (middle, [half_x, height, half_z]) in [(-6.0, [0.25, 0.5, 0.25]), (-2.0, [0.12, 2.4, 0.1])] {
        let mut sides = Mesh::default();
        let at = |x: f32, y: f32, z: f32| Vec3::new(half_x * x, height * y, middle + half_z * z);
        for [[x, z], [to_x, to_z]] in [
            [[-1.0, 1.0], [1.0, 1.0]],
            [[1.0, 1.0], [1.0, -1.0]],
            [[1.0, -1.0], [-1.0, -1.0]],
            [[-1.0, -1.0], [-1.0, 1.0]],
        ] {
            add_rectangle(
                &mut sides,
                [at(x, 0.0, z), at(to_x, 0.0, to_z), at(to_x, 1.0, to_z), at(x, 1.0, z)],
            );
        }
        add_rectangle(
            &mut sides,
            [at(-1.0, 1.0, 1.0), at(1.0, 1.0, 1.0), at(1.0, 1.0, -1.0), at(-1.0, 1.0, -1.0)],
        );
        add_mesh(&mut scene, sides);
    }
    let key = |time_s: f64, x: f32| CameraKey {
        time_s,
        eye_world: Vec3::new(x, 1.0, 0.0),
        aim: Aim::Target(Vec3::new(x, 0.1, -6.0)),
        fov_degrees: 23.0,
        near_m: 0.1,
    };
    let keys = vec![key(0.0, 0.0), key(0.7, 0.42)];
    let path = KeyedPath::new("aside".to_owned(), false, Blend::Linear, keys).unwrap();
    (scene, path.into())
}

#[test]
fn what_comes_out_from_behind_a_pillar_pops_in_less_the_more_is_known() {
    let names = ["hbao-plus", "sd-hbao-plus", "hbao-plus-peeled"];
    let methods = names.map(|name| ScreenSpace::from_name(name).unwrap());
    let found = run_on("kind = \"pop-in\"\nsteps = 40", [240, 180], &methods, behind_a_pillar());
    let table = &found.tables[0];
    let of = |name: &str| {
        let row = table.rows.iter().position(|row| row.name == name).unwrap();
        [0, 1, 2, 4].map(|column| value(&found, 0, row, column))
    };
    assert_eq!(of("truth"), [0.0; 4], "nothing moves but the eye");
    let [single, four, limit] = names.map(of);
    assert_eq!(single[1], single[3]);
    assert!(four[3] < 0.75 * single[3] && limit[3] < 0.75 * single[3], "{single:?}, {four:?}, {limit:?}");
    assert!(single[2] > 0.0 && four[2] > 0.0);
    assert!(found.plots[0].lines.iter().all(|line| line.points.len() == 41));
    assert_eq!(found.plots[0].lines.len(), 4);
}

#[test]
fn layers_before_what_is_hidden_take_its_place() {
    let found = run("kind = \"hidden-layers\"\nplates = [0, 8]", [160, 90]);
    assert_eq!(found.tables.len(), 6);
    for table in [1, 3, 5] {
        // Of what four samples find alone, and doubled.
        let (part, shown) = (|row, column| value(&found, table, row, column), &found.tables[table]);
        assert!(part(0, 2) > 50.0 && part(1, 2) < part(0, 2) - 5.0, "{shown:?}");
        assert!(part(1, 3) > part(1, 2) && part(1, 4) > part(1, 2), "{shown:?}");
    }
}

#[test]
fn each_departure_from_the_paper_removes_more() {
    let found = run("kind = \"map-rules\"", [160, 90]);
    let removed = |row| value(&found, 0, row, 2);
    assert!(removed(6) > 70.0 && removed(6) > removed(0) + 10.0, "{:?}", found.tables[0]);
    assert!(removed(5) > removed(4) && removed(11) > 99.0, "{:?}", found.tables[0]);
}

/// The Cornell box, whose lamp has an area.
fn lit_box() -> (Scene, CameraPath) {
    let glb = dapple_scene::builtin::glb("cornell", 0.2).unwrap();
    let scene = dapple_scene::load("cornell.glb", &glb, &dapple_scene::NoFiles).unwrap();
    let path = find_path(&scene, Some("path-box")).unwrap();
    (scene, path)
}

#[test]
fn direct_light_by_every_method_is_near_the_truth() {
    // Large enough for the noise of reservoirs, which neighbours share, not to look like bias.
    let found =
        run_on("kind = \"light-methods\"\nsteps = 10\ntruth-samples = 256", [144, 81], &[], lit_box());
    let of = |name: &str, column: usize| {
        let row = found.tables[0].rows.iter().find(|row| row.name == name);
        row.unwrap_or_else(|| panic!("{name}")).values[column].unwrap()
    };
    let (rays, psnr, ssim, bias) = (2, 4, 5, 6);
    for row in &found.tables[0].rows {
        assert!(of(&row.name, psnr) > 20.0 && of(&row.name, bias).abs() < 12.0, "{row:?}");
    }
    assert!(of("slc", psnr) > of("rt-48", psnr) + 1.0 && of("slc", ssim) > of("rt-48", ssim));
    assert!(of("slc", rays) < of("rt-16", rays));
    assert!(of("slc", bias).abs() < 1.5, "{}", of("slc", bias));
    assert!(of("rt-48, best sampler", psnr) > of("rt-16, best sampler", psnr));
}

#[test]
fn direct_light_may_come_from_all_around() {
    let folder = tempfile::tempdir().unwrap();
    let sky = folder.path().join("sky.hdr");
    std::fs::write(
        &sky,
        b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n\x80\x80\x80\x82\x80\x80\x80\x82",
    )
    .unwrap();
    // Quoted as a literal, for paths with backslashes.
    let text = |path: &std::path::Path| {
        format!(
            "kind = \"light-methods\"\nsteps = 40\ntruth-samples = 512\nenvironment = '{}'",
            path.display()
        )
    };
    let found = run_on(&text(&sky), [96, 54], &[], lit_box());
    let without = run_on("kind = \"light-methods\"\nsteps = 1\ntruth-samples = 16", [96, 54], &[], lit_box());
    let of = |name: &str, column: usize| {
        found.tables[0].rows.iter().find(|row| row.name == name).unwrap().values[column].unwrap()
    };
    let (rays, psnr, bias) = (2, 4, 6);
    // By power nearly all samples go to the sky, which is hardly seen from inside a box.
    for name in ["rt-48", "rt-48, best sampler", "slc", "slc by cones alone"] {
        assert!(of(name, bias).abs() < 4.0, "{name}: {} %", of(name, bias));
    }
    assert!(of("slc", psnr) > of("rt-48", psnr) + 1.0 && of("slc", psnr) > 18.0, "{} dB", of("slc", psnr));
    let boxed = without.tables[0].rows.iter().find(|row| row.name == "rt-48").unwrap().values[rays].unwrap();
    assert!(of("rt-48", rays) != boxed, "rays go to the surroundings, too");
}

#[test]
fn viewers_share_entries_and_all_see_the_truth() {
    let text = "kind = \"light-viewers\"\nviewers = [1, 4]\nsteps = 4\ntruth-samples = 32";
    let found = run_on(text, [48, 27], &[], lit_box());
    assert_eq!(found.tables.len(), 4);
    let (entries, psnr) = (2, 4);
    for table in &found.tables {
        let row = |name: &str| table.rows.iter().find(|row| row.name == name).unwrap();
        let [one, four] = ["1 × slc", "4 × slc"].map(|name| row(name).values[entries].unwrap());
        assert!(one > 0.0 && four > one && four < 4.0 * one, "{}: {one}, {four}", table.title);
        for row in &table.rows {
            assert!(row.values[psnr].unwrap() > 12.0, "{row:?}");
        }
    }
    let [together, apart] =
        [0, 2].map(|t: usize| found.tables[t].rows.iter().find(|r| r.name == "4 × slc").unwrap());
    assert!(together.values[entries] < apart.values[entries], "who stands together shares more");
}

#[test]
fn cones_are_taken_apart() {
    let text =
        "kind = \"light-ablation\"\nupdates = 8\ntruth-samples = 128\nsizes = [1.0, 2.0]\nspeeds = [1.0]";
    let found = run_on(text, [48, 27], &[], lit_box());
    let of = |name: &str| found.tables[0].rows.iter().find(|row| row.name == name).unwrap();
    let psnr = |name: &str| of(name).values[0].unwrap();
    assert!(psnr("slc") >= psnr("slc, 1 cones") - 0.1);
    assert!(
        of("slc, bias 4").values[4].unwrap() < 0.3 * of("slc").values[4].unwrap(),
        "fewer, larger texels"
    );
    assert_eq!(found.tables[1].rows.len(), 4);
    assert_eq!(found.tables[2].rows.len(), 4);
}
