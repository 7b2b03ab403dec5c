// SSAO's sampling pass: occlusion by random places in a hemisphere. The twin is `ssao`.

@fragment
fn ssao_fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let at = vec2<i32>(position.xy);
    let found = place_at(at);
    if found.w == 0.0 {
        return vec4(0.0);
    }
    let normal = normal_at(at);
    // A triangle without an area has no normal.
    if all(normal == vec3(0.0)) {
        return vec4(0.0);
    }
    return vec4(blocked_part(at, found.xyz, normal));
}
