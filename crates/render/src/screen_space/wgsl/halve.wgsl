// Of each square of 2 × 2 samples one: distances, or normals. The twin is `gbuffer::Screen::half`.

struct HalveParams {
    // Columns and rows of the full picture.
    full_size: vec2<i32>,
    pad: vec2<f32>,
}

@group(1) @binding(0) var<uniform> params: HalveParams;

@fragment
fn halve_fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    return textureLoad(before, chosen_of_four(vec2<i32>(position.xy), params.full_size), 0);
}
