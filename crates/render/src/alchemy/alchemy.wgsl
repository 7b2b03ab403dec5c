// AlchemyAO's sampling pass ([McGuire2012] eq. 1 from positions and normals at full resolution). The twin is `alchemy`.

@fragment
fn alchemy_fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let at = vec2<i32>(position.xy);
    let place = place_at(at);
    if place.w == 0.0 {
        return vec4(1.0);
    }
    let normal = normal_at(at);
    let distance = -place.z;
    let radius = params.radius_m * samples_per_metre(distance);
    let turn = alchemy_turn(at);
    var sum = 0.0;
    for (var i = 0u; i < params.samples; i++) {
        let step = spiral(i, turn);
        let seen = place_at(neighbour(at, step.yz * (radius * step.x)));
        if seen.w > 0.0 {
            sum += obscurance_term(seen.xyz - place.xyz, normal, distance);
        }
    }
    return vec4(obscurance_visibility(sum));
}
