// Small functions that several files use.

const FRAC_1_PI: f32 = 0.31830987;

// `v` at unit length, or `fallback` if it has none.
fn unit_or(v: vec3<f32>, fallback: vec3<f32>) -> vec3<f32> {
    let length_squared = dot(v, v);
    if length_squared > 0.0 {
        return v * inverseSqrt(length_squared);
    }
    return fallback;
}

// `normal` under a linear map given by rows: the inverse transpose up to a positive factor, mirrored back if it mirrors.
fn transform_normal(row_x: vec3<f32>, row_y: vec3<f32>, row_z: vec3<f32>, normal: vec3<f32>) -> vec3<f32> {
    // Cofactors of a matrix of rows are crosses of the rows.
    let cofactor_x = cross(row_y, row_z);
    let moved = vec3(dot(cofactor_x, normal), dot(cross(row_z, row_x), normal), dot(cross(row_x, row_y), normal));
    return select(moved, -moved, dot(row_x, cofactor_x) < 0.0);
}

fn fifth_power(x: f32) -> f32 {
    let x2 = x * x;
    return x2 * x2 * x;
}

// Unit vectors that with a unit axis make a frame ([Duff2017]). The twin is `points::orthonormal_basis`.
struct Basis {
    tangent: vec3<f32>,
    bitangent: vec3<f32>,
}

fn orthonormal_basis(axis: vec3<f32>) -> Basis {
    let sign = select(1.0, -1.0, axis.z < 0.0);
    let a = -1.0 / (sign + axis.z);
    let b = axis.x * axis.y * a;
    return Basis(
        vec3(1.0 + sign * axis.x * axis.x * a, sign * b, -sign * axis.x),
        vec3(b, sign + axis.y * axis.y * a, -axis.y),
    );
}
