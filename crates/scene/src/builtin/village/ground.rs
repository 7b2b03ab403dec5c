//! The land: a block of earth with a relief, its top split into road and grass along the road's edge; the pond; rocks and tufts.

use std::collections::BTreeMap;
use std::f32::consts::TAU;

use glam::{Vec2, Vec3};

use super::plan::*;
use crate::builtin::Detail;
use crate::builtin::noise::unit;
use crate::builtin::shapes::Geometry;

/// How near to the road's edge a corner of the grid may lie; nearer ones are moved into the grass, so that no sliver is cut.
const SNAP: f32 = 0.05;

/// The ground's normal at a place.
fn normal(p: Vec2) -> Vec3 {
    const STEP: f32 = 0.15;
    let slope = |d: Vec2| (ground(p + d) - ground(p - d)) / (2.0 * STEP);
    Vec3::new(-slope(Vec2::X * STEP), 1.0, -slope(Vec2::Y * STEP)).normalize()
}

/// A corner of the grid or a point of the road's edge: its place, and how far off the road it is.
#[derive(Clone, Copy)]
struct Corner {
    position: Vec3,
    off: f32,
}

fn vertex(g: &mut Geometry, position: Vec3) -> u32 {
    let p = Vec2::new(position.x, position.z);
    g.vertex(position, normal(p), 0.5 * p)
}

/// Grass and road: together with [`block`] they are closed.
pub(super) fn surface(detail: Detail) -> [Geometry; 2] {
    let n = detail.facets(136, 40);
    let step = 2.0 * LAND / n as f32;
    let corner = |i: u32, j: u32| {
        let p = Vec2::new(-LAND + step * i as f32, -LAND + step * j as f32);
        let off = off_road(p);
        let off = if off.abs() < SNAP { SNAP } else { off };
        Corner { position: Vec3::new(p.x, ground(p), p.y), off }
    };
    let corners: Vec<Corner> = (0..=n).flat_map(|j| (0..=n).map(move |i| corner(i, j))).collect();
    let mut surfaces = [Geometry::new(), Geometry::new()];
    // Vertices by their bits, one table for grass and one for road.
    let mut known: [BTreeMap<[u32; 3], u32>; 2] = Default::default();
    let mut emit = |on_road: bool, polygon: &[Vec3]| {
        let side = usize::from(on_road);
        let g = &mut surfaces[side];
        let ids: Vec<u32> = polygon
            .iter()
            .map(|&p| *known[side].entry(p.to_array().map(f32::to_bits)).or_insert_with(|| vertex(g, p)))
            .collect();
        for i in 2..ids.len() {
            g.triangles.push([ids[0], ids[i - 1], ids[i]]);
        }
    };
    // Where the road's edge crosses from one corner to another: the same bits from both sides.
    let crossing = |a: usize, b: usize| {
        let (a, b) = (&corners[a.min(b)], &corners[a.max(b)]);
        a.position.lerp(b.position, a.off / (a.off - b.off))
    };
    for j in 0..n {
        for i in 0..n {
            let at = |di: u32, dj: u32| ((j + dj) * (n + 1) + i + di) as usize;
            let cells = match (i + j) % 2 {
                0 => [[at(0, 0), at(0, 1), at(1, 1)], [at(0, 0), at(1, 1), at(1, 0)]],
                _ => [[at(0, 0), at(0, 1), at(1, 0)], [at(1, 0), at(0, 1), at(1, 1)]],
            };
            for t in cells {
                let is_road = t.map(|v| corners[v].off < 0.0);
                for side in [false, true] {
                    let mut polygon = Vec::new();
                    for k in 0..3 {
                        let (a, b) = (k, (k + 1) % 3);
                        if is_road[a] == side {
                            polygon.push(corners[t[a]].position);
                        }
                        if is_road[a] != is_road[b] {
                            polygon.push(crossing(t[a], t[b]));
                        }
                    }
                    if polygon.len() > 2 {
                        emit(side, &polygon);
                    }
                }
            }
        }
    }
    surfaces
}

/// The block's sides and underside, below the open edges of [`surface`].
pub(super) fn block(surface: &[Geometry; 2]) -> Geometry {
    // The open edges of the top: those whose opposite is on neither side.
    let key = |p: Vec3| p.to_array().map(f32::to_bits);
    let mut open: BTreeMap<([u32; 3], [u32; 3]), (Vec3, Vec3)> = BTreeMap::new();
    for g in surface {
        for t in &g.triangles {
            let [a, b, c] = t.map(|i| g.positions[i as usize]);
            for (p, q) in [(a, b), (b, c), (c, a)] {
                if open.remove(&(key(q), key(p))).is_none() {
                    open.insert((key(p), key(q)), (p, q));
                }
            }
        }
    }
    let mut g = Geometry::new();
    let down = |p: Vec3| Vec3::new(p.x, BEDROCK, p.z);
    for (p, q) in open.into_values() {
        g.polygon(&[q, p, down(p), down(q)]);
        g.polygon(&[down(q), down(p), Vec3::Y * BEDROCK]);
    }
    g
}

/// The pond's water: a flat sheet a little larger than the hollow it fills.
pub(super) fn water(detail: Detail) -> Geometry {
    let ([x, z], [a, b], level) = POND;
    let n = detail.facets(64, 16);
    let rim: Vec<Vec3> = (0..n)
        .map(|i| {
            let (s, c) = libm::sincosf(TAU * i as f32 / n as f32);
            Vec3::new(x + 1.05 * a * c, level, z - 1.05 * b * s)
        })
        .collect();
    let mut g = Geometry::new();
    g.polygon(&rim);
    g
}

/// A patch of grass about its middle: blades that bend, each of two triangles, one layer.
pub(super) fn tuft(seed: u32, detail: Detail) -> Geometry {
    let mut g = Geometry::new();
    for i in 0..detail.count(96, 16) {
        let r = |k: u32| unit(seed, 8 * i + k);
        let (s, c) = libm::sincosf(TAU * r(0));
        let (out, side) = (Vec3::new(c, 0.0, s), Vec3::new(-s, 0.0, c));
        let (s, c) = libm::sincosf(TAU * r(1));
        let root = Vec3::new(c, 0.0, s) * (0.85 * libm::sqrtf(r(2))) - Vec3::Y * 0.05;
        let height = 0.16 + 0.26 * r(3);
        let middle = root + Vec3::Y * (0.6 * height) + out * (0.14 * height);
        let tip = root + Vec3::Y * height + out * (height * (0.3 + 0.5 * r(4)));
        let half = side * (0.008 + 0.008 * r(5));
        let first = g.positions.len() as u32;
        let n = (out * -0.5 + Vec3::Y).normalize();
        for (p, u) in [
            (root - half, 0.0),
            (root + half, 0.02),
            (middle + 0.8 * half, 0.02),
            (middle - 0.8 * half, 0.0),
            (tip, 0.01),
        ] {
            g.vertex(p, n, Vec2::new(u, -(p.y - root.y)));
        }
        for t in [[0, 1, 2], [0, 2, 3], [3, 2, 4]] {
            g.triangles.push(t.map(|v| first + v));
        }
    }
    // The way round in which normals and faces agree.
    for t in &mut g.triangles {
        let [a, b, c] = t.map(|v| g.positions[v as usize]);
        if (b - a).cross(c - a).dot(g.normals[t[0] as usize]) < 0.0 {
            t.swap(1, 2);
        }
    }
    g
}

/// Where tufts grow: place (x, z), turn, scale.
pub(super) fn tufts() -> Vec<([f32; 2], f32, f32)> {
    let mut placed = Vec::new();
    for i in 0..900 {
        let p = Vec2::new(unit(521, i) - 0.5, unit(522, i) - 0.5) * (2.0 * LAND - 14.0);
        let free = PLOTS.iter().all(|plot| {
            let half = DESIGNS[plot.design].half;
            let (s, c) = libm::sincosf(plot.turn);
            let d = p - Vec2::from(plot.at);
            let local = Vec2::new(c * d.x - s * d.y, s * d.x + c * d.y).abs();
            local.x > half[0] + 1.0 || local.y > half[1] + 1.0
        });
        if off_road(p) > 0.95 && off_pond(p) > 1.4 && free && placed.len() < 190 {
            placed.push((p.to_array(), TAU * unit(523, i), 0.7 + 0.7 * unit(524, i)));
        }
    }
    placed
}
