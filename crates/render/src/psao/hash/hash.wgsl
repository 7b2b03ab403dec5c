// The paper's look-up of visibility at points in a hash table of cells ([Neff2023] sec. 3.2, 3.5, eq. 1 to 4).

// (edge, radius, T_n, T_d), (instances), then (origin, first bucket), (cells along axes, buckets) an instance.
@group(3) @binding(0) var hash_grids: texture_2d<u32>;
// Two texels a bucket: eight cells + 1, 0 at the end.
@group(3) @binding(1) var hash_buckets: texture_2d<u32>;
// Two texels a cell: seven packed points, and the cell's number in its grid.
@group(3) @binding(2) var hash_cells: texture_2d<u32>;

// Texel of a table that is 2048 wide.
fn hash_at(index: u32) -> vec2u {
    return vec2u(index & 2047u, index >> 11u);
}

fn hash_normal(word: u32) -> vec3f {
    let p = vec2f(f32((word >> 12u) & 15u), f32((word >> 8u) & 15u)) / 7.0 - 1.0;
    let z = 1.0 - abs(p.x) - abs(p.y);
    let folded = (1.0 - abs(p.yx)) * select(vec2f(1.0), vec2f(-1.0), p < vec2f(0.0));
    return normalize(vec3f(select(p, folded, z < 0.0), z));
}

// Adds one point to the sums of eq. 4; `corner` leads from the fragment to the cell's corner, in cells.
fn hash_add(sums: vec2f, word: u32, corner: vec3f, normal_rest: vec3f, params: vec4f) -> vec2f {
    let steps = vec3f(f32((word >> 26u) & 31u), f32((word >> 21u) & 31u), f32((word >> 16u) & 31u));
    let to_point = (corner + (steps + 0.5) / 32.0) * params.x;
    let point_normal = hash_normal(word);
    let distance = length(to_point);
    // [Neff2023] eq. 2
    let alpha = max((params.y - distance) / params.y, 0.0);
    // [Neff2023] eq. 3; a point at the fragment itself has no direction and passes.
    let along = select(0.0, dot(point_normal, to_point) / distance, distance > 0.0);
    if dot(point_normal, normal_rest) <= params.z || along * along >= params.w {
        return sums;
    }
    return sums + alpha * vec2f(f32(word & 255u), 1.0);
}

// Visibility 0 to 1 of a fragment, given in the rest space of its instance.
fn hash_visibility(instance: u32, position_rest: vec3f, normal_rest: vec3f) -> f32 {
    if instance >= textureLoad(hash_grids, vec2u(1u, 0u), 0).x {
        return 1.0;
    }
    let params = bitcast<vec4f>(textureLoad(hash_grids, vec2u(0u, 0u), 0));
    let place = textureLoad(hash_grids, hash_at(2u + 2u * instance), 0);
    let dims = textureLoad(hash_grids, hash_at(3u + 2u * instance), 0);
    if dims.w == 0u {
        return 1.0;
    }
    let position = (position_rest - bitcast<vec3f>(place.xyz)) / params.x;
    let base = vec3i(floor(position - 0.5));
    var sums = vec2f(0.0);
    for (var corner = 0; corner < 8; corner++) {
        let cell = base + vec3i(corner & 1, (corner >> 1u) & 1, corner >> 2u);
        if any(cell < vec3i(0)) || any(cell >= vec3i(dims.xyz)) {
            continue;
        }
        let c = vec3u(cell);
        // [Neff2023] eq. 1
        let hash = c.x + c.y * dims.x * 17u + c.z * dims.x * dims.y * 31u;
        let bucket = place.w + hash % dims.w;
        let key = (c.z * dims.y + c.y) * dims.x + c.x;
        var found = 0u;
        for (var part = 0u; part < 2u && found == 0u; part++) {
            let entries = textureLoad(hash_buckets, hash_at(2u * bucket + part), 0);
            for (var i = 0u; i < 4u; i++) {
                let entry = entries[i];
                if entry == 0u {
                    break;
                }
                if textureLoad(hash_cells, hash_at(2u * entry - 1u), 0).w == key {
                    found = entry;
                    break;
                }
            }
            // Entries are taken in order, so a free one ends the bucket.
            if entries.w == 0u {
                break;
            }
        }
        if found == 0u {
            continue;
        }
        let lead = vec3f(cell) - position;
        let first = textureLoad(hash_cells, hash_at(2u * found - 2u), 0);
        for (var i = 0u; i < 4u; i++) {
            if first[i] == 0u {
                break;
            }
            sums = hash_add(sums, first[i], lead, normal_rest, params);
        }
        let last = textureLoad(hash_cells, hash_at(2u * found - 1u), 0);
        for (var i = 0u; i < 3u; i++) {
            if last[i] == 0u {
                break;
            }
            sums = hash_add(sums, last[i], lead, normal_rest, params);
        }
    }
    // [Neff2023] eq. 4: open where nothing has weight.
    return select(1.0, sums.x / sums.y / 255.0, sums.y > 0.0);
}
