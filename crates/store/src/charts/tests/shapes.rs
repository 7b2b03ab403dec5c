//! Meshes that tests are made of.

use glam::{Quat, Vec3};

/// A mesh: positions and triangles.
pub(super) type Shape = (Vec<Vec3>, Vec<[u32; 3]>);

/// A surface over `columns` × `rows` quads; `place(u, v)` with u, v in 0 … 1.
pub(super) fn sheet(columns: u32, rows: u32, place: impl Fn(f32, f32) -> Vec3) -> Shape {
    let mut positions = Vec::new();
    for j in 0..=rows {
        for i in 0..=columns {
            positions.push(place(i as f32 / columns as f32, j as f32 / rows as f32));
        }
    }
    let mut triangles = Vec::new();
    for j in 0..rows {
        for i in 0..columns {
            let a = j * (columns + 1) + i;
            let (b, c, d) = (a + 1, a + columns + 1, a + columns + 2);
            triangles.extend([[a, b, c], [b, d, c]]);
        }
    }
    (positions, triangles)
}

/// A level square with its corner at the origin.
pub(super) fn floor(side_m: f32, quads: u32) -> Shape {
    sheet(quads, quads, |u, v| Vec3::new(u * side_m, 0.0, -v * side_m))
}

/// The eight corners and twelve triangles of a cube.
pub(super) fn cube(side_m: f32) -> Shape {
    let positions =
        (0..8u32).map(|i| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2) as f32) * side_m).collect();
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    (positions, triangles)
}

/// A ball; its poles and its seam are vertices at equal places.
pub(super) fn ball(radius_m: f32, quads: u32) -> Shape {
    sheet(2 * quads, quads, |u, v| {
        let ring = Quat::from_rotation_y(u * std::f32::consts::TAU) * Vec3::X;
        let height = (v - 0.5) * std::f32::consts::PI;
        (ring * height.cos() + Vec3::Y * height.sin()) * radius_m
    })
}

/// A ring.
pub(super) fn torus(radius_m: f32, tube_m: f32, quads: u32) -> Shape {
    sheet(2 * quads, quads, |u, v| {
        let tube = Quat::from_rotation_z(v * std::f32::consts::TAU) * Vec3::X * tube_m;
        Quat::from_rotation_y(u * std::f32::consts::TAU) * (Vec3::X * radius_m + tube)
    })
}

/// A spiral ramp of several turns, seen from above as one ring over the other.
pub(super) fn helix(turns: f32, pitch_m: f32, width_m: f32, quads: u32) -> Shape {
    sheet(quads, 2, |u, v| {
        let out = Quat::from_rotation_y(u * turns * std::f32::consts::TAU) * Vec3::X;
        out * (1.0 + v * width_m) + Vec3::Y * (u * turns * pitch_m)
    })
}

/// A Moebius strip: its two ends meet turned over.
pub(super) fn moebius(width_m: f32, quads: u32) -> Shape {
    sheet(quads, 2, |u, v| {
        let tilt = Quat::from_rotation_z(u * std::f32::consts::PI) * Vec3::X * ((v - 0.5) * width_m);
        Quat::from_rotation_y(u * std::f32::consts::TAU) * (Vec3::X + tilt)
    })
}

/// A number in 0 … 1 from a seed and an index.
pub(super) fn random(seed: u64, index: u64) -> f32 {
    let mut z =
        seed.wrapping_add(index.wrapping_mul(0x9e37_79b9_7f4a_7c15)).wrapping_add(0x1234_5678_9abc_def1);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 40) as f32 / (1u64 << 24) as f32
}
