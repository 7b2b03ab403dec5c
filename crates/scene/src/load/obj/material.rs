//! Materials of OBJ files, from their libraries (`.mtl`).

use std::collections::{HashMap, HashSet};
use std::fmt::Write;

use glam::{Affine2, Vec3};
use tobj::MTLLoadResult;

use super::check::{NO_MATERIAL, keyword, without_comment};
use crate::load::context::{Context, is_usable};
use crate::load::{image, uri};
use crate::{AlphaMode, Filter, Image, Material, Scene, Texture, TextureRef, Wrap};

/// Reflectance of materials that say nothing about it.
const PLAIN_GRAY: f32 = 0.8;

/// Reads the library that an `mtllib` statement names. One that cannot be read is a warning.
pub(super) fn library(context: &Context<'_>, statement: &str) -> MTLLoadResult {
    let bytes = uri::read(context, "mtllib", &uri_of(statement)).or_else(|error| {
        // A name with spaces, or several names.
        let names: Vec<&str> = statement.split_whitespace().collect();
        let parts = names.iter().filter_map(|name| uri::read(context, "mtllib", &uri_of(name)).ok());
        let joined = if names.len() > 1 { parts.collect::<Vec<_>>().join(&b'\n') } else { Vec::new() };
        if joined.is_empty() { Err(error) } else { Ok(joined) }
    });
    match bytes {
        Ok(bytes) => tobj::load_mtl_buf(&mut check(context, &String::from_utf8_lossy(&bytes)).as_bytes()),
        Err(error) => {
            context.warn(format!("{error}; until then its materials are plain"));
            Err(tobj::LoadError::OpenFileFailed)
        }
    }
}

/// Plain materials for the names that no library has.
pub(super) fn plain(context: &Context<'_>, names: &[String], known: &HashSet<String>) -> MTLLoadResult {
    let unknown: Vec<&String> = names.iter().filter(|name| !known.contains(*name)).collect();
    let listed: Vec<&str> = unknown.iter().map(|name| name.as_str()).filter(|n| *n != NO_MATERIAL).collect();
    if !listed.is_empty() {
        let (n, some) = (listed.len(), listed[..listed.len().min(8)].join(", "));
        context.warn(format!("{n} materials are in no material library and become plain gray: {some}"));
    }
    let numbers = unknown.iter().enumerate().map(|(i, name)| ((*name).clone(), i)).collect();
    let named = |name: &&String| tobj::Material { name: (*name).clone(), ..tobj::Material::default() };
    Ok((unknown.iter().map(named).collect(), numbers))
}

/// The lines of a library that are used here and make sense: one bad line would cost `tobj` the whole library, and a
/// color of less than three numbers makes it panic.
fn check(context: &Context<'_>, text: &str) -> String {
    let mut checked = String::new();
    let mut bad_lines = 0;
    for line in text.lines().map(without_comment) {
        let word = keyword(line);
        let rest = line[word.len()..].trim();
        let number = |word: &str| word.parse().ok().filter(|x: &f32| is_usable(*x));
        let numbers = rest.split_whitespace().map(number);
        let value = match word {
            "newmtl" => Some(rest.to_owned()).filter(|name| !name.is_empty()),
            "Kd" | "Ke" => match numbers.take(3).collect::<Option<Vec<f32>>>().as_deref() {
                // One number is a gray.
                Some([r, rest @ ..]) => {
                    Some(format!("{r} {} {}", rest.first().unwrap_or(r), rest.get(1).unwrap_or(r)))
                }
                _ => None,
            },
            "d" | "Tr" | "Pr" | "Pm" => numbers.take(1).next().flatten().map(|x| x.to_string()),
            "map_Kd" | "map_Ke" | "map_d" => map_file(rest),
            _ => continue,
        };
        match value {
            Some(value) => {
                let _ = writeln!(checked, "{word} {value}");
            }
            None => bad_lines += 1,
        }
    }
    if bad_lines > 0 {
        context.warn(format!("{bad_lines} lines of the material library make no sense and are ignored"));
    }
    checked
}

/// Paths in OBJ files are not URIs: nothing in them is an escape.
fn uri_of(path: &str) -> String {
    path.trim().replace('%', "%25")
}

/// The file of a `map_…` statement, behind its options.
fn map_file(text: &str) -> Option<String> {
    let mut rest = text.trim();
    while rest.starts_with('-') {
        rest = rest[keyword(rest).len()..].trim_start();
        loop {
            let word = keyword(rest);
            let is_value = word.parse::<f32>().is_ok() || matches!(word, "on" | "off");
            if !is_value || word.len() == rest.len() {
                break;
            }
            rest = rest[word.len()..].trim_start();
        }
    }
    (!rest.is_empty()).then(|| rest.to_owned())
}

/// Images by their paths; `None` for those that cannot be had.
pub(super) type Images = HashMap<String, Option<u32>>;

/// Makes a material of what a library says about it, and reads its images.
pub(super) fn convert(
    context: &Context<'_>,
    source: &tobj::Material,
    images: &mut Images,
    scene: &mut Scene,
) -> Material {
    let other = |key: &str| source.unknown_param.get(key);
    let number = |key: &str| other(key).and_then(|x| x.parse::<f32>().ok());
    let fraction = |x: f32| x.clamp(0.0, 1.0);
    let mut image = |path: Option<&String>| path.and_then(|path| read_image(context, path, images, scene));
    let diffuse_image = image(source.diffuse_texture.as_ref());
    let opacity_image = image(source.dissolve_texture.as_ref());
    let emission_image = image(other("map_Ke"));
    // Some exporters write black beside a texture, meaning the texture alone.
    let textured = diffuse_image.is_some();
    let diffuse = match source.diffuse.map(Vec3::from) {
        Some(color) if !(textured && color == Vec3::ZERO) => color,
        _ if textured => Vec3::ONE,
        _ => Vec3::splat(PLAIN_GRAY),
    };
    let opacity = fraction(source.dissolve.or_else(|| number("Tr").map(|x| 1.0 - x)).unwrap_or(1.0));
    let mut material = Material {
        name: source.name.clone(),
        base_color_factor: diffuse.clamp(Vec3::ZERO, Vec3::ONE).extend(opacity),
        metallic_factor: number("Pm").map_or(0.0, fraction),
        roughness_factor: number("Pr").map_or(1.0, fraction),
        emissive_factor: source.emissive.map_or(Vec3::ZERO, Vec3::from).max(Vec3::ZERO),
        alpha_mode: if opacity < 1.0 { AlphaMode::Blend } else { AlphaMode::Opaque },
        double_sided: true,
        ..Material::default()
    };
    let mut base_image = diffuse_image;
    if let Some(opacity) = opacity_image {
        base_image = with_opacity(context, diffuse_image, opacity, scene).or(diffuse_image);
        material.alpha_mode = AlphaMode::Mask { cutoff: 0.5 };
    }
    material.base_color_texture = base_image.map(|image| texture(scene, image));
    if let Some(image) = emission_image {
        material.emissive_texture = Some(texture(scene, image));
        if material.emissive_factor == Vec3::ZERO {
            material.emissive_factor = Vec3::ONE;
        }
    }
    material
}

fn texture(scene: &mut Scene, image: u32) -> TextureRef {
    let texture = Texture { image, wrap_u: Wrap::Repeat, wrap_v: Wrap::Repeat, filter: Filter::Linear };
    let index = match scene.textures.iter().position(|known| *known == texture) {
        Some(index) => index,
        None => {
            scene.textures.push(texture);
            scene.textures.len() - 1
        }
    };
    TextureRef { texture: index as u32, uv_set: 0, image_from_uv: Affine2::IDENTITY }
}

fn read_image(context: &Context<'_>, path: &str, images: &mut Images, scene: &mut Scene) -> Option<u32> {
    if let Some(image) = images.get(path) {
        return *image;
    }
    let bytes = uri::read(context, "material library", &uri_of(path)).map_err(|error| error.to_string());
    let image = match bytes.and_then(|bytes| image::decode(context, path.to_owned(), &bytes)) {
        Ok(image) => {
            scene.images.push(image);
            Some(scene.images.len() as u32 - 1)
        }
        Err(reason) => {
            context
                .warn(format!("texture '{path}' cannot be used ({reason}); its color factor is used alone"));
            None
        }
    };
    images.insert(path.to_owned(), image);
    image
}

/// A new image with the colors of `color` (or white) and the opacity of another image: its alpha, if it has any, else
/// its red.
fn with_opacity(context: &Context<'_>, color: Option<u32>, opacity: u32, scene: &mut Scene) -> Option<u32> {
    if color == Some(opacity) {
        return color;
    }
    let mask = &scene.images[opacity as usize];
    let base = &scene.images[color.unwrap_or(opacity) as usize];
    let bytes = 4 * base.rgba8.len() as u64;
    if bytes > context.image_left_bytes() {
        context.warn("no memory left to combine color and opacity images; opacity is ignored".to_owned());
        return None;
    }
    let uses_alpha = mask.rgba8.iter().any(|texel| texel[3] < 255);
    let mut rgba8 = Vec::with_capacity(base.rgba8.len());
    for (i, texel) in base.rgba8.iter().enumerate() {
        let (x, y) = (i as u64 % u64::from(base.width), i as u64 / u64::from(base.width));
        let mask_x = x * u64::from(mask.width) / u64::from(base.width);
        let mask_y = y * u64::from(mask.height) / u64::from(base.height);
        let [red, _, _, alpha] = mask.rgba8[(mask_y * u64::from(mask.width) + mask_x) as usize];
        let [r, g, b, _] = if color.is_some() { *texel } else { [255; 4] };
        rgba8.push([r, g, b, if uses_alpha { alpha } else { red }]);
    }
    let name = format!("{} with opacity of {}", base.name, mask.name);
    let image = Image { name, width: base.width, height: base.height, rgba8 };
    context.use_image_bytes(bytes);
    scene.images.push(image);
    Some(scene.images.len() as u32 - 1)
}
