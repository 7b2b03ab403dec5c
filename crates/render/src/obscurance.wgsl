// The estimator that AlchemyAO and SAO share ([McGuire2012] eq. 1, 6 and 7). The twin is `obscurance`.

struct ObscuranceParams {
    radius_m: f32,
    sigma_m: f32,
    bias_m: f32,
    beta: f32,
    exponent: f32,
    samples: u32,
    turns: u32,
    // Of SAO: the first level serves places nearer than twice 2 to this.
    switch_log2: u32,
    // Of SAO: the highest level, and where the packed distance ends.
    top_level: u32,
    farthest_m: f32,
    pad: vec2<f32>,
}

// Keeps the quotient of eq. 1 finite, square metres.
const EPSILON_M2: f32 = 1e-4;

@group(1) @binding(0) var<uniform> params: ObscuranceParams;

// Eq. 6 and 7: of the i-th place the part of the radius, and the direction on the picture.
fn spiral(i: u32, turn: f32) -> vec3<f32> {
    let part = (f32(i) + 0.5) / f32(params.samples);
    let angle = TAU * fract(part * f32(params.turns) + turn);
    return vec3(part, cos(angle), sin(angle));
}

fn obscurance_term(to_seen: vec3<f32>, normal: vec3<f32>, distance: f32) -> f32 {
    let height = dot(to_seen, normal) - params.bias_m - max(distance, 0.0) * params.beta;
    return max(height, 0.0) / (dot(to_seen, to_seen) + EPSILON_M2);
}

fn obscurance_visibility(sum: f32) -> f32 {
    let open = max(1.0 - 2.0 * params.sigma_m / f32(params.samples) * sum, 0.0);
    if params.exponent == 1.0 {
        return open;
    }
    return pow(open, params.exponent);
}
