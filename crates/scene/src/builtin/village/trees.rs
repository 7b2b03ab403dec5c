//! Trees: a trunk with boughs, and leaves of one layer each.

use std::f32::consts::TAU;

use glam::{Vec2, Vec3};

use crate::builtin::Detail;
use crate::builtin::noise::unit;
use crate::builtin::shapes::{Frame, Geometry, circle, sweep};

/// A bar that tapers from its start to its end.
fn bough(points: &[Vec3], [thick, thin]: [f32; 2], sides: u32) -> Geometry {
    let last = (points.len() - 1).max(1) as f32;
    let frames: Vec<Frame> = points
        .iter()
        .enumerate()
        .map(|(i, &origin)| {
            let (a, b) = (points[i.saturating_sub(1)], points[(i + 1).min(points.len() - 1)]);
            let along = (b - a).normalize_or(Vec3::Y);
            let x = along.cross(Vec3::new(0.31, 0.2, 0.93)).normalize_or(Vec3::X);
            let scale = thick + (thin - thick) * i as f32 / last;
            Frame { origin, x: x * scale, y: along.cross(x) * scale }
        })
        .collect();
    sweep(&frames, &circle(1.0, sides), true, false)
}

/// A leaf: two triangles, folded a little along its middle.
fn leaf(g: &mut Geometry, root: Vec3, along: Vec3, face: Vec3, [long, wide]: [f32; 2]) {
    let side = along.cross(face).normalize_or(along.any_orthonormal_vector()) * (0.5 * wide);
    let face = side.cross(along).normalize_or(face);
    let middle = root + along * (0.45 * long) - face * (0.12 * wide);
    let corners = [root, middle + side, root + along * long, middle - side];
    let first = g.positions.len() as u32;
    // Lit from above: what is below is the same leaf's other side.
    let face = if face.y < 0.0 { -face } else { face };
    for (corner, uv) in
        corners.into_iter().zip([[0.0, 0.0], [wide, -0.5 * long], [0.0, -long], [-wide, -0.5 * long]])
    {
        g.vertex(corner, face, Vec2::from(uv));
    }
    for t in [[0, 1, 2], [0, 2, 3]] {
        let [a, b, c] = t.map(|v: usize| corners[v]);
        let flip = (b - a).cross(c - a).dot(face) < 0.0;
        let t = t.map(|v| first + v as u32);
        g.triangles.push(if flip { [t[0], t[2], t[1]] } else { t });
    }
}

fn direction(turn: f32, rise: f32) -> Vec3 {
    let ((s, c), (up, out)) = (libm::sincosf(turn), libm::sincosf(rise));
    Vec3::new(out * c, up, out * s)
}

/// A leafy tree of about 6 m: its wood and its leaves.
pub(super) fn leafy(seed: u32, detail: Detail) -> [Geometry; 2] {
    let (mut wood, mut leaves) = (Geometry::new(), Geometry::new());
    let sides = detail.facets(12, 5);
    let trunk: Vec<Vec3> = (0..=6)
        .map(|i| {
            let t = i as f32 / 6.0;
            Vec3::new(0.16 * libm::sinf(2.6 * t + seed as f32), -0.4 + 3.6 * t, 0.14 * libm::sinf(3.4 * t))
        })
        .collect();
    wood.append_at(&bough(&trunk, [0.24, 0.12], sides), Vec3::ZERO);
    let boughs = 9;
    let mut tips: Vec<(Vec3, f32)> = vec![(trunk[6] + Vec3::Y * 1.1, 1.15)];
    for i in 0..boughs {
        let r = |k: u32| unit(seed, 16 * i + k);
        let from = trunk[3 + (i % 4) as usize].lerp(trunk[2 + (i % 4) as usize], r(0));
        let d = direction(TAU * (i as f32 + 0.6 * r(1)) / boughs as f32 * 2.0, 0.45 + 0.5 * r(2));
        let long = 1.3 + 0.9 * r(3);
        let bend = from + d * (0.55 * long);
        let tip = from + d * long + Vec3::Y * (0.25 * long);
        wood.append_at(&bough(&[from, bend, tip], [0.085, 0.03], sides.div_ceil(2).max(4)), Vec3::ZERO);
        for k in 0..2 {
            let d = direction(TAU * r(5 + k), 0.3 + 0.7 * r(7 + k));
            let twig = bend.lerp(tip, 0.3 + 0.4 * k as f32);
            let end = twig + d * (0.7 + 0.3 * r(9 + k));
            wood.append_at(&bough(&[twig, end], [0.03, 0.012], 4), Vec3::ZERO);
            tips.push((end, 0.62 + 0.2 * r(11 + k)));
        }
        tips.push((tip, 0.8 + 0.3 * r(13)));
    }
    let each = detail.count(34, 5);
    // Fewer leaves are larger ones.
    let size = libm::sqrtf(34.0 / each as f32);
    for (c, &(center, radius)) in tips.iter().enumerate() {
        for i in 0..each {
            let r = |k: u32| unit(seed ^ 0x5a5a, (c as u32 * 64 + i) * 8 + k);
            let d = direction(TAU * r(0), 3.0 * (r(1) - 0.5));
            let root = center + d * (radius * libm::cbrtf(0.15 + 0.85 * r(2))) * Vec3::new(1.0, 0.72, 1.0);
            let along = (d + Vec3::new(r(3) - 0.5, r(4) - 0.9, r(5) - 0.5)).normalize_or(d);
            let face = Vec3::new(r(6) - 0.5, 0.8, r(7) - 0.5).normalize();
            leaf(&mut leaves, root, along, face, [0.3 * size, 0.19 * size]);
        }
    }
    [wood, leaves]
}

/// A fir of about 7 m: its trunk, and boughs whose sprays of needles are leaves.
pub(super) fn fir(seed: u32, detail: Detail) -> [Geometry; 2] {
    let (mut wood, mut needles) = (Geometry::new(), Geometry::new());
    let height = 7.0;
    wood.append_at(
        &bough(&[Vec3::Y * -0.4, Vec3::Y * 2.5, Vec3::Y * height], [0.2, 0.02], detail.facets(10, 5)),
        Vec3::ZERO,
    );
    let whorls = detail.facets(13, 5);
    for w in 0..whorls {
        let t = (w as f32 + 0.5) / whorls as f32;
        let y = 0.9 + (height - 1.2) * t;
        let reach = 2.0 * (1.0 - t) + 0.28;
        let count = 9;
        for i in 0..count {
            let r = |k: u32| unit(seed, (w * 16 + i) * 8 + k);
            let turn = TAU * (i as f32 + 0.5 * (w % 2) as f32 + 0.4 * r(0)) / count as f32;
            let out = direction(turn, 0.0);
            let side = Vec3::new(-out.z, 0.0, out.x);
            let long = reach * (0.82 + 0.3 * r(1));
            // A bough droops and lifts its tip; sprays stand along both of its sides.
            let curve = |s: f32| Vec3::Y * (y - 0.42 * long * s + 0.2 * long * s * s) + out * (long * s);
            let sprays = detail.facets(6, 2);
            let wide = 6.0 / sprays as f32;
            for k in 0..sprays {
                let s = (k as f32 + 0.7) / sprays as f32;
                let along = (curve(s) - curve(s - 0.1)).normalize_or(out);
                for hand in [-1.0_f32, 1.0] {
                    let d = (along * 0.75 + side * hand - Vec3::Y * 0.12).normalize();
                    let size = [0.34 * long * (1.15 - 0.75 * s) + 0.1, 0.085 * wide * (0.6 + 0.25 * long)];
                    leaf(&mut needles, curve(s - 0.06), d, Vec3::Y, size);
                }
            }
            leaf(
                &mut needles,
                curve(0.72),
                (curve(1.0) - curve(0.9)).normalize_or(out),
                Vec3::Y,
                [0.3 * long, 0.1 * wide],
            );
        }
    }
    [wood, needles]
}
