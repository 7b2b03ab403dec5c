// The fragment stage of the forward pass: surface, look-up, light, display. The twins are `gbuffer::surface`,
// `shade` and `compose`.

// Whether alpha below the material's cutoff is a hole.
override CUTS_HOLES: bool = false;
// Whether alpha is blended.
override BLENDS: bool = false;
// Whether data is shown instead of light.
override INSPECTS: bool = false;

const SMALLEST_COSINE: f32 = 1e-3;

@fragment
fn fragment(varyings: Varyings, @builtin(front_facing) is_front: bool) -> @location(0) vec4<f32> {
    var v = varyings;
    v.atlas = select(varyings.atlas_back, varyings.atlas, is_front);
    // Derivatives and mip levels need all four pixels of a quad: before anything branches.
    let dx = dpdx(v.relative);
    let dy = dpdy(v.relative);
    let rest_dx = dpdx(v.position_rest);
    let rest_dy = dpdy(v.position_rest);
    let normal_uv = image_coordinates(material.normal_use, v.uv);
    let uv_dx = dpdx(normal_uv);
    let uv_dy = dpdy(normal_uv);
    let base_texel = textureSample(base_color_texture, base_color_sampler, image_coordinates(material.base_color_use, v.uv));
    let metal_texel = textureSample(
        metallic_roughness_texture,
        metallic_roughness_sampler,
        image_coordinates(material.metallic_roughness_use, v.uv),
    );
    let normal_texel = textureSample(normal_texture, normal_sampler, normal_uv);
    let emissive_texel = textureSample(emissive_texture, emissive_sampler, image_coordinates(material.emissive_use, v.uv));

    let base_color = material.base_color * v.color * base_texel;
    if CUTS_HOLES && base_color.a < material.cutoff {
        discard;
    }

    let to_viewer = select(unit_or(-v.relative, vec3(0.0)), frame.axis_world, frame.is_parallel != 0u);
    let facing = select(-1.0, 1.0, is_front);
    // The triangle's normal on the viewer's side.
    let across = cross(dx, dy);
    let side = select(1.0, -1.0, dot(across, to_viewer) < 0.0);
    let smooth_normal = unit_or(v.normal_world, to_viewer * facing);
    let flat_normal = unit_or(across * side, smooth_normal * facing);
    let mapped = mapped_normal(v, smooth_normal, normal_texel.xyz, dx, dy, uv_dx, uv_dy);
    let normal = on_side_of(mapped * facing, flat_normal);

    var input: LookupInput;
    input.position_world = v.relative + frame.eye_world;
    input.normal_world = flat_normal;
    input.instance = v.ids.x;
    input.atlas = v.atlas;
    input.fade = frame.fade;
    input.pixel = floor(v.clip.xy) + 0.5;
    input.distance = -dot(v.relative, frame.axis_world);
    if NEEDS_REST {
        input.position_rest = v.position_rest;
        // The world's orientation and the rest's are one, unless exactly one of the two maps mirrors.
        let bits = v.ids.y & (INSTANCE_MIRRORED | INSTANCE_REST_MIRRORED);
        let turned = select(1.0, -1.0, bits == INSTANCE_MIRRORED || bits == INSTANCE_REST_MIRRORED);
        input.normal_rest = unit_or(cross(rest_dx, rest_dy) * (side * turned), vec3(0.0));
    }
    let visibility = lookup_visibility(input);
    if INSPECTS {
        return vec4(inspected(v, normal, visibility), 1.0);
    }

    var alpha = 1.0;
    if BLENDS {
        alpha = base_color.a;
    }
    if (material.flags & MATERIAL_UNLIT) != 0u {
        return vec4(displayed(base_color.rgb), alpha);
    }
    let surface = reflectance(base_color.rgb, material.metallic * metal_texel.b, material.roughness * metal_texel.g);
    var radiance = material.emissive * emissive_texel.rgb;
    radiance += ambient_reflected(surface, normal, to_viewer) * visibility;
    for (var first = 0u; first < frame.light_count; first += 32u) {
        // Which lights arrive is found before any is reflected: then neighbours that are lit by different lights do the
        // costly part side by side, and as often as one of them has lights, not as often as all of them have together.
        var arriving_lights = 0u;
        let end = min(frame.light_count - first, 32u);
        for (var i = 0u; i < end; i++) {
            let arrived = arriving(lights.lights[first + i], input.position_world);
            // Light from behind the true surface cannot reach it, whatever the interpolated normal says.
            let is_lit = dot(normal, arrived.to_light) > 0.0 && dot(flat_normal, arrived.to_light) > 0.0;
            arriving_lights |= select(0u, 1u << i, is_lit && any(arrived.intensity != vec3(0.0)));
        }
        while arriving_lights != 0u {
            let lowest = arriving_lights & (~arriving_lights + 1u);
            arriving_lights ^= lowest;
            // The exponent of a power of two is its bit's number; GLSL of WebGL2 has no other way to it.
            let light = lights.lights[first + (bitcast<u32>(f32(lowest)) >> 23u) - 127u];
            let arrived = arriving(light, input.position_world);
            let lit = lit_fraction(light, input.position_world, flat_normal, arrived.to_light);
            if lit > 0.0 {
                let cosine = dot(normal, arrived.to_light);
                radiance += reflected(surface, normal, to_viewer, arrived.to_light) * arrived.intensity * (cosine * lit);
            }
        }
    }
    if AREA_LIGHTS {
        var texel = v.light_texels.zw;
        if is_front {
            texel = v.light_texels.xy;
        }
        let area = AreaSurface(input.position_world, normal, flat_normal, to_viewer);
        radiance += area_reflected(surface, area, v.atlas, texel);
    }
    return vec4(displayed(radiance), alpha);
}

fn displayed(radiance: vec3<f32>) -> vec3<f32> {
    return srgb_from_linear(tone_mapped(radiance)) * frame.dim;
}

// `n` moved to the side of the unit normal `side` by the shortest way.
fn on_side_of(n: vec3<f32>, side: vec3<f32>) -> vec3<f32> {
    let cosine = dot(n, side);
    if cosine >= SMALLEST_COSINE {
        return n;
    }
    return unit_or(n + side * (SMALLEST_COSINE - cosine), side);
}

// The normal map's normal about the interpolated `normal` (front side), if there is a map and a tangent.
fn mapped_normal(
    v: Varyings,
    normal: vec3<f32>,
    texel: vec3<f32>,
    dx: vec3<f32>,
    dy: vec3<f32>,
    uv_dx: vec2<f32>,
    uv_dy: vec2<f32>,
) -> vec3<f32> {
    if (material.flags & MATERIAL_NORMAL_MAP) == 0u {
        return normal;
    }
    var along: vec3<f32>;
    var up: vec3<f32>;
    if (v.ids.y & INSTANCE_STORED_TANGENTS) != 0u {
        let mirror = select(1.0, -1.0, (v.ids.y & INSTANCE_MIRRORED) != 0u);
        along = v.tangent_world.xyz;
        up = cross(normal, along) * (select(1.0, -1.0, v.tangent_world.w < 0.0) * mirror);
    } else {
        // Directions in which u grows and v falls.
        let sign = select(1.0, -1.0, uv_dx.x * uv_dy.y - uv_dx.y * uv_dy.x < 0.0);
        along = unit_or((dx * uv_dy.y - dy * uv_dx.y) * sign, vec3(0.0));
        up = -unit_or((dy * uv_dx.x - dx * uv_dy.x) * sign, vec3(0.0));
        if all(along == vec3(0.0)) || all(up == vec3(0.0)) {
            return normal;
        }
    }
    let tangent = unit_or(along - normal * dot(normal, along), vec3(0.0));
    if all(tangent == vec3(0.0)) {
        return normal;
    }
    var bitangent = cross(normal, tangent);
    if dot(bitangent, up) < 0.0 {
        bitangent = -bitangent;
    }
    let n = texel * 2.0 - 1.0;
    return unit_or(tangent * (n.x * material.normal_scale) + bitangent * (n.y * material.normal_scale) + normal * n.z, normal);
}
