// Light of area lights, dimmed by how much of each is seen, as a surface reflects it. The twin is `area_lights`.

@group(2) @binding(6) var area_atlas: texture_2d_array<f32>;
@group(2) @binding(7) var area_table: texture_2d<f32>;

// In `frame.area_lights`: leans lie in two more planes of each group.
const AREA_LEANS: u32 = 0x100u;
// Lean, in angular radii, below which there is none.
const AREA_LEAST_LEAN: f32 = 0.015625;

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
        sum += arrived.irradiance * area_gloss(r, s, cone.xyz, cone.w, frame.specular != 0u) * fractions.x;
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
