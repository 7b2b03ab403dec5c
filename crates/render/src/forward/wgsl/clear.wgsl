// Empties a part of a shadow map: one triangle over the viewport, at the far end (reverse z).

@vertex
fn clear_vertex(@builtin(vertex_index) i: u32) -> @builtin(position) vec4<f32> {
    return vec4(f32(i & 1u) * 4.0 - 1.0, f32(i >> 1u) * 4.0 - 1.0, 0.0, 1.0);
}
