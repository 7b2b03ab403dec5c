//! Texture look-ups as a graphics card does them: sRGB texels are decoded before they are filtered. No mip levels.

use std::sync::LazyLock;

use glam::{Vec2, Vec3, Vec4};

use crate::{Filter, Image, Material, Scene, Texture, TextureRef, Wrap};

/// Linear light of the 256 sRGB codes (IEC 61966-2-1).
static LINEAR_FROM_SRGB8: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|code| linear_from_srgb(code as f64 / 255.0) as f32));

/// Linear light 0 … 1 of an sRGB value 0 … 1.
pub fn linear_from_srgb(value: f64) -> f64 {
    if value <= 0.04045 { value / 12.92 } else { libm::pow((value + 0.055) / 1.055, 2.4) }
}

/// How the bytes of a texel become numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// Red, green, blue are sRGB codes; alpha is linear.
    Srgb,
    /// All four are linear.
    Linear,
}

impl Encoding {
    fn decode(self, [r, g, b, a]: [u8; 4]) -> Vec4 {
        let unorm = |c: u8| f32::from(c) / 255.0;
        match self {
            Encoding::Linear => Vec4::new(unorm(r), unorm(g), unorm(b), unorm(a)),
            Encoding::Srgb => {
                let linear = |c: u8| LINEAR_FROM_SRGB8[usize::from(c)];
                Vec4::new(linear(r), linear(g), linear(b), unorm(a))
            }
        }
    }
}

/// Image coordinates of a texture on a material, from both coordinate sets of a surface.
pub fn image_coordinates(texture: &TextureRef, uv: &[Vec2; 2]) -> Vec2 {
    texture.image_from_uv.transform_point2(uv[usize::from(texture.uv_set.min(1))])
}

/// The value of a material's texture at a surface; 1 in all channels where there is no such texture or image.
pub fn sample(scene: &Scene, texture: &TextureRef, uv: &[Vec2; 2], encoding: Encoding) -> Vec4 {
    let coordinates = image_coordinates(texture, uv);
    let Some(texture) = scene.textures.get(texture.texture as usize) else { return Vec4::ONE };
    let Some(image) = scene.images.get(texture.image as usize) else { return Vec4::ONE };
    sample_image(texture, image, coordinates, encoding)
}

fn sample_image(texture: &Texture, image: &Image, uv: Vec2, encoding: Encoding) -> Vec4 {
    if !uv.is_finite() || image.width == 0 || image.height == 0 {
        return Vec4::ONE;
    }
    let texel = |x: i64, y: i64| -> Vec4 {
        let x = wrap(x, i64::from(image.width), texture.wrap_u);
        let y = wrap(y, i64::from(image.height), texture.wrap_v);
        image.rgba8.get(y * image.width as usize + x).map_or(Vec4::ONE, |&bytes| encoding.decode(bytes))
    };
    let (x, y) = (uv.x * image.width as f32, uv.y * image.height as f32);
    match texture.filter {
        Filter::Nearest => texel(x.floor() as i64, y.floor() as i64),
        Filter::Linear => {
            let (x, y) = (x - 0.5, y - 0.5);
            let (x_floor, y_floor) = (x.floor(), y.floor());
            let (fx, fy) = (x - x_floor, y - y_floor);
            let (x0, y0) = (x_floor as i64, y_floor as i64);
            // Saturating, because coordinates far outside the image end at i64's limits.
            let (x1, y1) = (x0.saturating_add(1), y0.saturating_add(1));
            let top = texel(x0, y0).lerp(texel(x1, y0), fx);
            let bottom = texel(x0, y1).lerp(texel(x1, y1), fx);
            top.lerp(bottom, fy)
        }
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

/// Base colour of a material (linear RGBA): factor × texture × vertex colour.
pub fn base_color(scene: &Scene, material: &Material, uv: &[Vec2; 2], vertex: Vec4) -> Vec4 {
    let mut color = material.base_color_factor * vertex;
    if let Some(texture) = &material.base_color_texture {
        color *= sample(scene, texture, uv, Encoding::Srgb);
    }
    color
}

/// Emitted radiance of a material, W/(m² sr).
pub fn emission(scene: &Scene, material: &Material, uv: &[Vec2; 2]) -> Vec3 {
    match &material.emissive_texture {
        Some(texture) if material.emissive_factor != Vec3::ZERO => {
            material.emissive_factor * sample(scene, texture, uv, Encoding::Srgb).truncate()
        }
        _ => material.emissive_factor,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checker() -> (Texture, Image) {
        let image = Image {
            name: "checker".into(),
            width: 2,
            height: 1,
            rgba8: vec![[0, 0, 0, 255], [255, 255, 255, 255]],
        };
        let texture = Texture { image: 0, wrap_u: Wrap::Repeat, wrap_v: Wrap::Clamp, filter: Filter::Linear };
        (texture, image)
    }

    #[test]
    fn filtering_happens_in_linear_light() {
        let (texture, image) = checker();
        let between = sample_image(&texture, &image, Vec2::new(0.5, 0.5), Encoding::Srgb);
        assert!((between.x - 0.5).abs() < 1e-6, "{between}");
        let at_texel = sample_image(&texture, &image, Vec2::new(0.75, 0.5), Encoding::Srgb);
        assert_eq!(at_texel, Vec4::ONE);
    }

    #[test]
    fn absurd_coordinates_are_harmless() {
        let (mut texture, image) = checker();
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            texture.wrap_u = wrap;
            for u in [1e30f32, -1e30, f32::NAN, f32::INFINITY] {
                let value = sample_image(&texture, &image, Vec2::new(u, u), Encoding::Srgb);
                assert!(value.is_finite());
            }
        }
    }

    #[test]
    fn srgb_decoding_matches_the_standard() {
        assert!((linear_from_srgb(0.5) - 0.214_041).abs() < 1e-6);
        assert_eq!(LINEAR_FROM_SRGB8[0], 0.0);
        assert_eq!(LINEAR_FROM_SRGB8[255], 1.0);
    }
}
