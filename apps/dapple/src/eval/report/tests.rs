//! The page of made-up results: whole, safe from its own words, exact in its pictures.

mod browser;

use std::collections::BTreeMap;
use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use image::{ImageFormat, RgbImage};
use serde_json::Value;
use tempfile::TempDir;

use super::pictures::{BUDGET_BYTES, order_in, spread};
use super::results::{
    Advice, Case, Figure, FrameRow, JudgeInfo, Machine, Params, Results, Row, RunInfo, SCHEMA, SceneInfo,
    Settling, Steps, StudyAxis, StudyColumn, StudyLine, StudyPicture, StudyPlot, StudyResult, StudyRow,
    StudyTable, Times, Truth, TruthFrame,
};
use super::{columns, html, html_within, rebuild, words};

const WIDTH: u32 = 20;
const HEIGHT: u32 = 12;
/// What closes elements, opens comments, leaves attributes and starts scripts.
const HOSTILE: &str = r#"</script><script>alert(1)</script><!-- "' & </title><img src=x onerror=alert(1)>"#;

fn figure(value: f64) -> Figure {
    Figure { value: Some(value), ci95: Some(0.25) }
}

fn frame(stem: &str, time_s: f64, quality_db: f64) -> FrameRow {
    FrameRow {
        time_s,
        visibility_psnr_db: Some(quality_db),
        moving_psnr_db: Some(quality_db - 2.0),
        moving_pixels: 50,
        psnr_db: Some(quality_db + 10.0),
        ssim: 0.9,
        flip: 1.0 / quality_db,
        hdr_flip: None,
        lpips: None,
        flicker: None,
        beauty: format!("{stem}-beauty.png"),
        visibility: format!("{stem}-visibility.png"),
        error: format!("{stem}-error.png"),
        flip_map: format!("{stem}-flip.png"),
    }
}

/// A method along a path; `qualities_db` has one value a frame.
fn row(case: &str, method: &str, points: Option<f32>, qualities_db: &[f64]) -> Row {
    let frames = qualities_db.iter().enumerate();
    Row {
        method: method.to_owned(),
        params: Params { points_per_m2: points, hz: points.map(|_| 15.0), ..Params::default() },
        compared_pixels: 200,
        visibility_psnr_db: figure(qualities_db[0]),
        moving_psnr_db: figure(qualities_db[0] - 2.0),
        psnr_db: figure(40.0),
        ssim: figure(0.9),
        flip: figure(0.04),
        hdr_flip: None,
        lpips: None,
        flicker: None,
        kbit_per_s: points.map(|n| figure(f64::from(n))),
        snapshot_bytes: points.map(|_| 1_700_000),
        cut_bytes: points.map(|_| 20_000),
        points: points.map(|_| 123_456),
        rays: 5_000_000,
        steps: points.map(|_| Steps::default()),
        step_bytes: points.map(|_| vec![4000; 15]).unwrap_or_default(),
        settling: points.map(|_| Settling {
            after_s: vec![0.0, 0.1],
            visibility_psnr_db: vec![Some(20.0), None],
            behind_rms: vec![0.1, 0.0],
            unfinished: false,
            settled_s: Some(0.1),
        }),
        frames: frames.map(|(i, q)| frame(&format!("{case}-{i:03}-{method}"), i as f64, *q)).collect(),
        times: Times { machine: machine(), server_ms: points.map(|_| 3.0), client_ms: 2.0 },
    }
}

fn case(name: &str, rows: Vec<Row>) -> Case {
    let frames = rows.first().map_or(0, |row| row.frames.len());
    Case {
        name: name.to_owned(),
        scene: SceneInfo {
            name: "hall".to_owned(),
            hash: "0123456789abcdef".to_owned(),
            triangles: 12_345,
            instances: 3,
            warnings: Vec::new(),
        },
        animation: Some("waltz".to_owned()),
        path: "walk".to_owned(),
        seconds: 4.0,
        width: WIDTH,
        height: HEIGHT,
        supersample: 2,
        reference_rays: 64,
        radius_m: 0.6,
        seed: 1,
        truth: Truth {
            noise_rms: 0.01,
            frames: (0..frames)
                .map(|i| TruthFrame {
                    time_s: i as f64,
                    covered_pixels: 200,
                    noise_rms: 0.01,
                    beauty: format!("{name}-{i:03}-truth-beauty.png"),
                    visibility: format!("{name}-{i:03}-truth-visibility.png"),
                })
                .collect(),
        },
        rows,
    }
}

fn machine() -> Machine {
    Machine { cpu: "a processor".to_owned(), threads: 2, os: "linux".to_owned() }
}

fn results(cases: Vec<Case>) -> Results {
    Results {
        schema: SCHEMA,
        title: "hall".to_owned(),
        run: RunInfo {
            dapple_version: "0.1.0".to_owned(),
            program: "fedcba9876543210".to_owned(),
            commit: Some("abcdef".to_owned()),
            command: "dapple eval hall.glb".to_owned(),
        },
        machine: machine(),
        judge: JudgeInfo { pixels_per_degree: 67.0, lpips_weights: None },
        cases,
        studies: Vec::new(),
        failures: Vec::new(),
        advice: Vec::new(),
    }
}

fn small() -> Results {
    results(vec![case(
        "hall",
        vec![
            row("hall", "psao", Some(512.0), &[31.2, 30.0]),
            row("hall", "psao-hat", Some(512.0), &[27.1, 26.0]),
            row("hall", "rtao-16", None, &[25.0, 25.0]),
            row("hall", "none", None, &[14.0, 14.0]),
        ],
    )])
}

/// A study with a table and two plots, one of them over logarithms.
fn study(name: &str) -> StudyResult {
    let axis = |title: &str, is_log| StudyAxis { title: title.to_owned(), unit: "m".to_owned(), is_log };
    let plot = |is_log| StudyPlot {
        title: name.to_owned(),
        x: axis(name, is_log),
        y: axis("error", is_log),
        lines: (1..4)
            .map(|k| StudyLine {
                name: format!("{name} {k}"),
                points: (1..5).map(|i| [f64::from(i), f64::from(k) * f64::from(i * i)]).collect(),
            })
            .collect(),
    };
    StudyResult {
        kind: "radius".to_owned(),
        title: name.to_owned(),
        subject: Some("hall / walk".to_owned()),
        notes: vec![name.to_owned()],
        tables: vec![StudyTable {
            title: name.to_owned(),
            columns: vec![StudyColumn { title: name.to_owned(), unit: "mm".to_owned(), digits: 2 }; 2],
            rows: vec![StudyRow { name: name.to_owned(), values: vec![Some(1.5), None] }],
        }],
        plots: vec![plot(false), plot(true)],
        pictures: vec![StudyPicture { title: name.to_owned(), file: "study.png".to_owned() }],
        machine: machine(),
    }
}

fn names(results: &Results) -> Vec<String> {
    let mut names = Vec::new();
    for case in &results.cases {
        names.extend(case.truth.frames.iter().flat_map(|f| [f.beauty.clone(), f.visibility.clone()]));
        for frame in case.rows.iter().flat_map(|row| &row.frames) {
            names.extend([&frame.beauty, &frame.visibility, &frame.error, &frame.flip_map].map(Clone::clone));
        }
    }
    names
}

/// Writes a picture of its own for every name in the results.
fn write_pictures(folder: &Path, results: &Results) {
    let of_studies =
        results.studies.iter().flat_map(|study| &study.pictures).map(|picture| picture.file.clone());
    for (i, name) in names(results).into_iter().chain(of_studies).enumerate() {
        let picture = RgbImage::from_fn(WIDTH, HEIGHT, |x, y| {
            let hash = (x * 7919 + y * 104_729 + i as u32 * 1_299_709).wrapping_mul(2_654_435_761);
            image::Rgb([(hash >> 8) as u8, (hash >> 16) as u8, x as u8])
        });
        picture.save_with_format(folder.join(name), ImageFormat::Png).unwrap();
    }
}

/// The island of a page.
fn island(page: &str) -> Value {
    let (_, rest) = page.split_once("id=\"data\">").unwrap();
    serde_json::from_str(rest.split_once("</script>").unwrap().0).unwrap()
}

/// The pictures in a page by their number.
fn embedded(page: &str) -> BTreeMap<u64, RgbImage> {
    let elements = page.split("<script type=\"text/plain\" id=\"p").skip(1);
    let picture = |element: &str| {
        let (number, rest) = element.split_once("\">data:image/").unwrap();
        let (format, rest) = rest.split_once(";base64,").unwrap();
        let bytes = STANDARD.decode(rest.split_once('<').unwrap().0).unwrap();
        let format = ImageFormat::from_extension(format).unwrap();
        let decoded = image::load_from_memory_with_format(&bytes, format).unwrap().to_rgb8();
        (number.parse().unwrap(), decoded)
    };
    elements.map(picture).collect()
}

#[test]
fn every_picture_is_in_the_page_to_the_last_bit() {
    let folder = TempDir::new().unwrap();
    let results = small();
    write_pictures(folder.path(), &results);
    let page = html(&results, folder.path()).unwrap();
    let (island, embedded) = (island(&page), embedded(&page));
    let listed = island["names"].as_array().unwrap();
    assert_eq!(listed.len(), names(&results).len());
    assert_eq!(embedded.len(), listed.len());
    for (number, picture) in embedded {
        let file = folder.path().join(listed[number as usize].as_str().unwrap());
        assert!(picture == image::open(&file).unwrap().to_rgb8(), "{} differs", file.display());
    }
    assert_eq!(island["embedded"], serde_json::json!([[0, 1]]));
    assert!(!page.contains("class=\"note\">This file holds"));
}

#[test]
fn the_page_loads_nothing() {
    let folder = TempDir::new().unwrap();
    let mut results = small();
    // A name of a scheme is no reason to go there.
    results.cases[0].rows[0].frames[0].beauty = "https://example.com/a.png".to_owned();
    let page = html(&results, folder.path()).unwrap();
    assert!(page.contains("default-src 'none'"), "browsers are told so too");
    for loader in
        [" src=\"", "url(", "@import", "fetch(", "import(", "XMLHttpRequest", "WebSocket", "<link", "<base"]
    {
        assert!(!page.contains(loader), "{loader}");
    }
    for target in page.split("href=\"").skip(1) {
        assert!(target.starts_with('#'), "{}", &target[..40]);
    }
    assert!(!page.contains("example.com"), "only files below the folder are named");
}

#[test]
fn words_cannot_become_markup() {
    let mut results =
        results(vec![case(HOSTILE, vec![row("a", HOSTILE, Some(8.0), &[30.0])]), case("b", vec![])]);
    results.title = HOSTILE.to_owned();
    results.run.command = HOSTILE.to_owned();
    results.run.commit = Some(HOSTILE.to_owned());
    results.machine.cpu = HOSTILE.to_owned();
    results.cases[0].path = HOSTILE.to_owned();
    results.cases[0].scene.name = HOSTILE.to_owned();
    results.cases[0].scene.warnings.push(HOSTILE.to_owned());
    results.studies.push(study(HOSTILE));
    results.advice.push(Advice { case: Some(0), text: HOSTILE.to_owned() });
    let folder = TempDir::new().unwrap();
    let page = html(&results, folder.path()).unwrap();
    let plain = html(&small(), folder.path()).unwrap();
    for markup in ["<script", "</script", "<!--", "<img", "</title"] {
        assert_eq!(page.matches(markup).count(), plain.matches(markup).count(), "{markup}");
    }
    let island = island(&page);
    assert_eq!(island["title"], HOSTILE);
    assert_eq!(island["studies"][0][0]["title"], HOSTILE);
    assert_eq!(island["cases"][0]["name"], HOSTILE);
    assert_eq!(island["cases"][0]["rows"][0]["method"], HOSTILE);
}

#[test]
fn the_table_and_the_summary_need_no_scripts() {
    let folder = TempDir::new().unwrap();
    let page = html(&small(), folder.path()).unwrap();
    let before_scripts = page.split_once("<script").unwrap().0;
    for words in ["<b>psao</b> (N 512, 15 Hz)", "31.20", "27.10", "512.0", "123,456", "hall.glb</span>"] {
        assert!(before_scripts.contains(words), "{words}");
    }
    assert_eq!(before_scripts.matches("<tr data-case").count(), 4);
}

#[test]
fn the_summary_says_what_is_best_and_by_how_much() {
    let lead = |results: &Results| {
        words::lead(results).replace('\u{a0}', " ").replace("<b>", "").replace("</b>", "")
    };
    assert_eq!(
        lead(&small()),
        "psao (N 512, 15 Hz) reaches 31.2 ± 0.2 dB of visibility at 512 kbit/s, after 1.7 MB to join; that is 4.0 dB \
         above psao-hat from the same points. For comparison: rtao-16 25.0 ± 0.2 dB, no occlusion at all 14.0 ± 0.2 dB."
    );
    // Not in every picture.
    let close = results(vec![case(
        "a",
        vec![
            row("a", "psao", Some(512.0), &[31.2, 30.0, 31.0]),
            row("a", "psao-hat", Some(512.0), &[30.5, 30.4, 30.9]),
        ],
    )]);
    assert!(
        lead(&close)
            .contains("psao-hat from the same points is 0.1 dB below, less than the pictures tell apart")
    );
    // Equal to the truth is better than any number.
    let mut equal = close;
    equal.cases[0].rows[1].visibility_psnr_db = Figure::default();
    equal.cases[0].rows[1].frames.iter_mut().for_each(|frame| frame.visibility_psnr_db = None);
    assert!(
        lead(&equal).starts_with("psao-hat (N 512, 15 Hz) reaches equal to the truth"),
        "{}",
        lead(&equal)
    );
    let two = results(vec![small().cases.remove(0), small().cases.remove(0)]);
    assert!(
        lead(&two).starts_with("psao is nearest to the truth in both cases, with 31.2 dB"),
        "{}",
        lead(&two)
    );
    assert!(lead(&results(vec![])).starts_with("Nothing was compared"));
    let studies = Results { studies: vec![study("radius")], ..results(vec![]) };
    assert!(lead(&studies).starts_with("Studies alone"));
    assert!(html(&studies, Path::new("")).unwrap().contains("<body class=\"of-studies\">"));
    let kicker = |kinds: &[&str]| {
        let of = |kind: &&str| StudyResult { kind: (*kind).to_owned(), ..study("a") };
        let studies = kinds.iter().map(of).collect();
        super::words::kicker(&Results { studies, ..results(vec![]) })
    };
    assert!(kicker(&["light-methods", "light-viewers"]).starts_with("Direct light"));
    assert!(kicker(&["light-methods", "radius"]).starts_with("Ambient visibility"));
    assert!(kicker(&[]).starts_with("Ambient visibility"));
    assert!(
        lead(&results(vec![case("a", vec![row("a", "none", None, &[14.0])])])).contains("without a stream")
    );
}

#[test]
fn too_many_pictures_leave_the_worst_and_some_of_everywhere() {
    let folder = TempDir::new().unwrap();
    let mut qualities = vec![30.0; 64];
    qualities[37] = 20.0;
    let long = results(vec![
        case("long", vec![row("long", "psao", Some(512.0), &qualities)]),
        case("short", vec![row("short", "psao", Some(512.0), &[30.0, 29.0])]),
    ]);
    write_pictures(folder.path(), &long);
    let one: usize = std::fs::read(folder.path().join("long-000-psao-beauty.png")).unwrap().len();
    let page = html_within(&long, folder.path(), 6 * 10 * one).unwrap();
    let island = island(&page);
    let frames = |case: usize| -> Vec<u64> {
        island["embedded"][case].as_array().unwrap().iter().map(|n| n.as_u64().unwrap()).collect()
    };
    assert_eq!(frames(1), [0, 1], "a short case is not starved by a long one");
    let long_frames = frames(0);
    assert!((5..64).contains(&long_frames.len()), "{long_frames:?}");
    for wanted in [0, 37, 63] {
        assert!(long_frames.contains(&wanted), "{wanted} of {long_frames:?}");
    }
    assert!(page.contains("of 66 moments"), "the page says so");
    assert!(!html_within(&long, folder.path(), BUDGET_BYTES).unwrap().contains("of 66 moments"));
}

#[test]
fn any_first_part_of_the_order_is_spread_evenly() {
    for count in [0, 1, 2, 3, 7, 64, 900] {
        let mut order = spread(count);
        if count > 64 {
            let mut part = order[..33].to_vec();
            part.sort_unstable();
            let widest = part.windows(2).map(|pair| pair[1] - pair[0]).max().unwrap();
            assert!(widest <= count.div_ceil(32) + 1, "{count}: {widest}");
        }
        order.sort_unstable();
        assert_eq!(order, (0..count).collect::<Vec<_>>());
    }
    let qualities: Vec<f64> = (0..50).map(|i| 30.0 - f64::from(i % 17)).collect();
    let case = case("a", vec![row("a", "psao", None, &qualities)]);
    let mut order = order_in(&case);
    assert_eq!(order[0], 16, "the first of the worst");
    order.sort_unstable();
    assert_eq!(order, (0..50).collect::<Vec<_>>());
}

#[test]
fn equal_pictures_are_there_once_and_missing_ones_are_said() {
    let folder = TempDir::new().unwrap();
    let results = small();
    write_pictures(folder.path(), &results);
    let copy =
        |from: &str, to: &str| std::fs::copy(folder.path().join(from), folder.path().join(to)).unwrap();
    copy("hall-000-none-beauty.png", "hall-001-none-beauty.png");
    std::fs::remove_file(folder.path().join("hall-000-psao-error.png")).unwrap();
    std::fs::write(folder.path().join("hall-001-psao-error.png"), b"no picture").unwrap();
    let page = html(&results, folder.path()).unwrap();
    let island = island(&page);
    let name =
        |number: &Value| island["names"][number.as_u64().unwrap() as usize].as_str().unwrap().to_owned();
    let missing: Vec<String> = island["missing"].as_array().unwrap().iter().map(name).collect();
    assert_eq!(missing.len(), 2);
    assert!(missing.iter().all(|name| name.ends_with("psao-error.png")), "{missing:?}");
    let same = island["same"].as_array().unwrap();
    assert_eq!(same.len(), 1);
    let pair = [name(&same[0][0]), name(&same[0][1])];
    assert!(pair.iter().all(|name| name.ends_with("none-beauty.png")) && pair[0] != pair[1], "{pair:?}");
    assert_eq!(embedded(&page).len(), names(&results).len() - 3);
    assert!(page.contains("2 pictures could not be read"));
}

#[test]
fn files_outside_the_folder_stay_there() {
    let folder = TempDir::new().unwrap();
    let inner = folder.path().join("inner");
    std::fs::create_dir(&inner).unwrap();
    let mut results = small();
    write_pictures(folder.path(), &results);
    let outside = folder.path().join("hall-000-truth-beauty.png");
    let frame = &mut results.cases[0].rows[0].frames[0];
    frame.beauty = "../hall-000-truth-beauty.png".to_owned();
    frame.visibility = outside.to_string_lossy().into_owned();
    frame.error = "a/../../hall-000-truth-beauty.png".to_owned();
    frame.flip_map = String::new();
    let page = html(&results, &inner).unwrap();
    assert!(embedded(&page).is_empty());
    let pictures = &island(&page)["cases"][0]["rows"][0]["pictures"];
    for kind in ["beauty", "visibility", "error", "flip"] {
        assert_eq!(pictures[kind][0], Value::Null, "{kind}");
    }
}

#[test]
fn results_without_anything_make_a_page() {
    let folder = TempDir::new().unwrap();
    let mut bare = row("a", "none", None, &[14.0]);
    bare.frames.clear();
    bare.compared_pixels = 0;
    for cases in [vec![], vec![case("a", vec![])], vec![case("a", vec![bare])]] {
        let page = html(&results(cases), folder.path()).unwrap();
        assert!(page.contains("Nothing was compared"), "{}", &page[..200]);
        island(&page);
    }
}

#[test]
fn a_page_is_made_again_from_its_results() {
    let folder = TempDir::new().unwrap();
    let results = small();
    write_pictures(folder.path(), &results);
    let file = folder.path().join("results.json");
    std::fs::write(&file, serde_json::to_vec(&results).unwrap()).unwrap();
    rebuild(&file, None).unwrap();
    let page = std::fs::read_to_string(folder.path().join("report.html")).unwrap();
    assert_eq!(page, html(&results, folder.path()).unwrap());
    let elsewhere = folder.path().join("other/page.html");
    rebuild(&file, Some(&elsewhere)).unwrap();
    assert_eq!(std::fs::read_to_string(elsewhere).unwrap(), page);

    let refusal = |text: &str| {
        std::fs::write(&file, text).unwrap();
        format!("{:#}", rebuild(&file, None).unwrap_err())
    };
    assert!(
        refusal("{\"schema\": 1}")
            .contains(&format!("has schema 1, this program reads {SCHEMA}: evaluate again"))
    );
    assert!(refusal(&format!("{{\"schema\": {SCHEMA}}}")).contains("is damaged"));
    assert!(refusal("# notes").contains("is not the results.json of an evaluation"));
    assert!(format!("{:#}", rebuild(&folder.path().join("none"), None).unwrap_err()).contains("cannot read"));
}

#[test]
fn numbers_read_well() {
    for (value, digits, text) in [
        (31.204, 2, "31.20"),
        (-0.004, 2, "0.00"),
        (-1.5, 1, "−1.5"),
        (1234.0, 0, "1234"),
        (1_234_567.0, 0, "1,234,567"),
        (12_345.6, 1, "12,345.6"),
        (f64::INFINITY, 1, "–"),
    ] {
        assert_eq!(columns::number(value, digits), text);
    }
    assert_eq!(columns::bits(0.0), "0 kbit/s");
    assert_eq!(columns::bits(12_000.0), "12.0 Mbit/s");
    assert_eq!(columns::bytes(999), "999 B");
    assert_eq!(columns::bytes(1_662_000), "1.7 MB");
}

#[test]
fn settings_tell_rows_of_a_method_apart() {
    let mut rows = vec![row("a", "psao", Some(256.0), &[1.0]), row("a", "psao", Some(256.0), &[1.0])];
    rows.push(row("a", "psao-hat", Some(256.0), &[1.0]));
    rows[1].params.threshold = Some(8);
    rows[2].params.threshold = Some(8);
    let settings: Vec<String> = columns::settings(&case("a", rows)).iter().map(ToString::to_string).collect();
    assert_eq!(settings, ["N 256, 15 Hz", "N 256, 15 Hz, threshold 8", "N 256, 15 Hz"]);
}
