//! The page in a real browser, from a file and without a network: everything is drawn, answers, and fits.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde_json::{Value, json};
use tempfile::TempDir;

use super::*;

/// What the tests need and a machine may lack.
struct Tools {
    node: PathBuf,
    browser: PathBuf,
    modules: PathBuf,
}

/// The tools; without them a test is skipped, and fails with `REQUIRE_BROWSER=1` in the environment.
fn tools() -> Option<Tools> {
    match find_tools() {
        Ok(tools) => Some(tools),
        Err(reason) if std::env::var_os("REQUIRE_BROWSER").is_some_and(|value| value == "1") => {
            panic!("REQUIRE_BROWSER is set, but {reason}")
        }
        Err(reason) => {
            eprintln!("skipped: the report in a browser: {reason}");
            None
        }
    }
}

fn find_tools() -> Result<Tools, String> {
    let node = on_path(&["node", "nodejs"]).ok_or("there is no node: install Debian's nodejs and npm")?;
    let browser = on_path(&["chromium", "chromium-browser", "google-chrome", "chrome"])
        .ok_or("there is no Chromium: install Debian's chromium")?;
    // The page of `apps/web` is driven by the same.
    let modules = Path::new(env!("CARGO_MANIFEST_DIR")).join("../web/tests/browser/node_modules");
    if !modules.join("playwright-core").is_dir() {
        return Err(
            "the driver of the browser is not installed: run `cargo xtask wasm` with npm at hand".into()
        );
    }
    Ok(Tools { node, browser, modules })
}

fn on_path(names: &[&str]) -> Option<PathBuf> {
    let folders: Vec<PathBuf> = std::env::split_paths(&std::env::var_os("PATH")?).collect();
    names
        .iter()
        .flat_map(|name| folders.iter().map(move |folder| folder.join(name)))
        .find(|path| path.is_file())
}

/// Opens files in the browser; gives what each reported.
fn drive(tools: &Tools, folder: &Path, views: &[Value]) -> Vec<Value> {
    let driver = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/eval/report/tests/driver.mjs");
    let plan = json!({ "browser": tools.browser, "modules": tools.modules, "views": views });
    let file = folder.join("plan.json");
    std::fs::write(&file, plan.to_string()).unwrap();
    let output = Command::new(&tools.node).args([&driver, &file]).stdin(Stdio::null()).output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "the driver ended with {}:\n{errors}", output.status);
    serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|error| panic!("{error}: {}\n{errors}", String::from_utf8_lossy(&output.stdout)))
}

/// Scripts of the page's tests: what they use of the page, and one promise at a time.
const LOOK: &str = "
    const canvases = (id) => [...document.querySelectorAll(`#${id} canvas`)];
    const drawn = (canvas) => {
      const { width, height } = canvas;
      const { data } = canvas.getContext('2d').getImageData(0, 0, width, height);
      const colors = new Set();
      for (let i = 0; i < data.length; i += 4) if (data[i + 3] > 200) colors.add(`${data[i]},${data[i + 1]},${data[i + 2]}`);
      return colors.size;
    };
    return {
      quality: canvases('quality-plots').map(drawn),
      time: canvases('time-plots').map(drawn),
      studies: canvases('studies').filter((canvas) => !canvas.classList.contains('swatch')).map(drawn),
      studyCells: [...document.querySelectorAll('#studies td')].map((cell) => cell.textContent),
      rows: document.querySelectorAll('#figures tbody tr').length,
      stage: document.querySelectorAll('.stage .pane').length,
      width: document.documentElement.scrollWidth,
      empty: [...document.querySelectorAll('.empty')].map((e) => e.textContent),
    };";

const USE: &str = "
    const sleep = (ms) => new Promise((resolve) => setTimeout(resolve, ms));
    const until = async (what) => { for (let i = 0; i < 200; i++) { if (what()) return true; await sleep(25); } return false; };
    const facts = {};
    const key = (name) => document.querySelector('.stage').dispatchEvent(new KeyboardEvent('keydown', { key: name, bubbles: true }));
    const pictures = () => [...document.querySelectorAll('.stage img')];
    const loaded = () => until(() => pictures().length && pictures().every((i) => i.complete && i.naturalWidth === 20));
    document.getElementById('pictures').scrollIntoView({ behavior: 'instant' });
    facts.pictures = await loaded();
    const seen = () => pictures().map((i) => i.src).join();
    const views = new Set();
    for (const view of ['1', '2', '3', '4']) { key(view); await loaded(); views.add(seen()); }
    facts.views = views.size;
    key('1');
    const first = seen();
    key('ArrowRight'); await loaded();
    facts.steps = seen() !== first && document.querySelector('.moment').textContent.startsWith('2 of 2');
    key('ArrowLeft');
    key('x');
    facts.swaps = document.querySelector('.tag.second').textContent.includes('truth');
    key('x');
    const divider = document.querySelector('.divider');
    divider.dispatchEvent(new KeyboardEvent('keydown', { key: 'ArrowLeft', bubbles: true }));
    facts.divides = divider.getAttribute('aria-valuenow') === '48';
    key('+');
    facts.zooms = pictures().every((i) => i.style.width === '200%' && i.style.imageRendering === 'pixelated');
    key('0');
    facts.fits = pictures().every((i) => i.style.width === '100%');
    key('g'); await loaded();
    facts.all = pictures().length;
    key('d'); key('f');
    facts.flips = document.querySelector('.tag.second').hidden;
    key('f');
    facts.flipsBack = document.querySelector('.tag.first').hidden;
    const values = () => [...document.querySelectorAll('#figures tbody td[data-v]')].filter((c) => c.cellIndex === 2).map((c) => Number(c.dataset.v));
    const sort = document.querySelector('#figures th[data-key=visibility_psnr_db] button');
    sort.click();
    facts.sortsDown = values().every((v, i, all) => i === 0 || all[i - 1] >= v);
    sort.click();
    facts.sortsUp = values().every((v, i, all) => i === 0 || all[i - 1] <= v);
    facts.themeBefore = getComputedStyle(document.body).backgroundColor;
    document.getElementById('theme').click();
    facts.themeAfter = getComputedStyle(document.body).backgroundColor;
    document.querySelector('#worst .thumbs button').click();
    await loaded();
    facts.jumps = document.querySelector('[aria-label=\"What is shown\"] [aria-pressed=true]').textContent;
    const stage = document.querySelector('.stage').getBoundingClientRect();
    document.querySelector('.stage').dispatchEvent(new PointerEvent('pointermove', {
      pointerType: 'mouse', clientX: stage.left + stage.width / 2, clientY: stage.top + stage.height / 2, bubbles: true,
    }));
    facts.reads = document.querySelector('.readout').textContent;
    return facts;";

const LINKED: &str = "
    const pressed = [...document.querySelectorAll('#viewer .segments [aria-pressed=true]')].map((b) => b.textContent);
    return [...pressed, document.querySelector('.moment').textContent, ...[...document.querySelectorAll('.tile b')].map((b) => b.textContent),
      Math.abs(document.getElementById('pictures').getBoundingClientRect().top) < 100];";

fn assert_quiet(report: &Value) {
    assert_eq!(report["errors"], json!([]), "{report:#}");
    assert_eq!(report["requests"], json!([]), "{report:#}");
}

#[test]
fn a_browser_shows_everything_and_answers() {
    let Some(tools) = tools() else { return };
    let folder = TempDir::new().unwrap();
    let mut results = small();
    results.studies = vec![study("radius"), StudyResult { plots: Vec::new(), ..study("passes") }];
    write_pictures(folder.path(), &results);
    // Away from the pictures: what is shown is in the file.
    let page = TempDir::new().unwrap();
    let file = page.path().join("report.html");
    std::fs::write(&file, html(&results, folder.path()).unwrap()).unwrap();
    let views = [
        json!({ "file": file, "width": 1280, "height": 800, "script": LOOK }),
        json!({ "file": file, "width": 390, "height": 844, "dark": true, "touch": true, "script": LOOK }),
        json!({ "file": file, "width": 1280, "height": 800, "script": USE }),
        json!({
            "file": file, "hash": "#see:frame=1,view=error,mode=pair,a=1,b=99,zoom=2", "width": 1280, "height": 800,
            "script": LINKED,
        }),
    ];
    let reports = drive(&tools, page.path(), &views);
    for report in &reports[..2] {
        assert_quiet(report);
        let facts = &report["result"];
        let plots = |name: &str| {
            facts[name].as_array().unwrap().iter().map(|n| n.as_u64().unwrap()).collect::<Vec<_>>()
        };
        assert_eq!(plots("quality").len(), 1, "{report:#}");
        assert_eq!(plots("time").len(), 3, "figures, bits, settling: {report:#}");
        assert_eq!(plots("studies").len(), 2, "{report:#}");
        assert_eq!(facts["studyCells"], json!(["1.50", "–", "1.50", "–"]), "{report:#}");
        for colors in [plots("quality"), plots("time"), plots("studies")].concat() {
            assert!(colors > 4, "a plot is blank: {report:#}");
        }
        assert_eq!(facts["rows"], 4);
        assert_eq!(facts["stage"], 2);
        assert_eq!(facts["empty"], json!([]), "{report:#}");
        assert_eq!(facts["width"], report["width"], "the page is wider than the window: {report:#}");
    }
    let report = &reports[2];
    assert_quiet(report);
    let facts = &report["result"];
    for fact in [
        "pictures",
        "steps",
        "swaps",
        "divides",
        "zooms",
        "fits",
        "flips",
        "flipsBack",
        "sortsDown",
        "sortsUp",
    ] {
        assert_eq!(facts[fact], true, "{fact}: {report:#}");
    }
    assert_eq!(facts["views"], 4, "{report:#}");
    assert_eq!(facts["all"], 5, "the truth and four methods: {report:#}");
    assert_eq!(facts["jumps"], "FLIP", "{report:#}");
    assert_ne!(facts["themeBefore"], facts["themeAfter"], "{report:#}");
    let read = facts["reads"].as_str().unwrap();
    assert!(read.starts_with("10, 6") && read.contains("truth"), "pixels of a file can be read: {read}");
    assert_quiet(&reports[3]);
    let sight = json!(["Error", "Pair", "2 of 2, 1.00 s", "psao-hat · N 512, 15 Hz", "none", true]);
    assert_eq!(reports[3]["result"], sight, "an address leads to what it names: {:#}", reports[3]);
}

#[test]
fn a_browser_shows_what_there_is_of_poor_results() {
    let Some(tools) = tools() else { return };
    let folder = TempDir::new().unwrap();
    let mut single = results(vec![case("a", vec![row("a", "psao", Some(512.0), &[31.0])])]);
    single.cases[0].rows[0].settling = None;
    single.cases[0].rows[0].step_bytes = vec![0; 15];
    single.cases[0].rows[0].kbit_per_s = Some(Figure { value: Some(0.0), ci95: None });
    let mut without_pixels = row("a", "none", None, &[14.0]);
    without_pixels.compared_pixels = 0;
    without_pixels.frames.clear();
    let mut equal = row("a", "psao", Some(512.0), &[31.0]);
    equal.visibility_psnr_db = Figure::default();
    equal.frames[0].visibility_psnr_db = None;
    let mut hostile = results(vec![
        case(HOSTILE, vec![row("a", HOSTILE, Some(512.0), &[31.0, 30.0])]),
        case("b", vec![row("b", "psao", Some(512.0), &[31.0, 30.0])]),
    ]);
    hostile.title = HOSTILE.to_owned();
    hostile.studies.push(study(HOSTILE));
    let pages = [
        ("single", single, 1),
        ("nothing", results(vec![]), 0),
        ("no-row", results(vec![case("a", vec![])]), 0),
        ("no-pixel", results(vec![case("a", vec![without_pixels])]), 1),
        ("equal", results(vec![case("a", vec![equal])]), 1),
        ("hostile", hostile, 2),
    ];
    let views: Vec<Value> = pages
        .iter()
        .map(|(name, results, _)| {
            let file = folder.path().join(format!("{name}.html"));
            std::fs::write(&file, html(results, folder.path()).unwrap()).unwrap();
            json!({ "file": file, "width": 1000, "height": 800, "script": LOOK })
        })
        .collect();
    let reports = drive(&tools, folder.path(), &views);
    for (report, (name, _, rows)) in reports.iter().zip(&pages) {
        assert_quiet(report);
        assert_eq!(report["result"]["rows"], *rows, "{name}: {report:#}");
        assert_eq!(report["result"]["width"], report["width"], "{name} is wider than the window: {report:#}");
        let said = report["result"]["empty"].to_string();
        assert!(said.contains("No picture could be found"), "{name}: {report:#}");
    }
    let single = reports[0]["result"]["empty"].to_string();
    for words in ["There is one picture only along the path", "Nothing was sent after the start"] {
        assert!(single.contains(words), "{single}");
    }
    assert!(reports[4]["result"]["empty"].to_string().contains("Equal to the truth"), "{:#}", reports[4]);
}
