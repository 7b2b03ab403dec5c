// A material: numbers and textures.

struct TextureUse {
    // Columns of the linear part of image_from_uv.
    linear: vec4<f32>,
    offset: vec2<f32>,
    // Texture coordinate set, 0 or 1.
    uv_set: u32,
    pad: u32,
}

struct Material {
    base_color: vec4<f32>,
    emissive: vec3<f32>,
    metallic: f32,
    roughness: f32,
    normal_scale: f32,
    // Alpha below it is a hole, where holes are cut.
    cutoff: f32,
    // MATERIAL_ bits.
    flags: u32,
    base_color_use: TextureUse,
    metallic_roughness_use: TextureUse,
    normal_use: TextureUse,
    emissive_use: TextureUse,
}

const MATERIAL_UNLIT: u32 = 1u;
const MATERIAL_NORMAL_MAP: u32 = 2u;

@group(1) @binding(0) var<uniform> material: Material;
@group(1) @binding(1) var base_color_texture: texture_2d<f32>;
@group(1) @binding(2) var base_color_sampler: sampler;
@group(1) @binding(3) var metallic_roughness_texture: texture_2d<f32>;
@group(1) @binding(4) var metallic_roughness_sampler: sampler;
@group(1) @binding(5) var normal_texture: texture_2d<f32>;
@group(1) @binding(6) var normal_sampler: sampler;
@group(1) @binding(7) var emissive_texture: texture_2d<f32>;
@group(1) @binding(8) var emissive_sampler: sampler;

// Image coordinates from both coordinate sets.
fn image_coordinates(how: TextureUse, uv: vec4<f32>) -> vec2<f32> {
    let chosen = select(uv.xy, uv.zw, how.uv_set == 1u);
    return how.linear.xy * chosen.x + how.linear.zw * chosen.y + how.offset;
}
