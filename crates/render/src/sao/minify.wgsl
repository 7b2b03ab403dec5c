// One level of the pyramid of distances from the one below ([McGuire2012] Table 1). The twin is `sao::pyramid`.

struct MinifyParams {
    // Columns and rows of the level below.
    size: vec2<u32>,
    // 0 rotated grid, 1 mean, 2 harmonic mean, 3 farthest, 4 nearest.
    filtering: u32,
    pad: u32,
}

@group(1) @binding(0) var<uniform> params: MinifyParams;

fn below(at: vec2<u32>) -> f32 {
    return textureLoad(before, vec2<i32>(min(at, params.size - 1u)), 0).r;
}

@fragment
fn minify_fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let at = vec2<u32>(position.xy);
    if params.filtering == 0u {
        return vec4(below(at * 2u + ((at.yx & vec2(1u)) ^ vec2(1u))));
    }
    let a = below(at * 2u);
    let b = below(at * 2u + vec2(1u, 0u));
    let c = below(at * 2u + vec2(0u, 1u));
    let d = below(at * 2u + vec2(1u, 1u));
    switch params.filtering {
        case 1u: { return vec4(select(0.25 * (a + b + c + d), BACKGROUND_M, is_background(max(max(a, b), max(c, d))))); }
        case 2u: { return vec4(harmonic(vec4(a, b, c, d))); }
        case 3u: { return vec4(max(max(a, b), max(c, d))); }
        default: { return vec4(min(min(a, b), min(c, d))); }
    }
}

// The background adds nothing to the sum of inverses.
fn harmonic(distances_m: vec4<f32>) -> f32 {
    let sum = dot(select(1.0 / distances_m, vec4(0.0), distances_m > vec4(0.5 * BACKGROUND_M)), vec4(1.0));
    return select(4.0 / sum, BACKGROUND_M, sum == 0.0);
}
