// What screen-space methods begin with: of each pixel the triangle's normal, and its depth. The twin is `gbuffer::screen`.

// Whether alpha below the material's cutoff is a hole.
override CUTS_HOLES: bool = false;

@fragment
fn fragment(v: Varyings, @builtin(front_facing) is_front: bool) -> @location(0) vec4<f32> {
    // Derivatives and mip levels need all four pixels of a quad: before anything branches.
    let dx = dpdx(v.relative);
    let dy = dpdy(v.relative);
    let base_texel = textureSample(base_color_texture, base_color_sampler, image_coordinates(material.base_color_use, v.uv));
    if CUTS_HOLES && material.base_color.a * v.color.a * base_texel.a < material.cutoff {
        discard;
    }
    let to_viewer = select(unit_or(-v.relative, vec3(0.0)), frame.axis_world, frame.is_parallel != 0u);
    let facing = select(-1.0, 1.0, is_front);
    let across = cross(dx, dy);
    let side = select(1.0, -1.0, dot(across, to_viewer) < 0.0);
    let normal = unit_or(across * side, unit_or(v.normal_world, to_viewer * facing) * facing);
    return vec4(normal * 0.5 + 0.5, 1.0);
}

// Where depths are all that is wanted.
@fragment
fn depth_fragment(v: Varyings) {
    let base_texel = textureSample(base_color_texture, base_color_sampler, image_coordinates(material.base_color_use, v.uv));
    if CUTS_HOLES && material.base_color.a * v.color.a * base_texel.a < material.cutoff {
        discard;
    }
}
