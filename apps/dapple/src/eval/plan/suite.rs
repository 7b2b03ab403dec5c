//! Suites: TOML files with scenes and settings (docs/suites.md), some of them built in.

use std::path::Path;

use anyhow::{Context, Result, bail};
use serde::Deserialize;

use super::{Plan, Which, below, entry};
use crate::args::Options;
use crate::source::read_limited;

/// The largest file that is read.
const MAX_BYTES: u64 = 1 << 20;

/// Suites that the program brings, by name.
const BUILTIN: [(&str, &str, &str); 3] = [
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
    if suite.cases.is_empty() {
        bail!("it has no [[case]]: add at least one, with scene = \"FILE\" or builtin = \"NAME\"");
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
    Ok(Plan { title: suite.title.unwrap_or_else(|| "Evaluation".to_owned()), entries })
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
            assert!(plan.is_ok_and(|p| p.entries.len() > 1), "{name}");
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
        ] {
            let error = plan(text, Path::new(""), &Options::default()).unwrap_err();
            assert!(format!("{error:#}").contains(says), "{text}: {error:#}");
        }
    }
}
