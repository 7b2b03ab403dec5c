//! Materials, textures and images.

use std::collections::HashMap;

use glam::{Affine2, Vec2, Vec3, Vec4};
use gltf::json::extensions::texture::TextureTransform;
use gltf::json::material::{AlphaMode as Alpha, Material as Source};
use gltf::json::texture::{Info, MagFilter, Texture as SourceTexture, WrappingMode};
use gltf::json::validation::Checked;
use gltf::json::{Image as SourceImage, Index};
use serde_json::{Map, Value};

use super::document::{Document, label, name_of};
use crate::load::{LoadError, image, uri};
use crate::{AlphaMode, Filter, Material, NormalTexture, Scene, Texture, TextureRef, Wrap};

/// What the library gives as the image of textures that have none (it may be in an extension).
const NO_SOURCE: usize = u32::MAX as usize;

/// Reads images, textures and materials into `scene`. Textures that cannot be had are warned of and left out.
pub(super) fn read(document: &Document<'_>, scene: &mut Scene) -> Result<(), LoadError> {
    let images = read_images(document, scene)?;
    let textures = read_textures(document, &images, scene)?;
    for (i, source) in document.root.materials.iter().enumerate() {
        let material = read_material(document, source, i, &textures)?;
        scene.materials.push(material);
    }
    Ok(())
}

/// For each image of the file its index in the scene, if it could be decoded.
fn read_images(document: &Document<'_>, scene: &mut Scene) -> Result<Vec<Option<u32>>, LoadError> {
    // The same bytes may be listed many times: they are decoded once.
    let mut known: HashMap<String, Option<u32>> = HashMap::new();
    let mut indices = Vec::new();
    for (i, source) in document.root.images.iter().enumerate() {
        let at = label("image", i, &source.name);
        let view = document.resolve_optional(source.buffer_view, "buffer view", &at, "bufferView")?;
        let reference = source.uri.as_deref();
        let key = match (reference, view) {
            (Some(reference), _) => format!("uri {reference}"),
            (None, Some(view)) => format!("view {view}"),
            (None, None) => format!("image {i}"),
        };
        let index = match known.get(&key) {
            Some(index) => *index,
            None => {
                let index = read_image(document, source, i, at, scene);
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
    source: &SourceImage,
    index: usize,
    at: String,
    scene: &mut Scene,
) -> Option<u32> {
    let context = document.context;
    let name = match &source.uri {
        Some(reference) if !reference.starts_with("data:") => reference.clone(),
        _ => name_of("image", index, &source.name),
    };
    let decoded = match (&source.uri, source.buffer_view) {
        (Some(reference), _) => match uri::read(context, &at, reference) {
            Ok(bytes) => image::decode(context, name, &bytes),
            Err(error) => Err(error.to_string()),
        },
        (None, Some(view)) => match document.view(view, &at) {
            Ok((bytes, _)) => image::decode(context, name, bytes),
            Err(error) => Err(error.to_string()),
        },
        (None, None) => Err("it has neither uri nor bufferView".to_owned()),
    };
    match decoded {
        Ok(image) => {
            scene.images.push(image);
            Some(scene.images.len() as u32 - 1)
        }
        Err(reason) => {
            context.warn(format!("{at} cannot be used ({reason}); materials do without it"));
            None
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
    for (i, source) in document.root.textures.iter().enumerate() {
        let at = label("texture", i, &source.name);
        let sampler = document.resolve_optional(source.sampler, "sampler", &at, "sampler")?;
        let image = if source.source.value() == NO_SOURCE {
            document.context.warn(format!("{at} has no PNG or JPEG image; materials do without it"));
            None
        } else {
            images[document.resolve(source.source, "image", &at, "source")?]
        };
        let Some(image) = image else {
            indices.push(None);
            continue;
        };
        let (mut wrap_u, mut wrap_v, mut filter) = (Wrap::Repeat, Wrap::Repeat, Filter::Linear);
        if let Some(sampler) = sampler.map(|sampler| &document.root.samplers[sampler]) {
            (wrap_u, wrap_v) = (wrap_of(sampler.wrap_s), wrap_of(sampler.wrap_t));
            if let Some(Checked::Valid(MagFilter::Nearest)) = sampler.mag_filter {
                filter = Filter::Nearest;
            }
        }
        scene.textures.push(Texture { image, wrap_u, wrap_v, filter });
        indices.push(Some(scene.textures.len() as u32 - 1));
    }
    Ok(indices)
}

fn wrap_of(mode: Checked<WrappingMode>) -> Wrap {
    match mode {
        Checked::Valid(WrappingMode::ClampToEdge) => Wrap::Clamp,
        Checked::Valid(WrappingMode::MirroredRepeat) => Wrap::Mirror,
        Checked::Valid(WrappingMode::Repeat) | Checked::Invalid => Wrap::Repeat,
    }
}

fn read_material(
    document: &Document<'_>,
    source: &Source,
    index: usize,
    textures: &[Option<u32>],
) -> Result<Material, LoadError> {
    let at = label("material", index, &source.name);
    let reader = Reader { document, at: &at, textures };
    // Factors are fractions; what lies outside is clamped.
    let fraction = |key, x| document.number(&at, key, x).map(|x| x.clamp(0.0, 1.0));
    let pbr = &source.pbr_metallic_roughness;
    let color = document.numbers(&at, "baseColorFactor", pbr.base_color_factor.0)?;
    let mut emissive = Vec3::from(document.numbers(&at, "emissiveFactor", source.emissive_factor.0)?);
    let extensions = source.extensions.as_ref();
    if let Some(strength) = extensions.and_then(|e| e.emissive_strength.as_ref()) {
        emissive *= document.number(&at, "emissiveStrength", strength.emissive_strength.0)?.max(0.0);
    }
    let normal_texture = match &source.normal_texture {
        Some(map) => {
            let others = map.extensions.as_ref().map(|e| &e.others);
            let texture = reader.untyped("normalTexture", map.index, map.tex_coord, others)?;
            let scale = document.number(&at, "normalTexture.scale", map.scale)?;
            texture.map(|texture| NormalTexture { texture, scale })
        }
        None => None,
    };
    let occlusion_texture = match &source.occlusion_texture {
        Some(map) => {
            let others = map.extensions.as_ref().map(|e| &e.others);
            reader.untyped("occlusionTexture", map.index, map.tex_coord, others)?
        }
        None => None,
    };
    let cutoff = source.alpha_cutoff.unwrap_or_default().0;
    Ok(Material {
        name: name_of("material", index, &source.name),
        base_color_factor: Vec4::from(color).clamp(Vec4::ZERO, Vec4::ONE),
        base_color_texture: reader.info("pbrMetallicRoughness.baseColorTexture", &pbr.base_color_texture)?,
        metallic_factor: fraction("metallicFactor", pbr.metallic_factor.0)?,
        roughness_factor: fraction("roughnessFactor", pbr.roughness_factor.0)?,
        metallic_roughness_texture: reader
            .info("pbrMetallicRoughness.metallicRoughnessTexture", &pbr.metallic_roughness_texture)?,
        normal_texture,
        occlusion_texture,
        emissive_factor: emissive.max(Vec3::ZERO),
        emissive_texture: reader.info("emissiveTexture", &source.emissive_texture)?,
        alpha_mode: match source.alpha_mode {
            Checked::Valid(Alpha::Opaque) => AlphaMode::Opaque,
            Checked::Valid(Alpha::Mask) => {
                AlphaMode::Mask { cutoff: document.number(&at, "alphaCutoff", cutoff)?.max(0.0) }
            }
            Checked::Valid(Alpha::Blend) => AlphaMode::Blend,
            Checked::Invalid => {
                document.context.warn(format!("{at}: unknown alphaMode, taken as OPAQUE"));
                AlphaMode::Opaque
            }
        },
        double_sided: source.double_sided,
        unlit: extensions.is_some_and(|e| e.unlit.is_some()),
    })
}

/// Reads the texture references of one material.
struct Reader<'a> {
    document: &'a Document<'a>,
    at: &'a str,
    textures: &'a [Option<u32>],
}

impl Reader<'_> {
    fn info(&self, key: &str, info: &Option<Info>) -> Result<Option<TextureRef>, LoadError> {
        let Some(info) = info else { return Ok(None) };
        let transform = info.extensions.as_ref().and_then(|e| e.texture_transform.as_ref());
        self.texture_ref(key, info.index, info.tex_coord, transform)
    }

    /// A reference whose transform the library leaves as it is.
    fn untyped(
        &self,
        key: &str,
        index: Index<SourceTexture>,
        uv_set: u32,
        extensions: Option<&Map<String, Value>>,
    ) -> Result<Option<TextureRef>, LoadError> {
        let transform = extensions.and_then(|extensions| extensions.get("KHR_texture_transform"));
        let parse = |value: &Value| serde_json::from_value::<TextureTransform>(value.clone());
        let transform = transform.map(parse).transpose().map_err(|error| LoadError::Schema {
            file: self.document.context.file(),
            at: format!("{}.{key}.extensions.KHR_texture_transform", self.at),
            problem: error.to_string(),
        })?;
        self.texture_ref(key, index, uv_set, transform.as_ref())
    }

    fn texture_ref(
        &self,
        key: &str,
        index: Index<SourceTexture>,
        mut uv_set: u32,
        transform: Option<&TextureTransform>,
    ) -> Result<Option<TextureRef>, LoadError> {
        let (document, at) = (self.document, format!("{}.{key}", self.at));
        let texture = document.resolve(index, "texture", &at, "index")?;
        let mut image_from_uv = Affine2::IDENTITY;
        if let Some(transform) = transform {
            uv_set = transform.tex_coord.unwrap_or(uv_set);
            let offset = Vec2::from(document.numbers(&at, "offset", transform.offset.0)?);
            let scale = Vec2::from(document.numbers(&at, "scale", transform.scale.0)?);
            let rotation = document.number(&at, "rotation", transform.rotation.0)?;
            // Counter-clockwise as seen on the image, whose v axis points down.
            image_from_uv = Affine2::from_scale_angle_translation(scale, -rotation, offset);
        }
        let Some(texture) = self.textures[texture] else { return Ok(None) };
        if uv_set > 1 {
            let why = "only texture coordinate sets 0 and 1 are read; texture left out";
            document.context.warn(format!("{at}: {why}"));
            return Ok(None);
        }
        Ok(Some(TextureRef { texture, uv_set: uv_set as u8, image_from_uv }))
    }
}
