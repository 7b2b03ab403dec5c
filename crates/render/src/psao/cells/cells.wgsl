// Moving least squares a fragment, over static lists of points in cells (see mls.rs for the fit).

// (edge, radius, plane, log2 of the normals' power), (instances), then (origin, first slot), (cells along axes, slots).
@group(3) @binding(3) var cells_grids: texture_2d<u32>;
// (cell's number, first point, number of points, 0), free where there are no points; open addressing.
@group(3) @binding(4) var cells_slots: texture_2d<u32>;
// (position, 16 bits of normal and 8 of visibility).
@group(3) @binding(5) var cells_points: texture_2d<u32>;

// Weighted sums of value = a + b u + c v, and what serves where they are empty.
struct CellsFit {
    // w, w u, w v, w y
    first: vec4f,
    // w u u, w u v, w v v
    second: vec3f,
    // w u y, w v y
    mixed: vec2f,
    // Least and greatest value.
    range: vec2f,
    // Nearest point: on the other side (1) or not, squared distance, value.
    nearest: vec3f,
}

// Texel of a table that is 2048 wide.
fn cells_at(index: u32) -> vec2u {
    return vec2u(index & 2047u, index >> 11u);
}

fn cells_hash(key: u32) -> u32 {
    var h = key * 0x9e3779b1u;
    h ^= h >> 15u;
    h *= 0x2c1b3c6du;
    return h ^ (h >> 13u);
}

fn cells_normal(word: u32) -> vec3f {
    let p = (vec2f(f32((word >> 16u) & 255u), f32((word >> 8u) & 255u)) - 127.0) / 127.0;
    let z = 1.0 - abs(p.x) - abs(p.y);
    let folded = (1.0 - abs(p.yx)) * select(vec2f(1.0), vec2f(-1.0), p < vec2f(0.0));
    return normalize(vec3f(select(p, folded, z < 0.0), z));
}

// First point of a cell and their number.
fn cells_run(key: u32, first_slot: u32, slots: u32) -> vec2u {
    var slot = cells_hash(key) & (slots - 1u);
    for (var tried = 0u; tried < slots; tried++) {
        let found = textureLoad(cells_slots, cells_at(first_slot + slot), 0);
        if found.z == 0u {
            break;
        }
        if found.x == key {
            return found.yz;
        }
        slot = (slot + 1u) & (slots - 1u);
    }
    return vec2u(0u);
}

// (1 - d d)^2, the cosine to its power, and the distance from the tangent plane.
fn cells_weight(d: vec3f, normal: vec3f, point_normal: vec3f, params: vec4f) -> f32 {
    let inside = 1.0 - dot(d, d);
    var cosine = dot(normal, point_normal);
    if inside <= 0.0 || cosine <= 0.0 {
        return 0.0;
    }
    for (var i = 0u; i < u32(params.w); i++) {
        cosine *= cosine;
    }
    let height = dot(normal, d);
    let plane = 1.0 / (1.0 + params.z * height * height);
    return inside * inside * cosine * plane * plane;
}

// The fitted plane at the fragment, held within the values.
fn cells_value(fit: CellsFit) -> f32 {
    if !(fit.first.x >= 1e-9) {
        return fit.nearest.z;
    }
    let inverse = 1.0 / fit.first.x;
    let u = fit.first.y * inverse;
    let v = fit.first.z * inverse;
    let y = fit.first.w * inverse;
    let uu = fit.second.x * inverse - u * u + 1e-3;
    let uv = fit.second.y * inverse - u * v;
    let vv = fit.second.z * inverse - v * v + 1e-3;
    let uy = fit.mixed.x * inverse - u * y;
    let vy = fit.mixed.y * inverse - v * y;
    let determinant = uu * vv - uv * uv;
    if !(determinant > 0.0) {
        return y;
    }
    let b = (uy * vv - vy * uv) / determinant;
    let c = (vy * uu - uy * uv) / determinant;
    return clamp(y - b * u - c * v, fit.range.x, fit.range.y);
}

// Visibility 0 to 1 of a fragment, given in the rest space of its instance.
fn cells_visibility(instance: u32, position_rest: vec3f, normal_rest: vec3f) -> f32 {
    if instance >= textureLoad(cells_grids, vec2u(1u, 0u), 0).x {
        return 1.0;
    }
    let params = bitcast<vec4f>(textureLoad(cells_grids, vec2u(0u, 0u), 0));
    let place = textureLoad(cells_grids, cells_at(2u + 2u * instance), 0);
    let dims = textureLoad(cells_grids, cells_at(3u + 2u * instance), 0);
    if dims.w == 0u {
        return 1.0;
    }
    let position = (position_rest - bitcast<vec3f>(place.xyz)) / params.x;
    let base = vec3i(floor(position - 0.5));
    // Any two directions in the tangent plane do.
    let axis = select(vec3f(1.0, 0.0, 0.0), vec3f(0.0, 1.0, 0.0), abs(normal_rest.x) > 0.7);
    let tangent = normalize(cross(axis, normal_rest));
    let bitangent = cross(normal_rest, tangent);
    var fit = CellsFit(vec4f(0.0), vec3f(0.0), vec2f(0.0), vec2f(255.0, 0.0), vec3f(1.0, 3.4e38, 255.0));
    for (var corner = 0; corner < 8; corner++) {
        let cell = base + vec3i(corner & 1, (corner >> 1u) & 1, corner >> 2u);
        let lead = vec3f(cell) - position;
        let outside = max(max(lead, -lead - 1.0), vec3f(0.0));
        if any(cell < vec3i(0)) || any(cell >= vec3i(dims.xyz)) || dot(outside, outside) >= 0.25 {
            continue;
        }
        let c = vec3u(cell);
        let run = cells_run((c.z * dims.y + c.y) * dims.x + c.x, place.w, dims.w);
        for (var i = 0u; i < run.y; i++) {
            let point = textureLoad(cells_points, cells_at(run.x + i), 0);
            let point_normal = cells_normal(point.w);
            let y = f32(point.w & 255u);
            let d = (bitcast<vec3f>(point.xyz) - position_rest) / params.y;
            let w = cells_weight(d, normal_rest, point_normal, params);
            if w > 0.0 {
                let u = dot(d, tangent);
                let v = dot(d, bitangent);
                fit.first += w * vec4f(1.0, u, v, y);
                fit.second += w * vec3f(u * u, u * v, v * v);
                fit.mixed += w * y * vec2f(u, v);
                fit.range = vec2f(min(fit.range.x, y), max(fit.range.y, y));
            }
            let opposed = select(0.0, 1.0, dot(point_normal, normal_rest) <= 0.0);
            let near = vec3f(opposed, dot(d, d), y);
            if near.x < fit.nearest.x || (near.x == fit.nearest.x && near.y < fit.nearest.y) {
                fit.nearest = near;
            }
        }
    }
    return clamp(cells_value(fit) / 255.0, 0.0, 1.0);
}
