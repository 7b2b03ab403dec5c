// The cache on the card: which entries a sample reads, and what lies in them. The twins are `Reader` and `Nearby` of `cones::cache`; `entries.rs` says what
// lies where.

struct ConeParams {
    // Texels are this many pixels wide.
    bias: f32,
    // Places in the hash table, a power of two, less one.
    mask: u32,
    // Of each cone; 0 is as many as it needs.
    directions: i32,
    // CONE_BLENDS and others.
    flags: u32,
    // Of the picture, in `samples`.
    first_row: i32,
    // In the table of lights; 0: all by cones.
    lights: i32,
    pad_b: vec2<u32>,
}

// In `flags`: a sample reads the 2 × 2 texels about it; energies are irradiance; what several entries hold is shaded cone by cone.
const CONE_BLENDS: u32 = 1u;
const CONE_IS_RATIO: u32 = 2u;
const CONE_EACH_APART: u32 = 4u;

@group(0) @binding(0) var<uniform> params: ConeParams;
@group(0) @binding(1) var samples: texture_2d_array<u32>;
@group(0) @binding(2) var blocks: texture_2d<u32>;
@group(0) @binding(3) var entries: texture_2d_array<u32>;
@group(0) @binding(4) var area_table: texture_2d<f32>;

// As `entries.rs` has them.
const BLOCKS_A_ROW: i32 = 3;
const ENTRY_TEXELS: i32 = 10;
const HASH_A_ROW: u32 = 1024u;
const MOST_PROBES: i32 = 64;
const HAS_SAMPLES: u32 = 0x100u;

// As `cones::key`: a family of slabs.
const SLABS: u32 = 0x80000000u;
const NO_COORDINATE: i32 = 0x7fffffff;

// Where a sample lies in the charts.
struct Place {
    instance: u32,
    chart: u32,
    uv: vec2<f32>,
    depth: f32,
    // Texels of the chart's rectangle.
    size: vec2<f32>,
    level: i32,
}

struct BlockKey {
    instance: u32,
    chart: u32,
    level: i32,
    slab: i32,
    at: vec2<i32>,
}

// Texels that a sample reads, and their weights.
struct Reads {
    entry: array<i32, 4>,
    weight: array<f32, 4>,
    count: i32,
}

fn edge_of(level: i32) -> f32 {
    return bitcast<f32>(u32(127 + level) << 23u);
}

fn hashed(key: BlockKey) -> u32 {
    var h = mixed(0u, key.instance);
    h = mixed(h, key.chart);
    h = mixed(h, u32(key.level));
    h = mixed(h, u32(key.slab));
    h = mixed(h, u32(key.at.x));
    h = mixed(h, u32(key.at.y));
    return h ^ (h >> 16u);
}

fn mixed(h: u32, word: u32) -> u32 {
    let x = (h ^ word) * 0x9e3779b1u;
    return x ^ (x >> 15u);
}

// Where the block's entries begin, in entries; -1 if the card has none of it.
fn block_of(key: BlockKey) -> i32 {
    let first = hashed(key);
    for (var i = 0; i < MOST_PROBES; i++) {
        let place = (first + u32(i)) & params.mask;
        let at = vec2<i32>(vec2(2u * (place % HASH_A_ROW), place / HASH_A_ROW));
        let rest = textureLoad(blocks, at + vec2(1, 0), 0);
        if rest.z == 0u {
            return -1;
        }
        let head = textureLoad(blocks, at, 0);
        let is_it = all(head == vec4(key.instance, key.chart, u32(key.level), u32(key.slab)));
        if is_it && all(rest.xy == vec2<u32>(key.at)) {
            return (i32(rest.z) - 1) * 64;
        }
    }
    return -1;
}

fn entry_texel(entry: i32, texel: i32) -> vec4<u32> {
    let block = entry / 64;
    let row = block / BLOCKS_A_ROW;
    let rows = i32(textureDimensions(entries).y);
    let column = ((block % BLOCKS_A_ROW) * 64 + entry % 64) * ENTRY_TEXELS + texel;
    return textureLoad(entries, vec2(column, row % rows), row / rows, 0);
}

// The entry of the texel at that place of a level, in the chart and slab of the key; -1 if it has no samples.
fn entry_at(chart: BlockKey, texel: vec2<i32>) -> i32 {
    var key = chart;
    key.at = texel >> vec2(3u);
    let first = block_of(key);
    if first < 0 {
        return -1;
    }
    let entry = first + (texel.y & 7) * 8 + (texel.x & 7);
    return select(-1, entry, (entry_texel(entry, 1).y & HAS_SAMPLES) != 0u);
}

fn read_entries(place: Place) -> Reads {
    var reads: Reads;
    let shrink = edge_of(-place.level);
    let at = place.uv * shrink;
    let is_slab = (place.chart & SLABS) != 0u;
    var low = vec2<i32>(floor(vec2(0.5 * shrink)));
    var high = vec2<i32>(floor(max(place.size - 0.5, vec2(0.5)) * shrink));
    var slab = 0;
    if is_slab {
        low = vec2(-NO_COORDINATE);
        high = vec2(NO_COORDINATE);
        slab = i32(floor(place.depth * shrink));
    }
    let chart = BlockKey(place.instance, place.chart, place.level, slab, vec2(0));
    if (params.flags & CONE_BLENDS) != 0u {
        let corner = floor(at - 0.5);
        let part = clamp(at - 0.5 - corner, vec2(0.0), vec2(1.0));
        var sum = 0.0;
        for (var i = 0; i < 4; i++) {
            let step = vec2(i & 1, i >> 1u);
            let texel = vec2<i32>(corner) + step;
            let weights = select(1.0 - part, part, step == vec2(1));
            let weight = weights.x * weights.y;
            if weight <= 0.0 || any(texel < low) || any(texel > high) {
                continue;
            }
            let entry = entry_at(chart, texel);
            if entry < 0 {
                continue;
            }
            reads.entry[reads.count] = entry;
            reads.weight[reads.count] = weight;
            reads.count++;
            sum += weight;
        }
        for (var i = 0; i < reads.count; i++) {
            reads.weight[i] /= sum;
        }
    }
    if reads.count == 0 {
        let entry = entry_at(chart, vec2<i32>(floor(at)));
        if entry >= 0 {
            reads.entry[0] = entry;
            reads.weight[0] = 1.0;
            reads.count = 1;
        }
    }
    return reads;
}

// Where an entry is.
struct Site {
    position: vec3<f32>,
    normal: vec3<f32>,
    normal_shading: vec3<f32>,
    cones: i32,
}

fn site_of(entry: i32) -> Site {
    let place = entry_texel(entry, 0);
    let rest = entry_texel(entry, 1);
    return Site(
        bitcast<vec3<f32>>(place.xyz),
        unflattened(place.w),
        unflattened(rest.x),
        i32(rest.y & 0xffu),
    );
}

// In place of a light's number: a cone of several.
const OF_SEVERAL: u32 = 0xffffu;

// A cone of an entry, and the part of which light it is.
struct Cone {
    energy: vec3<f32>,
    mean_cosine: f32,
    direction: vec3<f32>,
    cos_angle: f32,
    // Of a light in the table; -1 for light of none.
    slot: i32,
    // A bit for each class of lights in it, if these are several.
    several: u32,
    fraction: f32,
    is_whole: bool,
    settled: f32,
}

fn cone_of(entry: i32, index: i32) -> Cone {
    let light = entry_texel(entry, 2 + 2 * index);
    let shape = entry_texel(entry, 3 + 2 * index);
    let settled = (shape.w >> 16u) & 0x7fffu;
    let is_of_several = shape.w == OF_SEVERAL;
    return Cone(
        bitcast<vec3<f32>>(light.xyz),
        bitcast<f32>(light.w),
        unflattened(shape.x),
        bitcast<f32>(shape.y),
        select(i32(shape.w & 0xffffu) - 1, -1, is_of_several),
        select(0u, shape.z, is_of_several),
        select(bitcast<f32>(shape.z), 0.0, is_of_several),
        (shape.w & 0x80000000u) != 0u,
        select(f32(settled) / 32768.0, 1.0, settled == 0x7fffu),
    );
}

// A unit vector of the octahedral map. The twin is `octahedral::unflatten`.
fn unflattened(packed: u32) -> vec3<f32> {
    let p = unpack2x16snorm(packed);
    let z = 1.0 - abs(p.x) - abs(p.y);
    let outer = (1.0 - abs(p.yx)) * select(vec2(1.0), vec2(-1.0), p < vec2(0.0));
    return normalize(vec3(select(p, outer, z < 0.0), z));
}
