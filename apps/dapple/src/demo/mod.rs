//! `dapple demo`: a scene, its light and the page, served on this machine.

mod content;
mod serve;

use std::path::Path;

use anyhow::{Context, Result};

use crate::args::DemoArgs;
use crate::listen;
use crate::page::built_page;

/// Makes what is missing, serves it, and returns when told to stop, or after one look at itself under CI.
pub(crate) fn run(args: &DemoArgs) -> Result<()> {
    // Before anything takes time.
    let page = built_page(args.page.as_deref())?;
    let listener = listen::bind(&args.host, args.port)?;
    content::make(args)?;
    copy_page(&page, &args.out)?;
    // Set but empty is as good as not set.
    let only_check = std::env::var_os("CI").is_some_and(|value| !value.is_empty());
    serve::serve(listener, &args.out, only_check)
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
