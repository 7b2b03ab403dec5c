//! Checks OBJ text, and rewrites it as the `tobj` crate takes it.
//!
//! `tobj` says neither what is wrong nor where, and expects plain statements: this joins continued lines, drops
//! comments, and refuses bad numbers and indices with their line. Faces come out grouped by object, material and kind
//! of corner, so that each of `tobj`'s models is of one piece.

use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use std::fmt::Write;

use crate::load::LoadError;
use crate::load::context::{Context, is_usable};

/// Stands for faces without a material.
pub(super) const NO_MATERIAL: &str = "default";

/// Corners are numbered in 32 bits, three to a triangle.
const MAX_CORNERS: usize = u32::MAX as usize / 3;

/// An OBJ file without flaws.
#[derive(Default)]
pub(super) struct Checked {
    /// Statements `mtllib`, `v`, `vt`, `vn`, `g`, `usemtl` and `f`; the name of a group is the number of its object.
    pub(super) text: String,
    /// Names of objects with faces, in order of their first face.
    pub(super) objects: Vec<String>,
    /// Names of materials with faces, in order of their first face.
    pub(super) materials: Vec<String>,
}

/// The first word of a statement.
pub(super) fn keyword(line: &str) -> &str {
    line.split_whitespace().next().unwrap_or("")
}

/// A line as far as it says something.
pub(super) fn without_comment(line: &str) -> &str {
    line.split('#').next().unwrap_or("").trim()
}

/// Numbers names in order of first use.
#[derive(Default)]
struct Names {
    list: Vec<String>,
    known: HashMap<String, usize>,
    current: String,
    current_number: Option<usize>,
}

impl Names {
    fn set(&mut self, name: &str) {
        name.clone_into(&mut self.current);
        self.current_number = None;
    }

    /// The number of the current name.
    fn number(&mut self) -> usize {
        *self.current_number.get_or_insert_with(|| {
            *self.known.entry(self.current.clone()).or_insert_with(|| {
                self.list.push(self.current.clone());
                self.list.len() - 1
            })
        })
    }
}

/// Lines with their numbers from 1, without comments; continued lines joined.
fn statements(text: &str) -> impl Iterator<Item = (usize, Cow<'_, str>)> {
    let mut lines = text.lines().enumerate();
    std::iter::from_fn(move || {
        let (number, mut line) = lines.next()?;
        let mut joined = String::new();
        while let Some(continued) = line.strip_suffix('\\') {
            joined.push_str(continued);
            joined.push(' ');
            line = lines.next().map_or("", |(_, line)| line);
        }
        if joined.is_empty() {
            return Some((number + 1, Cow::Borrowed(without_comment(line))));
        }
        joined.push_str(line);
        Some((number + 1, Cow::Owned(without_comment(&joined).to_owned())))
    })
}

pub(super) fn check(context: &Context<'_>, bytes: &[u8], stem: &str) -> Result<Checked, LoadError> {
    let text = String::from_utf8_lossy(bytes);
    if matches!(text, Cow::Owned(_)) {
        context.warn("the file is not UTF-8 text; what is not is replaced in names".to_owned());
    }
    // Objects, where there are any, are whole things; groups may be any selection of faces.
    let by_object = text.lines().any(|line| keyword(line) == "o");
    // Colors are all or nothing for `tobj`.
    let colored = |line: &str| keyword(line) == "v" && line.split_whitespace().count() > 6;
    let colored = statements(&text).any(|(_, line)| colored(&line));
    let mut checked = Checked::default();
    // Libraries first: `tobj` looks materials up where it meets their names.
    let mut libraries = HashSet::new();
    for (_, line) in statements(&text).filter(|(_, line)| keyword(line) == "mtllib") {
        let name = line["mtllib".len()..].trim().to_owned();
        if !name.is_empty() && !libraries.contains(&name) {
            let _ = writeln!(checked.text, "mtllib {name}");
            libraries.insert(name);
        }
    }
    // One without a name, for materials that no library has.
    checked.text.push_str("mtllib\n");
    let (mut objects, mut materials) = (Names::default(), Names::default());
    objects.set(stem);
    materials.set(NO_MATERIAL);
    let (mut counts, mut corner_count) = ([0_usize; 3], 0);
    let mut last_run = None;
    let mut left_out = [("lines and points", 0_usize), ("unknown statements", 0)];
    for (number, line) in statements(&text) {
        let at = || format!("line {number}");
        let word = keyword(&line);
        let rest = line[word.len()..].trim();
        let mut words: Vec<&str> = rest.split_whitespace().collect();
        match word {
            "v" => {
                counts[0] += 1;
                let given = check_numbers(context, &words, 3, 6, &at)?;
                // Three numbers more are a color; one is a weight, which polygons do not use.
                words.truncate(if given < 6 { 3 } else { 6 });
                if colored && words.len() < 6 {
                    words.extend(["1"; 3]);
                }
                let _ = writeln!(checked.text, "v {}", words.join(" "));
            }
            "vt" => {
                counts[1] += 1;
                check_numbers(context, &words, 1, 2, &at)?;
                words.push("0");
                let _ = writeln!(checked.text, "vt {} {}", words[0], words[1]);
            }
            "vn" => {
                counts[2] += 1;
                check_numbers(context, &words, 3, 3, &at)?;
                let _ = writeln!(checked.text, "vn {}", words[..3].join(" "));
            }
            "f" | "fo" if words.len() >= 3 => {
                let corner_at = || format!("line {number}, object \"{}\"", objects.current);
                let corner = |word: &&str| check_corner(context, word, counts, &corner_at);
                let corners = words.iter().map(corner).collect::<Result<Vec<_>, _>>()?;
                corner_count += corners.len();
                if corner_count > MAX_CORNERS {
                    return Err(context.invalid(at(), "more than a billion corners; split the file"));
                }
                // A face whose corners differ in kind has only what all of them have.
                let has = [1, 2].map(|i| corners.iter().all(|corner| corner[i].is_some()));
                let run = (objects.number(), materials.number(), has);
                // `tobj` makes each run a model, which takes memory.
                let new_run = last_run != Some(run);
                context.charge(&at(), 1, 160 * corners.len() as u64 + if new_run { 400 } else { 0 })?;
                if new_run {
                    let _ = writeln!(checked.text, "g {}", run.0);
                    if last_run.is_none_or(|(_, material, _)| material != run.1) {
                        let _ = writeln!(checked.text, "usemtl {}", materials.current);
                    }
                    last_run = Some(run);
                }
                checked.text.push('f');
                for [v, vt, vn] in corners {
                    let written = |index: Option<usize>| index.map_or(String::new(), |i| i.to_string());
                    let (vt, vn) = (vt.filter(|_| has[0]), vn.filter(|_| has[1]));
                    let _ = write!(checked.text, " {}/{}/{}", written(v), written(vt), written(vn));
                }
                checked.text.push('\n');
            }
            "f" | "fo" | "l" | "p" => left_out[0].1 += 1,
            "o" => objects.set(rest),
            "g" if !by_object => objects.set(rest),
            "usemtl" => materials.set(if rest.is_empty() { NO_MATERIAL } else { rest }),
            "" | "mtllib" | "g" | "s" | "mg" | "lod" | "usemap" | "maplib" | "bevel" | "c_interp"
            | "d_interp" => {}
            _ => left_out[1].1 += 1,
        }
    }
    for (what, count) in left_out.into_iter().filter(|(_, count)| *count > 0) {
        context.warn(format!("{count} {what} are left out"));
    }
    (checked.objects, checked.materials) = (objects.list, materials.list);
    Ok(checked)
}

/// Checks that up to `most` numbers are sound and at least `least` are there; returns how many are.
fn check_numbers(
    context: &Context<'_>,
    words: &[&str],
    least: usize,
    most: usize,
    at: &dyn Fn() -> String,
) -> Result<usize, LoadError> {
    let words = &words[..words.len().min(most)];
    for word in words {
        let short = || word.chars().take(40).collect::<String>();
        match word.parse::<f32>() {
            Ok(number) if is_usable(number) => {}
            Ok(_) => return Err(context.not_finite(format!("'{}' in {}", short(), at()))),
            Err(_) => {
                let problem = format!("'{}' is not a number; mend the line or export again", short());
                return Err(context.invalid(at(), problem));
            }
        }
    }
    if words.len() < least {
        let count = words.len();
        let problem =
            format!("has {count} numbers, but needs {least}; the file may be cut off: export it again");
        return Err(context.invalid(at(), problem));
    }
    Ok(words.len())
}

/// The indices of a corner (position, texture coordinate, normal), counted from 1.
fn check_corner(
    context: &Context<'_>,
    text: &str,
    counts: [usize; 3],
    at: &dyn Fn() -> String,
) -> Result<[Option<usize>; 3], LoadError> {
    let mut corner = [None; 3];
    let kinds = ["vertex", "texture coordinate", "normal"];
    for (i, word) in text.split('/').take(3).enumerate() {
        let (what, count) = (kinds[i], counts[i]);
        if word.is_empty() && i > 0 {
            continue;
        }
        let Ok(index) = word.parse::<i64>() else {
            let word: String = word.chars().take(40).collect();
            let problem = format!("'{word}' is not a {what} index; mend the line or export again");
            return Err(context.invalid(at(), problem));
        };
        // Indices count from 1; negative ones count back from the newest.
        let found = if index < 0 { (count as i64 + 1).saturating_add(index) } else { index };
        if found < 1 || found > count as i64 {
            let problem = format!(
                "the face refers to {what} {index}, but there are {count} before it, counted from 1; \
                 export the file again"
            );
            return Err(context.invalid(at(), problem));
        }
        corner[i] = Some(found as usize);
    }
    Ok(corner)
}
