// The vertex stage of all that draws meshes: pose, place, hand on.

@group(2) @binding(2) var page_table: texture_2d<u32>;
@group(2) @binding(3) var atlas_texture: texture_2d_array<f32>;
@group(2) @binding(4) var atlas_sampler: sampler;
@group(2) @binding(5) var inspection_texture: texture_2d_array<f32>;

// Whether the look-up reads the place at rest.
override NEEDS_REST: bool = false;
// Whether area lights are drawn.
override AREA_LIGHTS: bool = false;

const PAGE_TABLE_WIDTH: u32 = 1024u;
const NO_PAGE: u32 = 0xffffu;
// Of light_texels.
const NO_TEXEL: u32 = 0xffffffffu;
// Steps of a chart coordinate in a texel.
const TEXEL_FRACTION: f32 = 32.0;

const INSTANCE_STORED_TANGENTS: u32 = 1u;
const INSTANCE_MIRRORED: u32 = 2u;
const INSTANCE_REST_MIRRORED: u32 = 4u;
const INSTANCE_PER_VERTEX: u32 = 8u;
// From this bit on: number of pages of one side, if the back has pages of its own after the front's, or 0.
const INSTANCE_BACK_PAGES_SHIFT: u32 = 16u;

struct PlainVertex {
    @location(0) position: vec3<f32>,
    @location(1) normal: vec4<f32>,
    // Page, x, y, number of the chart.
    @location(2) chart: vec4<u32>,
    // Number in the mesh.
    @location(3) source: u32,
    // Rows of world from mesh.
    @location(4) world_x: vec4<f32>,
    @location(5) world_y: vec4<f32>,
    @location(6) world_z: vec4<f32>,
    // Rows of rest from mesh.
    @location(7) rest_x: vec4<f32>,
    @location(8) rest_y: vec4<f32>,
    @location(9) rest_z: vec4<f32>,
    // Index in the scene, first entry in the page table, header in the pose, INSTANCE_ bits.
    @location(10) instance: vec4<u32>,
}

struct DetailedVertex {
    @location(11) tangent: vec4<f32>,
    @location(12) uv: vec4<f32>,
    @location(13) color: vec4<f32>,
}

struct Varyings {
    // Passes compare depths with each other's.
    @builtin(position) @invariant clip: vec4<f32>,
    // In the world, relative to the eye.
    @location(0) relative: vec3<f32>,
    // Interpolates like the mesh's normals: not of unit length. Front side.
    @location(1) normal_world: vec3<f32>,
    // Bitangent's sign in w.
    @location(2) tangent_world: vec4<f32>,
    @location(3) uv: vec4<f32>,
    @location(4) color: vec4<f32>,
    // As in LookupInput. At the centroid, or a sample at a chart's border would reach into its neighbour.
    @location(5) @interpolate(perspective, centroid) atlas: vec3<f32>,
    @location(6) position_rest: vec3<f32>,
    // Index of the instance, its bits, number of the chart.
    @location(7) @interpolate(flat, either) ids: vec3<u32>,
    // Of the back, where it has texels of its own.
    @location(8) @interpolate(perspective, centroid) atlas_back: vec3<f32>,
    // Where vertices have texels of their own and area lights are drawn: that of the front's, x and y in 16 bits each and the layer, then the
    // back's. Of one vertex: such triangles are smaller than a texel.
    @location(9) @interpolate(flat, either) light_texels: vec4<u32>,
}

@vertex
fn vertex_plain(plain: PlainVertex) -> Varyings {
    return place(plain, DetailedVertex(vec4(0.0), vec4(0.0), vec4(1.0)));
}

@vertex
fn vertex_detailed(plain: PlainVertex, detailed: DetailedVertex) -> Varyings {
    return place(plain, detailed);
}

fn place(v: PlainVertex, detail: DetailedVertex) -> Varyings {
    let posed = deform(v.position, v.normal.xyz, v.source, v.instance.z);
    let start = vec4(posed.position, 1.0);
    let position_world = vec3(dot(v.world_x, start), dot(v.world_y, start), dot(v.world_z, start));
    var out: Varyings;
    out.relative = position_world - frame.eye_world;
    out.clip = frame.clip_from_relative * vec4(out.relative, 1.0);
    out.normal_world = transform_normal(v.world_x.xyz, v.world_y.xyz, v.world_z.xyz, posed.normal);
    let t = detail.tangent.xyz;
    out.tangent_world = vec4(dot(v.world_x.xyz, t), dot(v.world_y.xyz, t), dot(v.world_z.xyz, t), detail.tangent.w);
    out.uv = detail.uv;
    out.color = detail.color;
    out.atlas = atlas_place(v.chart, v.instance.y, v.instance.w);
    out.atlas_back = out.atlas;
    let back_pages = v.instance.w >> INSTANCE_BACK_PAGES_SHIFT;
    if back_pages > 0u {
        out.atlas_back = atlas_place(v.chart, v.instance.y + back_pages, v.instance.w);
    }
    out.light_texels = vec4(0u, NO_TEXEL, 0u, NO_TEXEL);
    if AREA_LIGHTS && (v.instance.w & INSTANCE_PER_VERTEX) != 0u {
        let front = vertex_texel(v.chart, v.instance.y);
        out.light_texels = vec4(front, front);
        if back_pages > 0u {
            out.light_texels = vec4(front, vertex_texel(v.chart, v.instance.y + back_pages));
        }
    }
    out.position_rest = vec3(0.0);
    if NEEDS_REST {
        out.position_rest = vec3(dot(v.rest_x.xyz, v.position), dot(v.rest_y.xyz, v.position), dot(v.rest_z.xyz, v.position));
    }
    out.ids = vec3(v.instance.x, v.instance.w, v.chart.w);
    return out;
}

// The texel of a vertex that has one of its own, as in light_texels.
fn vertex_texel(chart: vec4<u32>, first_page: u32) -> vec2<u32> {
    if chart.x == NO_PAGE {
        return vec2(0u, NO_TEXEL);
    }
    let entry = first_page + chart.x;
    let page = textureLoad(page_table, vec2(entry % PAGE_TABLE_WIDTH, entry / PAGE_TABLE_WIDTH), 0);
    if page.w == 0u {
        return vec2(0u, NO_TEXEL);
    }
    let at = page.yz + vec2<u32>(vec2<f32>(chart.yz) / TEXEL_FRACTION);
    return vec2(at.x | (at.y << 16u), page.x);
}

fn atlas_place(chart: vec4<u32>, first_page: u32, bits: u32) -> vec3<f32> {
    if chart.x == NO_PAGE {
        return vec3(0.0, 0.0, -1.0);
    }
    let entry = first_page + chart.x;
    // Layer, x, y, whether it has a place.
    let page = textureLoad(page_table, vec2(entry % PAGE_TABLE_WIDTH, entry / PAGE_TABLE_WIDTH), 0);
    if page.w == 0u {
        return vec3(0.0, 0.0, -1.0);
    }
    let at = vec2<f32>(page.yz) + vec2<f32>(chart.yz) / TEXEL_FRACTION;
    if (bits & INSTANCE_PER_VERTEX) != 0u {
        let values = textureLoad(atlas_texture, vec2<i32>(floor(at)), i32(page.x), 0).rg;
        return vec3(values, -2.0);
    }
    return vec3(at, f32(page.x));
}
