// Parameters of HBAO and HBAO+, and what HBAO+ finds at one step ([Vermeer2021] Alg. 3). The twin is `hbao`.

struct HbaoParams {
    radius_m: f32,
    directions: u32,
    steps: u32,
    // Radians.
    bias: f32,
    strength: f32,
    // 0 HBAO, 1 HBAO+.
    is_mean: u32,
    // Layers of `hidden` that are read, where they are (LOOKS_), and what occlusion by them is multiplied by.
    hidden_layers: u32,
    looks: u32,
    compensation: f32,
    pad_a: f32,
    pad_b: vec2<f32>,
}

@group(1) @binding(0) var<uniform> params: HbaoParams;

// By how much what is seen so far away counts; 0 beyond the radius.
fn falloff(to_seen: vec3<f32>) -> f32 {
    let squared = dot(to_seen, to_seen);
    return select(0.0, max(1.0 - squared / (params.radius_m * params.radius_m), 0.0), squared > 0.0);
}

// Alg. 3, lines 18 to 24: the greatest height over the surface, as a sine over a bias, by weight, of all that is known under a sample.
fn height_at(seen: vec2<i32>, place: vec3<f32>, normal: vec3<f32>, sin_bias: f32) -> f32 {
    let first = place_at(seen);
    let to_first = first.xyz - place;
    var value = 0.0;
    var is_decided = false;
    if first.w > 0.0 {
        let weight = falloff(to_first);
        let height = dot(normal, to_first);
        if weight > 0.0 {
            value = weight * max(height / length(to_first) - sin_bias, 0.0);
        }
        // Rays that come from below the plane may still rise over it.
        let is_low = height <= sin_bias * length(to_first) && falls_on(first.xyz, normal);
        is_decided = select(is_low, weight > 0.0, params.looks == LOOKS_WHERE_FIRST_IS_FAR) && params.looks != LOOKS_EVERYWHERE;
    }
    if is_decided {
        return value;
    }
    var most = 0.0;
    for (var layer = 0u; layer < params.hidden_layers; layer++) {
        let four = textureLoad(hidden, seen, i32(layer), 0);
        for (var i = 0; i < 4; i++) {
            if !is_background(four[i]) {
                let to_seen = place_view(centre(seen), four[i]) - place;
                let weight = falloff(to_seen);
                if weight > 0.0 {
                    most = max(most, weight * (dot(normal, to_seen) * inverseSqrt(dot(to_seen, to_seen)) - sin_bias));
                }
            }
        }
    }
    return max(value, params.compensation * most);
}
