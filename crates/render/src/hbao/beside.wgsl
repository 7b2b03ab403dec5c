// HBAO+'s sampling pass from the second camera ([Vermeer2021] Alg. 3): the more occlusion of both. The twin is `sdao::multi_view`.

fn occlusion_beside(at: vec2<i32>, seen_from: Beside) -> f32 {
    let step = params.radius_m * samples_per_metre(-seen_from.place.z) / f32(params.steps + 1u);
    // As those of the first camera.
    let turn = interleaved_gradient(at);
    let jitter = interleaved_gradient(at.yx + vec2(57, 23));
    let sin_bias = sin(params.bias);
    var sum = 0.0;
    for (var i = 0u; i < params.directions; i++) {
        let angle = TAU * (f32(i) + turn) / f32(params.directions);
        let direction = vec2(cos(angle), sin(angle));
        for (var s = 0u; s < params.steps; s++) {
            let seen = sample_in(seen_from.point + direction * (step * (f32(s) + 0.5 + jitter)));
            if is_inside(seen) {
                sum += height_at(seen, seen_from.place, seen_from.normal, sin_bias) / f32(params.steps);
            }
        }
    }
    return sum / f32(params.directions);
}

@fragment
fn hbao_beside_fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let at = vec2<i32>(position.xy);
    let visibility = textureLoad(before, at, 0).r;
    let seen_from = beside(at);
    if !seen_from.is_seen {
        return vec4(visibility);
    }
    return vec4(min(visibility, 1.0 - clamp(params.strength * occlusion_beside(at, seen_from), 0.0, 1.0)));
}
