//! `dapple scene`: lists built-in scenes and writes them.

use std::path::PathBuf;

use anyhow::Result;
use dapple_scene::builtin;

use crate::args::SceneArgs;
use crate::picture::write_file;
use crate::progress::Bar;

pub(crate) fn run(args: &SceneArgs) -> Result<()> {
    let Some(name) = &args.name else {
        for scene in builtin::BUILTINS {
            say!("{:13} {}", scene.name, scene.summary);
        }
        return Ok(());
    };
    let wheel = Bar::spinner(&format!("making {name}"));
    let bytes = builtin::glb(name, args.detail)?;
    drop(wheel);
    let output = args.output.clone().unwrap_or_else(|| PathBuf::from(format!("{name}.glb")));
    write_file(&output, &bytes)?;
    say!("wrote {} ({:.1} MB)", output.display(), bytes.len() as f64 / 1e6);
    Ok(())
}
