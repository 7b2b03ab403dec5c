//! Materials, textures and images.

use std::collections::HashMap;

use glam::{Affine2, Vec2, Vec3, Vec4};

use super::document::Document;
use super::json::Object;
use crate::load::{LoadError, image, uri};
use crate::{AlphaMode, Filter, Material, NormalTexture, Scene, Texture, TextureRef, Wrap};

/// Reads images, textures and materials into `scene`. Textures that cannot be had are warned of and left out.
pub(super) fn read(document: &Document<'_>, scene: &mut Scene) -> Result<(), LoadError> {
    let images = read_images(document, scene)?;
    let textures = read_textures(document, &images, scene)?;
    for (i, object) in document.materials.iter().enumerate() {
        let material = read_material(document, object, i, &textures)?;
        scene.materials.push(material);
    }
    Ok(())
}

/// For each image of the file its index in the scene, if it could be decoded.
fn read_images(document: &Document<'_>, scene: &mut Scene) -> Result<Vec<Option<u32>>, LoadError> {
    // The same bytes may be listed many times: they are decoded once.
    let mut known: HashMap<String, Option<u32>> = HashMap::new();
    let mut indices = Vec::new();
    for (i, object) in document.images.iter().enumerate() {
        let reference = object.string("uri")?;
        let view = object.index("bufferView", "buffer view", document.views.len())?;
        let key = match (reference, view) {
            (Some(reference), _) => format!("uri {reference}"),
            (None, Some(view)) => format!("view {view}"),
            (None, None) => format!("image {i}"),
        };
        let index = match known.get(&key) {
            Some(index) => *index,
            None => {
                let index = read_image(document, object, i, reference, view, scene)?;
                known.insert(key, index);
                index
            }
        };
        indices.push(index);
    }
    Ok(indices)
}

fn read_image(
    document: &Document<'_>,
    object: &Object<'_>,
    index: usize,
    reference: Option<&str>,
    view: Option<usize>,
    scene: &mut Scene,
) -> Result<Option<u32>, LoadError> {
    let context = document.context;
    let name = match reference {
        Some(reference) if !reference.starts_with("data:") => reference.to_owned(),
        _ => object.name("image", index)?,
    };
    let decoded = match (reference, view) {
        (Some(reference), _) => match uri::read(context, &object.at, reference) {
            Ok(bytes) => image::decode(context, name, &bytes),
            Err(error) => Err(error.to_string()),
        },
        (None, Some(view)) => match document.view(view) {
            Ok((bytes, _)) => image::decode(context, name, bytes),
            Err(error) => Err(error.to_string()),
        },
        (None, None) => Err("it has neither uri nor bufferView".to_owned()),
    };
    match decoded {
        Ok(image) => {
            scene.images.push(image);
            Ok(Some(scene.images.len() as u32 - 1))
        }
        Err(reason) => {
            context.warn(format!("{} cannot be used ({reason}); materials do without it", object.at));
            Ok(None)
        }
    }
}

/// For each texture of the file its index in the scene, if its image could be decoded.
fn read_textures(
    document: &Document<'_>,
    images: &[Option<u32>],
    scene: &mut Scene,
) -> Result<Vec<Option<u32>>, LoadError> {
    let mut indices = Vec::new();
    for object in &document.textures {
        let sampler = object.index("sampler", "sampler", document.samplers.len())?;
        let source = object.index("source", "image", images.len())?;
        if source.is_none() {
            document.context.warn(format!("{} has no PNG or JPEG image; materials do without it", object.at));
        }
        let Some(image) = source.and_then(|source| images[source]) else {
            indices.push(None);
            continue;
        };
        let (mut wrap_u, mut wrap_v, mut filter) = (Wrap::Repeat, Wrap::Repeat, Filter::Linear);
        if let Some(sampler) = sampler {
            let sampler = &document.samplers[sampler];
            let wrap = |key: &str| {
                Ok(match sampler.uint(key)? {
                    Some(33071) => Wrap::Clamp,
                    Some(33648) => Wrap::Mirror,
                    _ => Wrap::Repeat,
                })
            };
            (wrap_u, wrap_v) = (wrap("wrapS")?, wrap("wrapT")?);
            if sampler.uint("magFilter")? == Some(9728) {
                filter = Filter::Nearest;
            }
        }
        scene.textures.push(Texture { image, wrap_u, wrap_v, filter });
        indices.push(Some(scene.textures.len() as u32 - 1));
    }
    Ok(indices)
}

fn read_material(
    document: &Document<'_>,
    object: &Object<'_>,
    index: usize,
    textures: &[Option<u32>],
) -> Result<Material, LoadError> {
    let context = document.context;
    let mut material = Material { name: object.name("material", index)?, ..Material::default() };
    let texture = |object: &Object<'_>, key: &str| match object.object(key)? {
        Some(info) => texture_ref(document, &info, textures),
        None => Ok::<_, LoadError>(None),
    };
    // Factors are fractions; what lies outside is clamped.
    let fraction = |object: &Object<'_>, key: &str, default: f32| {
        Ok::<f32, LoadError>(object.number(key)?.unwrap_or(default).clamp(0.0, 1.0))
    };
    if let Some(pbr) = object.object("pbrMetallicRoughness")? {
        let color = pbr.numbers::<4>("baseColorFactor")?.unwrap_or([1.0; 4]);
        material.base_color_factor = Vec4::from(color).clamp(Vec4::ZERO, Vec4::ONE);
        material.base_color_texture = texture(&pbr, "baseColorTexture")?;
        material.metallic_factor = fraction(&pbr, "metallicFactor", 1.0)?;
        material.roughness_factor = fraction(&pbr, "roughnessFactor", 1.0)?;
        material.metallic_roughness_texture = texture(&pbr, "metallicRoughnessTexture")?;
    }
    if let (Some(texture), Some(info)) = (texture(object, "normalTexture")?, object.object("normalTexture")?)
    {
        material.normal_texture =
            Some(NormalTexture { texture, scale: info.number("scale")?.unwrap_or(1.0) });
    }
    material.occlusion_texture = texture(object, "occlusionTexture")?;
    material.emissive_texture = texture(object, "emissiveTexture")?;
    let emissive = Vec3::from(object.numbers::<3>("emissiveFactor")?.unwrap_or([0.0; 3])).max(Vec3::ZERO);
    let strength = match object.extension("KHR_materials_emissive_strength")? {
        Some(extension) => extension.number("emissiveStrength")?.unwrap_or(1.0).max(0.0),
        None => 1.0,
    };
    material.emissive_factor = emissive * strength;
    material.unlit = object.extension("KHR_materials_unlit")?.is_some();
    material.double_sided = object.bool("doubleSided")?.unwrap_or(false);
    material.alpha_mode = match object.string("alphaMode")? {
        None | Some("OPAQUE") => AlphaMode::Opaque,
        Some("MASK") => AlphaMode::Mask { cutoff: object.number("alphaCutoff")?.unwrap_or(0.5).max(0.0) },
        Some("BLEND") => AlphaMode::Blend,
        Some(_) => {
            context.warn(format!("{}: unknown alphaMode, taken as OPAQUE", object.at));
            AlphaMode::Opaque
        }
    };
    Ok(material)
}

fn texture_ref(
    document: &Document<'_>,
    info: &Object<'_>,
    textures: &[Option<u32>],
) -> Result<Option<TextureRef>, LoadError> {
    let texture = info.index("index", "texture", textures.len())?.ok_or_else(|| info.missing("index"))?;
    let mut uv_set = info.uint("texCoord")?.unwrap_or(0);
    let mut image_from_uv = Affine2::IDENTITY;
    if let Some(transform) = info.extension("KHR_texture_transform")? {
        uv_set = transform.uint("texCoord")?.unwrap_or(uv_set);
        let offset = Vec2::from(transform.numbers::<2>("offset")?.unwrap_or([0.0; 2]));
        let scale = Vec2::from(transform.numbers::<2>("scale")?.unwrap_or([1.0; 2]));
        let rotation = transform.number("rotation")?.unwrap_or(0.0);
        // Counter-clockwise as seen on the image, whose v axis points down.
        image_from_uv = Affine2::from_scale_angle_translation(scale, -rotation, offset);
    }
    let Some(texture) = textures[texture] else { return Ok(None) };
    if uv_set > 1 {
        document
            .context
            .warn(format!("{}: only texture coordinate sets 0 and 1 are read; texture left out", info.at));
        return Ok(None);
    }
    Ok(Some(TextureRef { texture, uv_set: uv_set as u8, image_from_uv }))
}
