//! Smooth skins over rings: limbs, bodies, hulls.

use glam::{Vec2, Vec3};

use super::Geometry;
use super::organic::smooth_normals;
use super::swept::unit_circle;

/// A place along a loft: the ring's centre and its half width and half depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Girth {
    /// Centre of the ring.
    pub center: Vec3,
    /// Half extents along the ring's axes.
    pub half: Vec2,
}

/// A skin over rings of equally many points (at least three), smooth throughout, closed at both ends by a fan around the
/// ring's mean. Rings turn right-handed about the way from the first to the last.
pub fn loft(rings: &[Vec<Vec3>]) -> Geometry {
    let mut g = Geometry::new();
    let n = rings.iter().map(Vec::len).min().unwrap_or(0);
    if n < 3 || rings.len() < 2 {
        return g;
    }
    // First without a seam, so that normals are smooth across it.
    let mut positions: Vec<Vec3> = rings.iter().flat_map(|r| r[..n].iter().copied()).collect();
    let at = |i: usize, j: usize| (i * n + j % n) as u32;
    let mut quads = Vec::new();
    for i in 0..rings.len() - 1 {
        for j in 0..n {
            quads.push([at(i, j), at(i, j + 1), at(i + 1, j + 1)]);
            quads.push([at(i, j), at(i + 1, j + 1), at(i + 1, j)]);
        }
    }
    let last = rings.len() - 1;
    let mut caps = Vec::new();
    for (ring, flipped) in [(0, true), (last, false)] {
        let mean = rings[ring][..n].iter().sum::<Vec3>() / n as f32;
        let pole = positions.len() as u32;
        positions.push(mean);
        for j in 0..n {
            let (a, b) = (at(ring, j), at(ring, j + 1));
            caps.push(if flipped { [pole, b, a] } else { [pole, a, b] });
        }
    }
    let welded: Vec<[u32; 3]> = quads.iter().chain(&caps).copied().collect();
    let normals = smooth_normals(&positions, &welded);
    // Then with one: texture coordinates start anew where the ring closes.
    let mut way = 0.0;
    for (i, ring) in rings.iter().enumerate() {
        way += if i > 0 { rings[i - 1][0].distance(ring[0]) } else { 0.0 };
        let mut around = 0.0;
        for j in 0..=n {
            around += if j > 0 { ring[j - 1].distance(ring[j % n]) } else { 0.0 };
            let v = at(i, j) as usize;
            g.vertex(positions[v], normals[v], Vec2::new(around, -way));
        }
    }
    let seamed = |i: usize, j: usize| (i * (n + 1) + j) as u32;
    for i in 0..last {
        for j in 0..n {
            g.triangles.push([seamed(i, j), seamed(i, j + 1), seamed(i + 1, j + 1)]);
            g.triangles.push([seamed(i, j), seamed(i + 1, j + 1), seamed(i + 1, j)]);
        }
    }
    for (ring, pole) in [(0, positions.len() - 2), (last, positions.len() - 1)] {
        let center = g.vertex(positions[pole], normals[pole], Vec2::ZERO);
        for j in 0..n {
            let (a, b) = (seamed(ring, j), seamed(ring, j + 1));
            g.triangles.push(if ring == 0 { [center, b, a] } else { [center, a, b] });
        }
    }
    g
}

/// The points of an oval ring, right-handed about `x × y`. `power` 2 is an ellipse, more is squarer.
pub fn oval(girth: Girth, [x, y]: [Vec3; 2], power: f32, points: u32) -> Vec<Vec3> {
    let n = points.max(3);
    (0..n)
        .map(|j| {
            let d = unit_circle(j, n);
            let reach = |c: f32| libm::powf(c.abs(), 2.0 / power).copysign(c);
            girth.center + x * (girth.half.x * reach(d.x)) + y * (girth.half.y * reach(d.y))
        })
        .collect()
}

/// `count ≥ 2` girths along the smooth curve (Catmull-Rom) through some, which are evenly far apart in parameter;
/// the outer ones are kept.
pub fn between(girths: &[Girth], count: u32) -> Vec<Girth> {
    let last = girths.len().saturating_sub(1);
    let at = |i: i64| girths[i.clamp(0, last as i64) as usize];
    (0..count.max(2))
        .map(|k| {
            let s = last as f32 * k as f32 / (count.max(2) - 1) as f32;
            let i = (s as i64).min(last as i64 - 1);
            let t = s - i as f32;
            let [a, b, c, d] = [at(i - 1), at(i), at(i + 1), at(i + 2)];
            let (t2, t3) = (t * t, t * t * t);
            let w = [
                0.5 * (2.0 * t2 - t - t3),
                0.5 * (2.0 - 5.0 * t2 + 3.0 * t3),
                0.5 * (t + 4.0 * t2 - 3.0 * t3),
                0.5 * (t3 - t2),
            ];
            let center = a.center * w[0] + b.center * w[1] + c.center * w[2] + d.center * w[3];
            let half = a.half * w[0] + b.half * w[1] + c.half * w[2] + d.half * w[3];
            Girth { center, half: half.max(Vec2::splat(0.002)) }
        })
        .collect()
}
