//! `dapple demo`: a scene, its light and the page, served on this machine.

mod content;
mod serve;

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use crate::args::DemoArgs;

/// Makes what is missing, serves it, and returns when told to stop, or after one look at itself under CI.
pub(crate) fn run(args: &DemoArgs) -> Result<()> {
    // Before anything takes time.
    let page = find_page(args.page.as_deref())?;
    let listener = serve::bind(&args.host, args.port)?;
    content::make(args)?;
    copy_page(&page, &args.out)?;
    // Set but empty is as good as not set.
    let only_check = std::env::var_os("CI").is_some_and(|value| !value.is_empty());
    serve::serve(listener, &args.out, only_check)
}

/// The folder of the built page.
fn find_page(given: Option<&Path>) -> Result<PathBuf> {
    let built = |folder: &Path| folder.join("index.html").is_file();
    let advice = "build it with `cargo xtask wasm`, which writes target/web, or name its folder with --page";
    if let Some(folder) = given {
        if !built(folder) {
            bail!("there is no page in {}: {advice}", folder.display());
        }
        return Ok(folder.to_owned());
    }
    let here = PathBuf::from("target/web");
    // Beside this program's own build folder.
    let beside = std::env::current_exe().ok().and_then(|exe| Some(exe.parent()?.parent()?.join("web")));
    [Some(here), beside]
        .into_iter()
        .flatten()
        .find(|folder| built(folder))
        .with_context(|| format!("there is no page in target/web: {advice}"))
}

/// Puts the page beside the scene.
fn copy_page(from: &Path, to: &Path) -> Result<()> {
    let entries =
        std::fs::read_dir(from).with_context(|| format!("cannot read the page in {}", from.display()))?;
    for entry in entries {
        let path = entry.with_context(|| format!("cannot read the page in {}", from.display()))?.path();
        let Some(name) = path.file_name() else { continue };
        let target = to.join(name);
        if path.is_dir() {
            std::fs::create_dir_all(&target)
                .with_context(|| format!("cannot create the folder {}", target.display()))?;
            copy_page(&path, &target)?;
        } else {
            std::fs::copy(&path, &target)
                .with_context(|| format!("cannot copy {} to {}", path.display(), target.display()))?;
        }
    }
    Ok(())
}
