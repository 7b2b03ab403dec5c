//! Parts of buildings: arcades, slabs with an opening, stairs.

use glam::{Vec2, Vec3};

use super::Geometry;
use super::swept::unit_circle;

/// A wall with round-headed openings, standing on piers: `bays` equal bays along X, centred at the origin, thick along Z.
///
/// The wall's underside between the openings is at `spring`, where the half circles begin; its top at `top`. Seen from the
/// front, every bay is `bay` wide with an opening of the given radius in its middle (`2 radius < bay`, `spring + radius < top`).
/// `overhang` lengthens both ends. Closed; one bay gives a single arch.
pub fn arcade_wall(
    bays: u32,
    bay: f32,
    radius: f32,
    [spring, top]: [f32; 2],
    thickness: f32,
    overhang: f32,
    segments: u32,
) -> Geometry {
    let n = segments.max(2);
    let half = 0.5 * thickness;
    let left = -0.5 * bay * bays as f32;
    // The lower outline from left to right; flags say which stretches belong to an arch.
    let mut outline: Vec<(Vec2, Option<Vec2>)> = vec![(Vec2::new(left - overhang, spring), None)];
    for b in 0..bays {
        let center = Vec2::new(left + bay * (b as f32 + 0.5), spring);
        for k in 0..=n {
            let d = unit_circle(n - k, 2 * n);
            outline.push((center + d * radius, Some(d)));
        }
    }
    outline.push((Vec2::new(-left + overhang, spring), None));
    // Springing points lie exactly on the wall's underside, whatever the rounding of the sine of 180°.
    for (p, _) in &mut outline {
        p.y = p.y.max(spring);
        if p.y < spring + 1e-5 {
            p.y = spring;
        }
    }
    let mut g = Geometry::new();
    for pair in outline.windows(2) {
        let ((a, da), (b, db)) = (pair[0], pair[1]);
        let p = |q: Vec2, z: f32| Vec3::new(q.x, q.y, z);
        let up = |q: Vec2, z: f32| Vec3::new(q.x, top, z);
        g.polygon(&[p(a, half), p(b, half), up(b, half), up(a, half)]);
        g.polygon(&[p(b, -half), p(a, -half), up(a, -half), up(b, -half)]);
        g.polygon(&[up(a, half), up(b, half), up(b, -half), up(a, -half)]);
        let below = [p(a, -half), p(b, -half), p(b, half), p(a, half)];
        match (da, db) {
            (Some(da), Some(db)) if a.distance(b) < bay && da != db && a.y.max(b.y) > spring => {
                // The soffit is smooth: its normals point at the arch's axis.
                let first = g.positions.len() as u32;
                for (corner, d) in below.into_iter().zip([da, db, db, da]) {
                    let around = radius * libm::atan2(f64::from(d.y), f64::from(d.x)) as f32;
                    g.vertex(corner, Vec3::new(-d.x, -d.y, 0.0).normalize(), Vec2::new(around, corner.z));
                }
                g.triangles.push([first, first + 1, first + 2]);
                g.triangles.push([first, first + 2, first + 3]);
            }
            _ => g.polygon(&below),
        }
    }
    let (a, b) = (outline[0].0, outline[outline.len() - 1].0);
    g.polygon(&[
        Vec3::new(a.x, spring, -half),
        Vec3::new(a.x, spring, half),
        Vec3::new(a.x, top, half),
        Vec3::new(a.x, top, -half),
    ]);
    g.polygon(&[
        Vec3::new(b.x, spring, half),
        Vec3::new(b.x, spring, -half),
        Vec3::new(b.x, top, -half),
        Vec3::new(b.x, top, half),
    ]);
    g
}

/// A level slab around a rectangular opening, centred on the Y axis: half extents of the outside and of the opening (x, z),
/// underside and top. Closed, mitred at the corners.
pub fn ring_slab(outer: Vec2, inner: Vec2, [bottom, top]: [f32; 2]) -> Geometry {
    ring_slab_faces(outer, inner, [bottom, top], [true; 4])
}

/// [`ring_slab`] with a choice of faces: top, underside, outside, inside.
pub fn ring_slab_faces(outer: Vec2, inner: Vec2, [bottom, top]: [f32; 2], faces: [bool; 4]) -> Geometry {
    let mut g = Geometry::new();
    // Counter-clockwise seen from above (+Y towards the eye, x right, z down).
    let corner = |half: Vec2, i: usize, y: f32| {
        let (x, z) = [(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0)][i % 4];
        Vec3::new(half.x * x, y, half.y * z)
    };
    for i in 0..4 {
        let o = |k: usize, y: f32| corner(outer, i + k, y);
        let n = |k: usize, y: f32| corner(inner, i + k, y);
        if faces[0] {
            g.polygon(&[o(0, top), o(1, top), n(1, top), n(0, top)]);
        }
        if faces[1] {
            g.polygon(&[n(0, bottom), n(1, bottom), o(1, bottom), o(0, bottom)]);
        }
        if faces[2] {
            g.polygon(&[o(0, bottom), o(1, bottom), o(1, top), o(0, top)]);
        }
        if faces[3] {
            g.polygon(&[n(1, bottom), n(0, bottom), n(0, top), n(1, top)]);
        }
    }
    g
}

/// A flight of stairs that climbs along +X from the origin, centred on z = 0, over an inclined underside `depth` metres
/// (measured upright) below the steps' inner corners; it reaches `sink` metres into the ground. Closed.
pub fn stairs(steps: u32, riser: f32, tread: f32, width: f32, depth: f32, sink: f32) -> Geometry {
    let half = 0.5 * width;
    let x = |i: u32| tread * i as f32;
    let top = |i: u32| riser * (i + 1) as f32;
    let under = |i: u32| (riser * i as f32 - depth).max(-sink);
    let mut g = Geometry::new();
    let p = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
    for i in 0..steps {
        let (x0, x1, y) = (x(i), x(i + 1), top(i));
        let (b0, b1) = (under(i), under(i + 1));
        let foot = if i == 0 { b0 } else { top(i - 1) };
        // Tread, riser, underside.
        g.polygon(&[p(x0, y, half), p(x1, y, half), p(x1, y, -half), p(x0, y, -half)]);
        g.polygon(&[p(x0, foot, -half), p(x0, foot, half), p(x0, y, half), p(x0, y, -half)]);
        g.polygon(&[p(x0, b0, -half), p(x1, b1, -half), p(x1, b1, half), p(x0, b0, half)]);
        // Sides: fans around the lower back corner, with a vertex where the step below meets this one.
        let mut side = vec![p(x1, b1, half), p(x1, y, half), p(x0, y, half)];
        if i > 0 {
            side.push(p(x0, foot, half));
        }
        side.push(p(x0, b0, half));
        g.polygon(&side);
        let other = side.iter().map(|&q| p(q.x, q.y, -half));
        let mut flipped: Vec<Vec3> = other.collect();
        flipped[1..].reverse();
        g.polygon(&flipped);
    }
    let (end, b, y) = (x(steps), under(steps), top(steps.max(1) - 1));
    g.polygon(&[p(end, b, half), p(end, b, -half), p(end, y, -half), p(end, y, half)]);
    g
}
