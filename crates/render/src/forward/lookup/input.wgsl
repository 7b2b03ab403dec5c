// What every look-up of visibility gets from the forward pass.

// A place on a surface. A file that is joined after this one defines
//
//     fn lookup_visibility(s: LookupInput) -> f32
//
// and returns 0 (blocked) … 1 (open). Calls are not in uniform control flow: sample by textureSampleLevel or textureLoad.
struct LookupInput {
    // At rest, metres, and the unit normal of the resting triangle on the viewer's side. Zero unless the look-up
    // asks for them (`Lookup::needs_rest`).
    position_rest: vec3<f32>,
    normal_rest: vec3<f32>,
    // As posed, metres, and the unit normal of the posed triangle on the viewer's side.
    position_world: vec3<f32>,
    normal_world: vec3<f32>,
    // Index of the instance in the scene.
    instance: u32,
    // Place in the atlas: x, y in texels and the layer (z ≥ 0); or nothing (z = −1, open); or the values themselves
    // (z = −2: x is the old one, y the new one).
    atlas: vec3<f32>,
    // From the old values (0) to the new ones (1).
    fade: f32,
    // Centre of the pixel in the picture, and the distance along the view axis, metres.
    pixel: vec2<f32>,
    distance: f32,
}
