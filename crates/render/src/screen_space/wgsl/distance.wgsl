// Distances from depths ([McGuire2012] eq. 2, for reversed depth): the first level of the pyramid.

struct DistanceParams {
    unused: vec4<f32>,
}

@group(1) @binding(0) var<uniform> params: DistanceParams;

// WebGL2 reads a texture of depths only through a sampler that says nearest.
@group(1) @binding(4) var nearest: sampler;

@fragment
fn distance_fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let place = position.xy / vec2<f32>(textureDimensions(before));
    let depth = textureSampleLevel(before, nearest, place, 0.0).r;
    if depth <= 0.0 {
        return vec4(BACKGROUND_M);
    }
    if screen.is_parallel != 0u {
        return vec4(screen.depth.x - depth * screen.depth.y);
    }
    return vec4(screen.depth.x / depth);
}
