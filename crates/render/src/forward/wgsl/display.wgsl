// Radiance to what a display shows: exposure, tone curve, sRGB. The twin is `image::ToneMap`.

const CURVE_CLAMP: u32 = 0u;
const CURVE_REINHARD: u32 = 1u;
const CURVE_FILMIC: u32 = 2u;

fn tone_mapped(radiance: vec3<f32>) -> vec3<f32> {
    let x = clamp(radiance * frame.exposure, vec3(0.0), vec3(1e6));
    switch frame.tone_curve {
        case CURVE_CLAMP: { return min(x, vec3(1.0)); }
        case CURVE_REINHARD: { return x / (1.0 + x); }
        // [Narkowicz2015]
        default: { return min((x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14), vec3(1.0)); }
    }
}

// IEC 61966-2-1.
fn srgb_from_linear(linear: vec3<f32>) -> vec3<f32> {
    let curved = 1.055 * pow(max(linear, vec3(1e-8)), vec3(1.0 / 2.4)) - 0.055;
    return select(curved, linear * 12.92, linear <= vec3(0.0031308));
}
