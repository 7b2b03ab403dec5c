//! An unmodified MoQ relay, for the tests and measurements that put one between a server and its viewers.

use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail};

/// The version that speaks as `crates/moq` does; the two go up together.
const VERSION: &str = "0.17.10";

/// Installs it into the build folder, unless it is there.
pub(crate) fn install(target: &Path) -> Result<()> {
    let folder = target.join("relay");
    let program = folder.join("bin/moq-relay").with_extension(std::env::consts::EXE_EXTENSION);
    if says_version(&program) {
        println!("{} is there", program.display());
        return Ok(());
    }
    println!("installing moq-relay {VERSION} into {}: some minutes, once", folder.display());
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let status = Command::new(cargo)
        .args(["install", "--quiet", "moq-relay", "--version", &format!("={VERSION}")])
        .args(["--no-default-features", "--features", "noq,websocket", "--debug", "--root"])
        .arg(&folder)
        // Its own build folder goes away again.
        .env_remove("CARGO_TARGET_DIR")
        .stdin(Stdio::null())
        .status()
        .context("cannot start cargo")?;
    if !status.success() {
        bail!("`cargo install moq-relay` ended with {status}");
    }
    Ok(())
}

fn says_version(program: &Path) -> bool {
    let output = Command::new(program).arg("--version").stdin(Stdio::null()).output();
    output.is_ok_and(|output| String::from_utf8_lossy(&output.stdout).contains(VERSION))
}
