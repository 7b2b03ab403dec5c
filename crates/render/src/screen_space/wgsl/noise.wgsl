// Numbers that differ from sample to sample. The twin is `noise`.

// AlchemyAO's hash ([McGuire2012] eq. 8) as a part of a turn, 0 … 1. Byte by byte, since a float does not hold all of it.
fn alchemy_turn(at: vec2<i32>) -> f32 {
    let x = u32(at.x);
    let y = u32(at.y);
    let hash = ((x * 3u) ^ (y + x * y)) * 10u;
    let bytes = vec4<f32>(vec4(hash, hash >> 8u, hash >> 16u, hash >> 24u) & vec4(255u));
    // 256 to 0, 1, 2, 3 in turns: what is left of whole ones.
    return fract(dot(bytes, vec4(0.15915494, 0.74366543, 0.37835047, 0.85772044)));
}

// Interleaved gradient noise, 0 … 1. Of columns and rows by 64, since of large products a float keeps little.
fn interleaved_gradient(at: vec2<i32>) -> f32 {
    let fine = vec2<f32>(at & vec2(63));
    let coarse = vec2<f32>(at >> vec2(6u));
    let inner = dot(fine, vec2(0.06711056, 0.00583715)) + dot(coarse, vec2(0.29507584, 0.3735776));
    return fract(52.9829189 * fract(inner));
}
