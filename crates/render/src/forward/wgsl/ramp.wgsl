// The colour ramp of `compose::views`: dark to light, nothing is nearly black, the end is yellow. Display codes.

fn point_color(t: f32) -> vec3<f32> {
    let x = clamp(t, 0.0, 1.0) * 4.0;
    let c0 = vec3(8.0, 8.0, 12.0);
    let c1 = vec3(30.0, 60.0, 130.0);
    let c2 = vec3(118.0, 116.0, 128.0);
    let c3 = vec3(196.0, 170.0, 92.0);
    let c4 = vec3(255.0, 233.0, 68.0);
    var color = mix(c0, c1, clamp(x, 0.0, 1.0));
    color = mix(color, c2, clamp(x - 1.0, 0.0, 1.0));
    color = mix(color, c3, clamp(x - 2.0, 0.0, 1.0));
    color = mix(color, c4, clamp(x - 3.0, 0.0, 1.0));
    return color / 255.0;
}
