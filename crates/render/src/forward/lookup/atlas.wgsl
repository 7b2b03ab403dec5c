// Visibility from the atlas: one bilinear fetch of the old and the new value, and a mix of the two.

fn lookup_visibility(s: LookupInput) -> f32 {
    var values = vec2(1.0);
    if s.atlas.z > -0.5 {
        let side = vec2<f32>(textureDimensions(atlas_texture));
        values = textureSampleLevel(atlas_texture, atlas_sampler, s.atlas.xy / side, i32(round(s.atlas.z)), 0.0).rg;
    } else if s.atlas.z < -1.5 {
        values = s.atlas.xy;
    }
    return mix(values.x, values.y, s.fade);
}
