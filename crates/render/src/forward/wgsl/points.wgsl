// Draws points as small squares in the shade of their values, over a picture and hidden by what is nearer.

struct PointVaryings {
    @builtin(position) clip: vec4<f32>,
    @location(0) value: f32,
}

@vertex
fn point_vertex(
    @builtin(vertex_index) corner: u32,
    @location(0) position_world: vec3<f32>,
    @location(1) value: f32,
) -> PointVaryings {
    let relative = position_world - frame.eye_world;
    let ahead = dot(frame.axis_world, -relative);
    // A square lies on a slanted surface: what is nearer by no more than its own size does not hide it.
    let half_m = frame.point_half_m * select(ahead, 1.0, frame.is_parallel != 0u);
    let nearer = 3.0 * half_m + 1e-3 * abs(ahead);
    let to_viewer = select(unit_or(-relative, vec3(0.0)), frame.axis_world, frame.is_parallel != 0u);
    var clip = frame.clip_from_relative * vec4(relative + to_viewer * min(nearer, 0.5 * abs(ahead)), 1.0);
    let x = select(-1.0, 1.0, (corner & 1u) != 0u);
    let y = select(-1.0, 1.0, (corner & 2u) != 0u);
    clip = vec4(clip.xy + vec2(x, y) * frame.point_half * 2.0 * clip.w, clip.zw);
    return PointVaryings(clip, value);
}

@fragment
fn point_fragment(v: PointVaryings) -> @location(0) vec4<f32> {
    return vec4(point_color(0.15 + 0.85 * clamp(v.value, 0.0, 1.0)), 1.0);
}
