// What the forward pass reads: of each pixel its visibility and its distance, without the guard band.

struct PlaceParams {
    // Samples of the guard band on each side.
    guard: vec2<i32>,
    pad: vec2<f32>,
}

@group(1) @binding(0) var<uniform> params: PlaceParams;

@fragment
fn place_fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let at = vec2<i32>(position.xy) + params.guard;
    // Sixteen bits do not reach the background.
    let distance = min(textureLoad(distances, at, 0).r, 60000.0);
    return vec4(textureLoad(before, at, 0).r, distance, 0.0, 1.0);
}
