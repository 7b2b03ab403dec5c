//! Metallic-roughness materials and the images they read.

use glam::{Affine2, Vec2, Vec3, Vec4};

/// A glTF metallic-roughness material. Defaults are glTF's.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name in the file, or a made-up one.
    pub name: String,
    /// Linear RGBA, multiplied with the texture.
    pub base_color_factor: Vec4,
    /// sRGB colour, linear alpha.
    pub base_color_texture: Option<TextureRef>,
    /// 0 dielectric … 1 metal.
    pub metallic_factor: f32,
    /// Perceptual roughness 0 … 1.
    pub roughness_factor: f32,
    /// G = roughness, B = metallic.
    pub metallic_roughness_texture: Option<TextureRef>,
    /// Tangent-space normals.
    pub normal_texture: Option<NormalTexture>,
    /// R = baked occlusion (kept for bakes; not used in shading).
    pub occlusion_texture: Option<TextureRef>,
    /// Linear emitted radiance, `KHR_materials_emissive_strength` already multiplied in.
    pub emissive_factor: Vec3,
    /// sRGB, multiplied with the factor.
    pub emissive_texture: Option<TextureRef>,
    /// How alpha is read.
    pub alpha_mode: AlphaMode,
    /// Drawn and lit from both sides.
    pub double_sided: bool,
    /// `KHR_materials_unlit`: base colour is the result.
    pub unlit: bool,
}

impl Default for Material {
    fn default() -> Self {
        Material {
            name: String::new(),
            base_color_factor: Vec4::ONE,
            base_color_texture: None,
            metallic_factor: 1.0,
            roughness_factor: 1.0,
            metallic_roughness_texture: None,
            normal_texture: None,
            occlusion_texture: None,
            emissive_factor: Vec3::ZERO,
            emissive_texture: None,
            alpha_mode: AlphaMode::Opaque,
            double_sided: false,
            unlit: false,
        }
    }
}

/// How a material's alpha is read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AlphaMode {
    /// Alpha is ignored.
    Opaque,
    /// Alpha below the cutoff is a hole.
    Mask {
        /// glTF default 0.5.
        cutoff: f32,
    },
    /// Blended by alpha. Rays and the CPU rasteriser treat it as a mask with cutoff 0.5.
    Blend,
}

/// A texture as a material uses it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureRef {
    /// Index into [`crate::Scene::textures`].
    pub texture: u32,
    /// Texture coordinate set, 0 or 1.
    pub uv_set: u8,
    /// `KHR_texture_transform`: coordinates in the image from coordinates of the vertex.
    pub image_from_uv: Affine2,
}

/// A normal map with its scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NormalTexture {
    /// Which texture.
    pub texture: TextureRef,
    /// Scale of x and y, default 1.
    pub scale: f32,
}

/// An image with the way it is sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Texture {
    /// Index into [`crate::Scene::images`].
    pub image: u32,
    /// Outside 0 … 1 along u.
    pub wrap_u: Wrap,
    /// Outside 0 … 1 along v.
    pub wrap_v: Wrap,
    /// Magnification filter.
    pub filter: Filter,
}

/// What happens outside 0 … 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrap {
    /// Repeat.
    Repeat,
    /// Repeat, every second copy mirrored.
    Mirror,
    /// Border texel.
    Clamp,
}

/// Filter between texels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Filter {
    /// Nearest texel.
    Nearest,
    /// Bilinear.
    Linear,
}

/// A decoded image, 8 bits a channel as stored in the file (not linearised).
#[derive(Clone, PartialEq, Eq)]
pub struct Image {
    /// Name or URI.
    pub name: String,
    /// Width in texels, ≥ 1.
    pub width: u32,
    /// Height in texels, ≥ 1.
    pub height: u32,
    /// Rows from the top, `width * height` RGBA values.
    pub rgba8: Vec<[u8; 4]>,
}

impl std::fmt::Debug for Image {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Image({:?}, {}x{})", self.name, self.width, self.height)
    }
}

impl Texture {
    /// The texel value at `uv` (image coordinates, v down), each channel 0 … 1 as stored, filtered as the sampler says.
    pub fn sample(&self, image: &Image, uv: Vec2) -> Vec4 {
        let x = uv.x * image.width as f32 - 0.5;
        let y = uv.y * image.height as f32 - 0.5;
        match self.filter {
            Filter::Nearest => self.texel(image, (x + 0.5).floor() as i64, (y + 0.5).floor() as i64),
            Filter::Linear => {
                let (x0, y0) = (x.floor(), y.floor());
                let (fx, fy) = (x - x0, y - y0);
                let (x0, y0) = (x0 as i64, y0 as i64);
                let top = self.texel(image, x0, y0).lerp(self.texel(image, x0.saturating_add(1), y0), fx);
                let bottom = self
                    .texel(image, x0, y0.saturating_add(1))
                    .lerp(self.texel(image, x0.saturating_add(1), y0.saturating_add(1)), fx);
                top.lerp(bottom, fy)
            }
        }
    }

    fn texel(&self, image: &Image, x: i64, y: i64) -> Vec4 {
        let x = wrap(x, i64::from(image.width), self.wrap_u);
        let y = wrap(y, i64::from(image.height), self.wrap_v);
        let [r, g, b, a] = image.rgba8[y * image.width as usize + x];
        Vec4::new(f32::from(r), f32::from(g), f32::from(b), f32::from(a)) / 255.0
    }
}

fn wrap(i: i64, n: i64, mode: Wrap) -> usize {
    let i = match mode {
        Wrap::Repeat => i.rem_euclid(n),
        Wrap::Clamp => i.clamp(0, n - 1),
        Wrap::Mirror => {
            let j = i.rem_euclid(2 * n);
            if j < n { j } else { 2 * n - 1 - j }
        }
    };
    i as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_far_outside_are_sampled() {
        let image = Image { name: String::new(), width: 2, height: 3, rgba8: vec![[0, 51, 102, 255]; 6] };
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            let texture = Texture { image: 0, wrap_u: wrap, wrap_v: wrap, filter: Filter::Linear };
            for (u, v) in [(1e30, 1e30), (-1e30, 1e30), (1e30, -1e30), (0.3, 1e30)] {
                let texel = texture.sample(&image, Vec2::new(u, v));
                assert!(texel.abs_diff_eq(Vec4::new(0.0, 0.2, 0.4, 1.0), 1e-6), "{wrap:?} {u} {v}: {texel}");
            }
        }
    }
}
