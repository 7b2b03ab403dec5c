//! The page in a real browser, without a window: on WebGPU and on WebGL2 it shows what the Rust twin shows.

mod scenes;

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;

use dapple_metrics::{PIXELS_PER_DEGREE, flip};
use serde_json::{Value, json};

use scenes::{HEIGHT, SHADOW_RESOLUTION, Shot, WIDTH, YFOV_DEGREES, hall, hint_of_a_hall, walker};

/// The part of an address that asks for a coarse picture, where a message is looked at.
const COARSE: &str = "&shadowResolution=16&samples=1&maxPixelRatio=0.1";

/// What the tests need and a machine may lack.
struct Tools {
    node: PathBuf,
    browser: PathBuf,
    page: PathBuf,
    driver: PathBuf,
}

/// The tools; without them a test is skipped, and fails with `REQUIRE_BROWSER=1` in the environment.
fn tools() -> Option<Tools> {
    match find_tools() {
        Ok(tools) => Some(tools),
        Err(reason) if std::env::var_os("REQUIRE_BROWSER").is_some_and(|value| value == "1") => {
            panic!("REQUIRE_BROWSER is set, but {reason}")
        }
        Err(reason) => {
            eprintln!("skipped: the page in a browser: {reason}");
            None
        }
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
    // A browser that draws in software takes the whole machine.
    static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
    let _turn = ONE_AT_A_TIME.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
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
    let scenes: Vec<_> = std::iter::once(hall()).chain(walker()).collect();
    let mut pages = Vec::new();
    let mut expected = Vec::new();
    for prepared in &scenes {
        prepared.write(&folder);
        for backend in ["webgpu", "webgl2"] {
            let script =
                |shot: &Shot| json!({ "name": format!("{}-{backend}", shot.name), "script": look(shot) });
            pages.push(json!({
                "name": format!("{}-{backend}", prepared.name),
                "query": format!(
                    "{}&paused=1&fade=0&shadowResolution={SHADOW_RESOLUTION}&backend={backend}", prepared.query(),
                ),
                "width": WIDTH, "height": HEIGHT,
                "scripts": prepared.shots.iter().map(script).collect::<Vec<_>>(),
            }));
            expected.push((prepared, backend));
        }
    }
    for shot in scenes.iter().flat_map(|prepared| &prepared.shots) {
        // Beside the page's, for looking at both.
        let file = folder.join(format!("{}-twin.png", shot.name));
        image::save_buffer(file, &shot.lit, WIDTH, HEIGHT, image::ColorType::Rgb8).expect("it is written");
    }
    let reports = drive(&tools, &folder, &pages, None);
    assert_eq!(reports.len(), expected.len());
    let mut failures = Vec::new();
    for (report, (prepared, backend)) in reports.iter().zip(expected) {
        assert_quiet(report);
        for (i, shot) in prepared.shots.iter().enumerate() {
            let stats = &report["done"][i]["stats"];
            assert_eq!(stats["backend"], backend, "{report:#}");
            assert_eq!(stats["playing"], false, "{report:#}");
            assert_eq!(stats["time"], shot.time_s, "{report:#}");
            let name = format!("{}-{backend}", shot.name);
            let page = picture(&folder, &name);
            let [lit, open] = [&shot.lit, &shot.open].map(|twin| difference(twin, &page));
            println!("{name}: FLIP {lit:.4} to the twin, {open:.4} to the twin without occlusion");
            if lit > 0.05 {
                failures.push(format!("{name} differs from the twin by FLIP {lit:.4}"));
            }
            if lit >= open {
                failures.push(format!(
                    "{name} is no nearer to the twin with occlusion ({lit:.4}) than without ({open:.4})"
                ));
            }
        }
    }
    assert!(failures.is_empty(), "{failures:#?}");
}

#[test]
fn it_fits_a_window_and_a_phone() {
    let Some(tools) = tools() else { return };
    let folder = folder("browser-windows");
    let prepared = hint_of_a_hall(0);
    prepared.write(&folder);
    // The panels are what is looked at here: the picture may be coarse.
    let query = prepared.query() + "&paused=1&shadowResolution=128&samples=1";
    let pages = [
        json!({
            "name": "window", "width": 1280, "height": 720, "window": true,
            "query": format!("{query}&maxPixelRatio=0.3&split=0.5&other=none"),
            "scripts": [{ "name": "window-picture", "script": "" }],
        }),
        json!({
            "name": "phone", "width": 390, "height": 844, "phone": true, "light": true, "window": true,
            "query": format!("{query}&maxPixelRatio=0.5&backend=webgl2"),
            "scripts": [{ "name": "phone-picture", "script": "" }],
        }),
        json!({
            "name": "phone-menu", "width": 390, "height": 844, "phone": true, "window": true,
            "query": format!("{query}&maxPixelRatio=0.3&backend=webgl2&split=0.5&other=none"),
            "scripts": [{ "name": "phone-menu-picture", "script": "document.getElementById('menu').click();" }],
        }),
    ];
    for report in drive(&tools, &folder, &pages, None) {
        assert_quiet(&report);
        let stats = &report["done"][0]["stats"];
        assert!(stats["points"].as_u64() > Some(0), "{report:#}");
        assert_eq!(stats["playing"], false);
    }
}

#[test]
fn the_handle_plays_seeks_and_steers() {
    let Some(tools) = tools() else { return };
    let folder = folder("browser-handle");
    let prepared = hint_of_a_hall(1);
    prepared.write(&folder);
    let script = "
        const sleep = (ms) => new Promise((resolve) => setTimeout(resolve, ms));
        const until = async (what) => {
          for (let i = 0; i < 600; i++) { if (what()) return true; await sleep(50); }
          return false;
        };
        const facts = {};
        facts.cameras = viewer.cameras;
        facts.duration = viewer.duration;
        viewer.seek(0); viewer.setLoop(true); viewer.play();
        facts.playsOn = await until(() => viewer.time > 0.1);
        let last = viewer.time;
        facts.loops = await until(() => { const fell = viewer.time < last; last = viewer.time; return fell; });
        viewer.pause();
        const still = viewer.time; await sleep(300);
        facts.pauses = viewer.paused && viewer.time === still;
        viewer.seek(1e9);
        facts.seeksToTheEnd = viewer.time === viewer.duration;
        // What leads there is received with the next picture.
        await viewer.screenshot();
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
        const shown = async () => {
          const bytes = new Uint8Array(await (await viewer.screenshot()).arrayBuffer());
          return bytes.reduce((text, byte) => text + String.fromCharCode(byte), '');
        };
        viewer.seek(1); viewer.setCamera(viewer.cameras[0]); await until(() => viewer.stats.age > 0.5);
        const views = new Set();
        for (const view of ['visibility', 'normal', 'points', 'texels', 'weights', 'age', 'error', 'beauty']) {
          viewer.setView(view); views.add(await shown());
        }
        facts.differentViews = views.size;
        const methods = new Set();
        const screen = ['ssao', 'alchemy', 'sao', 'hbao', 'hbao-plus', 'gtao'];
        facts.problems = [];
        for (const method of ['none', ...screen, 'psao-paper', 'psao']) {
          viewer.setMethod(method); methods.add(await shown());
          if (viewer.stats.problem) facts.problems.push(method + ': ' + viewer.stats.problem);
        }
        viewer.setMethod('none'); const open = await shown();
        viewer.setMethod('sd-hbao-plus'); facts.looksBehind = (await shown()) !== open;
        facts.behind = viewer.stats.problem ?? '';
        viewer.setMethod('psao');
        viewer.setSplit(0.3, 'none'); methods.add(await shown()); viewer.setSplit(null);
        facts.differentMethods = methods.size;
        return facts;";
    let pages: Vec<Value> = ["webgpu", "webgl2"]
        .iter()
        .map(|backend| {
            json!({
                "name": backend, "width": 320, "height": 180,
                "scripts": [{ "name": backend, "script": script }],
                "query": format!(
                    "{}&backend={backend}&shadowResolution=64&samples=1&maxPixelRatio=0.3&secondCamera=2", prepared.query(),
                ),
            })
        })
        .collect();
    for (report, looks_behind) in drive(&tools, &folder, &pages, None).into_iter().zip([true, false]) {
        assert_quiet(&report);
        let facts = &report["done"][0]["result"];
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
        assert_eq!(facts["differentViews"], 8, "{report:#}");
        assert_eq!(facts["differentMethods"], 10, "{report:#}");
        assert_eq!(facts["problems"], json!([]), "{report:#}");
        // Stochastic depth is what WebGL2 lacks.
        let behind = facts["behind"].as_str().unwrap_or_default();
        assert_eq!(facts["looksBehind"], looks_behind, "{report:#}");
        assert_eq!(behind.contains("WebGL2"), !looks_behind, "{behind}");
        let refusal = |name: &str| facts[name].as_str().unwrap_or_default().to_owned();
        let known = "psao, psao-paper, ssao, alchemy, sao, hbao, hbao-plus, gtao, sd-ssao, sd-hbao, sd-hbao-plus, none";
        assert_eq!(refusal("badMethod"), format!("there is no method \"magic\": choose from {known}"));
        assert!(refusal("badCamera").contains("there is no camera \"nowhere\""), "{report:#}");
        assert!(refusal("badPlace").contains("finite"), "{report:#}");
    }
}

#[test]
fn what_cannot_be_shown_is_said_in_the_page() {
    let Some(tools) = tools() else { return };
    let folder = folder("browser-messages");
    hint_of_a_hall(0).write(&folder);
    std::fs::write(folder.join("broken.glb"), b"glTF nothing of the kind").expect("a file is written");
    let glb = dapple_scene::builtin::glb("atrium", 0.01).expect("a scene");
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
                "name": name, "query": format!("{query}{}", if query.is_empty() { "" } else { COARSE }), "width": 640, "height": 360, "expectMessage": true, "window": true,
                "light": matches!(*name, "nothing" | "wrong"),
            })
        })
        .collect();
    for (report, (name, _, part)) in drive(&tools, &folder, &pages, None).iter().zip(cases) {
        let message = report["message"].as_str().unwrap_or_default();
        assert!(message.contains(part), "{name}: {report:#}");
        assert!(!message.contains("3D graphics"), "{name} is no fault of the browser: {report:#}");
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
    hint_of_a_hall(0).write(&folder);
    let page = json!({
        "name": "bare", "query": "?scene=data/hall.glb", "width": 640, "height": 360, "expectMessage": true, "window": true,
    });
    let flags = ["--no-sandbox", "--disable-gpu", "--disable-3d-apis"];
    let reports = drive(&tools, &folder, &[page], Some(&flags));
    let message = reports[0]["message"].as_str().unwrap_or_default();
    assert!(message.contains("neither WebGPU nor WebGL2 works here"), "{:#}", reports[0]);
    assert!(!reports[0]["errors"].to_string().contains("panic"), "{:#}", reports[0]);
}
