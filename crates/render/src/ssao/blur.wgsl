// One direction of SSAO's blur. The twin is `ssao::blur`.

struct BlurParams {
    // One sample to the right or down.
    axis: vec2<i32>,
    // Taps on either side.
    half_width: u32,
    inverse_sigma: f32,
    // Of the sample itself; all weights together are 1.
    middle: f32,
    pad_a: f32,
    pad_b: vec2<f32>,
}

@group(1) @binding(0) var<uniform> params: BlurParams;

@fragment
fn blur_fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let at = vec2<i32>(position.xy);
    let last = vec2<i32>(screen.size) - 1;
    var sum = params.middle * textureLoad(before, at, 0).r;
    for (var tap = 1u; tap <= params.half_width; tap++) {
        let x = f32(tap) * params.inverse_sigma;
        let weight = params.middle * exp(-0.5 * x * x);
        let by = params.axis * i32(tap);
        // Beyond the border values repeat.
        let left = textureLoad(before, clamp(at - by, vec2(0), last), 0).r;
        let right = textureLoad(before, clamp(at + by, vec2(0), last), 0).r;
        sum += weight * (left + right);
    }
    if params.axis.y == 0 {
        return vec4(sum);
    }
    // The last of the two turns occlusion into visibility.
    return vec4(select(1.0 - clamp(sum, 0.0, 1.0), 1.0, is_background(textureLoad(distances, at, 0).r)));
}
