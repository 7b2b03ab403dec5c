// What the first camera's samples are to the second one, whose picture `screen` and `distances` are of. The twin is `sdao::multi_view`.

// All in one uniform: with one more of this group Mesa 22's software adapter crashes.
struct SideParams {
    // The first camera's picture, as its own passes see it.
    main: Screen,
    // Rows of the map from the first camera's view space to the second one's.
    side_from_main_x: vec4<f32>,
    side_from_main_y: vec4<f32>,
    side_from_main_z: vec4<f32>,
}

@group(1) @binding(5) var<uniform> side: SideParams;
@group(1) @binding(6) var main_distances: texture_2d<f32>;
@group(1) @binding(7) var main_normals: texture_2d<f32>;

struct Beside {
    // In the second camera's view space, and the point of its picture.
    place: vec3<f32>,
    normal: vec3<f32>,
    point: vec2<f32>,
    // Whether there is a surface with a normal, on the second picture, too.
    is_seen: bool,
}

fn beside(at: vec2<i32>) -> Beside {
    let distance = textureLoad(main_distances, at, 0).r;
    let part = centre_of(at, side.main.span, side.main.is_half) / side.main.span;
    let place_main = vec4(place_in(part, distance, side.main.half_extent, side.main.is_parallel), 1.0);
    var place = vec3(dot(side.side_from_main_x, place_main), dot(side.side_from_main_y, place_main), 0.0);
    place.z = dot(side.side_from_main_z, place_main);
    let normal = normal_view(textureLoad(main_normals, at, 0));
    let point = point_of(place);
    let is_seen = !is_background(distance) && any(normal != vec3(0.0)) && is_inside(sample_in(point));
    return Beside(place, normal, point, is_seen);
}
