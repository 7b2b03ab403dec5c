// Draws what throws shadows into one face of the shadow maps: depth, and holes where alpha cuts them.

struct FaceView {
    clip_from_world: mat4x4<f32>,
}

@group(0) @binding(0) var<uniform> face_view: FaceView;

struct CasterVaryings {
    @builtin(position) clip: vec4<f32>,
    @location(0) uv: vec4<f32>,
    @location(1) alpha: f32,
}

struct CasterVertex {
    @location(0) position: vec3<f32>,
    @location(1) normal: vec4<f32>,
    @location(3) source: u32,
    @location(4) world_x: vec4<f32>,
    @location(5) world_y: vec4<f32>,
    @location(6) world_z: vec4<f32>,
    @location(10) instance: vec4<u32>,
}

fn caster_clip(v: CasterVertex) -> vec4<f32> {
    let start = vec4(deform(v.position, v.normal.xyz, v.source, v.instance.z).position, 1.0);
    return face_view.clip_from_world * vec4(dot(v.world_x, start), dot(v.world_y, start), dot(v.world_z, start), 1.0);
}

@vertex
fn caster_solid(v: CasterVertex) -> @builtin(position) vec4<f32> {
    return caster_clip(v);
}

@vertex
fn caster_masked(v: CasterVertex, @location(12) uv: vec4<f32>, @location(13) color: vec4<f32>) -> CasterVaryings {
    return CasterVaryings(caster_clip(v), uv, color.a);
}

@fragment
fn caster_holes(v: CasterVaryings) {
    let texel = textureSample(base_color_texture, base_color_sampler, image_coordinates(material.base_color_use, v.uv));
    if material.base_color.a * v.alpha * texel.a < material.cutoff {
        discard;
    }
}
