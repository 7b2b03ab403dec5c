//! Builds the page: `cargo xtask wasm`.

use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail};

const TARGET: &str = "wasm32-unknown-unknown";
const PROFILE: &str = "wasm-release";

/// Whether programs for browsers can be compiled here.
pub(crate) fn has_target() -> bool {
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let output = Command::new(rustc)
        .args(["--print", "target-libdir", "--target", TARGET])
        .stdin(Stdio::null())
        .stderr(Stdio::null())
        .output();
    output.is_ok_and(|output| Path::new(String::from_utf8_lossy(&output.stdout).trim()).is_dir())
}

/// Folders of tests that need packages for JavaScript.
const TEST_FOLDERS: [&str; 2] = ["apps/web/tests/browser", "apps/dapple/tests/bake/readers"];

/// Installs what drives a browser in tests and what reads baked files, where there is npm and it is not installed yet. That there
/// is none is no error: those tests then say that they were skipped.
pub(crate) fn install_test_packages(root: &Path) {
    for folder in TEST_FOLDERS {
        install(&root.join(folder));
    }
}

fn install(folder: &Path) {
    // npm leaves this file behind when it is done; it is as old as what it installed.
    let modified = |path: &str| folder.join(path).metadata().and_then(|metadata| metadata.modified()).ok();
    let (installed, wanted) = (modified("node_modules/.package-lock.json"), modified("package-lock.json"));
    if installed >= wanted {
        return;
    }
    let npm = if cfg!(windows) { "npm.cmd" } else { "npm" };
    println!("{npm} ci in {}", folder.display());
    let status = Command::new(npm)
        .args(["ci", "--ignore-scripts", "--no-audit", "--no-fund"])
        .current_dir(folder)
        .stdin(Stdio::null())
        .status();
    match status {
        Ok(status) if status.success() => {}
        Ok(status) => println!("npm ended with {status}: tests that need it will be skipped"),
        Err(_) => println!("npm is not installed: tests that need it will be skipped"),
    }
}

/// Builds the page into `web` of the build folder; `cargo` runs cargo in the workspace.
pub(crate) fn build(root: &Path, target_folder: &Path, cargo: impl Fn(&[&str]) -> Result<()>) -> Result<()> {
    if !has_target() {
        bail!("Rust cannot compile for browsers here: run `rustup target add {TARGET}`");
    }
    let profile = format!("--profile={PROFILE}");
    // Apart: what speaks WebTransport is fetched by those pages alone that use it.
    for package in ["dapple-web", "dapple-web-moq"] {
        let package = format!("--package={package}");
        let target = format!("--target={TARGET}");
        cargo(&["rustc", &package, "--lib", "--crate-type=cdylib", &target, &profile])?;
    }
    let programs = target_folder.join(TARGET).join(PROFILE);
    let [page, out] = [root.join("apps/web/page"), target_folder.join("web")];
    let path = |path: &Path| path.to_str().map(str::to_owned).context("a folder's name is not UTF-8");
    cargo(&[
        "run",
        "--quiet",
        "--package=xtask",
        "--features=web",
        "--bin=assemble-web",
        "--",
        &path(&programs)?,
        &path(&page)?,
        &path(&out)?,
    ])?;
    println!("the page: {}, for any static server", out.join("index.html").display());
    Ok(())
}
