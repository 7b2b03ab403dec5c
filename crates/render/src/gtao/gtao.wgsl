// The sampling pass of GTAO with a visibility bitmask. The twin is `gtao`.

struct GtaoParams {
    radius_m: f32,
    slices: u32,
    steps: u32,
    thickness_m: f32,
    bias: f32,
    pad_a: f32,
    pad_b: vec2<f32>,
}

@group(1) @binding(0) var<uniform> params: GtaoParams;

// Sectors of a slice, one a bit.
const SECTORS: f32 = 32.0;

// A plane through the eye's ray. Angles in it are from the way to the eye, positive to one side.
struct Slice {
    // Angle of the normal, brought into the plane.
    normal: f32,
    // The least angle of the hemisphere, in `gathered`.
    least: f32,
    // All light that comes, in `gathered`.
    all: f32,
    // What the slice counts; 0 where there is none.
    weight: f32,
}

// Light from the eye's ray up to an angle, cos(θ − γ) |sin θ| integrated ([Jimenez2016] eq. 7), with the angle's sign.
fn gathered(gamma: f32, angle: f32) -> f32 {
    let value = 0.25 * (cos(gamma) - cos(2.0 * angle - gamma) + 2.0 * angle * sin(gamma));
    return select(abs(value), -abs(value), angle < 0.0);
}

fn slice_along(eye: vec3<f32>, normal: vec3<f32>, direction: vec3<f32>) -> Slice {
    var slice = Slice(0.0, 0.0, 0.0, 0.0);
    let beside = direction - eye * dot(direction, eye);
    if dot(beside, beside) < 1e-12 {
        return slice;
    }
    let side = normalize(beside);
    let across = cross(side, eye);
    let projected = normal - across * dot(normal, across);
    let size = length(projected);
    if size < 1e-4 {
        return slice;
    }
    slice.normal = atan2(dot(projected, side), dot(projected, eye));
    slice.least = gathered(slice.normal, slice.normal - 0.5 * PI);
    slice.all = gathered(slice.normal, slice.normal + 0.5 * PI) - slice.least;
    slice.weight = size * slice.all;
    return slice;
}

// In sectors.
fn sector(slice: Slice, eye: vec3<f32>, to: vec3<f32>, side: f32) -> f32 {
    let cosine = clamp(dot(to, eye) / max(length(to), 1e-12), -1.0, 1.0);
    let angle = clamp(side * acos(cosine), slice.normal - 0.5 * PI, slice.normal + 0.5 * PI);
    return SECTORS * clamp((gathered(slice.normal, angle) - slice.least) / slice.all, 0.0, 1.0);
}

// All bits below one, 0 … 32.
fn up_to(bit: u32) -> u32 {
    return select((1u << (bit & 31u)) - 1u, 0xffffffffu, bit >= 32u);
}

// GLSL of WebGL2 does not count bits.
fn count_bits(bits: u32) -> u32 {
    let pairs = bits - ((bits >> 1u) & 0x55555555u);
    let fours = (pairs & 0x33333333u) + ((pairs >> 2u) & 0x33333333u);
    return (((fours + (fours >> 4u)) & 0x0f0f0f0fu) * 0x01010101u) >> 24u;
}

@fragment
fn gtao_fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let at = vec2<i32>(position.xy);
    let found = place_at(at);
    if found.w == 0.0 {
        return vec4(1.0);
    }
    let place = found.xyz;
    let normal = normal_at(at);
    // A triangle without an area has no normal.
    if all(normal == vec3(0.0)) {
        return vec4(1.0);
    }
    let eye = towards_eye(place);
    let radius = params.radius_m * samples_per_metre(-place.z);
    let turn = interleaved_gradient(at);
    let jitter = interleaved_gradient(at.yx + vec2(57, 23));
    var open = 0.0;
    var all_light = 0.0;
    for (var number = 0u; number < params.slices; number++) {
        let angle = PI * (f32(number) + turn) / f32(params.slices);
        let direction = vec2(cos(angle), sin(angle));
        // Down the picture is −y.
        let slice = slice_along(eye, normal, vec3(direction.x, -direction.y, 0.0));
        if slice.weight == 0.0 {
            continue;
        }
        var blocked = 0u;
        for (var half = 0; half < 2; half++) {
            let side = select(1.0, -1.0, half == 1);
            for (var step = 0u; step < params.steps; step++) {
                // Most places lie near.
                let part = (f32(step) + 0.25 + 0.75 * jitter) / f32(params.steps);
                let seen = place_at(neighbour(at, direction * (side * (radius * part * part + 1.0))));
                if seen.w == 0.0 {
                    continue;
                }
                let to_seen = seen.xyz - place;
                let squared = dot(to_seen, to_seen);
                if dot(normal, to_seen) <= params.bias * sqrt(squared) || squared > params.radius_m * params.radius_m {
                    continue;
                }
                let front = sector(slice, eye, to_seen, side);
                let back = sector(slice, eye, to_seen - towards_eye(seen.xyz) * params.thickness_m, side);
                // A sector is blocked where half of it is.
                let low = u32(floor(min(front, back) + 0.5));
                let high = u32(floor(max(front, back) + 0.5));
                blocked |= up_to(high) & ~up_to(low);
            }
        }
        open += slice.weight * (1.0 - f32(count_bits(blocked)) / SECTORS);
        all_light += slice.weight;
    }
    if all_light <= 0.0 {
        return vec4(1.0);
    }
    return vec4(open / all_light);
}
