//! Reads the statements of an OBJ file.

use std::collections::HashMap;

use glam::{Vec2, Vec3, Vec4};

use crate::load::LoadError;
use crate::load::context::{Context, is_usable};

/// No texture coordinate or normal.
pub(super) const NONE: u32 = u32::MAX;

/// One corner of a face: indices of position, texture coordinate and normal.
pub(super) type Corner = [u32; 3];

/// A polygon.
pub(super) struct Face {
    /// First of its corners in [`File::corners`].
    pub(super) first: u32,
    /// Number of its corners, ≥ 3.
    pub(super) count: u32,
    /// Index into [`File::object_names`].
    pub(super) object: u32,
    /// Index into [`File::material_names`].
    pub(super) material: u32,
}

/// The content of an OBJ file.
#[derive(Default)]
pub(super) struct File {
    pub(super) positions: Vec<Vec3>,
    /// Empty, or one a position.
    pub(super) colors: Vec<Vec4>,
    pub(super) uvs: Vec<Vec2>,
    pub(super) normals: Vec<Vec3>,
    pub(super) corners: Vec<Corner>,
    pub(super) faces: Vec<Face>,
    pub(super) object_names: Vec<String>,
    pub(super) material_names: Vec<String>,
    pub(super) libraries: Vec<String>,
}

/// Names in the order of their first use.
#[derive(Default)]
struct Names {
    list: Vec<String>,
    index: HashMap<String, u32>,
}

impl Names {
    fn get(&mut self, name: &str) -> u32 {
        if let Some(index) = self.index.get(name) {
            return *index;
        }
        let index = self.list.len() as u32;
        self.list.push(name.to_owned());
        self.index.insert(name.to_owned(), index);
        index
    }
}

pub(super) fn parse(context: &Context<'_>, bytes: &[u8], stem: &str) -> Result<File, LoadError> {
    let text = String::from_utf8_lossy(bytes);
    if matches!(text, std::borrow::Cow::Owned(_)) {
        context.warn("the file is not UTF-8 text; what is not is replaced in names".to_owned());
    }
    // Objects, where there are any, are whole things; groups may be any selection of faces.
    let by_object = text.lines().any(|line| keyword(line) == "o");
    let mut file = File::default();
    let (mut objects, mut materials) = (Names::default(), Names::default());
    let (mut object, mut material) = (stem.to_owned(), String::new());
    let mut left_out = [("lines and points", 0_usize), ("unknown statements", 0)];
    let mut lines = text.lines().enumerate();
    while let Some((number, line)) = lines.next() {
        let mut joined = String::new();
        let mut line = line;
        while let Some(continued) = line.strip_suffix('\\') {
            joined.push_str(continued);
            joined.push(' ');
            line = lines.next().map_or("", |(_, line)| line);
        }
        if !joined.is_empty() {
            joined.push_str(line);
            line = &joined;
        }
        let at = || format!("line {}", number + 1);
        let line = line.split('#').next().unwrap_or("").trim();
        let word = keyword(line);
        let rest = line[word.len()..].trim();
        match word {
            "" => {}
            "v" => {
                let numbers = floats::<7>(context, rest, 3, &at)?;
                file.positions.push(Vec3::from_slice(&numbers.0));
                // Position and color; a fourth number alone is a weight, which polygons do not use.
                if numbers.1 >= 6 {
                    file.colors.resize(file.positions.len() - 1, Vec4::ONE);
                    file.colors
                        .push(Vec4::new(numbers.0[3], numbers.0[4], numbers.0[5], 1.0).max(Vec4::ZERO));
                } else if !file.colors.is_empty() {
                    file.colors.push(Vec4::ONE);
                }
            }
            "vt" => {
                let numbers = floats::<3>(context, rest, 1, &at)?.0;
                file.uvs.push(Vec2::new(numbers[0], 1.0 - numbers[1]));
            }
            "vn" => file.normals.push(Vec3::from_array(floats::<3>(context, rest, 3, &at)?.0)),
            "f" | "fo" => {
                let first = file.corners.len();
                for corner in rest.split_whitespace() {
                    let corner =
                        parse_corner(context, corner, &file, || format!("{}, object \"{object}\"", at()))?;
                    file.corners.push(corner);
                }
                let count = file.corners.len() - first;
                if count < 3 {
                    file.corners.truncate(first);
                    left_out[0].1 += 1;
                    continue;
                }
                let limit = |n: usize| {
                    u32::try_from(n)
                        .map_err(|_| context.invalid(at(), "more than 2^32 corners; split the file"))
                };
                let (first, count) = (limit(first)?, limit(count)?);
                let (object, material) = (objects.get(&object), materials.get(&material));
                file.faces.push(Face { first, count, object, material });
            }
            "o" => object = rest.to_owned(),
            "g" if !by_object => object = rest.to_owned(),
            "usemtl" => material = rest.to_owned(),
            "mtllib" => file.libraries.push(rest.to_owned()),
            "l" | "p" => left_out[0].1 += 1,
            "g" | "s" | "mg" | "lod" | "usemap" | "maplib" | "bevel" | "c_interp" | "d_interp" => {}
            _ => left_out[1].1 += 1,
        }
    }
    for (what, count) in left_out {
        if count > 0 {
            context.warn(format!("{count} {what} are left out"));
        }
    }
    (file.object_names, file.material_names) = (objects.list, materials.list);
    Ok(file)
}

/// The first word of a statement.
pub(super) fn keyword(line: &str) -> &str {
    line.split_whitespace().next().unwrap_or("")
}

/// Up to `N` numbers, at least `least`, and how many there were.
fn floats<const N: usize>(
    context: &Context<'_>,
    text: &str,
    least: usize,
    at: &dyn Fn() -> String,
) -> Result<([f32; N], usize), LoadError> {
    let mut numbers = [0.0; N];
    let mut count = 0;
    for (slot, word) in numbers.iter_mut().zip(text.split_whitespace()) {
        let Ok(number) = word.parse::<f32>() else {
            let word: String = word.chars().take(40).collect();
            return Err(
                context.invalid(at(), format!("'{word}' is not a number; mend the line or export again"))
            );
        };
        if !is_usable(number) {
            return Err(context.not_finite(format!("'{word}' in {}", at())));
        }
        *slot = number;
        count += 1;
    }
    if count < least {
        let problem =
            format!("has {count} numbers, but needs {least}; the file may be cut off: export it again");
        return Err(context.invalid(at(), problem));
    }
    Ok((numbers, count))
}

fn parse_corner(
    context: &Context<'_>,
    text: &str,
    file: &File,
    at: impl Fn() -> String,
) -> Result<Corner, LoadError> {
    let mut corner = [NONE; 3];
    let lists = [
        ("vertex", file.positions.len()),
        ("texture coordinate", file.uvs.len()),
        ("normal", file.normals.len()),
    ];
    for (i, word) in text.split('/').enumerate() {
        let Some((what, count)) = lists.get(i) else { break };
        if word.is_empty() && i > 0 {
            continue;
        }
        let Ok(index) = word.parse::<i64>() else {
            let word: String = word.chars().take(40).collect();
            return Err(context
                .invalid(at(), format!("'{word}' is not a {what} index; mend the line or export again")));
        };
        // Indices count from 1; negative ones count back from the newest.
        let found = if index > 0 { index - 1 } else { (*count as i64).saturating_add(index) };
        if index == 0 || found < 0 || found >= *count as i64 || found >= i64::from(NONE) {
            let problem = format!(
                "the face refers to {what} {index}, but there are {count} before it, counted from 1; export the file again"
            );
            return Err(context.invalid(at(), problem));
        }
        corner[i] = found as u32;
    }
    Ok(corner)
}
