// Light of area lights, dimmed by how much of each is seen, as a surface reflects it. The twins are `area_lights` and its `gloss`.

@group(2) @binding(6) var area_atlas: texture_2d_array<f32>;
@group(2) @binding(7) var area_table: texture_2d<f32>;

// A golden turn.
const AREA_TURN: vec2<f32> = vec2(-0.73736888, 0.67549029);
// In `frame.area_lights`: leans lie in two more planes of each group.
const AREA_LEANS: u32 = 0x100u;
// Alpha from which on they are not seen, and lean, in angular radii, below which there is none.
const AREA_ROUGH_ALPHA: f32 = 0.36;
const AREA_LEAST_LEAN: f32 = 0.015625;
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
    let count = i32(frame.area_lights & 0xffu);
    let layers = i32(frame.area_lights >> 16u);
    let has_leans = (frame.area_lights & AREA_LEANS) != 0u;
    let group_layers = select(layers, 3 * layers, has_leans);
    let shows_leans = has_leans && r.alpha < AREA_ROUGH_ALPHA;
    var sum = vec3(0.0);
    var fractions = vec4(1.0);
    var leans = array<vec4<f32>, 2>(vec4(0.0), vec4(0.0));
    for (var slot = 0; slot < count; slot++) {
        let place_in_group = slot % 4;
        // Four lights share a texel.
        if place_in_group == 0 {
            let first = (slot / 4) * group_layers;
            fractions = area_atlas_texel(atlas, texel, first, vec4(1.0));
            if shows_leans && any(fractions > vec4(0.0)) {
                let middle = vec4(128.0 / 255.0);
                leans[0] = (area_atlas_texel(atlas, texel, first + layers, middle) - middle) * (255.0 / 127.0);
                leans[1] = (area_atlas_texel(atlas, texel, first + 2 * layers, middle) - middle) * (255.0 / 127.0);
            }
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
        let pair = leans[place_in_group / 2];
        let lean = select(pair.xy, pair.zw, place_in_group % 2 == 1);
        let cone = area_seen(s, vec4(arrived.direction, arrived.cos_angle), fractions.x, lean);
        sum += arrived.irradiance * area_gloss(r, s, cone.xyz, cone.w) * fractions.x;
    }
    return sum;
}

// Four bytes from the layers after `first`: how much is seen of four lights, or where on two of them.
fn area_atlas_texel(atlas: vec3<f32>, texel: vec2<u32>, first: i32, otherwise: vec4<f32>) -> vec4<f32> {
    if (frame.area_lights >> 16u) == 0u {
        return otherwise;
    }
    if atlas.z > -0.5 {
        let side = vec2<f32>(textureDimensions(area_atlas));
        return textureSampleLevel(area_atlas, atlas_sampler, atlas.xy / side, first + i32(round(atlas.z)), 0.0);
    }
    if atlas.z < -1.5 && texel.y != NO_TEXEL {
        let place = vec2<i32>(vec2(texel.x & 0xffffu, texel.x >> 16u));
        return textureLoad(area_atlas, place, first + i32(texel.y), 0);
    }
    return otherwise;
}

// The cone, axis and cosine, of what is seen of a light: it leans to where that lies.
fn area_seen(s: AreaSurface, cone: vec4<f32>, fraction: f32, lean: vec2<f32>) -> vec4<f32> {
    let far = min(length(lean), 1.0);
    let depth = 1.0 - cone.w;
    // Beyond a hemisphere there is no side.
    if far < AREA_LEAST_LEAN || depth >= 1.0 {
        return cone;
    }
    let axis = cone.xyz;
    let sine = sqrt(max(depth * (2.0 - depth), 0.0));
    // As `lean_frame`.
    let k = 1.0 / max(1.0 + axis.y, 1e-4);
    let across = vec3(1.0 - axis.x * axis.x * k, -axis.x, -axis.x * axis.z * k);
    let along = vec3(-axis.x * axis.z * k, -axis.z, 1.0 - axis.z * axis.z * k);
    let leaning = axis + (across * lean.x + along * lean.y) * sine;
    let lacks = max(0.5 * dot(s.normal, axis) - dot(s.normal, leaning), 0.0);
    let direction = leaning + s.normal * lacks;
    let size = length(direction);
    if !(size > 0.0) {
        return cone;
    }
    let part = max(fraction, (1.0 - far) * (1.0 - far));
    return vec4(direction / size, 1.0 - depth * part);
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
