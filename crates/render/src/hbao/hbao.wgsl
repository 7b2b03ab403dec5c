// HBAO's and HBAO+'s sampling pass ([Vermeer2021] Alg. 2 and 3 without their stochastic part). The twin is `hbao`.

struct HbaoParams {
    radius_m: f32,
    directions: u32,
    steps: u32,
    // Radians.
    bias: f32,
    strength: f32,
    // 0 HBAO, 1 HBAO+.
    is_mean: u32,
    pad: vec2<f32>,
}

@group(1) @binding(0) var<uniform> params: HbaoParams;

fn occlusion_at(at: vec2<i32>) -> f32 {
    let place = place_at(at);
    if place.w == 0.0 {
        return 0.0;
    }
    let normal = normal_at(at);
    // A triangle without an area has no normal.
    if all(normal == vec3(0.0)) {
        return 0.0;
    }
    let step = params.radius_m * samples_per_metre(-place.z) / f32(params.steps + 1u);
    // Directions and steps begin elsewhere in each sample.
    let turn = interleaved_gradient(at);
    let jitter = interleaved_gradient(at.yx + vec2(57, 23));
    let sin_bias = sin(params.bias);
    var sum = 0.0;
    for (var i = 0u; i < params.directions; i++) {
        let angle = TAU * (f32(i) + turn) / f32(params.directions);
        let direction = vec2(cos(angle), sin(angle));
        var sine = 0.0;
        if params.is_mean == 0u {
            // Where the plane of the surface goes in that direction of the picture.
            let next = on_plane(centre(at) + direction, place.xyz, normal);
            let along = select(vec3(0.0, 0.0, -1.0), next.xyz - place.xyz, next.w > 0.0);
            let tangent = asin(clamp(along.z / max(length(along), 1e-12), -1.0, 1.0));
            sine = sin(min(tangent + params.bias, 0.5 * PI));
        }
        for (var s = 0u; s < params.steps; s++) {
            let seen = place_at(neighbour(at, direction * (step * (f32(s) + 0.5 + jitter))));
            let to_seen = seen.xyz - place.xyz;
            let squared = dot(to_seen, to_seen);
            let part = squared / (params.radius_m * params.radius_m);
            if seen.w == 0.0 || part >= 1.0 || squared <= 0.0 {
                continue;
            }
            let height = dot(normal, to_seen) * inverseSqrt(squared);
            if params.is_mean != 0u {
                sum += (1.0 - part) * max(height - sin_bias, 0.0) / f32(params.steps);
                continue;
            }
            let found = to_seen.z * inverseSqrt(squared);
            // Samples lie beside the direction by up to half of one each way: the plane must not rise over itself for that.
            if height > sin_bias && found > sine {
                sum += (1.0 - part) * (found - sine);
                sine = found;
            }
        }
    }
    return sum / f32(params.directions);
}

@fragment
fn hbao_fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    return vec4(1.0 - clamp(params.strength * occlusion_at(vec2<i32>(position.xy)), 0.0, 1.0));
}
