// Views of data instead of light. Colours are display codes.

fn inspected(v: Varyings, normal: vec3<f32>, visibility: f32) -> vec3<f32> {
    switch frame.view {
        case VIEW_VISIBILITY: { return vec3(clamp(visibility, 0.0, 1.0)); }
        case VIEW_NORMAL: { return normal * 0.5 + 0.5; }
        case VIEW_TEXELS: {
            if v.atlas.z < -1.5 {
                return vec3(0.35, 0.3, 0.4);
            }
            let square = vec2<u32>(vec2<i32>(floor(v.atlas.xy)));
            let shade = select(0.75, 1.0, ((square.x + square.y) & 1u) == 0u) * (0.5 + 0.5 * clamp(visibility, 0.0, 1.0));
            return no_page(v) * select(vec3(0.0), vec3(1.0), v.atlas.z < -0.5) + chart_color(v.ids.z) * shade * select(1.0, 0.0, v.atlas.z < -0.5);
        }
        case VIEW_WEIGHTS: {
            let value = inspection(v);
            // How many of eight points, how much the heaviest weighs.
            return select(vec3(value.y, value.x * 255.0 / 8.0, 0.15), no_page(v), v.atlas.z < -0.5);
        }
        case VIEW_AGE: { return select(age_color(inspection(v).x), no_page(v), v.atlas.z < -0.5); }
        default: { return vec3(1.0, 0.0, 1.0); }
    }
}

// What surfaces without a place in the atlas show.
fn no_page(v: Varyings) -> vec3<f32> {
    return vec3(0.12);
}

fn inspection(v: Varyings) -> vec2<f32> {
    if v.atlas.z < -0.5 {
        return vec2(0.0);
    }
    let size = vec2<i32>(textureDimensions(inspection_texture));
    let texel = clamp(vec2<i32>(floor(v.atlas.xy)), vec2(0), size - 1);
    return textureLoad(inspection_texture, texel, i32(round(v.atlas.z)), 0).rg;
}

// Just changed is yellow, long ago dark blue.
fn age_color(age: f32) -> vec3<f32> {
    return mix(vec3(1.0, 0.91, 0.27), vec3(0.09, 0.13, 0.3), sqrt(clamp(age, 0.0, 1.0)));
}

// A colour of its own for each chart.
fn chart_color(chart: u32) -> vec3<f32> {
    var h = (chart + 1u) * 2654435761u;
    h = (h ^ (h >> 15u)) * 2246822519u;
    h = h ^ (h >> 13u);
    return vec3(f32(h & 255u), f32((h >> 8u) & 255u), f32((h >> 16u) & 255u)) / 255.0 * 0.75 + 0.25;
}
