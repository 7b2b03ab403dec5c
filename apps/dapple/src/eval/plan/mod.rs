//! What an evaluation is to do: scenes and settings from flags or from a suite's file, checked before anything runs.

mod settings;
mod suite;

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use super::study::Study;
use crate::args::{Options, SceneChoice, ScenesArgs};

pub(super) use settings::{CLIENT_HZ, Settings};

/// The scene and detail of an evaluation without arguments.
const DEFAULT_SCENE: &str = "atrium";
const DEFAULT_DETAIL: f32 = 0.15;

/// Everything that one command evaluates.
#[derive(Debug)]
pub(super) struct Plan {
    pub(super) title: String,
    pub(super) entries: Vec<Entry>,
    pub(super) studies: Vec<StudyEntry>,
}

/// One study, and what it looks at.
#[derive(Debug)]
pub(super) struct StudyEntry {
    /// As the suite names it.
    pub(super) kind: String,
    pub(super) study: Box<dyn Study>,
    /// The scene and the settings; none for a study without.
    pub(super) entry: Option<Entry>,
}

/// One scene, along one or several of its paths.
#[derive(Debug)]
pub(super) struct Entry {
    pub(super) scene: SceneChoice,
    /// What to call it: the file's or built-in scene's name.
    pub(super) name: String,
    pub(super) settings: Settings,
}

impl Plan {
    pub(super) fn new(scenes: &ScenesArgs, flags: &Options) -> Result<Plan> {
        let plan = match &scenes.suite {
            Some(suite) => suite::read(suite, scenes.scenes_folder.as_deref(), flags)?,
            None => from_flags(scenes, flags)?,
        };
        let of_studies = plan.studies.iter().filter_map(|study| study.entry.as_ref());
        for entry in plan.entries.iter().chain(of_studies) {
            if let Some(path) = &entry.scene.scene {
                // A typing mistake must not show after hours.
                std::fs::File::open(path)
                    .with_context(|| format!("cannot read the scene {}", path.display()))?;
            }
        }
        Ok(plan)
    }
}

fn from_flags(args: &ScenesArgs, flags: &Options) -> Result<Plan> {
    if let (Some(file), Some(_)) = (args.scenes.first(), flags.detail)
        && args.builtin.is_empty()
    {
        bail!("--detail is for built-in scenes; {} is a file", file.display());
    }
    let files = args.scenes.iter().map(|path| entry(Which::File(path.clone()), flags, false));
    let builtins = args.builtin.iter().map(|name| entry(Which::Builtin(name.clone()), flags, false));
    let mut entries: Vec<Entry> = files.chain(builtins).collect::<Result<_>>()?;
    let small = entries.is_empty();
    if small {
        entries.push(entry(Which::Builtin(DEFAULT_SCENE.to_owned()), flags, true)?);
    }
    let mut names: Vec<&str> = entries.iter().map(|e| e.name.as_str()).collect();
    names.dedup();
    Ok(Plan { title: names.join(", "), entries, studies: Vec::new() })
}

/// A scene as it is named.
enum Which {
    File(PathBuf),
    Builtin(String),
}

fn entry(which: Which, options: &Options, small: bool) -> Result<Entry> {
    let settings = Settings::new(options, small)?;
    let default_detail = if small { Some(DEFAULT_DETAIL) } else { None };
    let (scene, builtin, name, detail) = match which {
        Which::File(path) => {
            let name = path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
            (Some(path), None, name, None)
        }
        Which::Builtin(name) => {
            if !dapple_scene::builtin::BUILTINS.iter().any(|b| b.name == name) {
                // The same words as everywhere else.
                dapple_scene::builtin::glb(&name, 1.0)?;
            }
            (None, Some(name.clone()), name, options.detail.or(default_detail))
        }
    };
    let scene = SceneChoice { scene, builtin, detail, animation: options.animation.clone() };
    Ok(Entry { scene, name, settings })
}

/// A path in a suite's file, which starts from `folder`.
fn below(folder: &Path, path: &Path) -> PathBuf {
    if path.is_absolute() { path.to_owned() } else { folder.join(path) }
}
