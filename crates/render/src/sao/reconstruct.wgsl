// One direction of SAO's reconstruction ([McGuire2012] sec. 2.4): values and distances come from one texture. The twin is `sao::bilateral`.

struct ReconstructParams {
    // One sample to the right or down.
    axis: vec2<i32>,
    // On either side.
    taps: u32,
    // Samples between two taps.
    stride: u32,
    sharpness: f32,
    pad_a: f32,
    pad_b: vec2<f32>,
}

@group(1) @binding(0) var<uniform> params: ReconstructParams;

// Standard deviation of the taps' bell, in taps.
const SIGMA_TAPS: f32 = 2.0;

// Visibility, and the distance as a part of the farthest.
fn unpacked(texel: vec4<f32>) -> vec2<f32> {
    return vec2(texel.r, (texel.g * 255.0 + texel.b) / 256.0);
}

@fragment
fn reconstruct_fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let at = vec2<i32>(position.xy);
    let texel = textureLoad(before, at, 0);
    let own = unpacked(texel);
    var sum = own.x;
    var weights = 1.0;
    for (var tap = 1u; tap <= params.taps; tap++) {
        let x = f32(tap) / SIGMA_TAPS;
        let bell = exp(-0.5 * x * x);
        for (var side = -1; side <= 1; side += 2) {
            let other = at + params.axis * (i32(tap * params.stride) * side);
            if is_inside(other) {
                let found = unpacked(textureLoad(before, other, 0));
                let weight = bell * max(1.0 - params.sharpness * abs(found.y - own.y), 0.0);
                sum += weight * found.x;
                weights += weight;
            }
        }
    }
    var value = sum / weights;
    // The last of the two leaves what there is nothing open.
    if params.axis.y != 0 && is_background(textureLoad(distances, at, 0).r) {
        value = 1.0;
    }
    return vec4(value, texel.gba);
}
