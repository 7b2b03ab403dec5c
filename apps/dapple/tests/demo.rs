//! The demo's server: what a browser fetches from it, and how it ends.
#![allow(clippy::unwrap_used, reason = "tests may panic")]

mod common;

use std::io::{BufRead, BufReader, Read};
use std::net::TcpListener;
use std::path::Path;
use std::process::{Child, Command, Stdio};

use common::command::{dapple, fail};
use common::http::get;
use dapple_stream::{Limits, Recording};
use tempfile::TempDir;

const SMALL: [&str; 9] = ["demo", "--page", "page", "--detail", "0.05", "--points", "20", "--seconds", "0.4"];

/// A folder with a page as `cargo xtask wasm` lays it out, in names.
fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    let page = folder.path().join("page");
    std::fs::create_dir_all(page.join("nested")).unwrap();
    let text = "<!doctype html><title>page</title>".repeat(50);
    for (name, bytes) in [
        ("index.html", text.as_bytes()),
        ("dapple_bg.wasm", b"\0asm\x01\0\0\0"),
        ("main.js", b"export {};"),
        ("nested/style.css", b"body { margin: 0 }"),
    ] {
        std::fs::write(page.join(name), bytes).unwrap();
    }
    folder
}

/// Starts the demo without `CI` and waits for its address.
#[allow(clippy::zombie_processes, reason = "the caller waits; on the other way out the test fails")]
fn start(at: &Path, arguments: &[&str]) -> (Child, BufReader<std::process::ChildStdout>, u16) {
    let mut child = dapple(at, arguments).env_remove("CI").stdout(Stdio::piped()).spawn().unwrap();
    let mut out = BufReader::new(child.stdout.take().unwrap());
    loop {
        let mut line = String::new();
        assert!(out.read_line(&mut line).unwrap() > 0, "it ended before it said its address");
        if let Some(address) = line.trim().strip_prefix("the page: http://127.0.0.1:") {
            return (child, out, address.trim_end_matches('/').parse().unwrap());
        }
    }
}

#[cfg(unix)]
#[test]
fn a_browser_gets_everything_and_ctrl_c_ends_it() {
    let folder = folder();
    let at = folder.path();
    let arguments = [&SMALL[..], &["--port", "0"]].concat();
    let (mut child, mut out, port) = start(at, &arguments);
    for (path, kind) in [
        ("/", "text/html"),
        ("/index.html", "text/html"),
        ("/main.js", "text/javascript"),
        ("/nested/style.css", "text/css"),
        ("/dapple_bg.wasm", "application/wasm"),
        ("/viewer.json", "application/json"),
        ("/scene.glb", "model/gltf-binary"),
        ("/scene.dapple", "application/octet-stream"),
    ] {
        let (status, head, body) = get(port, path, "");
        assert_eq!(status, 200, "{path}: {head}");
        assert!(head.contains(&format!("content-type: {kind}")), "{path}: {head}");
        assert!(!body.is_empty(), "{path}");
    }
    let (_, head, stream) = get(port, "/scene.dapple", "Accept-Encoding: gzip\r\n");
    assert!(!head.contains("content-encoding") && head.contains("content-length"), "{head}");
    let recording = Recording::parse(stream, &Limits::default()).unwrap();
    let (_, _, scene) = get(port, "/scene.glb", "");
    let scene = dapple_scene::load("scene.glb", &scene, &dapple_scene::NoFiles).unwrap();
    assert_eq!(recording.header().unwrap().scene_hash, scene.hash().0);
    let (_, head, _) = get(port, "/", "Accept-Encoding: gzip\r\n");
    assert!(head.contains("content-encoding: gzip"), "{head}");
    let (_, head, part) = get(port, "/scene.dapple", "Range: bytes=0-7\r\n");
    assert!(head.contains("206") && part == b"DAPPLE\r\n", "{head}");
    assert_eq!(get(port, "/absent.html", "").0, 404);
    assert_eq!(get(port, "/../Cargo.toml", "").0, 404);

    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let mut rest = String::new();
    out.read_to_string(&mut rest).unwrap();
    assert!(child.wait().unwrap().success() && rest.contains("ended"), "{rest}");
}

#[test]
fn under_ci_it_looks_at_itself_and_ends_and_makes_things_once() {
    let folder = folder();
    let at = folder.path();
    let run = |arguments: &[&str]| {
        let output = dapple(at, arguments).env("CI", "true").output().unwrap();
        let [out, err] =
            [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text).into_owned());
        assert!(output.status.success(), "{out}\n{err}");
        out
    };
    let out = run(&SMALL);
    assert!(out.contains("answers") && out.contains("made out"), "{out}");
    let made = |name: &str| std::fs::read(at.join("out/demo-page").join(name)).unwrap();
    let stream = made("scene.dapple");
    assert!(run(&SMALL).contains("up to date"));
    // Damaged, or asked for otherwise, it is made again.
    std::fs::write(at.join("out/demo-page/scene.dapple"), &stream[..100]).unwrap();
    assert!(run(&SMALL).contains("made out"));
    assert!(stream == made("scene.dapple"), "the same again");
    assert!(run(&[&SMALL[..], &["--hz", "5"]].concat()).contains("made out"));
    assert!(stream != made("scene.dapple"));
}

#[test]
fn what_keeps_it_from_serving_is_named() {
    let folder = folder();
    let at = folder.path();
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port().to_string();
    fail(at, &[&SMALL[..], &["--port", &port]].concat(), &[&port, "in use", "--port"]);
    fail(at, &["demo", "--page", "absent"], &["absent", "cargo xtask wasm"]);
    fail(at, &[&SMALL[..], &["--host", "no.such.host.invalid"]].concat(), &["no.such.host.invalid"]);
    fail(at, &["demo", "--page", "page", "--builtin", "palace"], &["palace", "atrium"]);
    assert!(!at.join("out").exists(), "nothing is made before it is known that it can be served");
}
