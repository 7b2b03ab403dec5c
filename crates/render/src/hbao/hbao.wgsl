// HBAO's and HBAO+'s sampling pass ([Vermeer2021] Alg. 2 and 3). The twin is `hbao`.

// What a place adds to the sum of a direction whose horizon is at a sine, and the sine that it raises that to; 0 where it does not.
fn gain(to_seen: vec3<f32>, normal: vec3<f32>, sin_bias: f32, sine: f32) -> vec2<f32> {
    let weight = falloff(to_seen);
    let size = length(to_seen);
    let found = to_seen.z / max(size, 1e-12);
    // Samples lie beside the direction by up to half of one each way: the plane must not rise over itself for that.
    let is_above = dot(normal, to_seen) > sin_bias * size;
    return select(vec2(0.0), vec2(weight * (found - sine), found), is_above && found > sine && weight > 0.0);
}

// Alg. 2, lines 12 to 35, for one step: what is added, and the new horizon's sine.
fn horizon_at(seen: vec2<i32>, place: vec3<f32>, normal: vec3<f32>, sin_bias: f32, sine: f32) -> vec2<f32> {
    let first = place_at(seen);
    let to_first = first.xyz - place;
    var best = vec2(0.0, sine);
    var is_decided = false;
    if first.w > 0.0 {
        let own = gain(to_first, normal, sin_bias, sine);
        if own.x > 0.0 {
            best = own;
        }
        let is_under = to_first.z <= sine * length(to_first);
        let is_near = falloff(to_first) > 0.0 && params.looks == LOOKS_WHERE_FIRST_IS_FAR;
        is_decided = params.looks != LOOKS_EVERYWHERE && (is_under || is_near);
    }
    if is_decided {
        return best;
    }
    var most = vec2(0.0);
    for (var layer = 0u; layer < params.hidden_layers; layer++) {
        let four = textureLoad(hidden, seen, i32(layer), 0);
        for (var i = 0; i < 4; i++) {
            if !is_background(four[i]) {
                let other = gain(place_view(centre(seen), four[i]) - place, normal, sin_bias, sine);
                if other.x > most.x {
                    most = other;
                }
            }
        }
    }
    most.x *= params.compensation;
    return select(best, most, most.x > best.x);
}

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
            let seen = neighbour(at, direction * (step * (f32(s) + 0.5 + jitter)));
            // Its own sample blocks nothing, and what is drawn twice differs in its last bits.
            if !is_inside(seen) || all(seen == at) {
                continue;
            }
            if params.is_mean != 0u {
                sum += height_at(seen, place.xyz, normal, sin_bias) / f32(params.steps);
                continue;
            }
            let raised = horizon_at(seen, place.xyz, normal, sin_bias, sine);
            sum += raised.x;
            sine = raised.y;
        }
    }
    return sum / f32(params.directions);
}

@fragment
fn hbao_fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    return vec4(1.0 - clamp(params.strength * occlusion_at(vec2<i32>(position.xy)), 0.0, 1.0));
}
