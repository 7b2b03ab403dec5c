// SSAO's sampling pass: occlusion by random places in a hemisphere. The twin is `ssao`.

struct SsaoParams {
    radius_m: f32,
    samples: u32,
    // Metres over the surface's plane.
    height_m: f32,
    // Layers of `hidden` that are read, and what occlusion by them is multiplied by.
    hidden_layers: u32,
    compensation: f32,
    pad_a: f32,
    pad_b: vec2<f32>,
    // In the unit hemisphere about +z; w is not used.
    offsets: array<vec4<f32>, 256>,
    // Tile of 16 × 16 unit vectors in the plane z = 0, two a texel.
    turns: array<vec4<f32>, 128>,
}

@group(1) @binding(0) var<uniform> params: SsaoParams;

// The sample whose square of the picture a place falls on, outside of the picture where it is behind the camera.
fn sample_at(place: vec3<f32>) -> vec2<i32> {
    var scale = 1.0;
    if screen.is_parallel == 0u {
        if place.z >= 0.0 {
            return vec2(-1);
        }
        scale = -1.0 / place.z;
    }
    return sample_in((vec2(0.5) + vec2(0.5, -0.5) * place.xy * scale / screen.half_extent) * screen.span);
}

// The unit vector of a plane that is nearest to `turn`.
fn tangent_of(normal: vec3<f32>, turn: vec3<f32>) -> vec3<f32> {
    let along = turn - normal * dot(normal, turn);
    // Nearly parallel vectors leave rounding only.
    if dot(along, along) > 1e-6 {
        return normalize(along);
    }
    let sign = select(1.0, -1.0, normal.z < 0.0);
    let a = -1.0 / (sign + normal.z);
    return vec3(normal.x * normal.y * a, sign + normal.y * normal.y * a, -normal.y);
}

// Whether what is seen hides a place of the hemisphere about a position.
fn is_blocked(seen: vec3<f32>, place: vec3<f32>, position: vec3<f32>, normal: vec3<f32>) -> bool {
    let to_seen = seen - position;
    let is_within = dot(to_seen, to_seen) <= params.radius_m * params.radius_m;
    // What hides a place of the hemisphere from an eye above the plane is above it, too: only rounding to samples says else.
    return seen.z > place.z && is_within && dot(normal, to_seen) > params.height_m;
}

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
    let tile = u32(at.y & 15) * 16u + u32(at.x & 15);
    let turns = params.turns[tile >> 1u];
    let turn = select(turns.xy, turns.zw, (tile & 1u) == 1u);
    let tangent = tangent_of(normal, vec3(turn, 0.0));
    let bitangent = cross(normal, tangent);
    var blocked = 0.0;
    for (var i = 0u; i < params.samples; i++) {
        let offset = params.offsets[i].xyz * params.radius_m;
        let place = found.xyz + (tangent * offset.x + bitangent * offset.y + normal * offset.z);
        let at_place = sample_at(place);
        if !is_inside(at_place) {
            continue;
        }
        let seen = place_at(at_place);
        if seen.w > 0.0 && is_blocked(seen.xyz, place, found.xyz, normal) {
            blocked += 1.0;
            continue;
        }
        // Where the first surface blocks, others change nothing.
        var is_hidden = false;
        for (var layer = 0u; layer < params.hidden_layers && !is_hidden; layer++) {
            let four = textureLoad(hidden, at_place, i32(layer), 0);
            for (var k = 0; k < 4; k++) {
                let behind = place_view(centre(at_place), four[k]);
                is_hidden = is_hidden || (!is_background(four[k]) && is_blocked(behind, place, found.xyz, normal));
            }
        }
        blocked += select(0.0, params.compensation, is_hidden);
    }
    return vec4(blocked / f32(params.samples));
}
