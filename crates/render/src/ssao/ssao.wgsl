// SSAO's sampling pass: occlusion by random places in a hemisphere. The twin is `ssao`.

struct SsaoParams {
    radius_m: f32,
    samples: u32,
    // Metres over the surface's plane.
    height_m: f32,
    pad: f32,
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
        let seen = place_at(sample_at(place));
        let to_seen = seen.xyz - found.xyz;
        let is_within = dot(to_seen, to_seen) <= params.radius_m * params.radius_m;
        // What hides a place of the hemisphere from an eye above the plane is above it, too: only rounding to samples says else.
        let is_above = dot(normal, to_seen) > params.height_m;
        blocked += select(0.0, 1.0, seen.w > 0.0 && seen.z > place.z && is_within && is_above);
    }
    return vec4(blocked / f32(params.samples));
}
