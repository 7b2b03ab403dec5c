// What arrives of one area light at one place with nothing in the way. The twin is `area_lights/arrival.rs`, whose constants these are.

const AREA_FAR_RADII: f32 = 20.0;
const AREA_IN_PLANE_RADII: f32 = 1e-6;
const AREA_NARROW_SINE: f32 = 0.2;
const AREA_PI: f32 = 3.1415927;

// Texels of a row of the table: `table.rs`.
const AREA_DISC_M2: i32 = 3;
const AREA_FIRST_CORNER: i32 = 4;
const AREA_FIRST_PLACE: i32 = 4;
const AREA_SPHERE: i32 = 1;
const AREA_DISC: i32 = 2;
const AREA_QUAD: i32 = 3;
const AREA_TRIANGLES: i32 = 4;
const AREA_PLACES: i32 = 5;
const AREA_FORMS: i32 = 8;

// Light as a cone; nothing arrives where it is black.
struct AreaArrival {
    irradiance: vec3<f32>,
    // Unit axis.
    direction: vec3<f32>,
    cos_angle: f32,
}

// Beside it lies the light's class.
fn area_form(shine: vec4<f32>) -> i32 {
    return i32(shine.w) % AREA_FORMS;
}

fn area_texel(slot: i32, texel: i32) -> vec4<f32> {
    return textureLoad(area_table, vec2(texel, slot), 0);
}

fn area_arrival(slot: i32, position: vec3<f32>, normal: vec3<f32>) -> AreaArrival {
    let nothing = AreaArrival(vec3(0.0), normal, 1.0);
    // A ball that holds it; what it is and how much it shines; where it faces.
    let ball = area_texel(slot, 0);
    let shine = area_texel(slot, 1);
    let form = area_form(shine);
    let offset = ball.xyz - position;
    // A ball below the horizon.
    if form == 0 || dot(normal, offset) <= -ball.w {
        return nothing;
    }
    let facing = area_texel(slot, 2);
    let two_sided = facing.w != 0.0;
    if form == AREA_TRIANGLES {
        return area_from_triangles(slot, i32(facing.x), ball.w, two_sided, position, normal);
    }
    if form == AREA_PLACES {
        return area_from_places(slot, i32(facing.x), facing.y != 0.0, two_sided, position, normal, shine.xyz);
    }
    var vector: vec3<f32>;
    if form == AREA_SPHERE {
        let distance_squared = dot(offset, offset);
        let radius_squared = ball.w * ball.w;
        // Nothing is seen from inside.
        if distance_squared <= radius_squared * 1.000001 {
            return nothing;
        }
        vector = offset * (AREA_PI * radius_squared / (distance_squared * sqrt(distance_squared)));
    } else {
        var height = -dot(facing.xyz, offset);
        if form == AREA_QUAD {
            height = dot(facing.xyz, position - area_texel(slot, AREA_FIRST_CORNER).xyz);
        }
        var front = facing.xyz;
        if height < 0.0 && two_sided {
            height = -height;
            front = -front;
        }
        // Behind it, or in its plane.
        if height <= AREA_IN_PLANE_RADII * ball.w {
            return nothing;
        }
        if form == AREA_DISC {
            vector = area_disc(-offset, height, front, ball.w);
        } else {
            vector = area_quad(slot, ball, position, height, front);
        }
    }
    // The cone of the light's own radiance that has this vector.
    let length_squared = dot(vector, vector);
    if length_squared <= 0.0 {
        return nothing;
    }
    let vector_length = sqrt(length_squared);
    let sin2 = min(vector_length * FRAC_1_PI, 1.0);
    let axis = vector / vector_length;
    let cosine = dot(normal, axis);
    let form_factor = area_above_horizon(cosine, sin2);
    if form_factor <= 0.0 {
        return nothing;
    }
    let left = area_raised(axis, normal, cosine, sin2);
    return AreaArrival(shine.xyz * (AREA_PI * form_factor), left.xyz, sqrt(max(1.0 - left.w, 0.0)));
}

// The vectors of forms are integrals of directions over what a light fills of all directions.

fn area_disc(from_center: vec3<f32>, height: f32, normal: vec3<f32>, radius: f32) -> vec3<f32> {
    let across = from_center - normal * height;
    let aside = length(across);
    let h2 = height * height;
    let r2 = radius * radius;
    let near = aside - radius;
    let far = aside + radius;
    // Product of the distances to the nearest and the farthest place of the rim.
    let rim = sqrt((near * near + h2) * (far * far + h2));
    let q = h2 + aside * aside;
    var facing = 0.5 * (1.0 + (r2 - q) / rim);
    if q > r2 {
        facing = 2.0 * r2 * h2 / (rim * (rim + q - r2));
    }
    let inwards = 2.0 * height * r2 / (rim * (q + r2 + rim));
    return (normal * facing + across * inwards) * -AREA_PI;
}

fn area_quad(slot: i32, ball: vec4<f32>, position: vec3<f32>, height: f32, normal: vec3<f32>) -> vec3<f32> {
    let a = area_texel(slot, AREA_FIRST_CORNER).xyz - position;
    let b = area_texel(slot, AREA_FIRST_CORNER + 1).xyz - position;
    let c = area_texel(slot, AREA_FIRST_CORNER + 2).xyz - position;
    let d = area_texel(slot, AREA_FIRST_CORNER + 3).xyz - position;
    let offset = ball.xyz - position;
    let distance_squared = dot(offset, offset);
    if distance_squared > AREA_FAR_RADII * AREA_FAR_RADII * ball.w * ball.w {
        let area = 0.5 * length(cross(c - a, d - b));
        return offset * (area * height / (distance_squared * distance_squared));
    }
    let p = area_corner(a);
    let q = area_corner(b);
    let r = area_corner(c);
    let s = area_corner(d);
    let vector = (area_edge(p, q) + area_edge(q, r) + area_edge(r, s) + area_edge(s, p)) * 0.5;
    // Corners may turn either way.
    return select(vector, -vector, dot(vector, normal) > 0.0);
}

// Corners, with their lengths.
fn area_edge(a: vec4<f32>, b: vec4<f32>) -> vec3<f32> {
    let both = max(a.w * b.w, 1e-30);
    let cosine = clamp(dot(a.xyz, b.xyz) / both, -1.0, 1.0);
    return cross(a.xyz, b.xyz - a.xyz) * (area_angle_over_sine(cosine) / both);
}

fn area_corner(offset: vec3<f32>) -> vec4<f32> {
    return vec4(offset, length(offset));
}

fn area_angle_over_sine(cosine: f32) -> f32 {
    let x = abs(cosine);
    var p = -0.0012624911 * x + 0.00667009;
    p = p * x - 0.017088126;
    p = p * x + 0.03089188;
    p = p * x - 0.050174305;
    p = p * x + 0.08897899;
    p = p * x - 0.2145988;
    p = (p * x + 1.5707963) / sqrt(1.0 + x);
    return select(AREA_PI / sqrt(max((1.0 - x) * (1.0 + x), 1e-8)) - p, p, cosine >= 0.0);
}

// Form factor of what lies above the horizon of a cone whose axis has that cosine and whose angle has that squared sine.
fn area_above_horizon(cosine: f32, sin2: f32) -> f32 {
    let sine = sqrt(sin2);
    if cosine >= sine {
        return cosine * sin2;
    }
    if cosine <= -sine {
        return 0.0;
    }
    if sine < AREA_NARROW_SINE {
        let q = clamp(cosine / sine, -1.0, 1.0);
        let root = sqrt(max(1.0 - q * q, 0.0));
        return sin2 * sine * FRAC_1_PI * (q * acos(-q) + root * (2.0 + q * q) * (1.0 / 3.0));
    }
    let cos_angle = sqrt(max(1.0 - sin2, 0.0));
    let level = sqrt(max(1.0 - cosine * cosine, 1e-12));
    // Turn about the axis at which the rim meets the horizon.
    let cos_turn = clamp(-cos_angle * cosine / (sine * level), -1.0, 1.0);
    let across = level * sqrt(max(1.0 - cos_turn * cos_turn, 0.0));
    let rim = sin2 * cosine * acos(cos_turn) - sine * cos_angle * across;
    return FRAC_1_PI * max(rim + atan2(sine * across, cos_angle), 0.0);
}

// Axis and squared sine of the cone that is left above the horizon.
fn area_raised(axis: vec3<f32>, normal: vec3<f32>, cosine: f32, sin2: f32) -> vec4<f32> {
    let sine = sqrt(sin2);
    if cosine >= sine {
        return vec4(axis, sin2);
    }
    let half_height = 0.5 * max(cosine + sine, 0.0);
    return vec4(unit_or(axis + normal * (half_height - cosine), normal), sine * half_height);
}

// Sum of what comes from parts of a light, each of which is a small cone.
struct AreaGathered {
    irradiance: vec3<f32>,
    vector: vec3<f32>,
    fluence: f32,
    // Irradiance of unit radiance.
    form_factor: f32,
}

// With a part; by its axis and the squared sine of its cone's angle.
fn area_add(before: AreaGathered, normal: vec3<f32>, axis: vec3<f32>, sin2: f32, radiance: vec3<f32>) -> AreaGathered {
    let cosine = dot(normal, axis);
    let form_factor = area_above_horizon(cosine, sin2);
    if form_factor <= 0.0 {
        return before;
    }
    var sum = before;
    sum.irradiance += radiance * (AREA_PI * form_factor);
    sum.form_factor += form_factor;
    // A part at the horizon is there by what is above.
    let sine = sqrt(sin2);
    var above = 1.0;
    if cosine < sine {
        above = 0.5 * (cosine + sine) / sine;
    }
    let share = dot(radiance, vec3(0.2126, 0.7152, 0.0722)) * above * sin2;
    sum.vector += area_raised(axis, normal, cosine, sin2).xyz * share;
    // Solid angle over π, without cancellation where it is small.
    sum.fluence += share * 2.0 / (1.0 + sqrt(max(1.0 - sin2, 0.0)));
    return sum;
}

fn area_sum(sum: AreaGathered, normal: vec3<f32>) -> AreaArrival {
    let vector_length = length(sum.vector);
    if vector_length <= 0.0 {
        return AreaArrival(vec3(0.0), normal, 1.0);
    }
    let cos_angle = clamp(2.0 * vector_length / sum.fluence - 1.0, -1.0, 1.0);
    // Parts that overlap are no more than light from all sides.
    return AreaArrival(sum.irradiance / max(sum.form_factor, 1.0), sum.vector / vector_length, cos_angle);
}

fn area_from_triangles(
    slot: i32,
    count: i32,
    radius: f32,
    two_sided: bool,
    position: vec3<f32>,
    normal: vec3<f32>,
) -> AreaArrival {
    var sum = AreaGathered(vec3(0.0), vec3(0.0), 0.0, 0.0);
    for (var i = 0; i < count; i++) {
        let texel = AREA_FIRST_PLACE + 3 * i;
        // Corners, with one colour of the radiance each.
        let first = area_texel(slot, texel);
        let second = area_texel(slot, texel + 1);
        let third = area_texel(slot, texel + 2);
        let a = first.xyz - position;
        let b = second.xyz - position;
        let c = third.xyz - position;
        let across = cross(b - a, c - a);
        let facing = -dot(across, a);
        if (facing <= 0.0 && !two_sided) || abs(facing) <= AREA_IN_PLANE_RADII * radius * length(across) {
            continue;
        }
        let p = area_corner(a);
        let q = area_corner(b);
        let r = area_corner(c);
        // Seen from the front, corners turn against the view.
        let vector = (area_edge(p, q) + area_edge(q, r) + area_edge(r, p)) * select(0.5, -0.5, facing > 0.0);
        let vector_length = length(vector);
        if vector_length <= 0.0 {
            continue;
        }
        let radiance = vec3(first.w, second.w, third.w);
        sum = area_add(sum, normal, vector / vector_length, min(vector_length * FRAC_1_PI, 1.0), radiance);
    }
    return area_sum(sum, normal);
}

fn area_from_places(
    slot: i32,
    count: i32,
    is_even: bool,
    two_sided: bool,
    position: vec3<f32>,
    normal: vec3<f32>,
    mean_radiance: vec3<f32>,
) -> AreaArrival {
    var sum = AreaGathered(vec3(0.0), vec3(0.0), 0.0, 0.0);
    for (var i = 0; i < count; i++) {
        let texel = AREA_FIRST_PLACE + 3 * i;
        // Place and area; its normal; its radiance, unless all shine alike.
        let place = area_texel(slot, texel);
        let offset = place.xyz - position;
        let distance_squared = dot(offset, offset);
        if distance_squared == 0.0 {
            continue;
        }
        let axis = offset * inverseSqrt(distance_squared);
        var facing = -dot(area_texel(slot, texel + 1).xyz, axis);
        if two_sided {
            facing = abs(facing);
        }
        if facing <= 0.0 {
            continue;
        }
        // Area × cosine / distance², but never more than all that a plane can fill.
        let own = place.w * FRAC_1_PI;
        let sin2 = own * facing / sqrt(distance_squared * distance_squared + own * own);
        var radiance = mean_radiance;
        if !is_even {
            radiance = area_texel(slot, texel + 2).xyz;
        }
        sum = area_add(sum, normal, axis, sin2, radiance);
    }
    return area_sum(sum, normal);
}
