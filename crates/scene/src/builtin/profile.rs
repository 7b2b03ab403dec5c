//! Profiles of turned pieces, and pieces that lose their finest features at low detail.

use glam::{Vec2, Vec3};

use crate::builtin::Detail;
use crate::builtin::shapes::{Geometry, beveled_box, cuboid, lathe};

/// Short for a point of a profile.
pub(super) fn v2(x: f32, y: f32) -> Vec2 {
    Vec2::new(x, y)
}

/// A box with cut edges at high detail, a plain one otherwise.
pub(super) fn block(detail: Detail, min: Vec3, max: Vec3, bevel: f32) -> Geometry {
    if detail.0 >= 0.4 { beveled_box(min, max, bevel) } else { cuboid(min, max) }
}

/// A surface of revolution whose profile loses what is finer than the detail.
pub(super) fn turned(detail: Detail, profile: &[Vec2], segments: u32) -> Geometry {
    let tolerance = 0.005 * (1.0 / libm::sqrtf(detail.0) - 1.0);
    lathe(&simplified(profile, tolerance), segments)
}

/// A line with the points left out that are within `tolerance` metres of it (Douglas–Peucker).
fn simplified(line: &[Vec2], tolerance: f32) -> Vec<Vec2> {
    let (Some(&first), Some(&last)) = (line.first(), line.last()) else { return Vec::new() };
    let way = last - first;
    let distance = |p: Vec2| {
        let t = (p - first).dot(way) / way.length_squared().max(1e-12);
        p.distance(first + way * t.clamp(0.0, 1.0))
    };
    let mut farthest = (0, tolerance);
    for (i, &p) in line.iter().enumerate().take(line.len() - 1).skip(1) {
        if distance(p) > farthest.1 {
            farthest = (i, distance(p));
        }
    }
    match farthest {
        (0, _) => vec![first, last],
        (i, _) => {
            let mut kept = simplified(&line[..=i], tolerance);
            kept.pop();
            kept.extend(simplified(&line[i..], tolerance));
            kept
        }
    }
}

/// A curve through profile points as a run of shorter pieces: Catmull-Rom, `pieces` to each stretch.
pub(super) fn rounded(points: &[Vec2], pieces: u32) -> Vec<Vec2> {
    let at = |i: i64| points[i.clamp(0, points.len() as i64 - 1) as usize];
    let mut out = Vec::new();
    for i in 0..points.len() as i64 - 1 {
        for k in 0..pieces.max(1) {
            let t = k as f32 / pieces.max(1) as f32;
            let (a, b, c, d) = (at(i - 1), at(i), at(i + 1), at(i + 2));
            let p = 0.5
                * (b * 2.0
                    + (c - a) * t
                    + (a * 2.0 - b * 5.0 + c * 4.0 - d) * (t * t)
                    + (b * 3.0 - a - c * 3.0 + d) * (t * t * t));
            out.push(v2(p.x.max(0.0), p.y));
        }
    }
    out.extend(points.last());
    out
}
