// One direction of the blur that keeps to surfaces. The twin is `bilateral`.

struct BilateralParams {
    // One sample to the right or down.
    axis: vec2<i32>,
    // On either side.
    taps: u32,
    // Samples between two taps.
    stride: u32,
    tolerance_m: f32,
    // Of a tap of the bell, in taps.
    inverse_sigma: f32,
    pad: vec2<f32>,
}

@group(1) @binding(0) var<uniform> params: BilateralParams;

// A slope is gentler than another if it is less than this part of it.
const MUCH_GENTLER: f32 = 0.9;

@fragment
fn bilateral_fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let at = vec2<i32>(position.xy);
    let value = textureLoad(before, at, 0).r;
    let distance = textureLoad(distances, at, 0).r;
    if is_background(distance) || params.taps == 0u {
        return vec4(value);
    }
    // The gentler of the slopes to both sides: the other may lead over an edge. Of two that are about alike the first, so that rounding decides nothing.
    var slope = 0.0;
    var gentlest = BACKGROUND_M;
    for (var side = -1; side <= 1; side += 2) {
        let next = at + params.axis * side;
        if is_inside(next) {
            let found = textureLoad(distances, next, 0).r;
            let steep = (found - distance) * f32(side);
            if !is_background(found) && abs(steep) < gentlest {
                slope = steep;
                gentlest = MUCH_GENTLER * abs(steep);
            }
        }
    }
    var sum = value;
    var weights = 1.0;
    for (var tap = 1u; tap <= params.taps; tap++) {
        let x = f32(tap) * params.inverse_sigma;
        let bell = exp(-0.5 * x * x);
        for (var side = -1; side <= 1; side += 2) {
            let by = i32(tap * params.stride) * side;
            let other = at + params.axis * by;
            if !is_inside(other) {
                continue;
            }
            let found = textureLoad(distances, other, 0).r;
            if is_background(found) {
                continue;
            }
            let off = min(abs(found - distance - slope * f32(by)), abs(found - distance));
            let weight = bell * max(1.0 - off / params.tolerance_m, 0.0);
            sum += weight * textureLoad(before, other, 0).r;
            weights += weight;
        }
    }
    return vec4(sum / weights);
}
