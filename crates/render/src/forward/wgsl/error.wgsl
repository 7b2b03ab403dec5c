// The absolute difference of two pictures of visibility in colours, as `compose::view_error` shows it.

@group(0) @binding(0) var picture_a: texture_2d<f32>;
@group(0) @binding(1) var picture_b: texture_2d<f32>;

// Error at which the colours end.
const ERROR_RANGE: f32 = 0.25;
const BACKGROUND: vec3<f32> = vec3(24.0, 34.0, 62.0) / 255.0;

@vertex
fn error_vertex(@builtin(vertex_index) corner: u32) -> @builtin(position) vec4<f32> {
    return vec4(f32(corner & 1u) * 4.0 - 1.0, f32(corner >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}

@fragment
fn error_fragment(@builtin(position) at: vec4<f32>) -> @location(0) vec4<f32> {
    let a = textureLoad(picture_a, vec2<i32>(at.xy), 0).rgb;
    let b = textureLoad(picture_b, vec2<i32>(at.xy), 0).rgb;
    // Visibility is gray and the background is not.
    if abs(a.b - a.r) > 0.05 {
        return vec4(BACKGROUND, 1.0);
    }
    return vec4(point_color(abs(a.g - b.g) / ERROR_RANGE), 1.0);
}
