//! Puts the page together: glue for the compiled program, the page's own files, and a check of the size.
//!
//! `assemble-web PROGRAMS_FOLDER PAGE_FOLDER OUT_FOLDER`

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use wasm_bindgen_cli_support::Bindgen;

/// Names of the glue (`.js`) and, with `_bg`, of a program (`.wasm`), and most bytes of it as a server sends it, compressed.
const PROGRAMS: [(&str, usize); 2] = [("dapple_web", 1_700_000), ("dapple_web_moq", 600_000)];

fn main() -> ExitCode {
    let arguments: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let [programs, page, out] = arguments.as_slice() else {
        eprintln!("assemble-web takes PROGRAMS_FOLDER PAGE_FOLDER OUT_FOLDER");
        return ExitCode::FAILURE;
    };
    match assemble(programs, page, out) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error:#}");
            ExitCode::FAILURE
        }
    }
}

fn assemble(programs: &Path, page: &Path, out: &Path) -> Result<()> {
    std::fs::create_dir_all(out).with_context(|| format!("cannot make {}", out.display()))?;
    for (name, _) in PROGRAMS {
        let program = programs.join(name).with_extension("wasm");
        let mut bindgen = Bindgen::new();
        bindgen
            .input_path(&program)
            .out_name(name)
            .typescript(false)
            .remove_name_section(true)
            .remove_producers_section(true)
            .web(true)?;
        bindgen.generate(out).with_context(|| format!("cannot make the glue of {}", program.display()))?;
    }
    for file in std::fs::read_dir(page).with_context(|| format!("cannot list {}", page.display()))? {
        let from = file?.path();
        if let (true, Some(name)) = (from.is_file(), from.file_name()) {
            std::fs::copy(&from, out.join(name))
                .with_context(|| format!("cannot copy {}", from.display()))?;
        }
    }
    for (name, most) in PROGRAMS {
        let wasm = out.join(format!("{name}_bg.wasm"));
        let (whole, gzipped) = size(&wasm)?;
        println!("{}: {}, {} gzipped", wasm.display(), megabytes(whole), megabytes(gzipped));
        if gzipped > most {
            bail!(
                "{name} has {gzipped} bytes gzipped, more than {most}: look for what came in last (`cargo tree -p {} --target \
                 wasm32-unknown-unknown`)",
                name.replace('_', "-")
            );
        }
    }
    Ok(())
}

/// Bytes of a file, and of the same compressed by gzip at its best.
fn size(path: &Path) -> Result<(usize, usize)> {
    let bytes = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    encoder.write_all(&bytes)?;
    Ok((bytes.len(), encoder.finish()?.len()))
}

fn megabytes(bytes: usize) -> String {
    format!("{:.2} MB", bytes as f64 / 1e6)
}
