// What is the same for all that one view draws: camera, ambient light, tone, lights, shadow maps.

struct Frame {
    // Clip space from the world relative to the eye: differences of floats are exact where the eye is near.
    clip_from_relative: mat4x4<f32>,
    eye_world: vec3<f32>,
    // One of the VIEW_ constants.
    view: u32,
    // Unit, from what is in the middle of the picture towards the viewer.
    axis_world: vec3<f32>,
    is_parallel: u32,
    ambient_sky: vec3<f32>,
    exposure: f32,
    ambient_ground: vec3<f32>,
    // One of the CURVE_ constants.
    tone_curve: u32,
    // 0 old values … 1 new values.
    fade: f32,
    specular: u32,
    light_count: u32,
    // What beauty is multiplied with, as displayed.
    dim: f32,
    // Half the side of a drawn point, as a part of the picture's size along x and y.
    point_half: vec2<f32>,
    // Metres that half a point spans: at distance 1 (perspective) or anywhere (parallel).
    point_half_m: f32,
    // Area lights in the lowest byte, 256 more if the atlas has leans; layers of a plane of four of them in the upper half, or 0: all are open.
    area_lights: u32,
}

struct Light {
    position_world: vec3<f32>,
    // 1 / range², 0 for none.
    inverse_range_squared: f32,
    // Unit, from the light.
    direction_world: vec3<f32>,
    is_directional: u32,
    intensity: vec3<f32>,
    first_face: u32,
    // Scale and offset of the cosine that fades a spot light.
    cone: vec2<f32>,
    // 0: no shadow; 1; or 6 in the order +X −X +Y −Y +Z −Z.
    face_count: u32,
    pad: u32,
}

// One square shadow map: a part of a layer.
struct Face {
    // Rows of an affine map.
    view_from_world: mat3x4<f32>,
    // Half the extent: metres, or tangents of half angles in a perspective.
    extent: vec2<f32>,
    // Texels along the side, and the layer.
    resolution: f32,
    layer: u32,
    // First texel in the layer.
    origin: vec2<f32>,
    // Perspective: near and 0. Parallel: near and far.
    near: f32,
    far: f32,
    is_perspective: u32,
    pad_a: u32,
    pad_b: u32,
    pad_c: u32,
}

struct Lights {
    lights: array<Light, 64>,
    faces: array<Face, 96>,
}

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> lights: Lights;
@group(0) @binding(2) var shadow_maps: texture_depth_2d_array;
@group(0) @binding(3) var shadow_sampler: sampler_comparison;

const VIEW_BEAUTY: u32 = 0u;
const VIEW_VISIBILITY: u32 = 1u;
const VIEW_NORMAL: u32 = 2u;
const VIEW_TEXELS: u32 = 3u;
const VIEW_WEIGHTS: u32 = 4u;
const VIEW_AGE: u32 = 5u;
