// Visibility from what a screen-space method has made of the picture.

@group(3) @binding(0) var screen_visibility: texture_2d<f32>;

// Distances of one surface differ by no more than this part: sixteen bits, and what lies between a pixel's samples.
const SAME_SURFACE: f32 = 0.004;
// A neighbour that is farther away than this part speaks for another surface.
const NEAR_SURFACE: f32 = 0.05;

fn lookup_visibility(s: LookupInput) -> f32 {
    let last = vec2<i32>(textureDimensions(screen_visibility)) - 1;
    let at = clamp(vec2<i32>(s.pixel), vec2(0), last);
    let own = textureLoad(screen_visibility, at, 0).rg;
    if abs(own.y - s.distance) <= SAME_SURFACE * abs(s.distance) {
        return own.x;
    }
    // At an edge the pixel's middle shows another surface: the neighbour that is nearest to this one speaks for it.
    var best = vec2(own.x, abs(own.y - s.distance));
    for (var i = 0; i < 9; i++) {
        let texel = textureLoad(screen_visibility, clamp(at + vec2(i % 3 - 1, i / 3 - 1), vec2(0), last), 0).rg;
        let off = abs(texel.y - s.distance);
        if off < best.y {
            best = vec2(texel.x, off);
        }
    }
    // What is none of them, as glass before a wall, has no value.
    return select(1.0, best.x, best.y <= NEAR_SURFACE * abs(s.distance));
}
