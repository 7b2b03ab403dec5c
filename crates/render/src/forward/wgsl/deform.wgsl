// Morph targets and skins: the place of a vertex in its pose. The twin is `Scene::pose`.

// Row-major texels of numbers that change with the pose, POSE_WIDTH a row: joint matrices (three rows of an affine map
// each), morph weights (one a texel), and a header of two texels for each instance that deforms:
// (first texel of influences, sets, first texel of displacements, targets),
// (vertices, first texel of joints, first texel of morph weights, joints).
@group(2) @binding(0) var pose_texture: texture_2d<f32>;
// Row-major texels that never change, DEFORM_WIDTH a row. Influences: for each vertex and set joints, weights.
// Displacements: for each target and vertex position, normal.
@group(2) @binding(1) var deform_texture: texture_2d<f32>;

const POSE_WIDTH: u32 = 1024u;
const DEFORM_WIDTH: u32 = 2048u;
// Header of an instance that does not deform.
const RIGID: u32 = 0xffffffffu;

struct Posed {
    position: vec3<f32>,
    normal: vec3<f32>,
}

fn pose_texel(index: u32) -> vec4<f32> {
    return textureLoad(pose_texture, vec2(index % POSE_WIDTH, index / POSE_WIDTH), 0);
}

fn deform_texel(index: u32) -> vec4<f32> {
    return textureLoad(deform_texture, vec2(index % DEFORM_WIDTH, index / DEFORM_WIDTH), 0);
}

// A vertex (number `vertex` of the mesh) in its pose: in mesh space if morphed, in the world if skinned.
fn deform(position: vec3<f32>, normal: vec3<f32>, vertex: u32, header: u32) -> Posed {
    var posed = Posed(position, normal);
    if header == RIGID {
        return posed;
    }
    let a = vec4<u32>(pose_texel(header));
    let b = vec4<u32>(pose_texel(header + 1u));
    if a.w > 0u {
        for (var target_index = 0u; target_index < a.w; target_index++) {
            let weight = pose_texel(b.z + target_index).x;
            if weight != 0.0 {
                let at = a.z + (target_index * b.x + vertex) * 2u;
                posed.position += weight * deform_texel(at).xyz;
                posed.normal += weight * deform_texel(at + 1u).xyz;
            }
        }
        posed.normal = unit_or(posed.normal, normal);
    }
    if a.y > 0u {
        var row_x = vec4(0.0);
        var row_y = vec4(0.0);
        var row_z = vec4(0.0);
        for (var influence = 0u; influence < a.y; influence++) {
            let at = a.x + (vertex * a.y + influence) * 2u;
            let joints = vec4<u32>(deform_texel(at));
            let weights = deform_texel(at + 1u);
            for (var i = 0u; i < 4u; i++) {
                let weight = weights[i];
                if weight != 0.0 && joints[i] < b.w {
                    let joint = b.y + joints[i] * 3u;
                    row_x += pose_texel(joint) * weight;
                    row_y += pose_texel(joint + 1u) * weight;
                    row_z += pose_texel(joint + 2u) * weight;
                }
            }
        }
        let start = vec4(posed.position, 1.0);
        posed.position = vec3(dot(row_x, start), dot(row_y, start), dot(row_z, start));
        posed.normal = unit_or(transform_normal(row_x.xyz, row_y.xyz, row_z.xyz, posed.normal), posed.normal);
    }
    return posed;
}
