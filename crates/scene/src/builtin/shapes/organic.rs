//! Cloth and boulders.

use std::collections::BTreeMap;

use glam::{Vec2, Vec3};

use super::Geometry;
use crate::builtin::noise::{fractal_noise, value_noise};

/// A hanging sheet: `width` along X, from y = 0 down to −`height`, with `folds` sine folds up to `depth` metres deep
/// towards +Z, tighter at the top. One layer, front towards +Z: give it a double-sided material.
pub fn cloth(width: f32, height: f32, folds: f32, depth: f32, [nx, ny]: [u32; 2], seed: u32) -> Geometry {
    let (nx, ny) = (nx.max(4), ny.max(2));
    let surface = |s: f32, t: f32| {
        // The hem spreads a little, and folds wander as they fall.
        let spread = 0.93 + 0.07 * t;
        let wander = 0.45 * value_noise(seed, Vec3::new(3.0 * s, 1.7 * t, 0.5));
        let phase = std::f32::consts::TAU * (folds * s + wander * (0.3 + t));
        let amplitude = 0.5
            * depth
            * (0.55 + 0.45 * t)
            * (1.0 + 0.35 * value_noise(seed ^ 77, Vec3::new(5.0 * s, t, 0.0)));
        let sway = 0.06 * depth * value_noise(seed ^ 5, Vec3::new(2.0 * s, 4.0 * t, 2.0));
        let z = amplitude * libm::sinf(phase) + sway;
        Vec3::new(width * (s - 0.5) * spread, -height * t, z)
    };
    let mut g = Geometry::new();
    for j in 0..=ny {
        for i in 0..=nx {
            let (s, t) = (i as f32 / nx as f32, j as f32 / ny as f32);
            g.vertex(surface(s, t), Vec3::Z, Vec2::new(width * s, height * t));
        }
    }
    for j in 0..ny {
        for i in 0..nx {
            let a = j * (nx + 1) + i;
            let (b, c, d) = (a + 1, a + nx + 2, a + nx + 1);
            g.triangles.push([a, d, c]);
            g.triangles.push([a, c, b]);
        }
    }
    g.normals = smooth_normals(&g.positions, &g.triangles);
    g
}

/// Normals of vertices as the sum of the areas around them.
pub(super) fn smooth_normals(positions: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Vec3> {
    let mut normals = vec![Vec3::ZERO; positions.len()];
    for t in triangles {
        let [a, b, c] = t.map(|i| positions[i as usize]);
        let n = (b - a).cross(c - a);
        for &i in t {
            normals[i as usize] += n;
        }
    }
    normals.into_iter().map(|n| n.normalize_or(Vec3::Z)).collect()
}

/// A rounded boulder of mean radius 1 about the origin: an icosphere of `20 · 4^level` triangles, displaced by noise.
/// Closed, smooth. Equal seeds give the same rock at every level.
pub fn boulder(level: u32, seed: u32) -> Geometry {
    let (directions, triangles) = icosphere(level);
    let positions: Vec<Vec3> = directions.iter().map(|&d| d * boulder_radius(seed, d)).collect();
    let normals = smooth_normals(&positions, &triangles);
    let uvs = positions.iter().map(|p| Vec2::new(p.x, -p.y)).collect();
    Geometry { positions, normals, uvs, triangles }
}

/// A ball of radius 1 about the origin: an icosphere of `20 · 4^level` triangles, its vertices on the sphere. Closed, smooth.
pub fn ball(level: u32) -> Geometry {
    let (directions, triangles) = icosphere(level);
    let uvs = directions.iter().map(|p| Vec2::new(p.x, -p.y)).collect();
    Geometry { normals: directions.clone(), positions: directions, uvs, triangles }
}

/// Points on the surface of [`boulder`] at a level, for a hull.
pub fn boulder_points(level: u32, seed: u32) -> Vec<Vec3> {
    icosphere(level).0.iter().map(|&d| d * boulder_radius(seed, d)).collect()
}

fn boulder_radius(seed: u32, direction: Vec3) -> f32 {
    let lumps = value_noise(seed, direction * 1.3 + Vec3::splat(11.0));
    let grain = fractal_noise(seed ^ 0x51, direction * 5.0 + Vec3::splat(7.0), 3);
    1.0 + 0.10 * lumps + 0.022 * grain
}

fn icosphere(level: u32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let phi = 0.5 * (1.0 + libm::sqrtf(5.0));
    let mut points: Vec<Vec3> = Vec::new();
    for (a, b) in [(-1.0, phi), (1.0, phi), (-1.0, -phi), (1.0, -phi)] {
        points.push(Vec3::new(a, b, 0.0).normalize());
    }
    for (a, b) in [(-1.0, phi), (1.0, phi), (-1.0, -phi), (1.0, -phi)] {
        points.push(Vec3::new(0.0, a, b).normalize());
    }
    for (a, b) in [(phi, -1.0), (phi, 1.0), (-phi, -1.0), (-phi, 1.0)] {
        points.push(Vec3::new(a, 0.0, b).normalize());
    }
    let mut triangles: Vec<[u32; 3]> = vec![
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    for _ in 0..level.min(7) {
        let mut middles: BTreeMap<(u32, u32), u32> = BTreeMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                points.push((points[a as usize] + points[b as usize]).normalize());
                points.len() as u32 - 1
            })
        };
        triangles = triangles
            .iter()
            .flat_map(|&[a, b, c]| {
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
            })
            .collect();
    }
    (points, triangles)
}
