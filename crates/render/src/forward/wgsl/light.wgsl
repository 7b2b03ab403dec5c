// Punctual lights ([KHR_lights_punctual]) and the fraction of them that shadow maps let through.
// The twins are `shade::light` and `shade::shadow`, whose constants these are.

const NORMAL_OFFSET_TEXELS: vec2<f32> = vec2(0.05, 0.75);
const SLACK: vec2<f32> = vec2(0.02, 1e-5);
const STEEPEST_TEXELS: f32 = 16.0;
// Rounding of a depth, up to 1: interpolation in floats, and −1 … 1 on WebGL2.
const DEPTH_ROUNDING: f32 = 1.2e-7;

struct Arriving {
    // Unit.
    to_light: vec3<f32>,
    // Irradiance on a surface that faces the light.
    intensity: vec3<f32>,
}

fn arriving(light: Light, position_world: vec3<f32>) -> Arriving {
    if light.is_directional != 0u {
        return Arriving(-light.direction_world, light.intensity);
    }
    let offset = light.position_world - position_world;
    let distance_squared = dot(offset, offset);
    if distance_squared == 0.0 {
        return Arriving(vec3(0.0), vec3(0.0));
    }
    let to_light = offset * inverseSqrt(distance_squared);
    let ratio = distance_squared * light.inverse_range_squared;
    let window = clamp(1.0 - ratio * ratio, 0.0, 1.0);
    let fade = clamp(dot(light.direction_world, -to_light) * light.cone.x + light.cone.y, 0.0, 1.0);
    return Arriving(to_light, light.intensity * (window * fade * fade / distance_squared));
}

// Fraction of a light that reaches a surface; `normal_world` is the triangle's, on the light's side.
fn lit_fraction(light: Light, position_world: vec3<f32>, normal_world: vec3<f32>, to_light: vec3<f32>) -> f32 {
    if light.face_count == 0u {
        return 1.0;
    }
    var index = light.first_face;
    if light.face_count == 6u {
        let d = -to_light;
        let a = abs(d);
        if a.x >= a.y && a.x >= a.z {
            index += select(0u, 1u, d.x < 0.0);
        } else if a.y >= a.z {
            index += select(2u, 3u, d.y < 0.0);
        } else {
            index += select(4u, 5u, d.z < 0.0);
        }
    }
    return face_lit_fraction(index, position_world, normal_world, to_light);
}

fn face_lit_fraction(index: u32, position_world: vec3<f32>, normal_world: vec3<f32>, to_light: vec3<f32>) -> f32 {
    let view_from_world = lights.faces[index].view_from_world;
    let extent = lights.faces[index].extent;
    let resolution = lights.faces[index].resolution;
    let origin = lights.faces[index].origin;
    let layer = i32(lights.faces[index].layer);
    let near = lights.faces[index].near;
    let far = lights.faces[index].far;
    let is_perspective = lights.faces[index].is_perspective != 0u;

    let distance_before = -dot(view_from_world[2], vec4(position_world, 1.0));
    let scale_before = select(1.0, max(distance_before, 0.0), is_perspective);
    let texel = 2.0 * max(extent.x, extent.y) * scale_before / resolution;
    let cosine = clamp(dot(normal_world, to_light), 0.0, 1.0);
    let sine = sqrt(1.0 - cosine * cosine);
    let moved = vec4(position_world + normal_world * (texel * (NORMAL_OFFSET_TEXELS.x + NORMAL_OFFSET_TEXELS.y * sine)), 1.0);
    // Rows times a vector.
    let position = moved * view_from_world;
    let normal = vec4(normal_world, 0.0) * view_from_world;
    let distance = -position.z;
    if is_perspective && distance <= 0.0 {
        return 1.0;
    }
    let scale = select(1.0, distance, is_perspective);
    let at = floor((0.5 + vec2(0.5, -0.5) * position.xy / (extent * scale)) * resolution);
    var slack = SLACK.x * texel + SLACK.y * abs(distance);
    if is_perspective {
        slack += DEPTH_ROUNDING * distance * distance / near;
    }
    let steepest = STEEPEST_TEXELS * texel;
    let layer_side = vec2<f32>(textureDimensions(shadow_maps));
    var lit = 0.0;
    for (var dy = -1.0; dy < 1.5; dy += 1.0) {
        for (var dx = -1.0; dx < 1.5; dx += 1.0) {
            let tap = at + vec2(dx, dy);
            if any(tap < vec2(0.0)) || any(tap >= vec2(resolution)) {
                lit += 1.0;
                continue;
            }
            let ray = vec2(2.0, -2.0) * ((tap + 0.5) / resolution - 0.5) * extent;
            // Distance of the receiver's plane along the tap's ray; a plane that is seen edge-on has none.
            var below = normal.z;
            if is_perspective {
                below = dot(normal, vec3(ray, -1.0));
            }
            var plane = distance;
            if below != 0.0 {
                let there = select(
                    distance + dot(normal.xy, ray - position.xy) / below,
                    dot(normal, position) / below,
                    is_perspective,
                );
                plane = clamp(there, distance - steepest, distance + steepest);
            }
            plane -= slack;
            // Reverse z: the greater is nearer to the light.
            let depth = select((far - plane) / (far - near), near / max(plane, 1e-9), is_perspective);
            lit += textureSampleCompareLevel(shadow_maps, shadow_sampler, (origin + tap + 0.5) / layer_side, layer, depth);
        }
    }
    return lit / 9.0;
}
