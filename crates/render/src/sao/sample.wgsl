// SAO's sampling pass ([McGuire2012] sec. 2.3): place and normal from distances alone, places on a spiral read from the pyramid, quads averaged, and the
// result packed with its distance. The twins are `sao::sample` and `sao::pack`.

override USES_ROTATED_GRID: bool = true;

// Samples that are farther apart than this along the view axis are not averaged in a quad, metres.
const QUAD_EDGE_M: f32 = 0.02;

// The difference of the places of two samples, and 1; 0 where one of them is missing.
fn difference(a: vec2<i32>, b: vec2<i32>) -> vec4<f32> {
    let from_place = place_at(a);
    let to_place = place_at(b);
    return vec4(to_place.xyz - from_place.xyz, from_place.w * to_place.w);
}

// Eq. 4 over the quad of 2 × 2 that a sample is of.
fn quad_normal(at: vec2<i32>) -> vec3<f32> {
    let size = vec2<i32>(screen.size);
    // The last of an odd row or column has no quad: its pair is the one before.
    let even = at & vec2(~1);
    // One by one: GLSL of WebGL2 cannot choose between vectors of integers.
    let x = select(max(even.x - 1, 0), even.x, (at.x | 1) < size.x);
    let y = select(max(even.y - 1, 0), even.y, (at.y | 1) < size.y);
    let first = vec2(x, y);
    let right = difference(vec2(first.x, at.y), vec2(first.x + 1, at.y));
    let down = difference(vec2(at.x, first.y), vec2(at.x, first.y + 1));
    let along_row = select(vec3(1.0, 0.0, 0.0), right.xyz, right.w > 0.0);
    let along_column = select(vec3(0.0, -1.0, 0.0), down.xyz, down.w > 0.0);
    let across = cross(along_column, along_row);
    let length_squared = dot(across, across);
    return select(vec3(0.0, 0.0, 1.0), across * inverseSqrt(max(length_squared, 1e-38)), length_squared > 1e-38);
}

// From depths; at half resolution, where they lie twice as far apart, the geometry's, which upsampling needs there anyway.
fn normal_seen(at: vec2<i32>) -> vec3<f32> {
    if screen.is_half != 0u {
        let own = normal_at(at);
        if any(own != vec3(0.0)) {
            return own;
        }
    }
    return quad_normal(at);
}

// The distance of the texel of a level that a sample lies in, and the point of the picture that it stands for.
fn read_level(level: u32, at: vec2<u32>) -> vec3<f32> {
    var texel = at >> vec2(level);
    let distance = textureLoad(distances, vec2<i32>(texel), i32(level)).r;
    if level == 0u {
        return vec3(distance, centre(vec2<i32>(texel)));
    }
    if !USES_ROTATED_GRID {
        let low = texel << vec2(level);
        let high = min((texel + 1u) << vec2(level), screen.size);
        return vec3(distance, 0.5 * vec2<f32>(low + high));
    }
    for (var above = level; above > 0u; above--) {
        let last = ((screen.size + ((1u << (above - 1u)) - 1u)) >> vec2(above - 1u)) - 1u;
        texel = min(texel * 2u + ((texel.yx & vec2(1u)) ^ vec2(1u)), last);
    }
    return vec3(distance, centre(vec2<i32>(texel)));
}

fn visibility_at(at: vec2<i32>) -> f32 {
    let place = place_at(at);
    if place.w == 0.0 {
        return 1.0;
    }
    let normal = normal_seen(at);
    let distance = -place.z;
    let radius = params.radius_m * samples_per_metre(distance);
    let turn = alchemy_turn(at);
    var sum = 0.0;
    for (var i = 0u; i < params.samples; i++) {
        let step = spiral(i, turn);
        let reach = radius * step.x;
        let seen = neighbour(at, step.yz * reach);
        if !is_inside(seen) {
            continue;
        }
        // Eq. 9: the higher the farther it is on the screen. The exponent of a float is its logarithm, rounded down.
        let log2_reach = i32(bitcast<u32>(max(floor(reach), 1.0)) >> 23u) - 127;
        let level = u32(clamp(log2_reach - i32(params.switch_log2), 0, i32(params.top_level)));
        let found = read_level(level, vec2<u32>(seen));
        if !is_background(found.x) {
            sum += obscurance_term(place_view(found.yz, found.x) - place.xyz, normal, distance);
        }
    }
    return obscurance_visibility(sum);
}

@fragment
fn sao_fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let at = vec2<i32>(position.xy);
    // Of a quad that reaches beyond the picture some samples are not there.
    let here = min(at, vec2<i32>(screen.size) - 1);
    let distance = textureLoad(distances, here, 0).r;
    var value = visibility_at(here);
    let pairs = (at | vec2(1)) < vec2<i32>(screen.size);
    let to_other = vec2(1.0) - 2.0 * vec2<f32>(at & vec2(1));
    // Half way to the other sample of the row, then of the column.
    let step_x = dpdxFine(value);
    // Derivatives before anything branches, `&&` included.
    let step_x_distance = dpdxFine(distance);
    let step_y_distance = dpdyFine(distance);
    if pairs.x && abs(step_x_distance) < QUAD_EDGE_M {
        value += 0.5 * to_other.x * step_x;
    }
    let step_y = dpdyFine(value);
    if pairs.y && abs(step_y_distance) < QUAD_EDGE_M {
        value += 0.5 * to_other.y * step_y;
    }
    let key = 256.0 * clamp(distance / params.farthest_m, 0.0, 1.0);
    let whole = min(floor(key), 255.0);
    return vec4(value, whole / 255.0, key - whole, 1.0);
}
