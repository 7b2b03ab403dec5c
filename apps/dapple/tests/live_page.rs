//! Pages in a real browser take part in a scene that `dapple serve` lights: what one moves, the others see moved.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

#[cfg(all(unix, feature = "moq"))]
mod common;

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

#[cfg(all(unix, feature = "moq"))]
use common::live::{SMALL, Served};
#[cfg(all(unix, feature = "moq"))]
use common::relay::Relay;
use serde_json::{Value, json};

/// Node.js, the browser, the driver's script and the built page.
type Tools = [PathBuf; 4];

/// The tools; without them a test is skipped, and fails with `REQUIRE_BROWSER=1` in the environment.
fn tools() -> Option<Tools> {
    match find_tools() {
        Ok(tools) => Some(tools),
        Err(reason) if std::env::var_os("REQUIRE_BROWSER").is_some_and(|value| value == "1") => {
            panic!("REQUIRE_BROWSER is set, but {reason}")
        }
        Err(reason) => {
            eprintln!("skipped: live pages in a browser: {reason}");
            None
        }
    }
}

fn find_tools() -> Result<Tools, String> {
    let node = on_path(&["node", "nodejs"]).ok_or("there is no node: install Debian's nodejs and npm")?;
    let browser = on_path(&["chromium", "chromium-browser", "google-chrome", "chrome"])
        .ok_or("there is no Chromium: install Debian's chromium")?;
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../web/tests/browser");
    if !folder.join("node_modules/playwright-core").is_dir() {
        return Err(
            "the driver of the browser is not installed: run `cargo xtask wasm` with npm at hand".into()
        );
    }
    let page = Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("web");
    if !page.join("dapple_web_bg.wasm").is_file() {
        return Err("the page is not built: run `cargo xtask wasm`".into());
    }
    Ok([node, browser, folder.join("live.mjs"), page])
}

fn on_path(names: &[&str]) -> Option<PathBuf> {
    let folders: Vec<PathBuf> = std::env::split_paths(&std::env::var_os("PATH")?).collect();
    names
        .iter()
        .flat_map(|name| folders.iter().map(move |folder| folder.join(name)))
        .find(|path| path.is_file())
}

/// Part of the pixels that differ by more than rounding.
fn difference(folder: &Path, [a, b]: [&str; 2]) -> f64 {
    let [a, b] = [a, b].map(|name| image::open(folder.join(format!("{name}.png"))).unwrap().to_rgb8());
    assert_eq!(a.dimensions(), b.dimensions());
    let differ =
        |(a, b): &(&image::Rgb<u8>, &image::Rgb<u8>)| a.0.iter().zip(b.0).any(|(a, b)| a.abs_diff(b) > 8);
    let count = a.pixels().zip(b.pixels()).filter(differ).count();
    count as f64 / f64::from(a.width() * a.height())
}

/// Runs a driver's script with a plan; gives the facts that it found.
fn drive(node: &Path, driver: &Path, folder: &Path, plan: &Value) -> Value {
    let file = folder.join("plan.json");
    std::fs::write(&file, plan.to_string()).unwrap();
    let output = Command::new(node).args([driver, &file]).stdin(Stdio::null()).output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "the driver ended with {}:\n{errors}", output.status);
    let facts: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(facts["errors"], json!([]), "{facts:#}");
    facts
}

/// An empty folder for what a test leaves behind.
fn folder_of(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    // What an earlier run left is no error.
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

#[test]
#[cfg(all(unix, feature = "moq"))]
fn pages_over_webtransport_see_what_those_over_a_websocket_see() {
    let Some([node, browser, driver, page]) = tools() else { return };
    let folder = folder_of("moq-page");
    let relay = Relay::start(&folder, None);
    let mut arguments = vec!["--moq", "--page", page.to_str().unwrap()];
    if let Some(relay) = &relay {
        arguments.extend(["--relay", &relay.url]);
    }
    let served = Served::start(&folder, 0, &arguments);
    let port = served.port.to_string();
    let again = [&SMALL[..], &["--port", &port], &arguments[..3]].concat();
    // Nobody answers there: it is held, and not listened to.
    let dead = std::net::UdpSocket::bind("127.0.0.1:0").unwrap();
    let plan = json!({
        "browser": browser, "url": format!("http://127.0.0.1:{}/", served.port), "out": folder,
        "port": dead.local_addr().unwrap().port(), "relay": relay.as_ref().map(|relay| &relay.url),
        "server": served.child.id(), "again": [env!("CARGO_BIN_EXE_dapple"), again],
    });
    let facts = drive(&node, &driver.with_file_name("moq.mjs"), &folder, &plan);
    assert_eq!(facts["transports"], json!(["WebTransport", "WebTransport", "WebSocket"]), "{facts:#}");
    assert_eq!(facts["placed"][0], facts["placed"][1], "{facts:#}");
    assert_eq!(facts["placed"][0], facts["placed"][2], "{facts:#}");
    assert_eq!(facts["figures"], "WebTransport");
    assert!(facts["text"].as_str().unwrap().contains("live"), "{facts:#}");
    assert!(
        facts["light"][0].as_u64().unwrap() > 1000 && facts["light"][0] == facts["light"][2],
        "{facts:#}"
    );
    assert_eq!(facts["walled"], "WebSocket", "{facts:#}");
    if relay.is_some() {
        assert_eq!(facts["relayed"], json!(["WebTransport", facts["light"][0]]), "{facts:#}");
    }
    assert_eq!(facts["again"], "WebTransport", "{facts:#}");
}

#[test]
fn what_one_page_moves_the_others_see() {
    let Some([node, browser, driver, page]) = tools() else { return };
    let folder = folder_of("live-page");
    let page = page.to_str().unwrap();
    let spares: Vec<String> = (0..12).map(|i| format!("boulder-{i}=1")).collect();
    let serve = |detail: &'static str| {
        let scene = ["serve", "--builtin", "atrium", "--detail", detail, "--points", "128", "--hz", "10"];
        let access = ["--token", "interact=touch", "--max-viewers", "2", "--page", page];
        let mut arguments = [&scene[..], &access].concat();
        // Whichever is in view, there is another like it.
        arguments.extend(spares.iter().flat_map(|spare| ["--spare", spare]));
        arguments
    };
    let plan = json!({
        "browser": browser, "program": env!("CARGO_BIN_EXE_dapple"), "serve": serve("0.2"), "other": serve("0.1"),
        "token": "touch", "out": folder,
    });
    let facts = drive(&node, &driver, &folder, &plan);

    assert_eq!(facts["roles"], json!(["interact", "view"]));
    assert_eq!(facts["bits"], 500_000);
    assert_eq!(facts["times"], facts["timesLater"], "time stands still");
    assert_eq!(facts["times"][0], facts["times"][1], "for all");

    let placed = &facts["placed"][0];
    assert_eq!(placed["node"], facts["boulder"]["node"]);
    for axis in 0..3 {
        let [at, goal] =
            [&placed["placement"]["translation"], &facts["goal"]].map(|v| v[axis].as_f64().unwrap());
        assert!((at - goal).abs() < 1e-5, "{facts:#}");
    }
    let moved = difference(&folder, ["before", "after"]);
    let between = difference(&folder, ["after", "after-mover"]);
    println!("{moved:.4} of the looker's picture changed; {between:.4} differs from the mover's");
    assert!(moved > 0.02, "the other's picture stays as it was: {moved}");
    assert!(between < 0.5 * moved, "both show the same: {between} {moved}");

    let says = |fact: &str, parts: &[&str]| {
        let text = facts[fact].as_str().unwrap_or_default();
        for part in parts {
            assert!(text.contains(part), "{fact} does not say {part:?}: {facts:#}");
        }
    };
    says("refusedChange", &["may look"]);
    assert_eq!(facts["lookerTools"], false);
    assert_eq!(facts["lookerPlay"], false);
    says("looker", &["live", "view only", "2 viewers"]);
    assert_eq!(facts["dragged"]["node"], facts["boulder"]["node"]);
    assert_eq!(facts["lifted"]["node"], facts["boulder"]["node"]);
    says("tools", &["boulder", "Move", "Lift", "Add another", "Remove", "Reset"]);
    assert_eq!(facts["byHand"], true);

    says("full", &["the server is full", "trying again"]);
    says("stranger", &["not live", "token", "?token="]);
    assert_eq!(facts["strangerReload"], false);
    says("gone", &["reconnecting"]);
    assert_eq!(facts["goneMessage"], false, "what came stays in view");
    says("goneChange", &["no connection"]);
    assert!(difference(&folder, ["before", "picture-gone"]) < 0.9);
    says("back", &["live"]);
    assert_eq!(facts["roleBack"], "interact");
    says("phone", &["live"]);
    says("phoneTools", &["boulder"]);
    says("otherScene", &["not live", "another scene"]);
    assert_eq!(facts["otherReload"], true);
    assert_eq!(facts["reloaded"], true);
}
