//! Files that an interrupted run never leaves half written.

use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use anyhow::{Context, Result};

/// Writes a whole file: into a neighbour first, then renamed over the old one.
pub(crate) fn write_file(path: &Path, bytes: &[u8]) -> Result<()> {
    write_parts(path, &[bytes])
}

/// Fails where a file could not be written, before the work that would be lost.
pub(crate) fn check_writable(path: &Path) -> Result<()> {
    let refuse = |error: std::io::Error| anyhow::anyhow!("cannot write {}: {error}", path.display());
    if path.is_dir() {
        anyhow::bail!("cannot write {}: it is a folder", path.display());
    }
    let folder = path.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."));
    match std::fs::metadata(folder) {
        Ok(found) if !found.is_dir() => {
            anyhow::bail!("cannot write {}: {} is no folder", path.display(), folder.display())
        }
        // It will be made.
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(refuse(error)),
        Ok(_) => {}
    }
    if std::fs::metadata(path).is_ok_and(|m| !m.is_file()) {
        return Ok(());
    }
    let trial = Partial::beside(path, path.file_name().unwrap_or_default());
    std::fs::File::create(&trial.path).map(|_| ()).map_err(refuse)
}

/// As [`write_file`], of bytes that follow each other.
pub(crate) fn write_parts(path: &Path, parts: &[&[u8]]) -> Result<()> {
    if let Some(folder) = path.parent().filter(|f| !f.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder)
            .with_context(|| format!("cannot create the folder {}", folder.display()))?;
    }
    // What is written to follows links, and a device or pipe is written into, not replaced.
    let resolved = std::fs::canonicalize(path);
    let path = resolved.as_deref().unwrap_or(path);
    if std::fs::metadata(path).is_ok_and(|m| !m.is_file() && !m.is_dir()) {
        let written = std::fs::File::create(path)
            .and_then(|mut file| parts.iter().try_for_each(|part| file.write_all(part)));
        return written.with_context(|| format!("cannot write {}", path.display()));
    }
    let name = path.file_name().with_context(|| format!("{} names no file", path.display()))?;
    let partial = Partial::beside(path, name);
    let written = std::fs::File::create(&partial.path).and_then(|mut file| {
        parts.iter().try_for_each(|part| file.write_all(part))?;
        file.sync_all()
    });
    let moved = written.and_then(|()| std::fs::rename(&partial.path, path));
    moved.with_context(|| format!("cannot write {}", path.display()))
}

/// All files that are being written, by all threads.
static PARTIAL: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn partial_files() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    PARTIAL.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The neighbour that a file is written into until it is whole. It is gone when this is dropped, if it was not renamed, and when
/// the program is told to stop.
struct Partial {
    path: PathBuf,
}

impl Partial {
    fn beside(path: &Path, name: &OsStr) -> Partial {
        let mut partial = name.to_owned();
        partial.push(format!(".{}.tmp", std::process::id()));
        let path = path.with_file_name(partial);
        partial_files().insert(path.clone());
        Partial { path }
    }
}

impl Drop for Partial {
    fn drop(&mut self) {
        // Fails where it was renamed or never made.
        let _ = std::fs::remove_file(&self.path);
        partial_files().remove(&self.path);
    }
}

/// From now on Ctrl-C and a request to end take what is half written along. Nothing can be done about a kill.
pub(crate) fn watch_interrupts() {
    let wait = || {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
        runtime.block_on(wait_for_interrupt())
    };
    let watch = move || match wait() {
        Ok(number) => {
            // Held until the end, so that no other file is begun.
            let partial = partial_files();
            for path in partial.iter() {
                let _ = std::fs::remove_file(path);
            }
            // As shells tell what a signal ended.
            std::process::exit(128 + number)
        }
        Err(error) => tracing::debug!("signals end the program at once: {error}"),
    };
    // Without the thread signals do what they do anyway.
    let _ = std::thread::Builder::new().name("interrupts".to_owned()).spawn(watch);
}

/// Waits for a signal to end; gives its number.
#[cfg(unix)]
pub(crate) async fn wait_for_interrupt() -> std::io::Result<i32> {
    use std::task::Poll;
    use tokio::signal::unix::{SignalKind, signal};

    let kinds = [SignalKind::interrupt(), SignalKind::terminate()];
    let mut signals = [signal(kinds[0])?, signal(kinds[1])?];
    let first = std::future::poll_fn(|context| {
        let came = signals.iter_mut().position(|signal| signal.poll_recv(context).is_ready());
        came.map_or(Poll::Pending, Poll::Ready)
    });
    Ok(kinds[first.await].as_raw_value())
}

#[cfg(not(unix))]
pub(crate) async fn wait_for_interrupt() -> std::io::Result<i32> {
    const SIGINT: i32 = 2;
    tokio::signal::ctrl_c().await.map(|()| SIGINT)
}
