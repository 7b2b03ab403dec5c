// What the forward pass reads: of each pixel its visibility and its distance, without the guard band; from values at half resolution by joint bilateral
// upsampling. The twin is `upsample`.

struct PlaceParams {
    // Samples of the guard band on each side.
    guard: vec2<i32>,
    // Whether values are of half the resolution.
    is_half: u32,
    pad: f32,
}

@group(1) @binding(0) var<uniform> params: PlaceParams;

// How far a sample may lie from another's plane before it counts nothing, in widths of a sample at that distance.
const TOLERANCE_SAMPLES: f32 = 2.0;
// Samples of the picture within which others count.
const REACH: f32 = 2.0;
// Less weight than this in all is none.
const LEAST: f32 = 1e-3;

// How far each of two places lies from the plane of the other: the farther. Without normals, how far they are apart.
fn off_plane(by: vec3<f32>, normal: vec3<f32>, other: vec3<f32>) -> f32 {
    if all(normal == vec3(0.0)) || all(other == vec3(0.0)) {
        return length(by);
    }
    return max(abs(dot(by, normal)), abs(dot(by, other)));
}

fn upsampled(at: vec2<i32>) -> f32 {
    let place = place_at(at);
    if place.w == 0.0 {
        return 1.0;
    }
    let size = vec2<i32>(screen.size);
    let half_size = (size + 1) / 2;
    let normal = normal_at(at);
    let tolerance = TOLERANCE_SAMPLES / samples_per_metre(-place.z);
    var sum = 0.0;
    var weights = 0.0;
    var nearest = vec2(BACKGROUND_M, 1.0);
    for (var i = 0; i < 9; i++) {
        let half = at / 2 + vec2(i % 3 - 1, i / 3 - 1);
        if any(half < vec2(0)) || any(half >= half_size) {
            continue;
        }
        let other_at = chosen_of_four(half, size);
        let other = place_at(other_at);
        if other.w == 0.0 {
            continue;
        }
        let other_normal = normal_at(other_at);
        let value = textureLoad(before, half, 0).r;
        let off = off_plane(other.xyz - place.xyz, normal, other_normal);
        if off < nearest.x {
            nearest = vec2(off, value);
        }
        let near = max(1.0 - abs(vec2<f32>(other_at - at)) / REACH, vec2(0.0));
        let alike = max(dot(normal, other_normal), 0.0);
        let alike_squared = alike * alike;
        let alike_fourth = alike_squared * alike_squared;
        let weight = near.x * near.y * alike_fourth * alike_fourth * max(1.0 - off / tolerance, 0.0);
        sum += weight * value;
        weights += weight;
    }
    return select(nearest.y, sum / weights, weights > LEAST);
}

@fragment
fn place_fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let at = vec2<i32>(position.xy) + params.guard;
    // Sixteen bits do not reach the background.
    let distance = min(textureLoad(distances, at, 0).r, 60000.0);
    if params.is_half != 0u {
        return vec4(upsampled(at), distance, 0.0, 1.0);
    }
    return vec4(textureLoad(before, at, 0).r, distance, 0.0, 1.0);
}
