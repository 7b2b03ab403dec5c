//! The atrium's pieces as geometry, each about its own origin.

use std::f32::consts::FRAC_PI_2;

use glam::{Affine3A, Quat, Vec2, Vec3};

use super::plan::*;
use crate::builtin::Detail;
use crate::builtin::noise::unit;
use crate::builtin::shapes::*;

fn v2(x: f32, y: f32) -> Vec2 {
    Vec2::new(x, y)
}

/// A box with cut edges at high detail, a plain one otherwise.
fn block(detail: Detail, min: Vec3, max: Vec3, bevel: f32) -> Geometry {
    if detail.0 >= 0.4 { beveled_box(min, max, bevel) } else { cuboid(min, max) }
}

/// A surface of revolution whose profile loses what is finer than the detail.
fn turned(detail: Detail, profile: &[Vec2], segments: u32) -> Geometry {
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
fn rounded(points: &[Vec2], pieces: u32) -> Vec<Vec2> {
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

/// A column from its plinth to its abacus; it stands 2 cm in the ground and reaches 2 cm into what it carries.
fn column(height: f32, foot: f32, head: f32, [segments, bend]: [u32; 2], detail: Detail) -> Geometry {
    let (plinth, abacus) = (0.16 * foot / 0.24, 0.12 * foot / 0.24);
    let (base, top) = (plinth, height - abacus);
    let torus = |y: f32, r: f32, h: f32| [v2(r, y), v2(r + 0.5 * h, y + 0.5 * h), v2(r, y + h)];
    let s = foot / 0.24;
    let mut profile = vec![v2(0.0, base - 0.02)];
    profile.extend(rounded(&torus(base - 0.02, foot * 1.12, 0.11 * s), bend));
    profile.extend(rounded(&torus(base + 0.10 * s, foot * 1.04, 0.07 * s), bend));
    let shaft = [
        v2(foot * 1.03, base + 0.20 * s),
        v2(foot, base + 0.30 * s),
        v2(foot * 0.985, base + 0.4 * (top - base)),
        v2(head, top - 0.40 * s),
    ];
    profile.extend(rounded(&shaft, bend));
    profile.extend(rounded(&torus(top - 0.38 * s, head * 1.02, 0.05 * s), bend.div_ceil(2)));
    let bell = [
        v2(head, top - 0.32 * s),
        v2(head * 1.02, top - 0.2 * s),
        v2(head * 1.18, top - 0.08 * s),
        v2(head * 1.5, top),
        v2(head * 1.52, top + 0.02),
    ];
    profile.extend(rounded(&bell, bend));
    profile.push(v2(0.0, top + 0.02));
    let mut g = turned(detail, &profile, segments);
    let square = |half: f32, y0: f32, y1: f32| {
        block(detail, Vec3::new(-half, y0, -half), Vec3::new(half, y1, half), 0.018)
    };
    g.append_at(&square(foot * 1.29, -0.02, plinth), Vec3::ZERO);
    g.append_at(&square(head * 1.36, top, height + 0.02), Vec3::ZERO);
    g
}

/// A column of the lower arcade.
pub(super) fn lower_column(detail: Detail) -> Geometry {
    column(SPRING, 0.24, 0.205, [detail.facets(26, 8), detail.facets(3, 1)], detail)
}

/// A column of the gallery, its foot at y = 0.
pub(super) fn upper_column(detail: Detail) -> Geometry {
    column(BEAM_BOTTOM - GALLERY, 0.165, 0.135, [detail.facets(20, 6), detail.facets(2, 1)], detail)
}

/// The arcade's wall over a number of bays, along X; it reaches 5 cm into the slab above.
pub(super) fn arcade(bays: u32, overhang: f32, detail: Detail) -> Geometry {
    let heights = [SPRING, SLAB_BOTTOM + 0.05];
    arcade_wall(bays, BAY, ARCH_RADIUS, heights, ARCADE_THICKNESS, overhang, detail.facets(28, 6))
}

/// Moulding around an arch on both faces of the wall, with a keystone: about the arch's springing line, along X.
pub(super) fn archivolt(detail: Detail) -> Geometry {
    let mut g = Geometry::new();
    let half = 0.5 * ARCADE_THICKNESS;
    // Rises from the opening to a lip at its outer edge, 1 cm of it inside the wall. The outline's y axis points along −Z.
    let outline = [v2(0.0, -0.01), v2(0.17, -0.01), v2(0.17, 0.05), v2(0.13, 0.05), v2(0.0, 0.022)];
    for side in [-1.0, 1.0] {
        let mut outline = outline.map(|p| v2(p.x, -side * p.y));
        if side > 0.0 {
            outline.reverse();
        }
        let center = Vec3::new(0.0, SPRING, side * half);
        let frames = arc_frames(center, ARCH_RADIUS + 0.02, detail.facets(24, 6));
        g.append_at(&sweep(&frames, &outline, false, false), Vec3::ZERO);
    }
    let crown = SPRING + ARCH_RADIUS;
    let key = block(
        detail,
        Vec3::new(-0.1, crown - 0.05, -half - 0.085),
        Vec3::new(0.1, crown + 0.26, half + 0.085),
        0.02,
    );
    g.append_at(&key, Vec3::ZERO);
    g
}

/// A railing between two columns, along X, its foot at y = 0: thin turned bars, a bottom rail and a handrail.
pub(super) fn railing(detail: Detail) -> Geometry {
    let mut g = Geometry::new();
    let half = 0.5 * BAY - 0.1;
    let bars = detail.count(15, 4);
    let sides = detail.facets(6, 4);
    let bar = turned(
        detail,
        &[
            v2(0.009, 0.05),
            v2(0.009, 0.36),
            v2(0.016, 0.42),
            v2(0.020, 0.47),
            v2(0.016, 0.52),
            v2(0.009, 0.58),
            v2(0.009, RAIL_HEIGHT - 0.02),
        ],
        sides,
    );
    for i in 0..bars {
        let x = 2.0 * half * ((i as f32 + 0.5) / bars as f32 - 0.5);
        g.append_at(&bar, Vec3::new(x, 0.0, 0.0));
    }
    let rail =
        |y: f32, radius: f32| tube(&[Vec3::new(-half, y, 0.0), Vec3::new(half, y, 0.0)], radius, sides + 2);
    g.append_at(&rail(0.06, 0.014), Vec3::ZERO);
    g.append_at(&rail(RAIL_HEIGHT - 0.13, 0.010), Vec3::ZERO);
    g.append_at(&rail(RAIL_HEIGHT, 0.026), Vec3::ZERO);
    g
}

/// The railing of one side of a flight that climbs along +X from the origin: thin bars, posts at both ends, a handrail.
pub(super) fn stair_railing(detail: Detail) -> Geometry {
    let mut g = Geometry::new();
    let sides = detail.facets(10, 4);
    let step = |i: f32| Vec3::new(TREAD * i, RISER * (i + 0.5), 0.0);
    let every = if detail.0 >= 0.5 { 1 } else { 3 };
    for i in (1..STEPS).step_by(every) {
        let at = step(i as f32 + 0.5);
        let foot = RISER * (i + 1) as f32 - 0.01;
        g.append_at(&tube(&[Vec3::new(at.x, foot, 0.0), at + Vec3::Y * 0.86], 0.009, sides), Vec3::ZERO);
    }
    let (first, last) = (step(0.6), step(STEPS as f32 - 0.15));
    let rise = Vec3::Y * 0.88;
    let path = [
        first + rise - Vec3::new(0.22, 0.10, 0.0),
        first + rise,
        last + rise,
        last + rise + Vec3::new(0.30, 0.14, 0.0),
    ];
    g.append_at(&tube(&path, 0.026, sides + 2), Vec3::ZERO);
    let lower = Vec3::Y * 0.16;
    g.append_at(&tube(&[first + lower, last + lower], 0.010, sides), Vec3::ZERO);
    let post = turned(
        detail,
        &[
            v2(0.035, -0.01),
            v2(0.035, 0.1),
            v2(0.022, 0.16),
            v2(0.022, 0.82),
            v2(0.04, 0.86),
            v2(0.045, 0.92),
            v2(0.0, 0.99),
        ],
        detail.facets(16, 6),
    );
    g.append_at(&post, Vec3::new(first.x, RISER, 0.0));
    g.append_at(&post, Vec3::new(last.x, RISER * STEPS as f32, 0.0));
    g
}

/// A slender vase with a neck, hollow.
pub(super) fn vase([segments, bend]: [u32; 2], detail: Detail) -> Geometry {
    let outside = [
        v2(0.13, 0.0),
        v2(0.15, 0.04),
        v2(0.22, 0.22),
        v2(0.265, 0.45),
        v2(0.20, 0.66),
        v2(0.105, 0.77),
        v2(0.11, 0.84),
        v2(0.165, 0.9),
    ];
    let inside =
        [v2(0.145, 0.895), v2(0.09, 0.83), v2(0.085, 0.77), v2(0.17, 0.66), v2(0.22, 0.45), v2(0.0, 0.3)];
    let mut profile = vec![v2(0.0, -0.01), v2(0.13, -0.01)];
    profile.extend(rounded(&outside, bend));
    profile.extend(rounded(&inside, bend.div_ceil(2)));
    turned(detail, &profile, segments)
}

/// A wide pot with a thick rim, filled with earth.
pub(super) fn pot(detail: Detail) -> Geometry {
    let bend = detail.facets(4, 1);
    let outside = [v2(0.24, 0.0), v2(0.29, 0.08), v2(0.36, 0.28), v2(0.385, 0.42)];
    let rim = [v2(0.40, 0.43), v2(0.425, 0.45), v2(0.425, 0.53), v2(0.40, 0.55), v2(0.36, 0.54)];
    let mut profile = vec![v2(0.0, -0.01), v2(0.24, -0.01)];
    profile.extend(rounded(&outside, bend));
    profile.extend(rounded(&rim, bend.div_ceil(2)));
    profile.extend([v2(0.34, 0.47), v2(0.2, 0.485), v2(0.0, 0.5)]);
    turned(detail, &profile, detail.facets(28, 8))
}

/// Long leaves that rise from a pot and bend over; each leaf is a closed, thin blade.
pub(super) fn leaves(seed: u32, detail: Detail) -> Geometry {
    let mut g = Geometry::new();
    let count = detail.count(22, 6);
    let segments = detail.facets(8, 3);
    for leaf in 0..count {
        let r = |k: u32| unit(seed, leaf * 8 + k);
        let turn = std::f32::consts::TAU * (leaf as f32 + 0.7 * r(0)) / count as f32 * 3.0;
        let (length, lean) = (0.75 + 0.5 * r(1), 0.25 + 0.75 * r(2));
        let wide = 0.028 + 0.03 * r(3);
        let forward = Vec3::new(libm::cosf(turn), 0.0, -libm::sinf(turn));
        let side = Vec3::new(forward.z, 0.0, -forward.x);
        let frames: Vec<Frame> = (0..=segments)
            .map(|i| {
                let t = i as f32 / segments as f32;
                let angle = FRAC_PI_2 - lean * (0.25 + 1.7 * t * t);
                // Height and reach of an arc whose slope falls along the blade.
                let (reach, rise) = (lean * t * t * 0.8 * length, length * (t - 0.42 * lean * t * t * t));
                let along = forward * libm::cosf(angle) + Vec3::Y * libm::sinf(angle);
                let width = wide * (0.35 + 2.6 * t * (1.0 - t)) * (1.0 - 0.85 * t * t);
                let origin = forward * (0.05 + 0.1 * r(4) + reach) + Vec3::Y * (0.42 + rise);
                Frame { origin, x: side * (width / wide), y: along.cross(side) }
            })
            .collect();
        g.append_at(
            &sweep(&frames, &rectangle(v2(-wide, -0.002), v2(wide, 0.002)), false, false),
            Vec3::ZERO,
        );
    }
    g
}

/// A wooden crate of 0.8 m: panels inside a frame of bars.
pub(super) fn crate_box(detail: Detail) -> Geometry {
    let h = 0.4;
    let mut g = cuboid(Vec3::new(-h + 0.03, 0.02, -h + 0.03), Vec3::new(h - 0.03, 0.78, h - 0.03));
    let bar = |g: &mut Geometry, a: Vec3, b: Vec3| {
        g.append_at(&block(detail, a.min(b), a.max(b), 0.008), Vec3::ZERO)
    };
    for s in [-1.0, 1.0] {
        for t in [-1.0, 1.0] {
            let corner = |y: f32, inset: f32| Vec3::new(s * (h - inset), y, t * (h - inset));
            bar(&mut g, corner(0.0, 0.0), corner(0.8, 0.085));
            for y in [0.004, 0.711] {
                bar(
                    &mut g,
                    Vec3::new(-h + 0.08, y, t * (h - 0.006)),
                    Vec3::new(h - 0.08, y + 0.085, t * (h - 0.06)),
                );
                bar(
                    &mut g,
                    Vec3::new(s * (h - 0.006), y, -h + 0.08),
                    Vec3::new(s * (h - 0.06), y + 0.085, h - 0.08),
                );
            }
        }
        let brace = block(detail, Vec3::new(-0.44, -0.04, -0.02), Vec3::new(0.44, 0.04, 0.02), 0.006);
        for turn in [0.0, FRAC_PI_2] {
            let face = Affine3A::from_rotation_translation(
                Quat::from_rotation_y(turn),
                Quat::from_rotation_y(turn) * Vec3::new(0.0, 0.4, s * (h - 0.022)),
            );
            g.append(&brace, &(face * Affine3A::from_rotation_z(s * 0.76)));
        }
    }
    g
}

/// A table of 1.8 × 0.8 m with turned legs.
pub(super) fn table(detail: Detail) -> Geometry {
    let mut g = block(detail, Vec3::new(-0.9, 0.71, -0.4), Vec3::new(0.9, 0.76, 0.4), 0.012);
    g.append_at(&cuboid(Vec3::new(-0.78, 0.60, -0.30), Vec3::new(0.78, 0.715, 0.30)), Vec3::ZERO);
    let leg = turned(
        detail,
        &rounded(
            &[
                v2(0.022, -0.005),
                v2(0.03, 0.05),
                v2(0.024, 0.12),
                v2(0.042, 0.3),
                v2(0.03, 0.5),
                v2(0.045, 0.56),
                v2(0.045, 0.712),
            ],
            detail.facets(3, 1),
        ),
        detail.facets(16, 6),
    );
    for x in [-0.8, 0.8] {
        for z in [-0.32, 0.32] {
            g.append_at(&leg, Vec3::new(x, 0.0, z));
        }
    }
    g
}

/// A stone bench of 1.7 × 0.42 m on two blocks.
pub(super) fn bench(detail: Detail) -> Geometry {
    let mut g = block(detail, Vec3::new(-0.85, 0.36, -0.21), Vec3::new(0.85, 0.45, 0.21), 0.02);
    for x in [-0.55, 0.55] {
        g.append_at(
            &block(detail, Vec3::new(-0.11, -0.01, -0.16), Vec3::new(0.11, 0.37, 0.16), 0.015),
            Vec3::X * x,
        );
    }
    g
}

/// The fountain's stone: a basin with a stem and a bowl in its middle.
pub(super) fn fountain(detail: Detail) -> Geometry {
    let bend = detail.facets(5, 1);
    let [radius, height] = FOUNTAIN;
    let mut profile = vec![v2(0.0, -0.02), v2(radius - 0.05, -0.02), v2(radius - 0.05, 0.08)];
    profile
        .extend(rounded(&[v2(radius - 0.12, 0.14), v2(radius - 0.14, 0.26), v2(radius - 0.08, 0.34)], bend));
    profile.extend(rounded(&[v2(radius - 0.02, 0.36), v2(radius, 0.40), v2(radius - 0.02, height)], bend));
    profile.extend([v2(radius - 0.18, height), v2(radius - 0.2, height - 0.2), v2(0.16, height - 0.2)]);
    profile.extend(rounded(&[v2(0.14, 0.3), v2(0.10, 0.55), v2(0.09, 0.75), v2(0.14, 0.95)], bend));
    profile.extend(rounded(&[v2(0.2, 1.0), v2(0.38, 1.12), v2(0.44, 1.24), v2(0.42, 1.26)], bend));
    profile.extend(rounded(&[v2(0.40, 1.25), v2(0.2, 1.13), v2(0.05, 1.1)], bend));
    profile.extend([v2(0.04, 1.3), v2(0.0, 1.35)]);
    turned(detail, &profile, detail.facets(56, 10))
}

/// The fountain's water: a thin disc that reaches into basin and stem.
pub(super) fn water(detail: Detail) -> Geometry {
    let r = FOUNTAIN[0] - 0.185;
    turned(detail, &[v2(r, FOUNTAIN[1] - 0.16), v2(r, FOUNTAIN[1] - 0.07)], detail.facets(56, 10))
}

/// A lattice screen's frame of 2.1 × 2.3 m along X.
pub(super) fn screen_frame(detail: Detail) -> Geometry {
    let mut g = Geometry::new();
    for x in [-1.02, 0.0, 1.02] {
        g.append_at(
            &block(detail, Vec3::new(x - 0.03, -0.01, -0.03), Vec3::new(x + 0.03, 2.3, 0.03), 0.006),
            Vec3::ZERO,
        );
    }
    for y in [0.05, 0.75, 2.2] {
        g.append_at(
            &block(detail, Vec3::new(-1.0, y, -0.024), Vec3::new(1.0, y + 0.07, 0.024), 0.006),
            Vec3::ZERO,
        );
    }
    g
}

/// A lattice screen's filling: one layer.
pub(super) fn screen_filling() -> Geometry {
    let mut g = Geometry::new();
    g.polygon(&[
        Vec3::new(-1.0, 0.1, 0.0),
        Vec3::new(1.0, 0.1, 0.0),
        Vec3::new(1.0, 2.22, 0.0),
        Vec3::new(-1.0, 2.22, 0.0),
    ]);
    g
}

/// A curtain, hung from y = 0.
pub(super) fn curtain(which: u32, detail: Detail) -> Geometry {
    let (width, folds) = if which == 0 { (0.85, 6.0) } else { (1.1, 8.0) };
    cloth(
        width,
        BEAM_BOTTOM - GALLERY - 0.22,
        folds,
        0.16,
        [detail.facets(72, 20), detail.facets(14, 3)],
        100 + which,
    )
}

/// A long banner on the hall's side, hung from y = 0.
pub(super) fn banner(detail: Detail) -> Geometry {
    cloth(0.85, 2.9, 2.5, 0.07, [detail.facets(28, 8), detail.facets(20, 3)], 300)
}

/// A rod along X across one bay, 1 m per unit.
pub(super) fn rod(half: f32, detail: Detail) -> Geometry {
    tube(&[Vec3::X * -half, Vec3::X * half], 0.016, detail.facets(10, 4))
}

/// A lantern's metal, hung from y = 0: a chain as a thin rod, a dome, a ring with four bars, a finial.
pub(super) fn lantern_metal(detail: Detail) -> Geometry {
    let bend = detail.facets(5, 1);
    let sides = detail.facets(18, 6);
    let mut g = tube(&[Vec3::Y * 0.01, Vec3::Y * -0.47], 0.006, detail.facets(8, 3));
    let mut dome = rounded(&[v2(0.155, -0.60), v2(0.12, -0.53), v2(0.05, -0.48), v2(0.018, -0.45)], bend);
    dome.push(v2(0.0, -0.45));
    let mut profile = vec![v2(0.0, -0.59), v2(0.14, -0.60)];
    profile.append(&mut dome);
    g.append_at(&turned(detail, &profile, sides), Vec3::ZERO);
    let foot =
        rounded(&[v2(0.0, -0.93), v2(0.02, -0.91), v2(0.03, -0.88), v2(0.10, -0.84), v2(0.105, -0.82)], bend);
    let mut foot = foot;
    foot.push(v2(0.0, -0.82));
    g.append_at(&turned(detail, &foot, sides), Vec3::ZERO);
    for i in 0..4 {
        let turn = Quat::from_rotation_y(FRAC_PI_2 * i as f32);
        let bar = tube(&[turn * Vec3::new(0.135, -0.59, 0.0), turn * Vec3::new(0.095, -0.83, 0.0)], 0.007, 4);
        g.append_at(&bar, Vec3::ZERO);
    }
    g
}

/// A lantern's glowing glass.
pub(super) fn lantern_glass(detail: Detail) -> Geometry {
    let bend = detail.facets(4, 1);
    let profile = rounded(&[v2(0.05, -0.815), v2(0.075, -0.76), v2(0.085, -0.68), v2(0.06, -0.61)], bend);
    turned(detail, &profile, detail.facets(20, 6))
}

/// A spot light's housing around the origin, open towards −Z.
pub(super) fn spot_housing(detail: Detail) -> Geometry {
    let profile = [
        v2(0.0, -0.06),
        v2(0.07, -0.06),
        v2(0.105, 0.02),
        v2(0.11, 0.16),
        v2(0.10, 0.16),
        v2(0.095, 0.03),
        v2(0.0, 0.0),
    ];
    let mut g = Geometry::new();
    // The lathe's axis becomes −Z, its mouth just behind the light.
    let turn = Affine3A::from_rotation_translation(Quat::from_rotation_x(-FRAC_PI_2), Vec3::Z * 0.17);
    g.append(&turned(detail, &profile, detail.facets(24, 6)), &turn);
    g
}

/// A pilaster on a wall that faces +Z, from the floor to `height`, reaching 2 cm into the wall.
pub(super) fn pilaster(height: f32, detail: Detail) -> Geometry {
    let mut g = Geometry::new();
    let mut part = |half: f32, y0: f32, y1: f32, deep: f32| {
        g.append_at(&block(detail, Vec3::new(-half, y0, -0.02), Vec3::new(half, y1, deep), 0.01), Vec3::ZERO);
    };
    part(0.14, 0.2, height - 0.1, 0.08);
    part(0.19, -0.01, 0.22, 0.13);
    part(0.165, height - 0.32, height - 0.26, 0.11);
    part(0.20, height - 0.14, height + 0.02, 0.15);
    g
}

/// A double door in a wall that faces +Z: frame, leaves with panels.
pub(super) fn door(detail: Detail) -> Geometry {
    let mut g = Geometry::new();
    let mut piece = |x0: f32, y0: f32, x1: f32, y1: f32, z0: f32, z1: f32| {
        g.append_at(&block(detail, Vec3::new(x0, y0, z0), Vec3::new(x1, y1, z1), 0.01), Vec3::ZERO);
    };
    piece(-0.92, -0.01, -0.76, 2.32, -0.02, 0.10);
    piece(0.76, -0.01, 0.92, 2.32, -0.02, 0.10);
    piece(-1.0, 2.30, 1.0, 2.5, -0.02, 0.14);
    for x in [-0.385, 0.385] {
        piece(x - 0.38, -0.005, x + 0.38, 2.31, -0.02, 0.03);
        for (y0, y1) in [(0.2, 0.95), (1.1, 1.5), (1.65, 2.18)] {
            piece(x - 0.26, y0, x + 0.26, y1, 0.02, 0.055);
        }
    }
    g
}

/// A picture's frame on a wall that faces +Z, about the picture's centre.
pub(super) fn picture_frame(width: f32, height: f32) -> Geometry {
    let (w, h, b) = (0.5 * width, 0.5 * height, 0.09);
    let mut g = Geometry::new();
    // Mitred: a rectangle swept around the picture.
    let corner = |x: f32, y: f32| Frame {
        origin: Vec3::new(x * w, y * h, 0.0),
        x: Vec3::new(x, y, 0.0),
        y: Vec3::NEG_Z,
    };
    let path = [corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0), corner(-1.0, -1.0)];
    g.append_at(&sweep(&path, &rectangle(v2(0.0, -0.06), v2(b, 0.02)), false, true), Vec3::ZERO);
    g
}

/// A picture's canvas in [`picture_frame`].
pub(super) fn picture_canvas(width: f32, height: f32) -> Geometry {
    let (w, h) = (0.5 * width + 0.02, 0.5 * height + 0.02);
    cuboid(Vec3::new(-w, -h, -0.03), Vec3::new(w, h, 0.03))
}

/// A spot light's stem: from the light's pivot at the origin up to the ceiling, `height` metres above.
pub(super) fn spot_stem(height: f32, detail: Detail) -> Geometry {
    let mut g = tube(&[Vec3::new(0.0, 0.0, 0.0), Vec3::Y * (height + 0.01)], 0.014, detail.facets(10, 4));
    g.append_at(
        &cuboid(Vec3::new(-0.06, height - 0.03, -0.06), Vec3::new(0.06, height + 0.01, 0.06)),
        Vec3::ZERO,
    );
    g
}

/// The skylight's beams: five across, one along, all ends inside the curb.
pub(super) fn skylight_beams(detail: Detail) -> Geometry {
    let mut g = Geometry::new();
    for i in -2..=2_i32 {
        let x = BAY * i as f32;
        let beam = block(
            detail,
            Vec3::new(x - 0.09, CEILING + 0.12, -SKYLIGHT.y - 0.05),
            Vec3::new(x + 0.09, CEILING + 0.40, SKYLIGHT.y + 0.05),
            0.015,
        );
        g.append_at(&beam, Vec3::ZERO);
    }
    for z in [-0.9, 0.9] {
        let purlin = block(
            detail,
            Vec3::new(-SKYLIGHT.x - 0.05, CEILING + 0.34, z - 0.05),
            Vec3::new(SKYLIGHT.x + 0.05, CEILING + 0.48, z + 0.05),
            0.012,
        );
        g.append_at(&purlin, Vec3::ZERO);
    }
    g
}

/// The room's shell, seen from inside only: floor, walls, ceiling with the curb of its opening.
pub(super) fn shell() -> [Geometry; 3] {
    let (x, z) = (ROOM.x, ROOM.y);
    let mut floor = Geometry::new();
    floor.polygon(&[
        Vec3::new(-x, 0.0, z),
        Vec3::new(x, 0.0, z),
        Vec3::new(x, 0.0, -z),
        Vec3::new(-x, 0.0, -z),
    ]);
    let mut walls = Geometry::new();
    let corners = [Vec2::new(-x, z), Vec2::new(-x, -z), Vec2::new(x, -z), Vec2::new(x, z)];
    for i in 0..4 {
        let (a, b) = (corners[i], corners[(i + 1) % 4]);
        let p = |q: Vec2, y: f32| Vec3::new(q.x, y, q.y);
        walls.polygon(&[p(a, 0.0), p(b, 0.0), p(b, CEILING), p(a, CEILING)]);
    }
    let ceiling = ring_slab_faces(ROOM, SKYLIGHT, [CEILING, CURB_TOP], [false, true, false, true]);
    [floor, walls, ceiling]
}
