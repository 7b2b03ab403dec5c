// Light of area lights, dimmed by how much of each is seen, as a surface reflects it. The twins are `area_lights` and its `gloss`.

@group(2) @binding(6) var area_atlas: texture_2d_array<f32>;
@group(2) @binding(7) var area_table: texture_2d<f32>;

// A golden turn.
const AREA_TURN: vec2<f32> = vec2(-0.73736888, 0.67549029);
// Mean cosine below which a cone is not taken at its word.
const AREA_LEAST_COSINE: f32 = 0.01;

// A surface as it is lit.
struct AreaSurface {
    position: vec3<f32>,
    // Shading normal, and the triangle's on the viewer's side.
    normal: vec3<f32>,
    flat_normal: vec3<f32>,
    to_viewer: vec3<f32>,
}

fn area_reflected(r: Reflectance, s: AreaSurface, atlas: vec3<f32>, texel: vec2<u32>) -> vec3<f32> {
    let count = i32(frame.area_lights & 0xffffu);
    let layers = i32(frame.area_lights >> 16u);
    var sum = vec3(0.0);
    var fractions = vec4(1.0);
    for (var slot = 0; slot < count; slot++) {
        let place_in_group = slot % 4;
        // Four lights share a texel.
        if place_in_group == 0 {
            fractions = area_fractions(atlas, texel, (slot / 4) * layers);
        } else {
            fractions = vec4(fractions.yzw, 1.0);
        }
        if fractions.x <= 0.0 {
            continue;
        }
        let arrived = area_arrival(slot, s.position, s.normal);
        if all(arrived.irradiance <= vec3(0.0)) {
            continue;
        }
        sum += arrived.irradiance * area_gloss(r, s, arrived.direction, arrived.cos_angle) * fractions.x;
    }
    return sum;
}

// How much is seen of four lights, from the layers after `first`.
fn area_fractions(atlas: vec3<f32>, texel: vec2<u32>, first: i32) -> vec4<f32> {
    if (frame.area_lights >> 16u) == 0u {
        return vec4(1.0);
    }
    if atlas.z > -0.5 {
        let side = vec2<f32>(textureDimensions(area_atlas));
        return textureSampleLevel(area_atlas, atlas_sampler, atlas.xy / side, first + i32(round(atlas.z)), 0.0);
    }
    if atlas.z < -1.5 && texel.y != NO_TEXEL {
        let place = vec2<i32>(vec2(texel.x & 0xffffu, texel.x >> 16u));
        return textureLoad(area_atlas, place, first + i32(texel.y), 0);
    }
    return vec4(1.0);
}

// Reflected radiance of a cone that gives irradiance 1 on the surface.
fn area_gloss(r: Reflectance, s: AreaSurface, axis: vec3<f32>, cos_angle: f32) -> vec3<f32> {
    let depth = 1.0 - cos_angle;
    let need = sqrt(max(2.0 * depth, 0.0)) / (0.04 + 0.6 * r.alpha);
    var count = 16;
    if need < 0.25 {
        count = 1;
    } else if need < 0.6 {
        count = 4;
    } else if need < 1.2 {
        count = 8;
    }
    let n = f32(count);
    // Gloss so wide that directions run into each other.
    let a2_own = r.alpha * r.alpha;
    let a2 = min(a2_own + max(0.5 * depth / n, 0.0), max(a2_own, 1.0));
    // A frame about the axis.
    let sign = select(1.0, -1.0, axis.z < 0.0);
    let a = -1.0 / (sign + axis.z);
    let b = axis.x * axis.y * a;
    let tangent = vec3(1.0 + sign * axis.x * axis.x * a, sign * b, -sign * axis.x);
    let bitangent = vec3(b, sign + axis.y * axis.y * a, -axis.y);
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
        let l = tangent * (radius * turn.x) + bitangent * (radius * turn.y) + axis * (1.0 - below);
        turn = vec2(turn.x * AREA_TURN.x - turn.y * AREA_TURN.y, turn.x * AREA_TURN.y + turn.y * AREA_TURN.x);
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
    if frame.specular == 0u {
        return r.diffuse * (FRAC_1_PI * sums.w / over);
    }
    let reflected = r.diffuse * (1.0 - r.f0) * (FRAC_1_PI * sums.x) + r.f0 * sums.y + vec3(sums.z);
    return reflected / over;
}
