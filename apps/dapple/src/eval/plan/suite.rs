//! Suites: TOML files with scenes and settings (docs/suites.md), some of them built in.

use std::path::Path;

use anyhow::{Context, Result, bail};
use serde::Deserialize;

use super::super::study;
use super::{Plan, StudyEntry, Which, below, entry};
use crate::args::Options;
use crate::source::read_limited;

/// The largest file that is read.
const MAX_BYTES: u64 = 1 << 20;

/// Suites that the program brings, by name.
const BUILTIN: [(&str, &str, &str); 8] = [
    (
        "builtins",
        include_str!("../../../suites/builtins.toml"),
        "every built-in scene along both of its paths",
    ),
    (
        "others",
        include_str!("../../../suites/others.toml"),
        "scenes that others made, found with --scenes-folder",
    ),
    (
        "psao",
        include_str!("../../../suites/psao.toml"),
        "points, the paper's scheme and shading atlas streaming on three scenes",
    ),
    (
        "sao",
        include_str!("../../../suites/sao.toml"),
        "screen-space methods on three built-in scenes, with the studies of SAO",
    ),
    (
        "sao-others",
        include_str!("../../../suites/sao-others.toml"),
        "the same on scenes by others, found with --scenes-folder",
    ),
    (
        "stochastic",
        include_str!("../../../suites/stochastic.toml"),
        "stochastic depth on two built-in scenes, against all layers and the truth, with its studies",
    ),
    (
        "stochastic-others",
        include_str!("../../../suites/stochastic-others.toml"),
        "the same on scenes by others, found with --scenes-folder",
    ),
    (
        "slc",
        include_str!("../../../suites/slc.toml"),
        "direct light from area lights on four built-in scenes: light cones, rays and resampling, one viewer and many",
    ),
];

/// A suite as its file says it.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Suite {
    title: Option<String>,
    /// For every case that says nothing else.
    #[serde(default)]
    defaults: Options,
    #[serde(rename = "case", default)]
    cases: Vec<toml::Table>,
    #[serde(rename = "study", default)]
    studies: Vec<toml::Table>,
}

/// Reads a built-in suite or a file.
pub(super) fn read(wanted: &str, scenes_folder: Option<&Path>, flags: &Options) -> Result<Plan> {
    if let Some((name, text, _)) = BUILTIN.iter().find(|(name, _, _)| *name == wanted) {
        if scenes_folder.is_none() && text.contains("\nscene = ") {
            bail!("the suite {name} needs --scenes-folder DIR: its scenes are not part of the program");
        }
        return plan(text, scenes_folder.unwrap_or(Path::new("")), flags)
            .with_context(|| format!("the suite {name}"));
    }
    let path = Path::new(wanted);
    if !path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")) {
        let known: Vec<String> = BUILTIN.iter().map(|(name, _, what)| format!("{name} ({what})")).collect();
        bail!("there is no suite {wanted}: known are {}, or name a .toml file", known.join(", "));
    }
    let bytes =
        read_limited(path, MAX_BYTES).with_context(|| format!("cannot read the suite {}", path.display()))?;
    let text = String::from_utf8(bytes).with_context(|| format!("{} is not UTF-8", path.display()))?;
    let folder = scenes_folder.or(path.parent()).unwrap_or(Path::new(""));
    plan(&text, folder, flags).with_context(|| format!("the suite {}", path.display()))
}

fn plan(text: &str, folder: &Path, flags: &Options) -> Result<Plan> {
    let suite: Suite = toml::from_str(text)?;
    if suite.cases.is_empty() && suite.studies.is_empty() {
        bail!(
            "it has no [[case]]: add at least one, with scene = \"FILE\" or builtin = \"NAME\", or a [[study]]"
        );
    }
    let mut entries = Vec::new();
    for (number, mut table) in suite.cases.into_iter().enumerate() {
        let which = which(&mut table, folder).with_context(|| format!("[[case]] {}", number + 1))?;
        let own = Options::deserialize(table).with_context(|| {
            format!("[[case]] {}, which may have scene or builtin, and settings", number + 1)
        })?;
        if let (Which::File(path), Some(_)) = (&which, own.detail) {
            bail!("[[case]] {}: detail is for built-in scenes; {} is a file", number + 1, path.display());
        }
        let options = flags.clone().or(&own).or(&suite.defaults);
        entries.push(entry(which, &options, false).with_context(|| format!("[[case]] {}", number + 1))?);
    }
    let mut studies = Vec::new();
    for (number, table) in suite.studies.into_iter().enumerate() {
        let entry = study(table, folder, flags, &suite.defaults);
        studies.push(entry.with_context(|| format!("[[study]] {}", number + 1))?);
    }
    Ok(Plan { title: suite.title.unwrap_or_else(|| "Evaluation".to_owned()), entries, studies })
}

/// Reads a `[[study]]`: its kind, the kind's own settings, a scene if it needs one, and settings as of a case.
fn study(mut table: toml::Table, folder: &Path, flags: &Options, defaults: &Options) -> Result<StudyEntry> {
    let Some(toml::Value::String(kind)) = table.remove("kind") else {
        bail!("it must have kind = \"NAME\"");
    };
    if flags.size.is_some() {
        // Said for all.
        table.remove("sizes");
    }
    if let Some(toml::Value::String(path)) = table.get_mut("environment") {
        let at = below(folder, Path::new(&*path));
        if !at.is_file() {
            bail!("{kind}: there is no environment {}", at.display());
        }
        *path = at.to_string_lossy().into_owned();
    }
    let study = study::read(&kind, &mut table).with_context(|| kind.clone())?;
    if !study.has_scene() {
        if let Some(key) = table.keys().next() {
            bail!("{kind} has no setting {key}, nor a scene");
        }
        return Ok(StudyEntry { kind, study, entry: None });
    }
    let which = which(&mut table, folder)?;
    let own = Options::deserialize(table)
        .context("it may have kind, the kind's own settings, scene or builtin, and settings of cases")?;
    let entry = entry(which, &flags.clone().or(&own).or(defaults), false)?;
    Ok(StudyEntry { kind, study, entry: Some(entry) })
}

/// Takes the scene out of a case.
fn which(table: &mut toml::Table, folder: &Path) -> Result<Which> {
    match (table.remove("scene"), table.remove("builtin")) {
        (Some(toml::Value::String(path)), None) => Ok(Which::File(below(folder, Path::new(&path)))),
        (None, Some(toml::Value::String(name))) => Ok(Which::Builtin(name)),
        _ => bail!("it must have either scene = \"FILE\" or builtin = \"NAME\""),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::args::{Method, Radius, Size};

    #[test]
    fn built_in_suites_are_sound() {
        // Without the codec that some need.
        let flags = Options { methods: Some(vec![Method::Psao]), ..Options::default() };
        for (name, text, _) in BUILTIN {
            let plan = plan(text, Path::new("somewhere"), &flags);
            let plan = plan.unwrap_or_else(|error| panic!("{name}: {error:#}"));
            assert!(plan.entries.len() + plan.studies.len() > 1, "{name}");
        }
    }

    #[test]
    fn flags_override_cases_and_cases_defaults() {
        let text = "title = \"t\"\n[defaults]\nframes = 7\nradius = 0.25\nsize = \"64x48\"\n\
                    [[case]]\nscene = \"a/room.glb\"\nframes = 3\nmethods = [\"rtao-4\"]\n\
                    [[case]]\nbuiltin = \"atrium\"\nradius = \"auto\"\ndetail = 0.5\n";
        let flags = Options { size: Some(Size { width: 32, height: 32 }), ..Options::default() };
        let plan = plan(text, Path::new("folder"), &flags).unwrap();
        let [room, atrium] = &plan.entries[..] else { panic!("{plan:?}") };
        assert_eq!(plan.title, "t");
        assert_eq!(room.scene.scene.as_deref(), Some(Path::new("folder/a/room.glb")));
        assert_eq!((room.settings.frames, atrium.settings.frames), (3, 7));
        assert_eq!(room.settings.methods, [Method::Rtao { rays: 4 }]);
        assert_eq!(room.settings.radius, Radius::Metres(0.25));
        assert_eq!((atrium.settings.radius, atrium.scene.detail), (Radius::Auto, Some(0.5)));
        assert_eq!(atrium.settings.size, Size { width: 32, height: 32 });
    }

    #[test]
    fn one_of_a_list_needs_no_brackets() {
        let text = "[[case]]\nbuiltin = \"atrium\"\nmethods = \"psao\"\npoints = 300\nhz = \"5,30\"\npath = \"all\"\n\
                    [[case]]\nbuiltin = \"atrium\"\nmethods = \"psao, none\"\npoints = [100, 2e2]\nhz = [60.0]\n";
        let plan = plan(text, Path::new(""), &Options::default()).unwrap();
        let [one, two] = &plan.entries[..] else { panic!("{plan:?}") };
        assert_eq!((&one.settings.points_per_m2[..], &one.settings.hz[..]), (&[300.0][..], &[5.0, 30.0][..]));
        assert_eq!(
            (&one.settings.methods[..], &one.settings.paths[..]),
            (&[Method::Psao][..], &["all".to_owned()][..])
        );
        assert_eq!(two.settings.methods, [Method::Psao, Method::None]);
        assert_eq!(
            (&two.settings.points_per_m2[..], &two.settings.hz[..]),
            (&[100.0, 200.0][..], &[60.0][..])
        );
    }

    #[test]
    fn studies_have_settings_of_their_own_and_those_of_cases() {
        let text = "[defaults]\nframes = 7\n[[study]]\nkind = \"passes\"\nbuiltin = \"atrium\"\nsizes = [\"64x48\"]\n\
                    detail = 0.5\nmethods = \"sao\"\n[[study]]\nkind = \"z-precision\"\ntriangles = 10\n";
        let plan = plan(text, Path::new(""), &Options::default()).unwrap();
        let [passes, z] = &plan.studies[..] else { panic!("{plan:?}") };
        assert_eq!((passes.kind.as_str(), z.kind.as_str()), ("passes", "z-precision"));
        let entry = passes.entry.as_ref().unwrap();
        assert_eq!((entry.settings.frames, entry.scene.detail), (7, Some(0.5)));
        assert!(format!("{:?}", passes.study).contains("width: 64"), "{:?}", passes.study);
        assert!(z.entry.is_none() && format!("{:?}", z.study).contains("triangles: 10"), "{:?}", z.study);
        let flags = Options { size: Some(Size { width: 32, height: 32 }), ..Options::default() };
        let plan = super::plan(text, Path::new(""), &flags).unwrap();
        assert!(!format!("{:?}", plan.studies[0].study).contains("width"), "a flag is for all");
    }

    #[test]
    fn mistakes_are_named() {
        for (text, says) in [
            ("", "[[case]]"),
            ("[[case]]\n", "scene"),
            ("[[case]]\nscene = \"a.glb\"\nbuiltin = \"atrium\"\n", "either"),
            ("[[case]]\nbuiltin = \"atrium\"\nfranes = 3\n", "franes"),
            ("[[case]]\nbuiltin = \"atrium\"\nmethods = [\"magic\"]\n", "magic"),
            ("[[case]]\nbuiltin = \"nowhere\"\n", "nowhere"),
            ("[[case]]\nbuiltin = \"atrium\"\nframes = 0\n", "frames"),
            ("[[case]]\nscene = \"a.glb\"\ndetail = 0.5\n", "a.glb is a file"),
            ("[[case]]\nbuiltin = \"atrium\"\nhz = [\"often\"]\n", "often"),
            ("[[case]\n", "TOML"),
            ("[[study]]\nbuiltin = \"atrium\"\n", "kind"),
            ("[[study]]\nkind = \"magic\"\n", "z-precision"),
            ("[[study]]\nkind = \"radius\"\n", "either"),
            ("[[study]]\nkind = \"radius\"\nbuiltin = \"atrium\"\nradii = \"wide\"\n", "radii"),
            ("[[study]]\nkind = \"radius\"\nbuiltin = \"atrium\"\nsizes = [\"64x48\"]\n", "sizes"),
            ("[[study]]\nkind = \"z-precision\"\nbuiltin = \"atrium\"\n", "builtin"),
        ] {
            let error = plan(text, Path::new(""), &Options::default()).unwrap_err();
            assert!(format!("{error:#}").contains(says), "{text}: {error:#}");
        }
    }
}
