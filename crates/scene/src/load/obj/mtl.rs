//! Material libraries (`.mtl`) of OBJ files.

use glam::{Affine2, Vec3, Vec4};

use super::parse::keyword;
use crate::load::context::{Context, is_usable};
use crate::load::{image, uri};
use crate::{AlphaMode, Filter, Image, Material, Scene, Texture, TextureRef, Wrap};

/// Reflectance of materials that say nothing about it.
const PLAIN_GRAY: f32 = 0.8;

/// A material of which only the name is known.
pub(super) fn plain(name: &str) -> Material {
    Material {
        name: if name.is_empty() { "default".to_owned() } else { name.to_owned() },
        base_color_factor: Vec4::new(PLAIN_GRAY, PLAIN_GRAY, PLAIN_GRAY, 1.0),
        metallic_factor: 0.0,
        double_sided: true,
        ..Material::default()
    }
}

/// What a library says about one material, before its images are read.
struct Draft {
    material: Material,
    diffuse: Option<Vec3>,
    emission: Option<Vec3>,
    opacity: f32,
    diffuse_map: Option<String>,
    emission_map: Option<String>,
    opacity_map: Option<String>,
}

/// Reads the library that an `mtllib` statement names, and its images. A library that cannot be read is a warning.
pub(super) fn read(context: &Context<'_>, statement: &str, library: &mut Vec<Material>, scene: &mut Scene) {
    let whole = uri_of(statement);
    let bytes = uri::read(context, "mtllib", &whole).or_else(|error| {
        // A name with spaces, or several names.
        let names: Vec<&str> = statement.split_whitespace().collect();
        let several = names.len() > 1;
        let parts = names.iter().filter_map(|name| uri::read(context, "mtllib", &uri_of(name)).ok());
        let joined = parts.collect::<Vec<_>>().join(&b'\n');
        if several && !joined.is_empty() { Ok(joined) } else { Err(error) }
    });
    let bytes = match bytes {
        Ok(bytes) => bytes,
        Err(error) => {
            context.warn(format!("{error}; until then its materials are plain"));
            return;
        }
    };
    let mut images: Vec<(String, Option<u32>)> = Vec::new();
    for draft in parse(context, &String::from_utf8_lossy(&bytes)) {
        let material = finish(context, draft, &mut images, scene);
        library.push(material);
    }
}

/// Paths in OBJ files are not URIs: nothing in them is an escape.
fn uri_of(path: &str) -> String {
    path.trim().replace('%', "%25")
}

fn parse(context: &Context<'_>, text: &str) -> Vec<Draft> {
    let mut drafts: Vec<Draft> = Vec::new();
    let mut bad_lines = 0;
    for line in text.lines() {
        let line = line.split('#').next().unwrap_or("").trim();
        let word = keyword(line);
        let rest = line[word.len()..].trim();
        if word == "newmtl" {
            drafts.push(Draft {
                material: plain(rest),
                diffuse: None,
                emission: None,
                opacity: 1.0,
                diffuse_map: None,
                emission_map: None,
                opacity_map: None,
            });
            continue;
        }
        let Some(draft) = drafts.last_mut() else { continue };
        let number = || rest.split_whitespace().next().and_then(|x| x.parse().ok()).filter(|x| is_usable(*x));
        let understood = match word {
            "Kd" => set(&mut draft.diffuse, color(rest)),
            "Ke" => set(&mut draft.emission, color(rest)),
            "d" => number().map(|x: f32| draft.opacity = x.clamp(0.0, 1.0)).is_some(),
            "Tr" => number().map(|x: f32| draft.opacity = 1.0 - x.clamp(0.0, 1.0)).is_some(),
            "Pr" => number().map(|x: f32| draft.material.roughness_factor = x.clamp(0.0, 1.0)).is_some(),
            "Pm" => number().map(|x: f32| draft.material.metallic_factor = x.clamp(0.0, 1.0)).is_some(),
            "map_Kd" => set(&mut draft.diffuse_map, map_file(rest)),
            "map_Ke" => set(&mut draft.emission_map, map_file(rest)),
            "map_d" => set(&mut draft.opacity_map, map_file(rest)),
            _ => true,
        };
        bad_lines += usize::from(!understood);
    }
    if bad_lines > 0 {
        context.warn(format!("{bad_lines} lines of the material library make no sense and are ignored"));
    }
    drafts
}

fn set<T>(slot: &mut Option<T>, value: Option<T>) -> bool {
    let found = value.is_some();
    if found {
        *slot = value;
    }
    found
}

fn color(text: &str) -> Option<Vec3> {
    let mut numbers = text.split_whitespace().map(|x| x.parse::<f32>().ok().filter(|x| is_usable(*x)));
    let red = numbers.next()??;
    // One number is a gray.
    let mut other = || numbers.next().unwrap_or(Some(red));
    Some(Vec3::new(red, other()?, other()?).max(Vec3::ZERO))
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

fn finish(
    context: &Context<'_>,
    draft: Draft,
    images: &mut Vec<(String, Option<u32>)>,
    scene: &mut Scene,
) -> Material {
    let mut material = draft.material;
    let diffuse_image =
        draft.diffuse_map.as_deref().and_then(|path| read_image(context, path, images, scene));
    let opacity_image =
        draft.opacity_map.as_deref().and_then(|path| read_image(context, path, images, scene));
    let emission_image =
        draft.emission_map.as_deref().and_then(|path| read_image(context, path, images, scene));
    // Some exporters write black beside a texture, meaning the texture alone.
    let textured = diffuse_image.is_some();
    let diffuse = match draft.diffuse {
        Some(color) if !(textured && color == Vec3::ZERO) => color,
        _ if textured => Vec3::ONE,
        _ => material.base_color_factor.truncate(),
    };
    material.base_color_factor = diffuse.min(Vec3::ONE).extend(draft.opacity);
    if draft.opacity < 1.0 {
        material.alpha_mode = AlphaMode::Blend;
    }
    let mut base_image = diffuse_image;
    if let Some(opacity) = opacity_image {
        base_image = with_opacity(context, diffuse_image, opacity, scene).or(diffuse_image);
        material.alpha_mode = AlphaMode::Mask { cutoff: 0.5 };
    }
    material.base_color_texture = base_image.map(|image| texture(scene, image));
    material.emissive_factor = draft.emission.unwrap_or(Vec3::ZERO);
    if let Some(image) = emission_image {
        material.emissive_texture = Some(texture(scene, image));
        if draft.emission.is_none_or(|emission| emission == Vec3::ZERO) {
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

fn read_image(
    context: &Context<'_>,
    path: &str,
    images: &mut Vec<(String, Option<u32>)>,
    scene: &mut Scene,
) -> Option<u32> {
    if let Some((_, image)) = images.iter().find(|(known, _)| known == path) {
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
    images.push((path.to_owned(), image));
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
