//! The page in a real browser, without a window: on WebGPU and on WebGL2 it shows what the Rust twin shows.

mod scenes;

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use dapple_metrics::{PIXELS_PER_DEGREE, flip};
use serde_json::{Value, json};

use scenes::{HEIGHT, Shot, WIDTH, YFOV_DEGREES, prepare_hall, prepare_walker};

/// What the tests need and a machine may lack.
struct Tools {
    node: PathBuf,
    browser: PathBuf,
    page: PathBuf,
    driver: PathBuf,
}

/// The tools, with `REQUIRE_BROWSER=1` in the environment; without it a test is skipped.
fn tools() -> Option<Tools> {
    // A software browser takes minutes, and what it draws has not been confirmed on every machine.
    if std::env::var_os("REQUIRE_BROWSER").is_none_or(|value| value != "1") {
        eprintln!("skipped: the page in a browser, set REQUIRE_BROWSER=1 to open it");
        return None;
    }
    match find_tools() {
        Ok(tools) => Some(tools),
        Err(reason) => panic!("REQUIRE_BROWSER is set, but {reason}"),
    }
}

fn find_tools() -> Result<Tools, String> {
    let node = on_path(&["node", "nodejs"]).ok_or("there is no node: install Debian's nodejs and npm")?;
    let browser = on_path(&["chromium", "chromium-browser", "google-chrome", "chrome"])
        .ok_or("there is no Chromium: install Debian's chromium")?;
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/browser");
    if !folder.join("node_modules/playwright-core").is_dir() {
        return Err(
            "the driver of the browser is not installed: run `cargo xtask wasm` with npm at hand".into()
        );
    }
    let page = Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("web");
    if !page.join("dapple_web_bg.wasm").is_file() {
        return Err("the page is not built: run `cargo xtask wasm`".into());
    }
    Ok(Tools { node, browser, page, driver: folder.join("driver.mjs") })
}

fn on_path(names: &[&str]) -> Option<PathBuf> {
    let folders: Vec<PathBuf> = std::env::split_paths(&std::env::var_os("PATH")?).collect();
    names
        .iter()
        .flat_map(|name| folders.iter().map(move |folder| folder.join(name)))
        .find(|path| path.is_file())
}

/// An empty folder of this test.
fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    // What an earlier run left is no error.
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a folder in the build folder");
    folder
}

/// Opens pages in the browser; gives what each reported.
fn drive(tools: &Tools, folder: &Path, pages: &[Value], flags: Option<&[&str]>) -> Vec<Value> {
    let plan = json!({
        "browser": tools.browser, "page": tools.page, "data": folder, "out": folder, "pages": pages, "flags": flags,
    });
    let file = folder.join("plan.json");
    std::fs::write(&file, plan.to_string()).expect("the plan is written");
    let output = Command::new(&tools.node)
        .args([&tools.driver, &file])
        .stdin(Stdio::null())
        .output()
        .expect("node starts");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "the driver ended with {}:\n{errors}", output.status);
    serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|error| panic!("{error}: {}\n{errors}", String::from_utf8_lossy(&output.stdout)))
}

/// A picture that the page drew, as sRGB bytes.
fn picture(folder: &Path, name: &str) -> Vec<u8> {
    let image = image::open(folder.join(format!("{name}.png"))).expect("a picture").to_rgba8();
    assert_eq!(image.dimensions(), (WIDTH, HEIGHT), "{name}");
    assert!(image.pixels().all(|pixel| pixel.0[3] == 255), "{name} can be seen through");
    image.pixels().flat_map(|pixel| [pixel.0[0], pixel.0[1], pixel.0[2]]).collect()
}

fn assert_quiet(report: &Value) {
    assert_eq!(report["errors"], json!([]), "{report:#}");
    assert_eq!(report["message"], Value::Null, "{report:#}");
}

/// Mean FLIP between a picture of the twin and one of the page.
fn difference(twin: &[u8], page: &[u8]) -> f64 {
    flip(WIDTH, HEIGHT, twin, page, PIXELS_PER_DEGREE).expect("pictures of one size").mean
}

/// The body of a script that looks from a shot's camera at its time.
fn look(shot: &Shot) -> String {
    let place = |v: dapple_scene::glam::Vec3| format!("[{}, {}, {}]", v.x, v.y, v.z);
    format!(
        "viewer.setCamera({{ eye: {}, target: {}, yfovDegrees: {} }}); viewer.seek({});",
        place(shot.eye),
        place(shot.target),
        YFOV_DEGREES,
        shot.time_s
    )
}

#[test]
fn the_page_shows_what_the_twin_shows() {
    let Some(tools) = tools() else { return };
    let folder = folder("browser-pictures");
    let scenes: Vec<_> = std::iter::once(prepare_hall(&folder)).chain(prepare_walker(&folder)).collect();
    let mut pages = Vec::new();
    let mut expected = Vec::new();
    for prepared in scenes {
        for shot in &prepared.shots {
            for backend in ["webgpu", "webgl2"] {
                pages.push(json!({
                    "name": format!("{}-{backend}", shot.name),
                    "query": format!("{}&paused=1&fade=0&backend={backend}", prepared.query()),
                    "width": WIDTH, "height": HEIGHT,
                    "script": look(shot),
                }));
                expected.push((shot, backend));
            }
        }
    }
    let reports = drive(&tools, &folder, &pages, None);
    assert_eq!(reports.len(), expected.len());
    for (report, (shot, backend)) in reports.iter().zip(expected) {
        assert_quiet(report);
        assert_eq!(report["stats"]["backend"], backend, "{report:#}");
        assert_eq!(report["stats"]["playing"], false, "{report:#}");
        assert_eq!(report["stats"]["time"], shot.time_s, "{report:#}");
        let name = format!("{}-{backend}", shot.name);
        let page = picture(&folder, &name);
        let [lit, open] = [&shot.lit, &shot.open].map(|twin| difference(twin, &page));
        println!("{name}: FLIP {lit:.4} to the twin, {open:.4} to the twin without occlusion");
        assert!(lit <= 0.05, "{name} differs from the twin by FLIP {lit:.4}");
        assert!(
            lit < open,
            "{name} is no nearer to the twin with occlusion ({lit:.4}) than without ({open:.4})"
        );
    }
}

#[test]
fn it_fits_a_window_and_a_phone() {
    let Some(tools) = tools() else { return };
    let folder = folder("browser-windows");
    let prepared = prepare_hall(&folder);
    let pages = [
        json!({
            "name": "window", "width": 1280, "height": 720, "shot": true,
            "query": prepared.query() + "&paused=1&shadowResolution=512&maxPixelRatio=0.5&split=0.5&other=none",
            "script": look(&prepared.shots[1]),
        }),
        json!({
            "name": "phone", "width": 390, "height": 844, "phone": true, "shot": true,
            "query": prepared.query() + "&paused=1&shadowResolution=512&backend=webgl2",
            "script": look(&prepared.shots[0]),
        }),
    ];
    for report in drive(&tools, &folder, &pages, None) {
        assert_quiet(&report);
        assert!(report["stats"]["points"].as_u64() > Some(0), "{report:#}");
        assert_eq!(report["stats"]["playing"], false);
    }
}

#[test]
fn the_handle_plays_seeks_and_steers() {
    let Some(tools) = tools() else { return };
    let folder = folder("browser-handle");
    let prepared = prepare_hall(&folder);
    let script = "
        const sleep = (ms) => new Promise((resolve) => setTimeout(resolve, ms));
        const until = async (what) => { for (let i = 0; i < 200 && !what(); i++) await sleep(50); return what(); };
        const facts = {};
        facts.cameras = viewer.cameras;
        facts.duration = viewer.duration;
        viewer.seek(0); viewer.setLoop(true); viewer.play();
        facts.playsOn = await until(() => viewer.time > 0.1);
        facts.loops = await until(() => viewer.time > 0.8) && await until(() => viewer.time < 0.5);
        viewer.pause();
        const still = viewer.time; await sleep(300);
        facts.pauses = viewer.paused && viewer.time === still;
        viewer.seek(1e9);
        facts.seeksToTheEnd = viewer.time === viewer.duration;
        const bytes = viewer.stats.bytes;
        viewer.seek(0); await until(() => viewer.stats.bytes > bytes);
        facts.seeksBack = viewer.stats.bytes > bytes && viewer.time === 0;
        viewer.setCamera({ eye: [0, 1.5, 4], target: [0, 1, 0], yfovDegrees: 60 });
        const before = viewer.getCamera();
        viewer.rotate(0.1, 0); viewer.zoom(1.5); viewer.pan(0.1, 0);
        facts.steers = JSON.stringify(viewer.getCamera()) !== JSON.stringify(before);
        viewer.setWalking(true);
        facts.walks = viewer.getCamera().walking;
        const canvas = document.getElementById('view');
        const eye = viewer.getCamera().eye;
        canvas.dispatchEvent(new KeyboardEvent('keydown', { code: 'KeyW' }));
        facts.keyWalks = await until(() => Math.hypot(...viewer.getCamera().eye.map((x, i) => x - eye[i])) > 0.05);
        canvas.dispatchEvent(new KeyboardEvent('keyup', { code: 'KeyW' }));
        const wheel = viewer.getCamera().eye;
        canvas.dispatchEvent(new WheelEvent('wheel', { deltaY: -200 }));
        facts.wheelMoves = Math.hypot(...viewer.getCamera().eye.map((x, i) => x - wheel[i])) > 0.05;
        viewer.setCamera('fit');
        viewer.setCamera(viewer.cameras[0]);
        facts.follows = viewer.getCamera().path === viewer.cameras[0];
        const refused = (call) => { try { call(); return null; } catch (error) { return error.message; } };
        facts.badMethod = refused(() => viewer.setMethod('magic'));
        facts.badCamera = refused(() => viewer.setCamera('nowhere'));
        facts.badPlace = refused(() => viewer.setCamera({ eye: [NaN, 0, 0], target: [0, 0, 0] }));
        for (const view of ['visibility', 'normal', 'points', 'texels', 'weights', 'age', 'error', 'beauty']) {
          viewer.setView(view); await sleep(60);
        }
        for (const method of ['none', 'psao-paper', 'psao']) { viewer.setMethod(method); await sleep(60); }
        viewer.setSplit(0.3, 'none'); await sleep(60); viewer.setSplit(null);
        return facts;";
    let pages: Vec<Value> = ["webgpu", "webgl2"]
        .iter()
        .map(|backend| {
            json!({
                "name": backend, "width": 320, "height": 180, "script": script,
                "query": format!("{}&backend={backend}&shadowResolution=256&samples=1", prepared.query()),
            })
        })
        .collect();
    for report in drive(&tools, &folder, &pages, None) {
        assert_quiet(&report);
        let facts = &report["result"];
        for fact in [
            "playsOn",
            "loops",
            "pauses",
            "seeksToTheEnd",
            "seeksBack",
            "steers",
            "walks",
            "keyWalks",
            "wheelMoves",
            "follows",
        ] {
            assert_eq!(facts[fact], true, "{fact}: {report:#}");
        }
        assert_eq!(facts["duration"], 1.0);
        let refusal = |name: &str| facts[name].as_str().unwrap_or_default().to_owned();
        assert_eq!(refusal("badMethod"), "there is no method \"magic\": choose from psao, psao-paper, none");
        assert!(refusal("badCamera").contains("there is no camera \"nowhere\""), "{report:#}");
        assert!(refusal("badPlace").contains("finite"), "{report:#}");
    }
}

#[test]
fn what_cannot_be_shown_is_said_in_the_page() {
    let Some(tools) = tools() else { return };
    let folder = folder("browser-messages");
    prepare_hall(&folder);
    std::fs::write(folder.join("broken.glb"), b"glTF nothing of the kind").expect("a file is written");
    let glb = dapple_scene::builtin::glb("atrium", 0.02).expect("a scene");
    std::fs::write(folder.join("other.glb"), glb).expect("a file is written");
    let stream = std::fs::read(folder.join("hall.dapple")).expect("the stream");
    std::fs::write(folder.join("cut.dapple"), &stream[..stream.len() / 2]).expect("a file is written");
    let cases = [
        ("nothing", "", "Nothing to show was named"),
        ("missing", "?scene=data/missing.glb", "the server says 404"),
        ("broken", "?scene=data/broken.glb", "broken.glb cannot be shown"),
        ("stream", "?scene=data/hall.glb&stream=data/missing.dapple", "the server says 404"),
        ("cut", "?scene=data/hall.glb&stream=data/cut.dapple", "it was cut"),
        ("no-stream", "?scene=data/hall.glb&stream=data/hall.glb", "this is no .dapple file"),
        ("wrong", "?scene=data/other.glb&stream=data/hall.dapple", "load the same scene on both ends"),
        ("backend", "?scene=data/hall.glb&backend=vulkan", "there is no backend"),
    ];
    let pages: Vec<Value> = cases
        .iter()
        .map(|(name, query, _)| {
            json!({
                "name": name, "query": query, "width": 640, "height": 360, "expectMessage": true, "shot": true,
            })
        })
        .collect();
    for (report, (name, _, part)) in drive(&tools, &folder, &pages, None).iter().zip(cases) {
        let message = report["message"].as_str().unwrap_or_default();
        assert!(message.contains(part), "{name}: {report:#}");
        // A file that is not there is an error of the console in any browser; nothing else may be.
        let errors = report["errors"].as_array().cloned().unwrap_or_default();
        let other = |error: &Value| !error.as_str().unwrap_or_default().contains("404");
        assert!(!errors.iter().any(other), "{name}: {report:#}");
    }
}

#[test]
fn a_browser_without_3d_graphics_says_so() {
    let Some(tools) = tools() else { return };
    let folder = folder("browser-bare");
    prepare_hall(&folder);
    let page = json!({
        "name": "bare", "query": "?scene=data/hall.glb", "width": 640, "height": 360, "expectMessage": true, "shot": true,
    });
    let flags = ["--no-sandbox", "--disable-gpu", "--disable-3d-apis"];
    let reports = drive(&tools, &folder, &[page], Some(&flags));
    let message = reports[0]["message"].as_str().unwrap_or_default();
    assert!(message.contains("neither WebGPU nor WebGL2 works here"), "{:#}", reports[0]);
    assert!(!reports[0]["errors"].to_string().contains("panic"), "{:#}", reports[0]);
}
