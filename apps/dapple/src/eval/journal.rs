//! What a run has finished, kept so that the same command continues where it was stopped.
//!
//! Each finished job is one file, named by a hash of everything that its outcome depends on, the program included. So
//! nothing is taken for done that another program, scene or setting would have done differently.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::picture::write_file;
use crate::source::read_limited;

/// The largest file that is read back.
const MAX_BYTES: u64 = 1 << 30;

pub(super) struct Journal {
    /// Where results lie; pictures are named relative to it.
    out: PathBuf,
    /// Hash of the program.
    program: String,
}

/// What one file holds.
#[derive(Serialize, Deserialize)]
struct Entry<T> {
    /// In full, against two of the same hash.
    key: serde_json::Value,
    value: T,
}

/// Names a job.
#[derive(Debug, Clone)]
pub(super) struct Key {
    text: serde_json::Value,
    /// Hexadecimal, 16 digits.
    hash: String,
}

impl Key {
    /// Short, for the names of files that belong to the job.
    pub(super) fn short(&self) -> &str {
        &self.hash[..8]
    }
}

impl Journal {
    /// The journal of results in `out`; `fresh` forgets what was done before.
    pub(super) fn open(out: &Path, fresh: bool) -> Result<Journal> {
        if fresh {
            forget(&out.join("jobs"))?;
            forget_pictures(&out.join("pictures"))?;
        }
        let program = std::env::current_exe().context("cannot find the program's own file")?;
        let bytes = std::fs::read(&program)
            .with_context(|| format!("cannot read the program's own file {}", program.display()))?;
        Ok(Journal { out: out.to_owned(), program: hex(&blake3::hash(&bytes)) })
    }

    /// Hash of the program's file, 16 hexadecimal digits.
    pub(super) fn program(&self) -> &str {
        &self.program
    }

    /// The name of a job, from everything that its outcome depends on.
    pub(super) fn key(&self, what: serde_json::Value) -> Key {
        let text = serde_json::json!({ "program": self.program, "job": what });
        let hash = hex(&blake3::hash(text.to_string().as_bytes()));
        Key { text, hash }
    }

    /// What the job gave, if it was finished and the files that it names are still there.
    pub(super) fn get<T: DeserializeOwned>(&self, key: &Key, files: impl Fn(&T) -> Vec<String>) -> Option<T> {
        let bytes = read_limited(&self.file(key), MAX_BYTES).ok()?;
        // What cannot be read was not finished.
        let entry: Entry<T> = serde_json::from_slice(&bytes).ok()?;
        let whole =
            entry.key == key.text && files(&entry.value).iter().all(|file| self.out.join(file).is_file());
        whole.then_some(entry.value)
    }

    /// Keeps what a job gave.
    pub(super) fn put<T: Serialize>(&self, key: &Key, value: &T) -> Result<()> {
        let entry = Entry { key: key.text.clone(), value };
        write_file(&self.file(key), &serde_json::to_vec(&entry)?)
    }

    fn file(&self, key: &Key) -> PathBuf {
        self.out.join("jobs").join(format!("{}.json", key.hash))
    }
}

/// Removes the files of finished jobs, and nothing else that may lie there.
fn forget(folder: &Path) -> Result<()> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Ok(()) };
    for entry in entries {
        let path = entry.with_context(|| format!("cannot read the folder {}", folder.display()))?.path();
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let is_hash = stem.len() == 16 && stem.bytes().all(|b| b.is_ascii_hexdigit());
        if is_hash && path.extension().is_some_and(|e| e == "json") {
            std::fs::remove_file(&path).with_context(|| format!("cannot remove {}", path.display()))?;
        }
    }
    Ok(())
}

/// Removes the folders of jobs' pictures, which end with a point and eight digits of the job's hash, and nothing else.
fn forget_pictures(folder: &Path) -> Result<()> {
    let Ok(cases) = std::fs::read_dir(folder) else { return Ok(()) };
    for case in cases.flatten() {
        for job in std::fs::read_dir(case.path()).into_iter().flatten().flatten() {
            let path = job.path();
            let end = path.extension().unwrap_or_default().to_string_lossy();
            if path.is_dir() && end.len() == 8 && end.bytes().all(|b| b.is_ascii_hexdigit()) {
                std::fs::remove_dir_all(&path)
                    .with_context(|| format!("cannot remove {}", path.display()))?;
            }
        }
    }
    Ok(())
}

/// The first 16 hexadecimal digits.
fn hex(hash: &blake3::Hash) -> String {
    hash.to_hex()[..16].to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn only_whole_jobs_of_the_same_name_count() {
        let folder = tempfile::tempdir().unwrap();
        let journal = Journal::open(folder.path(), false).unwrap();
        let key = journal.key(json!({ "scene": 1 }));
        let none = |_: &Vec<f64>| Vec::new();
        assert_eq!(journal.get(&key, none), None);
        let value = vec![0.1 + 0.2, f64::MIN_POSITIVE, 1e300 / 3.0];
        journal.put(&key, &value).unwrap();
        assert_eq!(journal.get(&key, none), Some(value.clone()), "to the last bit");
        assert_eq!(journal.get(&journal.key(json!({ "scene": 2 })), none), None);
        // A picture that it names is gone.
        let picture = |_: &Vec<f64>| vec!["picture.png".to_owned()];
        assert_eq!(journal.get(&key, picture), None);
        std::fs::write(folder.path().join("picture.png"), "").unwrap();
        assert_eq!(journal.get(&key, picture), Some(value));
        // Half a file.
        let file = journal.file(&key);
        let bytes = std::fs::read(&file).unwrap();
        std::fs::write(&file, &bytes[..bytes.len() / 2]).unwrap();
        assert_eq!(journal.get(&key, none), None);
        // What is not a job's stays.
        let foreign = folder.path().join("jobs/thesis.json");
        std::fs::write(&foreign, "").unwrap();
        let pictures = folder.path().join("pictures/room");
        for name in ["points-512-15hz.0123abcd/000.png", "mine/000.png", "notes.0123abcd"] {
            let file = pictures.join(name);
            std::fs::create_dir_all(file.parent().unwrap()).unwrap();
            std::fs::write(file, "").unwrap();
        }
        let again = Journal::open(folder.path(), true).unwrap();
        assert!(!again.file(&key).exists() && foreign.exists());
        assert!(!pictures.join("points-512-15hz.0123abcd").exists());
        assert!(pictures.join("mine/000.png").exists() && pictures.join("notes.0123abcd").exists());
    }
}
