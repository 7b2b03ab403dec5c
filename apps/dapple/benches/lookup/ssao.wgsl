// The yardstick: screen-space ambient occlusion of 16 taps with a bilateral blur of two passes of 9 taps.

@group(1) @binding(0) var ssao_depth: texture_2d<f32>;
@group(1) @binding(1) var ssao_normal: texture_2d<f32>;
@group(1) @binding(2) var ssao_occlusion: texture_2d<f32>;

const BLUR_WEIGHTS = vec4f(0.8825, 0.6065, 0.3247, 0.1353);

fn ssao_inside(pixel: vec2i) -> vec2i {
    return clamp(pixel, vec2i(0), vec2i(SIZE) - 1);
}

// 1 if the tap at an offset in the frame of the surface is behind what is seen there.
fn ssao_tap(offset: vec3f, frame: mat3x3f, position: vec3f) -> f32 {
    let tap = position + frame * offset * RADIUS_M;
    let ndc = tap.xy * FOCAL / -tap.z;
    let pixel = ssao_inside(vec2i((ndc * vec2f(0.5, -0.5) + 0.5) * SIZE));
    let depth = textureLoad(ssao_depth, pixel, 0).x;
    let fade = smoothstep(0.0, 1.0, RADIUS_M / max(abs(-position.z - depth), 1e-4));
    return select(0.0, fade, depth < -tap.z - 0.01);
}

@fragment fn ssao(@builtin(position) at: vec4f) -> @location(0) vec4f {
    let pixel = vec2i(at.xy);
    let depth = textureLoad(ssao_depth, pixel, 0).x;
    if depth <= 0.0 {
        return vec4f(1.0);
    }
    let normal = normalize(textureLoad(ssao_normal, pixel, 0).xyz * 2.0 - 1.0);
    let ndc = (at.xy / SIZE * 2.0 - 1.0) * vec2f(1.0, -1.0);
    let position = vec3f(ndc / FOCAL * depth, -depth);
    // Interleaved gradient noise turns the taps from pixel to pixel.
    let angle = 6.2831853 * fract(52.9829189 * fract(dot(at.xy, vec2f(0.06711056, 0.00583715))));
    let spun = vec3f(cos(angle), sin(angle), 0.0);
    let tangent = normalize(spun - normal * dot(spun, normal));
    let frame = mat3x3f(tangent, cross(normal, tangent), normal);
    var blocked = 0.0;
    TAPS
    return vec4f(1.0 - blocked / 16.0);
}

fn ssao_blur(at: vec4f, step: vec2i) -> vec4f {
    let pixel = vec2i(at.xy);
    let depth = textureLoad(ssao_depth, pixel, 0).x;
    var sum = textureLoad(ssao_occlusion, pixel, 0).x;
    var weights = 1.0;
    for (var i = 0; i < 4; i++) {
        for (var side = -1; side <= 1; side += 2) {
            let other = ssao_inside(pixel + step * (i + 1) * side);
            let difference = textureLoad(ssao_depth, other, 0).x - depth;
            let weight = BLUR_WEIGHTS[i] * exp(-difference * difference * 100.0);
            sum += weight * textureLoad(ssao_occlusion, other, 0).x;
            weights += weight;
        }
    }
    return vec4f(sum / weights);
}

@fragment fn blur_x(@builtin(position) at: vec4f) -> @location(0) vec4f {
    return ssao_blur(at, vec2i(1, 0));
}

@fragment fn blur_y(@builtin(position) at: vec4f) -> @location(0) vec4f {
    return ssao_blur(at, vec2i(0, 1));
}
