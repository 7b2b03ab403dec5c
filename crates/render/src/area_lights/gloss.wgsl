// What a surface reflects of one cone of light whose irradiance on it is known. The twin is `area_lights::gloss`.

// Part of a ring's height that its directions lie at.
const CONE_INSET: f32 = 1.75;
// Cosine and sine of the golden section of a right angle.
const RING_TURN: vec2<f32> = vec2(0.56463489, 0.82534081);
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
    // Gloss so wide that directions run into each other.
    let a2 = r.alpha * r.alpha;
    let lobe = lobe_of(s, min(a2 + max(0.25 * depth / f32(count), 0.0), max(a2, 1.0)));
    let basis = orthonormal_basis(axis);
    var sums = vec4(0.0);
    var over = 0.0;
    var turn = vec2(1.0, 0.0);
    for (var i = 0; i < count; i++) {
        let l = in_cone(axis, basis, depth, i, count, turn);
        turn = turned(turn, i);
        sums += reflected_parts(s, lobe, l);
        over += max(dot(s.normal, l), 0.0);
    }
    over = max(over, AREA_LEAST_COSINE * f32(count));
    if !has_gloss {
        return r.diffuse * (FRAC_1_PI * sums.w / over);
    }
    let reflected = r.diffuse * (1.0 - r.f0) * (FRAC_1_PI * sums.x) + r.f0 * sums.y + vec3(sums.z);
    return reflected / over;
}

// What of gloss is the same for all directions of light.
struct Lobe {
    // Squared alpha, and that of the lobe where a direction stands for more than itself.
    a2: f32,
    wide_a2: f32,
    n_dot_v_signed: f32,
    n_dot_v: f32,
    lambda_v: f32,
}

fn lobe_of(s: AreaSurface, a2: f32) -> Lobe {
    let n_dot_v_signed = dot(s.normal, s.to_viewer);
    let n_dot_v = clamp(n_dot_v_signed, 1e-3, 1.0);
    return Lobe(a2, a2, n_dot_v_signed, n_dot_v, sqrt(n_dot_v * n_dot_v * (1.0 - a2) + a2));
}

// What reflectance is made of, for light from one direction: n·l (1 − f), D V n·l (1 − f), D V n·l f, with f Schlick's fifth power, and n·l, all above
// the triangle.
fn reflected_parts(s: AreaSurface, lobe: Lobe, l: vec3<f32>) -> vec4<f32> {
    let shading = dot(s.normal, l);
    let nl = select(0.0, max(shading, 0.0), dot(s.flat_normal, l) > 0.0);
    // h = (v + l) / |v + l|, |v + l|² = 2 + 2 v·l.
    let vl = dot(s.to_viewer, l);
    let reciprocal = 1.0 / sqrt(max(2.0 + 2.0 * vl, 1e-6));
    let vh = clamp((1.0 + vl) * reciprocal, 0.0, 1.0);
    let nh = clamp((lobe.n_dot_v_signed + shading) * reciprocal, 0.0, 1.0);
    let miss = fifth_power(1.0 - vh);
    let f = (1.0 - nh) * (1.0 + nh) + nh * nh * lobe.wide_a2;
    let safe = max(nl, 1e-3);
    let smith = safe * lobe.lambda_v + lobe.n_dot_v * sqrt(safe * safe * (1.0 - lobe.a2) + lobe.a2);
    let dv = (0.5 * FRAC_1_PI * lobe.wide_a2) * nl / (f * f * smith);
    return vec4(nl * (1.0 - miss), dv * (1.0 - miss), dv * miss, nl);
}

// The i-th of so many directions evenly in a cone, four in a ring: `turn` is where it has come to. The twin is `cap_pattern`.
fn in_cone(axis: vec3<f32>, basis: Basis, depth: f32, i: i32, count: i32, turn: vec2<f32>) -> vec3<f32> {
    return in_cone_from(axis, basis, depth, i, count, turn, CONE_INSET);
}

// With directions at another part of a ring's height.
fn in_cone_from(axis: vec3<f32>, basis: Basis, depth: f32, i: i32, count: i32, turn: vec2<f32>, inset: f32) -> vec3<f32> {
    let height = select((f32(4 * (i / 4)) + inset) / f32(count), 0.0, count == 1);
    let below = depth * height;
    let radius = sqrt(max(below * (2.0 - below), 0.0));
    return basis.tangent * (radius * turn.x) + basis.bitangent * (radius * turn.y) + axis * (1.0 - below);
}

// A right angle on, and after the last of a ring to where the next begins.
fn turned(turn: vec2<f32>, i: i32) -> vec2<f32> {
    let on = vec2(-turn.y, turn.x);
    let next = vec2(on.x * RING_TURN.x - on.y * RING_TURN.y, on.x * RING_TURN.y + on.y * RING_TURN.x);
    return select(on, next, i % 4 == 3);
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
