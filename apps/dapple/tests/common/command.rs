//! Runs the command `dapple` and reads what it says and writes.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// The program with some arguments, in `folder`, not yet started.
pub(crate) fn dapple(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_dapple"));
    command.current_dir(folder).args(arguments).env_remove("DAPPLE_LOG").env("NO_COLOR", "1");
    command
}

pub(crate) fn run(folder: &Path, arguments: &[&str]) -> (Output, String, String) {
    let output = dapple(folder, arguments).output().unwrap();
    let [out, err] =
        [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
    assert!(!err.contains("panicked"), "{arguments:?} panicked:\n{err}");
    (output, out, err)
}

/// What a run that must succeed prints.
pub(crate) fn succeed(folder: &Path, arguments: &[&str]) -> String {
    let (output, out, err) = run(folder, arguments);
    assert!(output.status.success(), "{arguments:?}: {}\n{out}\n{err}", output.status);
    out
}

/// The message of a run that must fail, which names all of `names`. No file may be left half written.
pub(crate) fn fail(folder: &Path, arguments: &[&str], names: &[&str]) -> String {
    let (output, out, err) = run(folder, arguments);
    assert!(output.status.code().is_some_and(|code| code != 0), "{arguments:?} should fail:\n{out}\n{err}");
    assert!(err.starts_with("error: "), "{arguments:?}: {err}");
    for name in names {
        assert!(err.contains(name), "{arguments:?} does not say {name:?}: {err}");
    }
    assert_eq!(partial_files(folder), Vec::<PathBuf>::new(), "{arguments:?}");
    err
}

/// All files below a folder, in order.
pub(crate) fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() { folders.push(path) } else { found.push(path) }
        }
    }
    found.sort();
    found
}

/// Files below a folder that a write began and did not finish.
pub(crate) fn partial_files(folder: &Path) -> Vec<PathBuf> {
    files(folder).into_iter().filter(|path| path.extension().is_some_and(|e| e == "tmp")).collect()
}

/// The size of a PNG, all of which can be decoded.
pub(crate) fn png_size(path: &Path) -> (u32, u32) {
    let picture = image::open(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    (picture.width(), picture.height())
}
