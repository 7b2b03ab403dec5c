// What every pass of a screen-space method sees: distances and normals of a picture, and the lens. The twin is `gbuffer::screen`.

struct Screen {
    // Rows of the rotation from the world to view space; w is not used.
    view_from_world_x: vec4<f32>,
    view_from_world_y: vec4<f32>,
    view_from_world_z: vec4<f32>,
    // Half the picture's width and height: at distance 1 for a perspective, anywhere for a parallel camera.
    half_extent: vec2<f32>,
    // Columns and rows.
    size: vec2<u32>,
    // The picture's width and height in samples: less than columns and rows where the last ones reach beyond it.
    span: vec2<f32>,
    is_parallel: u32,
    // Whether each sample is one of a square of four, of a picture with twice as many columns and rows.
    is_half: u32,
    // Perspective: the near plane and 0. Parallel: the far plane, and how far it is behind the near one.
    depth: vec2<f32>,
    // Samples of the picture in a metre across the view axis: at distance 1 (perspective) or anywhere (parallel).
    samples_per_metre: f32,
    pad: f32,
}

@group(0) @binding(0) var<uniform> screen: Screen;
// Metres along the view axis, and ever coarser ones above. The background is at BACKGROUND_M.
@group(0) @binding(1) var distances: texture_2d<f32>;
// Unit normals in the world as (n + 1) / 2, and 1; 0 where there is nothing.
@group(0) @binding(2) var normals: texture_2d<f32>;
// What the pass before has written, where a pass needs that.
@group(1) @binding(1) var before: texture_2d<f32>;

// What infinity is: shaders may not have it.
const BACKGROUND_M: f32 = 1e30;
const TAU: f32 = 6.2831853;
const PI: f32 = 3.1415927;

// Covers the picture.
@vertex
fn screen_vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    let corner = vec2(f32((index << 1u) & 2u), f32(index & 2u));
    return vec4(corner * 2.0 - 1.0, 0.0, 1.0);
}

fn is_background(distance: f32) -> bool {
    return distance > 0.5 * BACKGROUND_M;
}

fn is_inside(at: vec2<i32>) -> bool {
    return all(at >= vec2(0)) && all(at < vec2<i32>(screen.size));
}

// Of a square of 2 × 2 the sample that a picture of half the resolution has: another in each row and column ([McGuire2012] Table 1, rotated grid).
fn chosen_of_four(at: vec2<i32>, full_size: vec2<i32>) -> vec2<i32> {
    return min(at * 2 + ((at.yx & vec2(1)) ^ vec2(1)), full_size - 1);
}

// The point that a sample is of, of a picture whose width and height in samples is `span`, and which may have one of four alone.
fn centre_of(at: vec2<i32>, span: vec2<f32>, is_half: u32) -> vec2<f32> {
    if is_half == 0u {
        return vec2<f32>(at) + 0.5;
    }
    return 0.5 * vec2<f32>(chosen_of_four(at, vec2<i32>(2.0 * span))) + 0.25;
}

fn centre(at: vec2<i32>) -> vec2<f32> {
    return centre_of(at, screen.span, screen.is_half);
}

// The place at a distance that a part of a picture shows: 0 … 1 from the left and from the top.
fn place_in(part: vec2<f32>, distance: f32, half_extent: vec2<f32>, is_parallel: u32) -> vec3<f32> {
    let across = vec2(2.0, -2.0) * part + vec2(-1.0, 1.0);
    let scale = select(distance, 1.0, is_parallel != 0u);
    return vec3(across * half_extent * scale, -distance);
}

// The place at a distance that a point of the picture shows; the first sample's centre is at (0.5, 0.5).
fn place_view(point: vec2<f32>, distance: f32) -> vec3<f32> {
    return place_in(point / screen.span, distance, screen.half_extent, screen.is_parallel);
}

// The point of the picture, or beside it, that a place falls on; a point outside where the place is behind the camera.
fn point_of(place: vec3<f32>) -> vec2<f32> {
    var scale = 1.0;
    if screen.is_parallel == 0u {
        if place.z >= 0.0 {
            return vec2(-1.0);
        }
        scale = -1.0 / place.z;
    }
    return (vec2(0.5) + vec2(0.5, -0.5) * place.xy * scale / screen.half_extent) * screen.span;
}

// The place that a sample sees, and 1; 0 for the background and outside of the picture.
fn place_at(at: vec2<i32>) -> vec4<f32> {
    if !is_inside(at) {
        return vec4(0.0);
    }
    let distance = textureLoad(distances, at, 0).r;
    if is_background(distance) {
        return vec4(0.0);
    }
    return vec4(place_view(centre(at), distance), 1.0);
}

// What a texel of normals is in view space, a unit vector; zero where it has none.
fn normal_view(texel: vec4<f32>) -> vec3<f32> {
    if texel.a < 0.5 {
        return vec3(0.0);
    }
    let n = texel.xyz * 2.0 - 1.0;
    let x = dot(screen.view_from_world_x.xyz, n);
    let y = dot(screen.view_from_world_y.xyz, n);
    let z = dot(screen.view_from_world_z.xyz, n);
    return normalize(vec3(x, y, z));
}

// A sample's normal.
fn normal_at(at: vec2<i32>) -> vec3<f32> {
    return normal_view(textureLoad(normals, at, 0));
}

// The sample that a point of the picture lies in; one outside where that is outside.
fn sample_in(point: vec2<f32>) -> vec2<i32> {
    // Not a number is outside, too.
    if all(point >= vec2(0.0)) && all(point < screen.span) {
        return vec2<i32>(point);
    }
    return vec2(-1);
}

// The sample that lies so many to the right and down of another's centre.
fn neighbour(at: vec2<i32>, by: vec2<f32>) -> vec2<i32> {
    return sample_in(centre(at) + by);
}

fn samples_per_metre(distance: f32) -> f32 {
    return select(screen.samples_per_metre / distance, screen.samples_per_metre, screen.is_parallel != 0u);
}

// The way from a place to the eye, a unit vector.
fn towards_eye(place: vec3<f32>) -> vec3<f32> {
    if screen.is_parallel != 0u {
        return vec3(0.0, 0.0, 1.0);
    }
    return -place / max(length(place), 1e-12);
}

// Where what a point of the picture shows meets a plane, and 1; 0 if it does not, or behind the camera.
fn on_plane(point: vec2<f32>, place: vec3<f32>, normal: vec3<f32>) -> vec4<f32> {
    var origin = vec3(0.0);
    var ray = place_view(point, 1.0);
    if screen.is_parallel != 0u {
        origin = place_view(point, 0.0);
        ray = vec3(0.0, 0.0, -1.0);
    }
    let steepness = dot(normal, ray);
    if abs(steepness) < 1e-12 {
        return vec4(0.0);
    }
    let along = dot(normal, place - origin) / steepness;
    if along <= 0.0 && screen.is_parallel == 0u {
        return vec4(0.0);
    }
    return vec4(origin + ray * along, 1.0);
}
