// glTF's metallic-roughness reflectance ([glTF2.0] appendix B.3). The twin is `shade::brdf`.

const DIELECTRIC_F0: f32 = 0.04;
const SMALLEST_ALPHA: f32 = 2e-3;

fn reflectance(base_color: vec3<f32>, metallic: f32, roughness: f32) -> Reflectance {
    return Reflectance(
        base_color * (1.0 - metallic),
        mix(vec3(DIELECTRIC_F0), base_color, metallic),
        max(roughness * roughness, SMALLEST_ALPHA),
    );
}

// BRDF, 1/sr, for unit directions to the viewer and the light.
fn reflected(r: Reflectance, normal: vec3<f32>, to_viewer: vec3<f32>, to_light: vec3<f32>) -> vec3<f32> {
    if frame.specular == 0u {
        return r.diffuse * FRAC_1_PI;
    }
    let half = unit_or(to_viewer + to_light, vec3(0.0));
    let v_dot_h = clamp(dot(to_viewer, half), 0.0, 1.0);
    let n_dot_h = clamp(dot(normal, half), 0.0, 1.0);
    let n_dot_v = clamp(dot(normal, to_viewer), 1e-3, 1.0);
    let n_dot_l = clamp(dot(normal, to_light), 1e-3, 1.0);
    let fresnel = r.f0 + (1.0 - r.f0) * fifth_power(1.0 - v_dot_h);
    let specular = distribution(r.alpha, n_dot_h) * smith(r.alpha, n_dot_v, n_dot_l);
    return (1.0 - fresnel) * r.diffuse * FRAC_1_PI + fresnel * specular;
}

// D: GGX (Trowbridge–Reitz).
fn distribution(alpha: f32, n_dot_h: f32) -> f32 {
    let a2 = alpha * alpha;
    let f = (1.0 - n_dot_h) * (1.0 + n_dot_h) + n_dot_h * n_dot_h * a2;
    return a2 * FRAC_1_PI / (f * f);
}

// V = G / (4 n·l n·v): height-correlated Smith.
fn smith(alpha: f32, n_dot_v: f32, n_dot_l: f32) -> f32 {
    let a2 = alpha * alpha;
    let lambda_l = n_dot_l * sqrt(n_dot_v * n_dot_v * (1.0 - a2) + a2);
    let lambda_v = n_dot_v * sqrt(n_dot_l * n_dot_l * (1.0 - a2) + a2);
    return 0.5 / (lambda_l + lambda_v);
}

// Radiance reflected from the surroundings, unoccluded.
fn ambient_reflected(r: Reflectance, normal: vec3<f32>, to_viewer: vec3<f32>) -> vec3<f32> {
    let diffuse = r.diffuse * ambient_radiance(normal);
    if frame.specular == 0u {
        return diffuse;
    }
    let n_dot_v = clamp(dot(normal, to_viewer), 0.0, 1.0);
    let mirrored = normal * (2.0 * dot(normal, to_viewer)) - to_viewer;
    let grazing = max(vec3(1.0 - r.alpha), r.f0);
    let fresnel = r.f0 + (grazing - r.f0) * fifth_power(1.0 - n_dot_v);
    let gathered = unit_or(mix(mirrored, normal, min(r.alpha, 1.0)), normal);
    return (1.0 - fresnel) * diffuse + fresnel * ambient_radiance(gathered);
}

fn ambient_radiance(direction_world: vec3<f32>) -> vec3<f32> {
    return mix(frame.ambient_ground, frame.ambient_sky, 0.5 + 0.5 * direction_world.y);
}
