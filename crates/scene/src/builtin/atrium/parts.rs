//! The atrium's fabric as geometry, each piece about its own origin.

use glam::{Vec2, Vec3};

use super::plan::*;
use crate::builtin::Detail;
use crate::builtin::profile::{block, rounded, turned, v2};
use crate::builtin::shapes::*;

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
