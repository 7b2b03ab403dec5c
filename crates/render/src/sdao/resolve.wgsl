// Four samples of the stochastic depth map as distances in one texel; of a quarter of the pixels where the method sees half the resolution. The twin is `sdao::map`.

struct ResolveParams {
    // Columns and rows of the full picture.
    full_size: vec2<i32>,
    is_half: u32,
    pad: u32,
}

@group(1) @binding(0) var<uniform> params: ResolveParams;
@group(1) @binding(3) var map: texture_depth_multisampled_2d;

fn distance_of(at: vec2<i32>, sample: i32) -> f32 {
    let depth = textureLoad(map, at, sample);
    if depth <= 0.0 {
        return BACKGROUND_M;
    }
    if screen.is_parallel != 0u {
        return screen.depth.x - depth * screen.depth.y;
    }
    return screen.depth.x / depth;
}

@fragment
fn resolve_fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    var at = vec2<i32>(position.xy);
    if params.is_half != 0u {
        at = chosen_of_four(at, params.full_size);
    }
    return vec4(distance_of(at, 0), distance_of(at, 1), distance_of(at, 2), distance_of(at, 3));
}
