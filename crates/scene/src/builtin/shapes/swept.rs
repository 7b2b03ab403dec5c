//! Surfaces of revolution, and outlines swept along a path.

use std::f64::consts::TAU;

use glam::{Vec2, Vec3};

use super::Geometry;

/// A surface of revolution about the Y axis. `profile` lists (radius, height) from the bottom of the axis over the
/// outside to the top (and down again inside, for a vessel); ends off the axis are closed with discs. Joints of less than
/// about 40° are smooth, others creased. `segments ≥ 3` facets go around.
pub fn lathe(profile: &[Vec2], segments: u32) -> Geometry {
    const SMOOTH_COS: f32 = 0.77;
    let mut line: Vec<Vec2> = profile.to_vec();
    if let (Some(&first), Some(&last)) = (profile.first(), profile.last()) {
        if first.x > 0.0 {
            line.insert(0, Vec2::new(0.0, first.y));
        }
        if last.x > 0.0 {
            line.push(Vec2::new(0.0, last.y));
        }
    }
    line.dedup();
    let segments = segments.max(3);
    let directions: Vec<Vec2> = (0..segments).map(|j| unit_circle(j, segments)).collect();
    let widest = line.iter().fold(0.0_f32, |r, p| r.max(p.x));
    let outward = |a: Vec2, b: Vec2| Vec2::new(b.y - a.y, a.x - b.x).normalize_or(Vec2::X);
    let mut g = Geometry::new();
    let ring = |g: &mut Geometry, p: Vec2, n: Vec2, v: f32| -> u32 {
        let first = g.positions.len() as u32;
        for j in 0..=segments {
            let d = directions[(j % segments) as usize];
            let u = widest * std::f32::consts::TAU * j as f32 / segments as f32;
            let normal = Vec3::new(n.x * d.x, n.y, -n.x * d.y).normalize();
            g.vertex(Vec3::new(p.x * d.x, p.y, -p.x * d.y), normal, Vec2::new(u, -v));
        }
        first
    };
    let mut v = 0.0;
    let mut smooth_end: Option<u32> = None;
    for i in 0..line.len().saturating_sub(1) {
        let (a, b) = (line[i], line[i + 1]);
        let n = outward(a, b);
        let start = smooth_end.take().unwrap_or_else(|| ring(&mut g, a, n, v));
        v += a.distance(b);
        let next = line.get(i + 2).map(|&c| outward(b, c)).filter(|m| m.dot(n) > SMOOTH_COS);
        let end = ring(&mut g, b, next.map_or(n, |m| (m + n).normalize()), v);
        if next.is_some() {
            smooth_end = Some(end);
        }
        for j in 0..segments {
            let (a0, a1, b0, b1) = (start + j, start + j + 1, end + j, end + j + 1);
            if a.x > 0.0 {
                g.triangles.push([a0, a1, if b.x > 0.0 { b1 } else { b0 }]);
            }
            if b.x > 0.0 {
                g.triangles.push([a0, b1, b0]);
            }
        }
    }
    g
}

/// A place on a path: the outline's axes there. `x × y` points along the path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Where the outline's origin lies.
    pub origin: Vec3,
    /// The outline's first axis.
    pub x: Vec3,
    /// The outline's second axis.
    pub y: Vec3,
}

/// Sweeps a convex outline (counter-clockwise in x, y) along a path. With `round` the outline is shaded smooth, otherwise
/// each edge is a flat strip; along the path shading is smooth. A `closed` path joins its end to its start; others are capped.
pub fn sweep(path: &[Frame], outline: &[Vec2], round: bool, closed: bool) -> Geometry {
    let mut g = Geometry::new();
    let n = outline.len();
    if path.len() < 2 || n < 3 {
        return g;
    }
    let at = |f: &Frame, p: Vec2| f.origin + f.x * p.x + f.y * p.y;
    let edge_normal = |k: usize| {
        let e = outline[(k + 1) % n] - outline[k % n];
        Vec2::new(e.y, -e.x).normalize_or(Vec2::X)
    };
    let mut way = vec![0.0_f32];
    for pair in path.windows(2) {
        way.push(way[way.len() - 1] + pair[0].origin.distance(pair[1].origin));
    }
    if closed {
        way.push(way[way.len() - 1] + path[path.len() - 1].origin.distance(path[0].origin));
    }
    let rings = way.len();
    let mut around = 0.0;
    for k in 0..n {
        let (p, q) = (outline[k], outline[(k + 1) % n]);
        let flat = edge_normal(k);
        let (np, nq) = match round {
            true => ((flat + edge_normal(k + n - 1)).normalize(), (flat + edge_normal(k + 1)).normalize()),
            false => (flat, flat),
        };
        let next = around + p.distance(q);
        let first = g.positions.len() as u32;
        for (i, &w) in way.iter().enumerate() {
            let f = &path[i % path.len()];
            for (corner, normal, u) in [(p, np, around), (q, nq, next)] {
                let normal = (f.x * normal.x + f.y * normal.y).normalize();
                g.vertex(at(f, corner), normal, Vec2::new(u, -w));
            }
        }
        for i in 0..rings as u32 - 1 {
            let (a0, a1, b0, b1) = (first + 2 * i, first + 2 * i + 1, first + 2 * i + 2, first + 2 * i + 3);
            g.triangles.push([a0, a1, b1]);
            g.triangles.push([a0, b1, b0]);
        }
        around = next;
    }
    if !closed {
        let start: Vec<Vec3> = outline.iter().rev().map(|&p| at(&path[0], p)).collect();
        g.polygon(&start);
        let end: Vec<Vec3> = outline.iter().map(|&p| at(&path[path.len() - 1], p)).collect();
        g.polygon(&end);
    }
    g
}

/// A round bar along points (no two neighbours equal); corners are mitred. `sides ≥ 3`.
pub fn tube(points: &[Vec3], radius: f32, sides: u32) -> Geometry {
    let direction = |i: usize| (points[i + 1] - points[i]).normalize_or(Vec3::Y);
    let last = points.len().saturating_sub(1);
    if last == 0 {
        return Geometry::new();
    }
    let mut x = direction(0).any_orthonormal_vector();
    let mut frames = Vec::with_capacity(points.len());
    for (i, &origin) in points.iter().enumerate() {
        let before = direction(i.max(1) - 1);
        let after = direction(i.min(last - 1));
        let tangent = (before + after).normalize_or(after);
        x = (x - tangent * tangent.dot(x)).normalize_or(tangent.any_orthonormal_vector());
        let y = tangent.cross(x);
        // Mitre: stretch across the corner so that the bar keeps its thickness.
        let bend = after - before;
        let stretch = 1.0 / tangent.dot(after).max(0.3);
        let widen = |axis: Vec3| match bend.try_normalize() {
            Some(b) => axis + b * (axis.dot(b) * (stretch - 1.0)),
            None => axis,
        };
        frames.push(Frame { origin, x: widen(x), y: widen(y) });
    }
    sweep(&frames, &circle(radius, sides), true, false)
}

/// A circle as an outline, counter-clockwise.
pub fn circle(radius: f32, sides: u32) -> Vec<Vec2> {
    let sides = sides.max(3);
    (0..sides).map(|j| unit_circle(j, sides) * radius).collect()
}

/// A rectangle as an outline, counter-clockwise.
pub fn rectangle(min: Vec2, max: Vec2) -> Vec<Vec2> {
    vec![min, Vec2::new(max.x, min.y), max, Vec2::new(min.x, max.y)]
}

/// Frames along the upper half of a circle in the XY plane, from +X over +Y to −X: x points outward, y along −Z.
pub fn arc_frames(center: Vec3, radius: f32, segments: u32) -> Vec<Frame> {
    let n = segments.max(1);
    (0..=n)
        .map(|i| {
            let d = unit_circle(i, 2 * n);
            let outward = Vec3::new(d.x, d.y, 0.0);
            Frame { origin: center + outward * radius, x: outward, y: Vec3::NEG_Z }
        })
        .collect()
}

/// Cosine and sine of `i / n` of a full turn, the same bits on every machine.
pub(super) fn unit_circle(i: u32, n: u32) -> Vec2 {
    let angle = TAU * f64::from(i) / f64::from(n);
    Vec2::new(libm::cos(angle) as f32, libm::sin(angle) as f32)
}
