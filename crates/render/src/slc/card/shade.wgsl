// What a sample reflects of the cones about it. The twins are `slc::blend` and `slc::cap`, whose constants these are.

// Part of a light from which on its highlight is that of all of it.
const WHOLE: f32 = 0.97;
// Part of a cone above an entry's horizon, and mean cosine there, below which it is not taken at its word.
const LEAST_OPEN: f32 = 0.125;
const LEAST_COSINE: f32 = 0.01;
// Cosine that light above an entry's surface counts with at least.
const GRAZING_COSINE: f32 = 0.05;
const SMALLEST: f32 = 1.17549435e-38;

// How much larger than a cone of several lights that part of all directions is which any of them may lie in, mean square of heights that says nothing of them, and
// most that a light counts more or less for its height.
const CONE_BESIDE: f32 = 9.0;
const LEAST_HEIGHTS: f32 = 1e-4;
const MOST_LEVELLED: f32 = 20.0;
// Least of a channel of a light's colour.
const LEAST_TINT: f32 = 0.02;

// A sample that is lit.
struct ConePoint {
    surface: AreaSurface,
    reflectance: Reflectance,
    has_gloss: bool,
    // Metres of an edge of its pixel.
    footprint: f32,
}

// What cones bring of what reflectance is made of: n·l (1 − f), D V n·l (1 − f) and D V n·l f, f Schlick's fifth power. Of surfaces without gloss the
// first is n·l.
struct Lit {
    matte: vec3<f32>,
    gloss: vec3<f32>,
    grazing: vec3<f32>,
}

// What several entries see of one light.
struct Seen {
    slot: i32,
    fraction: f32,
    // Weight of entries that tell, and the last that did.
    told: f32,
    teller: i32,
    moment: vec3<f32>,
    fluence: f32,
}

// For how much of a cone the light's own shape stands.
fn shape_share(cone: Cone, widest: f32) -> f32 {
    if cone.slot < 0 {
        return 0.0;
    }
    let is_narrow = 1.0 - cone.cos_angle <= widest;
    if cone.is_whole && is_narrow {
        return 1.0;
    }
    return select(0.0, 1.0 - cone.settled, cone.is_whole || is_narrow);
}

// 1 − cos a of the widest cone of a part of a light that one cone for all entries stands for.
fn widest_part(p: ConePoint) -> f32 {
    if !is_smooth(p) {
        return 3.0;
    }
    let chord = 1.2 * (0.04 + 0.6 * p.reflectance.alpha);
    return 0.5 * chord * chord;
}

// Whether a surface shows where light comes from: one entry's cones cannot stand for another's.
fn is_smooth(p: ConePoint) -> bool {
    return p.has_gloss && p.reflectance.alpha < AREA_ROUGH_ALPHA;
}

// What heights of a cone's directions over an entry's horizon are to be scaled by, if some of them are below it; 0 if none is.
fn flattened(cone: Cone, n: vec3<f32>, basis: Basis, count: i32) -> f32 {
    let depth = 1.0 - cone.cos_angle;
    let upright = dot(n, cone.direction);
    let is_above = depth < 1.0 && upright > 0.0 && (upright * upright > depth * (2.0 - depth) + 1e-3);
    if ((params.flags & CONE_IS_RATIO) == 0u) || (count == 1) || is_above {
        return 0.0;
    }
    var heights = 0.0;
    var is_below = false;
    var turn = vec2(1.0, 0.0);
    for (var i = 0; i < count; i++) {
        let height = dot(n, in_cone(cone.direction, basis, depth, i, count, turn));
        turn = turned(turn, i);
        heights += abs(height);
        is_below = is_below || height <= 0.0;
    }
    let mean = max(upright * 0.5 * (1.0 + cone.cos_angle), LEAST_COSINE);
    return select(0.0, mean * f32(count) / max(heights, SMALLEST), is_below);
}

// A direction that is so much higher or lower over the horizon, and above it.
fn lifted(l: vec3<f32>, n: vec3<f32>, flatter: f32) -> vec3<f32> {
    if flatter <= 0.0 {
        return l;
    }
    let before = dot(n, l);
    let height = min(abs(before) * flatter, 1.0);
    let along = sqrt((1.0 - height * height) / max(1.0 - before * before, 1e-6));
    return l * along + n * (height - before * along);
}

fn lit_by(p: ConePoint, before: Lit, cone: Cone, site: Site, part: f32) -> Lit {
    let depth = 1.0 - cone.cos_angle;
    let count = directions_of(p, cone);
    let n = f32(count);
    let basis = orthonormal_basis(cone.direction);
    var lobe = lobe_of(p.surface, p.reflectance.alpha * p.reflectance.alpha);
    // Each direction shows the part of the cone about it; the paper's show themselves alone.
    lobe.wide_a2 += select(0.0, 0.25 * depth / n, (params.flags & CONE_IS_RATIO) != 0u);
    // Lobes of the paper's form are not made wider, and rings lie in their middle.
    let inset = select(2.0, CONE_INSET, (params.flags & CONE_IS_RATIO) != 0u);
    let flatter = flattened(cone, site.normal, basis, count);
    var sums = vec4(0.0);
    // Of the entry: cosines, and directions above its horizon.
    var over = 0.0;
    var open = 0.0;
    var turn = vec2(1.0, 0.0);
    for (var i = 0; i < count; i++) {
        let l = lifted(in_cone_from(cone.direction, basis, depth, i, count, turn, inset), site.normal, flatter);
        turn = turned(turn, i);
        let cosine = select(0.0, max(dot(site.normal_shading, l), GRAZING_COSINE), dot(site.normal, l) > 0.0);
        over += cosine;
        open += select(0.0, 1.0, cosine > 0.0);
        sums += reflected_parts(p.surface, lobe, l);
    }
    if (params.flags & CONE_IS_RATIO) == 0u {
        over = n;
        open = n;
    } else {
        // Light that reached the entry came from above its horizon, wherever rounding puts the cone.
        over = max(over, LEAST_COSINE * n);
        open = max(open, LEAST_OPEN * n);
    }
    let energy = cone.energy * (part / over);
    let of_gloss = over / (open * cone.mean_cosine);
    return Lit(
        before.matte + energy * select(sums.w, sums.x, p.has_gloss),
        before.gloss + energy * (of_gloss * sums.y),
        before.grazing + energy * (of_gloss * sums.z),
    );
}

// A light of a cone of several, from where it is shaded: how much it brings beside others, 1 − the cosine of the angle that it is seen under, and how high it
// is above the entry.
struct Toward {
    direction: vec3<f32>,
    weight: f32,
    // Its colour, of luminance 1.
    tint: vec3<f32>,
    depth: f32,
    height: f32,
}

fn toward(p: ConePoint, cone: Cone, site: Site, slot: i32) -> Toward {
    let nothing = Toward(p.surface.normal, 0.0, vec3(0.0), 0.0, 0.0);
    let shine = area_texel(slot, 1);
    let form = area_form(shine);
    if (form == 0) || ((cone.several >> u32(i32(shine.w) / AREA_FORMS)) & 1u) == 0u {
        return nothing;
    }
    let ball = area_texel(slot, 0);
    let offset = ball.xyz - p.surface.position;
    let distance_squared = max(dot(offset, offset), SMALLEST);
    let direction = offset / sqrt(distance_squared);
    let height = dot(site.normal, direction);
    let side = area_texel(slot, 2);
    let is_flat = form == AREA_DISC || form == AREA_QUAD;
    let facing = select(1.0, -dot(side.xyz, direction), is_flat && side.w == 0.0);
    let far = (1.0 - dot(cone.direction, direction)) / max(1.0 - cone.cos_angle, 1e-6);
    let near = max(1.0 - far / CONE_BESIDE, 0.0);
    let brightness = luminance(shine.xyz);
    if brightness <= 0.0 {
        return nothing;
    }
    let strength = brightness * area_texel(slot, AREA_DISC_M2).x;
    let tint = max(shine.xyz / brightness, vec3(LEAST_TINT));
    // Inside of its ball it is all around.
    let weight = max(strength * facing / max(distance_squared, ball.w * ball.w), 0.0) * near * near;
    let sine_squared = min(ball.w * ball.w / distance_squared, 1.0);
    return Toward(direction, select(0.0, weight, height > 0.0), tint, 1.0 - sqrt(1.0 - sine_squared), height);
}

// By the lights that it is of, those of them that lie about it; `lit_by` if there are none.
fn lit_by_several(p: ConePoint, before: Lit, cone: Cone, site: Site, part: f32) -> Lit {
    var all = 0.0;
    var mean = 0.0;
    var square = 0.0;
    for (var slot = 0; slot < params.lights; slot++) {
        let light = toward(p, cone, site, slot);
        all += light.weight;
        mean += light.weight * light.height;
        square += light.weight * light.height * light.height;
    }
    if all <= 0.0 {
        return lit_by(p, before, cone, site, part);
    }
    // As high above the entry in the mean as its light is: what grazes a smooth surface outshines the rest.
    mean /= max(all, SMALLEST);
    let spread = square / max(all, SMALLEST) - mean * mean;
    let slope = (dot(site.normal, cone.direction) * 0.5 * (1.0 + cone.cos_angle) - mean) / (spread + LEAST_HEIGHTS);
    var matte = vec3(0.0);
    var gloss = vec3(0.0);
    var grazing = vec3(0.0);
    var tinted = vec3(0.0);
    var over = 0.0;
    all = 0.0;
    for (var slot = 0; slot < params.lights; slot++) {
        let light = toward(p, cone, site, slot);
        if light.weight <= 0.0 {
            continue;
        }
        let weight = light.weight * clamp(1.0 + slope * (light.height - mean), 1.0 / MOST_LEVELLED, MOST_LEVELLED);
        var lobe = lobe_of(p.surface, p.reflectance.alpha * p.reflectance.alpha);
        lobe.wide_a2 += 0.25 * light.depth;
        let parts = reflected_parts(p.surface, lobe, light.direction);
        let cosine = max(dot(site.normal_shading, light.direction), GRAZING_COSINE);
        let own = light.tint * weight;
        all += weight;
        over += weight * cosine;
        tinted += own * cosine;
        matte += own * select(parts.w, parts.x, p.has_gloss);
        gloss += own * parts.y;
        grazing += own * parts.z;
    }
    // Lights that are not those which shine may all graze the entry, which its own light does not.
    let most = max(over, 0.5 * cone.mean_cosine * all);
    let energy = cone.energy * (part * over / max(most, SMALLEST)) / max(tinted, vec3(SMALLEST));
    let of_gloss = most / (max(all, SMALLEST) * cone.mean_cosine);
    return Lit(
        before.matte + energy * matte,
        before.gloss + energy * (of_gloss * gloss),
        before.grazing + energy * (of_gloss * grazing),
    );
}

fn directions_of(p: ConePoint, cone: Cone) -> i32 {
    return select(params.directions, needed_directions(1.0 - cone.cos_angle, p.reflectance.alpha), params.directions == 0);
}

fn reflected_of(p: ConePoint, lit: Lit) -> vec3<f32> {
    let r = p.reflectance;
    if !p.has_gloss {
        return r.diffuse * FRAC_1_PI * lit.matte;
    }
    return r.diffuse * (1.0 - r.f0) * FRAC_1_PI * lit.matte + r.f0 * lit.gloss + lit.grazing;
}

fn luminance(colour: vec3<f32>) -> f32 {
    return dot(colour, vec3(0.2126, 0.7152, 0.0722));
}

fn fourth(v: f32) -> f32 {
    let v2 = v * v;
    return v2 * v2;
}

fn reflected_of_cones(p: ConePoint, place: Place) -> vec3<f32> {
    let found = read_entries(place);
    let texel = max(p.footprint * params.bias, SMALLEST);
    // Entries on other faces, or off the plane, see other light.
    var near = array<f32, 4>(0.0, 0.0, 0.0, 0.0);
    var plain = array<f32, 4>(0.0, 0.0, 0.0, 0.0);
    var total = 0.0;
    var plain_total = 0.0;
    for (var i = 0; i < found.count; i++) {
        let site = site_of(found.entry[i]);
        let facing = fourth(max(dot(p.surface.flat_normal, site.normal), 0.0));
        let leaning = fourth(max(dot(p.surface.normal, site.normal_shading), 0.0));
        let off = dot(p.surface.flat_normal, site.position - p.surface.position) / texel;
        plain[i] = found.weight[i];
        near[i] = found.weight[i] * facing * facing * leaning / (1.0 + off * off);
        total += near[i];
        plain_total += plain[i];
    }
    var kept = 0;
    for (var i = 0; i < found.count; i++) {
        // Where none is like the place, any is better than darkness.
        near[i] = select(plain[i] / max(plain_total, SMALLEST), near[i] / max(total, SMALLEST), total > 1e-4 * plain_total);
        if near[i] > 1e-3 {
            kept++;
        } else {
            near[i] = 0.0;
        }
    }

    let each_apart = (params.flags & CONE_EACH_APART) != 0u || kept == 1 || is_smooth(p);
    let is_ratio = (params.flags & CONE_IS_RATIO) != 0u;
    let widest = widest_part(p);
    var lit = Lit(vec3(0.0), vec3(0.0), vec3(0.0));
    // As many as four entries have cones.
    var parts: array<Seen, 16>;
    var used = 0;
    var mean = vec3(0.0);
    var heaviest = -1;
    var most = 0.0;
    var most_irradiance = vec3(0.0);
    for (var i = 0; i < found.count; i++) {
        if near[i] == 0.0 {
            continue;
        }
        let site = site_of(found.entry[i]);
        var irradiance = vec3(0.0);
        for (var k = 0; k < site.cones; k++) {
            var cone = cone_of(found.entry[i], k);
            let share = shape_share(cone, widest);
            if share > 0.0 {
                var at = 0;
                while at < used && parts[at].slot != cone.slot {
                    at++;
                }
                if at == used {
                    parts[at] = Seen(cone.slot, 0.0, 0.0, -1, vec3(0.0), 0.0);
                    used++;
                }
                let weight = near[i] * share;
                parts[at].fraction += weight * cone.fraction;
                // Entries that see little of the light tell little of where that lies.
                let fluence = weight * luminance(cone.energy) / cone.mean_cosine;
                parts[at].fluence += fluence;
                parts[at].moment += cone.direction * (fluence * 0.5 * (1.0 + cone.cos_angle));
                if parts[at].teller != i {
                    parts[at].teller = i;
                    parts[at].told += weight;
                }
            }
            if share >= 1.0 {
                continue;
            }
            cone.energy *= 1.0 - share;
            if is_smooth(p) && is_ratio && cone.several != 0u && directions_of(p, cone) > 1 {
                lit = lit_by_several(p, lit, cone, site, near[i]);
            } else if each_apart {
                lit = lit_by(p, lit, cone, site, near[i]);
            } else {
                let cosine = max(dot(p.surface.normal, cone.direction), 0.0) * 0.5 * (1.0 + cone.cos_angle);
                irradiance += cone.energy * (cosine / cone.mean_cosine);
            }
        }
        let part = near[i] * luminance(irradiance);
        mean += irradiance * near[i];
        if part > most {
            most = part;
            most_irradiance = irradiance;
            heaviest = found.entry[i];
        }
    }
    if heaviest >= 0 {
        let site = site_of(heaviest);
        for (var k = 0; k < site.cones; k++) {
            var cone = cone_of(heaviest, k);
            let share = shape_share(cone, widest);
            if share < 1.0 {
                cone.energy *= 1.0 - share;
                lit = lit_by(p, lit, cone, site, 1.0);
            }
        }
    }
    var radiance = reflected_of(p, lit);
    if heaviest >= 0 {
        // Not more than four times of what the heaviest of four has, in any colour.
        radiance *= min(mean / max(most_irradiance, vec3(SMALLEST)), vec3(4.0));
    }
    for (var i = 0; i < used; i++) {
        radiance += reflected_of_light(p, parts[i]);
    }
    return radiance;
}

// By the light's own shape, as much as is seen of it.
fn reflected_of_light(p: ConePoint, seen: Seen) -> vec3<f32> {
    let arrived = area_arrival(seen.slot, p.surface.position, p.surface.normal);
    if all(arrived.irradiance <= vec3(0.0)) {
        return vec3(0.0);
    }
    var direction = arrived.direction;
    var cos_angle = arrived.cos_angle;
    let size = length(seen.moment);
    if size > 0.0 && seen.fraction < WHOLE * seen.told {
        direction = seen.moment / size;
        cos_angle = clamp(2.0 * size / seen.fluence - 1.0, -1.0, 1.0);
    }
    let reflected = area_gloss(p.reflectance, p.surface, direction, cos_angle, p.has_gloss);
    return arrived.irradiance * reflected * seen.fraction;
}

// One triangle over the whole picture.
@vertex
fn cone_vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    let corner = vec2(f32((index << 1u) & 2u), f32(index & 2u));
    return vec4(corner * 2.0 - 1.0, 0.0, 1.0);
}

// Layers of `samples`, as `samples.rs` writes them.
@fragment
fn cone_fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    // A band of the picture has its samples to itself.
    let at = vec2<i32>(position.xy) - vec2(0, params.first_row);
    let normal = textureLoad(samples, at, 1, 0);
    // Whether there is a surface, whether it has a place in the charts, and whether it has gloss.
    let kind = normal.w;
    if (kind & 1u) == 0u {
        return vec4(0.0);
    }
    let emitted = textureLoad(samples, at, 5, 0);
    var radiance = bitcast<vec3<f32>>(emitted.xyz);
    if (kind & 2u) != 0u {
        let located = textureLoad(samples, at, 0, 0);
        let shading = textureLoad(samples, at, 2, 0);
        let viewer = textureLoad(samples, at, 3, 0);
        let diffuse = textureLoad(samples, at, 4, 0);
        let chart = textureLoad(samples, at, 6, 0);
        let texels = textureLoad(samples, at, 7, 0);
        let f0 = bitcast<vec3<f32>>(vec3(viewer.w, diffuse.w, emitted.w));
        let surface = AreaSurface(
            bitcast<vec3<f32>>(located.xyz),
            bitcast<vec3<f32>>(shading.xyz),
            bitcast<vec3<f32>>(normal.xyz),
            bitcast<vec3<f32>>(viewer.xyz),
        );
        let reflectance = Reflectance(bitcast<vec3<f32>>(diffuse.xyz), f0, bitcast<f32>(located.w));
        let footprint = bitcast<f32>(shading.w);
        let size = vec2<f32>(vec2(chart.z & 0xffffu, chart.z >> 16u));
        let uv = bitcast<vec2<f32>>(texels.xy);
        let place = Place(chart.x, chart.y, uv, bitcast<f32>(texels.z), size, i32(texels.w));
        radiance += reflected_of_cones(ConePoint(surface, reflectance, (kind & 4u) != 0u, footprint), place);
    }
    return vec4(radiance, 1.0);
}
