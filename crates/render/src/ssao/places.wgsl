// Parameters of SSAO, and what part of a sample's hemisphere is blocked. The twin is `ssao`.

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

// The part of the places about a position with a normal that what a picture shows hides; `at` is the sample whose turn they are given.
fn blocked_part(at: vec2<i32>, position: vec3<f32>, normal: vec3<f32>) -> f32 {
    let tile = u32(at.y & 15) * 16u + u32(at.x & 15);
    let turns = params.turns[tile >> 1u];
    let turn = select(turns.xy, turns.zw, (tile & 1u) == 1u);
    let tangent = tangent_of(normal, vec3(turn, 0.0));
    let bitangent = cross(normal, tangent);
    var blocked = 0.0;
    for (var i = 0u; i < params.samples; i++) {
        let offset = params.offsets[i].xyz * params.radius_m;
        let place = position + (tangent * offset.x + bitangent * offset.y + normal * offset.z);
        let at_place = sample_in(point_of(place));
        if !is_inside(at_place) {
            continue;
        }
        let seen = place_at(at_place);
        if seen.w > 0.0 && is_blocked(seen.xyz, place, position, normal) {
            blocked += 1.0;
            continue;
        }
        // Where the first surface blocks, others change nothing.
        var is_hidden = false;
        for (var layer = 0u; layer < params.hidden_layers && !is_hidden; layer++) {
            let four = textureLoad(hidden, at_place, i32(layer), 0);
            for (var k = 0; k < 4; k++) {
                let behind = place_view(centre(at_place), four[k]);
                is_hidden = is_hidden || (!is_background(four[k]) && is_blocked(behind, place, position, normal));
            }
        }
        blocked += select(0.0, params.compensation, is_hidden);
    }
    return blocked / f32(params.samples);
}
