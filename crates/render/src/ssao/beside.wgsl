// SSAO's sampling pass from the second camera ([Vermeer2021] Alg. 3, line 5): the more occlusion of both. The twin is `sdao::multi_view`.

@fragment
fn ssao_beside_fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let at = vec2<i32>(position.xy);
    let occlusion = textureLoad(before, at, 0).r;
    let seen_from = beside(at);
    if !seen_from.is_seen {
        return vec4(occlusion);
    }
    return vec4(max(occlusion, blocked_part(at, seen_from.place, seen_from.normal)));
}
