// What a surface reflects of one cone of light whose irradiance on it is known. The twin is `area_lights::gloss`.

// A golden turn.
const GOLDEN_TURN: vec2<f32> = vec2(-0.73736888, 0.67549029);
// Alpha from which on it is not seen which part of a light is hidden.
const AREA_ROUGH_ALPHA: f32 = 0.36;
// Mean cosine below which a cone is not taken at its word.
const AREA_LEAST_COSINE: f32 = 0.01;

// A material's reflectance at one place.
struct Reflectance {
    diffuse: vec3<f32>,
    f0: vec3<f32>,
    // Squared perceptual roughness.
    alpha: f32,
}

// A surface as it is lit.
struct AreaSurface {
    position: vec3<f32>,
    // Shading normal, and the triangle's on the viewer's side.
    normal: vec3<f32>,
    flat_normal: vec3<f32>,
    to_viewer: vec3<f32>,
}

// Reflected radiance of a cone that gives irradiance 1 on the surface.
fn area_gloss(r: Reflectance, s: AreaSurface, axis: vec3<f32>, cos_angle: f32, has_gloss: bool) -> vec3<f32> {
    let depth = 1.0 - cos_angle;
    let count = needed_directions(depth, r.alpha);
    let n = f32(count);
    // Gloss so wide that directions run into each other.
    let a2_own = r.alpha * r.alpha;
    let a2 = min(a2_own + max(0.5 * depth / n, 0.0), max(a2_own, 1.0));
    let basis = orthonormal_basis(axis);
    let n_dot_v_signed = dot(s.normal, s.to_viewer);
    let nv = clamp(n_dot_v_signed, 1e-3, 1.0);
    let lambda_v = sqrt(nv * nv * (1.0 - a2) + a2);
    // Sums of n·l (1 − f), D V n·l (1 − f), D V n·l f, with f Schlick's fifth power; of n·l above the triangle, and of n·l.
    var sums = vec4(0.0);
    var over = 0.0;
    var turn = vec2(1.0, 0.0);
    for (var i = 0; i < count; i++) {
        let height = select((f32(i) + 0.5) / n, 0.0, count == 1);
        let below = depth * height;
        let radius = sqrt(max(below * (2.0 - below), 0.0));
        let l = basis.tangent * (radius * turn.x) + basis.bitangent * (radius * turn.y) + axis * (1.0 - below);
        turn = vec2(turn.x * GOLDEN_TURN.x - turn.y * GOLDEN_TURN.y, turn.x * GOLDEN_TURN.y + turn.y * GOLDEN_TURN.x);
        let shading = dot(s.normal, l);
        let nl = select(0.0, max(shading, 0.0), dot(s.flat_normal, l) > 0.0);
        let vl = dot(s.to_viewer, l);
        let reciprocal = 1.0 / sqrt(max(2.0 + 2.0 * vl, 1e-6));
        let vh = clamp((1.0 + vl) * reciprocal, 0.0, 1.0);
        let nh = clamp((n_dot_v_signed + shading) * reciprocal, 0.0, 1.0);
        let miss = fifth_power(1.0 - vh);
        let f = (1.0 - nh) * (1.0 + nh) + nh * nh * a2;
        let d = a2 * FRAC_1_PI / (f * f);
        let safe = max(nl, 1e-3);
        let v = 0.5 / (safe * lambda_v + nv * sqrt(safe * safe * (1.0 - a2) + a2));
        let dv = d * v * nl;
        sums += vec4(nl * (1.0 - miss), dv * (1.0 - miss), dv * miss, nl);
        over += max(shading, 0.0);
    }
    over = max(over, AREA_LEAST_COSINE * n);
    if !has_gloss {
        return r.diffuse * (FRAC_1_PI * sums.w / over);
    }
    let reflected = r.diffuse * (1.0 - r.f0) * (FRAC_1_PI * sums.x) + r.f0 * sums.y + vec3(sums.z);
    return reflected / over;
}

// Directions that stand for a cone of that 1 − cos a on a surface of that alpha.
fn needed_directions(depth: f32, alpha: f32) -> i32 {
    // By the chord of the angle, about the angle itself.
    let need = sqrt(max(2.0 * depth, 0.0)) / (0.04 + 0.6 * alpha);
    if need < 0.25 {
        return 1;
    }
    if need < 0.6 {
        return 4;
    }
    return select(16, 8, need < 1.2);
}
