//! Textures and materials of the document.

use std::io::Cursor;

use gltf_json as json;
use image::ImageEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use json::validation::Checked::Valid;

use super::{BuiltinError, GlbBuilder, MaterialId, MaterialSpec, TextureId, id};

impl GlbBuilder {
    /// Adds an image of `width × height` RGBA texels, rows from the top, embedded as PNG and repeated outside 0 … 1;
    /// `nearest` turns bilinear filtering off.
    ///
    /// # Errors
    /// [`BuiltinError::Png`] if `rgba8` is not `4 × width × height` bytes.
    pub fn texture(
        &mut self,
        name: &str,
        [width, height]: [u32; 2],
        rgba8: &[u8],
        nearest: bool,
    ) -> Result<TextureId, BuiltinError> {
        let mut png = Vec::new();
        if rgba8.len() as u64 != 4 * u64::from(width) * u64::from(height) {
            return Err(BuiltinError::Png {
                name: name.into(),
                reason: format!("{} bytes for {width} × {height} RGBA texels", rgba8.len()),
            });
        }
        PngEncoder::new_with_quality(Cursor::new(&mut png), CompressionType::Default, FilterType::Adaptive)
            .write_image(rgba8, width, height, image::ExtendedColorType::Rgba8)
            .map_err(|e| BuiltinError::Png { name: name.into(), reason: e.to_string() })?;
        let view = self.push_view(&png, None);
        let source = self.root.push(json::Image {
            buffer_view: Some(view),
            mime_type: Some(json::image::MimeType("image/png".into())),
            name: Some(name.into()),
            uri: None,
            extensions: None,
            extras: None,
        });
        let sampler = self.sampler(nearest);
        let texture = self.root.push(json::Texture {
            name: Some(name.into()),
            sampler: Some(sampler),
            source,
            extensions: None,
            extras: None,
        });
        Ok(TextureId(id(texture)))
    }

    /// Adds a material.
    pub fn material(&mut self, name: &str, spec: &MaterialSpec) -> MaterialId {
        let peak = spec.emissive.max_element();
        let strength = (peak > 1.0).then(|| {
            self.use_extension("KHR_materials_emissive_strength");
            json::extensions::material::EmissiveStrength {
                emissive_strength: json::extensions::material::EmissiveStrengthFactor(peak),
            }
        });
        let material = json::Material {
            name: Some(name.into()),
            alpha_mode: Valid(match spec.alpha_cutoff {
                Some(_) => json::material::AlphaMode::Mask,
                None => json::material::AlphaMode::Opaque,
            }),
            alpha_cutoff: spec.alpha_cutoff.map(json::material::AlphaCutoff),
            double_sided: spec.double_sided,
            pbr_metallic_roughness: json::material::PbrMetallicRoughness {
                base_color_factor: json::material::PbrBaseColorFactor(spec.base_color.to_array()),
                base_color_texture: spec.texture.map(|t| json::texture::Info {
                    index: json::Index::new(t.0),
                    tex_coord: 0,
                    extensions: None,
                    extras: None,
                }),
                metallic_factor: json::material::StrengthFactor(spec.metallic),
                roughness_factor: json::material::StrengthFactor(spec.roughness),
                ..Default::default()
            },
            normal_texture: spec.normal_map.map(|t| json::material::NormalTexture {
                index: json::Index::new(t.0),
                scale: 1.0,
                tex_coord: 0,
                extensions: None,
                extras: None,
            }),
            emissive_factor: json::material::EmissiveFactor((spec.emissive / peak.max(1.0)).to_array()),
            extensions: strength.map(|emissive_strength| json::extensions::material::Material {
                emissive_strength: Some(emissive_strength),
                ..Default::default()
            }),
            ..Default::default()
        };
        MaterialId(id(self.root.push(material)))
    }

    fn sampler(&mut self, nearest: bool) -> json::Index<json::texture::Sampler> {
        if let Some(&sampler) = self.samplers.get(&nearest) {
            return json::Index::new(sampler);
        }
        use json::texture::{MagFilter, MinFilter, Sampler};
        let (mag, min) = match nearest {
            true => (MagFilter::Nearest, MinFilter::Nearest),
            false => (MagFilter::Linear, MinFilter::LinearMipmapLinear),
        };
        let sampler =
            Sampler { mag_filter: Some(Valid(mag)), min_filter: Some(Valid(min)), ..Sampler::default() };
        let sampler = self.root.push(sampler);
        self.samplers.insert(nearest, id(sampler));
        sampler
    }
}
