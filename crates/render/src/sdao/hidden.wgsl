// Hidden surfaces under a sample. The twin is `sdao::hidden`.

// Four distances a texel; BACKGROUND_M where there is none.
@group(1) @binding(2) var hidden: texture_2d_array<f32>;

// `Looks`: everywhere, where the first surface is too far away to count, where it rises over the plane.
const LOOKS_EVERYWHERE: u32 = 0u;
const LOOKS_WHERE_FIRST_IS_FAR: u32 = 1u;

// Whether the ray that goes to a place falls in front of its plane with a normal.
fn falls_on(place: vec3<f32>, normal: vec3<f32>) -> bool {
    return select(dot(normal, place) <= 0.0, normal.z >= 0.0, screen.is_parallel != 0u);
}
